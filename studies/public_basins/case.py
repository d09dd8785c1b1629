"""A case of the collection: equations, where initial conditions lie, and what its source says."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cellmap import CellGrid, Coordinate, ForcedSystem, PointMap, discrete_map, stroboscopic_map

Numbers = Sequence[float]


@dataclass(frozen=True)
class Case:
    """A system of the collection.

    Parameters
    ----------
    name, title : str
        What it is called in commands, and in figures.
    source : str
        Where it was published: the end of a DOI, or words.
    published : str
        What is said of it there.
    make : callable
        Makes the exact map.
    lower, upper : tuple of float
        Corners of the window; a coordinate in which they are equal has that value.
    attractors : int, optional
        Number of attractors, or of ends that orbits come to, where that is known.
    counts : tuple of int
        Of random initial conditions in the window, how many come to each attractor: by iteration of maps in NumPy, or
        with SciPy's DOP853 at tolerances of 1e-11.
    orbits : int
        Number of these initial conditions, some of which may go to infinity.
    states : callable, optional
        Carries the points of a window of two dimensions to initial conditions.
    plane : tuple of str, optional
        Coordinates across and up where initial conditions are no grid.
    """

    name: str
    title: str
    source: str
    published: str
    make: Callable[[], PointMap]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    attractors: int | None = None
    counts: tuple[int, ...] = ()
    orbits: int = 0
    states: Callable[[np.ndarray], np.ndarray] | None = None
    plane: tuple[str, str] | None = None

    def initial_conditions(self, cells: int) -> CellGrid | np.ndarray:
        """Return initial conditions with so many cells along each side of the window."""
        sides = zip(self.lower, self.upper, strict=True)
        grid = CellGrid(self.lower, self.upper, tuple(1 if low == high else cells for low, high in sides))
        return grid if self.states is None else self.states(grid.centres())


def flow(
    title: str,
    source: str,
    published: str,
    coordinates: Sequence[str | Coordinate],
    period: float,
    lower: tuple[float, ...],
    upper: tuple[float, ...],
    *,
    system: Mapping[str, Any] | None = None,
    **more: Any,
) -> Callable[[Callable[[float, Numbers, Any], Numbers]], Case]:
    """Make a case of a right-hand side, whose flow is looked at once a period."""

    def made(rhs: Callable[[float, Numbers, Any], Numbers]) -> Case:
        def make() -> PointMap:
            return stroboscopic_map(ForcedSystem(rhs, {}, period, coordinates, **(system or {})))

        return Case(rhs.__name__, title, source, published, make, lower, upper, **more)

    return made


def mapping(
    title: str,
    source: str,
    published: str,
    coordinates: Sequence[str | Coordinate],
    lower: tuple[float, ...],
    upper: tuple[float, ...],
    *,
    ends: Mapping[str, Callable[[Numbers, Any], float]] | None = None,
    **more: Any,
) -> Callable[[Callable[[Numbers, Any], Numbers]], Case]:
    """Make a case of a discrete map."""

    def made(function: Callable[[Numbers, Any], Numbers]) -> Case:
        def make() -> PointMap:
            return discrete_map(function, {}, coordinates, ends=ends)

        return Case(function.__name__, title, source, published, make, lower, upper, **more)

    return made
