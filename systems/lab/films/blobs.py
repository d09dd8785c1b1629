"""Bright blobs in an image: threshold, labels, light around and across them, centres to a small part of a pixel."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, nan, pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import binary_dilation, binary_erosion

from ..arrays import Bools, Floats
from .pixel_noise import PixelNoise

try:
    from skimage.filters import threshold_otsu
    from skimage.measure import label, regionprops
except ModuleNotFoundError:
    raise ModuleNotFoundError("tracking markers needs scikit-image: pip install 'cellmap-dynamics[lab]'") from None

Box = tuple[int, int, int, int]  # first row, row past the last, first column, column past the last

_SECTORS = 24  # directions that are distinguished in the surroundings of a blob
_LEFT, _RIGHT = np.roll(np.arange(_SECTORS), 1), np.roll(np.arange(_SECTORS), -1)  # directions beside each of them
_ROD = 0.1  # fraction of the contrast by which something beyond the edge stands out
_SQUARE, _WIDE_SQUARE = np.ones((3, 3), bool), np.ones((5, 5), bool)
_FEW = 16  # inner pixels of a blob; with fewer, those that touch its outside at a corner count as well
_FEWEST = 7  # inner pixels that tell of a slope
_CHANCE = 12.0  # square of a slope over its standard error, which chance exceeds once in 400 times
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
    def centre(self) -> complex:
        """Centre as a complex number, column + 1j row."""
        return complex(self.column, self.row)

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
    Otsu, IEEE Transactions on Systems, Man, and Cybernetics 9 (1979) 62; by scikit-image (van der Walt et al., PeerJ 2
    (2014) e453).

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
    bright = grey > threshold_otsu(grey)
    dark, light, fraction = grey[~bright], grey[bright], float(bright.mean())
    between = fraction * (1.0 - fraction) * float(light.mean() - dark.mean()) ** 2
    return 0.5 * (float(dark.max()) + float(light.min())), between / float(grey.var())


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
    if not bright.any():
        return []
    labels = label(bright, connectivity=2)
    background = float(np.median(patch[::2, ::2]))
    chosen = [region for region in regionprops(labels) if areas[0] <= region.num_pixels <= areas[1]]
    found = [_measure(frame, box, labels, region, background, noise, weighted) for region in chosen]
    return [blob for blob in found if blob is not None]


def _measure(
    frame: NDArray[Any],
    box: Box,
    labels: NDArray[Any],
    region: Any,
    background: float,
    noise: PixelNoise,
    weighted: bool,
) -> Blob | None:
    """Measure one blob with the rim around it, in which its blurred edge ends.

    What a pixel is when covered in full is a plane through the blob, where it is beyond chance that light changes.
    """
    top, bottom, left, right = box
    rows, columns = (slice(max(s.start - _RIM, 0), s.stop + _RIM) for s in region.slice)
    near, values = labels[rows, columns], frame[top:bottom, left:right][rows, columns].astype(np.float64)
    inside = near == region.label
    plateau = _plateau(values[inside])
    contrast = plateau - background
    if contrast <= 0.0:
        return None
    levels, tilt = surroundings(values, near, inside, background, contrast, uneven=False)
    others = (near > 0) & ~inside
    apart = binary_dilation(others, _SQUARE, 2) & ~inside if others.any() else others
    y, x = top + rows.start + np.arange(len(values)), left + columns.start + np.arange(values.shape[1])
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
    stretch = sqrt((half + spread) / max(half - spread, 1e-9 * half))
    sides = np.array(region.bbox) == (0, 0, *labels.shape)
    ends = np.array((top, left, bottom, right)) == (0, 0, *frame.shape)
    clipped, cut = bool((sides & ends).any()), bool((sides & ~ends).any())
    return Blob(column, row, area, errors[1], errors[0], plateau, background, stretch, clipped, cut)


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
    beyond = float(slope @ np.linalg.solve(squares, slope))
    if beyond <= _CHANCE:
        return none, none
    taken = 1.0 - (_CHANCE / beyond) ** 2
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
