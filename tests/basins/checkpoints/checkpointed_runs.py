"""Runs with a checkpoint, how they are ended early, and whether their results are equal."""

from __future__ import annotations

import threading
from collections.abc import Callable
from math import cos, pi, sin

import numpy as np
import pytest
from known_basins import assert_same_record

import cellmap
import cellmap._lib.checkpoint
import systems
from cellmap import Basins, CellGrid, ForcedSystem, discrete_map, find_basins, interpolated_map, stroboscopic_map


class Died(BaseException):
    """What ends a run in the middle here, as a signal does elsewhere."""


def forced(t, x, p):
    return x[1], x[0] - x[0] ** 3 - p.delta * x[1] + p.gamma * cos(t)


DUFFING = stroboscopic_map(ForcedSystem(forced, {"delta": 0.2, "gamma": 0.1}, 2 * pi, ("q", "v")), rtol=1e-5, atol=1e-5)
WINDOW = CellGrid((-2.2, -2.2), (2.2, 2.2), (125, 115))  # four tiles of `TILE`


def pendulum():
    return stroboscopic_map(systems.driven_pendulum(amplitude=0.010), rtol=1e-6, atol=1e-6)


def conservative(x, p):
    """Hénon's area-preserving map: nothing settles, some orbits diverge."""
    y = x[1] - x[0] * x[0]
    return x[0] * cos(p.angle) - y * sin(p.angle), x[0] * sin(p.angle) + y * cos(p.angle)


TILE = 4096  # initial conditions, for the fixture `small_tiles`

CASES: dict[str, Callable[..., Basins]] = {
    # Two attractors that the sample finds; one pass.
    "one pass": lambda **how: find_basins(DUFFING, WINDOW, **how),
    # Small basins are found among the active orbits, and the sweep begins again for some of them.
    "small basins": lambda **how: find_basins(
        pendulum(), CellGrid((-pi, -500.0), (pi, 500.0), (100, 85)), 600, 8, **how
    ),
    # Everything is left after each pass.
    "undecided": lambda cells=(70, 65), **how: find_basins(
        discrete_map(conservative, {"angle": 1.327}, ("x", "y")), CellGrid((-0.6, -0.6), (0.6, 0.6), cells), 520, **how
    ),
    # The same with multi-period steps, on whose division orbits depend.
    "multi-period steps": lambda **how: find_basins(
        interpolated_map(
            discrete_map(conservative, {"angle": 1.327}, ("x", "y")),
            CellGrid((-1, -1), (1, 1), (60, 60)),
            outside="escape",
            max_step=8,
        ),
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
