"""Coordinates, and wrapped angles."""

import math
from math import nextafter, pi, ulp

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cellmap import (
    CellGrid,
    Coordinate,
    ForcedSystem,
    Status,
    angle,
    discrete_map,
    find_attractors,
    find_basins,
    stroboscopic_map,
)
from cellmap._compiled.kernels.blocks import wrap_rows
from cellmap.maps import jacobian
from cellmap.maps.coordinates import as_coordinates, difference, state_points, turns_of, wrap

CIRCLES = [
    angle("theta"),
    angle("theta", lower=0.0),
    angle("degrees", "deg", period=360.0),
    angle("x", period=1.0, lower=-0.3),
]
places = st.floats(-1e9, 1e9)


def wrapped_rows(x: float, circle: Coordinate) -> tuple[float, int]:
    points, rotations = np.array([[x]]), np.zeros((1, 1), np.int64)
    lower, circle_period = turns_of([circle])
    wrap_rows(points, rotations, lower, circle_period)
    return float(points[0, 0]), int(rotations[0, 0])


@pytest.mark.parametrize("circle", CIRCLES, ids=str)
@given(x=places)
def test_an_angle_stays_in_its_period_and_its_place(circle: Coordinate, x: float) -> None:
    assert circle.lower is not None and circle.period is not None
    point, rotations = wrapped_rows(x, circle)
    assert circle.lower <= point < circle.lower + circle.period
    assert point + rotations * circle.period == pytest.approx(x, rel=4e-16, abs=4e-16 * circle.period)
    assert wrap(np.array([x]), [circle])[0] == pytest.approx(point, abs=2.0 * ulp(abs(x) + circle.period))
    assert wrapped_rows(point, circle) == (point, 0)


@pytest.mark.parametrize("circle", CIRCLES, ids=str)
@given(x=st.floats(allow_nan=False, allow_infinity=False))
def test_wrapping_any_number_gives_an_angle_of_the_period_or_none(circle: Coordinate, x: float) -> None:
    """From 1e15 rotations on numbers lie a tenth of a period apart, and nothing is left of a phase."""
    assert circle.lower is not None and circle.period is not None
    with np.errstate(over="ignore"):
        point = wrap(np.array([x]), [circle])[0]
    if abs(np.floor((x - circle.lower) / circle.period)) < 1e15:
        assert circle.lower <= point < circle.lower + circle.period
    else:
        assert np.isnan(point)
    assert np.isnan(wrapped_rows(x, circle)[0]) == np.isnan(point)


@pytest.mark.parametrize("circle", CIRCLES, ids=str)
def test_an_angle_next_to_the_cut_is_wrapped_once(circle: Coordinate) -> None:
    assert circle.lower is not None and circle.period is not None
    for whole in range(-20, 21):
        x = circle.lower + whole * circle.period
        for near in x + np.arange(-6, 7) * ulp(x):
            point, rotations = wrapped_rows(float(near), circle)
            assert wrapped_rows(point, circle) == (point, 0)
            again = wrap(np.array([near]), [circle])
            assert wrap(again, [circle])[0] == again[0]
            assert abs(rotations - whole) <= 1


def test_the_cut_belongs_to_the_period_above_it() -> None:
    circle = angle("theta")
    assert wrapped_rows(-pi, circle) == (-pi, 0)
    assert wrapped_rows(pi, circle) == (-pi, 1)
    below = wrapped_rows(nextafter(-pi, -4.0), circle)
    assert below == (pytest.approx(pi, rel=1e-15), -1) and below[0] < pi
    # So close below the cut of [0, 1) that the sum with a whole period rounds to the next cut.
    assert wrapped_rows(-1e-20, angle("x", period=1.0, lower=0.0)) == (0.0, 0)


@pytest.mark.parametrize("x", [1e16, -1e16, 1e300])
def test_states_whose_angle_has_no_phase_are_refused(x: float) -> None:
    rotor = discrete_map(lambda x, p: (x[0] + x[1], x[1]), {}, (angle("theta"), "v"), "rotor")
    for call in (rotor, lambda s: rotor.iterate(s, 1), lambda s: rotor.orbit(s, 1), lambda s: jacobian(rotor, s)):
        with pytest.raises(ValueError, match=r"points\[1, 0\]=.*: at 1e\+15 periods of 6.28319 and beyond"):
            call([[0.0, 0.0], [x, 0.0]])
    with pytest.raises(ValueError, match=r"initial_conditions\[0\]=.*give it within a few periods"):
        find_attractors(rotor, [x, 0.0])
    with pytest.raises(ValueError, match=r"grid lies .* periods away from 0 in theta"):
        CellGrid((2.0**57, 0.0), (2.0**57 + 32.0, 1.0), (1, 1)).on((angle("theta", period=100.0), Coordinate("v")))
    assert state_points("points", [[1e15, 0.0]], (angle("theta"), Coordinate("v"))).tolist() == [[1e15, 0.0]]
    behind = (angle("theta"), Coordinate("v"), angle("b", period=1.0))
    with pytest.raises(ValueError, match=r"points\[1, 2\]=.*an angle has no phase"):
        state_points("points", [[0.0, 0.0, 0.0], [0.0, 0.0, x]], behind)
    far = math.copysign(1e15, x)
    ends = sorted((far, far * (1.0 - 5e-16)))
    with pytest.raises(ValueError, match="periods away from 0 in b"):
        CellGrid((0.0, 0.0, ends[0]), (1.0, 1.0, ends[1]), (2, 2, 2)).on(behind)


@pytest.mark.parametrize("far", [1e16, -1e16, 1e99])
def test_orbits_whose_angle_loses_its_phase_end(far: float) -> None:
    """The second step turns by `far`: the orbit has diverged, and says so."""
    rotor = discrete_map(lambda x, p: (x[0] + x[1], p.far * x[1]), {"far": far}, (angle("theta"), "v"), "rotor")
    images = rotor.iterate([[0.0, 2.0], [0.3, 0.0]], 2)
    assert images.status.tolist() == [Status.DIVERGED, Status.OK]
    assert np.isnan(images.points[0]).all() and images.points[1].tolist() == [0.3, 0.0]
    assert rotor.orbit([0.0, 2.0], 3).status.tolist() == [0, 0, 3, 3]
    flow = ForcedSystem(lambda t, x, p: (x[1], 0.0 * x[0]), {}, 1.0, (angle("theta", period=1e-3), "v"), "free rotor")
    assert stroboscopic_map(flow).iterate([[0.0, far], [0.0, 0.25e-3]], 1).status.tolist() == [
        Status.DIVERGED,
        Status.OK,
    ]


@pytest.mark.parametrize("circle", CIRCLES, ids=str)
@given(a=st.floats(-1e6, 1e6), b=st.floats(-1e6, 1e6))
def test_the_shorter_way_round(circle: Coordinate, a: float, b: float) -> None:
    assert circle.period is not None
    d = float(difference(np.array([a]), np.array([b]), [circle])[0])
    assert abs(d) <= 0.5 * circle.period
    rotations = (a - b - d) / circle.period
    assert rotations == pytest.approx(round(rotations), abs=1e-6)


def test_batches_with_variables_on_the_line() -> None:
    points = np.array([[7.0, 7.0], [-7.0, -7.0]])
    assert np.array_equal(wrap(points, [Coordinate("x"), angle("theta")])[:, 0], points[:, 0])
    assert points[0, 1] == 7.0
    a, b = np.array([[3.0, 1.0], [0.0, -5.0]]), np.array([-3.0, 4.0])
    assert difference(a, b, [angle("theta"), Coordinate("v")]) == pytest.approx(
        np.array([[6.0 - 2 * pi, -3.0], [3.0, -9.0]])
    )


def test_names_become_coordinates() -> None:
    theta = angle("theta")
    assert as_coordinates(("x", theta)) == (Coordinate("x"), theta)
    assert as_coordinates("x") == (Coordinate("x"),)
    assert as_coordinates(c for c in "xy") == (Coordinate("x"), Coordinate("y"))
    assert [str(c) for c in (theta, Coordinate("v", "m/s"), Coordinate("q"))] == ["theta (rad)", "v (m/s)", "q"]
    assert theta.is_angle and not Coordinate("q").is_angle


LINE, UP = np.linspace(-2, 2, 20), np.linspace(-1, 3, 30)


@pytest.mark.parametrize(
    ("axes", "names", "remedy"),
    [
        (LINE, "xv", r"values along one axis, .* CellGrid\(\(-2, ...\), \(2, ...\), \(20, ...\)\), .* of 2 entries"),
        ([LINE, UP], "xv", r"coordinates of a grid, .* CellGrid\(\(-2, -1\), \(2, 3\), \(20, 30\)\)"),
        (np.meshgrid(LINE, UP), "xv", r"CellGrid\(\(-2, -1\), \(2, 3\), \(20, 30\)\)"),
        (np.meshgrid(LINE, UP, sparse=True), "xv", r"CellGrid\(\(-2, -1\), \(2, 3\), \(20, 30\)\)"),
        ([LINE, 0.5], "xv", r"CellGrid\(\(-2, 0.5\), \(2, 0.5\), \(20, 1\)\)"),
        (((-2, 2, 40), (-1, 3, 50)), "xv", r"CellGrid\(\(-2, -1\), \(2, 3\), \(40, 50\)\)"),
        (LINE, "x", r"CellGrid\(\(-2,\), \(2,\), \(20,\)\)"),
        ([(-2, 2), (-1, 3), (0, 1)], "xyz", r"states have length 3, and these pairs 2; .* CellGrid\(\(-2, -1, 0\)"),
        (np.random.default_rng(0).random((2, 20)), "xv", r"the first one does, so give np.moveaxis"),
        (np.sort(np.random.default_rng(0).random((2, 3))), "xv", r"the first one does, so give np.moveaxis"),
    ],
)
def test_axes_in_the_place_of_states_ask_for_a_grid(axes, names, remedy):
    rest = discrete_map(lambda x, p: tuple(v / 2 for v in x), {}, tuple(names))
    for search in (find_basins, find_attractors):
        with pytest.raises(ValueError, match=remedy):
            search(rest, axes)


def test_states_that_look_like_windows_or_axes():
    rest = discrete_map(lambda x, p: tuple(v / 2 for v in x), {}, ("x", "v"))
    with pytest.warns(UserWarning, match=r"are two states; for a window give CellGrid\(\(-2, -1\), \(2, 3\), shape\)"):
        find_basins(rest, [(-2, 2), (-1, 3)])
    rising = discrete_map(lambda x, p: tuple(v / 2 for v in x), {}, tuple("xyz"))
    assert find_basins(rising, [[0, 1, 2], [1, 2, 3], [2, 3, 4]]).labels.tolist() == [0, 0, 0]
