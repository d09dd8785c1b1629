"""More attractors than 16 bits distinguish: labels of 32 bits, everywhere.

But for one test that has as many, 40 count as too many for 16 bits.
"""

from dataclasses import replace
from math import floor

import numpy as np
import pytest

from cellmap import CellGrid, discrete_map, find_attractors, find_basins, interpolated_map, load_basins, save_basins
from cellmap.analysis.resilience import basin_stability
from cellmap.attractors import labels
from cellmap.attractors.settling.settle import Catalogue, settle
from cellmap.basins import certify
from cellmap.exchange import from_xarray, to_xarray
from cellmap.maps.orbit_batch import Orbits

NUMBER, MOST = 60, 40
GRID = CellGrid((-0.5,), (NUMBER - 0.5,), (4 * NUMBER,))
NUMBERS = np.arange(4 * NUMBER) // 4


def step(x, p):
    """Halve the distance to the nearest whole number."""
    nearest = floor(x[0] + 0.5)
    return (nearest + 0.5 * (x[0] - nearest),)


@pytest.fixture(autouse=True)
def few_are_many(monkeypatch):
    monkeypatch.setattr(labels, "_MOST", MOST)


@pytest.fixture(scope="module")
def staircase():
    return discrete_map(step, {}, ("x",))


@pytest.fixture(scope="module")
def origin(staircase):
    (origin,) = find_attractors(staircase, [[0.3]])
    return origin


def all_numbers(origin, number):
    region = origin.neighbourhood
    return [
        replace(origin, points=origin.points + k, neighbourhood=replace(region, centres=region.centres + k))
        for k in range(number)
    ]


@pytest.fixture
def basins(staircase, origin):
    # In another order than that of the labels, which are given by the distance from the origin.
    return find_basins(staircase, GRID, max_periods=20, attractors=all_numbers(origin, NUMBER)[::-1])


def test_each_cell_has_the_label_of_its_whole_number(basins, staircase):
    assert basins.labels.dtype == np.int32
    assert np.array_equal(basins.labels, NUMBERS)
    assert [a.points[0, 0] for a in basins.attractors[-3:]] == [NUMBER - 3, NUMBER - 2, NUMBER - 1]
    assert basins.fractions[NUMBER - 1].count == 4
    assert basins.verify(200).wrong == 0
    some = basin_stability(staircase, lambda rng, n: np.full((n, 1), NUMBER - 1.2), 10, basins.attractors)
    assert (some.labels == NUMBER - 1).all()


@pytest.mark.thorough
def test_files_and_labelled_arrays_keep_them(basins, staircase, origin, tmp_path):
    save_basins(basins, tmp_path / "basins.h5")
    assert np.array_equal(load_basins(tmp_path / "basins.h5").labels, basins.labels)
    assert np.array_equal(from_xarray(to_xarray(basins)).labels, basins.labels)
    known = all_numbers(origin, NUMBER)[::-1]
    kept = find_basins(staircase, GRID, 20, attractors=known, checkpoint=tmp_path / "run.h5")
    assert np.array_equal(kept.labels, basins.labels)


def test_certificates_have_them(staircase, origin):
    with pytest.warns(UserWarning, match="map not smooth"):
        table = interpolated_map(staircase, CellGrid((-0.5,), (NUMBER - 0.5,), (16 * NUMBER,)))
    certified = certify(find_basins(table, GRID, 20, attractors=all_numbers(origin, NUMBER)))
    assert certified.basins.labels.dtype == np.int32
    assert np.array_equal(certified.basins.labels, NUMBERS)


def test_more_than_16_bits_distinguish(staircase, origin, monkeypatch):
    monkeypatch.undo()
    many = 33_000
    catalogue = Catalogue.of(all_numbers(origin, many), staircase)
    settled = settle(staircase, Orbits.starting(np.array([[many - 1.3], [0.4]])), catalogue, 20)
    assert settled.labels.dtype == np.int32 and settled.labels.tolist() == [many - 1, 0]
