"""Data of an interpolated map: grid, spline coefficients, error estimates and fallback cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Bools, Floats
from .._lib.deprecation import renamed
from .grid import CellGrid


@dataclass(frozen=True, eq=False)
class CellTable:
    """Interpolation grid of an interpolated map, with spline coefficients and error estimates.

    Parameters
    ----------
    grid : CellGrid
        Cells between the nodes.
    order : int
        Degree of the B-splines.
    coefficients : ndarray, shape (n_1 + order, ..., n_d + order, d)
        B-spline coefficients of the displacement in one period.
    indicator : ndarray of float32, shape of the grid
        Estimate of the largest interpolation error in each cell, in cell widths (largest over the components): its
        leading terms along the axes, and by how much these miss the error that is measured at the centre.  Infinite
        where the centre has no exact image.
    fallback : ndarray of bool, shape of the grid
        Fallback cells, which are evaluated with the exact map.
    """

    grid: CellGrid
    order: int
    coefficients: Floats
    indicator: NDArray[np.float32]
    fallback: Bools

    @classmethod
    def unexamined(cls, grid: CellGrid, order: int, coefficients: Floats) -> CellTable:
        """Return a table whose errors are not known yet."""
        return cls(grid, order, coefficients, np.zeros(0, np.float32), np.zeros((0,) * grid.dimension, bool))

    @property
    def rough(self) -> Bools:
        """Fallback cells, by the name that they had in cellmap 0.1."""
        renamed("CellTable.rough", "CellTable.fallback", "0.2")
        return self.fallback

    def __repr__(self) -> str:
        fraction = 100.0 * float(self.fallback.mean())
        return f"CellTable(order {self.order}, {self.grid}; {fraction:.3g} % fallback cells)"


@dataclass(frozen=True, eq=False)
class MapError:
    """Measured error of one period of an interpolated map, at random points of its interpolated cells.

    Parameters
    ----------
    median, percentile_99, largest : float
        Of the largest component of the difference to the exact image, in the units of the coordinates; NaN without a
        point in an interpolated cell.
    points : int
        Points in interpolated cells at which both maps have an image.
    fallback : int
        Points in fallback cells, which are evaluated with the exact map, so that there is nothing to measure.
    """

    median: float
    percentile_99: float
    largest: float
    points: int
    fallback: int = 0
