"""How a map moves orbits, as compiled loops call it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._compiled.codegen.period import CompiledPeriod
from .._compiled.kernels.labelling import DISCRETE, FLOW, NOT_COMPILED, Discrete, Step, Table
from .._compiled.kernels.periods import Motion, iterate
from .integration import Flow
from .orbit_batch import Orbits, portions

_NONE, _NOWHERE = np.zeros(1, np.int64), np.zeros(1)
_NO_TABLE = Table(0, _NONE, 0, 0, _NOWHERE, _NOWHERE, _NOWHERE, _NOWHERE)
_NO_MOTION = Motion(0, _NONE, _NOWHERE, 0.0, 0.0, _NOWHERE, 0.0, 0.0, 0.0, _NONE, 0, 0, 0, 0, 0.0, 0)
_NO_FUNCTION = Discrete(0, _NONE, _NOWHERE, 0.0)

UNKNOWN_STEP = Step(_NO_TABLE, NOT_COMPILED, _NO_MOTION, _NO_FUNCTION, _NOWHERE, _NOWHERE)
"""That of a map of which nothing is known but the function that it is."""


class CompiledAdvance(ABC):
    """An `advance` of a map that compiled loops can call without Python."""

    @property
    @abstractmethod
    def step(self) -> Step:
        """What these loops call."""

    @property
    def stages(self) -> int:
        """Evaluations of the right-hand side in a step of the integrator, or applications of the map."""
        return 1

    @abstractmethod
    def __call__(self, orbits: Orbits, periods: int) -> None:
        """Move a batch of orbits on by some periods, in place."""


@dataclass(frozen=True, eq=False)
class FlowAdvance(CompiledAdvance):
    """Periods of a flow, with the cuts and turns of its coordinates."""

    motion: Flow
    lower: NDArray[np.float64]
    turn: NDArray[np.float64]

    @property
    def step(self) -> Step:
        """Steps of the integrator."""
        return UNKNOWN_STEP._replace(kind=FLOW, motion=self.motion.numbers, lower=self.lower, turn=self.turn)

    @property
    def stages(self) -> int:
        """Evaluations of the right-hand side in a step."""
        return self.motion.kernel.stages

    def __call__(self, orbits: Orbits, periods: int) -> None:
        """Move a batch of orbits on by some periods, in place."""
        self.motion.advance(orbits, periods, self.lower, self.turn)


@dataclass(frozen=True, eq=False)
class DiscreteAdvance(CompiledAdvance):
    """Applications of a discrete map; an orbit has diverged that is not smaller than a bound."""

    kernel: CompiledPeriod
    parameters: NDArray[np.float64]
    bound: float
    lower: NDArray[np.float64]
    turn: NDArray[np.float64]

    @property
    def step(self) -> Step:
        """Applications of the compiled function."""
        function = Discrete(self.kernel.address, self.kernel.context, self.parameters, self.bound)
        return UNKNOWN_STEP._replace(kind=DISCRETE, discrete=function, lower=self.lower, turn=self.turn)

    def __call__(self, orbits: Orbits, periods: int = 1) -> None:
        """Move a batch of orbits on by some applications, in place."""
        state = (orbits.points, orbits.rotations, orbits.status)
        for some in portions(periods, len(orbits)):
            orbits.work.evaluations += iterate(*self.step.discrete, *state, self.lower, self.turn, some)
