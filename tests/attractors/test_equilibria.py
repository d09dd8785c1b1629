"""Sticking sets: continua of equilibria with dry friction."""

from math import asin, cos, pi
from typing import Any

import numpy as np
import pytest

import systems
from cellmap import CellGrid, ForcedSystem, Label, angle, discrete_map, find_attractors, find_basins, stroboscopic_map
from cellmap.attractors.kinds.continua import _with_boxes, closed_orbits, continua
from cellmap.attractors.kinds.neutral_segments import traced
from cellmap.orbits import Kind
from cellmap.orbits.attractor import Cover

LENGTH, AMPLITUDE, FREQUENCY, FRICTION = 0.0272, 0.003, 50.0, 10.0
W = 2.0 * pi * FREQUENCY
HOLDS = asin(FRICTION / ((9.8 + AMPLITUDE * W * W) / LENGTH))
"""Farthest from either equilibrium that a rod sticks through the whole period (rad)."""


@pytest.fixture(scope="module")
def stuck():
    """Basins of the pendulum with viscous and dry friction."""
    strobe = stroboscopic_map(systems.driven_pendulum(friction=FRICTION))
    return find_basins(strobe, CellGrid((-pi, -100.0), (pi, 100.0), (40, 40)))


@pytest.mark.thorough
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


def test_a_circle_of_equilibria_closes_upon_itself() -> None:
    held = discrete_map(lambda x, p: (x[0], 0.5 * x[1]), {}, (angle("a"), "v"))
    (circle,) = find_attractors(held, CellGrid((-pi, -20.0), (pi, 20.0), (6, 6)).centres())
    assert circle.kind is Kind.EQUILIBRIA and circle.cover.certain.all()
    gaps = np.diff(np.sort(circle.points[:, 0]))
    assert np.ptp(circle.points[:, 0]) + gaps.max() == pytest.approx(2 * pi, rel=1e-6)


def held_in_the_plane(t, x, p, s):
    return x[2], x[3], -x[0] - p.limit * s[0], -2.0 * x[1] - p.limit * s[1]


@pytest.mark.thorough
def test_a_set_of_two_dimensions() -> None:
    """Two blocks on springs: held in the rectangle |x| <= limit, |y| <= limit/2."""
    system = ForcedSystem(
        held_in_the_plane, {"limit": 0.3}, 1.0, ("x", "y", "x'", "y'"), switches=lambda t, x, p: (x[2], x[3])
    )
    initial_conditions = np.random.default_rng(0).uniform(-1.0, 1.0, (40, 4))
    (held,) = find_attractors(stroboscopic_map(system), initial_conditions)
    assert held.kind is Kind.EQUILIBRIA
    assert held.multipliers == pytest.approx([1.0, 1.0, 0.0, 0.0], abs=1e-9)
    reach = np.abs(held.points).max(axis=0)
    assert reach[:2] == pytest.approx([0.3, 0.15], rel=0.15)
    assert (reach[:2] < [0.3, 0.15]).all() and (reach[2:] == 0.0).all()
    assert len(np.unique(held.cover.boxes[:, :2], axis=0)) > 400


@pytest.mark.parametrize("number", [11, pytest.param(100, marks=pytest.mark.thorough)])
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


# --- continua of cycles


def held_beside_a_moving_mass(t, x, p, s):
    """A block with dry friction on a spring, and on it, by a spring, a mass that is driven and damped."""
    a, va, b, vb = x
    spring = b - a
    return va, 0.3 * spring - p.k * a - p.limit * s[0], vb, -spring - 0.4 * vb + p.force * cos(t)


HELD = ForcedSystem(
    held_beside_a_moving_mass,
    {"limit": 1.0, "force": 0.3, "k": 1.0},
    2 * pi,
    ("a", "va", "b", "vb"),
    switches=lambda t, x, p: (x[1],),
)
SQUARE = CellGrid((-1, -1), (1, 1), (12, 12))


@pytest.fixture(scope="module")
def held():
    return find_basins(stroboscopic_map(HELD), CellGrid((-1, -0.5, -1, -0.5), (1, 0.5, 1, 0.5), (5, 2, 4, 2)))


@pytest.mark.thorough
def test_places_at_which_friction_holds_a_block(held):
    """The mass swings with the amplitude 0.3/0.4 of resonance, b - a = 0.75 sin t.

    Its spring pulls with 0.225 at most, so that the block is held where its own spring pulls with 0.775 or less.
    """
    (attractor,) = held.attractors
    assert attractor.kind is Kind.CONTINUUM and attractor.period == 1
    a, va, b, vb = attractor.points.T
    assert a.max() == pytest.approx(0.775, abs=2e-3) and a.min() == pytest.approx(-0.775, abs=2e-3)
    assert np.abs(a).max() < 0.775
    assert b == pytest.approx(a, abs=1e-8)
    assert vb == pytest.approx(0.75, abs=1e-8)
    assert np.abs(va).max() < 1e-15
    # Of the block at rest 1 and 0, of the mass exp(2 pi (-0.2 +- i sqrt(0.96))).
    assert attractor.multipliers[0] == pytest.approx(1.0, abs=1e-9)
    assert np.abs(attractor.multipliers[1:3]) == pytest.approx(np.exp(-0.4 * pi), abs=1e-9)
    assert attractor.multipliers[3] == pytest.approx(0.0, abs=1e-9)
    assert attractor.name.startswith("continuum of fixed points around")


def test_a_segment_that_is_much_shorter_than_the_region():
    """Fixed points on y = 0.6 x for |x| < 0.001; beyond, x shrinks by a half towards it."""

    def function(x, p):
        inner = min(max(x[0], -0.001), 0.001)
        return inner + 0.5 * (x[0] - inner), 0.5 * x[1] + 0.3 * inner

    short = discrete_map(function, {}, ("x", "y"))
    rng = np.random.default_rng(0)
    near, far = rng.uniform(-0.0009, 0.0009, (20, 2)), rng.uniform(-1, 1, (10, 2))
    (attractor,) = find_attractors(short, [*near, *far])
    assert attractor.kind is Kind.CONTINUUM
    assert np.abs(attractor.points[:, 0]).max() == pytest.approx(0.001, rel=0.05)


def test_cycles_of_period_two():
    """(x, y) -> (-x, y/2 + 0.3 x): pairs of points on y = -0.2 x."""
    flips = discrete_map(lambda x, p: (-x[0], 0.5 * x[1] + 0.3 * x[0]), {}, ("x", "y"))
    basins = find_basins(flips, SQUARE)
    (attractor,) = basins.attractors
    assert (attractor.kind, attractor.period) == (Kind.CONTINUUM, 2)
    assert (basins.labels == 0).all()
    assert attractor.points[:, 1] == pytest.approx(-0.2 * attractor.points[:, 0], abs=1e-9)


def test_cycles_longer_than_those_that_are_tried_first_in_the_last_look():
    """Rotations by 1/40, of which the first look is the last."""
    turning = discrete_map(lambda x, p: (x[0] + 2 * pi / 40, 0.5 * x[1]), {}, (angle("a"), "v"))
    (attractor,) = find_attractors(turning, [[0.3, 0.0]], max_periods=32, longest_period=8)
    assert (attractor.kind, attractor.period) == (Kind.CONTINUUM, 40)


def test_a_derivative_too_large_for_a_number_makes_no_segment():
    """y grows by 1e90 in a step, so that the derivative of four is infinite, and that of five is none."""
    steep = discrete_map(lambda x, p: (0.5 * x[0], 1e90 * x[1]), {}, ("x", "y"))
    assert traced(steep, np.array([0.3, 0.0]), 5, np.ones(2)) is None


def test_boxes_of_a_joined_cover_are_certain_where_they_lie_in_certain_ones():
    still = discrete_map(lambda x, p: (x[0], 0.5 * x[1]), {}, ("x", "y"))
    other = Cover(np.zeros(2), np.ones(2), np.array([[0, 0], [1, 0], [2, 0]]), np.array([True, True, False]))
    joined = _with_boxes(still, Cover(np.zeros(2), np.ones(2), np.array([[0, 0]])), other)
    assert joined.boxes[joined.certain].tolist() == [[1, 0]]


def test_a_segment_ends_where_it_stops_attracting():
    """The multiplier across y = x is 1/2 + x^2."""
    bounded = discrete_map(lambda x, p: (x[0], x[0] + (0.5 + x[0] ** 2) * (x[1] - x[0])), {}, ("x", "y"))
    (attractor,) = find_attractors(bounded, SQUARE.centres())
    assert np.abs(attractor.points).max() == pytest.approx(np.sqrt(0.499), abs=1e-3)
    inside = find_basins(bounded, SQUARE).labels[4:8]
    assert (inside == 0).all()


@pytest.mark.parametrize(
    "function",
    [
        lambda x, p: (x[0], x[1]),  # every point stays
        lambda x, p: (x[0], x[1] + x[0]),  # a shear
        lambda x, p: (-x[0], -x[1]),
        lambda x, p: (x[0] - x[0] ** 3, 0.5 * x[1] + 0.3 * x[0]),  # one fixed point, of multiplier 1
        lambda x, p: (x[0], 2.0 * x[1] - x[0]),  # a line that repels
    ],
)
def test_what_is_no_attracting_continuum(function):
    exact = discrete_map(function, {}, ("x", "y"))
    line = discrete_map(lambda x, p: (x[0],), {}, ("x",))
    assert continua(line, closed_orbits(line, np.array([[0.3]]), np.ones(1), 8), np.ones(1)) == []
    ends = exact.iterate(SQUARE.centres().reshape(-1, 2), 20).points
    assert continua(exact, closed_orbits(exact, ends, np.full(2, 2.0), 8), np.full(2, 2.0)) == []


def test_an_orbit_beside_the_continuum_is_not_in_it():
    """Two lines of fixed points, y = x + 1 and y = x - 1, which part the plane between them."""
    lines = discrete_map(lambda x, p: (x[0], x[0] + (3 * (x[1] - x[0]) - (x[1] - x[0]) ** 3) / 2), {}, ("x", "y"))
    basins = find_basins(lines, CellGrid((-1, -2), (1, 2), (12, 12)))
    assert [a.kind for a in basins.attractors] == [Kind.CONTINUUM] * 2
    x, y = basins.grid.centres().reshape(-1, 2).T
    for number, attractor in enumerate(basins.attractors):
        above = attractor.points[0] @ (-1, 1) > 0
        mine = (basins.labels.ravel() == number) & (np.abs(y - x) < 1.7)  # farther away they jump across
        assert ((y > x) == above)[mine].all()
    assert (basins.labels != Label.UNDECIDED).all()


def test_a_line_that_is_longer_than_the_region() -> None:
    """y = x attracts at the rate 1/2, and orbits move by up to 40 along it."""
    oblique = discrete_map(lambda x, p: (x[0] + 10 * (x[1] - x[0]), x[1] + 9.5 * (x[1] - x[0])), {}, ("x", "y"))
    basins = find_basins(oblique, CellGrid((-1, -1), (1, 1), (11, 11)))
    assert [a.kind for a in basins.attractors] == [Kind.CONTINUUM]
    assert (basins.labels == 0).all()


@pytest.mark.parametrize(("sign", "period"), [(1.0, 1), pytest.param(-1.0, 2, marks=pytest.mark.thorough)])
def test_circles_of_fixed_points_and_of_cycles(sign: float, period: int) -> None:
    """r -> r + r (1 - r^2) (2 - r^2) (3 - r^2)/10: the circles at 1 and sqrt 3 attract, that at sqrt 2 parts them."""

    def function(x, p):
        r = x[0] ** 2 + x[1] ** 2
        factor = p.sign * (1 + (1 - r) * (2 - r) * (3 - r) / 10)
        return factor * x[0], factor * x[1]

    circles = discrete_map(function, {"sign": sign}, ("x", "y"))
    basins = find_basins(circles, CellGrid((-1.3, -1.3), (1.3, 1.3), (12, 12)))
    assert [(a.kind, a.period) for a in basins.attractors] == [(Kind.CONTINUUM, period)] * 2
    radius = np.linalg.norm(basins.grid.centres(), axis=-1)
    for k, r in enumerate((1.0, np.sqrt(3.0))):
        assert np.linalg.norm(basins.attractors[k].points, axis=1) == pytest.approx(r, abs=1e-3)
        assert np.array_equal(basins.labels == k, (radius > np.sqrt(2.0)) == bool(k))


def test_a_region_in_which_all_states_rest_is_one_attractor() -> None:
    def pulled(t: float, x: Any, p: Any) -> Any:
        force = p.a * (1.0 + 0.3 * cos(t)) ** 2 / (1.0 - x[0]) ** 2
        return (0.0, 0.0) if x[0] > 0.95 else (x[1], -x[0] - 0.1 * x[1] + force)

    def free(t: float, x: Any, p: Any) -> Any:
        return x[1], -x[0] - 0.1 * x[1] + p.a * (1.0 + 0.3 * cos(t)) ** 2 / (1.0 - x[0]) ** 2

    grid, ends = CellGrid((-0.9, -1.0), (0.9, 1.0), (12, 12)), {"pulled in": lambda t, x, p: x[0] - 0.95}
    resting, ended = (
        find_basins(stroboscopic_map(ForcedSystem(rhs, {"a": 0.1}, 2.0 * pi, ("x", "v"), **more)), grid)
        for rhs, more in ((pulled, {}), (free, {"ends": ends}))
    )
    assert [a.kind for a in resting.attractors] == [Kind.FIXED_POINT, Kind.EQUILIBRIA]
    known = resting.labels >= 0
    assert known.mean() > 0.99
    assert ((resting.labels == 1) == (ended.labels < 0))[known].all()
    everywhere = find_basins(discrete_map(lambda x, p: (1.0 * x[0], 1.0 * x[1]), {}, ("x", "y")), grid)
    assert len(everywhere.attractors) == 1 and (everywhere.labels == 0).all()
