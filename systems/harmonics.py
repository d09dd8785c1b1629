"""Drives of several harmonics, and of a measured acceleration."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi
from typing import Any

import numpy as np

from cellmap.utils import check_length, finite_number, whole_number

from .drives import period_of
from .effects import Effect, FieldTerm, Terms
from .forces import total
from .quantities import LENGTH, MOST_RADIANS, NUMBER, RATE, is_iterable, quantity, sized_number


@dataclass(frozen=True)
class HarmonicDrive(Effect):
    """Pivot at the height sum_k A_k cos(k w t + phase_k), k = 1, 2, ..., positive up, with w = 2 pi `frequency`.

    The right-hand side depends on the number of harmonics alone.  The parameters are amplitude_1, ..., phase_1, ...

    Parameters
    ----------
    amplitudes : sequence of float
        Amplitudes A_k of the pivot's height (m), at least 0 each.
    phases : sequence of float
        Phases (rad), as many.
    frequency : float
        Frequency of the first harmonic (Hz), above 0.

    Raises
    ------
    TypeError, ValueError
        For numbers that are not finite or out of bounds, and for different numbers of phases and amplitudes.

    Examples
    --------
    >>> HarmonicDrive(amplitudes=(0.003, 0.001), phases=(0.0, 1.5), frequency=50.0).parameters["phase_2"]
    1.5
    """

    amplitudes: Sequence[float] = quantity(LENGTH, each="amplitude", at_least=0.0)
    phases: Sequence[float] = quantity(NUMBER, each="phase", at_least=-MOST_RADIANS, at_most=MOST_RADIANS)
    frequency: float = quantity(RATE, above=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.amplitudes) != len(self.phases):
            raise ValueError(f"phases={self.phases!r}: give one for each of the {len(self.amplitudes)} amplitudes")

    @property
    def terms(self) -> Terms:
        """Acceleration of the pivot."""
        return _harmonic_terms(len(self.amplitudes))

    @property
    def vanishes(self) -> bool:
        """Whether the pivot is fixed."""
        return not any(self.amplitudes)


@functools.cache
def _harmonic_terms(count: int) -> Terms:
    harmonics = range(1, count + 1)
    height = total([_harmonic_height(k) for k in harmonics])

    def place(t: float, p: Any) -> tuple[float, float]:
        return 0.0, height(t, p)

    return Terms(vertical=total([_harmonic(k) for k in harmonics]), place=place, period=period_of)


def _harmonic(k: int) -> FieldTerm:
    amplitude, phase = f"amplitude_{k}", f"phase_{k}"

    def harmonic(t: float, p: Any) -> float:
        w = 2.0 * pi * k * p.frequency
        return -(getattr(p, amplitude) * w * w) * cos(w * t + getattr(p, phase))

    return harmonic


def _harmonic_height(k: int) -> FieldTerm:
    amplitude, phase = f"amplitude_{k}", f"phase_{k}"

    def height(t: float, p: Any) -> float:
        return getattr(p, amplitude) * cos(2.0 * pi * k * p.frequency * t + getattr(p, phase))

    return height


def sampled_drive(samples: Sequence[float], frequency: float, harmonics: int | None = None) -> HarmonicDrive:
    """Return the drive whose pivot has a measured acceleration.

    The samples are interpolated by trigonometric functions; of N samples all N // 2 harmonics are kept, so that the
    acceleration passes through every sample, less their mean, which vanishes for a pivot in periodic motion.

    Parameters
    ----------
    samples : sequence of float
        Upward acceleration of the pivot (m/s^2) at the times j / (N `frequency`), j = 0, ..., N - 1; at least 3.
    frequency : float
        Frequency (Hz), above 0: one over the time that the samples span.
    harmonics : int, optional
        Number of harmonics to keep, from the first on, at most N // 2: fewer suppress the noise of an accelerometer.

    Returns
    -------
    HarmonicDrive
        Drive with the harmonics of the pivot's height as parameters.  Changing its frequency keeps the height.

    Raises
    ------
    TypeError, ValueError
        For numbers that are not finite or out of bounds, and for fewer than 3 samples.

    References
    ----------
    Trefethen, *Spectral Methods in MATLAB* (2000), chapter 3.

    Examples
    --------
    >>> drive = sampled_drive([-1.0, 0.0, 1.0, 0.0], frequency=1.0)
    >>> [round((2 * pi) ** 2 * a, 12) for a in drive.amplitudes], abs(round(drive.phases[0], 12))
    ([1.0, 0.0], 0.0)
    """
    if not is_iterable(samples):
        raise TypeError(f"samples={samples!r}: give a sequence of numbers")
    check_length("samples", samples)
    values = [finite_number(f"samples[{j}]", v) for j, v in enumerate(samples)]
    count = len(values)
    if count < 3:
        raise ValueError(f"samples={values!r}: give at least 3 numbers")
    kept = count // 2 if harmonics is None else whole_number("harmonics", harmonics, 1, count // 2)
    ladder = np.arange(1, kept + 1)
    factors = -np.fft.rfft(values)[1 : kept + 1] * np.where(2 * ladder == count, 1.0, 2.0) / count
    rate = 2.0 * pi * sized_number("frequency", frequency, above=0.0)
    return HarmonicDrive(
        tuple((np.abs(factors) / (ladder * rate) ** 2).tolist()), tuple(np.angle(factors).tolist()), frequency
    )
