"""Boxes of a basin image that contain basin boundary, by box size."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..._compiled.kernels.boxes import halve, mixed_boxes
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
                level = _halved(level, [(o // side) & 1 for o in shifts])
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


def _halved(bits: NDArray[np.uint8], shifts: Sequence[int]) -> NDArray[np.uint8]:
    """Boxes of twice the side, the first of which begin `shifts` boxes before the first box of these."""
    shape = tuple((n + b + 1) // 2 for n, b in zip(bits.shape, shifts, strict=True))
    leading = bits.shape[:-1]
    place = np.indices(shape[:-1]).reshape(len(leading), int(np.prod(shape[:-1])))
    parts = []
    for half in itertools.product((0, 1), repeat=len(leading)):
        at = [2 * p + h - b for p, h, b in zip(place, half, shifts[:-1], strict=True)]
        inside = np.ones(place.shape[1] if leading else 1, bool)
        for a, n in zip(at, leading, strict=True):
            inside &= (a >= 0) & (a < n)
        clipped = tuple(np.clip(a, 0, n - 1) for a, n in zip(at, leading, strict=True))
        number = np.ravel_multi_index(clipped, leading) if leading else np.zeros(1, np.int64)
        parts.append(np.where(inside, number, -1))
    rows = np.ascontiguousarray(np.stack(parts, axis=-1))
    flat = bits.reshape(-1, bits.shape[-1])
    out = np.empty((len(rows), shape[-1]), np.uint8)

    def work(part: slice) -> None:
        halve(flat, rows, shifts[-1], part.start, part.stop, out)

    run_over(slices(len(rows), max(1, _ROWS // bits.shape[-1])), work)
    return out.reshape(shape)


def _joined(bits: NDArray[np.uint8], size: int, shifts: Sequence[int]) -> NDArray[np.uint8]:
    """Boxes of any side."""
    boxes = bits
    for axis, (n, shift) in enumerate(zip(bits.shape, shifts, strict=True)):
        initial_conditions = np.maximum(np.arange(-(shift % size), n, size), 0)
        boxes = np.bitwise_or.reduceat(boxes, initial_conditions, axis=axis)
    return np.asarray(boxes)


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
