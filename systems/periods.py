"""Period of a scene: the shortest one that its periodic effects have in common."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from fractions import Fraction
from math import lcm
from types import SimpleNamespace
from typing import Any

from .effects import Effect, PeriodTerm

_MOST = 1000  # periods of an effect in that of the scene
_ROUNDING = 1e-12


def common_period(effects: Sequence[Effect], terms: Sequence[PeriodTerm | None]) -> float | Callable[[Any], float]:
    """Return the shortest common period of the periodic effects of a scene.

    Parameters
    ----------
    effects : sequence of Effect
        The effects that are given.
    terms : sequence of callable or None
        Period ``f(p)`` of each by the parameters of the scene; None for an effect that is absent.

    Returns
    -------
    float or callable
        A function of the parameters, or a number where all periodic effects are absent.

    Raises
    ------
    ValueError
        If there is no periodic effect, or no common period of at most 1,000 periods of each.
    """
    own = [(e.terms.period, SimpleNamespace(**e.parameters), f) for e, f in zip(effects, terms, strict=True)]
    periodic = [(period(p), in_scene) for period, p, in_scene in own if period is not None]
    if not periodic:
        raise ValueError(
            "period=None: it follows from the periodic effects, and there are none. Give period= in the unit of time "
            "(any positive number for an unforced scene)"
        )
    length, present = next((pair for pair in periodic if pair[1] is not None), periodic[0])
    count = lcm(*(_numerator(other / length) for other, _ in periodic))
    if not 0 < count <= _MOST:
        lengths = ", ".join(f"{other:g}" for other, _ in periodic)
        raise ValueError(
            f"period=None: the effects have the periods {lengths}, with no common period of at most {_MOST} of each. "
            "Give frequencies with ratios of small whole numbers, or period="
        )
    if present is None:
        return count * length
    return present if count == 1 else _multiple(present, count)


def _numerator(ratio: float) -> int:
    """Return the numerator of a ratio of small whole numbers; 0 where it is none."""
    near = Fraction(ratio).limit_denominator(_MOST)
    return near.numerator if abs(near - Fraction(ratio)) <= _ROUNDING * ratio else 0


@functools.cache
def _multiple(period: PeriodTerm, count: int) -> Callable[[Any], float]:
    def several(p: Any) -> float:
        return count * period(p)

    return several
