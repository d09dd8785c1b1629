"""Scenes: a body and the effects that act on it become a forced system.

The right-hand side consists of the terms of the effects that are present.  An absent effect contributes no term, not
even one with a factor of zero.  The same body with effects of the same kinds has the same right-hand side, whatever the
values of the parameters, so that a parameter sweep compiles nothing.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cellmap import Coordinate, ForcedSystem
from cellmap._compiled.codegen.trace import parameter_record
from cellmap.maps.system import RightHandSide, StateFunction

from .effects import Effect, PlaceTerm, Terms
from .forces import Forces, combined
from .parts import RATE, Part
from .units import Units, in_units

TipsTerm = Callable[[Sequence[float], Any], tuple[float, ...]]


@dataclass(frozen=True)
class Body(Part):
    """Body with its equation of motion.

    The state of a body with n joints is n angles from the downward vertical, counter-clockwise and absolute, then their
    n angular velocities.  Functions are composed from forces and contain no values of the body: they read parameters as
    ``p.name``.
    """

    @property
    def joints(self) -> int:
        """Number of joints; bodies of one kind with equal numbers share their right-hand side."""
        return 1

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Angles, then their angular velocities."""
        raise NotImplementedError

    @staticmethod
    def compose(forces: Forces) -> RightHandSide:
        """Return the right-hand side ``f(t, x, p, s=())`` with the forces that are present."""
        raise NotImplementedError

    @staticmethod
    def tips(joints: int) -> TipsTerm | None:
        """Return the positions ``f(x, p)`` of the parts (x1, y1, ...) relative to the pivot, if they are known."""
        return None

    @staticmethod
    def energy(forces: Forces) -> StateFunction | None:
        """Return kinetic and potential energy ``f(t, x, p)`` in the frame of the pivot, if they are known."""
        return None


def scene(
    body: Body, *effects: Effect, period: float | None = None, name: str = "", units: Units | None = None
) -> ForcedSystem:
    """Return the system of a body and the effects on it.

    Parameters
    ----------
    body : Body
        The moving body.
    *effects : Effect
        Effects on it, each kind at most once.  An effect of zero strength is omitted; a drive of zero amplitude still
        sets the period.
    period : float, optional
        Sampling period (s); by default the period of the only periodic effect.
    name : str, optional
        Name for files and plots; by default the kinds of the body and of the effects.
    units : Units, optional
        Units of length, time and mass of the system; by default those of the arguments.  With other units, its
        coordinates are pure numbers.

    Returns
    -------
    ForcedSystem
        System whose parameters are those of the body and of the effects that are present.  Its switching functions are
        the angular velocities of the joints, if there is dry friction or drag, then those of the drive.  Its outputs
        are "positions", the coordinates x0, y0, x1, y1, ... of the pivot and of the parts of the body (m, y up, where
        the pivot is known), and "energy", kinetic and potential, in the frame of the pivot.

    Raises
    ------
    TypeError
        For something that is not a body or not an effect.
    ValueError
        For two parts with a parameter of the same name, or if the period does not follow from the effects.

    Examples
    --------
    >>> from systems.drives import VerticalDrive
    >>> from systems.effects import Gravity
    >>> from systems.pendulum import Pendulum
    >>> scene(Pendulum(length=1.0), Gravity(9.8), VerticalDrive(amplitude=0.0, frequency=2.0))
    ForcedSystem(Pendulum, Gravity: length=1, gravity=9.8; period 0.5)
    """
    if not isinstance(body, Body):
        raise TypeError(f"body={body!r}: give a body, such as Pendulum(length=1.0)")
    for effect in effects:
        if not isinstance(effect, Effect):
            raise TypeError(f"effects hold {effect!r}: give effects, such as Gravity(9.8)")
    coordinates = body.coordinates
    if units is not None:
        body, effects = in_units(body, units), tuple(in_units(effect, units) for effect in effects)
        period = None if period is None else period * units.of(RATE)
        coordinates = tuple(
            Coordinate(c.name, "" if c.period is None else c.unit, c.period, c.lower) for c in coordinates
        )
    present = [effect for effect in effects if not effect.vanishes]
    if not all(effect.terms.winds for effect in present):
        coordinates = tuple(Coordinate(c.name, c.unit) for c in coordinates)
    made = _composed(body.compose, body.tips, body.energy, body.joints, tuple(effect.terms for effect in present))
    return ForcedSystem(
        made.rhs,
        _parameters(body, *present),
        period=_period(effects) if period is None else period,
        coordinates=coordinates,
        name=name or ", ".join(type(part).__name__ for part in (body, *present)),
        switches=made.switches,
        outputs=made.outputs,
    )


@dataclass(frozen=True, eq=False)
class _Functions:
    rhs: RightHandSide
    switches: StateFunction | None
    outputs: Mapping[str, StateFunction]


@functools.cache
def _composed(
    compose: Callable[[Forces], RightHandSide],
    tips_of: Callable[[int], TipsTerm | None],
    energy_of: Callable[[Forces], StateFunction | None],
    joints: int,
    terms: tuple[Terms, ...],
) -> _Functions:
    """Compose once for each structure: kernels are kept by the identity of their right-hand side."""
    forces = combined(terms, joints)
    outputs: dict[str, StateFunction] = {}
    if (tips := tips_of(joints)) is not None:
        outputs["positions"] = _positions(forces.place or _at_rest, tips)
    if (energy := energy_of(forces)) is not None:
        outputs["energy"] = energy
    return _Functions(compose(forces), forces.switches, outputs)


def _positions(place: PlaceTerm, tips: TipsTerm) -> StateFunction:
    def positions(t: float, x: Sequence[float], p: Any) -> tuple[float, ...]:
        pivot, relative = place(t, p), tips(x, p)
        return (*pivot, *[relative[i] + pivot[i % 2] for i in range(len(relative))])

    return positions


def _at_rest(t: float, p: Any) -> tuple[float, float]:
    return 0.0, 0.0


def _parameters(*parts: Part) -> dict[str, float]:
    owner: dict[str, str] = {}
    for part in parts:
        for name in part.parameters:
            if name in owner:
                raise ValueError(
                    f"{owner[name]} and {type(part).__name__} both set the parameter {name!r}: "
                    "a scene takes each kind of effect once, and one drive"
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
