"""Sticking sets: continua of equilibria with dry friction."""

from __future__ import annotations

from math import asin, pi
from pathlib import Path

import numpy as np
import pytest

import systems
from cellmap import (
    CellGrid,
    ForcedSystem,
    discrete_map,
    find_attractors,
    find_basins,
    load_basins,
    save_basins,
    stroboscopic_map,
)
from cellmap.attractors.equilibria import sticking_sets
from cellmap.orbits import Kind

LENGTH, AMPLITUDE, FREQUENCY, FRICTION = 0.0272, 0.003, 50.0, 10.0
W = 2.0 * pi * FREQUENCY
HOLDS = asin(FRICTION / ((9.8 + AMPLITUDE * W * W) / LENGTH))
"""Farthest from either equilibrium that a rod sticks through the whole period (rad)."""


@pytest.fixture(scope="module")
def stuck():
    """Basins of the pendulum with viscous and dry friction."""
    strobe = stroboscopic_map(systems.driven_pendulum(friction=FRICTION))
    return find_basins(strobe, CellGrid((-pi, -100.0), (pi, 100.0), (40, 40)))


def test_the_pendulum_sticks_at_both_equilibria(stuck) -> None:
    """Two intervals of equilibria beside the stick-slip cycles: all orbits are decided."""
    assert [a.kind for a in stuck.attractors] == [Kind.FIXED_POINT] * 2 + [Kind.EQUILIBRIA] * 2
    assert not (stuck.labels < 0).any()
    for attractor, rest in zip(stuck.attractors[2:], (0.0, pi), strict=True):
        away = np.abs((attractor.points[:, 0] - rest + pi) % (2 * pi) - pi)
        assert away.max() == pytest.approx(HOLDS, rel=0.1) and away.max() < HOLDS
        assert (attractor.points[:, 1] == 0.0).all()
        assert attractor.multipliers == pytest.approx([1.0, 0.0], abs=1e-9)
        assert attractor.period == 1 and attractor.rotations == (0, 0)


@pytest.mark.slow
def test_every_end_is_where_its_label_says(stuck) -> None:
    """Upright, the set repels what slips beside it; hanging, orbits creep towards its edges for ever."""
    initial_conditions = stuck.grid.centres().reshape(-1, 2)
    labels = stuck.labels.ravel()
    assert (stuck.point_map.iterate(initial_conditions[labels < 2], 500).points[:, 1] != 0.0).all()
    theta, rate = stuck.point_map.iterate(initial_conditions[labels == 3], 500).points.T
    assert (np.abs(theta % (2 * pi) - pi) <= HOLDS * (1 + 1e-9)).all() and (rate == 0.0).all()
    creeping = stuck.point_map.iterate(initial_conditions[labels == 2], 500).points
    before, after = (np.abs(p[:, 0]) for p in (creeping, stuck.point_map.iterate(creeping, 500).points))
    assert (before < 1.01 * HOLDS).all() and (creeping[:, 1] == 0.0).all()
    assert ((after < before) | (before <= HOLDS * (1 + 1e-9))).all()


def test_the_image_is_kept_on_disk(stuck, tmp_path: Path) -> None:
    save_basins(stuck, tmp_path / "stuck.h5")
    again = load_basins(tmp_path / "stuck.h5")
    assert [a.kind for a in again.attractors] == [a.kind for a in stuck.attractors]
    assert np.array_equal(again.labels, stuck.labels)
    for one, other in zip(again.attractors[2:], stuck.attractors[2:], strict=True):
        assert np.array_equal(one.cover.boxes, other.cover.boxes)


def test_mirror_images_have_equal_fractions(stuck) -> None:
    fractions = [stuck.fractions[k].fraction for k in range(4)]
    assert fractions[0] == fractions[1]


def test_without_gravity_all_angles_are_held() -> None:
    """One set, the whole circle, which closes upon itself."""
    system = systems.driven_pendulum(gravity=0.0, amplitude=0.0, damping=0.0, friction=FRICTION)
    initial_conditions = CellGrid((-pi, -20.0), (pi, 20.0), (6, 6)).centres()
    (circle,) = find_attractors(stroboscopic_map(system), initial_conditions)
    assert circle.kind is Kind.EQUILIBRIA
    gaps = np.diff(np.sort(circle.points[:, 0]))
    assert np.ptp(circle.points[:, 0]) + gaps.max() == pytest.approx(2 * pi, rel=1e-6)


def held_in_the_plane(t, x, p, s):
    return x[2], x[3], -x[0] - p.limit * s[0], -2.0 * x[1] - p.limit * s[1]


def test_a_set_of_two_dimensions() -> None:
    """Two blocks on springs: held in the rectangle |x| <= limit, |y| <= limit/2."""
    system = ForcedSystem(
        held_in_the_plane,
        {"limit": 0.3},
        1.0,
        ("x", "y", "x'", "y'"),
        switches=lambda t, x, p: (x[2], x[3]),
    )
    initial_conditions = np.random.default_rng(0).uniform(-1.0, 1.0, (40, 4))
    (held,) = find_attractors(stroboscopic_map(system), initial_conditions)
    assert held.kind is Kind.EQUILIBRIA
    assert held.multipliers == pytest.approx([1.0, 1.0, 0.0, 0.0], abs=1e-9)
    reach = np.abs(held.points).max(axis=0)
    assert reach[:2] == pytest.approx([0.3, 0.15], rel=0.15)
    assert (reach[:2] < [0.3, 0.15]).all() and (reach[2:] == 0.0).all()
    assert len(np.unique(held.cover.boxes[:, :2], axis=0)) > 400


@pytest.mark.parametrize("shrink", [1.0, 0.5])
def test_neutral_and_single_fixed_points_are_no_sets(shrink: float) -> None:
    """The identity attracts nothing; a single fixed point is not a set."""
    plane = discrete_map(lambda x, p: (p.shrink * x[0], p.shrink * x[1]), {"shrink": shrink}, ("x", "y"))
    states = np.array([[0.3, 0.4]]) * (shrink == 1.0)
    assert sticking_sets(plane, states, np.ones(2)) == []


def test_a_line_of_fixed_points_attracts() -> None:
    """(x, y) -> (x, y/2): the axis within the window."""
    fibres = discrete_map(lambda x, p: (x[0], 0.5 * x[1]), {}, ("x", "y"))
    (line,) = sticking_sets(fibres, np.array([[0.1, 0.0], [-0.4, 0.0]]), np.ones(2))
    assert line.kind is Kind.EQUILIBRIA and line.name.startswith("equilibria around")


@pytest.mark.parametrize("number", [11, 20, 40, 41, 100])
@pytest.mark.parametrize("shear", [0.2, 10.0])
def test_a_line_on_which_orbits_end_far_apart_is_one_set(number: int, shear: float) -> None:
    """(x + shear y, y/2): the line y = 0 attracts as a whole; an orbit ends at x + 2 shear y."""
    sheared = discrete_map(lambda x, p: (x[0] + p.shear * x[1], 0.5 * x[1]), {"shear": shear}, ("x", "y"))
    basins = find_basins(sheared, CellGrid((-1, -1), (1, 1), (number, number)))
    (line,) = basins.attractors
    assert line.kind is Kind.EQUILIBRIA
    assert (basins.labels == 0).all()
    ends = basins.grid.centres().reshape(-1, 2) @ [1.0, 2.0 * shear]
    assert line.points[:, 0].min() <= ends.min() and line.points[:, 0].max() >= ends.max()


def test_two_lines_of_equilibria_stay_two() -> None:
    """The lines y = -1 and y = 1, on which orbits end far apart."""
    lines = discrete_map(lambda x, p: (x[0] + 5 * (x[1] - x[1] ** 3), 1.5 * x[1] - 0.5 * x[1] ** 3), {}, ("x", "y"))
    basins = find_basins(lines, CellGrid((-1, -1.5), (1, 1.5), (20, 20)))
    assert [a.kind for a in basins.attractors] == [Kind.EQUILIBRIA] * 2
    side = np.array([a.points[0, 1] for a in basins.attractors])
    assert np.array_equal(side[basins.labels], np.broadcast_to(np.sign(basins.grid.centres()[..., 1]), (20, 20)))


def test_a_plane_on_which_orbits_end_far_apart_is_one_set() -> None:
    plane = discrete_map(lambda x, p: (x[0] + 0.4 * x[2], x[1] - 0.6 * x[2], 0.5 * x[2]), {}, ("x", "y", "z"))
    basins = find_basins(plane, CellGrid((-1, -1, -1), (1, 1, 1), (5, 5, 5)))
    assert [a.kind for a in basins.attractors] == [Kind.EQUILIBRIA]
    assert (basins.labels == 0).all()
