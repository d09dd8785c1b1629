"""Batches of orbits: their points, their status, and the work that they take."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._compiled.kernels import periods
from .._compiled.kernels.blocks import wrap_rows
from .._lib.arrays import Bools, Floats, Ints

CHUNK = 16384
"""Initial conditions in a slice of work.  Fixed, so that results do not depend on the number of threads."""


class Status(IntEnum):
    """Status of an orbit.

    An orbit with the status ESCAPED or a later one is terminated: its point is NaN and stays NaN.
    """

    OK = 0
    INACCURATE = periods.INACCURATE
    """The integrator missed its tolerance in some period; the point is its best value, at least one digit correct."""
    ESCAPED = periods.ESCAPED
    """The orbit left the window of an interpolated map."""
    DIVERGED = periods.DIVERGED
    """The orbit grew beyond all bounds (that of a flow to 1e100), or an angle reached 1e15 full rotations, where it has
    no phase; or it ended at a singularity of the right-hand side; or that, or the function of a discrete map, was not
    finite there or raised an exception."""
    NO_RETURN = 4
    """The orbit did not return to the Poincaré section."""
    OUT_OF_STEPS = periods.OUT_OF_STEPS
    """After the largest number of steps the orbit was not at the end of the period, or not one digit of it correct."""
    ENDED = periods.ENDED
    """The orbit came to the first of the ends of its system; that of the next one is one more, and so on."""


PERIODS_AT_ONCE = 2**15
"""Periods of all orbits together after which a compiled loop returns for a moment, so that Ctrl-C is heard."""

_FIRST_END = int(Status.ESCAPED)  # looking up a member of an enum costs more than the comparison


@dataclass(frozen=True, eq=False)
class Cost:
    """Time and work that a map or a basin image has taken.

    Parameters
    ----------
    seconds : float
        Wall time.
    steps : int
        Steps of a map: for an interpolated map its exact images, for basins the periods of all initial conditions.
    tabulation : float
        Wall time of computing the interpolation grid; for basins that of their map, which `seconds` leaves out.
    iteration : float
        Wall time of iteration, a part of `seconds`; the rest of it is the search for attractors.
    evaluations : int
        Right-hand sides that the integrator computed for these steps, or their series where it is a Taylor method, with
        those of steps that were repeated; applications of a discrete map.
    look_ups : int
        Evaluations of the interpolated map in these steps; a multi-period step is one of them.
    """

    seconds: float = 0.0
    steps: int = 0
    tabulation: float = 0.0
    iteration: float = 0.0
    evaluations: int = 0
    look_ups: int = 0


@dataclass(eq=False)
class Work:
    """Work that a batch of orbits took; maps count.  See :class:`Cost`."""

    evaluations: int = 0
    look_ups: int = 0

    def add(self, other: Work) -> None:
        """Count what was done for a part of the batch."""
        self.evaluations += other.evaluations
        self.look_ups += other.look_ups


class Tally(NamedTuple):
    """Work of labelling some initial conditions.

    ``steps``: periods of all of them; ``inaccurate``: those with a label on whose orbit the integrator missed its
    tolerance, for those that are undecided go on; ``evaluations``, ``look_ups``: see :class:`Cost`.
    """

    steps: int = 0
    inaccurate: int = 0
    evaluations: int = 0
    look_ups: int = 0

    def plus(self, other: Iterable[int]) -> Tally:
        """Return the sum of two."""
        return Tally(*(int(a + b) for a, b in zip(self, other, strict=True)))


NOTHING = Tally()


def portions(periods: int, orbits: int) -> Iterator[int]:
    """Yield numbers of periods that compiled loops take at once, between which Ctrl-C is noticed."""
    most = max(1, PERIODS_AT_ONCE // max(1, orbits))
    for done in range(0, periods, most):
        yield min(most, periods - done)


@dataclass(eq=False)
class Orbits:
    """Working state of a batch of orbits; kernels change it in place.

    ``points`` (n, d) float, ``rotations`` (n, d) int taken out of the angles, ``status`` (n,) uint8; ``work``
    is shared by all parts of a batch.
    """

    points: Floats
    rotations: Ints
    status: NDArray[np.uint8]
    work: Work = field(default_factory=Work)

    @classmethod
    def starting(cls, points: Floats) -> Orbits:
        """Begin orbits at the rows of an array, which is kept and changed."""
        return cls(points, np.zeros(points.shape, np.int64), np.zeros(len(points), np.uint8))

    @classmethod
    def joined(cls, parts: Sequence[Orbits]) -> Orbits:
        """Put batches one behind the other."""
        points, rotations, status = (
            np.concatenate([getattr(o, n) for o in parts]) for n in ("points", "rotations", "status")
        )
        return cls(points, rotations, status)

    def __getitem__(self, part: Any) -> Orbits:
        return Orbits(self.points[part], self.rotations[part], self.status[part], self.work)

    def __setitem__(self, part: Any, other: Orbits) -> None:
        self.points[part], self.rotations[part], self.status[part] = other.points, other.rotations, other.status

    def __len__(self) -> int:
        return len(self.points)

    @property
    def alive(self) -> Bools:
        """Orbits that have a point."""
        return self.status < _FIRST_END

    def living(self) -> Iterator[Orbits]:
        """Yield those orbits that have a point, once, unless there are none; what is done to them is kept."""
        alive = self.alive
        if alive.all():
            if len(self):
                yield self
        elif alive.any():
            some = self[alive]
            yield some
            self[alive] = some

    def wrap(self, lower: Floats, turn: Floats) -> None:
        """Wrap angles, and terminate orbits whose angle is so large that it has no phase."""
        if wrap_rows(self.points, self.rotations, lower, turn):
            self.end(np.flatnonzero(np.isnan(self.points).any(axis=1) & self.alive), Status.DIVERGED)

    def end(self, where: NDArray[Any], status: Status) -> None:
        """Mark orbits as ended."""
        self.status[where] = status
        self.points[where] = np.nan
