"""How light changes across a blob and around it."""

from __future__ import annotations

from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, binary_erosion

from ..arrays import Bools, Floats
from .pixel_noise import PixelNoise

_SECTORS = 24  # directions that are distinguished in the surroundings of a blob
_LEFT, _RIGHT = np.roll(np.arange(_SECTORS), 1), np.roll(np.arange(_SECTORS), -1)  # directions beside each of them
_ROD = 0.1  # fraction of the contrast by which something beyond the edge stands out
_SQUARE, _WIDE_SQUARE = np.ones((3, 3), bool), np.ones((5, 5), bool)
_FEW = 16  # inner pixels of a blob; with fewer, those that touch its outside at a corner count as well
_FEWEST = 7  # inner pixels that tell of a slope
_CHANCE = 12.0  # square of a slope over its standard error, which chance exceeds once in 400 times


def slope_inside(
    values: Floats, inside: Bools, centre: tuple[float, float], radius: float, noise: PixelNoise
) -> tuple[Floats, Floats]:
    """Return by how much a blob grows brighter from pixel to pixel, down and across, and the standard errors.

    It is the slope of a plane through the grey values of the pixels that do not touch its outside, together with what
    the blurred edge takes from them, alike on all sides of the centre (row, column).  The errors are those of the
    pixels' noise, or of what the plane does not fit.  The less a slope exceeds chance, the less of it is given: none of
    one that is as large by chance once in 400 times.
    """
    none = np.zeros(2)
    inner = _within(inside)
    rows, columns = np.nonzero(inner)
    if rows.size < _FEWEST:
        return none, none
    grey = values[inner]
    down, across = rows - centre[0], columns - centre[1]
    dimmed = np.exp(2.0 * np.minimum(np.hypot(down, across) - radius, 0.0))
    design = np.stack([down, across, dimmed, np.ones(grey.size)])
    inverse = np.linalg.inv(design @ design.T + 1e-9 * np.eye(4))
    fit = inverse @ (design @ grey)
    rest = grey - fit @ design
    variance = max(float(noise.variance(grey.mean())), float(rest @ rest) / (grey.size - 4), 1e-12)
    slope, squares = fit[:2], variance * inverse[:2, :2]
    (a, b), (_, c) = squares.tolist()
    s, t = slope.tolist()
    determinant, beyond = a * c - b * b, c * s * s - 2.0 * b * s * t + a * t * t
    if determinant <= 0.0 or beyond <= _CHANCE * determinant:
        return none, none
    taken = 1.0 - (_CHANCE * determinant / beyond) ** 2
    return taken * slope, np.sqrt(np.diag(squares))


def _within(inside: Bools) -> Bools:
    """Return the pixels whose eight neighbours are inside as well; where they are few, the four at their sides."""
    within = binary_erosion(inside, _SQUARE)
    return within if np.count_nonzero(within) >= _FEW else binary_erosion(inside)


def surroundings(
    values: Floats, near: NDArray[np.int32], inside: Bools, background: float, contrast: float, uneven: bool
) -> tuple[Floats, Floats]:
    """Return for each pixel the grey value beyond the blob's edge in its direction, and the slope of these values.

    So a rod that meets the blob does not pull its centre: the edge is judged by what is on its two sides.  A rod is as
    wide at the edge as beyond it, and so covers more directions there: it counts in those beside its own as well.
    In `uneven` light a plane through what is no rod tells how grey values change from beyond the edge to the edge; in
    even light their slope is 0.
    """
    rows, columns = np.nonzero(inside)
    down = np.arange(len(values))[:, None] - rows.mean()
    across = np.arange(values.shape[1]) - columns.mean()
    sectors = ((np.arctan2(down, across) / (2.0 * pi) + 0.5) * _SECTORS).astype(np.intp) % _SECTORS
    beyond = ~binary_dilation(inside, _WIDE_SQUARE) & (near == 0)
    which = sectors[beyond]
    count = np.bincount(which, minlength=_SECTORS)
    total = np.bincount(which, values[beyond], _SECTORS)
    levels = np.where(count > 0, total / np.maximum(count, 1), background)
    limit, plane, ground, slope = _ROD * contrast, np.full(_SECTORS, background), background, np.zeros(2)
    if uneven:
        r, c = np.nonzero(beyond)
        sums = np.stack([np.bincount(which, part, _SECTORS) for part in (down[r, 0], across[c])])
        places = sums / np.maximum(count, 1)
        for _ in range(2):
            rods = levels > plane + limit
            clear = (count > 0) & ~(rods | rods[_LEFT] | rods[_RIGHT])
            if 3 * np.count_nonzero(clear) < _SECTORS:
                break
            middle, level = places[:, clear].mean(axis=1), float(levels[clear].mean())
            off = places[:, clear] - middle[:, None]
            slope = np.linalg.solve(off @ off.T + 1e-6 * np.eye(2), off @ (levels[clear] - level))
            plane = level + slope @ (places - middle[:, None])
            ground = level + slope[0] * (down - middle[0]) + slope[1] * (across - middle[1])
    more = np.where(count > 0, levels - plane, 0.0)
    beside = np.maximum(more[_LEFT], more[_RIGHT])
    more = np.where(beside > limit, np.maximum(more, beside), more)
    return more[sectors] + ground, slope
