"""Sweeps over initial conditions, with labels in memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .._lib.threads import slices
from ..attractors.labels import LABEL_NAMES, Label
from ..attractors.search import Examined
from ..attractors.settling import Settled
from ..maps.orbit_batch import CHUNK, NOTHING, Tally
from ..orbits.attractor import Attractor, sort_key
from .initial_conditions import BLOCK, Rows
from .record import Basins


@dataclass(frozen=True, eq=False)
class Pass:
    """All that a pass over starts depends on, besides the map and the starts.

    ``rows``: starts that are labelled; ``legs``: periods after which earlier passes, with the same attractors, looked
    at those that went on, and which they have behind them now; ``horizon``: periods after which this one does;
    ``repeats``: passes up to that horizon before this one, with fewer attractors; ``undecided``: starts that the last
    of them left; ``tally``: what all passes before it took.
    """

    attractors: tuple[Attractor, ...]
    examined: Examined
    rows: Rows
    legs: tuple[int, ...]
    horizon: int
    repeats: int = 0
    undecided: int | None = None
    tally: Tally = NOTHING

    @cached_property
    def parts(self) -> list[slice]:
        """Tiles, as slices of the rows."""
        return slices(len(self.rows), CHUNK)

    def rows_of(self, number: int) -> slice | NDArray[np.int64]:
        """Return the starts of a tile."""
        part = self.parts[number]
        return part if self.rows.bits is None else self.rows[part]


class Kept:
    """Labels and settling times of all starts, in memory."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.shape, self.total = shape, int(np.prod(shape, dtype=object))
        self.labels = np.full(self.total, Label.UNDECIDED, np.int16)
        self.times = np.full(self.total, -1, np.int32)
        self.tallies = np.zeros((0, len(NOTHING)), np.int64)

    def resume(self, examined: Examined) -> Pass | None:
        """Return the pass that an earlier run has come to, if one has; `examined` is an empty record."""
        return None

    def begin(self, now: Pass) -> None:
        """Make ready for the tiles of a pass."""
        self.tallies = np.zeros((len(now.parts), len(NOTHING)), np.int64)

    def unfinished(self, now: Pass) -> list[int]:
        """Return the tiles of a pass that are to do."""
        return list(range(len(now.parts)))

    def put(self, number: int, rows: slice | NDArray[np.int64], settled: Settled) -> None:
        """Keep what became of a tile."""
        self.labels[rows], self.times[rows] = settled.labels, settled.times
        self.tallies[number] = settled.tally

    def where(self, wanted: Callable[[NDArray[np.int16]], NDArray[np.bool_]]) -> Rows:
        """Return the starts with labels of some kind."""

        def of(part: slice) -> NDArray[np.bool_]:
            self.forget()
            return wanted(self.labels[part])

        return Rows.where(self.total, of)

    def used(self, number: int) -> NDArray[np.bool_]:
        """Tell which of the attractors have a start."""
        used = np.zeros(number, bool)
        for part in slices(self.total, BLOCK):
            labels = self.labels[part]
            used |= np.bincount(labels[labels >= 0], minlength=number).astype(bool)
            self.forget()
        return used

    def finish(self, renumber: Callable[[NDArray[np.int16]], NDArray[np.int16]], make: Callable[..., Basins]) -> Basins:
        """Give labels their final numbers; return the picture that `make` makes of labels and settling times."""
        for part in slices(self.total, BLOCK):
            self.labels[part] = renumber(self.labels[part])
        return make(self.labels.reshape(self.shape), self.times.reshape(self.shape))

    def forget(self) -> None:
        """Give back memory whose contents are kept elsewhere."""


def in_use(
    attractors: tuple[Attractor, ...], kept: Kept
) -> tuple[tuple[Attractor, ...], Callable[[NDArray[np.int16]], NDArray[np.int16]]]:
    """Order the attractors, without those that no start ends on; also return what numbers the labels accordingly."""
    used = np.flatnonzero(kept.used(len(attractors))).tolist()
    used.sort(key=lambda k: sort_key(attractors[k]))
    lowest = min(LABEL_NAMES)
    numbers = np.arange(lowest, len(attractors), dtype=np.int16)
    for new, old in enumerate(used):
        numbers[old - lowest] = new
    return tuple(attractors[k] for k in used), lambda labels: numbers[labels - lowest]
