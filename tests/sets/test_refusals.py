"""What does not fit together: an error that names the argument and says what to do.

Arguments that are wrong by themselves are those of `tests/_lib/bad_input/`.
"""

from math import pi

import numpy as np
import pytest
from maps_of_cells import AWAY, CUBIC, FIVE_CELLS, HALVES, HENON, SADDLE, TURNING, line

from cellmap import CellGrid
from cellmap.sets import (
    BoxSet,
    box_image,
    generalized_cell_mapping,
    relative_attractor,
    simple_cell_mapping,
    transfer_operator,
    unstable_set,
)
from cellmap.sets import maximal_invariant_set as invariant_set

SQUARE = CellGrid((-1, -1), (1, 1), (10, 10))
FULL = BoxSet.full(SQUARE)


def cells(lower, upper, shape=(10, 10), periods=1, point_map=HENON):
    return simple_cell_mapping(point_map, CellGrid(lower, upper, shape), periods)


def chain(point_map=HALVES, *samples, **noise):
    return generalized_cell_mapping(point_map, FIVE_CELLS, *samples, **noise)


def mapped(other):
    return cells((0, 0), (1, 1)).join(other)


def extended(*grid):
    return cells((0, 0), (1, 1)).extend(CellGrid(*grid))


REFUSED = {
    r"keys run from 0 to 100.*0 to 99": lambda: BoxSet(SQUARE, [0, 100]),
    "boxes of one grid": lambda: FULL | BoxSet.full(CellGrid((0, 0), (1, 1), (2, 2))),
    r"2\*\*62.*bisect fewer": lambda: BoxSet(CellGrid((0,) * 4, (1,) * 4, (2**16,) * 4), []),
    r"samples='many'.*adaptive": lambda: box_image(FULL, HENON, "many"),
    r"grid\.on": lambda: box_image(line(4, -pi, pi), TURNING),
    r"depth=\(1, 2, 3\).*2 coordinates": lambda: relative_attractor(SADDLE, SQUARE, (1, 2, 3)),
    "depth=40.*at most 2.*62": lambda: relative_attractor(SADDLE, SQUARE, 40),
    "1 axis and the system 2": lambda: invariant_set(SADDLE, FIVE_CELLS, 2),
    r"points=\[5.0, 0.0\].*in the region": lambda: unstable_set(SADDLE, [5.0, 0.0], SQUARE),
    "at least one box": lambda: transfer_operator(BoxSet(FIVE_CELLS, []), CUBIC),
    "take fewer cells": lambda: cells((-1,), (1,), (10**12,), point_map=HALVES),
    "whole cells more": lambda: extended((0, 0), (2, 1), (30, 10)),
    "whole cells away": lambda: extended((-0.05, 0), (1.05, 1), (11, 10)),
    "widen it": lambda: extended((0.1, 0), (1.1, 1), (10, 10)),
    "use extend, which": lambda: mapped(cells((1.5, 0), (2.5, 1))),
    "take as many": lambda: mapped(cells((1, 0), (2, 1), periods=2)),
    "by one map": lambda: mapped(cells((1, 0), (2, 1), point_map=HENON.with_params(a=1.3))),
    "one for each axis": lambda: chain(HALVES, (5, 5)),
    "samples=.* at least 1": lambda: chain(HALVES, (0,)),
    "samples=.*at most": lambda: chain(HALVES, 10**6),
    "samples=0: .*at least 1": lambda: chain(HALVES, 0),
    "at most .* points of a cell": lambda: chain(HALVES, (10**6,)),
    "one standard deviation": lambda: chain(noise=(1.0, 1.0)),
    r"noise returned the shape \(25,\)": lambda: chain(noise=lambda rng, n: rng.normal(size=n)),
    "noise returned nan: return finite numbers": lambda: chain(noise=lambda rng, n: np.full((n, 1), np.nan)),
    r"0 closed classes.*no density": lambda: chain(AWAY).density(),
}


def test_eigenvectors_claim_their_memory(monkeypatch):
    operator = transfer_operator(line(3000), CUBIC, 2)
    monkeypatch.setattr("cellmap._lib.checks._ALWAYS_FREE", 0)
    monkeypatch.setattr("cellmap._lib.checks.memory_available", lambda: 1000)
    with pytest.raises(MemoryError, match=r"eigenvectors of 3,000 boxes needs 1.15 MB .*: ask for fewer"):
        operator.eigenvalues(4)


@pytest.mark.parametrize("message", REFUSED)
def test_what_is_wrong_is_named(message):
    with pytest.raises((ValueError, MemoryError), match=message):
        REFUSED[message]()
