"""Label images: basins of cells, and cells without a basin."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._lib.checks import whole_number
from ...basins.record import LABEL_NAMES, Basins

NO_BASIN = -1
"""Number of cells without a basin in a :class:`LabelImage`."""


@dataclass(frozen=True, eq=False)
class LabelImage:
    """Basins of cells, numbered without gaps.

    Parameters
    ----------
    numbers : ndarray of int16
        Number of each cell's basin, 0, 1, ...; NO_BASIN for cells without one.  Axes of one cell are taken out.
    names : tuple of int
        Label that each basin had.
    wraps : tuple of bool
        Which axes are circles.
    """

    numbers: NDArray[np.int16]
    names: tuple[int, ...]
    wraps: tuple[bool, ...]

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.numbers.shape))
        return f"LabelImage({shape} cells, {len(self.names)} basins)"

    @property
    def complete(self) -> bool:
        """Whether each cell has a basin."""
        return bool(self.numbers.min() > NO_BASIN)

    def neighbours(self, axis: int, distance: int = 1) -> Iterator[tuple[NDArray[np.int16], NDArray[np.int16]]]:
        """Yield cells and those some cells further along an axis; round a circle the last ones meet the first."""
        n = self.numbers.shape[axis]
        before, after = ([slice(None)] * self.numbers.ndim for _ in range(2))
        before[axis], after[axis] = slice(0, n - distance), slice(distance, n)
        yield self.numbers[tuple(before)], self.numbers[tuple(after)]
        if self.wraps[axis] and 2 * distance <= n:
            before[axis], after[axis] = slice(n - distance, n), slice(0, distance)
            yield self.numbers[tuple(before)], self.numbers[tuple(after)]


def label_image(
    source: Basins | ArrayLike, also: Sequence[int] = (), wraps: Sequence[bool] = (), name: str = "basins"
) -> LabelImage:
    """Read a label image from basins on a grid, or from an array of labels.

    Parameters
    ----------
    source : Basins or array_like of int
        Basins on a grid, or labels of cells in any number of dimensions.  Negative labels are no basins; in arrays of
        floats NaN, and in masked arrays what is masked, is missing, which is no basin either.
    also : sequence of int, optional
        Negative labels that count as basins all the same, such as (-2,) for the starts that diverge.
    wraps : sequence of bool, optional
        Which axes of an array are circles; for basins the grid knows.
    name : str, optional
        Name of the argument in errors.

    Returns
    -------
    LabelImage
        Numbers of basins.

    Raises
    ------
    TypeError, ValueError
        For what is no image of labels: not whole numbers, fewer than two cells, no cell with a basin.

    Examples
    --------
    >>> label_image([[0, 4, -2], [4, 4, -3]], also=(-2,))
    LabelImage(2 x 3 cells, 3 basins)
    """
    counted = also_labels(also)
    if isinstance(source, Basins):
        if source.grid is None:
            raise ValueError(
                f"{name}: these basins are of single initial conditions, which have no neighbours; give basins on a "
                "grid, or their labels if the initial conditions are in the order of a grid"
            )
        if len(tuple(wraps)):
            raise ValueError(f"wraps={tuple(wraps)!r}: the grid of basins determines the periodic axes; leave it out")
        labels: NDArray[Any] = source.labels
        circles = source.grid.wraps
        missing = np.zeros(labels.shape, bool)
    else:
        labels, missing = _whole(source, name)
        circles = tuple(bool(w) for w in wraps) or (False,) * labels.ndim
        if len(circles) != labels.ndim:
            raise ValueError(
                f"wraps={circles!r}: {name} has {labels.ndim} axes; give one entry for each, True if it is periodic"
            )
    if labels.size < 2:
        raise ValueError(f"{name} has {labels.size} cells of the shape {labels.shape}: give at least two cells")
    wide = tuple(j for j, n in enumerate(labels.shape) if n > 1)
    valid = ~missing & ((labels >= 0) | np.isin(labels, counted))
    names = np.unique(labels[valid])
    if not len(names):
        raise ValueError(f"{name}: no cell belongs to a basin; give labels from 0, or count others with also=")
    if len(names) > np.iinfo(np.int16).max:
        raise ValueError(f"{name} has {len(names)} labels: give labels of basins, not values of a field")
    numbers = np.where(valid, np.searchsorted(names, labels), NO_BASIN).astype(np.int16)
    shape = tuple(labels.shape[j] for j in wide)
    return LabelImage(numbers.reshape(shape), tuple(int(v) for v in names), tuple(circles[j] for j in wide))


def also_labels(also: Sequence[int]) -> tuple[int, ...]:
    """Check which negative labels count as basins."""
    counted = tuple(also) if not isinstance(also, int | np.integer) else (int(also),)
    for label in counted:
        if whole_number("also", label, at_least=min(LABEL_NAMES)) >= 0:
            raise ValueError(f"also={label!r}: give negative labels, among {sorted(LABEL_NAMES)}")
    return counted


def _whole(source: ArrayLike, name: str) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return labels as whole numbers, and which are missing."""
    masked = np.ma.getmaskarray(source) if isinstance(source, np.ma.MaskedArray) else None
    try:
        values = np.asarray(np.ma.getdata(source) if masked is not None else source)
    except ValueError:
        raise ValueError(f"{name}: rows of different lengths; give an array of labels") from None
    if values.ndim == 0 or values.dtype.kind not in "iufb":
        raise TypeError(f"{name}={source!r}: give Basins, or an array of whole numbers")
    missing = np.isnan(values) if values.dtype.kind == "f" else np.zeros(values.shape, bool)
    if masked is not None:
        missing = missing | masked
    whole = np.where(missing, NO_BASIN, values)
    labels = whole.astype(np.int64)
    if not (labels == whole).all():
        raise ValueError(f"{name} holds {whole[labels != whole].flat[0]}: labels are whole numbers")
    return labels, missing
