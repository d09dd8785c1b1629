"""Impacts: events at which the state of a system jumps."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from .._lib.checks import one_of

StateFunction = Callable[[float, Sequence[float], Any], Any]


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


@functools.lru_cache(maxsize=256)
def joined(impacts: tuple[Impact, ...]) -> StateFunction | None:
    """Return one function of all guards, falling, each with 1 if solid and the state after the impact; None if none.

    It is the same one every time, so that systems with other parameters share what is compiled.
    """
    function: StateFunction | None = None
    for impact in impacts:
        function = _followed(function, impact.guard, impact.reset, -float(impact.direction), float(impact.solid))
    return function


def _followed(
    before: StateFunction | None, guard: StateFunction, reset: StateFunction, sign: float, solid: float
) -> StateFunction:
    if before is None:
        return lambda t, x, p: (sign * guard(t, x, p), solid, *reset(t, x, p))
    return lambda t, x, p: (*before(t, x, p), sign * guard(t, x, p), solid, *reset(t, x, p))
