"""Sinusoids of one unknown frequency and its multiples, fitted to samples at any times, with the noise about them.

The model is an offset, a slope if asked for, and a_k cos(k w t) + b_k sin(k w t) for k = 1, ..., K, with t from the
middle of the record, where offset, frequency and phases are almost independent.  It is linear but for w, so each step
of Gauss and Newton is a linear problem with one term more (variable projection; Golub and Pereyra 2003).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import exp, log, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft, linalg, signal

from ..arrays import Bools, Floats

ORDINATES = 40  # of the periodogram, from which the noise at one frequency is estimated
_CHUNK = 8192  # samples whose terms fit into the cache
_ALIKE = 1e-3  # fraction of a term that those before it do not explain
_ROUNDS = 25
_LARGEST_GRID = 2**25


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
    step : float
        Step of Gauss and Newton for the rate times half of the record.
    """

    rate: float
    coefficients: Floats
    residuals: Floats
    gram: Floats
    gains: Floats
    step: float

    @property
    def variance(self) -> float:
        """Variance of the noise, from the residuals."""
        return float(self.residuals @ self.residuals) / max(len(self.residuals) - len(self.gram), 1)


class Spectrum(NamedTuple):
    """Periodogram: for white noise each `power` is the variance on average; at multiples of `step` (Hz)."""

    step: float
    power: Floats

    def at(self, frequencies: ArrayLike) -> Floats:
        """Return the power at the nearest places."""
        places = np.rint(np.asarray(frequencies) / self.step).astype(int)
        return self.power[np.clip(places, 0, len(self.power) - 1)]


def resolution_of(values: Floats) -> float:
    """Return the step of which all differences of values are multiples; 0 where there is none."""
    gaps = np.diff(np.unique(values))
    gaps = gaps[gaps > 1e-9 * np.ptp(values)]
    if 2 * len(gaps) > len(values) or not len(gaps):
        return 0.0
    step = float(gaps.min())
    return step if np.abs(gaps / step - np.rint(gaps / step)).max() < 1e-3 else 0.0


def harmonics_by_information(gains: Floats, noise: Floats, samples: int) -> int:
    """Return the number of harmonics by the Bayesian information criterion (Schwarz 1978).

    Each harmonic costs 2 log(samples) and brings its gain in units of the noise at its frequency.
    """
    return int(np.argmax(np.cumsum(gains / noise - 2.0 * log(samples)))) + 1


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

    def without(self, bad: Bools) -> Record:
        """Return the record without some samples."""
        return replace(self, times=self.times[~bad], values=self.values[~bad])

    def refined(self, rate: float, harmonics: int) -> Fit:
        """Fit the frequency as well, from a guess whose phase errs by at most a quarter of a period over the self."""
        half, began, last = 0.5 * self.span, rate, np.inf
        for _ in range(_ROUNDS):
            fit = self.solved(rate, harmonics)
            change, size = float(np.clip(fit.step, -0.5, 0.5)) / half, abs(fit.step)
            if abs(rate + change - began) > 2.0 * pi / half:
                break
            rounded = max(1e-12, 4e-15 * rate * half)
            error = np.sqrt(max(fit.variance * np.linalg.inv(fit.gram)[-1, -1], 0.0))
            if size <= max(rounded, 1e-6 * error) or 0.5 * last < size < 1e6 * rounded:
                return fit
            last, rate = size, rate + change
        raise np.linalg.LinAlgError("the frequency does not settle")

    def model(self, rate: float, coefficients: Floats) -> Floats:
        """Return the model at the times of a self."""
        harmonics = (len(coefficients) - self.trends) // 2
        return np.concatenate([coefficients @ rows for _, rows in self._rows(rate, harmonics)])

    def _rows(self, rate: float, harmonics: int) -> Iterator[tuple[slice, Floats]]:
        """Yield the terms of the linear part as rows, some samples at a time."""
        half = 0.5 * self.span
        for first in range(0, len(self.times), _CHUNK):
            part = slice(first, first + _CHUNK)
            t = self.times[part]
            rows = np.empty((self.trends + 2 * harmonics, len(t)))
            rows[0] = 1.0
            if self.drift:
                rows[1] = t / half
            once = np.exp(1j * rate * t) if harmonics else np.empty(0)
            power = once.copy()
            for k in range(self.trends, len(rows), 2):
                rows[k], rows[k + 1] = power.real, power.imag
                power *= once
            yield part, rows

    def solved(self, rate: float, harmonics: int) -> Fit:
        """Fit the linear part at a given rate."""
        size, first = self.trends + 2 * harmonics, self.trends
        gram, sums = np.zeros((size, size)), np.zeros(size)
        for part, rows in self._rows(rate, harmonics):
            gram += rows @ rows.T
            sums += rows @ self.values[part]
        scale = np.sqrt(np.maximum(gram.diagonal(), 1e-300))
        triangle = linalg.cholesky(gram / np.outer(scale, scale), lower=True)
        if triangle.diagonal().min() < _ALIKE:
            raise np.linalg.LinAlgError("terms are alike")
        parts = linalg.solve_triangular(triangle, sums / scale, lower=True)
        coefficients = linalg.solve_triangular(triangle, parts, lower=True, trans="T") / scale
        turned, order = np.zeros(size), np.arange(1, harmonics + 1)
        turned[first::2], turned[first + 1 :: 2] = order * coefficients[first + 1 :: 2], -order * coefficients[first::2]
        residuals, (last, along) = np.empty_like(self.values), np.zeros((2, size + 1))
        for part, rows in self._rows(rate, harmonics):
            residuals[part] = self.values[part] - coefficients @ rows
            slope = self.times[part] / (0.5 * self.span) * (turned @ rows)
            last += [*rows @ slope, slope @ slope]
            along += [*rows @ residuals[part], slope @ residuals[part]]
        gram = np.block([[gram, last[:-1, None]], [last]])
        step = float(linalg.lstsq(gram, along)[0][-1]) if harmonics else 0.0
        return Fit(rate, coefficients, residuals, gram, (parts[first:] ** 2).reshape(-1, 2).sum(axis=1), step)

    def periodogram(self, values: Floats) -> Spectrum:
        """Return the periodogram of values at the times of the record, up to the limit of Nyquist.

        Samples at uneven times are divided between the nearest two nodes of a grid twice as fine, and the loss at high
        frequencies is corrected for.
        """
        places = (self.times - self.times[0]) / self.spacing
        nodes = np.rint(places)
        last = max(nodes[-1], 1.0)
        even = bool(np.abs(places * (last / places[-1]) - nodes).max() < 0.02)
        fine = 1 if even else 2
        places, count = (nodes if even else places * (fine * last / places[-1])), fine * int(last) + 2
        pad = 8 if count <= 2**17 else 2
        if count * pad > _LARGEST_GRID:
            raise ValueError(
                f"times: {len(self.times)} samples on a grid of {count} places are too few: take a part without long "
                "gaps"
            )
        below = places.astype(int)
        row = np.bincount(below, values * (1.0 + below - places), count)
        row += np.bincount(below + 1, values * (places - below), count)
        rate = fine * last / (self.times[-1] - self.times[0])
        length = fft.next_fast_len(count * pad, real=True)
        frequencies, density = signal.periodogram(row, rate, nfft=length, detrend=False)
        shown = frequencies <= self.nyquist
        power = density[shown] * (0.5 * rate * count / len(values))
        return Spectrum(rate / length, power if even else power / np.sinc(frequencies[shown] / rate) ** 4)

    def noise_about(self, fit: Fit, spectrum: Spectrum, most: int) -> tuple[Floats, int]:
        """Return the noise at the multiples 0 to `most` of the frequency of a fit, from its residuals' periodogram.

        It is the mean of the ordinates about each multiple, but those that the harmonics take up: one over the record
        apart, where they tell of independent noise, and halfway between, where they tell of lines elsewhere.  They
        reach no further than the next multiple, for coloured noise changes by the octave.  Returned as well is how many
        are independent.  The error of a coarse converter, if no noise dithers it, is the same in every period, and so
        stands on the multiples themselves (Widrow, Kollar 2008): it is added at its largest.
        """
        frequency = fit.rate / (2.0 * pi)
        periods = frequency * self.span
        between = max(2, round(periods))
        number = np.arange(2, max(6, int(2.0 * self.nyquist / frequency * between)))
        number = number[np.abs((number + between) % (2 * between) - between) >= 2]
        powers = spectrum.at(number * (0.5 * frequency / between))
        count = min(2 * ORDINATES, len(number), max(8, 4 * between - 6))
        first = np.searchsorted(number, 2 * between * np.arange(most + 1)) - count // 2
        first = np.clip(first, 0, len(number) - count)
        running = np.concatenate([[0.0], np.cumsum(powers)])
        noise = (running[first + count] - running[first]) / count
        coarse = self.resolution**2 / 12.0
        if coarse:
            spread = max(fit.variance - coarse, 0.0) / self.resolution**2
            noise = np.maximum(noise, coarse * (1.0 + periods * exp(-4.0 * pi**2 * spread)))
        # Rounding, in units of the standard deviation of the record, is noise as well.
        return np.maximum(noise, 1e-22), max(2, count // 2)
