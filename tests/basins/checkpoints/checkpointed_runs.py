"""Runs with a checkpoint, and how they are ended early."""

import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from known_basins import RUNS, found

import cellmap
import cellmap._lib.checkpoint
from cellmap import Basins, CellGrid


class Died(BaseException):
    """What ends a run in the middle here, as a signal does elsewhere."""


TILE = 4096  # initial conditions, for the fixture `small_tiles`

CASES: dict[str, Callable[..., Basins]] = {name: partial(found, name) for name in RUNS}


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


def interrupted(run: Callable[..., object], path: Path, tiles: int) -> Path:
    """Let a run with a checkpoint die after some tiles; return its file."""
    with pytest.MonkeyPatch.context() as patch, pytest.raises(Died):
        dying(patch, tiles, False)
        run(checkpoint=path)
    return path


TABLE = CellGrid((-2.2, -2.2), (2.2, 2.2), (200, 150))  # three tiles of nodes, two of cells
