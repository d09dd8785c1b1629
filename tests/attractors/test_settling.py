"""Labels and settling times of single orbits, against iteration step by step."""

from dataclasses import replace
from math import pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import systems
from cellmap import (
    Attractor,
    CellGrid,
    Label,
    PointMap,
    Status,
    angle,
    discrete_map,
    find_attractors,
    find_basins,
    interpolated_map,
    stroboscopic_map,
)
from cellmap.attractors.regions.boxes import RESIDENCE, inside_cover
from cellmap.attractors.settling.labels import LABEL_NAMES, label_of
from cellmap.attractors.settling.settle import Catalogue, classify, settle
from cellmap.maps.coordinates import difference
from cellmap.maps.orbit_batch import Orbits
from cellmap.orbits.attractor import Cover


def henon(a: float = 1.4) -> PointMap:
    return systems.henon_map(a)


def pendulum(amplitude: float) -> PointMap:
    return stroboscopic_map(systems.driven_pendulum(amplitude=amplitude))


def table(exact: PointMap, outside: str) -> PointMap:
    return interpolated_map(exact, CellGrid((-pi, -300.0), (pi, 300.0), (128, 128)), outside=outside)


WIDE = CellGrid((-pi, -300.0), (pi, 300.0), (30, 30))
MAPS = {
    "pendulum, 3 mm": (lambda: pendulum(0.003), WIDE),
    "pendulum, 10 mm": (lambda: pendulum(0.010), WIDE),
    "table, escape": (lambda: table(pendulum(0.010), "escape"), WIDE),
    "table, integrate": (lambda: table(pendulum(0.010), "integrate"), WIDE),
    "Duffing": (lambda: stroboscopic_map(systems.two_well_duffing()), CellGrid((-2.2, -2.2), (2.2, 2.2), (30, 30))),
    "Henon, chaotic": (henon, CellGrid((-2.0, -2.0), (2.0, 2.0), (30, 30))),
    "Henon, period 2": (lambda: henon(0.5), CellGrid((-2.0, -2.0), (2.0, 2.0), (30, 30))),
}


def step_by_step(
    point_map: PointMap, initial_conditions: np.ndarray, attractors, periods: int
) -> tuple[np.ndarray, np.ndarray]:
    """Labels and times by plain iteration: the first period in which an orbit is inside an attractor's region."""
    orbit = point_map.orbit(initial_conditions, periods)
    labels = np.full(len(initial_conditions), Label.UNDECIDED)
    labels[orbit.status[-1] == Status.ESCAPED] = Label.ESCAPED
    labels[orbit.status[-1] == Status.DIVERGED] = Label.DIVERGED
    times = np.full(len(initial_conditions), -1)
    covers = {k: set(map(tuple, a.cover.boxes.tolist())) for k, a in enumerate(attractors) if a.cover is not None}
    residence = np.zeros((len(attractors), len(initial_conditions)), int)
    for k, points in enumerate(orbit.points):
        for owner, a in enumerate(attractors):
            if a.neighbourhood is not None:
                entered, when = in_ellipsoids(a, points), k
            else:
                places = np.floor((points - a.cover.lower) / a.cover.widths).tolist()
                stays = [tuple(place) in covers[owner] for place in places]
                residence[owner] = np.where(stays, residence[owner] + 1, 0)
                entered, when = residence[owner] >= RESIDENCE, k - RESIDENCE + 1
            fresh = entered & (times < 0)
            labels[fresh], times[fresh] = owner, when
    return labels, times


def in_ellipsoids(a: Attractor, points: np.ndarray) -> np.ndarray:
    shift = difference(points[:, None], a.neighbourhood.centres, a.coordinates)
    return (np.einsum("nqi,qij,nqj->nq", shift, a.neighbourhood.metrics, shift) <= 1).any(axis=-1)


FIRST = ("pendulum, 10 mm", "table, integrate", "Henon, chaotic")


@pytest.mark.parametrize("name", [n if n in FIRST else pytest.param(n, marks=pytest.mark.thorough) for n in MAPS])
def test_labels_and_times_are_those_of_step_by_step_iteration(name):
    make, grid = MAPS[name]
    point_map = make()
    basins = find_basins(point_map, grid)
    chosen = np.random.default_rng(0).choice(grid.size, 300, replace=False)
    initial_conditions = grid.centres().reshape(-1, 2)[chosen]
    labels, times = step_by_step(point_map, initial_conditions, basins.attractors, 400)
    assert np.array_equal(basins.labels.ravel()[chosen], labels)
    assert np.array_equal(basins.settling_time.ravel()[chosen], times)
    assert len(np.unique(labels)) > 1


def test_settling_time_of_a_linear_contraction():
    """|x| <= 1/4 is the neighbourhood of x' = x/2 on [-1/2, 1/2]: a quarter of the window."""
    halves = discrete_map(lambda x, p: (0.5 * x[0],), {}, ("x",))
    initial_conditions = [[0.5], [-0.5], [0.499], [-0.499], [0.249], [0.0], [0.251], [-0.3]]
    basins = find_basins(halves, initial_conditions)
    assert basins.settling_time[2:].tolist() == [1, 1, 0, 0, 1, 1]
    assert set(basins.settling_time[:2].tolist()) <= {1, 2}  # at the edge, to rounding


def test_codes_of_initial_conditions_without_attractor():
    """Escaped, diverged and undecided orbits together: x' = x + y drifts, and y = 2, 3 are special."""

    def drift(x, p):
        # Exceeds every bound where y > 1; rests where y = 0; else moves to the right.
        return x[0] + x[1] * (1.0 + 1e200 * max(x[1] - 1.0, 0.0)), x[1]

    exact = discrete_map(drift, {}, ("x", "y"))
    icm = interpolated_map(exact, CellGrid((-1.0, -0.5), (1.0, 0.9), (20, 20)), outside="escape")
    initial_conditions = [[0.0, 0.5], [0.0, 0.0], [0.5, -0.4]]
    basins = find_basins(icm, initial_conditions, max_periods=20)
    assert basins.labels.tolist() == [Label.ESCAPED, Label.UNDECIDED, Label.ESCAPED]
    assert find_basins(exact, [[0.0, 2.0], [0.0, 0.0]], max_periods=20).labels.tolist() == [
        Label.DIVERGED,
        Label.UNDECIDED,
    ]
    assert len({Label.ESCAPED, Label.DIVERGED, Label.UNDECIDED}) == 3
    assert max(Label.ESCAPED, Label.DIVERGED, Label.UNDECIDED) < 0


def test_initial_conditions_any_number_of_rotations_away():
    point_map = pendulum(0.003)
    initial_conditions = WIDE.centres().reshape(-1, 2)[::11]
    shifted = (
        initial_conditions + np.array([2 * pi, 0.0]) * np.arange(-3, 4)[np.arange(len(initial_conditions)) % 7, None]
    )
    here, there = find_basins(point_map, initial_conditions), find_basins(point_map, shifted)
    assert np.array_equal(here.labels, there.labels)
    assert np.array_equal(here.settling_time, there.settling_time)


def in_python(point_map: PointMap) -> PointMap:
    """The same map, of which compiled loops know nothing."""
    return replace(point_map, advance=lambda orbits, periods: point_map.advance(orbits, periods))


def doubtful(exact: PointMap) -> PointMap:
    """A coarse interpolated map on a smaller window, with fallback cells."""
    return interpolated_map(exact, CellGrid((-pi, -200.0), (pi, 200.0), (48, 48)), tolerance=1e-2)


@pytest.mark.parametrize(
    ("make", "table"),
    [
        pytest.param(henon, None, marks=pytest.mark.thorough),
        (lambda: henon(0.5), None),
        pytest.param(lambda: pendulum(0.003), None, marks=pytest.mark.thorough),
        (lambda: pendulum(0.010), doubtful),
    ],
    ids=["chaotic", "period 2", "flow", "table"],
)
def test_maps_that_are_called_from_python_have_the_same_labels(make, table):
    """What the loop asks for and what it calls by itself: labels, times and work are the same."""
    exact = make()
    grid = WIDE if exact.coordinates[0].period else CellGrid((-2.0, -2.0), (2.0, 2.0), (30, 30))
    ours, theirs = (m if table is None else table(m) for m in (exact, in_python(exact)))
    one, other = find_basins(ours, grid), find_basins(theirs, grid)
    assert np.array_equal(one.labels, other.labels)
    assert np.array_equal(one.settling_time, other.settling_time)
    assert (one.cost.steps, one.cost.look_ups) == (other.cost.steps, other.cost.look_ups)
    assert one.cost.evaluations > 0
    if table is not None:
        assert 0 < one.cost.look_ups < one.cost.steps


@pytest.mark.parametrize("pool", [1, 7, 300])
def test_labels_do_not_depend_on_the_rows_that_are_moved_together(pool, monkeypatch):
    point_map = doubtful(pendulum(0.010))
    initial_conditions = WIDE.centres().reshape(-1, 2)[::5]
    catalogue = Catalogue.of(find_attractors(point_map, initial_conditions), point_map)
    whole = settle(point_map, Orbits.starting(initial_conditions.copy()), catalogue, 10)
    monkeypatch.setattr("cellmap.attractors.settling.settle.POOL", pool)
    parts = settle(point_map, Orbits.starting(initial_conditions.copy()), catalogue, 10)
    assert 0 < len(whole.undecided) < len(initial_conditions)
    assert np.array_equal(whole.labels, parts.labels)
    assert np.array_equal(whole.times, parts.times)
    assert whole.orbits.points.tobytes() == parts.orbits.points.tobytes()
    assert whole.tally == parts.tally


def test_each_way_to_end_has_its_label():
    assert {name: int(label) for name, label in Label.__members__.items()} == {
        "ESCAPED": -1,
        "DIVERGED": -2,
        "UNDECIDED": -3,
        "NO_RETURN": -4,
        "UNLABELLED": -5,
        "OUT_OF_STEPS": -6,
        "DOUBTFUL": -7,
        "ENDED": -8,
    }
    ends = {s: Label[s.name] if s.name in Label.__members__ else Label.UNDECIDED for s in Status}
    assert label_of(list(ends)).tolist() == list(ends.values())
    further = [Label.ENDED - k for k in range(1, 16)]
    assert list(LABEL_NAMES) == [*Label, *further]
    assert label_of([Status.ENDED + 15]).tolist() == further[-1:]


def test_a_rule_sees_points_and_tells_any_number():
    """x' = x / 2 until x < 1: final states may have numbers beyond those of attractors; ended orbits have no point."""
    halves = discrete_map(lambda x, p: (0.5 * x[0] if x[0] > 0 else 1e200,), {}, ("x",))
    seen = []

    def rule(points):
        seen.append(points)
        return np.where(points[:, 0] < 1.0, 100_000, -1) * np.where(points[:, 0] > 0, 1, 0) - (points[:, 0] <= 0)

    catalogue = Catalogue.of((), halves)
    found = classify(halves, catalogue, np.array([[4.5], [0.5], [-1.0], [1e9]]), 10, rule)
    assert found.labels.tolist() == [100_000, 100_000, Label.DIVERGED, Label.UNDECIDED]
    assert found.times.tolist() == [3, 0, -1, -1]
    assert found.tally.steps == 3 + 0 + 1 + 10
    assert np.isfinite(np.concatenate(seen)).all()


# --- covers of chaotic attractors


COVERED = discrete_map(lambda x, p: (x[0] + 0.1 * sin(x[1]), x[1]), {}, (angle("a"), "y"))


@given(
    points=st.lists(
        st.tuples(st.floats(-pi, pi, exclude_max=True), st.floats(-5, 5) | st.just(np.nan)), min_size=1, max_size=30
    ),
    visited=st.sets(st.tuples(st.integers(0, 7), st.integers(-3, 6)), min_size=1, max_size=20),
)
def test_cover_holds_the_points_of_its_boxes(points, visited):
    lower, widths = np.array([-pi, -1.0]), np.array([pi / 4, 0.5])
    cover = Cover(lower, widths, np.array(sorted(visited)))
    expected = []
    for a, y in points:
        place = (int(np.floor((a + pi) / (pi / 4))) % 8, np.floor((y + 1.0) / 0.5))
        expected.append(place in visited)
    assert inside_cover(cover, np.array(points), COVERED).tolist() == expected


def test_settling_times_do_not_depend_on_multi_period_steps():
    """An interpolated map with steps of up to eight periods, on whose cubic splines the map is exact."""
    cubic = discrete_map(lambda x, p: (x[0] + 0.1 * (x[0] - x[0] ** 3), 0.9 * x[1]), {}, ("x", "y"))
    window = CellGrid((-1.5, -1.0), (1.5, 1.0), (64, 64))
    points = CellGrid((-1.4, -0.9), (1.4, 0.9), (30, 11)).centres().reshape(-1, 2)
    found = []
    for step in (1, 8):
        table = interpolated_map(cubic, window, 3, max_step=step)
        attractors = find_attractors(table, points)
        assert len(attractors) == 2
        found.append(settle(table, Orbits.starting(points.copy()), Catalogue.of(attractors, table), 200))
    one, eight = found
    assert np.array_equal(one.labels, eight.labels)
    assert np.abs(one.times - eight.times).max() <= 1  # of orbits that come to the very edge of a region
    assert (one.times == eight.times).mean() > 0.98
    assert one.times.max() > 16
