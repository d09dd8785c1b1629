"""The basins that are planned, and the candidate maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..._lib.arrays import Floats
from ..._lib.randomness import random_numbers
from ...maps.coordinates import difference
from ...maps.grid import CellGrid, grid_points
from ...maps.point_map import PointMap, follow
from ...maps.stroboscopic import SMALLEST_TOLERANCE, method_of, stroboscopic_map
from ...maps.system import ForcedSystem

Source = tuple[str, float]
"""Method and tolerance of an exact map."""

_TOLERANCES = (1e-4, 1e-7, 1e-10, 1e-13)
_LOOSE = (1e-4, 1e-7)  # of RK45, which takes too many steps for more
_JUMPING = (1e-6, 1e-10)  # of discontinuous right-hand sides, whose kernels take long to compile
_BASE = 1e-7  # about the tolerance with which probes are labelled
_PLACES = 4096  # random places at which errors are measured


@dataclass(frozen=True, eq=False)
class Job:
    """A basin image to be planned: exact maps by method and tolerance, the most precise one, and the task."""

    sources: Mapping[Source, PointMap]
    reference: PointMap
    grid: CellGrid
    periods: int | None
    outside: str
    seed: int

    @property
    def base(self) -> Source:
        """Method and tolerance with which initial conditions are labelled in probes."""
        return min(self.sources, key=lambda s: (s[0] == "RK45", abs(np.log(s[1] / _BASE)), s[0] == "DOP853"))

    @property
    def finest(self) -> PointMap:
        """The map that is interpolated in probes, so that they show the error of interpolation."""
        return self.sources[min(self.sources, key=lambda s: (s[0] == "RK45", s[1], s[0] == "DOP853"))]


def exact_maps(system: ForcedSystem | PointMap, phase: float) -> tuple[dict[Source, PointMap], PointMap]:
    """Return the exact maps that come into question, and the most precise one."""
    if isinstance(system, PointMap):
        name = method_of(system) or system.recipe["kind"]
        return {(name, max(system.tolerance)): system}, system
    reference = stroboscopic_map(system, phase, SMALLEST_TOLERANCE, SMALLEST_TOLERANCE)
    usual = method_of(reference)
    wanted: dict[str, tuple[float, ...]] = {usual: _JUMPING}
    if system.functions[1:] == (None, None):
        wanted = {usual: _TOLERANCES, "DOP853": _TOLERANCES, "RK45": _LOOSE}
    found = {(m, tol): stroboscopic_map(system, phase, tol, tol, m) for m, tols in wanted.items() for tol in tols}
    return found, reference


def percentile_error(one: PointMap, other: PointMap, places: Floats) -> float:
    """Return the 99th percentile of the largest component by which images differ, where both maps have one."""
    shift = difference(follow(one, places, 1).points, follow(other, places, 1).points, one.coordinates)
    errors = np.abs(shift).max(axis=-1)
    errors = errors[np.isfinite(errors)]
    return float(np.quantile(errors, 0.99)) if errors.size else float("inf")


def places_in(window: CellGrid, seed: int) -> Floats:
    """Return random places of a window."""
    return random_numbers(seed).uniform(window.lower, window.upper, (_PLACES, window.dimension))


def some_initial_conditions(grid: CellGrid, count: int) -> Floats:
    """Return some initial conditions of a grid, in its order."""
    some = grid.size > count
    rows = np.sort(np.random.default_rng(0).choice(grid.size, count, replace=False)) if some else np.arange(grid.size)
    return grid_points([grid.axis(j) for j in range(grid.dimension)], rows)
