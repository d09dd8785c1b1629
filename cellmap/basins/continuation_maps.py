"""Maps at consecutive values of a parameter, from tables over the parameter where these serve."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

from .._lib.arrays import Floats
from ..maps.interpolation.interpolated import Interpolated
from ..maps.interpolation.over_parameter import FEWEST, ParameterTable, tables_over
from ..maps.point_map import PointMap


class Window(NamedTuple):
    """Tables over a parameter, and the numbers of the values for which they are: `low` to before `high`."""

    table: ParameterTable
    low: int
    high: int


class MapsOverValues:
    """The maps of a family at values (n,) of a parameter.

    Tables over the parameter are made when a value among those that they are for is asked for first: for all values, or
    where these tables cannot have the accuracy that is needed for halves of them, and so on.  Which tables there are
    depends on the values alone, so that a run that is resumed goes on as it would have gone.
    """

    def __init__(self, point_map: PointMap, parameter: str, values: Floats) -> None:
        self._map, self._parameter, self._values = point_map, parameter, values
        self._known: dict[tuple[int, int], ParameterTable | None] = {}

    def at(self, number: int) -> PointMap:
        """Return the map at the value with this number."""
        value, window = float(self._values[number]), self.window(number)
        return self._map.with_params(**{self._parameter: value}) if window is None else window.table.at(value)

    def window(self, number: int) -> Window | None:
        """Return the tables that serve at the value with this number, None where it has one of its own."""
        low, high = 0, len(self._values)
        while self._spec is not None and high - low >= FEWEST:
            if (low, high) not in self._known:
                ends = sorted((float(self._values[low]), float(self._values[high - 1])))
                self._known[low, high] = tables_over(self._spec, self._parameter, *ends, high - low)
            if (table := self._known[low, high]) is not None:
                return Window(table, low, high)
            middle = (low + high) // 2
            low, high = (low, middle) if number < middle else (middle, high)
        return None

    @cached_property
    def _spec(self) -> Interpolated | None:
        spec = self._map.spec
        return spec if isinstance(spec, Interpolated) else None
