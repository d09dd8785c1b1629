"""Neighbouring parameter points to which known attractors of an atlas lead."""

from __future__ import annotations

import numpy as np
import pytest

from cellmap.bifurcations import AtlasKind
from cellmap.bifurcations.atlas_families import Attractors, Directory
from cellmap.bifurcations.atlas_neighbours import _neighbours

SHAPE = (3, 4)  # rows, columns


def at(places, kind=AtlasKind.PERIODIC, modulus=0.5, period=1):
    n = len(places)
    columns = (
        np.full(n, kind, np.int8),
        np.full(n, period),
        np.zeros((n, 1), np.int64),
        np.zeros((n, 1)),
        np.zeros((n, 2)),
    )
    return Attractors(np.array(places), *columns, np.full(n, modulus), np.ones(n, np.int64))


@pytest.mark.parametrize("place", range(12))
def test_all_neighbours_inside_the_grid_and_no_others(place):
    found = at([place])
    row, column = divmod(place, 4)
    expected = {4 * r + c for r in range(3) for c in range(4) if abs(r - row) + abs(c - column) == 1}
    source, there = _neighbours(found, Directory.of(found), np.array([0]), SHAPE)
    assert set(there.tolist()) == expected
    assert len(there) == len(expected)
    assert (source == 0).all()


def test_neighbours_where_it_is_known_are_left_out():
    found = at([5, 6])
    source, there = _neighbours(found, Directory.of(found), np.array([0, 1]), SHAPE)
    assert sorted(zip(source.tolist(), there.tolist(), strict=True)) == [
        (0, 1),
        (0, 4),
        (0, 9),
        (1, 2),
        (1, 7),
        (1, 10),
    ]
