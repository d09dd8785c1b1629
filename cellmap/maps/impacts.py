"""Impacts: events at which the state of a system jumps."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._compiled.codegen.expression import ImpureError
from .._compiled.codegen.trace import as_state
from .._compiled.kernels.periods import MOST_ENDS
from .._lib.checks import check_mapping, label, one_of, shown
from .coordinates import Coordinate
from .misread import PLACES, called_twice, differ, short, trial_state
from .periodicity import InTime, check_periodic

StateFunction = Callable[[float, Sequence[float], Any], Any]

REMEDY = (
    "give the period with which the forcing, walls and kicks repeat, and the guard of a kick at time s of each period "
    "T as sin(2 * pi * (s - t) / T)"
)


@dataclass(frozen=True)
class Impact:
    """An event at which the state of a system jumps: a wall, a table, a kick at a given time.

    Parameters
    ----------
    guard : callable
        Smooth function ``guard(t, x, p)`` of time, state and parameters that returns a number.  The impact happens
        where it passes through zero.
    reset : callable
        Function ``reset(t, x, p)`` that returns the tuple of the state after the impact.
    direction : int, optional
        -1 for a guard that falls through zero (a distance that becomes negative), 1 for one that rises.
    solid : bool, optional
        Whether there is something solid behind the surface, if states can rest on it: an initial condition behind it
        begins on it.  False for a thin wall, with a further impact for its other side.

    Raises
    ------
    TypeError, ValueError
        For what is no function, or another direction.

    Examples
    --------
    >>> wall = Impact(lambda t, x, p: 1.0 - x[0], lambda t, x, p: (x[0], -0.8 * x[1]))
    >>> wall.guard(0.0, (1.0, 2.0), None), wall.reset(0.0, (1.0, 2.0), None)
    (0.0, (1.0, -1.6))
    """

    guard: StateFunction
    reset: StateFunction
    direction: int = -1
    solid: bool = True

    def __post_init__(self) -> None:
        for name in ("guard", "reset"):
            if not callable(getattr(self, name)):
                raise TypeError(f"{name}={getattr(self, name)!r}: give a function {name}(t, x, p)")
        one_of("direction", self.direction, (-1, 1))


_LAST = 2.0  # mark of an end of orbits; an impact is marked by 1 where it is solid, by 0 where it is not


def _unchanged(t: float, x: Sequence[float], p: Any) -> Sequence[float]:
    return x


@functools.lru_cache(maxsize=256)
def joined(impacts: tuple[Impact, ...], ends: tuple[StateFunction, ...] = ()) -> StateFunction | None:
    """Return one function of all guards, falling, each with 1 if solid and the state after the impact; None if none.

    Behind them are the guards of ends, which leave the state as it is.  It is the same one every time, so that systems
    with other parameters share what is compiled.
    """
    function: StateFunction | None = None
    for impact in impacts:
        function = _followed(function, impact.guard, impact.reset, -float(impact.direction), float(impact.solid))
    for guard in ends:
        function = _followed(function, guard, _unchanged, -1.0, _LAST)
    return function


def _followed(
    before: StateFunction | None, guard: StateFunction, reset: StateFunction, sign: float, solid: float
) -> StateFunction:
    if before is None:
        return lambda t, x, p: (sign * guard(t, x, p), solid, *reset(t, x, p))
    return lambda t, x, p: (*before(t, x, p), sign * guard(t, x, p), solid, *reset(t, x, p))


def try_impact(k: int, impact: Impact, period: float, axes: Sequence[Coordinate], parameters: Any) -> None:
    """Call the guard and the reset of the k-th impact of a system; check what they return, and their angles."""
    place = trial_state(len(axes))
    for name, count in (("guard", 1), ("reset", len(axes))):
        what, function = f"impacts[{k}].{name}", getattr(impact, name)
        for found in _tried(what, function, PLACES[0] * period, place, parameters):
            values = np.atleast_1d(np.array(found, dtype=object))
            if len(values) != count or not all(isinstance(v, int | float | np.number) for v in values):
                returned = "a number" if name == "guard" else f"the {count} state variables after the impact"
                raise ValueError(f"{what} returns {shown(found)}: return {returned}")
            check_periodic(what, in_time(function, place, parameters), period, REMEDY)
    for fraction, (j, c) in itertools.product(PLACES, enumerate(axes)):
        if c.period is not None:
            there = (*place[:j], place[j] + c.period, *place[j + 1 :])
            _try_turn(k, impact, fraction * period, place, there, (j, c, c.period), parameters)


def check_ends(ends: Any, form: str, arguments: tuple[Any, ...]) -> dict[str, Callable[..., Any]]:
    """Check guards of ends by name: functions of some arguments that return a number."""
    check_mapping("ends", ends, "of names to guards, such as {'capsized': lambda t, x, p: abs(x[0]) - 1.5}")
    if len(ends) > MOST_ENDS:
        raise ValueError(f"ends has {len(ends)} guards: give at most {MOST_ENDS}")
    for name, guard in ends.items():
        label("ends", name)
        if not callable(guard):
            raise TypeError(
                f"ends[{name!r}]={shown(guard)}: give a function guard({form}) that is positive beyond the end"
            )
        for found in _tried(f"ends[{name!r}]", guard, *arguments):
            if np.ndim(found) or isinstance(found, bool | np.bool) or not isinstance(found, int | float | np.number):
                raise ValueError(
                    f"ends[{name!r}] returns {shown(found)}: return a number that is positive beyond the end, such as "
                    "x[0] - 2.0 for x[0] > 2.0"
                )
    return dict(ends)


def _tried(what: str, function: Callable[..., Any], *arguments: Any) -> tuple[Any, ...]:
    """Return (value,) of a function at some arguments, the last but one a state; () outside of its domain."""
    try:
        return (called_twice(what, function, *arguments[:-2], as_state(function, arguments[-2]), arguments[-1]),)
    except ImpureError:
        raise
    except (AttributeError, IndexError, TypeError) as error:
        raise ValueError(f"{what} fails at {arguments[-2]}: {error}") from error
    except Exception:
        return ()


def in_time(function: StateFunction, place: tuple[float, ...], parameters: Any) -> InTime:
    """Return a guard or a reset as a function of time, at one state."""
    return lambda t: tuple(np.atleast_1d(function(t, as_state(function, place), parameters)))


def _try_turn(
    k: int,
    impact: Impact,
    t: float,
    here: tuple[float, ...],
    there: tuple[float, ...],
    angle: tuple[int, Coordinate, float],
    parameters: Any,
) -> None:
    """Check that an impact is the same one period of an angle further on."""
    j, c, turn = angle
    try:
        guards = [(float(np.squeeze(impact.guard(t, as_state(impact.guard, x), parameters))),) for x in (here, there)]
        before, after = (
            tuple(map(float, impact.reset(t, as_state(impact.reset, x), parameters))) for x in (here, there)
        )
    except Exception:
        return  # outside the domain of a function
    resets = [before, (*after[:j], after[j] - round((after[j] - before[j]) / turn) * turn, *after[j + 1 :])]
    for name, (first, further) in (("guard", guards), ("reset", resets)):
        if differ(first, further):
            raise ValueError(
                f"impacts[{k}].{name} is {short(first)} and one period of {c.name} further on {short(further)}, but an "
                "angle meets it in every full rotation: write it with functions of that period, such as sin; or, where "
                f"walls let {c.name} make no full rotation, give the name alone as its coordinate, and a wall on "
                "either side"
            )
