"""Maps at consecutive values of a parameter, from tables over the parameter where these serve."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from .._lib.arrays import Floats
from ..maps.interpolation.interpolated import Interpolated
from ..maps.interpolation.over_parameter import FEWEST, ParameterTable, tables_over
from ..maps.point_map import PointMap


class TabulatedRange(NamedTuple):
    """Tables over a parameter, and the numbers of the values for which they are: `low` to before `high`."""

    table: ParameterTable
    low: int
    high: int


class MapsOverValues:
    """The maps of a family at values (n,) of a parameter.

    Tables over the parameter are made when a value among those that they are for is asked for first: for all values, or
    where these tables cannot have the accuracy that is needed for halves of them, and so on.  Which tables there are
    depends on the values alone, so that a run that is resumed goes on as it would have gone.  The map of each value is
    compared with the exact one at some points; where it differs, the value has a table of its own.
    """

    def __init__(self, point_map: PointMap, parameter: str, values: Floats) -> None:
        self._spec, self._parameter, self._values = point_map.specified, parameter, values
        exact = point_map.without_table.specified
        # A value that the system refuses is told before anything is computed.
        self._exact = [exact.with_params({**point_map.params, parameter: float(value)}) for value in values]
        self._now: TabulatedRange | None = None
        self._refused: set[tuple[int, int]] = set()
        self._alone: set[int] = set()

    def at(self, number: int) -> PointMap:
        """Return the map at the value with this number."""
        window, exact = self.window(number), self._exact[number].build()
        if window is not None:
            combined = window.table.at(float(self._values[number]), exact)
            if window.table.serves(combined):
                return combined
            self._alone.add(number)
        return replace(self._spec, exact=exact, table=None).build() if isinstance(self._spec, Interpolated) else exact

    def window(self, number: int) -> TabulatedRange | None:
        """Return the tables that serve at the value with this number, None where it has one of its own."""
        if number in self._alone:
            return None
        now = self._now
        if now is not None and now.low <= number < now.high:
            return now
        self._now, low, high = None, 0, len(self._values)  # the former tables need no memory
        while isinstance(self._spec, Interpolated) and high - low >= FEWEST:
            if (low, high) not in self._refused:
                table = tables_over(self._spec, self._parameter, self.interval(low, high), high - low)
                if table is not None:
                    self._now = TabulatedRange(table, low, high)
                    return self._now
                self._refused.add((low, high))
            middle = (low + high) // 2
            low, high = (low, middle) if number < middle else (middle, high)
        return None

    def interval(self, low: int, high: int) -> tuple[float, float]:
        """Return the interval of the values with numbers from `low` to before `high`."""
        ends = float(self._values[low]), float(self._values[high - 1])
        return min(ends), max(ends)
