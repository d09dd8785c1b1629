"""How a map moves orbits, as compiled loops call it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._compiled.codegen.period import CompiledPeriod
from .._compiled.kernels.labelling import DISCRETE, FLOW, NOT_COMPILED, PeriodStep, record
from .._compiled.kernels.periods import CompiledMap, iterate
from .._lib.arrays import Floats, Ints
from .._lib.computed import computed_once
from .._lib.stopping import check_stop
from .integration import Flow
from .orbit_batch import Orbits, portions

_COSTLY = 256  # weight of an orbit in a portion of work: a search can be stopped after fewer periods of one orbit

UNKNOWN_STEP = PeriodStep()
"""That of a map of which nothing is known but the function that it is."""


class CompiledAdvance(ABC):
    """An `advance` of a map that compiled loops can call without Python."""

    @property
    @abstractmethod
    def step(self) -> PeriodStep:
        """What these loops call."""

    @property
    def stages(self) -> int:
        """Evaluations of the right-hand side in a step of the integrator, or applications of the map."""
        return 1

    def take_lost(self) -> list[int]:
        """Return, once, the components that were too small to be known and then grew."""
        return []

    @abstractmethod
    def __call__(self, orbits: Orbits, periods: int) -> None:
        """Move a batch of orbits on by some periods, in place."""


@dataclass(frozen=True, eq=False)
class FlowAdvance(CompiledAdvance):
    """Periods of a flow, with the cuts and turns of its coordinates."""

    motion: Flow
    lower: Floats
    turn: Floats

    @property
    def step(self) -> PeriodStep:
        """Steps of the integrator."""
        return UNKNOWN_STEP._replace(kind=FLOW, motion=self.motion.numbers, lower=self.lower, turn=self.turn)

    @property
    def stages(self) -> int:
        """Evaluations of the right-hand side in a step."""
        return self.motion.kernel.stages

    def take_lost(self) -> list[int]:
        """Return, once, the components that were below their tolerance for some periods and then grew."""
        lost = self.motion.numbers.usual.lost
        found = np.flatnonzero(lost).tolist()
        lost[:] = 0
        return found

    def __call__(self, orbits: Orbits, periods: int) -> None:
        """Move a batch of orbits on by some periods, in place."""
        self.motion.advance(orbits, periods, self.lower, self.turn)


@dataclass(frozen=True, eq=False)
class DiscreteAdvance(CompiledAdvance):
    """Applications of a discrete map; an orbit has diverged that is not smaller than a bound."""

    kernel: CompiledPeriod
    parameters: Floats
    bound: float
    lower: Floats
    turn: Floats

    @computed_once
    def function(self) -> CompiledMap:
        """The compiled function, with its parameters."""
        return CompiledMap(self.kernel.address, self.kernel.context, self.parameters, self.bound)

    @property
    def step(self) -> PeriodStep:
        """Applications of the compiled function."""
        return UNKNOWN_STEP._replace(kind=DISCRETE, discrete=self.function, lower=self.lower, turn=self.turn)

    def __call__(self, orbits: Orbits, periods: int = 1) -> None:
        """Move a batch of orbits on by some applications, in place."""
        state = (orbits.points, orbits.rotations, orbits.status)
        for some in portions(periods, len(orbits)):
            orbits.work.evaluations += iterate(self.function, *state, self.lower, self.turn, some)


def recorded(
    advance: Callable[[Orbits, int], None], orbits: Orbits, periods: int
) -> Iterator[tuple[Floats, Ints, NDArray[np.uint8]]]:
    """Move a batch of orbits on, in place, and yield where it has been, some periods at a time.

    Points and full rotations have the shape (periods, n, d), status (periods, n).
    """
    compiled = advance if isinstance(advance, CompiledAdvance) else None
    step = UNKNOWN_STEP if compiled is None else compiled.step
    one_by_one = step.kind == NOT_COMPILED or step.table.function != 0
    small = np.zeros(orbits.points.shape, np.uint8)
    for some in portions(periods, _COSTLY * len(orbits)):
        check_stop()
        points, rotations = np.empty((some, *orbits.points.shape)), np.empty((some, *orbits.points.shape), np.int64)
        status = np.empty((some, len(orbits)), np.uint8)
        if compiled is None or one_by_one:
            for k in range(some):
                check_stop()
                advance(orbits, 1)
                points[k], rotations[k], status[k] = orbits.points, orbits.rotations, orbits.status
        else:
            made = record(step, orbits.points, orbits.rotations, orbits.status, small, points, rotations, status)
            orbits.work.evaluations += made * compiled.stages
        yield points, rotations, status
