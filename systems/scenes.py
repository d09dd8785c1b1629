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
from cellmap.maps import RightHandSide, StateFunction
from cellmap.utils import finite_number, shown, text

from .effects import Effect, PeriodTerm, PlaceTerm
from .forces import Acting, Forces, combined
from .periods import common_period
from .quantities import RATE, Part
from .scene_parameters import acting, names_in_scene
from .units import Units, in_units, parameter_units

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
        Effects on it, any number of each kind.  An effect of zero strength is omitted, at each joint on its own; a
        drive of zero amplitude still counts for the period.
    period : float, optional
        Sampling period (s); by default the shortest common period of all drives.
    name : str, optional
        Name for files and plots; by default the kinds of the body and of the effects.
    units : Units, optional
        Units of length, time and mass of the system; by default those of the arguments.  With other units, its
        coordinates are pure numbers.

    Returns
    -------
    ForcedSystem
        System whose parameters are those of the body and of the effects that are present, by the same names.  Where an
        effect shares a name with another effect or with the body, its names get its kind as a prefix, such as
        ``vertical_drive_amplitude`` and ``torque_drive_frequency``, and among effects of one kind its number too, such
        as ``vertical_drive_2_amplitude``.  The switching functions are the angular velocities of the joints with dry
        friction or drag, then those of the drives.  The outputs
        are "positions", the coordinates x0, y0, x1, y1, ... of the pivot and of the parts of the body (m, y up, where
        the pivot is known), and "energy", kinetic and potential, in the frame of the pivot.

    Raises
    ------
    TypeError
        For something that is not a body or not an effect.
    ValueError
        If the period does not follow from the effects, for a number of values that is not that of the joints, and for
        parameters that have the same name even with prefixes.

    Examples
    --------
    >>> from systems import Gravity, Pendulum, TorqueDrive, VerticalDrive
    >>> scene(Pendulum(length=1.0), Gravity(9.8), VerticalDrive(amplitude=0.0, frequency=2.0))
    ForcedSystem(Pendulum, Gravity: length=1, gravity=9.8; period 0.5)
    >>> both = scene(Pendulum(1.0), VerticalDrive(0.1, frequency=2.0), TorqueDrive(3.0, frequency=1.0))
    >>> both.params["vertical_drive_frequency"], both.params["torque_drive_frequency"], both.length
    (2.0, 1.0, 1.0)
    """
    if not isinstance(body, Body):
        raise TypeError(f"body={shown(body)}: give a body, such as Pendulum(length=1.0)")
    for effect in effects:
        if not isinstance(effect, Effect):
            raise TypeError(f"effects={shown(effect)}: give effects, such as Gravity(9.8)")
    title = text("name", name)
    period = None if period is None else finite_number("period", period, above=0.0)
    coordinates = body.coordinates
    if units is not None:
        body, effects = in_units(body, units), tuple(in_units(effect, units) for effect in effects)
        period = None if period is None else period * units.of(RATE)
        coordinates = tuple(
            Coordinate(c.name, "" if c.period is None else c.unit, c.period, c.lower) for c in coordinates
        )
    acts: list[Acting] = []
    params = body.parameters
    own_periods: list[PeriodTerm | None] = []
    for effect, names in zip(effects, names_in_scene(body, effects), strict=True):
        at_joints = [] if effect.vanishes else acting(effect, names, body.joints)
        acts += [act for act, _ in at_joints]
        own_periods.append(at_joints[0][0].terms.period if at_joints else None)
        for _, values in at_joints:
            params |= values
    present = [effect for effect in effects if not effect.vanishes]
    if not all(effect.terms.winds for effect in present):
        coordinates = tuple(Coordinate(c.name, c.unit) for c in coordinates)
    made = _composed(body.compose, body.tips, body.energy, body.joints, tuple(acts))
    return ForcedSystem(
        made.rhs,
        params,
        period=common_period(effects, own_periods) if period is None else period,
        coordinates=coordinates,
        name=title or ", ".join(type(part).__name__ for part in (body, *present)),
        switches=made.switches,
        outputs=made.outputs,
        parameter_units={} if units is not None else parameter_units(params),
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
    effects: tuple[Acting, ...],
) -> _Functions:
    """Compose once for each structure: kernels are kept by the identity of their right-hand side."""
    forces = combined(effects, joints)
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
