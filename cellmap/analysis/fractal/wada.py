"""Merging test for Wada basins in a basin image (Daza et al. 2018)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import distance_transform_edt

from ..._lib.arrays import Bools, Floats
from ..._lib.checks import finite_number
from ..._lib.signatures import checked
from ...basins.record import Basins
from .label_images import NO_BASIN, LabelImage, label_image

WADA, PARTIALLY, NOT = "Wada", "partially", "not"
"""Verdicts on basins."""

PART = 0.1
"""Smallest fraction of the boundary next to three basins for which basins are called partially Wada.

Around points where smooth basins meet, a part of the boundary of any image is next to three basins."""


@dataclass(frozen=True, eq=False)
class MergingTest:
    """Merging test: distances between the boundaries that remain when all basins but one are merged.

    Parameters
    ----------
    basins : tuple of int
        Labels of the basins.
    radius : float
        Distance in cells within which boundaries count as one.
    tolerance : float
        Fraction of a boundary that may lie farther away.
    largest : ndarray, shape (k, k)
        Largest distance of the boundary of basin i (row) from that of basin j, in cells; inf where j has none.
    median : ndarray, shape (k, k)
        Median of that distance.
    apart : ndarray, shape (k, k)
        Fraction of the boundary of basin i that is farther than `radius` from that of basin j.
    sides : ndarray, shape (k + 1,)
        Fraction of the whole boundary that is within `radius` of the boundaries of so many basins.
    cells : int
        Number of cells on the boundary.
    name : str
        Name of the system.
    """

    basins: tuple[int, ...]
    radius: float
    tolerance: float
    largest: Floats
    median: Floats
    apart: Floats
    sides: Floats
    cells: int
    name: str = ""

    def __repr__(self) -> str:
        return (
            f"MergingTest({self.verdict}: {len(self.basins)} basins, at most {100 * self.apart.max(initial=0.0):.3g} % "
            f"of a boundary farther than {self.radius:g} cells from another)"
        )

    @property
    def verdict(self) -> str:
        """Verdict on the basins: "Wada", "partially" Wada or "not" Wada.

        Wada: three basins or more, and no more of any boundary than the tolerance is farther than `radius` from any
        other.  Partially: at least a tenth of the whole boundary is that of three basins or more.  Two basins always
        have one common boundary, and are not Wada.
        """
        if len(self.basins) < 3 or not self.cells:
            return NOT
        if self.apart.max() <= self.tolerance:
            return WADA
        return PARTIALLY if self.sides[3:].sum() >= PART else NOT


@checked
def wada_merging(
    basins: Basins | ArrayLike,
    radius: float | None = None,
    tolerance: float = 0.001,
    include: Sequence[int] = (),
    wraps: Sequence[bool] | None = None,
) -> MergingTest:
    r"""Test basins for the Wada property by merging them.

    For each basin all others are merged, and the cells next to the boundary between the two are collected.  For Wada
    basins the boundary is the same whichever basin is left out; in an image, it is the same up to the distance between
    cells on it.  Measured is how far points of the boundary :math:`B_i` are from another one, :math:`d_{ij}(x) =
    \min_{y \in B_j} |x - y|` for x in :math:`B_i`.

    Parameters
    ----------
    basins : Basins or array_like of int
        Basins on a grid, or labels of cells in any number of dimensions.  Cells of a negative label (escaped, diverged,
        undecided), or of a missing one, belong to no basin and form no boundary.
    radius : float, optional
        Distance in cells within which boundaries count as one, by default a hundredth of the shorter side, and at least
        2; in images of fewer than 16 cells along a side, an eighth of these, and at least 1.
    tolerance : float, optional
        Fraction of a boundary that may lie farther away, to allow for wrong labels.
    include : sequence of int, optional
        Negative labels that count as basins: (-2,) for initial conditions that diverge.
    wraps : sequence of bool, optional
        Which axes of an array are periodic; for basins the grid determines it.

    Returns
    -------
    MergingTest
        Distances between all pairs of boundaries, and a verdict.

    Raises
    ------
    TypeError, ValueError
        For something that is not a basin image, or a radius above an eighth of its shorter side, for which any image
        would be Wada.

    Notes
    -----
    The verdict applies to the scale of the radius: basins that alternate in stripes narrower than it are called Wada.

    References
    ----------
    Daza, Wagemakers, Sanjuan, Scientific Reports 8 (2018) 9954.

    Examples
    --------
    >>> import numpy as np
    >>> wada_merging(np.arange(90)[:, None] % 3 + np.zeros((90, 60), int)).verdict
    'Wada'
    >>> wada_merging(np.arange(90)[:, None] // 30 + np.zeros((90, 60), int)).verdict
    'not'
    """
    image = label_image(basins, include, wraps)
    shortest = min(image.numbers.shape)
    widest = max(shortest / 8, 1.0)
    reach = finite_number("radius", min(max(2.0, shortest / 100), widest) if radius is None else radius, at_least=1.0)
    if reach > widest:
        raise ValueError(
            f"radius={reach:g}: within an eighth of {shortest} cells any boundaries count as one; give a smaller "
            "radius or a larger image"
        )
    tolerated = finite_number("tolerance", tolerance, at_least=0.0, at_most=0.5)
    edges = [_merged_boundary(image, k) for k in range(len(image.names))]
    whole = np.logical_or.reduce(edges)
    distances = [_distance(edge, image.wraps) for edge in edges]
    n = len(edges)
    largest, median, apart = (np.zeros((n, n)) for _ in range(3))
    for i, edge in enumerate(edges):
        for j in range(n):
            if i != j and edge.any():
                far = distances[j][edge]
                largest[i, j], median[i, j], apart[i, j] = far.max(), np.median(far), (far > reach).mean()
    near = np.sum([d[whole] <= reach for d in distances], axis=0)
    cells = int(np.count_nonzero(whole))
    return MergingTest(
        image.names,
        reach,
        tolerated,
        largest,
        median,
        apart,
        np.bincount(near, minlength=n + 1) / max(cells, 1),
        cells,
        image.source,
    )


def _merged_boundary(image: LabelImage, basin: int) -> Bools:
    """Mark cells next to the boundary between one basin and all others together."""
    own = image.numbers == basin
    known = image.numbers != NO_BASIN
    edge = np.zeros(own.shape, bool)
    for axis, n in enumerate(own.shape):
        last = n if image.wraps[axis] and n > 2 else n - 1
        here, there = np.arange(last), np.arange(1, last + 1) % n
        crossing = np.take(own, here, axis) != np.take(own, there, axis)
        crossing &= np.take(known, here, axis) & np.take(known, there, axis)
        marked = np.moveaxis(edge, axis, 0)
        marked[here] |= np.moveaxis(crossing, axis, 0)
        marked[there] |= np.moveaxis(crossing, axis, 0)
    return edge


def _distance(edge: Bools, wraps: tuple[bool, ...]) -> Floats:
    """Return the distance of each cell from the nearest marked one, also round circles; inf if there is none."""
    if not edge.any():
        return np.full(edge.shape, np.inf)
    pads = [(n // 2, n // 2) if wrap else (0, 0) for n, wrap in zip(edge.shape, wraps, strict=True)]
    distance = distance_transform_edt(~np.pad(edge, pads, mode="wrap"))
    inner = tuple(slice(a, a + n) for (a, _), n in zip(pads, edge.shape, strict=True))
    return np.asarray(distance[inner], dtype=float)
