"""Sinusoids of one unknown frequency and its multiples, fitted to samples at any times, with the noise about them.

The model is an offset, a slope if asked for, and a_k cos(k w t) + b_k sin(k w t) for k = 1, ..., K, with t from the
middle of the record, where offset, frequency and phases are almost independent.  It is linear but for w, so each step
of Gauss and Newton is a linear problem with one term more (variable projection; Golub and Pereyra 2003).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import exp, log, pi

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft, linalg

from ..arrays import Floats

ORDINATES = 40  # of the periodogram, from which the noise at one frequency is estimated
_CHUNK = 8192  # samples whose terms fit into the cache
_ALIKE = 1e-3  # fraction of a term that those before it do not explain
_ROUNDS = 25
_LARGEST_GRID = 2**25


@dataclass(frozen=True, eq=False)
class Record:
    """Samples of the acceleration.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Increasing times from the middle of the record (s).
    values : ndarray, shape (n,)
        Values, scaled to a standard deviation of 1.
    drift : bool
        Whether the model has a slope.
    resolution : float
        Step of the converter, if the values have one.
    """

    times: Floats
    values: Floats
    drift: bool
    resolution: float = 0.0

    def __repr__(self) -> str:
        return f"Record({len(self.times)} samples over {self.span:g} s)"

    @property
    def span(self) -> float:
        """Time from the first to the last sample, and one spacing more (s)."""
        return float(self.times[-1] - self.times[0]) * len(self.times) / (len(self.times) - 1)

    @property
    def spacing(self) -> float:
        """Typical time between two samples (s)."""
        return float(np.median(np.diff(self.times)))

    @property
    def nyquist(self) -> float:
        """Half of the typical sampling rate (Hz)."""
        return 0.5 / self.spacing

    @property
    def trends(self) -> int:
        """Number of terms beside the sinusoids."""
        return 2 if self.drift else 1

    def most_harmonics(self, frequency: float) -> int:
        """Return how many harmonics are below the limit of Nyquist, and can be distinguished with these samples."""
        below = int((self.nyquist - 0.5 / self.span) / frequency)
        return max(0, min(below, (len(self.times) - 6) // 4))


@dataclass(frozen=True, eq=False)
class Fit:
    """A least-squares fit.

    Parameters
    ----------
    rate : float
        Angular frequency w (rad/s).
    coefficients : ndarray, shape (p,)
        Offset, slope over half of the record if there is one, then a_1, b_1, a_2, b_2, ...
    residuals : ndarray, shape (n,)
        Values less the model.
    gram : ndarray, shape (p + 1, p + 1)
        Sums of products of the terms, the last one of which is that of w times half of the record (rad).
    gains : ndarray, shape (K,)
        By how much each harmonic, added after those before it, lowers the sum of squares.
    """

    rate: float
    coefficients: Floats
    residuals: Floats
    gram: Floats
    gains: Floats

    def __repr__(self) -> str:
        return f"Fit({self.rate / (2.0 * pi):g} Hz, {len(self.gains)} harmonics)"

    @property
    def variance(self) -> float:
        """Variance of the noise, from the residuals."""
        return float(self.residuals @ self.residuals) / max(len(self.residuals) - len(self.gram), 1)


def solved(record: Record, rate: float, harmonics: int) -> Fit:
    """Fit the linear part at a given rate."""
    return _fit(record, rate, harmonics)[0]


def refined(record: Record, rate: float, harmonics: int) -> Fit:
    """Fit the frequency as well, from a guess whose phase errs by at most a quarter of a period over the record."""
    half, began, last = 0.5 * record.span, rate, np.inf
    for _ in range(_ROUNDS):
        fit, step = _fit(record, rate, harmonics)
        change = float(np.clip(step, -0.5, 0.5)) / half
        if abs(rate + change - began) > 2.0 * pi / half:
            break
        rounded = max(1e-12, 4e-15 * rate * half)
        if abs(step) <= max(rounded, 1e-6 * _rate_error(fit)) or 0.5 * last < abs(step) < 1e6 * rounded:
            return fit
        last = abs(step)
        rate += change
    raise np.linalg.LinAlgError("the frequency does not settle")


def _rate_error(fit: Fit) -> float:
    inverse = np.linalg.inv(fit.gram)
    return float(np.sqrt(max(fit.variance * inverse[-1, -1], 0.0)))


def model(record: Record, rate: float, coefficients: Floats) -> Floats:
    """Return the model at the times of a record."""
    harmonics = (len(coefficients) - record.trends) // 2
    return np.concatenate([coefficients @ rows for _, rows in _rows(record, rate, harmonics)])


def _rows(record: Record, rate: float, harmonics: int) -> Iterator[tuple[slice, Floats]]:
    """Yield the terms of the linear part as rows, some samples at a time."""
    half = 0.5 * record.span
    for first in range(0, len(record.times), _CHUNK):
        part = slice(first, first + _CHUNK)
        t = record.times[part]
        rows = np.empty((record.trends + 2 * harmonics, len(t)))
        rows[0] = 1.0
        if record.drift:
            rows[1] = t / half
        once = np.exp(1j * rate * t) if harmonics else np.empty(0)
        power = once.copy()
        for k in range(record.trends, len(rows), 2):
            rows[k], rows[k + 1] = power.real, power.imag
            power *= once
        yield part, rows


def _fit(record: Record, rate: float, harmonics: int) -> tuple[Fit, float]:
    """Solve the linear part, and return the step of Gauss and Newton for the rate times half of the record."""
    size, first = record.trends + 2 * harmonics, record.trends
    gram, sums = np.zeros((size + 1, size + 1)), np.zeros(size)
    for part, rows in _rows(record, rate, harmonics):
        gram[:size, :size] += rows @ rows.T
        sums += rows @ record.values[part]
    scale = np.sqrt(np.maximum(gram.diagonal()[:size], 1e-300))
    triangle = linalg.cholesky(gram[:size, :size] / np.outer(scale, scale), lower=True)
    if triangle.diagonal().min() < _ALIKE:
        raise np.linalg.LinAlgError("terms are alike")
    parts = linalg.solve_triangular(triangle, sums / scale, lower=True)
    coefficients = linalg.solve_triangular(triangle, parts, lower=True, trans="T") / scale
    order, half = np.arange(1, harmonics + 1), 0.5 * record.span
    turned = np.zeros(size)
    turned[first::2], turned[first + 1 :: 2] = order * coefficients[first + 1 :: 2], -order * coefficients[first::2]
    residuals, along, square = np.empty_like(record.values), np.zeros(size + 1), 0.0
    for part, rows in _rows(record, rate, harmonics):
        residuals[part] = record.values[part] - coefficients @ rows
        slope = (record.times[part] / half) * (turned @ rows)
        gram[:size, size] += rows @ slope
        square += float(slope @ slope)
        along[:size] += rows @ residuals[part]
        along[size] += float(slope @ residuals[part])
    gram[size, :size], gram[size, size] = gram[:size, size], square
    step = linalg.lstsq(gram, along)[0][-1] if harmonics else 0.0
    gains = (parts[first:] ** 2).reshape(-1, 2).sum(axis=1)
    return Fit(rate, coefficients, residuals, gram, gains), float(step)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Periodogram: for white noise each `power` is the variance on average; at multiples of `step` (Hz)."""

    step: float
    power: Floats

    def __repr__(self) -> str:
        return f"Spectrum({len(self.power)} places, {self.step:g} Hz apart)"

    def at(self, frequencies: ArrayLike) -> Floats:
        """Return the power at the nearest places."""
        places = np.rint(np.asarray(frequencies) / self.step).astype(int)
        return self.power[np.clip(places, 0, len(self.power) - 1)]


def periodogram(record: Record, values: Floats) -> Spectrum:
    """Return the periodogram of values at the times of a record, up to the limit of Nyquist.

    Samples at uneven times are divided between the nearest two nodes of a grid twice as fine, and the loss at high
    frequencies is corrected for.
    """
    places = (record.times - record.times[0]) / record.spacing
    index = np.rint(places)
    index_end = max(index[-1], 1.0)
    even = bool(np.abs(places * (index_end / places[-1]) - index).max() < 0.02)
    count, spacing = int(index_end) + 1, (record.times[-1] - record.times[0]) / index_end
    if not even:
        count, spacing = 2 * count, 0.5 * spacing
    pad = 8 if count <= 2**17 else 2
    if count * pad > _LARGEST_GRID:
        raise ValueError(
            f"times: {len(record.times)} samples on a grid of {count} places are too few: take a part without long gaps"
        )
    length = fft.next_fast_len(count * pad, real=True)
    if even:
        row = np.bincount(index.astype(int), weights=values, minlength=count)
    else:
        places = (record.times - record.times[0]) / spacing
        below = places.astype(int)
        fraction = places - below
        row = np.bincount(below, weights=values * (1.0 - fraction), minlength=count + 1)
        row += np.bincount(below + 1, weights=values * fraction, minlength=count + 1)[: len(row)]
    power = np.abs(fft.rfft(row, length)) ** 2 / len(values)
    step = 1.0 / (length * spacing)
    power = power[: int(record.nyquist / step) + 1]
    if not even:
        power /= np.sinc(np.arange(len(power)) * step * spacing) ** 4
    return Spectrum(step, power)


def resolution_of(values: Floats) -> float:
    """Return the step of which all differences of values are multiples; 0 where there is none."""
    gaps = np.diff(np.unique(values))
    gaps = gaps[gaps > 1e-9 * np.ptp(values)]
    if 2 * len(gaps) > len(values) or not len(gaps):
        return 0.0
    step = float(gaps.min())
    return step if np.abs(gaps / step - np.rint(gaps / step)).max() < 1e-3 else 0.0


def noise_about(record: Record, fit: Fit, spectrum: Spectrum, most: int) -> tuple[Floats, int]:
    """Return the noise at the multiples 0 to `most` of the frequency of a fit, from the periodogram of its residuals.

    It is the mean of the ordinates about each multiple, but those that the harmonics take up: one over the record
    apart, where they tell of independent noise, and halfway between, where they tell of lines elsewhere.  They reach no
    further than the next multiple, for coloured noise changes by the octave.  Returned as well is how many are
    independent.  The error of a coarse converter, if no noise dithers it, is the same in every period, and so stands on
    the multiples themselves (Widrow, Kollar 2008): it is added at its largest.
    """
    frequency = fit.rate / (2.0 * pi)
    periods = frequency * record.span
    between = max(2, round(periods))
    number = np.arange(2, max(6, int(2.0 * record.nyquist / frequency * between)))
    number = number[np.abs((number + between) % (2 * between) - between) >= 2]
    powers = spectrum.at(number * (0.5 * frequency / between))
    count = min(2 * ORDINATES, len(number), max(8, 4 * between - 6))
    first = np.searchsorted(number, 2 * between * np.arange(most + 1)) - count // 2
    first = np.clip(first, 0, len(number) - count)
    running = np.concatenate([[0.0], np.cumsum(powers)])
    noise = (running[first + count] - running[first]) / count
    coarse = record.resolution**2 / 12.0
    if coarse:
        spread = max(fit.variance - coarse, 0.0) / record.resolution**2
        noise = np.maximum(noise, coarse * (1.0 + periods * exp(-4.0 * pi**2 * spread)))
    # Rounding, in units of the standard deviation of the record, is noise as well.
    return np.maximum(noise, 1e-22), max(2, count // 2)


def harmonics_by_information(gains: Floats, noise: Floats, samples: int) -> int:
    """Return the number of harmonics by the Bayesian information criterion (Schwarz 1978).

    Each harmonic costs 2 log(samples) and brings its gain in units of the noise at its frequency.
    """
    return int(np.argmax(np.cumsum(gains / noise - 2.0 * log(samples)))) + 1
