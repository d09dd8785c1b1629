"""Search for a periodic drive in a record: its frequency, how many harmonics it has, and where the sensor saturated."""

from __future__ import annotations

from collections.abc import Iterator
from math import log, sqrt
from typing import NamedTuple

import numpy as np
from scipy import stats

from ..arrays import Bools, Floats
from .harmonic_fit import Fit, Record, Spectrum, harmonics_by_information

MOST_HARMONICS = 50
FEWEST_PERIODS = 2.0
_CHANCE = 1e-3  # of a line among all frequencies where there is noise alone
_LARGEST_DIVISOR = 8  # of the strongest harmonic
_PLAUSIBLE, _FEW_PERIODS = 3, 4.0  # a divisor beyond which a fundamental needs so many periods
_FAINTEST = 16.0  # power of a fundamental below the strongest line, to the noise about it
_WEAKEST = 1e-3  # and to that line: what aliases of far harmonics, and steps of a converter, do not reach
_RESOLVED = 8.0  # periods, over which no more than 0.002 of a harmonic's power leaks to the fundamental
_PLAIN = 0.02  # power of a plain fundamental, to that of the strongest harmonic
_NEAR = 0.02  # within which the frequency is sought about a given one
_RUN = 3  # equal samples in a row at an extreme look like saturation
MOST_SATURATED = 0.9  # of the samples, where the others are fitted
_BAND = 8.0  # standard deviations of the noise below an extreme, in which a noisy plateau lies
_CROWDED = 10.0  # times as many samples there as in the next band make a plateau; of a sine there are 2.4 times as many
_NARROW = 0.1  # of the range, at most, is a band that can tell
_STUCK = 8  # equal samples in a row anywhere look like a dead time of the sensor,
_RARE = 0.5  # if they are rarer than that for each period, or else they belong to the wave,
_FAR = 4.0  # and if the fit of the others passes them, on average, at so many standard deviations of its noise
_WORK = 2e9  # products of columns that one fit may take


class Choice(NamedTuple):
    """A frequency with a number of harmonics: the fit, the noise at each harmonic, and how well it does.

    Parameters
    ----------
    fit : Fit
        Least-squares fit.
    noise : ndarray, shape (K + 1,)
        Variance of the noise as it is at the frequency 0 and at each of the K harmonics to keep.
    spectrum : Spectrum
        Periodogram of what more harmonics leave over.
    ordinates : int
        Number of independent ordinates in an estimate of the noise.
    chance : float
        Probability that noise alone has a line so strong anywhere.
    """

    fit: Fit
    noise: Floats
    spectrum: Spectrum
    ordinates: int
    chance: float

    @property
    def harmonics(self) -> int:
        """Number K of harmonics."""
        return len(self.noise) - 1


def find_drive(
    record: Record, frequency: float | None, harmonics: int | None, start: float | None = None
) -> tuple[Fit, Floats, int]:
    """Return the fit, the noise at the frequency 0 and at its harmonics, and of how many ordinates that is.

    Arguments and errors are those of :func:`~systems.lab.shaker.drive_recovery.recover_drive`.  Where a good guess is
    known, to `start` from (Hz), nothing else is tried.
    """
    least, strongest, chance = FEWEST_PERIODS / record.span, np.nan, 1.0
    flat = record.solved(1.0, 0)
    spectrum = record.periodogram(flat.residuals)
    begins = _begins(record, spectrum, frequency) if start is None else iter([(start, 1)])
    # What a straight line leaves of a straight line is rounding, and no motion.
    for place, divisor in begins if flat.variance > 1e-22 else iter([]):
        try:
            line = record.refined(2.0 * np.pi * place, 1)
            first = line.rate / (2.0 * np.pi * divisor)
            if not (least <= first and first * divisor < record.nyquist):
                continue
            choice = chosen(record, line.rate / divisor, harmonics)
            if frequency is None and start is None:
                choice = _fundamental(record, choice, harmonics)
            choice = chosen(record, record.refined(choice.fit.rate, choice.harmonics).rate, harmonics)
            if choice.chance < chance:
                strongest, chance = choice.fit.rate / (2.0 * np.pi), choice.chance
            if choice.chance < _CHANCE:
                return record.refined(choice.fit.rate, choice.harmonics), choice.noise, choice.ordinates
        except np.linalg.LinAlgError:
            continue
    told = f" (the strongest, at {strongest:.4g} Hz, has a chance of {chance:.2g})" if chance < 1.0 else ""
    hint = f"is the shaker on, and its frequency below the limit of Nyquist, {record.nyquist:.4g} Hz?"
    if 0.3 / record.span < _highest(spectrum, 0.0, record.nyquist) < least:
        hint = "most of the motion is slower than two periods in the record: take a longer one, or filter the drift"
    near = "" if frequency is None else f" near {frequency:g} Hz"
    raise ValueError(
        f"no drive found: among {len(record.times)} samples over {record.span:.4g} s no line{near} stands out of the "
        f"noise{told}; {hint}"
    )


def _begins(record: Record, spectrum: Spectrum, frequency: float | None) -> Iterator[tuple[float, int]]:
    """Yield frequencies of lines to try (Hz), and which harmonic each is taken for."""
    if frequency is None:
        least = FEWEST_PERIODS / record.span
        yield _highest(spectrum, least, record.nyquist), 1
        yield _highest(_whitened(record, spectrum), least, record.nyquist), 1
        return
    lines = []
    for k in range(1, min(5, max(1, record.most_harmonics(frequency))) + 1):
        reach = min(max(1.0 / record.span, _NEAR * frequency) * k, 0.3 * frequency)
        top = _highest(spectrum, k * frequency - reach, min(k * frequency + reach, record.nyquist))
        lines.append((float(spectrum.at(top)), top, k))
    best = max(lines)
    # A stronger line near a harmonic may be hum.
    if frequency * record.span > _RESOLVED and lines[0][0] > _PLAIN * best[0]:
        best = lines[0]
    yield best[1:]


def _highest(spectrum: Spectrum, lower: float, upper: float) -> float:
    """Return where the periodogram is highest."""
    first = max(1, int(np.ceil(lower / spectrum.step)))
    last = min(len(spectrum.power) - 1, int(upper / spectrum.step))
    top = first + int(np.argmax(spectrum.power[first : last + 1])) if last > first else 0
    return top * spectrum.step or 0.5 * (lower + upper)


def _whitened(record: Record, spectrum: Spectrum) -> Spectrum:
    """Divide by the median of the neighbourhood, so that a line stands out of coloured noise."""
    width = max(8, round(64.0 / (record.span * spectrum.step)))
    count = len(spectrum.power) // width
    if count < 2:
        return spectrum
    medians = np.median(spectrum.power[: count * width].reshape(count, width), axis=1)
    level = np.interp(np.arange(len(spectrum.power)), (np.arange(count) + 0.5) * width, np.maximum(medians, 1e-300))
    return Spectrum(spectrum.step, spectrum.power / level)


def chosen(record: Record, rate: float, harmonics: int | None) -> Choice:
    """Fit as many harmonics as may be, and tell how many of them the noise lets be known."""
    frequency = rate / (2.0 * np.pi)
    affordable = int(0.5 * sqrt(_WORK / len(record.times)))
    most = harmonics or max(1, min(MOST_HARMONICS, record.most_harmonics(frequency), affordable))
    while True:
        try:
            fit = record.solved(rate, most)
            break
        except np.linalg.LinAlgError:
            if harmonics is not None or most == 1:
                raise
            most = max(1, most // 2)
    spectrum = record.periodogram(fit.residuals)
    noise, count = record.noise_about(fit, spectrum, most)
    kept = harmonics or harmonics_by_information(fit.gains, noise[1:], len(record.times))
    single = float(stats.f.sf(0.5 * (fit.gains / noise[1:])[:kept].max(), 2, 2 * count))
    chance = min(1.0, single * kept * max(1.0, 0.5 * len(record.times)))
    return Choice(fit, noise[: kept + 1], spectrum, count, chance)


def _fundamental(record: Record, choice: Choice, harmonics: int | None) -> Choice:
    """Look for a fundamental of which the strongest line is a harmonic, and keep it where it explains more."""
    spectrum, best, most = choice.spectrum, choice, 0.0
    information = log(len(record.times))
    for divisor in range(2, _LARGEST_DIVISOR + 1):
        rate = choice.fit.rate / divisor
        frequency = rate / (2.0 * np.pi)
        # The comb of a far fundamental with few periods takes up slow noise almost whole.
        if frequency * record.span < (FEWEST_PERIODS if divisor <= _PLAUSIBLE else _FEW_PERIODS):
            break
        apart = np.concatenate([np.arange(-24, -1), np.arange(2, 25)])
        apart = apart[np.abs(apart) <= max(4.0, frequency * record.span)]
        places = frequency + apart / record.span
        around = spectrum.at(places[(places > 0.5 / record.span) & (places < record.nyquist)])
        if spectrum.at(frequency) > _FAINTEST * np.median(around) / log(2.0):
            other = chosen(record, rate, harmonics)
            order = np.arange(1, other.harmonics + 1)
            fresh = order[order % divisor != 0]
            gained = float((other.fit.gains[fresh - 1] / other.noise[fresh]).sum()) - 2.0 * len(fresh) * information
            if gained > most and other.fit.gains[0] > _WEAKEST * other.fit.gains.max():
                best, most = other, gained
    return best


def saturated(readings: Floats, limits: tuple[float, float] | None) -> Bools:
    """Tell which samples look saturated: at the limits of the sensor, or else in runs of equal extremes."""
    if limits is not None:
        return (readings <= limits[0]) | (readings >= limits[1])
    return _plateaus(readings, [readings == extreme for extreme in (readings.min(), readings.max())])


def crowded(readings: Floats) -> Bools:
    """Tell which samples crowd at an extreme as narrowly as the noise: saturated ones, if noise came in after that.

    Where hardly any are left besides, the wave is square, and there are none.
    """
    # Fourth differences hold nothing of a smooth wave; their weights have 70 as the sum of squares.
    width = _BAND * 1.4826 * float(np.median(np.abs(np.diff(readings, 4)))) / sqrt(70.0)
    bands = []
    for extreme in (readings.min(), readings.max()):
        below = np.abs(readings - extreme)
        near, next_to = below <= width, (below > width) & (below <= 2.0 * width)
        if width < _NARROW * np.ptp(readings) and near.sum() > _CROWDED * next_to.sum():
            bands.append(near)
    found = _plateaus(readings, bands)
    return found & (found.mean() <= MOST_SATURATED)


def _plateaus(readings: Floats, bands: list[Bools]) -> Bools:
    """Return the samples of the bands in which some follow each other."""
    kept = [band for band in bands if (np.convolve(band, np.ones(_RUN), "valid") == _RUN).any()]
    return np.any([np.zeros(len(readings), bool), *kept], axis=0)


def dead_times(record: Record, frequency: float | None, harmonics: int | None, rate: float) -> Bools:
    """Tell which samples a sensor repeated while it was dead: runs of equal ones that the fit of the others misses."""
    values, dead = record.values, np.zeros(len(record.values), bool)
    edges = np.flatnonzero(np.diff(values, prepend=np.nan, append=np.nan) != 0.0)
    long = [slice(*edges[k : k + 2]) for k in np.flatnonzero(np.diff(edges) >= _STUCK)]
    # Saturation, at the extremes, apart from what is between.
    sides = [int(values[run.start] == values.max()) - int(values[run.start] == values.min()) for run in long]
    most = _RARE * rate * record.span / (2.0 * np.pi)
    runs = [run for run, side in zip(long, sides, strict=True) if sides.count(side) < most]
    if not runs:
        return dead
    for run in runs:
        dead[run] = True
    fit = find_drive(record.without(dead), frequency, harmonics)[0]
    missed = np.abs(record.model(fit.rate, fit.coefficients) - values)
    far = _FAR * sqrt(fit.variance) + record.resolution
    for run in runs:
        dead[run] = missed[run].mean() > far
    return dead


def beyond_limits(record: Record, fit: Fit, bad: Bools) -> Bools:
    """Tell which samples the fit of the others puts beyond the plateaus of the record; none if it puts them on these.

    A coarse converter gives runs of equal samples as well, where the motion turns, and the fit passes through them
    within half of a step of the converter.  Judged by the fit, and not by the samples, those left are not a selection
    of the noise.
    """
    predicted, noise = record.model(fit.rate, fit.coefficients), sqrt(fit.variance)
    found = np.zeros(len(bad), bool)
    middle = 0.5 * float(record.values.max() + record.values.min())
    for side in (1.0, -1.0):
        there = bad & (side * (record.values - middle) > 0.0)
        if there.any():
            extreme = float(record.values[there].mean())
            excess = side * (predicted[there] - extreme)
            if excess.mean() > 0.55 * record.resolution + 4.0 * noise / sqrt(there.sum()):
                found |= there | (side * (predicted - extreme) > -3.0 * noise)
    return found
