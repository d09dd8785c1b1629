"""Minimal fatal shocks: closed forms, symmetries, and the stable manifold of a saddle."""

from dataclasses import replace
from math import atan2, pi, sin, sqrt

import numpy as np
import pytest

from cellmap import Basins, CellGrid, angle, discrete_map, find_basins, find_periodic_orbits, stroboscopic_map
from cellmap.analysis.boundary import saddle_manifold
from cellmap.analysis.resilience import FatalShock, largest_ball, local_integrity, minimal_fatal_shock
from cellmap.maps import inverse_stroboscopic_map
from systems import driven_pendulum, logistic_map


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


def test_undecided_cells_are_not_fatal(disc: Basins) -> None:
    """With the cells outside relabelled as undecided, nothing is known to be fatal."""
    labels = np.where(disc.labels == -2, -3, disc.labels).astype(np.int16)
    with pytest.raises(ValueError, match="no initial condition has another label"):
        minimal_fatal_shock(replace(disc, labels=labels), 0)


# --- largest balls in basins


def test_integrity_of_a_disc(disc: Basins) -> None:
    rough, fine = (local_integrity(disc, 0, scale=1.0, refine=r) for r in (False, True))
    assert abs(rough.radius - 1.0) < rough.resolution
    assert fine.radius == pytest.approx(1.0, abs=1e-9)
    assert not fine.meets_window
    assert rough.shock is None
    assert fine.centre == pytest.approx([0.0, 0.0], abs=1e-12)


def test_integrity_of_a_cycle_is_that_of_its_weakest_point() -> None:
    """Logistic map, r = 3.2: both points of the 2-cycle lie in (0, 1), outside of which orbits diverge.

    Single points of the boundary within, such as the preimages of the unstable fixed point, have no room and no weight.
    """
    r = 3.2
    basins = find_basins(logistic_map(r), CellGrid((-0.5,), (1.5,), (200,)))
    high = (r + 1 + sqrt((r - 3) * (r + 1))) / (2 * r)
    ball = local_integrity(basins, 0, scale=1.0)
    assert ball.radius == pytest.approx(1.0 - high, abs=1e-9)
    assert ball.centre == pytest.approx([high])


def test_largest_ball_about_any_centre(disc: Basins) -> None:
    ball = largest_ball(disc, 0, scale=1.0)
    assert abs(ball.radius - 1.0) < ball.resolution
    assert np.linalg.norm(ball.centre) < ball.resolution
    refined = largest_ball(disc, 0, scale=1.0, refine=True)
    assert refined.radius == pytest.approx(1.0 - np.linalg.norm(refined.centre), abs=1e-7)


def test_largest_ball_wraps_and_stops_at_a_window() -> None:
    labels = np.zeros((20, 11), int)
    labels[:4], labels[-5:] = 1, 1
    closed = largest_ball(labels, 1, wraps=(True, False))
    assert closed.radius == 5.0  # nine rows across the branch cut: from the middle one to the first beyond
    assert closed.centre[0] in (19.5, 0.5 - 0.0)
    opened = largest_ball(labels, 1)
    assert opened.radius == 3.0
    assert opened.meets_window
    narrow = largest_ball(labels, 0, scale=(1.0, 0.1))
    assert narrow.radius == 6.0
    assert not narrow.meets_window


def test_undecided_cells_end_a_ball() -> None:
    labels = np.ones((9, 9), int)
    labels[4, 4] = -3
    # About cell (2, 2): the undecided one is nearer than the third row away, beyond the window.
    ball = largest_ball(labels, 1)
    assert ball.radius == pytest.approx(2.0 * sqrt(2.0))
    assert not ball.meets_window
    labels[4, 4] = 1
    assert largest_ball(labels, 1).radius == 5.0
