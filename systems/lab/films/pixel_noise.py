"""Noise of a camera's pixels, from the film itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.optimize import nnls

from ..arrays import Floats
from .film import Film

_PAIRS, _BINS = 12, 24


@dataclass(frozen=True)
class PixelNoise:
    """Variance of a pixel's grey value, constant + slope x grey value: noise of reading and shot noise.

    Parameters
    ----------
    constant : float
        Variance of a black pixel.
    slope : float
        Growth of the variance with the grey value.
    """

    constant: float
    slope: float

    def variance(self, grey: NDArray[Any]) -> Floats:
        """Return the variance of pixels of these grey values."""
        return self.constant + self.slope * np.clip(grey, 0.0, None)


def pixel_noise(film: Film) -> PixelNoise:
    """Return the noise of the pixels, from the differences between frames that follow each other.

    Half the variance of the differences is a straight line over the grey value.  Pixels where something moves would
    give too much: those near an edge are left out, and in each class of grey values those beyond four standard
    deviations, by the median.
    Whole grey values have a variance of at least 1/12 from rounding.

    Parameters
    ----------
    film : Film
        The film; 12 pairs of frames are used.

    Returns
    -------
    PixelNoise
        The noise; without a pair of frames, that of rounding alone.

    References
    ----------
    Janesick, *Photon Transfer* (2007), chapter 5.

    Examples
    --------
    >>> from systems.lab import film_at_rate
    >>> rng = np.random.default_rng(1)
    >>> frames = rng.normal(100.0, 2.0, (5, 64, 64))
    >>> bool(abs(pixel_noise(film_at_rate(frames, 100.0)).variance(np.array(100.0)) - 4.0) < 0.2)
    True
    """
    least = 0.0 if film.frames.dtype.kind == "f" else 1.0 / 12.0
    present = np.flatnonzero(~film.missing)
    firsts = present[:-1][np.diff(present) == 1]
    if not firsts.size:
        return PixelNoise(least, 0.0)
    chosen = firsts[np.unique(np.linspace(0, firsts.size - 1, _PAIRS).round().astype(int))]
    before, after = film.frames[chosen].astype(np.float32), film.frames[chosen + 1].astype(np.float32)
    mean, apart = 0.5 * (before + after), after - before
    usual = 1.4826 / np.sqrt(2.0) * float(np.median(np.abs(apart)))
    rough = maximum_filter(mean, (1, 3, 3)) - minimum_filter(mean, (1, 3, 3))
    smooth = rough <= max(0.1 * float(np.ptp(mean)), 8.0 * usual)
    mean, apart = mean[smooth], apart[smooth]
    edges = np.unique(np.linspace(mean.min(), mean.max(), _BINS + 1))
    classes = np.clip(np.searchsorted(edges, mean, side="right") - 1, 0, max(edges.size - 2, 0))
    greys, variances, weights = [], [], []
    for k in range(max(edges.size - 1, 1)):
        part = apart[classes == k]
        if part.size < 30:
            continue
        limit = 4.0 * max(1.4826 * float(np.median(np.abs(part))), np.sqrt(2.0 * least))
        kept = part[np.abs(part) <= limit]
        greys.append(float(mean[classes == k].mean()))
        variances.append(0.5 * float(kept.astype(np.float64).var()))
        weights.append(np.sqrt(kept.size) / max(variances[-1], least, 1e-12))
    if not greys:
        return PixelNoise(least, 0.0)
    design = np.column_stack([np.ones(len(greys)), np.clip(greys, 0.0, None)]) * np.array(weights)[:, None]
    constant, slope = nnls(design, np.array(variances) * weights)[0]
    return PixelNoise(max(float(constant), least), float(slope))
