"""Final states of many initial conditions, by the trapping regions of known attractors or by a user's rule."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .._lib.checks import whole_number
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor
from .classification import Labeller, Outcome, labeller
from .finding import find_basins
from .record import Basins

_COARSE = 4096  # cells from which attractors are sought


@dataclass(frozen=True, eq=False)
class FinalStates:
    """Final states of the orbits that begin in a region.

    Parameters
    ----------
    label : Labeller
        What labels them: by known attractors, or by a rule in their place.
    region : CellGrid
        Window of the initial conditions; an axis of one cell is fixed at its centre.
    """

    label: Labeller
    region: CellGrid

    @property
    def point_map(self) -> PointMap:
        """The map."""
        return self.label.point_map

    @property
    def attractors(self) -> tuple[Attractor, ...]:
        """Attractors that are distinguished."""
        return self.label.attractors


def final_states(
    source: Basins | PointMap,
    region: CellGrid | None,
    attractors: Sequence[Attractor],
    outcome: Outcome | None,
    max_periods: int,
) -> FinalStates:
    """Collect what is needed to label initial conditions; search for attractors where none are known."""
    max_periods = whole_number("max_periods", max_periods, at_least=1)
    if isinstance(source, Basins):
        if source.point_map is None:
            raise ValueError("basins have no map: rebuild it with rebuild_map and find the basins again")
        point_map, region = source.point_map, region or source.grid
        attractors = attractors or source.attractors
    elif isinstance(source, PointMap):
        point_map = source
    else:
        raise TypeError(f"source={source!r}: give Basins or a PointMap")
    if not isinstance(region, CellGrid):
        raise TypeError(f"region={region!r}: give the window as a CellGrid")
    region = region.on(point_map.coordinates, "region")
    if max(region.shape) == 1:
        raise ValueError(f"region={region!r} is one cell: give two cells at least along the axes that it spans")
    if outcome is not None:
        return FinalStates(labeller(point_map, max_periods=max_periods, outcome=outcome), region)
    if not attractors:
        attractors = find_basins(point_map, _coarse(region), max_periods).attractors
    if not attractors:
        raise ValueError("no attractor was found in this region: define the final states with outcome=")
    return FinalStates(labeller(point_map, attractors, max_periods=max_periods), region)


def _coarse(region: CellGrid) -> CellGrid:
    wide = sum(n > 1 for n in region.shape)
    side = max(2, int(_COARSE ** (1.0 / wide)))
    return CellGrid(region.lower, region.upper, tuple(side if n > 1 else 1 for n in region.shape))
