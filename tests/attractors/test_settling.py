"""Labels and settling times of single orbits, against iteration step by step."""

from __future__ import annotations

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
from cellmap.attractors.boxes import box_keys, boxes_of, inside_cover
from cellmap.attractors.labels import LABEL_NAMES, label_of
from cellmap.attractors.settling import RESIDENCE, Catalogue, classify, settle
from cellmap.maps.coordinates import difference
from cellmap.maps.orbit_batch import Orbits
from cellmap.orbits import Kind
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


@pytest.mark.parametrize("name", MAPS)
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


def test_settling_in_steps_equals_settling_at_once():
    """Continuing undecided orbits later, from an age on, gives the same labels and times."""
    point_map = pendulum(0.003)
    initial_conditions = WIDE.centres().reshape(-1, 2)
    catalogue = Catalogue.of(find_attractors(point_map, initial_conditions), point_map)
    at_once = settle(point_map, Orbits.starting(initial_conditions.copy()), catalogue, 300)
    first = settle(point_map, Orbits.starting(initial_conditions.copy()), catalogue, 20)
    labels, times, rows = first.labels.copy(), first.times.copy(), first.undecided
    second = settle(point_map, first.orbits, catalogue, 280, age=20)
    labels[rows], times[rows] = second.labels, second.times
    assert 0 < len(rows) < len(initial_conditions)
    assert np.array_equal(labels, at_once.labels)
    assert np.array_equal(times, at_once.times)


@pytest.mark.parametrize("periods", [0, 1, 7, 100])
def test_undecided_orbits_are_returned_at_their_age(periods):
    point_map = pendulum(0.003)
    initial_conditions = WIDE.centres().reshape(-1, 2)[::7]
    settled = settle(point_map, Orbits.starting(initial_conditions.copy()), Catalogue.of((), point_map), periods)
    assert (settled.labels == Label.UNDECIDED).all()
    assert (settled.times == -1).all()
    assert np.array_equal(settled.orbits.points, point_map.iterate(initial_conditions, periods).points)


@pytest.mark.parametrize("periods", [0, 1, 7, 130])
def test_orbits_that_nothing_captures_are_labelled_by_their_ends(periods):
    """They move many periods at a time, and are found where single periods lead, whenever they diverge."""
    calls = []

    def advance(orbits, stride):
        calls.append(stride)
        exact.advance(orbits, stride)

    exact = henon()
    initial_conditions = CellGrid((-2.0, -2.0), (2.0, 2.0), (20, 20)).centres().reshape(-1, 2)
    counted = replace(exact, advance=advance)
    settled = settle(counted, Orbits.starting(initial_conditions.copy()), Catalogue.of((), exact), periods)
    points, diverged = initial_conditions.copy(), np.zeros(len(initial_conditions), bool)
    for _ in range(periods):
        image = exact.iterate(points[~diverged], 1)
        points[~diverged] = image.points
        diverged[~diverged] = image.status == Status.DIVERGED
    assert np.array_equal(settled.labels, np.where(diverged, Label.DIVERGED, Label.UNDECIDED))
    assert (settled.times == -1).all()
    assert np.array_equal(settled.orbits.points, points[~diverged])
    assert sum(calls) == periods
    assert len(calls) <= 10


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


def test_ended_orbits_have_no_settling_time():
    basins = find_basins(henon(), CellGrid((-2.0, -2.0), (2.0, 2.0), (20, 20)))
    assert (basins.settling_time[basins.labels == Label.DIVERGED] == -1).all()
    assert (basins.settling_time[basins.labels >= 0] >= 0).all()


def test_initial_conditions_on_the_attractor_are_settled_from_the_beginning():
    point_map = pendulum(0.010)
    attractors = find_attractors(point_map, WIDE.centres())
    initial_conditions = np.concatenate([a.points for a in attractors])
    basins = find_basins(point_map, initial_conditions, attractors=attractors)
    assert basins.labels.tolist() == [k for k, a in enumerate(attractors) for _ in range(a.period)]
    assert (basins.settling_time == 0).all()


def test_initial_conditions_any_number_of_rotations_away():
    point_map = pendulum(0.003)
    initial_conditions = WIDE.centres().reshape(-1, 2)[::11]
    shifted = (
        initial_conditions + np.array([2 * pi, 0.0]) * np.arange(-3, 4)[np.arange(len(initial_conditions)) % 7, None]
    )
    here, there = find_basins(point_map, initial_conditions), find_basins(point_map, shifted)
    assert np.array_equal(here.labels, there.labels)
    assert np.array_equal(here.settling_time, there.settling_time)


def test_ellipsoid_across_the_cut_of_the_angle():
    """The inverted pendulum rests at the cut: starts at both of its sides are inside from the beginning."""
    point_map = pendulum(0.003)
    initial_conditions = [[pi - 0.01, 0.0], [-pi + 0.01, 0.0], [pi, 0.0], [-pi, 0.0]]
    basins = find_basins(point_map, initial_conditions)
    assert basins.labels.tolist() == [0] * 4
    assert (basins.settling_time == 0).all()
    assert np.abs(basins.attractors[0].points[0, 0]) == pytest.approx(pi, abs=1e-9)


def in_python(point_map: PointMap) -> PointMap:
    """The same map, of which compiled loops know nothing."""
    return replace(point_map, advance=lambda orbits, periods: point_map.advance(orbits, periods))


def doubtful(exact: PointMap) -> PointMap:
    """A coarse interpolated map on a smaller window, with fallback cells."""
    return interpolated_map(exact, CellGrid((-pi, -200.0), (pi, 200.0), (48, 48)), tolerance=1e-2)


@pytest.mark.parametrize(
    ("make", "table"),
    [(henon, None), (lambda: henon(0.5), None), (lambda: pendulum(0.003), None), (lambda: pendulum(0.010), doubtful)],
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
    monkeypatch.setattr("cellmap.attractors.settling.POOL", pool)
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
    }
    ends = {s: Label[s.name] if s.name in Label.__members__ else Label.UNDECIDED for s in Status}
    assert label_of(list(ends)).tolist() == list(ends.values())
    assert list(LABEL_NAMES) == list(Label)


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


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300, -1e300])
def test_boxes_of_numbers_that_have_none(bad):
    cover = Cover(np.array([-pi, -1.0]), np.array([pi / 4, 0.5]), np.array([[0, 0], [7, 3]]))
    assert not inside_cover(cover, np.array([[0.0, bad]]), COVERED).any()


@given(st.sets(st.tuples(st.integers(-50, 50), st.integers(-3, 3), st.integers(0, 9)), min_size=1, max_size=40))
def test_keys_are_different_and_in_order(boxes):
    reference = np.array(sorted(boxes))
    keys = box_keys(reference, reference)
    assert (np.diff(keys) > 0).all()
    assert keys.min() >= 0
    assert box_keys(reference + np.array([1000, 0, 0]), reference).tolist() == [-1] * len(boxes)


def test_boxes_wrap_along_an_angle():
    places = boxes_of(np.array([[-pi, 0.0], [pi - 1e-9, 0.0]]), np.array([-pi, 0.0]), np.array([pi / 4, 1.0]), COVERED)
    assert places.tolist() == [[0, 0], [7, 0]]


def test_visit_to_a_cover_shorter_than_the_residence_does_not_count():
    """Orbits that pass near the chaotic attractor and diverge later are not captured by it."""
    basins = find_basins(henon(), CellGrid((-2.0, -2.0), (2.0, 2.0), (40, 40)))
    (chaotic,) = basins.attractors
    assert chaotic.kind is Kind.CHAOTIC
    orbit = henon().orbit(basins.grid.centres(), 2000)
    diverged = orbit.status[-1] == Status.DIVERGED
    assert np.array_equal(basins.labels == Label.DIVERGED, diverged)
