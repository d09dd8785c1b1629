"""Scenes: a body and the effects that act on it become a forced system.

The right-hand side is put together from the effects that are present and from nothing else.  An absent effect leaves
nothing behind: no factor of zero, no branch, no sine.  The same body with effects of the same kinds has the same
right-hand side, whatever the values of the parameters, so a sweep compiles nothing.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from cellmap import Coordinate, ForcedSystem
from cellmap.codegen.trace import parameter_record
from cellmap.system import RightHandSide

from .effects import Effect, Part, Terms


@dataclass(frozen=True)
class Body(Part):
    """A body with its equation of motion."""

    coordinates: ClassVar[tuple[Coordinate, ...]]

    @staticmethod
    def compose(terms: Sequence[Terms]) -> RightHandSide:
        """Return the right-hand side with the terms of the effects that are present."""
        raise NotImplementedError


def scene(body: Body, *effects: Effect, period: float | None = None, name: str = "") -> ForcedSystem:
    """Return the system of a body and the effects on it.

    Parameters
    ----------
    body : Body
        What moves.
    *effects : Effect
        What acts on it, each kind at most once.  An effect of zero strength is left out; a drive of zero amplitude
        still sets the period.
    period : float, optional
        Time between two looks at the state; by default the period of the only effect that has one.
    name : str, optional
        Name for files and plots; by default the kinds of the body and of the effects.

    Returns
    -------
    ForcedSystem
        System whose parameters are those of the body and of the effects that are present.

    Raises
    ------
    TypeError
        For something that is not a body or not an effect.
    ValueError
        For two parts with a parameter of the same name, or where the period does not follow from the effects.

    Examples
    --------
    >>> from systems.effects import Gravity, VerticalDrive
    >>> from systems.pendulum import Pendulum
    >>> scene(Pendulum(length=1.0), Gravity(9.8), VerticalDrive(amplitude=0.0, frequency=2.0))
    ForcedSystem(Pendulum, Gravity: length=1, gravity=9.8; period 0.5)
    """
    if not isinstance(body, Body):
        raise TypeError(f"body={body!r}: give a body, such as Pendulum(length=1.0)")
    for effect in effects:
        if not isinstance(effect, Effect):
            raise TypeError(f"effects hold {effect!r}: give effects, such as Gravity(9.8)")
    present = [effect for effect in effects if not effect.vanishes]
    return ForcedSystem(
        _composed(body.compose, tuple(effect.terms for effect in present)),
        _parameters(body, *present),
        period=_period(effects) if period is None else period,
        coordinates=type(body).coordinates,
        name=name or ", ".join(type(part).__name__ for part in (body, *present)),
    )


def total(terms: Sequence[Callable[..., Any]]) -> Callable[..., Any]:
    """Return the sum of one or more terms as a function of the same arguments.

    Terms are nested and not looped over, so that a compiler without tracing meets plain calls of known functions.

    Examples
    --------
    >>> total([lambda t: t, lambda t: 10 * t])(2)
    22
    """
    *others, last = terms
    if not others:
        return last
    before = total(others)

    def both(*arguments: Any) -> Any:
        return before(*arguments) + last(*arguments)

    return both


@functools.cache
def _composed(compose: Callable[[Sequence[Terms]], RightHandSide], terms: tuple[Terms, ...]) -> RightHandSide:
    """Compose once for each structure: kernels are kept by the identity of their right-hand side."""
    return compose(terms)


def _parameters(*parts: Part) -> dict[str, float]:
    owner: dict[str, str] = {}
    for part in parts:
        for name in part.parameters:
            if name in owner:
                raise ValueError(
                    f"{owner[name]} and {type(part).__name__} both set the parameter {name!r}: "
                    "a scene takes each kind of effect once"
                )
            owner[name] = type(part).__name__
    return {name: value for part in parts for name, value in part.parameters.items()}


def _period(effects: tuple[Effect, ...]) -> float | Callable[[Any], float]:
    """Period of the effects: of a present one a function of its parameters, of a vanished one a number."""
    periodic = [effect for effect in effects if effect.terms.period is not None]
    if len(periodic) != 1:
        kinds = ", ".join(type(effect).__name__ for effect in periodic) or "none"
        raise ValueError(
            f"period=None: it follows from the effects where exactly one is periodic, and here these are: {kinds}. "
            "Give period= in the unit of time (any positive number for an unforced scene)"
        )
    (drive,) = periodic
    period = drive.terms.period
    assert period is not None
    return period(parameter_record(tuple(drive.parameters))(**drive.parameters)) if drive.vanishes else period
