"""Bright blobs in an image: threshold, labels, centres to a small part of a pixel."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, nan, pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import binary_dilation

from ..arrays import Floats

try:
    from skimage.filters import threshold_otsu
    from skimage.measure import label, regionprops
except ModuleNotFoundError:
    raise ModuleNotFoundError("tracking markers needs scikit-image: pip install 'cellmap-dynamics[lab]'") from None

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
    apart = binary_dilation(others, _EIGHT, 2) & ~inside if others.any() else others
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
