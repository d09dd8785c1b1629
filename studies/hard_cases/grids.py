"""Windows and grids."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from math import pi
from unittest import mock

import numpy as np

from cellmap import CellGrid, discrete_map, find_basins, interpolated_map, stroboscopic_map
from systems import driven_pendulum

from .._unsettled import unsettled_basins
from .case import Finding, at_most, hard_case, is_so, refused

ESCAPED = -1


@hard_case(
    "A window that all orbits leave",
    why="Nothing can be learned in it: there is no attractor inside, and the table has no images that lead on.",
    expected='With outside="escape" every orbit has escaped; with outside="integrate" the labels are those of direct '
    "integration.",
)
def all_leave() -> Iterator[Finding]:
    exact = stroboscopic_map(driven_pendulum())
    window = CellGrid((0.5, 60.0), (0.9, 70.0), (20, 20))
    lost = unsettled_basins(interpolated_map(exact, window, outside="escape"), window)
    yield is_so(
        "escape: no attractor, 400 of 400 orbits escaped", not lost.attractors and bool((lost.labels == ESCAPED).all())
    )
    kept = find_basins(interpolated_map(exact, window, outside="integrate"), window)
    direct = find_basins(exact, window)
    yield is_so(f"integrate: {len(kept.attractors)} attractors", len(kept.attractors) == len(direct.attractors) >= 1)
    yield at_most("labels that differ from direct integration", int(np.count_nonzero(kept.labels != direct.labels)), 2)


@hard_case(
    "Grids of one cell and of two",
    why="No neighbours to interpolate between, and a circle of one or two cells is its own neighbour.",
    expected="The labels of direct integration, as the table knows that it is too coarse and leaves all to the exact "
    "map. Only a table of one cell whose centre is a fixed point passes its own check, which is at the "
    "centres; its measured error is that of a guess.",
)
def one_and_two_cells() -> Iterator[Finding]:
    exact = stroboscopic_map(driven_pendulum())
    initial_conditions = CellGrid((-pi, -100.0), (pi, 100.0), (12, 12))
    direct = find_basins(exact, initial_conditions)
    for shape in ((2, 1), (1, 2), (2, 2)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that all cells are fallback cells
            table = interpolated_map(exact, CellGrid((-pi, -100.0), (pi, 100.0), shape), outside="integrate")
        wrong = int(np.count_nonzero(find_basins(table, initial_conditions).labels != direct.labels))
        yield at_most(f"table of {shape[0]} x {shape[1]} cells: wrong labels of 144", wrong, 0)
    single = interpolated_map(exact, CellGrid((-pi, -100.0), (pi, 100.0), (1, 1)), outside="integrate")
    yield is_so(
        f"interpolation on 1 x 1 cells: its measured median error is {single.error(1000).median:.2g}",
        single.error(1000).median > 1.0,
    )
    one = find_basins(exact, CellGrid((-pi, -100.0), (pi, 100.0), (1, 1)))
    yield is_so("basins on one cell, whose centre hangs", one.labels.tolist() == [[0]] and len(one.attractors) == 1)


@hard_case(
    "A grid of 100,000,000 cells",
    why="Its table needs gigabytes; running out of memory after minutes is the worst of answers.",
    expected="Refused at once, with the memory that it needs and what to do, where less is free (here 1 GB); a million"
    " million cells are refused on any machine.",
)
def many_cells() -> Iterator[Finding]:
    halves = discrete_map(lambda x, p: (0.5 * x[0], 0.5 * x[1]), {}, ("x", "y"))
    large, larger = (CellGrid((-1.0, -1.0), (1.0, 1.0), (n, n)) for n in (10_000, 1_000_000))
    with mock.patch("cellmap._lib.checks.memory_available", return_value=10**9):
        yield refused("table of 1e8 cells", lambda: interpolated_map(halves, large), MemoryError, "GB are free")
        yield refused("centres of 1e8 cells", large.centres, MemoryError, "take fewer cells")
    yield refused("table of 1e12 cells", lambda: interpolated_map(halves, larger), MemoryError, "TB")
    yield refused("basins of 1e12 cells", lambda: find_basins(halves, larger), MemoryError, "take fewer initial")
    yield is_so(
        "a grid itself takes no memory, and finds a cell of 1e12",
        int(larger.locate([[1e-9, -1e-9]])[0]) == 500_000_499_999,
    )
