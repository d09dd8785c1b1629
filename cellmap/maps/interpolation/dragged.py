"""Tables over the parameter that an interactive program changes again and again, made one with each change."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass

from ..point_map import PointMap
from .interpolated import Interpolated
from .over_parameter import ParameterTable, tables_in_steps

_AHEAD = 64.0  # changes, as large as the last one, that tables are made for on both sides of a value
_NEAREST = 0.5  # tables begin at this fraction of the value, on the side of 0
_VALUES = 64  # values for which tables are made: so many images make them worthwhile


@dataclass(eq=False)
class Dragged:
    """Interpolated maps for the values of one parameter after the other, while the others and the phase stay.

    When a parameter has been changed twice in a row, tables over it are begun, one with each further change.  From then
    on :meth:`map_of` returns maps as long as the values are in their interval.
    """

    others: tuple[Mapping[str, float], float | None] | None = None
    parameter: str = ""
    value: float = 0.0
    interval: tuple[float, float] = (0.0, 0.0)
    making: Generator[None, None, ParameterTable | None] | None = None
    table: ParameterTable | None = None

    def map_of(self, spec: Interpolated, phase: float | None) -> PointMap | None:
        """Return the map of a specification, None where there are no tables from which it can be combined."""
        params, before = dict(spec.exact.params), self.others
        self.others = params, phase
        if before is None:
            return None
        changed = [name for name, value in params.items() if before[0].get(name) != value]
        if phase != before[1] or len(changed) != 1:
            self._begin_with("", None)
            return None
        (name,) = changed
        value, step = params[name], abs(params[name] - before[0][name])
        if name != self.parameter:
            self._begin_with(name, None)
            return None
        if not self.interval[0] <= value <= self.interval[1]:
            self.interval = _around(value, step)
            self._begin_with(name, tables_in_steps(spec, name, self.interval, _VALUES))
        if self.making is not None:
            try:
                next(self.making)
            except StopIteration as end:
                self.making, self.table = None, end.value
        combined = None if self.table is None else self.table.at(value, spec.exact)
        return combined if combined is not None and self.table is not None and self.table.serves(combined) else None

    def _begin_with(self, name: str, making: Generator[None, None, ParameterTable | None] | None) -> None:
        self.parameter, self.making, self.table = name, making, None
        if making is None:
            self.interval = 0.0, 0.0


def _around(value: float, step: float) -> tuple[float, float]:
    """Return an interval around a value, without 0, where systems often change in kind."""
    low, high = value - _AHEAD * step, value + _AHEAD * step
    return (max(low, _NEAREST * value), high) if value > 0.0 else (low, min(high, _NEAREST * value))
