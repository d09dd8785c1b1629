"""Measures of periodic orbits over their period: maxima, amplitudes, means and norms of a quantity."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from .._lib.arrays import Complexes, Floats
from .._lib.checks import check_mapping, finite_number, label, one_of, shown
from ..maps.poincare import Section
from ..maps.point_map import PointMap
from ..maps.stroboscopic import Stroboscopic
from ..maps.swept_orbits import Quantity as Quantity
from ..maps.swept_orbits import SweptOrbits

_SAMPLES, _MOST_SAMPLES = 64, 1024  # samples in a step of the map, at first and at most
_TAIL = 1e-10  # largest harmonics of the upper quarter, relative to all, of a signal that is resolved
_CHECKS = 37  # samples in a step, with no factor in common with the others, at which these must give the same signal
_AGREES, _ROUGH = 1e-6, 1e-3  # differences there, relative: of smooth signals, and beyond the samples beside them
_GOLDEN = 0.5 * (5.0**0.5 - 1.0)  # golden ratio: no number of samples aliases its multiples, less whole numbers
_ZOOMS = 10  # finer samples around an extreme value of a signal with jumps or kinks
_FINER = 8  # points between two samples at which the largest value is looked for first
_NEWTON_STEPS = 4
_BLOCK = 8192  # steps of orbits that are integrated together
_CLOSED = 1e-5  # distance, relative, by which a signal may miss its first value after a period


class PeriodMeasure(StrEnum):
    """Measures of a quantity over the period of an orbit."""

    MAXIMUM = "maximum"
    """Largest value."""
    MINIMUM = "minimum"
    """Smallest value."""
    AMPLITUDE = "amplitude"
    """Half the difference of the largest and the smallest value."""
    MEAN = "mean"
    """Mean over time."""
    NORM = "norm"
    """Square root of the mean square (L2 norm)."""


_NAMES = tuple(m.value for m in PeriodMeasure)


@dataclass(frozen=True)
class OrbitFunction:
    """Function of an orbit: a quantity at its first point, or a measure of the quantity over the period.

    Parameters
    ----------
    quantity : int, str or callable, optional
        Number or name of a coordinate, one of the `outputs` of the system, or a function ``f(t, x, p)`` of time,
        state and parameters, written with the functions of :mod:`math`.  For discrete maps the time is the number of
        the iterate.  On a section quantities are those of all coordinates of the system.
    measure : {"maximum", "minimum", "amplitude", "mean", "norm"}, optional
        A :class:`PeriodMeasure`; by default the quantity is that at the first point of the orbit.
    value : float, optional
        What is subtracted, in the unit of the quantity, so that the function is zero where the quantity has this value.
    extremum : bool, optional
        What is located on a branch is where the function is greatest or least along it, such as the peak of a
        resonance curve, instead of where it is zero.

    Examples
    --------
    >>> OrbitFunction("x", "amplitude", value=1.5)
    OrbitFunction(quantity='x', measure='amplitude', value=1.5, extremum=False)
    """

    quantity: Quantity = 0
    measure: str | None = None
    value: float = 0.0
    extremum: bool = False

    def __post_init__(self) -> None:
        if self.measure is not None:
            one_of("measure", self.measure, _NAMES)
        object.__setattr__(self, "value", finite_number("value", self.value))
        if not isinstance(self.extremum, bool | np.bool_):
            raise TypeError(f"extremum={shown(self.extremum)}: give True or False")


def as_functions(
    given: Mapping[str, Quantity | OrbitFunction] | None, argument: str = "functions"
) -> dict[str, OrbitFunction]:
    """Return functions of orbits by their names; a quantity stands for itself at the first point."""
    given = {} if given is None else given
    check_mapping(argument, given, "of names to functions of orbits, such as {'x': 0}")
    return {label(argument, n): f if isinstance(f, OrbitFunction) else OrbitFunction(f) for n, f in given.items()}


def measured(
    point_map: PointMap,
    names: tuple[str, ...],
    values: Floats,
    points: Floats,
    period: int,
    quantity: Quantity,
    measure: str | None,
    finest: float = np.inf,
) -> Floats:
    """Return a measure (n,) of orbits through points (n, d) at values (n, m) of some parameters.

    The states within a period are integrated at equal distances in time, at more of them until the harmonics of the
    quantity have died out, and agree with others between them; its extreme values are those of the trigonometric
    polynomial through them.  Where 1024 samples in a step do not resolve it, they are values that it takes if it has
    jumps or kinks, and NaN if it oscillates between the samples.  For a discrete
    map the points of the orbit stand for all times.  NaN where the quantity does not return after the period, as an
    angle that makes full rotations.  Without a measure, the quantity at the points.  The tolerances are those of the
    map, or `finest` if that is less.
    """
    orbits = SweptOrbits(point_map.without_table, names, values, points, period, finest)
    if measure is None:
        return orbits.quantity(quantity, *orbits.beginning)[:, 0]
    chosen = PeriodMeasure(one_of("measure", measure, _NAMES))
    result, rows, samples = np.full(len(values), np.nan), np.arange(len(values)), _SAMPLES
    while len(rows):
        some = orbits[rows]
        times, states = some.motion(samples)
        signals = some.quantity(quantity, times, states)
        apart = np.abs(signals[:, -1] - signals[:, 0])
        closed = apart <= _CLOSED * _size(signals)
        if not orbits.is_flow:
            result[rows[closed]] = _reduced(chosen, signals[closed, :-1], _highest(signals[closed, :-1]))
            break
        harmonics = np.fft.rfft(signals[:, :-1]) / (signals.shape[1] - 1)
        strength = np.abs(harmonics)
        tail = strength[:, 3 * strength.shape[1] // 4 :].max(axis=1, initial=0.0)
        resolved = tail <= np.maximum(_TAIL * strength.max(axis=1), apart)
        rough = np.zeros(len(rows), bool)
        if resolved.any() or samples == _MOST_SAMPLES:
            # Harmonics that are aliased are seen at another number of samples, and at irregular times.
            checks = some.quantity(quantity, *some.motion(_CHECKS))[:, :-1]
            phases = np.append(
                np.arange(checks.shape[1]) / checks.shape[1], np.arange(1, _CHECKS * period) * _GOLDEN % 1.0
            )
            loose = np.arange(len(phases)) >= checks.shape[1]  # states from polynomials are less accurate
            inside = np.repeat(phases[loose, None] * (len(states) - 1), len(rows), axis=1)
            checks = np.hstack([checks, some.quantity(quantity, *_between(times, states, inside))])
            slack = np.where(loose, _ROUGH, _AGREES) * _size(signals)[:, None] + 10.0 * apart[:, None]
            waves = np.exp(2j * np.pi * np.outer(np.arange(harmonics.shape[1]), phases))
            waves[1 : (signals.shape[1] - 1) // 2] *= 2.0
            resolved &= (np.abs((harmonics @ waves).real - checks) <= slack).all(axis=1)
            beside = (phases * (signals.shape[1] - 1)).astype(int)
            pair = np.stack([signals[:, beside], signals[:, beside + 1]])
            slack = _ROUGH * _size(signals)[:, None]
            rough = ((checks >= pair.min(axis=0) - slack) & (checks <= pair.max(axis=0) + slack)).all(axis=1)
        done, left = closed & resolved, closed & ~resolved
        result[rows[done]] = _reduced(chosen, signals[done, :-1], _of_waves(signals[done, :-1], harmonics[done]))
        if samples == _MOST_SAMPLES:
            left &= rough
            zoomed = _of_samples(some[left], quantity, signals[left], times[:, left], states[:, left])
            result[rows[left]] = _reduced(chosen, signals[left, :-1], zoomed)
            break
        rows, samples = rows[left], 2 * samples
    return result


def _of_samples(orbits: SweptOrbits, quantity: Quantity, signals: Floats, times: Floats, states: Floats) -> _Largest:
    """Return the largest values of signals (n, times) with jumps or kinks, which are values that they take.

    They are looked for between the samples beside the best one, with states from polynomials through five samples.
    """
    each = np.arange(len(signals))

    def largest(sign: float) -> Floats:
        best = np.argmax(sign * signals, axis=1)
        high, place, width = sign * signals[each, best], best.astype(float), 1.0
        for _ in range(_ZOOMS):
            at = np.clip(place + width * np.linspace(-1.0, 1.0, 2 * _FINER + 1)[:, None], 0.0, len(states) - 1.0)
            found = sign * orbits.quantity(quantity, *_between(times, states, at)).T
            best = np.argmax(found, axis=0)
            high, place, width = np.maximum(high, found[best, each]), at[best, each], width / _FINER
        return high

    return largest


def _between(times: Floats, states: Floats, places: Floats) -> tuple[Floats, Floats]:
    """Return times and states at places (k, n) between samples (count, n, ...), by polynomials through five of them."""
    centre = np.clip(np.rint(places).astype(int), 2, len(states) - 3)
    at, nodes = places - centre, range(-2, 3)
    weights = [np.prod([(at - m) / (k - m) for m in nodes if m != k], axis=0) for k in nodes]
    each = np.arange(states.shape[1])
    when = sum(w * times[centre + k, each] for w, k in zip(weights, nodes, strict=True))
    where = sum(w[..., None] * states[centre + k, each] for w, k in zip(weights, nodes, strict=True))
    return np.asarray(when), np.asarray(where)


def measured_along(
    point_map: PointMap, names: tuple[str, ...], values: Floats, points: Floats, quantity: Quantity, measure: str
) -> Floats:
    """Return a measure (n,) over all steps that are recorded of orbits (n, steps, d) that need not return.

    Extreme values are those of parabolas through neighbouring samples.  NaN for maps of first returns, whose steps are
    of different length.
    """
    if isinstance(point_map.without_table.spec, Section):
        return np.full(len(points), np.nan)
    chosen = PeriodMeasure(one_of("measure", measure, _NAMES))
    n, steps, d = points.shape
    result, block = np.full(n, np.nan), max(_BLOCK // steps, 1)
    for rows in (slice(k, k + block) for k in range(0, n, block)):
        each, exact = np.repeat(values[rows], steps, axis=0), point_map.without_table
        orbits = SweptOrbits(exact, names, each, points[rows].reshape(-1, d), 1)
        signals = orbits.quantity(quantity, *orbits.motion(_SAMPLES))
        signals = signals.reshape(-1, steps, signals.shape[-1])
        apart = np.abs(signals[:, :-1, -1] - signals[:, 1:, 0]).max(axis=1, initial=0.0)
        inner = signals[..., :-1].reshape(len(signals), -1)
        whole = np.column_stack([inner, signals[:, -1, -1]])
        found = (
            _reduced(chosen, whole, _of_parabola(whole), is_open=True)
            if orbits.is_flow
            else _reduced(chosen, inner, _highest(whole))
        )
        result[rows] = np.where(apart <= _CLOSED * _size(whole), found, np.nan)
    return result


def turn_of(point_map: PointMap, quantity: Quantity, measure: str | None) -> float:
    """Return the period of a measure that is an angle, and 0 for others."""
    exact = point_map.without_table
    if measure in {PeriodMeasure.AMPLITUDE, PeriodMeasure.NORM} or callable(quantity):
        return 0.0
    axes = exact.spec.system.axes if isinstance(exact.spec, Stroboscopic | Section) else exact.coordinates
    chosen = exact.coordinates[quantity].name if isinstance(quantity, int | np.integer) else quantity
    return next((c.period or 0.0 for c in axes if c.name == chosen), 0.0)


def unwrapped(values: Floats, turn: float) -> Floats:
    """Return angles (n,) along a branch, each next to the one before it that is known."""
    known = np.isfinite(values)
    if turn and known.any():
        values = values.copy()
        values[known] = np.unwrap(values[known], period=turn)
    return values


def _size(signals: Floats) -> Floats:
    size = np.abs(signals).max(axis=1, initial=0.0)
    return np.where(size > 0.0, size, 1.0)


_Largest = Callable[[float], Floats]
"""Returns the largest values (n,) of signals times a sign."""


def _reduced(measure: PeriodMeasure, signals: Floats, largest: _Largest, is_open: bool = False) -> Floats:
    """Return a measure (n,) of signals (n, times), whose last value is the first one again unless they are open."""
    if measure in {PeriodMeasure.MEAN, PeriodMeasure.NORM}:
        means = signals if measure is PeriodMeasure.MEAN else signals**2
        mean = np.asarray((0.5 * (means[:, :-1] + means[:, 1:]) if is_open else means).mean(axis=1))
        return mean if measure is PeriodMeasure.MEAN else np.sqrt(mean)
    high, low = largest(1.0), -largest(-1.0)
    if measure is PeriodMeasure.AMPLITUDE:
        return np.asarray(0.5 * (high - low))
    return np.asarray(high if measure is PeriodMeasure.MAXIMUM else low)


def _highest(signals: Floats) -> _Largest:
    return lambda sign: np.asarray((sign * signals).max(axis=1))


def _of_parabola(values: Floats) -> _Largest:
    """Return the largest values of signals (n, times), from parabolas through three samples."""

    def largest(sign: float) -> Floats:
        signals = sign * values
        place = np.argmax(signals[:, 1:-1], axis=1)
        before, here, after = (signals[np.arange(len(signals)), place + k] for k in range(3))
        bend = 2.0 * here - before - after
        return np.maximum(signals.max(axis=1), here + (after - before) ** 2 / np.where(bend > 0.0, 8.0 * bend, np.inf))

    return largest


def _of_waves(signals: Floats, harmonics: Complexes) -> _Largest:
    return lambda sign: _largest(sign * signals, sign * harmonics)


def _largest(signals: Floats, harmonics: Complexes) -> Floats:
    """Return the largest values (n,) of trigonometric polynomials, from values at their nodes and coefficients."""
    count, orders = signals.shape[1], np.arange(harmonics.shape[1])
    weights = np.where((orders == 0) | (2 * orders == count), 1.0, 2.0) * harmonics
    fine = np.fft.irfft(harmonics, _FINER * count)
    times = 2.0 * np.pi * np.argmax(fine, axis=1) / (_FINER * count)

    def value(order: int) -> Floats:
        waves = np.exp(1j * orders * times[:, None])
        return np.asarray((weights * (1j * orders) ** order * waves).real.sum(axis=1))

    best = np.maximum(signals.max(axis=1), value(0))
    for _ in range(_NEWTON_STEPS):
        curvature = value(2)
        step = np.where(curvature < 0.0, -value(1) / np.where(curvature < 0.0, curvature, 1.0), 0.0)
        times = times + np.clip(step, -2.0 * np.pi / (_FINER * count), 2.0 * np.pi / (_FINER * count))
        best = np.maximum(best, value(0))
    return best
