"""Chaotic attractors that come close to each other are two; one of several bands, or with rare changes, is one."""

from typing import Any

import numpy as np
import pytest

from cellmap import CellGrid, discrete_map, find_attractors, find_basins
from cellmap.attractors.kinds.clouds import Clouds, recurrent_groups
from cellmap.basins import load_basins, save_basins
from cellmap.orbits import Kind

ODD = discrete_map(lambda x, p: (p.a * x[0] - x[0] ** 3,), {"a": 2.6}, ("x",))
CUBIC = discrete_map(lambda x, p: (p.a * x[0] - x[0] ** 3 + p.b * x[1], x[0]), {"a": 2.6, "b": -0.1}, ("x", "y"))
LOGISTIC = discrete_map(lambda x, p: (p.a * x[0] * (1 - x[0]),), {"a": 3.6}, ("x",))
LINE = CellGrid((-1.8,), (1.8,), (400,))


def thorough(*values: float) -> Any:
    return pytest.param(*values, marks=pytest.mark.thorough)


def gap(a: float) -> float:
    """Half of the gap between the attractors of a x - x^3: the image of the maximum m, at sqrt(a/3), is the minimum."""
    m = 2.0 * (a / 3.0) ** 1.5
    return m * (a - m * m)


@pytest.mark.parametrize("a", [2.4, 2.59807, *(thorough(a) for a in (2.58, 2.592, 2.595, 2.598, 2.59805))])
def test_two_attractors_with_any_gap_between_them(a: float) -> None:
    """[g, m] and its mirror image are invariant below the merging crisis at a = 3 sqrt(3)/2 = 2.5980762."""
    assert gap(a) > 0.0
    basins = find_basins(ODD.with_params(a=a), LINE)
    assert [k.kind for k in basins.attractors] == [Kind.CHAOTIC] * 2
    assert [f.fraction for f in basins.fractions.values()] == [0.5, 0.5]
    for attractor in basins.attractors:
        assert np.abs(attractor.points).min() >= gap(a) * (1 - 1e-9)
        assert len(set(np.sign(attractor.points[:, 0]))) == 1
        assert attractor.resolution is not None and 0.0 < attractor.resolution[0] < 0.002


@pytest.mark.parametrize("a", [2.5981, thorough(2.599), thorough(2.61)])
def test_one_attractor_beyond_the_merging_crisis(a: float) -> None:
    """At a = 2.5981 an orbit changes sides once in some 540 steps (20 orbits of 100,000 steps in NumPy)."""
    assert gap(a) < 0.0
    basins = find_basins(ODD.with_params(a=a), LINE, max_periods=500)
    assert [k.kind for k in basins.attractors] == [Kind.CHAOTIC]
    assert basins.fractions[0].fraction == 1.0


@pytest.mark.parametrize(("a", "bands"), [thorough(3.58, 4), (3.6, 2), thorough(3.65, 2), (3.7, 1)])
def test_bands_that_orbits_visit_in_turn_are_one_attractor(a: float, bands: int) -> None:
    """The bands of the logistic map merge at 3.6786 and 3.5926 (Grossmann and Thomae 1977)."""
    (found,) = find_attractors(LOGISTIC.with_params(a=a), np.linspace(0.05, 0.95, 60)[:, None], max_periods=500)
    assert found.kind is Kind.CHAOTIC
    gaps = np.diff(np.sort(found.points[:, 0]))
    assert np.count_nonzero(gaps > 2e-3) == bands - 1


@pytest.mark.parametrize(
    ("a", "number"), [(2.49, 4), thorough(2.6, 2), thorough(2.61, 2), (2.62, 1), thorough(2.65, 1)]
)
def test_pairs_in_the_plane(a: float, number: int) -> None:
    """The cubic map of Holmes (1979), against 400 orbits of 20,000 steps in NumPy.

    They come no nearer to x = 0 than 0.0084 at 2.61, and all of them change sides at 2.62.  At 2.49 they are on four
    attractors, to which 62, 62, 10 and 10 of these initial conditions belong.
    """
    basins = find_basins(CUBIC.with_params(a=a), CellGrid((-1.3, -1.2), (1.3, 1.2), (12, 12)))
    assert [k.kind for k in basins.attractors] == [Kind.CHAOTIC] * number
    counts = {4: [10, 10, 62, 62], 2: [72, 72], 1: [144]}[number]
    assert sorted(np.bincount(basins.labels.ravel())) == counts


def test_samples_with_equal_orbits_are_of_one_set() -> None:
    """Mirror images of initial conditions have one orbit: no sample has neighbours elsewhere than in its copy."""
    begin = LOGISTIC.with_params(a=3.9).iterate(np.linspace(0.1, 0.4, 8)[:, None], 500).points
    samples = list(LOGISTIC.with_params(a=3.9).orbit(begin, 500).points.swapaxes(0, 1))
    assert set(Clouds(LOGISTIC, [*samples, *samples], np.ones(1)).group) == {0}


def test_sets_are_one_where_orbits_go_to_and_fro_or_not_back_in_common_boxes() -> None:
    """Samples on [0, 0.1] and [1, 1.1], where all points rest; the orbit of the first was at two places before."""
    rest = discrete_map(lambda x, p: (x[0],), {}, ("x",))
    clouds = Clouds(rest, [np.linspace(k, k + 0.1, 50)[:, None] for k in (0, 1)], np.ones(1))
    for before, width, number in (
        ((0.05, 1.05), 0.3, 1),
        ((1.05, 1.05), 0.3, 2),
        ((0.5, 0.5), 0.3, 2),
        ((0.5, 0.5), 3.0, 1),
    ):
        path = np.array(before)[:, None, None]
        group, leaves = recurrent_groups(clouds, path, np.array([width]), np.empty((0, 16, 1)))
        assert (len(set(group)), leaves[0]) == (number, 0.05 not in before)


def test_the_distance_at_which_attractors_are_resolved_is_kept_in_files(tmp_path) -> None:
    basins = find_basins(ODD.with_params(a=2.595), LINE, max_periods=200)
    again = load_basins(save_basins(basins, tmp_path / "two.h5"))
    for one, other in zip(basins.attractors, again.attractors, strict=True):
        assert np.array_equal(one.resolution, other.resolution)
        assert one.cover is not None and np.array_equal(one.cover.boxes, other.cover.boxes)


# --- what rests by the end is on no chaotic attractor

SUPERSTABLE = {
    13: 3.6797028056802543,
    22: 3.778227331134958,
    25: 3.7304557021635225,
    32: 3.6483484357989004,
    40: 3.615399687690841,
}
"""Parameters at which the critical point of the logistic map has a period, to rounding (bisection in NumPy)."""


@pytest.mark.parametrize(("period", "a"), [p if p[0] in (13, 25) else thorough(*p) for p in SUPERSTABLE.items()])
def test_no_chaos_where_orbits_come_to_rest(period: int, a: float) -> None:
    """Of 300 orbits some rest by the end on the superstable cycle, and others wander for up to 300,000 steps."""
    point_map = LOGISTIC.with_params(a=a)
    basins = find_basins(point_map, CellGrid((0.001,), (0.999,), (300,)), longest_period=40)
    (cycle,) = basins.attractors
    assert cycle.kind is Kind.PERIODIC and cycle.period == period
    assert np.abs(cycle.points - 0.5).min() < 1e-7
    later = point_map.iterate(basins.grid.centres(), 2000 + 100 * period).points[:, 0]
    away = np.abs(later[:, None] - cycle.points[:, 0]).min(axis=1)
    assert (away[basins.labels == 0] < 1e-7).all()  # rounding grows by up to 1e8 within a period
    assert 0 < np.count_nonzero(basins.labels == 0) < 300
    assert (basins.labels[basins.labels != 0] == -3).all()


@pytest.mark.thorough
def test_chaos_beside_a_cycle_is_kept() -> None:
    """A Henon map with a chaotic attractor and a cycle of period 6, on which 72 of 400 orbits of 100,000 steps end."""
    both = discrete_map(lambda x, p: (1 - 1.07 * x[0] ** 2 + x[1], 0.3 * x[0]), {}, ("x", "y"))
    basins = find_basins(both, CellGrid((-0.9, -0.3), (0.9, 0.3), (20, 20)))
    assert [a.kind for a in basins.attractors] == [Kind.PERIODIC, Kind.CHAOTIC]
