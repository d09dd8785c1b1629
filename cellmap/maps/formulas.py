"""What is known of a right-hand side: its formulas, the surfaces on which they change, or why there are none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._compiled.codegen.filippov import SwitchingTrace
from .._compiled.codegen.kernel import traced_function, traced_switching, why_untraced
from .._compiled.codegen.linear import values
from .._compiled.codegen.trace import Trace
from .._lib.arrays import Floats
from .system import ForcedSystem


@dataclass(frozen=True, eq=False)
class Formulas:
    """Formulas of a right-hand side: in one piece, or (``in_modes``) with events between their modes.

    ``unknown`` is the reason why there are none, empty where there are.
    """

    system: ForcedSystem
    unknown: str
    plain: Trace | None = None
    in_modes: SwitchingTrace | None = None

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


def formulas(system: ForcedSystem) -> Formulas:
    """Return what is known of the right-hand side of a system."""
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
