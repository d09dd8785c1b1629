"""Measures of periodic orbits over their period: maxima, amplitudes, means and norms of a quantity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.checks import one_of, shown
from ..maps.parameters_as_states import swept_map, with_states
from ..maps.point_map import PointMap
from ..maps.stroboscopic import Stroboscopic
from ..maps.system import ForcedSystem
from ..maps.trajectories import trajectory

_SAMPLES, _MOST_SAMPLES = 64, 1024  # in a step of the map
_TAIL = 1e-10  # largest harmonics of the upper half, relative to all, of a signal that is resolved
_FINER = 8  # points between two samples at which the largest value is looked for first
_NEWTON_STEPS = 4
_CLOSED = 1e-5  # distance, relative, by which a signal may miss its first value after a period

Quantity = int | str | Callable[[Any, Any, Any], Any]
"""Number or name of a coordinate, name of one of the outputs of a system, or a function f(t, x, p)."""


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


def measured(
    point_map: PointMap,
    names: tuple[str, ...],
    values: NDArray[np.float64],
    points: NDArray[np.float64],
    period: int,
    quantity: Quantity,
    measure: str,
) -> NDArray[np.float64]:
    """Return a measure (n,) of orbits through points (n, d) at values (n, m) of some parameters.

    The states within a period are integrated at equal distances in time, at more of them until the harmonics of the
    quantity have died out; its extreme values are those of the trigonometric polynomial through them.  For a map that
    is no stroboscopic map the points of the orbit stand for all times.  NaN where the quantity does not return after
    the period, as an angle that makes full rotations.
    """
    chosen = PeriodMeasure(one_of("measure", measure, tuple(PeriodMeasure)))
    result = np.full(len(values), np.nan)
    rows, samples = np.arange(len(values)), _SAMPLES
    while len(rows):
        signals = _signals(point_map, names, values[rows], points[rows], period, quantity, samples)
        apart = np.abs(signals[:, -1] - signals[:, 0])
        signals, size = signals[:, :-1], np.abs(signals).max(axis=1, initial=0.0)
        closed = apart <= _CLOSED * np.where(size > 0.0, size, 1.0)
        harmonics = np.fft.rfft(signals) / signals.shape[1]
        strength = np.abs(harmonics)
        tail = strength[:, (strength.shape[1] + 1) // 2 :].max(axis=1, initial=0.0)
        coarse = closed & (tail > _TAIL * strength.max(axis=1)) & (samples < _MOST_SAMPLES)
        coarse &= isinstance(point_map.without_table.spec, Stroboscopic)
        done = closed & ~coarse
        result[rows[done]] = _reduced(chosen, signals[done], harmonics[done], point_map)
        rows, samples = rows[coarse], 4 * samples
    return result


def _signals(
    point_map: PointMap,
    names: tuple[str, ...],
    values: NDArray[np.float64],
    points: NDArray[np.float64],
    period: int,
    quantity: Quantity,
    samples: int,
) -> NDArray[np.float64]:
    """Return the quantity (n, times + 1) from the beginning of the period of orbits to its end."""
    exact = point_map.without_table
    spec, d = exact.spec, exact.dimension
    axes = [c.name for c in exact.coordinates]
    column = axes.index(quantity) if isinstance(quantity, str) and quantity in axes else None
    if isinstance(quantity, int):
        if isinstance(quantity, bool) or not -d <= quantity < d:
            raise ValueError(f"quantity={quantity!r}: the coordinates have the numbers 0 to {d - 1}")
        column = quantity
    if not isinstance(spec, Stroboscopic):
        if column is None:
            raise ValueError(f"quantity={shown(quantity)}: choose a coordinate of {exact!r}, one of {axes}")
        swept = swept_map(exact, *names)
        orbit = [np.column_stack([points, values])]
        for _ in range(period):
            orbit.append(swept(orbit[-1]))
        return np.array(orbit)[..., column].T
    system = spec.system
    settings: dict[str, Any] = {"phase": spec.phase, "rtol": spec.rtol, "atol": spec.atol, "method": spec.method}
    moving = with_states(system, names)
    if moving is not None:
        initial = np.column_stack([points, values])
        states = trajectory(moving, initial, period, samples, **settings).states[..., :d]
    else:
        each = (
            trajectory(_at(system, names, value), point, period, samples, **settings).states
            for value, point in zip(values, points, strict=True)
        )
        states = np.stack(list(each), axis=1)
    if column is not None:
        return states[..., column].T
    found = np.empty(states.shape[1::-1])
    for k, value in enumerate(values):
        here = _at(system, names, value)
        times = (spec.phase + np.arange(len(states)) / samples) * here.length
        name = quantity if isinstance(quantity, str) else "quantity"
        if not isinstance(quantity, str):
            here = replace(here, outputs={name: _as_output(quantity)})
        found[k] = here.output(name, times, states[:, k])[..., 0]
    return found


def _at(system: ForcedSystem, names: tuple[str, ...], values: NDArray[np.float64]) -> ForcedSystem:
    return system.with_params(**dict(zip(names, values.tolist(), strict=True)))


def _as_output(quantity: Any) -> Callable[[Any, Any, Any], Any]:
    if not callable(quantity):
        raise TypeError(
            f"quantity={shown(quantity)}: give a coordinate, one of the outputs of the system, or a function f(t, x, p)"
        )

    def output(t: Any, x: Any, p: Any) -> Any:
        value = quantity(t, x, p)
        return value if isinstance(value, tuple) else (value,)

    return output


def _reduced(
    measure: PeriodMeasure, signals: NDArray[np.float64], harmonics: NDArray[np.complex128], point_map: PointMap
) -> NDArray[np.float64]:
    if measure is PeriodMeasure.MEAN:
        return np.asarray(signals.mean(axis=1))
    if measure is PeriodMeasure.NORM:
        return np.asarray(np.sqrt((signals**2).mean(axis=1)))
    smooth = isinstance(point_map.without_table.spec, Stroboscopic)
    high, low = (
        sign * (_largest(sign * signals, sign * harmonics) if smooth else (sign * signals).max(axis=1))
        for sign in (1.0, -1.0)
    )
    if measure is PeriodMeasure.AMPLITUDE:
        return np.asarray(0.5 * (high - low))
    return np.asarray(high if measure is PeriodMeasure.MAXIMUM else low)


def _largest(signals: NDArray[np.float64], harmonics: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the largest values (n,) of trigonometric polynomials, from values at their nodes and coefficients."""
    count, orders = signals.shape[1], np.arange(harmonics.shape[1])
    weights = np.where((orders == 0) | (2 * orders == count), 1.0, 2.0) * harmonics
    fine = np.fft.irfft(harmonics, _FINER * count)
    times = 2.0 * np.pi * np.argmax(fine, axis=1) / (_FINER * count)

    def value(order: int) -> NDArray[np.float64]:
        waves = np.exp(1j * orders * times[:, None])
        return np.asarray((weights * (1j * orders) ** order * waves).real.sum(axis=1))

    best = np.maximum(signals.max(axis=1), value(0))
    for _ in range(_NEWTON_STEPS):
        curvature = value(2)
        step = np.where(curvature < 0.0, -value(1) / np.where(curvature < 0.0, curvature, 1.0), 0.0)
        times = times + np.clip(step, -2.0 * np.pi / (_FINER * count), 2.0 * np.pi / (_FINER * count))
        best = np.maximum(best, value(0))
    return best
