"""Minimal fatal shocks: closed forms, symmetries, and the stable manifold of a saddle."""

from __future__ import annotations

from dataclasses import replace
from math import atan2, cos, pi, sin, sqrt
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import (
    Basins,
    CellGrid,
    angle,
    discrete_map,
    find_basins,
    find_periodic_orbits,
    stroboscopic_map,
)
from cellmap.analysis.boundary import saddle_manifold
from cellmap.analysis.resilience import (
    FatalShock,
    largest_ball,
    local_integrity,
    minimal_fatal_shock,
)
from cellmap.maps import inverse_stroboscopic_map
from systems import driven_pendulum

mpl.use("Agg")


def test_shock_that_the_window_does_not_show(line: Basins) -> None:
    """The window shows the boundary at 0, a distance of 1; but at sqrt(3), beyond it, orbits are thrown over."""
    shock = minimal_fatal_shock(line, 0, scale=1.0)
    assert shock.from_image == pytest.approx(1.005)
    assert shock.size == pytest.approx(sqrt(3.0) - 1.0, abs=1e-9)
    assert shock.bracket == pytest.approx((sqrt(3.0) - 1.0,) * 2, abs=1e-15)
    assert shock.bracket[0] <= shock.bracket[1]
    assert shock.reached == 1
    assert shock.end == pytest.approx([sqrt(3.0)])


def test_shock_out_of_a_disc(disc: Basins) -> None:
    shock = minimal_fatal_shock(disc, 0, scale=1.0)
    assert shock.size == pytest.approx(1.0, abs=1e-9)
    assert (shock.reached, shock.inside_fatal) == (-2, 0)
    assert shock.inside_high == pytest.approx(1.0 - 0.025 ** (1.0 / shock.tested))
    off = minimal_fatal_shock(disc, 0, point=(0.3, 0.4), scale=1.0)
    assert off.size == pytest.approx(0.5, abs=1e-9)
    assert atan2(off.shock[1], off.shock[0]) == pytest.approx(atan2(0.4, 0.3), abs=1e-4)


def test_scale_and_direction_of_a_shock(disc: Basins) -> None:
    flat = minimal_fatal_shock(disc, 0, scale=(1.0, 4.0))
    assert flat.size == pytest.approx(0.25, abs=1e-9)
    assert abs(flat.shock[1]) == pytest.approx(1.0, abs=1e-7)
    kicked = minimal_fatal_shock(disc, 0, point=(0.6, 0.0), scale=1.0, along=["y"])
    assert kicked.shock.tolist() == pytest.approx([0.0, kicked.shock[1]])
    assert kicked.size == pytest.approx(0.8, abs=1e-9)
    by_number = minimal_fatal_shock(disc, 0, point=(0.6, 0.0), scale=1.0, along=[1])
    assert by_number.size == kicked.size


def test_shock_out_of_a_ball_in_three_dimensions(disc_function: Any) -> None:
    ball = find_basins(discrete_map(disc_function, {}, ("x", "y", "z")), CellGrid((-1.3,) * 3, (1.3,) * 3, (16,) * 3))
    shock = minimal_fatal_shock(ball, 0, point=(0.0, 0.3, 0.0), scale=1.0)
    assert shock.size == pytest.approx(0.7, abs=1e-9)
    assert shock.shock == pytest.approx([0.0, 0.7, 0.0], abs=1e-4)


def test_shock_goes_the_shorter_way_round_a_circle() -> None:
    """x' = x + sin(x)/2 pulls to pi, the branch cut; its basin ends at 0, a bump bounds it in y at 1."""
    shift = discrete_map(
        lambda x, p: (x[0] + 0.5 * cos(x[0] - 2.5), 0.5 * x[1] * (1 + x[1] ** 2)), {}, (angle("a"), "y")
    )
    basins = find_basins(shift, CellGrid((-pi, -1.5), (pi, 1.5), (90, 60)))
    # Stable where the cosine falls through 0: at 2.5 + pi/2 - 2 pi; unstable half a circle away.
    assert basins.attractors[0].points[0] == pytest.approx([2.5 + pi / 2 - 2 * pi, 0.0], abs=1e-9)
    far = minimal_fatal_shock(basins, 0, point=(-pi + 0.01, 0.9), scale=(1.0, 1.0))
    assert far.size == pytest.approx(0.1, abs=1e-9)


@pytest.mark.parametrize("cut", [-pi, 0.0, 0.3, 17.0])
def test_shocks_do_not_depend_on_where_a_circle_is_cut(cut: float) -> None:
    """x' = x - 0.4 sin 2x: attractors at 0 and pi, half a circle of basin each."""
    halves = discrete_map(lambda x, p: (x[0] - 0.4 * sin(2.0 * x[0]), 0.5 * x[1]), {}, (angle("a", lower=cut), "y"))
    basins = find_basins(halves, CellGrid((cut, -1.0), (cut + 2 * pi, 1.0), (64, 20)))
    for k in (0, 1):
        assert minimal_fatal_shock(basins, k, scale=1.0, n_trials=256).size == pytest.approx(pi / 2, abs=1e-9)


def test_shock_out_of_the_inverted_pendulum_ends_on_the_saddles_stable_manifold(shocks: list[FatalShock]) -> None:
    """Independent witness: the distance from the attractor to the curve grown by backward integration."""
    system = driven_pendulum(amplitude=0.003)
    exact = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
    window = CellGrid((-pi, -500.0), (pi, 500.0), (120, 120))
    unit = np.array([2 * pi, 1000.0])
    orbits = find_periodic_orbits(exact, window)
    saddle = next(o for o in orbits if not o.is_stable and 2.0 < o.points[0, 0] < 2.2)
    inverse = inverse_stroboscopic_map(system)
    curve = saddle_manifold(exact, saddle, "stable", window, length=3.0, spacing=5e-4, inverse=inverse).points
    for shock, at in zip(shocks, ([0.0, 0.0], [pi, 0.0]), strict=True):
        shift = curve - at
        shift[:, 0] -= 2 * pi * np.round(shift[:, 0] / (2 * pi))
        shift /= unit
        near = shift[np.argsort(np.linalg.norm(shift, axis=1))[:2]]
        piece = near[1] - near[0]
        fraction = -(near[0] @ piece) / (piece @ piece)
        known = np.linalg.norm(near[0] + fraction * piece)
        assert shock.size == pytest.approx(known, rel=2e-5)
        assert shock.inside_fatal == 0


def test_mirror_images_have_equal_shocks(pendulum: Basins) -> None:
    """The two rotations, labels 2 and 3, are mirror images."""
    sizes = [minimal_fatal_shock(pendulum, k, scale=(1.0, 300.0), n_trials=512).size for k in (2, 3)]
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-7)


@pytest.mark.parametrize(
    ("label", "change", "match"),
    [
        (-1, {}, "are not basins"),
        (7, {}, "label=7"),
        (0, {"scale": 0.0}, "scale=0.0"),
        (0, {"scale": (1.0, 1.0, 1.0)}, "scale="),
        (0, {"point": (2.0, 0.0)}, r"label -2, not 0"),
        (0, {"point": (2.0,)}, "point has shape"),
        (0, {"along": ["z"]}, "along='z'"),
        (0, {"along": []}, "along is empty"),
        (0, {"n_trials": 0}, "n_trials=0"),
    ],
)
def test_what_a_shock_refuses(disc: Basins, label: int, change: Any, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        minimal_fatal_shock(disc, label, **change)


def test_labels_that_are_no_whole_numbers() -> None:
    with pytest.raises(TypeError, match=r"basins=array.*: give Basins, or whole numbers as labels"):
        largest_ball(np.zeros((3, 3)), 0)


def test_no_shock_where_all_come_back(disc: Basins, disc_function: Any) -> None:
    inner = find_basins(discrete_map(disc_function, {}, ("x", "y")), CellGrid((-0.5, -0.5), (0.5, 0.5), (10, 10)))
    with pytest.raises(ValueError, match="larger window"):
        minimal_fatal_shock(inner, 0)
    with pytest.raises(ValueError, match="larger window"):
        local_integrity(inner, 0)


def test_undecided_cells_are_not_fatal(disc: Basins) -> None:
    """With the cells outside relabelled as undecided, nothing is known to be fatal."""
    labels = np.where(disc.labels == -2, -3, disc.labels).astype(np.int16)
    with pytest.raises(ValueError, match="no initial condition has another label"):
        minimal_fatal_shock(replace(disc, labels=labels), 0)


def test_initial_conditions_without_a_grid_serve_as_well(disc_function: Any) -> None:
    initial_conditions = np.random.default_rng(0).uniform(-1.5, 1.5, (3000, 2))
    basins = find_basins(discrete_map(disc_function, {}, ("x", "y")), initial_conditions)
    with pytest.raises(ValueError, match="scale is missing"):
        minimal_fatal_shock(basins, 0)
    assert minimal_fatal_shock(basins, 0, scale=1.0).size == pytest.approx(1.0, abs=1e-9)
