"""Image cells of points under a map, from which all cell mappings are built."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .._lib.arrays import Floats, Ints
from .._lib.checks import warn_caller
from ..attractors.labels import Label, label_of
from ..maps.coordinates import wrap
from ..maps.grid import CellGrid, Locator, grid_points
from ..maps.orbit_batch import Orbits, Status
from ..maps.point_map import PointMap, ToleranceWarning

LEFT, DIVERGED = int(Label.ESCAPED), int(Label.DIVERGED)
"""Sink cells for images outside the window, and for images that do not exist.

An image does not exist where the orbit diverges or does not return to the Poincaré section of a map.
"""

Kick = Callable[[int], Floats]
"""Returns the noise that is added to n points in one period, shape (n, dimension)."""


def centres_of(grid: CellGrid, cells: Ints) -> Floats:
    """Return the centres of some cells, shape (n, dimension)."""
    return grid_points([grid.axis(j) for j in range(grid.dimension)], cells)


def images_of(point_map: PointMap, points: Floats, periods: int, kick: Kick | None = None) -> Orbits:
    """Return points (n, dimension) after some periods, and after noise has acted in each of them."""
    orbits = Orbits.starting(wrap(points, point_map.coordinates))
    if kick is None:
        point_map.advance(orbits, periods)
        return orbits
    for _ in range(periods):
        point_map.advance(orbits, 1)
        orbits.points = wrap(orbits.points + kick(len(orbits)), point_map.coordinates)
    return orbits


def cells_of(point_map: PointMap, grid: CellGrid, orbits: Orbits) -> Ints:
    """Return the flat numbers of the cells in which orbits are, LEFT or DIVERGED for those in none."""
    cells = Locator.of(grid, point_map.coordinates)(orbits.points)
    return np.where(orbits.status >= Status.DIVERGED, DIVERGED, cells)


def label_of_no_image(point_map: PointMap) -> int:
    """Return the label of initial conditions whose orbits reach the sink DIVERGED."""
    return int(label_of(point_map.no_image))


def warn_of_inaccurate(missed: int, total: int) -> None:
    """Warn where the integrator missed its tolerance for some points."""
    if missed:
        warn_caller(
            f"the integrator missed its tolerance for {missed} of {total} points; loosen rtol and atol, or "
            "allow more steps with max_steps",
            ToleranceWarning,
        )
