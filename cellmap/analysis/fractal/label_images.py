"""Label images: basins of cells, and cells without a basin."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._compiled.kernels.boxes import NO_BASIN as NO_BASIN
from ..._lib.arrays import Bools
from ..._lib.checks import whole_number
from ...attractors.labels import LABEL_NAMES
from ...basins.record import Basins

_FEW = 64  # labels that are looked for one by one


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
    def ignored(self) -> float:
        """Fraction of the cells without a basin."""
        return float(np.count_nonzero(self.numbers == NO_BASIN) / self.numbers.size)

    def every(self, step: int, first: Sequence[int]) -> LabelImage:
        """Return every so many cells along each axis; circles stay circles where the step goes into them."""
        index = tuple(slice(a, None, step) for a in first)
        wraps = tuple(w and n % step == 0 for w, n in zip(self.wraps, self.numbers.shape, strict=True))
        return LabelImage(np.ascontiguousarray(self.numbers[index]), self.names, wraps)

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
    source: Basins | ArrayLike, include: Sequence[int] = (), wraps: Sequence[bool] | None = None, name: str = "basins"
) -> LabelImage:
    """Read a label image from basins on a grid, or from an array of labels.

    Parameters
    ----------
    source : Basins or array_like of int
        Basins on a grid, or labels of cells in any number of dimensions.  Negative labels are no basins; in arrays of
        floats NaN, and in masked arrays what is masked, is missing, which is no basin either.
    include : sequence of int, optional
        Negative labels that count as basins all the same, such as (-2,) for divergent orbits.
    wraps : sequence of bool, optional
        Which axes are circles; by default those of the grid of basins, and none of an array.
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
    >>> label_image([[0, 4, -2], [4, 4, -3]], include=(-2,))
    LabelImage(2 x 3 cells, 3 basins)
    """
    counted = included_labels(include)
    missing: Bools | None = None
    if not isinstance(source, Basins):
        labels, missing = _whole(source, name)
        circles = (False,) * labels.ndim
    elif source.grid is None:
        raise ValueError(
            f"{name}: these basins are of single initial conditions, which have no neighbours; give basins on a grid, "
            "or their labels if the initial conditions are in the order of a grid"
        )
    else:
        labels, circles = source.labels, source.grid.wraps
    if wraps is not None and len(tuple(wraps)):
        circles = tuple(bool(w) for w in wraps)
    if len(circles) != labels.ndim:
        raise ValueError(
            f"wraps={circles!r}: give one entry for each of the {labels.ndim} axes, True if it is periodic"
        )
    if labels.size < 2:
        raise ValueError(f"{name} has {labels.size} cells of the shape {labels.shape}: give at least two cells")
    known = labels if missing is None else labels[~missing]
    low, high = (int(known.min()), int(known.max())) if known.size else (0, -1)
    if missing is not None:
        labels = np.where(missing, low, labels)
    if high - low < _FEW:
        values, index = np.arange(low, high + 1), labels - low if low else labels
        occurs = np.array([(known == v).any() for v in values.tolist()], bool)
    else:
        values, index = np.unique(labels, return_inverse=True)
        occurs = np.ones(len(values), bool)
    basins = np.flatnonzero(occurs & ((values >= 0) | np.isin(values, counted)))
    names = values[basins]
    if not len(names):
        raise ValueError(f"{name}: no cell belongs to a basin; give labels from 0, or count others with include=")
    if len(names) > np.iinfo(np.int16).max:
        raise ValueError(f"{name} has {len(names)} labels: give labels of basins, not values of a field")
    if names[0] == 0 and len(names) == high + 1:
        numbers = np.maximum(labels, NO_BASIN).astype(np.int16, copy=False)
    else:
        table = np.full(len(values), NO_BASIN, np.int16)
        table[basins] = np.arange(len(names))
        numbers = table[index].reshape(labels.shape)
    if missing is not None:
        numbers[missing] = NO_BASIN
    wide = [j for j, n in enumerate(labels.shape) if n > 1]
    image = np.ascontiguousarray(numbers.reshape([labels.shape[j] for j in wide]))
    return LabelImage(image, tuple(int(v) for v in names), tuple(circles[j] for j in wide))


def included_labels(include: Sequence[int]) -> tuple[int, ...]:
    """Check which negative labels count as basins."""
    counted = tuple(include) if not isinstance(include, int | np.integer) else (int(include),)
    for label in counted:
        if whole_number("include", label, at_least=min(LABEL_NAMES)) >= 0:
            raise ValueError(f"include={label!r}: give negative labels, among {sorted(LABEL_NAMES)}")
    return counted


def _whole(source: ArrayLike, name: str) -> tuple[NDArray[np.integer], Bools | None]:
    """Return labels as whole numbers, and which are missing, if any are."""
    masked = np.ma.getmaskarray(source) if isinstance(source, np.ma.MaskedArray) else None
    try:
        values = np.asarray(np.ma.getdata(source) if masked is not None else source)
    except ValueError:
        raise ValueError(f"{name}: rows of different lengths; give an array of labels") from None
    if values.ndim == 0 or values.dtype.kind not in "iufb":
        raise TypeError(f"{name}={source!r}: give Basins, or an array of whole numbers")
    if values.dtype.kind != "f":
        return values if values.dtype == np.int16 else values.astype(np.int64), masked
    missing = np.isnan(values) if masked is None else np.isnan(values) | masked
    whole = np.where(missing, NO_BASIN, values)
    labels = whole.astype(np.int64)
    if not (labels == whole).all():
        raise ValueError(f"{name} holds {whole[labels != whole].flat[0]}: labels are whole numbers")
    return labels, missing
