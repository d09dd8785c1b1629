"""Boxes of a basin image that contain basin boundary, by box size."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..._compiled.kernels.boxes import mixed_boxes
from ..._lib.arrays import Floats, Ints
from ..._lib.threads import run_over, slices
from .label_images import LabelImage

_ROWS = 1 << 20  # cells in a slice of work


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
