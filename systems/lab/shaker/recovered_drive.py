"""A drive as it was recovered from a record, with its errors."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike

from ...drives import VerticalDrive
from ...harmonics import HarmonicDrive
from ..arrays import Floats

_SHOWN = 4  # harmonics in the text of a drive
_PHASES = 4096  # of a period, at which the extremes of the acceleration are looked for


@dataclass(frozen=True, eq=False)
class RecoveredDrive:
    """Drive found in a record: harmonics of the pivot's height y = sum_k A_k cos(k w t + phase_k), with errors.

    All errors are standard errors, to first order; an interval of 95 % is 1.96 of them to both sides.  The amplitude
    of a harmonic that is not above its error is biased upwards, as every length of a noisy vector, and its phase is
    not known.

    Parameters
    ----------
    frequency, frequency_error : float
        Frequency of the first harmonic (Hz).
    amplitudes, amplitude_errors : ndarray, shape (K,)
        Amplitudes A_k of the height (m).
    phases, phase_errors : ndarray, shape (K,)
        Phases (rad) at the time 0 of the record's clock, above -pi and up to pi.
    covariance : ndarray, shape (1 + 2 K, 1 + 2 K)
        Covariance of the frequency, then the amplitudes, then the phases.
    mean, mean_error : float
        Offset of the sensor, gravity included if it feels it, in the middle of the record (m/s^2).
    drift, drift_error : float
        Slope of the offset (m/s^3); 0 where it was not fitted.
    noise : float
        Standard deviation of the residuals (m/s^2).
    noise_factors : ndarray, shape (K,)
        Density of the noise at each harmonic to the mean one: 1 for white noise.
    autocorrelation : float
        Correlation of the residuals of neighbouring samples: 0 for white noise.
    middle : float
        Time of the middle of the record (s).
    span : float
        Length of the record (s).
    samples, missing, clipped : int
        Samples that were used, that were not numbers or of a dead time, and that the sensor cut off.
    """

    frequency: float
    frequency_error: float
    amplitudes: Floats
    amplitude_errors: Floats
    phases: Floats
    phase_errors: Floats
    covariance: Floats
    mean: float
    mean_error: float
    drift: float
    drift_error: float
    noise: float
    noise_factors: Floats
    autocorrelation: float
    middle: float
    span: float
    samples: int
    missing: int
    clipped: int

    def __repr__(self) -> str:
        shown = zip(self.amplitudes[:_SHOWN], self.amplitude_errors[:_SHOWN], strict=True)
        heights = ", ".join(f"{1e3 * a:.4g} +- {1e3 * e:.2g}" for a, e in shown)
        more = f" and {len(self.amplitudes) - _SHOWN} harmonics more" if len(self.amplitudes) > _SHOWN else ""
        lost = "".join(f", {n} {word}" for n, word in ((self.missing, "missing"), (self.clipped, "clipped")) if n)
        return (
            f"RecoveredDrive({self.frequency:.7g} +- {self.frequency_error:.2g} Hz; {heights} mm{more}; "
            f"{self.samples} samples{lost})"
        )

    @property
    def drive(self) -> VerticalDrive | HarmonicDrive:
        """The drive for a scene, whose time 0 is that of the record's clock."""
        if len(self.amplitudes) == 1:
            return VerticalDrive(float(self.amplitudes[0]), self.frequency, float(self.phases[0]))
        return HarmonicDrive(tuple(self.amplitudes.tolist()), tuple(self.phases.tolist()), self.frequency)

    @property
    def peak_to_peak(self) -> float:
        """Acceleration of the pivot from its lowest to its highest (m/s^2), of the fit: noise does not widen it."""
        return float(np.ptp(self._extremes()[1]))

    @property
    def peak_to_peak_error(self) -> float:
        """Standard error of the peak-to-peak acceleration (m/s^2)."""
        turned, values = self._extremes()
        order = np.arange(1, len(self.amplitudes) + 1)
        rates = (order * 2.0 * pi * self.frequency) ** 2
        angles = order * turned[:, None] + self.phases
        # At an extreme the place of the extreme does not matter to first order.
        by_amplitude = -rates * (np.cos(angles[1]) - np.cos(angles[0]))
        by_phase = rates * self.amplitudes * (np.sin(angles[1]) - np.sin(angles[0]))
        slope = np.concatenate([[2.0 * np.ptp(values) / self.frequency], by_amplitude, by_phase])
        return sqrt(float(slope @ self.covariance @ slope))

    def acceleration(self, times: ArrayLike) -> Floats:
        """Return the upward acceleration of the pivot (m/s^2) at times (s), without the offset of the sensor."""
        order = np.arange(1, len(self.amplitudes) + 1)
        rates = order * 2.0 * pi * self.frequency
        angles = np.asarray(times, dtype=float)[..., None] * rates + self.phases
        return -(np.cos(angles) @ (self.amplitudes * rates**2))

    def reading(self, times: ArrayLike) -> Floats:
        """Return what the sensor would read at times (s) without noise: acceleration, offset and drift (m/s^2)."""
        return self.acceleration(times) + self.mean + self.drift * (np.asarray(times, dtype=float) - self.middle)

    def _extremes(self) -> tuple[Floats, Floats]:
        """Return the phases of the lowest and the highest acceleration (rad), and the two values."""
        turned = 2.0 * pi * np.arange(_PHASES) / _PHASES
        values = self.acceleration(turned / (2.0 * pi * self.frequency))
        places, found = [], []
        for top in (int(np.argmin(values)), int(np.argmax(values))):
            before, here, after = values[top - 1], values[top], values[(top + 1) % _PHASES]
            bend = before - 2.0 * here + after
            shift = 0.5 * (before - after) / bend if bend else 0.0
            places.append(turned[top] + shift * 2.0 * pi / _PHASES)
            found.append(here - 0.25 * (before - after) * shift)
        return np.array(places), np.array(found)
