"""The envelope of a free swing: its extremes, one for each half swing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator
from scipy.special import ellipk

from cellmap.utils import finite_number

from ..arrays import Bools, Floats, Ints
from ..time_series import measured_series, noise_level

_MOST_HIDDEN = 4  # pairs of half swings in an interval from which the time of one is guessed
_TRIED = 400  # times that are tried, at most
SURE = 0.35  # of a half swing, by which an interval may miss its count; the next one of its kind is two away
_TAIL = 0.25  # of the extremes, at most, that are no more than noise after the swing has died
_SILENT = 3  # times as many half swings without an extreme as ever before are too many,
_WATCHED = 0.25  # if no gap among them is longer than this fraction of one
_CLEAR = 4.0  # standard deviations of the noise beyond rest that tell a swing from it
_CAP = 0.75  # samples of a half swing above this fraction of its height go into the fit of its extreme
_FEWEST_EXTREMES = 4
_FEWEST_SAMPLES = 4  # of a cap
_QUARTIC = 7  # samples of a cap from which on a polynomial of degree 4 is fitted
_WIDEST = 0.45  # fraction of a cap without a sample that may not hide an extreme
_BESIDE = 0.15  # of the width of a cap, that the series goes on beyond it at least: else the cap itself may be cut
_STEEP = 0.6  # of its height, the bend of a cap over its half width squared; that of a cosine is 0.52
_ROUNDS = 4
GAUSS = np.polynomial.legendre.leggauss(6)


class _Extreme(NamedTuple):
    time: float
    height: float
    side: int
    error: float
    time_error: float


@dataclass(frozen=True, eq=False)
class Envelope:
    """Extremes of a swing about its rest, in the order of time.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Times of the extremes (s).
    amplitudes : ndarray, shape (n,)
        Distances from rest (rad), above 0.
    sides : ndarray of int8, shape (n,)
        1 for a maximum, -1 for a minimum.
    standard_errors : ndarray, shape (n,)
        Of the amplitudes (rad), from the scatter of the samples about the polynomial through each extreme.
    time_errors : ndarray, shape (n,)
        Standard errors of the times (s).
    rest : float
        Angle about which it swings (rad).
    noise : float
        Standard deviation of the noise of a sample (rad).
    """

    times: Floats
    amplitudes: Floats
    sides: NDArray[np.int8]
    standard_errors: Floats
    time_errors: Floats
    rest: float
    noise: float

    def __repr__(self) -> str:
        missing = int(self.half_swings.sum()) - len(self.half_swings)
        hidden = f", {missing} hidden" if missing else ""
        return (
            f"Envelope({len(self.times)} extremes{hidden}, from {self.amplitudes[0]:.4g} to {self.amplitudes[-1]:.4g} "
            f"rad in {np.ptp(self.times):.4g} s)"
        )

    @property
    def half_swings(self) -> Ints:
        """Half swings from each extreme to the next, shape (n - 1,): 1, or more where gaps of the series hide some."""
        return counted(*self._lasted())

    @property
    def misfits(self) -> Floats:
        """By how much each interval differs from its `half_swings`, as a fraction of one, shape (n - 1,); at most 1.

        The count is a guess where it is large: beyond ``SURE`` the nearest counts may be as good.
        """
        lasted, odd = self._lasted()
        return np.abs(lasted - counted(lasted, odd))

    def _lasted(self) -> tuple[Floats, Bools]:
        """Half swings, not rounded, that each interval lasts at small amplitude, and whether sides change in it."""
        times, odd = np.diff(self.times) / self.slowings, np.diff(self.sides) != 0
        return times / half_period(times, odd), odd

    @property
    def slowings(self) -> Floats:
        """Mean ratio of the period to that of small swings from each extreme to the next, shape (n - 1,)."""
        nodes, weights = GAUSS
        late = self.times[:-1, None] + 0.5 * np.diff(self.times)[:, None] * (nodes + 1.0)
        amplitudes = np.exp(PchipInterpolator(self.times, np.log(self.amplitudes))(late))
        # A slow swing gets less far in its time, so the mean over the time is that of 1/slowing.
        return np.asarray(2.0 / ((1.0 / slowing(amplitudes)) @ weights))


def swing_envelope(times: ArrayLike, angles: ArrayLike, rest: float | None = None) -> Envelope:
    """Find the extremes of a free swing: one for each half swing that is clear of the noise.

    A half swing is what lies between two passages through rest, detected with a hysteresis of four standard
    deviations of the noise, so that noise makes no extremes.  A polynomial of degree 4 through the samples near the
    extreme, or of degree 2 where there are few, gives its time and height with their errors.  Half swings that the
    series begins or ends with, or whose extreme falls into a gap, are left out, and so are the last extremes, up to a
    quarter of them, from where their times lose the step or many are missing without a gap: the swing has died there.

    Parameters
    ----------
    times : array_like, shape (n,)
        Times of the samples (s), increasing.
    angles : array_like, shape (n,)
        Angles (rad), continuous; NaN marks a gap.
    rest : float, optional
        Angle of rest (rad).  By default it is found from the extremes: midway between maxima and minima, each taken at
        the same time.

    Returns
    -------
    Envelope
        The extremes.

    Raises
    ------
    TypeError, ValueError
        For a series that is not one, angles that jump by pi, swings over the top, too few samples in a swing,
        and fewer than four extremes.

    Examples
    --------
    >>> t = np.linspace(0.0, 5.0, 1001)
    >>> swing_envelope(t, 0.5 * np.exp(-0.2 * t) * np.cos(12.0 * t))
    Envelope(18 extremes, from 0.4746 to 0.1949 rad in 4.451 s)
    """
    return envelope_of(*continuous_angles(times, angles), rest)


def continuous_angles(times: ArrayLike, angles: ArrayLike) -> tuple[Floats, Floats]:
    """Return a series of angles, shape (n,) twice, checked for the jumps of angles that are wrapped."""
    t, x = measured_series(times, angles)
    jumps = np.abs(np.diff(x))
    if np.nanmax(jumps, initial=0.0) > pi:
        raise ValueError(
            f"angles[{int(np.nanargmax(jumps)) + 1}] is {np.nanmax(jumps):.3g} rad from the angle before: unwrap them"
        )
    return t, x


def envelope_of(
    t: Floats, x: Floats, rest: float | None = None, fewest: int = _FEWEST_EXTREMES, or_else: str = "rest="
) -> Envelope:
    """Find extremes of continuous angles; where they are too few, or beyond the top, an argument may help as well."""
    noise = noise_level(t, x)
    middle = _middle(t, x, noise) if rest is None else finite_number("rest", rest)
    found = _extremes(t, x, middle, noise)
    if np.nanmax(np.abs(x - middle)) >= pi:
        raise ValueError(
            f"angles go {np.nanmax(np.abs(x - middle)):.3g} rad from rest at {middle:.3g}, over the top: cut the "
            f"series where it begins to swing, or give {or_else}"
        )
    if len(found) >= _FEWEST_EXTREMES:
        moments, heights, sides, errors, time_errors = np.array(found).T
        envelope = Envelope(moments, heights, sides.astype(np.int8), errors, time_errors, middle, noise)
        kept = in_step(moments, envelope.half_swings, envelope.misfits, t[np.isfinite(x)])
        found = found[:kept] if kept >= _FEWEST_EXTREMES else found
    if len(found) < fewest:
        halves = len(_half_swings(x - middle, _CLEAR * noise))
        raise ValueError(
            f"angles have {len(found)} extremes in {halves} half swings clear of the noise of {noise:.2g} rad: give at "
            f"least {fewest}, by a longer film, a wider swing or at least 10 samples a half swing, or give {or_else}"
        )
    columns = ("times", "amplitudes", "sides", "standard_errors", "time_errors")
    return replace(envelope, **{name: getattr(envelope, name)[: len(found)] for name in columns})


def _middle(t: Floats, x: Floats, noise: float) -> float:
    """Angle midway between maxima and minima; a parabola through three neighbours in turn takes out their decay.

    A swing that loses most of its height at once is not about the middle of all angles: then their median is near it.
    """
    begin = 0.5 * float(np.nanmin(x) + np.nanmax(x))
    for middle in (begin, float(np.nanmedian(x))):
        for _ in range(_ROUNDS):
            found = _extremes(t, x, middle, noise)
            values = np.array([middle + e.side * e.height for e in found])
            rotations = [k for k in range(1, len(found) - 1) if found[k - 1].side == found[k + 1].side != found[k].side]
            if not rotations:  # too few extremes are about it
                break
            middle = float(np.median([(values[k - 1] + 2.0 * values[k] + values[k + 1]) / 4.0 for k in rotations]))
        else:
            return middle
    return begin


def _half_swings(x: Floats, clear: float) -> list[tuple[int, int, int]]:
    """Sides, first and last sample of the half swings; a swing begins where it is clear of rest on the other side."""
    signs = np.where(x > clear, 1, np.where(x < -clear, -1, 0))
    places = np.flatnonzero(signs)
    if not places.size:
        return []
    rotations = np.flatnonzero(np.diff(signs[places])) + 1
    return [(int(signs[p[0]]), int(p[0]), int(p[-1])) for p in np.split(places, rotations)]


def _extremes(t: Floats, x: Floats, middle: float, noise: float) -> list[_Extreme]:
    found = []
    for side, first, last in _half_swings(x - middle, _CLEAR * noise):
        heights = side * (x[first : last + 1] - middle)
        high = first + np.flatnonzero(heights > _CAP * np.nanmax(heights))
        cap = np.arange(high[0], high[-1] + 1)
        cap = cap[np.isfinite(x[cap])]
        if len(cap) >= _FEWEST_SAMPLES and (extreme := _extreme(t, side * (x - middle), cap, noise)) is not None:
            found.append(extreme._replace(side=side))
    return found


def _extreme(t: Floats, x: Floats, cap: NDArray[np.intp], noise: float) -> _Extreme | None:
    """Time and height of a maximum with their errors, from the samples near it; None where a gap may hide it."""
    seen = np.flatnonzero(np.isfinite(x))
    before, after = seen[seen < cap[0]], seen[seen > cap[-1]]
    if not (before.size and after.size):
        return None
    width = t[cap[-1]] - t[cap[0]]
    if min(t[cap[0]] - t[seen[0]], t[seen[-1]] - t[cap[-1]]) < _BESIDE * width:
        return None
    if np.diff(t[[before[-1], *cap, after[0]]]).max() > _WIDEST * width:
        return None
    centre, scale = 0.5 * (t[cap[0]] + t[cap[-1]]), 0.5 * width
    s = (t[cap] - centre) / scale
    degree = 4 if len(cap) >= _QUARTIC else 2
    factors, spread = np.polyfit(s, x[cap], degree, cov="unscaled")
    slopes = np.polyder(factors)
    flat = [float(r.real) for r in np.roots(slopes) if abs(r.imag) < 1e-9 and abs(r.real) <= 1.0]
    if not flat:
        return None
    height, place = max((float(np.polyval(factors, r)), r) for r in flat)
    bend = float(np.polyval(np.polyder(slopes), place))
    if bend >= 0.0:
        return None
    rest = x[cap] - np.polyval(factors, s)
    freedom = len(cap) - degree - 1
    spread *= float(rest @ rest) / freedom if freedom >= _QUARTIC else noise * noise
    value = place ** np.arange(degree, -1, -1)
    slope = np.append(np.arange(degree, 0, -1) * value[1:], 0.0)
    shift = float(slope @ spread @ slope) / -bend
    if shift > -bend:  # so flat for its scatter that the extreme may be anywhere in the cap
        return None
    return _Extreme(
        time=centre + scale * place,
        height=height - 0.5 * shift,  # the maximum of a noisy curve is too high by this much
        side=1,
        error=float(np.sqrt(value @ spread @ value)),
        # Noise bends a curve more than the swing does, and would seem to fix its extreme the better for it.
        time_error=scale * float(np.sqrt(shift * -bend)) / min(-bend, _STEEP * height),
    )


def check_rhythm(envelope: Envelope, first: int) -> None:
    """Refuse an envelope of whose first intervals one is no whole number of half swings.

    Parameters
    ----------
    envelope : Envelope
        Extremes.
    first : int
        How many intervals.

    Raises
    ------
    ValueError
        Where one misses its count by more than :data:`SURE`.
    """
    misfits = envelope.misfits[:first]
    if misfits.max() > SURE:
        k = int(np.argmax(misfits))
        raise ValueError(
            f"envelope: from the extreme at {envelope.times[k]:.4g} s to the next one at {envelope.times[k + 1]:.4g} s "
            "it is no whole number of half swings by the rhythm of the others; cut the series before the swing drowns "
            "in noise, or give more samples a swing"
        )


def slowing(amplitude: ArrayLike) -> Floats:
    """Return by what factor the period of a pendulum at an amplitude (rad) exceeds that of small swings: 2 K/pi."""
    return np.asarray(2.0 / pi * ellipk(np.sin(0.5 * np.asarray(amplitude, dtype=float)) ** 2))


def counted(lasted: Floats, odd: Bools) -> Ints:
    """Return the nearest odd number of half swings where sides change, else the nearest even one."""
    pairs = np.rint((lasted - odd) / 2.0).astype(np.int64)
    return np.where(odd, 2 * np.maximum(pairs, 0) + 1, 2 * np.maximum(pairs, 1))


def half_period(times: Floats, odd: Bools) -> float:
    """Return the longest of all times of which no shorter one fits clearly more intervals.

    Where many extremes are hidden, the typical interval is none of one half swing; short times fit some by chance.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Intervals, as they would be at small amplitude (s).
    odd : ndarray of bool, shape (n,)
        Whether the side changes in them.

    Returns
    -------
    float
        Time of a half swing (s).

    Examples
    --------
    >>> half_period(np.array([3.0, 1.1, 2.0, 3.0, 0.9, 4.0]), np.array([True, True, False, True, True, False]))
    1.0
    """
    counts = np.arange(1, 2 * _MOST_HIDDEN, 2)[:, None] + ~odd
    halves = np.sort((times / counts).ravel())[::-1]
    halves = halves[:: -(-len(halves) // _TRIED)]
    lasted = times / halves[:, None]
    fit = (np.abs(lasted - counted(lasted, odd)) < SURE).sum(axis=1)
    best = float(halves[np.argmax(fit >= fit.max() - max(1, len(times) // 10))])
    near = counted(times / best, odd)
    good = np.abs(times / best - near) < SURE
    return float(np.median(times[good] / near[good]))


def in_step(times: Floats, steps: Ints, misfits: Floats, seen: Floats) -> int:
    """Return how many extremes belong to the swing; the last ones may be noise, or the bend of a rod that has stopped.

    Those, up to a quarter of all, are out of step, or come after many half swings without an extreme, of which there
    were samples.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Times of the extremes (s).
    steps, misfits : ndarray, shape (n - 1,)
        Half swings from each to the next, and by how much the intervals miss them.
    seen : ndarray, shape (m,)
        Times of the samples (s).

    Returns
    -------
    int
        Number of extremes, `n` at most.
    """
    usual = np.maximum.accumulate(np.concatenate([[1], steps[:-1]]))
    breaks = misfits > SURE
    for k in np.flatnonzero(steps > _SILENT * usual):
        between = seen[(seen >= times[k]) & (seen <= times[k + 1])]
        breaks[k] |= np.diff(between).max(initial=0.0) < _WATCHED * (times[k + 1] - times[k]) / steps[k]
    ends = np.flatnonzero(breaks) + 1
    ends = ends[ends >= (1.0 - _TAIL) * len(times)]
    return int(ends[0]) if ends.size else len(times)
