"""Knowledge of a right-hand side: its formulas, the surfaces on which they change, or why there are none."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import numpy as np

from .._compiled.codegen.captured import Watched
from .._compiled.codegen.filippov import SwitchingTrace
from .._compiled.codegen.kernel import traced_function, traced_switching, why_untraced
from .._compiled.codegen.linear import values
from .._compiled.codegen.trace import Trace
from .._lib.arrays import Floats
from .._lib.computed import computed_once
from .misread import PLACES
from .periodicity import value_at
from .system import ForcedSystem

_SAMPLES = 2048  # samples of the forcing in a period; a pulse between two of them may be missed


@dataclass(frozen=True, eq=False)
class Formulas:
    """Formulas of a right-hand side: in one piece, or (``in_modes``) with events between their modes.

    ``unknown`` is the reason why there are none, empty where there are.
    """

    system: ForcedSystem
    unknown: str
    plain: Trace | None = None
    in_modes: SwitchingTrace | None = None
    _watched: Watched = field(init=False, repr=False)

    def __post_init__(self) -> None:
        system, (_, switches, events) = self.system, self.system.functions
        others = [f for f in (switches, events) if f is not None]

        def at(t: float, state: tuple[float, ...]) -> list[float]:
            return [*system.derivative(t, state), *(v for f in others for v in f(t, state, system.parameters))]

        def sample() -> list[float]:
            found: list[float] = []
            for fraction, state in product(PLACES, self._states):
                found.extend(value_at(lambda t: at(t, state), fraction * system.length))  # noqa: B023
            return found

        object.__setattr__(self, "_watched", Watched(f"rhs of {system.name}", system.functions, sample))

    @property
    def _states(self) -> list[tuple[float, ...]]:
        """Two states at which the right-hand side is looked at."""
        return [tuple(size + 0.1 * j for j in range(self.system.dimension)) for size in (0.1, 1.1)]

    def unchanged(self) -> ForcedSystem:
        """Return the system, for more of a map that has been made of it; refuse one that has changed since."""
        self._watched.check()
        return self.system

    @property
    def has_events(self) -> bool:
        """Whether the right-hand side has switches, or branches that can be located."""
        return self.system.functions[1:] != (None, None) or self.in_modes is not None

    def derivatives(self, times: Floats, state: tuple[float, ...]) -> Floats:
        """Return the right-hand side at many times, shape (times, dimension).

        Jumps are met as events: what is returned is the smooth side on which the state is at the time 0.
        """
        system, parameters = self.system, tuple(self.system.params.values())
        traced, signs = self.plain, tuple[float, ...]()
        if self.in_modes is not None:
            traced, signs = self.in_modes.free_motion, self.in_modes.signs_at(0.0, state, parameters)
        if traced is not None:
            found = values(traced.outputs, times, state, np.array(parameters), signs)
            return np.stack([np.broadcast_to(f, len(times)) for f in found], axis=1)
        with np.errstate(all="ignore"):
            return np.array([system.derivative(t, state) for t in times.tolist()])

    @computed_once
    def harmonics(self) -> list[Floats]:
        """Strengths of the harmonics of the right-hand side at two states, where it is finite over the period."""
        times, found = np.linspace(0.0, self.system.length, _SAMPLES, endpoint=False), list[Floats]()
        for state in self._states:
            try:
                samples = self.derivatives(times, state)
            except Exception:
                continue  # outside the domain of the right-hand side
            if np.isfinite(samples).all():
                found.append(harmonics_of(samples))
        return found


def harmonics_of(samples: Floats) -> Floats:
    """Return the strengths (times // 2,) of the harmonics of samples of a period, shape (times, ...).

    They are the largest of any component, 0 below a ten-millionth of the strongest one and below rounding.
    """
    strength = np.abs(np.fft.rfft(samples, axis=0))[1:] / len(samples)
    least = np.maximum(1e-7 * strength.max(axis=0), 1e-12 * np.abs(samples).max(axis=0))
    return np.asarray(np.where(strength > least, strength, 0.0).reshape(len(strength), -1).max(axis=1, initial=0.0))


def formulas(system: ForcedSystem) -> Formulas:
    """Return the formulas of the right-hand side of a system, or the reason why there are none."""
    names = tuple(system.params)
    if system.functions[1:] == (None, None):
        unknown = why_untraced(system.rhs, system.dimension, system.params)
        if unknown:
            return Formulas(system, unknown)
    in_modes = traced_switching(system.functions, system.dimension, names)
    if system.functions[1:] != (None, None):
        return Formulas(system, in_modes) if isinstance(in_modes, str) else Formulas(system, "", None, in_modes)
    if isinstance(in_modes, str) or not in_modes.is_analytic:
        return Formulas(system, "", traced_function(system.rhs, system.dimension, names))
    return Formulas(system, "", None, in_modes)


def unknown_formulas(system: ForcedSystem) -> str:
    """Return the reason why the formulas of a right-hand side are not known; empty if they are."""
    return formulas(system).unknown
