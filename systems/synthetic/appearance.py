"""What a synthetic film shows: markers and rods, what hides them or may be taken for them, and the camera."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from cellmap.utils import finite_number, whole_number

from ..lab.arrays import Floats


@dataclass(frozen=True)
class Look:
    """How things look on a film: sizes in pixels, grey values of 255, noise in electrons.

    Parameters
    ----------
    marker_radius : float or tuple of float, optional
        Radius of the markers; one for all, or one for each.
    marker, rod, background : float, optional
        Grey values in full light.
    rod_width : float, optional
        Width of the rods.
    shade : float, optional
        Fraction of the light that is missing in the darkest corner, below 1.
    blur : float, optional
        Standard deviation of the Gaussian point spread of the optics.
    full_well : float, optional
        Electrons of a pixel of the grey value 255: shot noise has as many electrons squared as there are electrons.
        Infinite for a film without shot noise.
    read_noise : float, optional
        Standard deviation of the noise of reading (grey values).
    pivot_marker : bool, optional
        Whether the pivot carries a marker, as number 0.
    """

    marker_radius: float | tuple[float, ...] = 5.0
    marker: float = 220.0
    rod: float = 90.0
    background: float = 40.0
    rod_width: float = 4.0
    shade: float = 0.3
    blur: float = 0.8
    full_well: float = 10_000.0
    read_noise: float = 1.0
    pivot_marker: bool = False

    def __post_init__(self) -> None:
        for name in ("marker", "rod", "background", "blur", "read_noise", "rod_width"):
            finite_number(name, getattr(self, name), at_least=0.0)
        finite_number("shade", self.shade, at_least=0.0, at_most=0.99)
        if not self.full_well > 0.0:
            raise ValueError(f"full_well={self.full_well!r}: give a number above 0")


@dataclass(frozen=True)
class Bar:
    """Rectangle in front of everything, fixed in the image: columns left to right, rows top to bottom (pixels).

    Parameters
    ----------
    left, right, top, bottom : float
        Edges.
    grey : float, optional
        Grey value in full light.
    start, end : float, optional
        Time in which it is there (s); by default always.
    """

    left: float
    right: float
    top: float
    bottom: float
    grey: float = 25.0
    start: float = -inf
    end: float = inf


@dataclass(frozen=True)
class Spot:
    """Disc behind everything, fixed in the image: a bright object that is no marker.

    Parameters
    ----------
    column, row, radius : float
        Centre and radius (pixels).
    grey : float, optional
        Grey value in full light.
    """

    column: float
    row: float
    radius: float
    grey: float = 220.0


@dataclass(frozen=True)
class Camera:
    """Camera that looks straight at the plane of motion.

    Parameters
    ----------
    scale : float
        Pixels per metre, above 0.
    origin : tuple of float
        Pixel (column, row) of the world's origin.
    shape : tuple of int
        Height and width of the image (pixels).

    Raises
    ------
    TypeError, ValueError
        For numbers that are not finite or not positive.

    Examples
    --------
    >>> camera = Camera(scale=1000.0, origin=(64.0, 32.0), shape=(96, 128))
    >>> camera.pixels([0.01, 0.02])
    array([74., 12.])
    >>> camera.places([74.0, 12.0])
    array([0.01, 0.02])
    """

    scale: float
    origin: tuple[float, float]
    shape: tuple[int, int]

    def __post_init__(self) -> None:
        finite_number("scale", self.scale, above=0.0)
        for name in ("origin", "shape"):
            pair = getattr(self, name)
            if not isinstance(pair, tuple) or len(pair) != 2:
                raise TypeError(f"{name}={pair!r}: give a tuple of two numbers")
        for k in range(2):
            finite_number(f"origin[{k}]", self.origin[k])
            whole_number(f"shape[{k}]", self.shape[k], at_least=1)

    def pixels(self, places: ArrayLike) -> Floats:
        """Return pixels (column, row) of places (x right, y up) in m, arrays of shape (..., 2)."""
        return np.asarray(self.origin) + self.scale * (_pairs("places", places) * [1.0, -1.0])

    def places(self, pixels: ArrayLike) -> Floats:
        """Return places (x right, y up) in m of pixels (column, row), arrays of shape (..., 2)."""
        return (_pairs("pixels", pixels) - self.origin) * [1.0, -1.0] / self.scale


def _pairs(name: str, given: ArrayLike) -> Floats:
    pairs = np.asarray(given, np.float64)
    if pairs.shape[-1:] != (2,):
        raise ValueError(f"{name} have the shape {pairs.shape}: give pairs, as (..., 2)")
    return pairs
