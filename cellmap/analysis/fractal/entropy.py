"""Basin entropy and boundary basin entropy (Daza et al. 2016)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, prod

import numpy as np
from numpy.typing import ArrayLike

from ..._lib.arrays import Floats, Ints
from ..._lib.checks import affordable_number, whole_number
from ..._lib.randomness import Rng, random_numbers
from ..._lib.signatures import checked
from ...basins.record import Basins
from .label_images import LabelImage, label_image
from .uncertainty_fits import finest_exponent, is_rough

_SIGNIFICANT = 2.0  # standard errors above ln 2
_FEW = 30  # boxes on the boundary below which nothing is concluded
_COMPLETE = 0.5  # fraction of a box's cells that must have a basin


@dataclass(frozen=True, eq=False)
class BasinEntropy:
    """Basin entropy and boundary basin entropy of a basin image.

    Parameters
    ----------
    entropy, standard_error : float
        Basin entropy, the mean over all boxes, and its standard error over boxes.
    boundary_entropy, boundary_error : float
        Boundary basin entropy, the mean over the boxes with more than one basin, and its standard error; NaN without
        such boxes.
    box : tuple of int
        Sides of the boxes in cells.
    boxes : ndarray, shape (n,) or that of the tiling
        Entropy of each box, NaN for excluded boxes.
    basins : int
        Number of basins in the image.
    positions : str
        Positions of the boxes, "tiling" or "random".
    finest : tuple of float
        Local uncertainty exponent between distances of two cells and one, and its standard error.
    name : str
        Name of the system.
    """

    entropy: float
    standard_error: float
    boundary_entropy: float
    boundary_error: float
    box: tuple[int, ...]
    boxes: Floats
    basins: int
    positions: str
    finest: tuple[float, float]
    name: str = ""

    def __repr__(self) -> str:
        sides = " x ".join(map(str, self.box))
        return (
            f"BasinEntropy({self.entropy:.4g} +- {self.standard_error:.2g}, on the boundary "
            f"{self.boundary_entropy:.4g} +- {self.boundary_error:.2g}, {self.count} boxes of {sides} cells)"
        )

    @property
    def count(self) -> int:
        """Number of boxes that count."""
        return int(np.isfinite(self.boxes).sum())

    @property
    def boundary_count(self) -> int:
        """Number of boxes with more than one basin."""
        return int((self.boxes > 0.0).sum())

    @property
    def above_ln2(self) -> bool:
        """Whether the boundary basin entropy exceeds ln 2 by two standard errors, in at least 30 boxes.

        A box on a smooth boundary contains two basins, and its entropy is at most ln 2; it is larger only around points
        where more basins meet, and these are few.  With two basins, the entropy never exceeds ln 2.
        """
        return (
            self.boundary_count >= _FEW
            and self.boundary_entropy - _SIGNIFICANT * self.boundary_error > log(2.0) + 1e-12
        )

    @property
    def fractal(self) -> bool:
        """Whether the ln 2 criterion proves the boundary fractal, at the scales of the image.

        This requires that the entropy is above ln 2 and that the cells themselves show no smooth boundary.  (Boxes that
        are wider than smooth basins contain several of them too, but next to such a boundary the fraction of pairs of
        cells that differ doubles with their distance.)  The converse does not hold: nothing follows from False.
        """
        return self.above_ln2 and is_rough(self.finest)


@checked
def basin_entropy(
    basins: Basins | ArrayLike,
    box_size: int | Sequence[int] = 5,
    n_positions: int | None = None,
    include: Sequence[int] = (),
    wraps: Sequence[bool] | None = None,
    *,
    rng: Rng = 0,
) -> BasinEntropy:
    r"""Compute the basin entropy of a basin image.

    It is :math:`S_b = -\frac{1}{N} \sum_{i=1}^{N} \sum_j p_{ij} \ln p_{ij}` for N boxes with the fractions
    :math:`p_{ij}` of the basins.

    In each box, the entropy of the fractions of the basins is computed with natural logarithms.  The mean over all
    boxes is the basin entropy, that over boxes with several basins the boundary basin entropy.

    Parameters
    ----------
    basins : Basins or array_like of int
        Basins on a grid, or labels of cells in any number of dimensions.  Cells of a negative label (escaped, diverged,
        undecided), or of a missing one, do not count; a box of which less than half has a basin is excluded.
    box_size : int or sequence of int, optional
        Side of the boxes in cells, one for all axes or one for each (axes of one cell do not count).
    n_positions : int, optional
        Number of boxes at random positions, instead of a tiling from the first corner on.  (Cells that a tiling leaves
        over at the other ends do not count.)
    include : sequence of int, optional
        Negative labels that count as basins: (-2,) for initial conditions that diverge.
    wraps : sequence of bool, optional
        Which axes of an array are periodic; for basins the grid determines it.  Random boxes extend across their branch
        cuts.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of random positions.

    Returns
    -------
    BasinEntropy
        Both entropies with standard errors, and the entropy of each box.

    Raises
    ------
    TypeError, ValueError
        For something that is not a basin image, or boxes that do not fit into it.

    Notes
    -----
    Boxes of random positions overlap, and neighbouring boxes of a tiling share pieces of boundary: standard errors over
    boxes are too small if there are more random boxes than a tiling has.  They do not include the dependence on the
    size of the box, so that only entropies for boxes of equal size should be compared.

    References
    ----------
    Daza, Wagemakers, Georgeot, Guery-Odelin, Sanjuan, Scientific Reports 6 (2016) 31416.

    Examples
    --------
    >>> import numpy as np
    >>> stripes = np.repeat([[0, 1]], 4, axis=0).repeat(2, axis=1)
    >>> found = basin_entropy(stripes, box_size=4)
    >>> round(found.entropy, 6), found.above_ln2
    (0.693147, False)
    """
    image = label_image(basins, include, wraps)
    sides = _sides(image, box_size)
    if n_positions is None:
        counts = _tiled(image, sides)
    else:
        counts = _random(image, sides, affordable_number("n_positions", n_positions, 8 * 8, at_least=2), rng)
    entropies = box_entropies(counts, prod(sides))
    valid = entropies[np.isfinite(entropies)]
    if not len(valid):
        raise ValueError(
            f"box_size={box_size!r}: no box has basins in half of its cells; take smaller boxes or another window"
        )
    mean, error = mean_and_error(valid)
    edge, edge_error = mean_and_error(valid[valid > 0.0])
    return BasinEntropy(
        mean,
        error,
        edge,
        edge_error,
        sides,
        entropies,
        len(image.names),
        "tiling" if n_positions is None else "random",
        finest_exponent(image),
        image.source,
    )


def box_entropies(counts: Ints, cells: int) -> Floats:
    """Return the entropy of boxes from the counts of their basins (basins, ...); NaN where too few cells have one."""
    total = counts.sum(axis=0)
    fraction = counts / np.maximum(total, 1)
    entropy = -(fraction * np.log(np.where(fraction > 0.0, fraction, 1.0))).sum(axis=0)
    return np.where(total >= _COMPLETE * cells, np.maximum(entropy, 0.0), np.nan)


def mean_and_error(values: Floats) -> tuple[float, float]:
    """Return the mean and its standard error, NaN where there are too few values."""
    n = len(values)
    return float(values.mean()) if n else np.nan, float(values.std(ddof=1) / np.sqrt(n)) if n > 1 else np.nan


def _sides(image: LabelImage, box: int | Sequence[int]) -> tuple[int, ...]:
    shape = image.numbers.shape
    given = (box,) * len(shape) if isinstance(box, int | np.integer) else tuple(box)
    if len(given) != len(shape):
        raise ValueError(f"box_size={box!r}: give a side for each of the {len(shape)} axes of more than one cell")
    sides = tuple(whole_number("box_size", side, at_least=1) for side in given)
    if prod(sides) < 2 or any(side > n for side, n in zip(sides, shape, strict=True)):
        raise ValueError(f"box_size={box!r}: give sides of two cells or more, that fit into {shape} cells")
    return sides


def _tiled(image: LabelImage, sides: tuple[int, ...]) -> Ints:
    """Count the basins in boxes side by side, shape (basins, boxes along each axis)."""
    tiles = [n // side for n, side in zip(image.numbers.shape, sides, strict=True)]
    used = image.numbers[tuple(slice(0, t * side) for t, side in zip(tiles, sides, strict=True))]
    split = used.reshape([m for pair in zip(tiles, sides, strict=True) for m in pair])
    inner = tuple(range(1, 2 * len(sides), 2))
    return np.array([np.count_nonzero(split == k, axis=inner) for k in range(len(image.names))])


def _random(image: LabelImage, sides: tuple[int, ...], positions: int, rng: Rng) -> Ints:
    """Count the basins in boxes at random positions, shape (basins, boxes)."""
    offsets = np.stack(np.meshgrid(*map(np.arange, sides), indexing="ij"), axis=-1).reshape(-1, len(sides))
    rng = random_numbers(rng)
    corners = [
        rng.integers(0, n if wraps else n - side + 1, positions)
        for n, side, wraps in zip(image.numbers.shape, sides, image.wraps, strict=True)
    ]
    return count_at(image, np.stack(corners, axis=-1), offsets)


def count_at(image: LabelImage, places: Ints, offsets: Ints) -> Ints:
    """Count the basins among the cells at some offsets from places, shape (basins, places)."""
    counts = np.empty((len(image.names), len(places)), np.int64)
    size = max(1, 4_000_000 // len(offsets))
    for begin in range(0, len(places), size):
        cells = np.zeros((1, 1), np.int64)
        for j, (n, wraps) in enumerate(zip(image.numbers.shape, image.wraps, strict=True)):
            along = places[begin : begin + size, j, None] + offsets[:, j]
            cells = cells * n + (along % n if wraps else along)
        numbers = image.numbers.ravel()[cells]
        for k in range(len(image.names)):
            counts[k, begin : begin + size] = np.count_nonzero(numbers == k, axis=1)
    return counts
