"""Stores of labels and settling times: in memory here, in a file in :mod:`cellmap.basins.label_file`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Bools, Ints
from .._lib.threads import slices
from ..attractors.kinds.examined import Examined
from ..attractors.settling.labels import LABEL_NAMES, Label, label_type
from ..attractors.settling.settle import Settled
from ..maps.orbit_batch import NOTHING
from .initial_conditions import BLOCK, Rows
from .record import Basins, label_counts
from .sweeps import Progress

HELD = 2**20
"""Active orbits whose states are kept from one sweep to the next; those of more are computed again."""

_HELD_BYTES = 256  # bytes for each of these states, while they are put together


class LabelStore(ABC):
    """Flat arrays ``labels`` and ``times`` of all initial conditions, and the ``tallies`` of the tiles of a sweep."""

    labels: NDArray[np.int16]
    times: NDArray[np.int32]
    tallies: Ints

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.shape, self.total = shape, int(np.prod(shape, dtype=object))

    @abstractmethod
    def finished(self) -> Basins | None:
        """Return the basins of an earlier run that has come to its end."""

    @abstractmethod
    def resume(self, examined: Examined) -> Progress | None:
        """Return how far an earlier run has come, if there was one; `examined` is an empty record."""

    @abstractmethod
    def begin(self, now: Progress) -> None:
        """Make ready for the tiles of a sweep."""

    @abstractmethod
    def unfinished(self, now: Progress) -> list[int]:
        """Return the tiles of a sweep that are to do."""

    @abstractmethod
    def put(self, number: int, rows: slice | Ints, settled: Settled) -> None:
        """Keep the labels and times of a finished tile."""

    @abstractmethod
    def finish(self, basins: Basins, numbers: NDArray[np.int16]) -> Basins:
        """Return basins with labels of their final numbers: ``numbers[label - lowest]``, from the lowest label on."""

    @abstractmethod
    def release(self) -> None:
        """Give memory back whose contents are kept elsewhere."""

    def cut_short(self, now: Progress | None) -> InMemory:
        """Return what is decided where a run has ended before its end, in some sweep; None where it has none yet."""
        kept = InMemory(self.shape)
        if now is not None:
            kept.labels[:], kept.times[:] = self.labels, self.times
            if now.rows.bits is None:
                for number in self.unfinished(now):
                    rows = now.rows_of(number)
                    kept.labels[rows], kept.times[rows] = Label.UNLABELLED, -1
        # Those that are undecided so far may settle in the periods that are left.
        kept.labels[kept.labels == Label.UNDECIDED] = Label.UNLABELLED
        return kept

    def where(self, wanted: Callable[[NDArray[np.int16]], Bools]) -> Rows:
        """Return the initial conditions with labels of some kind."""

        def of(part: slice) -> Bools:
            self.release()
            return wanted(self.labels[part])

        return Rows.where(self.total, of)

    def used(self, number: int) -> Ints:
        """Return which of the attractors have an initial condition."""
        return np.flatnonzero(label_counts(self.labels, number, self.release)[-min(LABEL_NAMES) :])


class InMemory(LabelStore):
    """Labels and settling times in memory."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        super().__init__(shape)
        self.labels = np.full(self.total, Label.UNLABELLED, np.int16)
        self.times = np.full(self.total, -1, np.int32)

    def finished(self) -> Basins | None:
        """Return nothing: there was no earlier run."""
        return None

    def resume(self, examined: Examined) -> Progress | None:
        """Return nothing: there was no earlier run."""
        return None

    def begin(self, now: Progress) -> None:
        """Make ready for the tiles of a sweep."""
        if (kind := label_type(len(now.attractors))) is not self.labels.dtype.type:
            self.labels = self.labels.astype(kind)
        self.tallies = np.zeros((len(now.parts), len(NOTHING)), np.int64)

    def unfinished(self, now: Progress) -> list[int]:
        """Return all tiles."""
        return list(range(len(now.parts)))

    def cut_short(self, now: Progress | None) -> InMemory:
        """Return what is decided where a run has ended before its end."""
        self.labels[self.labels == Label.UNDECIDED] = Label.UNLABELLED
        return self

    def put(self, number: int, rows: slice | Ints, settled: Settled) -> None:
        """Keep the labels and times of a finished tile."""
        self.labels[rows], self.times[rows] = settled.labels, settled.times
        self.tallies[number] = settled.tally

    def release(self) -> None:
        """Keep everything: it is nowhere else."""

    def finish(self, basins: Basins, numbers: NDArray[np.int16]) -> Basins:
        """Return basins with labels of their final numbers."""
        if numbers.dtype != self.labels.dtype:
            self.labels = numbers[self.labels.astype(np.int64) - min(LABEL_NAMES)]
        elif (numbers != np.arange(len(numbers)) + min(LABEL_NAMES)).any():
            for part in slices(self.total, BLOCK):
                self.labels[part] = numbers[self.labels[part] - min(LABEL_NAMES)]
        labels, times = self.labels.reshape(self.shape), self.times.reshape(self.shape)
        return replace(basins, labels=labels, settling_time=times)


def basins_memory(initial_conditions: int, checkpoint: bool = False) -> int:
    """Return the bytes of memory that the labels and settling times of a number of initial conditions need.

    With a checkpoint these are on the disk; a few bits for each initial condition remain in memory, which select those
    of the present sweep and the next one, and the states of active orbits, as long as they are few.

    Examples
    --------
    >>> basins_memory(10**8) // 10**6, basins_memory(10**8, checkpoint=True) // 10**6
    (625, 305)
    """
    if checkpoint:
        return 3 * (initial_conditions // 8) + _HELD_BYTES * min(initial_conditions, HELD)
    return 6 * initial_conditions + 24 * min(initial_conditions, BLOCK)


def basins_disk(initial_conditions: int) -> int:
    """Return the bytes on the disk that a checkpoint needs: twice, for a file is made before the older one goes.

    Examples
    --------
    >>> basins_disk(10**8) // 10**6
    1225
    """
    return 2 * (6 * initial_conditions + initial_conditions // 8) + 2**20 // 4
