"""Box dimensions of boundaries: on lines through them, which resolve far more than an image, and of images."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np

from cellmap import Basins, CellGrid, find_basins
from cellmap.analysis.fractal.boundary_dimensions import boundary_dimension
from cellmap.analysis.fractal.box_counting import BoxCount

Labels = Callable[[Basins], np.ndarray]
_FEWEST_LINES = 3


@dataclass(frozen=True, eq=False)
class Boxes:
    """Box counts of a boundary on lines parallel to the first axis; of an image, where lines meet too little of it.

    A boundary of dimension D leaves a set of dimension D - 1 on almost any line that meets enough of it (Marstrand
    1954).  A line crosses a smooth boundary a few times, too few for boxes to be counted.
    """

    on_lines: list[BoxCount]
    image: BoxCount | None

    def __repr__(self) -> str:
        if np.isnan(self.dimension):
            return "none by boxes"
        where = f"boxes on {len(self.on_lines)} lines" if self.by_lines else "boxes of an image"
        return f"{self.dimension:.3f} +- {self.standard_error:.3f} by {where}"

    @property
    def by_lines(self) -> bool:
        """Whether enough lines meet enough of the boundary."""
        return len(self.on_lines) >= _FEWEST_LINES

    @property
    def dimension(self) -> float:
        """Dimension of the boundary; NaN where there is none."""
        if self.by_lines:
            return 1.0 + float(np.mean([c.dimension for c in self.on_lines]))
        return np.nan if self.image is None else self.image.dimension

    @property
    def standard_error(self) -> float:
        """From the spread between the lines or from the fits, whichever is larger."""
        if self.by_lines:
            values = [c.dimension for c in self.on_lines]
            within = float(np.mean([c.standard_error for c in self.on_lines]))
            return max(float(np.std(values, ddof=1)), within) / sqrt(len(values))
        return np.nan if self.image is None else self.image.standard_error


def box_counts(
    basins: Basins, lines: int, cells: int, side: int, labels: Labels = lambda basins: basins.labels
) -> Boxes:
    """Count boxes with the map and the attractors of some basins.

    Lines have `cells` and lie at random places of the second axis; where fewer than three of them give a dimension, a
    basin image of `side` x `side` cells is counted.
    """
    assert basins.grid is not None and basins.point_map is not None
    (left, low), (right, high) = basins.grid.lower, basins.grid.upper
    thin = 1e-9 * (high - low)
    found = []
    for y in np.random.default_rng(0).uniform(low, high, lines):
        line = CellGrid((left, y - thin), (right, y + thin), (cells, 1))
        found.append(_counted(labels(find_basins(basins.point_map, line, attractors=basins.attractors)).ravel()))
    on_lines = [c for c in found if c is not None]
    if len(on_lines) >= _FEWEST_LINES:
        return Boxes(on_lines, None)
    grid = CellGrid((left, low), (right, high), (side, side))
    return Boxes(on_lines, _counted(labels(find_basins(basins.point_map, grid, attractors=basins.attractors))))


def _counted(labels: np.ndarray) -> BoxCount | None:
    try:
        return boundary_dimension(labels)
    except ValueError:  # no boundary, or too few boxes that meet it
        return None
