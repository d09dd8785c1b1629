"""The drive of a pivot, from the record of an accelerometer on it."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from cellmap.utils import finite_number, one_of, whole_number

from ...drives import VerticalDrive
from ...harmonics import HarmonicDrive
from ..arrays import Floats
from ..time_series import measured_series, real_numbers, undetermined
from .drive_search import FEWEST_PERIODS, MOST_SATURATED, beyond_limits, crowded, dead_times, find_drive, saturated
from .harmonic_fit import Fit, Record, resolution_of

_SHOWN = 4  # harmonics in the text of a drive
_PHASES = 4096  # of a period, at which the extremes of the acceleration are looked for
_FEWEST_SAMPLES = 10


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
        faint = f", undetermined harmonics {', '.join(map(str, self.undetermined))}" if self.undetermined else ""
        return (
            f"RecoveredDrive({self.frequency:.7g} +- {self.frequency_error:.2g} Hz; {heights} mm{more}; "
            f"{self.samples} samples{lost}{faint})"
        )

    @property
    def undetermined(self) -> tuple[int, ...]:
        """Harmonics, from 1 on, whose amplitudes are below their standard errors, as of those that a wave lacks."""
        columns = ({str(k): float(v) for k, v in enumerate(c, 1)} for c in (self.amplitudes, self.amplitude_errors))
        return tuple(map(int, undetermined(*columns)))

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
        angles = real_numbers("times", times)[..., None] * rates + self.phases
        return -(np.cos(angles) @ (self.amplitudes * rates**2))

    def reading(self, times: ArrayLike) -> Floats:
        """Return what the sensor would read at times (s) without noise: acceleration, offset and drift (m/s^2)."""
        return self.acceleration(times) + self.mean + self.drift * (real_numbers("times", times) - self.middle)

    def _extremes(self) -> tuple[Floats, Floats]:
        """Return the phases of the lowest and the highest acceleration (rad), and the two values."""
        turned = 2.0 * pi * np.arange(_PHASES) / _PHASES
        values = self.acceleration(turned / (2.0 * pi * self.frequency))
        tops = np.array([np.argmin(values), np.argmax(values)])
        before, here, after = values[tops - 1], values[tops], values[(tops + 1) % _PHASES]
        bend = before - 2.0 * here + after
        shifts = np.divide(0.5 * (before - after), bend, out=np.zeros(2), where=bend != 0.0)
        return turned[tops] + shifts * 2.0 * pi / _PHASES, here - 0.25 * (before - after) * shifts


def recover_drive(
    times: ArrayLike,
    acceleration: ArrayLike,
    frequency: float | None = None,
    harmonics: int | None = None,
    drift: bool = True,
    limits: tuple[float, float] | None = None,
    noise: str = "coloured",
) -> RecoveredDrive:
    """Return the drive of a pivot from a record of its acceleration.

    The frequency is sought in the periodogram and then fitted together with amplitudes, phases, offset and drift by
    least squares.  Where the strongest line is a harmonic of a weaker one, with 3 % of its acceleration and more,
    that one is taken for the fundamental; in slow noise of the sensor this may be a mistake where the record has fewer
    than about six periods, for which give `frequency`.  The number of harmonics is the one with the least Bayesian
    information criterion, among all up to the limit of Nyquist, at most 50: it is consistent, whereas Akaike's would
    keep a harmonic of nothing but noise in every seventh record.

    Standard errors take the noise to be stationary and to have, at each harmonic, the density of the periodogram of the
    residuals about it, over 40 independent ordinates or up to the next harmonic.  So they hold for coloured noise too,
    and are widened for lines of other frequencies, such as hum.  Of three periods of coloured noise 1.96 of them cover
    87 %, of ten and more 94 to 98 %.  What is not in the record no fit can tell: at even times a drive beyond the limit
    of Nyquist is taken for one below it, and a wave's harmonics beyond it disturb those below.

    A sensor that is dead for a while repeats one reading: eight and more equal samples in a row, less often than in
    every second period, that the fit of the others misses by far, are missing samples.

    Parameters
    ----------
    times : array_like, shape (n,)
        Increasing times (s), at any distances.
    acceleration : array_like, shape (n,)
        Upward acceleration (m/s^2), with any offset; of volts make it by
        :func:`systems.lab.shaker.voltage_conversion.acceleration_from_volts`.  NaN is a lost sample.  In units of g all
        amplitudes come out 9.8 times too small: the `mean` of a sensor that feels gravity, 1 and not 9.8, tells.
    frequency : float, optional
        Frequency of the drive (Hz) where it is known, by the generator say: the nearest line within 2 %, or one period
        more or less in the record, is fitted, or the strongest line near its harmonics where there is none.  A record
        of hum and drive needs it, or a drive without fundamental.  Hum nearer to the drive than about a period in the
        record cannot be distinguished: `autocorrelation` far from 0 is the sign of it.
    harmonics : int, optional
        Number of harmonics, from the first on; by default chosen by the criterion.
    drift : bool, optional
        Fit a slope of the offset.
    limits : tuple of float, optional
        Readings (m/s^2) at and beyond which the sensor is saturated; these samples are left out.  By default three and
        more equal samples at an extreme count as saturation if the fit of the others passes beyond them, and so do
        samples that crowd there as narrowly as the noise, where it comes in after the saturation.  Minus and plus
        infinity switch it off.
    noise : {"coloured", "white"}, optional
        What errors are worked out from: the noise next to each harmonic, or the mean one.

    Returns
    -------
    RecoveredDrive
        Frequency, amplitudes and phases with errors, and what is left over.

    Raises
    ------
    TypeError, ValueError
        For times that do not increase, too few samples, a constant record, a record of less than two periods, most of
        the samples saturated, a frequency or harmonics beyond the limit of Nyquist, and where no line stands out of the
        noise (chance above 0.001).

    References
    ----------
    Lomb, Astrophysics and Space Science 39 (1976) 447 (uneven times); Golub, Pereyra, Inverse Problems 19 (2003) R1
    (variable projection); Schwarz, Annals of Statistics 6 (1978) 461 (information criterion); Rife, Boorstyn, IEEE
    Transactions on Information Theory 20 (1974) 591 (errors of frequency and phase).

    Examples
    --------
    >>> from systems import VerticalDrive
    >>> from systems.lab import record_acceleration
    >>> times = np.linspace(0.0, 1.0, 2000, endpoint=False)
    >>> record = record_acceleration(VerticalDrive(0.003, 50.0, 0.5), times, noise=3.0, offset=9.8, rng=1)
    >>> recover_drive(times, record)
    RecoveredDrive(49.99969 +- 0.00019 Hz; 3 +- 0.001 mm; 2000 samples)
    """
    t, given = measured_series(times, acceleration, "acceleration", _FEWEST_SAMPLES)
    here = np.isfinite(given)
    readings, kept = given[here], t[here]
    middle, shift, scale = 0.5 * (kept[0] + kept[-1]), float(readings.mean()), float(readings.std())
    one_of("noise", noise, ("coloured", "white"))
    whole = Record(kept - middle, (readings - shift) / scale, bool(drift), resolution_of(readings) / scale)
    _check_request(whole, frequency, harmonics)
    bad = saturated(readings, _checked(limits))
    if bad.mean() > (0.5 if limits is None else MOST_SATURATED):
        raise ValueError(
            f"acceleration: {100.0 * bad.mean():.0f} % of the samples stand at the extremes: the sensor is saturated; "
            "widen its range, give its limits to fit the rest, or limits=(-inf, inf) if the wave is square"
        )
    if limits is None and not bad.any():
        bad = crowded(readings)
    found = find_drive(whole, frequency, harmonics)
    dead = dead_times(whole, frequency, harmonics, found[0].rate)
    if dead.any():
        whole, bad = whole.without(dead), bad[~dead]
        found = find_drive(whole, frequency, harmonics)
    for again in range(4 if bad.any() else 0):
        # Cut off, a wave keeps its frequency; of the rest alone the gaps would make lines.
        found = find_drive(whole.without(bad), frequency, harmonics, found[0].rate / (2.0 * pi))
        if limits is not None or again == 3 or not bad.any():
            break
        bad = beyond_limits(whole, found[0], bad)
    fit, around, ordinates = found
    if noise == "white":
        factors, degrees = np.ones_like(around), max(1, len(fit.residuals) - len(fit.gram))
    else:
        factors, degrees = around / max(fit.variance, 1e-300), 2 * ordinates
    # The noise is itself an estimate: Student's factor makes 1.96 standard errors cover 95 % all the same.
    factors = factors * float(stats.t.ppf(0.975, degrees) / stats.norm.ppf(0.975)) ** 2
    counts = int((~here).sum() + dead.sum()), int(bad.sum())
    return _described(whole.without(bad), fit, factors, middle, shift, scale, counts)


def _check_request(record: Record, frequency: float | None, harmonics: int | None) -> None:
    if frequency is not None:
        given = finite_number("frequency", frequency, above=0.0)
        if given >= record.nyquist:
            raise ValueError(
                f"frequency={frequency!r}: samples {record.spacing:.4g} s apart show frequencies below the limit of "
                f"Nyquist, {record.nyquist:.5g} Hz; sample faster"
            )
        if given * record.span < FEWEST_PERIODS:
            raise ValueError(
                f"frequency={frequency!r}: the record of {record.span:.4g} s spans {given * record.span:.2g} periods; "
                "give at least two"
            )
    if harmonics is not None:
        whole_number("harmonics", harmonics, at_least=1)
        lowest = frequency if frequency is not None else FEWEST_PERIODS / record.span
        most = record.most_harmonics(lowest)
        if harmonics > most:
            raise ValueError(f"harmonics={harmonics}: give at most {most}, all below the limit of Nyquist")


def _checked(limits: tuple[float, float] | None) -> tuple[float, float] | None:
    if limits is None:
        return None
    try:
        low, high = (float(v) for v in limits)
    except (TypeError, ValueError):
        raise TypeError(f"limits={limits!r}: give two numbers (m/s^2)") from None
    if not low < high:
        raise ValueError(f"limits={limits!r}: give the lower one first")
    return low, high


def _described(
    record: Record, fit: Fit, factors: Floats, middle: float, shift: float, scale: float, lost: tuple[int, int]
) -> RecoveredDrive:
    trends, half, rate = record.trends, 0.5 * record.span, fit.rate
    count = len(fit.gains)
    order = np.arange(1, count + 1)
    terms = trends + 2 * np.arange(count)
    waves = scale * (fit.coefficients[terms] - 1j * fit.coefficients[terms + 1])
    weights = (order * np.abs(waves)) ** 2
    # What a harmonic tells about the frequency suffers from the noise at that harmonic.
    fractions = np.concatenate(
        [np.full(trends, factors[0]), np.repeat(factors[1:], 2), [weights @ factors[1:] / weights.sum()]]
    )
    inverse, root = np.linalg.inv(fit.gram), np.sqrt(fractions)
    covariance = fit.variance * inverse @ (fit.gram * np.outer(root, root)) @ inverse
    heights = np.abs(waves) / (order * rate) ** 2
    phases = np.angle(-waves) - order * rate * middle
    # Real parts of a relative change are those of the amplitude, imaginary parts change the phase.
    changes = np.zeros((count, len(covariance)), complex)
    changes[order - 1, terms], changes[order - 1, terms + 1] = scale / waves, -1j * scale / waves
    changes[:, -1] = -2.0 / (rate * half) - 1j * order * middle / half
    first = np.eye(len(covariance))[-1:] / (half * 2.0 * pi)
    slopes = np.concatenate([first, heights[:, None] * changes.real, changes.imag])
    told = slopes @ covariance @ slopes.T
    errors = np.sqrt(told.diagonal())
    return RecoveredDrive(
        frequency=float(rate / (2.0 * pi)),
        frequency_error=float(errors[0]),
        amplitudes=heights,
        amplitude_errors=errors[1 : 1 + count],
        phases=-np.remainder(-phases + pi, 2.0 * pi) + pi,
        phase_errors=errors[1 + count :],
        covariance=told,
        mean=shift + scale * float(fit.coefficients[0]),
        mean_error=scale * sqrt(covariance[0, 0]),
        drift=scale * float(fit.coefficients[1]) / half if record.drift else 0.0,
        drift_error=scale * sqrt(covariance[1, 1]) / half if record.drift else 0.0,
        noise=scale * sqrt(fit.variance),
        noise_factors=factors[1:],
        autocorrelation=_neighbours(record, fit.residuals),
        middle=middle,
        span=record.span,
        samples=len(record.times),
        missing=lost[0],
        clipped=lost[1],
    )


def _neighbours(record: Record, residuals: Floats) -> float:
    """Correlation of the residuals of samples with no gap between them."""
    near = np.diff(record.times) < 1.5 * record.spacing
    square = float(residuals @ residuals) / len(residuals)
    return float((residuals[:-1] * residuals[1:])[near].mean() / square) if near.any() and square > 0.0 else 0.0
