"""Systems that the explorer offers, with the window that it shows first."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from .._lib.checks import shown
from ..maps.coordinates import Coordinate
from ..maps.grid import CellGrid
from ..maps.interpolation.interpolated import interpolated_map
from ..maps.point_map import PointMap
from ..maps.stroboscopic import stroboscopic_map
from ..maps.system import ForcedSystem

_HALF = 2.0  # of the window along a coordinate that is no angle, where none is given
_MARGIN = 0.05  # of the window, by which an interpolation grid is larger on each side


@dataclass(frozen=True, eq=False)
class Explored:
    """A system as the explorer offers it.

    Parameters
    ----------
    name : str
        Name by which addresses and scripts know it.
    make : callable
        Function without arguments that returns the :class:`ForcedSystem`, or the discrete :class:`PointMap`.
    region : CellGrid or None, optional
        First window and number of initial conditions.  With more than two coordinates the image is a slice through the
        window's centre.  By default angles have one period, and other coordinates reach from -2 to 2.
    nodes : int, optional
        Cells of the interpolation grid along each axis; 0 for the exact map.  The grid covers `region`, and a
        twentieth of it more on each side along axes that are no angles.
    source : str, optional
        Python statements after which ``system`` is the system, for scripts.
    """

    name: str
    make: Callable[[], ForcedSystem | PointMap]
    region: CellGrid | None = None
    nodes: int = 0
    source: str = ""

    @cached_property
    def system(self) -> ForcedSystem | PointMap:
        """The system or discrete map."""
        return self.make()

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """State variables."""
        system = self.system
        return system.axes if isinstance(system, ForcedSystem) else system.coordinates

    @cached_property
    def window(self) -> CellGrid:
        """First window, over all coordinates."""
        if self.region is not None:
            return self.region.on(self.coordinates, "region")
        lower = tuple(-_HALF if c.lower is None else c.lower for c in self.coordinates)
        upper = tuple(_HALF if c.period is None else a + c.period for a, c in zip(lower, self.coordinates, strict=True))
        return CellGrid(lower, upper, (500,) * len(lower)).on(self.coordinates)

    def point_map(self, nodes: int, tolerance: float) -> PointMap:
        """Return the map at the system's own parameters, interpolated if there are nodes."""
        system = self.system
        exact = stroboscopic_map(system, rtol=tolerance, atol=tolerance) if isinstance(system, ForcedSystem) else system
        return exact if not nodes else interpolated_map(exact, self.table_grid(nodes))

    def table_grid(self, nodes: int) -> CellGrid:
        """Return the interpolation grid."""
        lower, upper = list(self.window.lower), list(self.window.upper)
        for j, c in enumerate(self.coordinates):
            if c.period is None:
                margin = _MARGIN * (upper[j] - lower[j])
                lower[j], upper[j] = lower[j] - margin, upper[j] + margin
            else:
                lower[j], upper[j] = c.lower or 0.0, (c.lower or 0.0) + c.period
        return CellGrid(tuple(lower), tuple(upper), (nodes,) * len(lower))


def load_gallery(module: str) -> tuple[Explored, ...]:
    """Return the systems of a module's list ``GALLERY``.

    Raises
    ------
    ValueError
        If there is no such module or list, or if two systems have one name.
    """
    try:
        found = importlib.import_module(module).GALLERY
    except (ImportError, AttributeError) as error:
        raise ValueError(f"gallery={module!r}: give a module with a list GALLERY of systems ({error})") from error
    return checked_gallery(found)


def checked_gallery(given: Sequence[Explored]) -> tuple[Explored, ...]:
    """Return systems that all have names of their own, at least one."""
    gallery = tuple(given)
    if not gallery or not all(isinstance(e, Explored) for e in gallery):
        raise TypeError(f"gallery={shown(given)}: give at least one system, each of it an Explored")
    names = [e.name for e in gallery]
    if len(set(names)) < len(names):
        raise ValueError(f"gallery={names}: give each system a name of its own")
    return gallery
