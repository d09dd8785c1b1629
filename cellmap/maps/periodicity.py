"""Whether functions of time repeat: compared a period later where they change most, which one sees at many times."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .._compiled.codegen.rebind import over_arrays, rebind
from .._lib.arrays import Floats, Ints
from .misread import PLACES, differ, short

InTime = Callable[[float], Sequence[float]]
"""A function of time alone, such as a right-hand side at one state."""

MOST_CYCLES = 1000  # cycles of a function in a period that are recognised, at most
_SAMPLES = MOST_CYCLES + 24  # samples in a period
_TIMES = (*(0.5 + 0.5 * np.cos(np.arange(1.0, 41.0))).tolist(), *PLACES[:2])
"""Times in periods, irregular, at which a function is compared with itself: short pulses are to be met."""

_SWITCHES = 8  # places of change that are narrowed down
_HALVINGS = 17  # halvings of the distance of samples, to less than _NEAR
_NEAR = 1e-7  # a switch that is this fraction of a period from where it was a period before has stayed there

_REMEDY = "give the period of the forcing (any positive number for an autonomous system)"


def check_periodic(name: str, function: InTime, length: float, remedy: str = _REMEDY) -> None:
    """Refuse a function, by its name, that does not repeat after some time."""
    with np.errstate(all="ignore"):  # in functions of NumPy, at times that nobody asked for
        found = _unlike(function, length)
    if found is None:
        return
    t, *both = found
    now, later = map(short, both)
    if now == later:
        now, later = (short(values, 15) for values in both)
    raise ValueError(
        f"period={length!r}: {name} at t = {t:.9g} is {now} and one period later {later}; {remedy}. "
        "What happens at one time only, as `if t < 1`, is not periodic: such times cannot be used"
    )


def _unlike(function: InTime, length: float) -> tuple[float, Floats, Floats] | None:
    """Return a time, the value there, and another one a period later; None where there is no such time."""
    for fraction in PLACES:
        now, later = value_at(function, fraction * length), value_at(function, (fraction + 1.0) * length)
        if differ(now, later):
            return fraction * length, now, later
    near = _NEAR * length
    for before, after in _switches(function, length):
        for t in (before - 3.0 * near, after + 3.0 * near):
            values = [value_at(function, t + s) for s in (-near, 0.0, near, length)]
            if not all(np.isfinite(v).all() for v in values):
                continue
            *window, later = values
            # The nearest value within rounding of the time, at which a steep function is another one.
            if differ(np.clip(later, np.min(window, axis=0), np.max(window, axis=0)), later):
                return t, window[1], later
    return None


def value_at(function: InTime, t: float) -> Floats:
    """Return the value at one time; NaN outside of the domain of the function."""
    try:
        return np.array(function(t), dtype=float)
    except Exception:
        return np.array([np.nan])


def sampled(function: InTime, length: float, count: int = _SAMPLES) -> tuple[Floats, Floats]:
    """Return times in a period and beyond its end, and values there, shape (times, components).

    A function that takes arrays gets them, once; of another one there are `count` calls.
    """
    times = (np.arange(_SAMPLES + 1) + 0.37) / _SAMPLES * length
    try:
        with np.errstate(all="ignore"):
            columns = over_arrays(function)(times.copy())
            rows = np.stack(np.broadcast_arrays(times, *columns)[1:], axis=-1).astype(float)
        if not any(differ(rows[k], value_at(function, float(times[k]))) for k in (_SAMPLES // 3, -1)):
            return times, rows
    except Exception:
        pass  # a function of numbers alone, such as one with branches
    times = (np.arange(count + 1) + 0.37) / count * length
    silent = rebind(function, {"print": lambda *_, **__: None})
    values = [value_at(silent, t) for t in times.tolist()]
    rows = np.full((len(times), max(map(len, values))), np.nan)
    for k, value in enumerate(values):
        rows[k, : len(value)] = value
    return times, rows


def _switches(function: InTime, length: float) -> list[tuple[float, float]]:
    """Return the times before and after jumps, or where a function is steep, where it is more so than elsewhere."""
    components = len(value_at(function, PLACES[0] * length))
    times, rows = (v[:-1] for v in sampled(function, length, max(64, _SAMPLES // components)))
    rows = np.nan_to_num(rows, posinf=0.0, neginf=0.0)
    steps = np.diff(rows, axis=0)
    bends = np.abs(np.diff(steps, axis=0)).max(axis=1)
    apart = np.concatenate(([0.0], bends)) + np.concatenate((bends, [0.0]))  # a jump amid a smooth motion
    least = min(10.0 * np.median(apart), 0.1 * np.ptp(rows, axis=0).max()) + 1e-7 * np.abs(rows).max()
    peak = (apart >= np.concatenate(([0.0], apart[:-1]))) & (apart >= np.concatenate((apart[1:], [0.0])))
    found: Ints = np.flatnonzero(peak & (apart > least))
    switches = []
    for k in found[np.argsort(-apart[found], kind="stable")][:_SWITCHES].tolist():
        beside = steps[max(k - 1, 0)], steps[min(k + 1, len(steps) - 1)]
        slope = np.where(np.abs(beside[0]) < np.abs(beside[1]), *beside) / (times[1] - times[0])
        switches.append(_narrowed(lambda t: value_at(function, t) - slope * t, float(times[k]), float(times[k + 1])))  # noqa: B023
    return switches


def _narrowed(function: Callable[[float], Floats], before: float, after: float) -> tuple[float, float]:
    """Return the part of an interval in which a function changes most, by halving."""
    first, last = function(before), function(after)
    for _ in range(_HALVINGS):
        t = 0.5 * (before + after)
        middle = function(t)
        if np.abs(middle - first).max() >= np.abs(last - middle).max():
            after, last = t, middle
        else:
            before, first = t, middle
    return before, after


def shortest_period(function: InTime, length: float) -> float:
    """Return the shortest period that a function has, a whole fraction of a given one; 0 if time plays no part."""

    def repeats(after: float, times: Sequence[float]) -> bool:
        """Return whether the function has the same finite value some time later."""
        for fraction in times:
            pair = [value_at(function, fraction * length + s) for s in (0.0, after)]
            if not all(np.isfinite(v).all() for v in pair) or differ(*pair):
                return False
        return True

    # No whole fraction of a period is an irrational one of it.
    if all(repeats(f * length, _TIMES) for f in (0.2360679775, 0.4142135624, 0.7320508076)):
        return 0.0
    seen = next((n for n in range(MOST_CYCLES, 1, -1) if repeats(length / n, _TIMES)), 1)
    if seen > 1:  # a forcing that rests between jumps or pulses shows its period there alone
        samples, rows = sampled(function, length)
        change = np.nan_to_num(np.abs(np.diff(rows, axis=0)).max(axis=1))
        most = samples[np.argsort(-change, kind="stable")[: len(_TIMES)]] / length
        times = (*most.tolist(), *_TIMES)
        seen = next((n for n in range(seen, 1, -1) if repeats(length / n, times)), 1)
    return length / seen
