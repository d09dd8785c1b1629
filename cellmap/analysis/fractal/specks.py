"""Isolated labels of a basin image: groups of a few cells inside another basin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..._compiled.kernels.boxes import NO_BASIN
from ..._lib.arrays import Bools, Floats
from .label_boxes import count_boxes
from .label_images import LabelImage

_MOST = 4  # cells of a speck, which touch at least at their corners
_ALONE = 0.05  # fraction of the boxes that may hold specks alone without changing the result
_GROWTH = 1.2  # of the odds of such boxes, from the smallest size on, that rounding of a few counts does not reach


def without_specks(image: LabelImage) -> LabelImage:
    """Return an image in which specks, of at most four cells, have a label of the cells around them."""
    small = np.zeros(image.numbers.shape, bool)
    for value in np.unique(image.numbers):
        if value != NO_BASIN:
            small |= _pieces_of_few_cells(image.numbers == value)
    labels = image.numbers.copy()
    for _ in range(_MOST):
        places = np.nonzero(small)
        for axis in range(labels.ndim):
            for step in (-1, 1):
                beside = list(places)
                beside[axis] = places[axis] + step
                n = labels.shape[axis]
                beside[axis] = beside[axis] % n if image.wraps[axis] else beside[axis].clip(0, n - 1)
                known = small[places] & ~small[tuple(beside)] & (labels[tuple(beside)] != NO_BASIN)
                chosen = tuple(p[known] for p in places)
                labels[chosen] = labels[tuple(b[known] for b in beside)]
                small[chosen] = False
    return replace(image, numbers=labels)


def _pieces_of_few_cells(inside: Bools) -> Bools:
    from scipy.ndimage import label

    numbers = label(inside, np.ones((3,) * inside.ndim))[0]
    few = np.bincount(numbers.ravel()) <= _MOST
    few[0] = False
    return np.asarray(few[numbers])


def isolated_fractions(
    boundary: NDArray[np.uint8], rest: NDArray[np.uint8], wraps: Sequence[bool], sizes: Sequence[int]
) -> Floats:
    """Return the fraction of the boxes with boundary of each size that hold none of the rest, which specks leave."""
    found, left = (count_boxes(bits, wraps, sizes, [0] * bits.ndim) for bits in (boundary, rest))
    return np.asarray(np.clip(1.0 - left / np.maximum(found, 1e-300), 0.0, 1.0))


def are_noise(isolated: Floats) -> bool:
    """Return whether specks lie away from other boundary, by the fraction of boxes that hold them alone.

    Shares begin at the smallest size.  They fall with the size where specks are what cells show of finer structure.
    """
    odds = isolated / np.maximum(1.0 - isolated, 1e-300)
    return bool(isolated.max(initial=0.0) > _ALONE and odds.max() > _GROWTH * odds[0])
