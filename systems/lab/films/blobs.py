"""Bright blobs in an image: threshold, labels, centres to a small part of a pixel."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, nan, pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import binary_dilation, find_objects, label

from ..arrays import Floats
from .illumination import slope_inside, surroundings
from .pixel_noise import PixelNoise

Box = tuple[int, int, int, int]  # first row, row past the last, first column, column past the last

_EIGHT = np.ones((3, 3), bool)
_RIM = 4  # pixels around a labelled blob in which its blurred edge ends
_EDGE = (0.2, 0.8)  # fractions of the contrast between which a pixel counts as partly covered
_BLUR = 1.683  # standard deviations of a blurred edge between these fractions
_PASSES = 3  # times that the light across a blob is looked at, each about the centre that the one before gave
# Measured: a disc's centre errs by this over its radius, from where its edge falls on the pixels, where the optics
# spread it by 0.8 pixels (tests/systems/lab/test_marker_centres.py),
_PHASE_ERROR = 0.035
# and by this over the root of its radius for each pixel by which the edge is narrower than a soft one: 0.55 pixels
# without optics, 1.4 where they spread it by 0.8 (tests/systems/lab/test_error_estimates.py).
_SHARP_ERROR, _SOFT_EDGE = 0.09, 1.25


@dataclass(frozen=True, slots=True)
class Blob:
    """A bright blob.

    Parameters
    ----------
    column, row : float
        Centre (pixels).
    area : float
        Area (pixels), by the fractions to which pixels are covered.
    column_error, row_error : float
        Standard errors of the centre (pixels).
    plateau, background : float
        Grey values of the blob and of what is around it.
    stretch : float
        Length over width, by its second moments: 1 for a disc.
    clipped : bool
        Whether it touches the border of the image.
    cut : bool
        Whether it touches another border of the box that was searched, so that it may go on beyond it.
    """

    column: float
    row: float
    area: float
    column_error: float
    row_error: float
    plateau: float
    background: float
    stretch: float
    clipped: bool
    cut: bool

    @property
    def radius(self) -> float:
        """Radius of a disc of this area (pixels)."""
        return sqrt(self.area / pi)


def otsu_threshold(values: ArrayLike) -> tuple[float, float]:
    """Return the grey value that parts dark from bright pixels best, and how well it does.

    Of the 255 limits between 256 classes of grey values it is the one for which the variance between the two groups is
    the largest fraction of the whole variance; with several equal ones, the middle of them.

    Parameters
    ----------
    values : array_like
        Grey values, of any shape.

    Returns
    -------
    threshold : float
        Bright pixels are above it.
    fraction : float
        Fraction of the variance that lies between the groups: 1 for two grey values, 0.64 for normal noise alone, 0.75
        for an even slope.

    Raises
    ------
    ValueError
        For constant values, or values that are not finite.

    References
    ----------
    Otsu, IEEE Transactions on Systems, Man, and Cybernetics 9 (1979) 62.

    Examples
    --------
    >>> threshold, fraction = otsu_threshold(np.array([10, 10, 10, 200, 210, 210], np.uint8))
    >>> float(threshold), round(fraction, 3)
    (105.0, 0.999)
    >>> otsu_threshold([7, 7, 7])
    Traceback (most recent call last):
    ...
    ValueError: all grey values are 7: there is no threshold in a constant image
    """
    grey = np.asarray(values)
    low, high = float(grey.min()), float(grey.max())
    if not np.isfinite(low + high):
        raise ValueError("grey values are not all finite: leave such frames out")
    if low == high:
        raise ValueError(f"all grey values are {low:g}: there is no threshold in a constant image")
    width = 1.0 if grey.dtype == np.uint8 else (high - low) / 256.0
    edges = np.arange(257.0) - 0.5 if grey.dtype == np.uint8 else np.linspace(low, high, 257)
    counts = np.histogram(grey, edges)[0].astype(float)
    centres = edges[:-1] + 0.5 * width
    dark = np.cumsum(counts)[:-1]
    bright = grey.size - dark
    total, partial = counts @ centres, np.cumsum(counts * centres)[:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        between = dark * bright * (partial / dark - (total - partial) / bright) ** 2 / grey.size**2
    between[(dark == 0) | (bright == 0)] = 0.0
    best = np.flatnonzero(between >= between.max() * (1.0 - 1e-12))
    variance = counts @ (centres - total / grey.size) ** 2 / grey.size
    return 0.5 * (edges[1 + best[0]] + edges[1 + best[-1]]), float(between.max() / variance)


def find_blobs(
    frame: NDArray[Any], box: Box, threshold: float, areas: tuple[float, float], noise: PixelNoise, weighted: bool
) -> list[Blob]:
    """Return the blobs above a threshold in a box whose count of pixels is between two areas.

    Centres are weighted by the covered fraction of each pixel: its grey value between that of the blob there and
    that beyond its edge in the same direction, cut off below 0.2 and above 0.8, so that pixels come in with the weight
    0 and neither a rod nor uneven light pulls much.  Without weights a centre is the mean of the pixels above the
    threshold, and has no standard error.
    """
    top, bottom, left, right = box
    patch = frame[top:bottom, left:right]
    bright = patch > threshold
    labels, count = label(bright, _EIGHT)
    if not count:
        return []
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    chosen = [k for k in range(1, count + 1) if areas[0] <= sizes[k] <= areas[1]]
    if not chosen:
        return []
    background = float(np.median(patch[::2, ::2]))
    pieces = find_objects(labels)
    found = [_measure(frame, box, labels, k, pieces[k - 1], background, noise, weighted) for k in chosen]
    return [blob for blob in found if blob is not None]


def _measure(
    frame: NDArray[Any],
    box: Box,
    labels: NDArray[np.int32],
    number: int,
    piece: tuple[slice, slice],
    background: float,
    noise: PixelNoise,
    weighted: bool,
) -> Blob | None:
    """Measure one blob with the rim around it, in which its blurred edge ends.

    What a pixel is when covered in full is a plane through the blob, where it is beyond chance that light changes.
    """
    top, bottom, left, right = box
    (height, width), (rows, columns) = frame.shape, piece
    first, past = max(rows.start - _RIM, 0), min(rows.stop + _RIM, bottom - top)
    begin, end = max(columns.start - _RIM, 0), min(columns.stop + _RIM, right - left)
    values = frame[top + first : top + past, left + begin : left + end].astype(np.float64)
    near = labels[first:past, begin:end]
    inside = near == number
    plateau = _plateau(values[inside])
    contrast = plateau - background
    if contrast <= 0.0:
        return None
    levels, tilt = surroundings(values, near, inside, background, contrast, uneven=False)
    others = (near > 0) & ~inside
    apart = binary_dilation(others, _EIGHT, 2) & ~inside if others.any() else others
    y, x = np.arange(top + first, top + past), np.arange(left + begin, left + end)
    slope, slope_errors, plane = np.zeros(2), np.zeros(2), np.zeros(values.shape)
    for times in range(1 + _PASSES):
        fraction = (values - levels) / np.maximum(plateau + plane - levels, 0.25 * contrast)
        fraction[apart] = 0.0
        cover = np.clip((fraction - _EDGE[0]) / (_EDGE[1] - _EDGE[0]), 0.0, 1.0)
        area = float(cover.sum())
        weights = cover if weighted else inside.astype(np.float64)
        down, across, total = weights.sum(axis=1), weights.sum(axis=0), float(weights.sum())
        if total <= 0.0 or area <= 0.0:
            return None
        row, column, radius = float(down @ y) / total, float(across @ x) / total, sqrt(area / pi)
        if times == _PASSES:
            break
        slope, slope_errors = slope_inside(values, fraction > 0.5, (row - y[0], column - x[0]), radius, noise)
        if times == 0:
            if not slope.any():
                break
            levels, tilt = surroundings(values, near, inside, background, contrast, uneven=True)
        plane = slope[0] * (y - row)[:, None] + slope[1] * (x - column)
        plateau = _plateau((values - plane)[inside])
        contrast = plateau - background
    edge = (cover > 0.0) & (cover < 1.0)
    pulls = noise.variance(values) * edge
    squares = float(pulls.sum(axis=1) @ (y - row) ** 2), float(pulls.sum(axis=0) @ (x - column) ** 2)
    scale = total * contrast * (_EDGE[1] - _EDGE[0])
    wide = float(edge.sum()) / (2.0 * pi * radius)
    phase, errors = _phase_error(radius, wide), [nan, nan]
    if weighted:
        # The middle of an edge moves by half of what its plateau is wrong, over its steepness.
        lever = 0.5 * radius * wide / (contrast * (_EDGE[1] - _EDGE[0]))
        errors = [sqrt(s / scale**2 + phase**2 + (lever * e) ** 2) for s, e in zip(squares, slope_errors, strict=True)]
        # Blur moves all of the edge towards the darker side, by its variance times the slope over the contrast.
        shift = (wide / _BLUR) ** 2 * (slope - tilt) / contrast
        row, column = row + float(shift[0]), column + float(shift[1])
    moments = float(down @ (y - row) ** 2), float(across @ (x - column) ** 2), float((y - row) @ weights @ (x - column))
    half, spread = 0.5 * (moments[0] + moments[1]), hypot(0.5 * (moments[0] - moments[1]), moments[2])
    sides = rows.start == 0, rows.stop == bottom - top, columns.start == 0, columns.stop == right - left
    ends = top == 0, bottom == height, left == 0, right == width
    return Blob(
        column,
        row,
        area,
        errors[1],
        errors[0],
        plateau,
        background,
        sqrt((half + spread) / max(half - spread, 1e-9 * half)),
        any(s and e for s, e in zip(sides, ends, strict=True)),
        any(s and not e for s, e in zip(sides, ends, strict=True)),
    )


def _plateau(bright: Floats) -> float:
    """Return the mean of the brightest quarter of a blob's pixels."""
    return float(np.sort(bright)[-max(bright.size // 4, 1) :].mean())


def _phase_error(radius: float, width: float) -> float:
    """Return by how much the centre of a disc errs from where its edge, of a width in pixels, falls on them."""
    return max(_PHASE_ERROR / radius, _SHARP_ERROR * (_SOFT_EDGE - width) / sqrt(radius))


def smeared_area(radius: float, travel: float) -> float:
    """Return the area above half the brightest value of a disc that travels while it is exposed (pixels)."""
    if travel <= 0.0 or radius <= 0.0:
        return pi * radius**2
    offsets = (np.arange(32) + 0.5) / 32.0
    chords = 2.0 * radius * np.sqrt(1.0 - offsets**2)
    level = 0.5 * min(1.0, 2.0 * radius / travel)
    lengths = np.where(chords > level * travel, chords + travel * (1.0 - 2.0 * level), 0.0)
    return float(2.0 * radius * lengths.mean())
