"""How long orbits have to stay on a chaotic attractor, and how many of them are followed for long."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cellmap import CellGrid, discrete_map, find_basins
from cellmap.attractors import chaos
from cellmap.attractors.residence import with_full_residence, with_residence
from cellmap.attractors.settling import RESIDENCE, Catalogue, classify
from cellmap.attractors.wandering import are_chaotic, representatives
from cellmap.basins import LiveBasins, continue_basins, load_basins, save_basins
from cellmap.maps.point_map import PointMap
from systems import henon_map

HENON = henon_map()
CUBIC = discrete_map(lambda x, p: (p.a * x[0] - x[0] ** 3 - 0.1 * x[1], x[0]), {"a": 2.61}, ("x", "y"))
ODD = discrete_map(lambda x, p: (2.598 * x[0] - x[0] ** 3,), {}, ("x",))
SIX = discrete_map(lambda x, p: (1 - 1.07 * x[0] ** 2 + x[1], 0.3 * x[0]), {}, ("x", "y"))
CASES = {
    "Henon": (HENON, CellGrid((-2.0, -2.0), (2.0, 2.0), (96, 96))),
    "a pair that nearly touches": (CUBIC, CellGrid((-1.3, -1.2), (1.3, 1.2), (96, 96))),
    "a pair on a line": (ODD, CellGrid((-1.8,), (1.8,), (8192,))),
    "beside a cycle": (SIX, CellGrid((-0.9, -0.3), (0.9, 0.3), (96, 96))),
}


@pytest.mark.parametrize("name", CASES)
def test_labels_and_times_are_those_after_64_periods(name, tmp_path):
    point_map, grid = CASES[name]
    basins = find_basins(point_map, grid)
    covers = [a.cover for a in basins.attractors if a.cover is not None]
    assert all(8 <= cover.residence < RESIDENCE for cover in covers) and covers
    catalogue = Catalogue.of(with_full_residence(basins.attractors), point_map)
    full = classify(point_map, catalogue, grid.centres().reshape(-1, grid.dimension), 2000)
    assert np.array_equal(full.labels, basins.labels.ravel())
    assert np.array_equal(full.times, basins.settling_time.ravel())
    again = load_basins(save_basins(basins, tmp_path / "chaotic.h5"))
    assert [a.cover.residence for a in again.attractors if a.cover is not None] == [c.residence for c in covers]


def test_stays_that_end_are_counted():
    """x -> x + 1 passes ten boxes of width 1 and leaves; 2 of 3 orbits begin inside, after the 2nd and 7th of them."""
    (chaotic,) = (a for a in find_basins(HENON, [[0.1, 0.1]] * 40).attractors)
    shift = discrete_map(lambda x, p: (x[0] + 1.0, x[1]), {}, ("x", "y"))
    boxes = np.stack([np.arange(10), np.zeros(10, np.int64)], axis=1)
    cover = replace(chaotic.cover, lower=np.zeros(2), widths=np.ones(2), boxes=boxes)
    seen = with_residence(shift, [replace(chaotic, cover=cover)], np.array([[2.5, 0.5], [7.5, 0.5], [-9.5, 3.0]]), 30)
    assert seen[0].cover.residence == 2 * 8 + 8


def wandering(point_map: PointMap, number: int) -> np.ndarray:
    begin = np.random.default_rng(0).uniform(-0.5, 0.5, (number, 2))
    return point_map.iterate(begin, 500).points


def test_of_the_orbits_on_each_chaotic_set_as_many_are_kept():
    points = wandering(CUBIC, 800)
    kept = representatives(CUBIC, points, np.ones(2))
    assert are_chaotic(CUBIC, points, np.ones(2)) and len(kept) == 2 * 256
    assert np.count_nonzero(points[kept, 0] > 0) in range(200, 312)  # each orbit stays on its side
    away = np.concatenate([points, [[1.9, -1.7]]])  # an orbit that diverges
    assert not are_chaotic(CUBIC, away, np.ones(2)) or 800 in representatives(CUBIC, away, np.ones(2))


def test_all_orbits_are_kept_where_some_are_not_chaotic_or_they_are_few(monkeypatch):
    points = wandering(HENON, 600)
    points[300:] = [0.631354477089505, 0.18940634312685142]  # the fixed point
    monkeypatch.setattr(chaos, "_spectrum", None)  # no exponents are needed: it comes back to where it is
    assert not are_chaotic(HENON, points, np.ones(2))
    assert representatives(HENON, points[:300], np.ones(2)).tolist() == list(range(300))


def test_attractors_that_are_given_are_observed_on_the_orbits_to_be_labelled():
    point_map, grid = CASES["Henon"]
    basins = find_basins(point_map, grid)
    (chaotic,) = basins.attractors
    everywhere = np.ones(len(chaotic.cover.boxes), bool)
    short = replace(chaotic, cover=replace(chaotic.cover, residence=1, trapped=everywhere))
    again = find_basins(point_map, grid, attractors=[short])
    assert again.attractors[0].cover.residence == chaotic.cover.residence
    assert np.array_equal(again.labels, basins.labels) and np.array_equal(again.settling_time, basins.settling_time)
    few = find_basins(point_map, grid.centres().reshape(-1, 2)[::16], attractors=[short])
    assert few.attractors[0].cover.residence is None and few.attractors[0].cover.trapped is None
    assert np.array_equal(few.labels, basins.labels.ravel()[::16])


def test_an_attractor_whose_residence_is_observed_stays_one_attractor():
    point_map, grid = CASES["Henon"]
    sweep = continue_basins(point_map, "a", [1.4, 1.399], grid)
    assert sweep.labels == (0, -2) and [list(found) for found in sweep.attractors] == [[0], [0]]
    live = LiveBasins(point_map, grid, stride=4)
    for _ in range(2):
        assert live.image().identities == (0,)
