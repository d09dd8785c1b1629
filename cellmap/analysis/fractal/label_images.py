"""Label images: basins of cells, cells without a basin, and boxes of cells that contain boundary."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._compiled.kernels.boxes import NO_BASIN as NO_BASIN
from ..._compiled.kernels.boxes import mixed_boxes
from ..._lib.arrays import Bools, Floats, Ints
from ..._lib.checks import whole_number
from ..._lib.threads import run_over, slices
from ...attractors.settling.labels import LABEL_NAMES, Label
from ...basins.record import Basins

_FEW = 64  # labels that are looked for one by one
_ROWS = 1 << 20  # cells in a slice of work


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
    source : str
        Name of the system whose basins they are.
    """

    numbers: NDArray[np.int16]
    names: tuple[int, ...]
    wraps: tuple[bool, ...]
    source: str = ""

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
        return replace(self, numbers=np.ascontiguousarray(self.numbers[index]), wraps=wraps)

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
        Basins on a grid, or labels of cells in any number of dimensions.  Negative labels are no basins, but for
        those of ends; in arrays of floats NaN, and in masked arrays what is masked, is missing: no basin either.
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
    system = source.name if isinstance(source, Basins) else ""
    return LabelImage(image, tuple(int(v) for v in names), tuple(circles[j] for j in wide), system)


def included_labels(include: Sequence[int]) -> tuple[int, ...]:
    """Check which negative labels count as basins, and return them with those of ends, which always do."""
    counted = tuple(include) if not isinstance(include, int | np.integer) else (int(include),)
    for label in counted:
        if whole_number("include", label, at_least=min(LABEL_NAMES)) >= 0:
            raise ValueError(f"include={label!r}: give negative labels, among {sorted(LABEL_NAMES)}")
    return (*counted, *(label for label in LABEL_NAMES if label <= Label.ENDED))


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


def boundary_boxes(image: LabelImage) -> NDArray[np.uint8]:
    """Return which of the smallest boxes, between neighbouring cell centres, have corners in different basins."""
    cells = image.numbers.shape
    shape = tuple(n - (not w) for n, w in zip(cells, image.wraps, strict=True))
    if 0 in shape:  # one cell along an axis has no neighbours there
        return np.zeros(shape, np.uint8)
    rows = _corner_rows(cells[:-1], shape[:-1])
    flat = image.numbers.reshape(-1, cells[-1])
    out = np.empty((len(rows), shape[-1]), np.uint8)

    def work(part: slice) -> None:
        mixed_boxes(flat, rows, part.start, part.stop, out)

    run_over(slices(len(rows), max(1, _ROWS // shape[-1])), work)
    return out.reshape(shape)


def count_boxes(
    boundary: NDArray[np.uint8], wraps: Sequence[bool], sizes: Sequence[int], offset: Sequence[int]
) -> Floats:
    """Return the numbers of boxes of some sizes that hold boundary, on a grid with an offset in the smallest boxes.

    ``boundary`` are the smallest boxes that hold boundary.  Boxes that the edge of the image cuts count by the fraction
    of them that is inside.  Sizes are in rising order; powers of 2 are built one upon the other.
    """
    moved = [-int(o) if w else 0 for o, w in zip(offset, wraps, strict=True)]
    start = np.roll(boundary, moved, tuple(range(boundary.ndim))) if any(moved) else boundary
    shifts = [0 if w else int(o) for o, w in zip(offset, wraps, strict=True)]
    counts = []
    level, side = start, 1
    for size in sizes:
        if size & (size - 1) == 0:
            while side < size:
                # Bit number log2(side) of the offset tells whether the first box of twice the side is half outside.
                level = _joined(level, 2, [o // side for o in shifts])
                side *= 2
            boxes = level
        else:
            boxes = _joined(start, size, shifts)
        counts.append(_weighted(boxes, boundary.shape, size, shifts))
    return np.array(counts)


def _corner_rows(rows: tuple[int, ...], boxes: tuple[int, ...]) -> Ints:
    """Numbers of the rows at the corners of boxes, shape (boxes, corners)."""
    place = np.indices(boxes).reshape(len(boxes), int(np.prod(boxes)))
    corners = []
    for corner in itertools.product((0, 1), repeat=len(boxes)):
        at = tuple((p + c) % n for p, c, n in zip(place, corner, rows, strict=True))
        corners.append(np.ravel_multi_index(at, rows) if rows else np.zeros(1, np.int64))
    return np.ascontiguousarray(np.stack(corners, axis=-1))


def _joined(bits: NDArray[np.uint8], size: int, shifts: Sequence[int]) -> NDArray[np.uint8]:
    """Boxes of so many boxes a side, the first of which begin `shifts` boxes before the first of these."""
    before = [shift % size for shift in shifts]
    boxes = np.pad(bits, [(b, -(n + b) % size) for n, b in zip(bits.shape, before, strict=True)])
    for axis in range(bits.ndim):
        along = np.moveaxis(boxes, axis, 0)
        boxes = np.moveaxis(functools.reduce(np.bitwise_or, (along[k::size] for k in range(size))), 0, axis)
    return boxes


def _weighted(boxes: NDArray[np.uint8], shape: tuple[int, ...], size: int, shifts: Sequence[int]) -> float:
    """Sum of boxes, those at the edges weighted by the fraction inside."""
    pieces = []
    for m, n, shift in zip(boxes.shape, shape, shifts, strict=True):
        before = shift % size
        if m == 1:
            pieces.append([(slice(0, 1), n / size)])
            continue
        last = n + before - (m - 1) * size
        pieces.append([(slice(0, 1), 1.0 - before / size), (slice(1, m - 1), 1.0), (slice(m - 1, m), last / size)])
    occupied = boxes.view(bool)
    total = 0.0
    for piece in itertools.product(*pieces):
        weight = float(np.prod([w for _, w in piece]))
        total += weight * float(np.count_nonzero(occupied[tuple(s for s, _ in piece)]))
    return total
