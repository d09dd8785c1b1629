"""Runs with a checkpoint, how they are ended early, and whether their results are equal."""

from __future__ import annotations

import threading
from collections.abc import Callable
from math import pi

import numpy as np
import pytest
from known_basins import CONSERVATIVE, assert_same_record, duffing, pendulum

import cellmap
import cellmap._lib.checkpoint
import systems
from cellmap import Basins, CellGrid, discrete_map, find_basins, interpolated_map


class Died(BaseException):
    """What ends a run in the middle here, as a signal does elsewhere."""


WINDOW = CellGrid((-2.2, -2.2), (2.2, 2.2), (125, 115))  # four tiles of `TILE`


TILE = 4096  # initial conditions, for the fixture `small_tiles`

CASES: dict[str, Callable[..., Basins]] = {
    # Two attractors that the sample finds; one pass.
    "one pass": lambda **how: find_basins(duffing(), WINDOW, **how),
    # Small basins are found among the active orbits, and the sweep begins again for some of them.
    "small basins": lambda **how: find_basins(
        pendulum(), CellGrid((-pi, -500.0), (pi, 500.0), (100, 85)), 600, 8, **how
    ),
    # Everything is left after each pass.
    "undecided": lambda cells=(70, 65), **how: find_basins(
        CONSERVATIVE, CellGrid((-0.6, -0.6), (0.6, 0.6), cells), 520, **how
    ),
    # The same with multi-period steps, on whose division orbits depend.
    "multi-period steps": lambda **how: find_basins(
        interpolated_map(CONSERVATIVE, CellGrid((-1, -1), (1, 1), (60, 60)), outside="escape", max_step=8),
        CellGrid((-0.6, -0.6), (0.6, 0.6), (70, 65)),
        520,
        **how,
    ),
    # A cover in the place of a neighbourhood: all initial conditions are labelled again.
    "chaotic": lambda **how: find_basins(systems.henon_map(), CellGrid((-2.0, -2.0), (2.0, 2.0), (95, 95)), 500, **how),
    "given starts": lambda **how: find_basins(
        discrete_map(lambda x, p: (x[0] / 2 + 1 / (2 * x[0]),), {}, ("x",), name="newton"),
        np.random.default_rng(0).uniform(-3.0, 3.0, (4, 9000, 1)),
        **how,
    ),
}


def assert_same(ours: Basins, theirs: Basins) -> None:
    for name in ("labels", "settling_time"):
        one, other = getattr(ours, name), getattr(theirs, name)
        assert one.dtype == other.dtype
        assert one.shape == other.shape
        assert np.array_equal(one, other), f"{name}: {np.count_nonzero(one != other)} of {one.size} differ"
    assert (ours.inaccurate, ours.cost.steps) == (theirs.inaccurate, theirs.cost.steps)
    assert ours.fractions == theirs.fractions
    assert len(ours.attractors) == len(theirs.attractors)
    for one, other in zip(ours.attractors, theirs.attractors, strict=True):
        assert_same_record(one, other)


def dying(monkeypatch: pytest.MonkeyPatch, moment: int, torn: bool) -> None:
    """Let the run die with the entry of one of its tiles, before it is made or in the middle of the contents.

    The other threads die with it: a checksum that one of them takes later would vouch for contents that were torn here.
    """
    original, left = cellmap._lib.checkpoint.Checkpoint.finish, moment
    lock = threading.Lock()

    def finish(self, tiles, number, tally, contents):
        nonlocal left
        with lock:
            left -= 1
            if left >= 0:
                return original(self, tiles, number, tally, contents)
            if torn and left == -1:  # contents that are not those of the tile, and an entry that says otherwise
                original(self, tiles, number, tally, contents)
                for name in {"tiles": ("labels", "settling_time")}.get(tiles, (tiles.removeprefix("tiles of "),)):
                    self[name].view(np.uint8).reshape(-1)[:: self[name].nbytes // 7] ^= 1
        raise Died

    monkeypatch.setattr(cellmap._lib.checkpoint.Checkpoint, "finish", finish)


TABLE = CellGrid((-2.2, -2.2), (2.2, 2.2), (200, 150))  # three tiles of nodes, two of cells
