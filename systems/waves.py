"""Drives that accelerate the pivot by a square or a triangle wave, sharp or smooth."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from math import asin, atan, cos, pi, sin, sqrt
from typing import Any

import numpy as np

from .drives import period_of, turned_by
from .effects import Effect, Terms
from .quantities import ACCELERATION, MOST_RADIANS, NUMBER, RATE, quantity


@dataclass(frozen=True)
class SquareDrive(Effect):
    """Pivot accelerated by a square wave: y'' = -`acceleration` sign cos(w t + phase), positive up.

    Sharp (`smoothing` 0), the cosine is a switching function.  Smooth, sign c is c sqrt((1 + e^2)/(c^2 + e^2)) with e =
    `smoothing`, of the same peak.  The phase is that of :class:`VerticalDrive`: at phase 0 the pivot is at its highest
    at t = 0.  Its displacement has zero mean.

    Parameters
    ----------
    acceleration : float
        Peak acceleration (m/s^2), at least 0.
    frequency : float
        Frequency (Hz), above 0.
    phase : float, optional
        Phase (rad).
    smoothing : float, optional
        Half-width e of the edges in terms of the cosine, at least 0.  The right-hand side has it only if above 0.

    Examples
    --------
    >>> SquareDrive(acceleration=300.0, frequency=50.0).parameters
    {'acceleration': 300.0, 'frequency': 50.0, 'phase': 0.0}
    """

    acceleration: float = quantity(ACCELERATION, at_least=0.0)
    frequency: float = quantity(RATE, above=0.0)
    phase: float = quantity(NUMBER, default=0.0, at_least=-MOST_RADIANS, at_most=MOST_RADIANS)
    smoothing: float = quantity(NUMBER, default=0.0, at_least=0.0)

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters by name; those of a sharp wave have no smoothing."""
        return {n: v for n, v in super().parameters.items() if n != "smoothing" or v}

    @property
    def terms(self) -> Terms:
        """Acceleration of the pivot."""
        if self.smoothing:
            return Terms(vertical=_smooth_square, place=_smooth_square_height, period=period_of)
        return Terms(vertical=_square, place=_square_height, period=period_of, clocks=(_cosine,))

    @property
    def vanishes(self) -> bool:
        """Whether the pivot is fixed."""
        return self.acceleration == 0.0


def _cosine(t: float, p: Any) -> float:
    return cos(turned_by(t, p))


def _square(t: float, p: Any, sign: float) -> float:
    return -p.acceleration * sign


def _smooth_square(t: float, p: Any) -> float:
    c, e = cos(turned_by(t, p)), p.smoothing
    return -p.acceleration * (c * sqrt((1.0 + e * e) / (c * c + e * e)))


def _square_height(t: float, p: Any) -> tuple[float, float]:
    """Parabolas: with the triangle wave u of the phase, (pi^2/8) u (2 - abs(u)) has the second derivative -sign(u)."""
    w, u = 2.0 * pi * p.frequency, _triangle_of(cos(turned_by(t, p)))
    return 0.0, p.acceleration / (w * w) * (pi**2 / 8.0) * u * (2.0 - abs(u))


def _smooth_square_height(t: float, p: Any) -> tuple[float, float]:
    return 0.0, _height_of_wave(p, _square_harmonics(p.smoothing), turned_by(t, p))


@dataclass(frozen=True)
class TriangleDrive(SquareDrive):
    """Pivot accelerated by a triangle wave: y'' = -`acceleration` (2/pi) asin cos(w t + phase), positive up.

    Sharp (`smoothing` 0), the sine of the phase is a switching function, as the wave has a kink at its zeros.  Smooth,
    the wave is atan(c / sqrt(s^2 + e^2)) / atan(1/e) with cosine c, sine s and e = `smoothing`, of the same peak.  The
    phase is that of :class:`VerticalDrive`.  Its displacement has zero mean.

    Parameters
    ----------
    acceleration : float
        Peak acceleration (m/s^2), at least 0.
    frequency : float
        Frequency (Hz), above 0.
    phase : float, optional
        Phase (rad).
    smoothing : float, optional
        Half-width e of the tips in terms of the sine, at least 0.  The right-hand side has it only if above 0.

    Examples
    --------
    >>> len(TriangleDrive(acceleration=300.0, frequency=50.0).terms.clocks)
    1
    """

    @property
    def terms(self) -> Terms:
        """Acceleration of the pivot."""
        if self.smoothing:
            return Terms(vertical=_smooth_triangle, place=_smooth_triangle_height, period=period_of)
        return Terms(vertical=_triangle, place=_triangle_height, period=period_of, clocks=(_sine,))


def _sine(t: float, p: Any) -> float:
    return sin(turned_by(t, p))


def _triangle(t: float, p: Any, sign: float) -> float:
    """Half the angle from the middle of a slope is an arc tangent that goes on smoothly beyond both tips."""
    turned = turned_by(t, p)
    return -p.acceleration * ((4.0 / pi) * atan(cos(turned) / (1.0 + sign * sin(turned))))


def _smooth_triangle(t: float, p: Any) -> float:
    c, s, e = cos(turned_by(t, p)), sin(turned_by(t, p)), p.smoothing
    return -p.acceleration * (atan(c / sqrt(s * s + e * e)) / atan(1.0 / e))


def _triangle_of(c: float) -> float:
    return (2.0 / pi) * asin(c)


def _triangle_height(t: float, p: Any) -> tuple[float, float]:
    """Cubics: with the angle u from the upper tip, pi^2/12 - u^2/2 + u^3/(3 pi) has the second derivative 2u/pi - 1."""
    w, u = 2.0 * pi * p.frequency, (pi / 2.0) * (1.0 - _triangle_of(cos(turned_by(t, p))))
    return 0.0, p.acceleration / (w * w) * (pi**2 / 12.0 - u * u / 2.0 + u * u * u / (3.0 * pi))


def _smooth_triangle_height(t: float, p: Any) -> tuple[float, float]:
    return 0.0, _height_of_wave(p, _triangle_harmonics(p.smoothing), turned_by(t, p))


def _height_of_wave(p: Any, harmonics: tuple[float, ...], turned: float) -> float:
    """Integrate a wave of cosines of odd multiples of the phase twice, term by term."""
    w = 2.0 * pi * p.frequency
    height = 0.0
    for j, a in enumerate(harmonics):
        k = 2 * j + 1
        height = height + a / (k * k) * cos(k * turned)
    return p.acceleration / (w * w) * height


_WAVE_NODES = 1024
"""Nodes a period of a smooth wave; a quarter as many harmonics are kept, 1e-5 of the displacement for sharp edges."""


@functools.lru_cache(maxsize=64)
def _square_harmonics(e: float) -> tuple[float, ...]:
    c = np.cos(2.0 * pi * np.arange(_WAVE_NODES) / _WAVE_NODES)
    return _odd_harmonics(c * np.sqrt((1.0 + e * e) / (c * c + e * e)))


@functools.lru_cache(maxsize=64)
def _triangle_harmonics(e: float) -> tuple[float, ...]:
    turned = 2.0 * pi * np.arange(_WAVE_NODES) / _WAVE_NODES
    return _odd_harmonics(np.arctan(np.cos(turned) / np.sqrt(np.sin(turned) ** 2 + e * e)) / np.arctan(1.0 / e))


def _odd_harmonics(wave: Any) -> tuple[float, ...]:
    values: list[float] = (2.0 * np.fft.rfft(wave).real[1 : _WAVE_NODES // 2 : 2] / _WAVE_NODES).tolist()
    return tuple(values)
