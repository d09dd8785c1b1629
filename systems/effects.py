"""Effects on a body: parameters and terms in the equation of motion.

A new effect is one frozen dataclass.  Its fields are parameters of the right-hand side, by the same names.  Its terms
are plain functions; they read parameters as ``p.name`` and hold no values themselves, so that scenes of the same
effects share one compiled kernel.  Drives are in :mod:`systems.drives`.

Terms of a joint are angular accelerations referred to the unit inertia of the body: m l^2 of a point mass, the moment
of inertia of a compound pendulum, m_1 l_1^2 of a chain.  They act at every joint of a chain, on the relative angle and
the relative angular velocity.  Damping, drag, friction and springs take one number for all joints, or a sequence with
a number for each: ``ViscousDamping((5.0, 2.0))`` has the parameters ``damping_1`` and ``damping_2``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

from .quantities import ACCELERATION, ANGULAR_ACCELERATION, NUMBER, RATE, Part, quantity

FieldTerm = Callable[..., float]
JointTerm = Callable[[float, float, float, Any], float]
RubbingTerm = Callable[[float, float, float, float, Any], float]
StoredTerm = Callable[[float, Any], float]
PlaceTerm = Callable[[float, Any], tuple[float, float]]
PeriodTerm = Callable[[Any], float]


@dataclass(frozen=True)
class Terms:
    """Contributions of effects to an equation of motion, channel by channel; None where there is none.

    Parameters
    ----------
    vertical : callable or None
        ``vertical(t, p)``: weight per mass in the frame of the pivot (m/s^2), positive down.  Gravity, or the upward
        acceleration of the pivot.  Where the effect is steady it counts in the potential energy.
    horizontal : callable or None
        ``horizontal(t, p)``: acceleration of the pivot to the right (m/s^2).
    torque : callable or None
        ``torque(t, p)``: angular acceleration about the first joint (rad/s^2).
    joint : callable or None
        ``joint(t, angle, rate, p)``: angular acceleration of a link about its joint (rad/s^2), from the angle (rad) and
        the angular velocity (rad/s) of the joint.
    rubbing : callable or None
        ``rubbing(t, angle, rate, sign, p)``: the same with the sign of the joint's angular velocity, in which it is
        affine.
    stored : callable or None
        ``stored(angle, p)``: energy stored in a joint per unit inertia (rad^2/s^2).
    place : callable or None
        ``place(t, p)``: displacement (x, y) of the pivot (m), y up.
    period : callable or None
        ``period(p)``: period of the effect (s); None for a steady effect.
    clocks : tuple of callable, optional
        ``clock(t, p)``: functions of time at whose zeros `vertical`, `horizontal` and `torque` or their derivatives are
        discontinuous.  These three then take the signs of the clocks as further arguments after p.
    winds : bool, optional
        Whether the effect is invariant under full rotations of a joint; if not, angles are not wrapped.
    """

    vertical: FieldTerm | None = None
    horizontal: FieldTerm | None = None
    torque: FieldTerm | None = None
    joint: JointTerm | None = None
    rubbing: RubbingTerm | None = None
    stored: StoredTerm | None = None
    place: PlaceTerm | None = None
    period: PeriodTerm | None = None
    clocks: tuple[FieldTerm, ...] = ()
    winds: bool = True


@dataclass(frozen=True)
class Effect(Part):
    """Effect.  Effects of the same kind return the same functions as terms, whatever the parameters."""

    @property
    def terms(self) -> Terms:
        """Terms in the equation of motion."""
        raise NotImplementedError

    @property
    def vanishes(self) -> bool:
        """Whether the effect is zero, so that a scene omits it."""
        raise NotImplementedError

    @property
    def of_each_joint(self) -> tuple[str, ...]:
        """Names of the fields that have a number for each joint."""
        own = [f.name for f in fields(self) if f.metadata.get("per_joint")]
        return tuple(name for name in own if isinstance(getattr(self, name), tuple))

    def at_joint(self, joint: int) -> Self:
        """Return the effect with the numbers of one joint, counted from 0, for all joints."""
        return replace(self, **{name: getattr(self, name)[joint] for name in self.of_each_joint})


def _is_zero(value: float | Sequence[float]) -> bool:
    return not any(value) if isinstance(value, tuple) else value == 0.0


@dataclass(frozen=True)
class Gravity(Effect):
    """Uniform gravity.

    Parameters
    ----------
    gravity : float
        Acceleration of free fall (m/s^2), positive downward.

    Examples
    --------
    >>> Gravity(9.8).parameters
    {'gravity': 9.8}
    """

    gravity: float = quantity(ACCELERATION)

    @property
    def terms(self) -> Terms:
        """Weight."""
        return Terms(vertical=_weight)

    @property
    def vanishes(self) -> bool:
        """Whether gravity is absent."""
        return self.gravity == 0.0


def _weight(t: float, p: Any) -> float:
    return p.gravity


@dataclass(frozen=True)
class ViscousDamping(Effect):
    """Viscous damping, proportional to the angular velocity r of the joint: -damping r.

    Parameters
    ----------
    damping : float or sequence of float
        Angular deceleration per angular velocity (1/s), at least 0; one number, or one for each joint.

    Examples
    --------
    >>> ViscousDamping(-1.0)
    Traceback (most recent call last):
    ...
    ValueError: damping=-1.0: give a number of at least 0
    """

    damping: float | Sequence[float] = quantity(RATE, per_joint=True, at_least=0.0)

    @property
    def terms(self) -> Terms:
        """Friction at the joint."""
        return Terms(joint=_viscous)

    @property
    def vanishes(self) -> bool:
        """Whether the joint is frictionless."""
        return _is_zero(self.damping)


def _viscous(t: float, angle: float, rate: float, p: Any) -> float:
    return -p.damping * rate


@dataclass(frozen=True)
class QuadraticDrag(Effect):
    """Quadratic drag in the angular velocity r of the joint: -drag r abs(r).

    The right-hand side contains -drag r^2 s with the sign s of the angular velocity, a switching function of the joint,
    and is smooth on both sides of the switching surface.

    Parameters
    ----------
    drag : float or sequence of float
        Angular deceleration per square of the angular velocity (a pure number), at least 0; one number, or one for each
        joint.

    Examples
    --------
    >>> QuadraticDrag(0.1).parameters
    {'drag': 0.1}
    """

    drag: float | Sequence[float] = quantity(NUMBER, per_joint=True, at_least=0.0)

    @property
    def terms(self) -> Terms:
        """Drag at the joint."""
        return Terms(rubbing=_drag)

    @property
    def vanishes(self) -> bool:
        """Whether the joint is frictionless."""
        return _is_zero(self.drag)


def _drag(t: float, angle: float, rate: float, sign: float, p: Any) -> float:
    return -p.drag * (rate * rate) * sign


@dataclass(frozen=True)
class DryFriction(Effect):
    """Coulomb friction: -friction s with the sign s of the joint's angular velocity, and sticking where it is zero.

    The angular velocity of the joint is a switching function.  While the joint sticks, s takes the value between -1 and
    1 that balances the other torques.

    Parameters
    ----------
    friction : float or sequence of float
        Angular deceleration (rad/s^2), at least 0; one number, or one for each joint.

    References
    ----------
    Coulomb, *Theorie des machines simples* (1785).

    Examples
    --------
    >>> DryFriction(friction=-1.0)
    Traceback (most recent call last):
    ...
    ValueError: friction=-1.0: give a number of at least 0
    """

    friction: float | Sequence[float] = quantity(ANGULAR_ACCELERATION, per_joint=True, at_least=0.0)

    @property
    def terms(self) -> Terms:
        """Friction at the joint."""
        return Terms(rubbing=_dry)

    @property
    def vanishes(self) -> bool:
        """Whether the joint is frictionless."""
        return _is_zero(self.friction)


def _dry(t: float, angle: float, rate: float, sign: float, p: Any) -> float:
    return -p.friction * sign


@dataclass(frozen=True)
class TorsionSpring(Effect):
    """Spring at the joint: -stiffness (angle - rest).

    The torque depends on the number of full rotations, so that angles are not wrapped.

    Parameters
    ----------
    stiffness : float or sequence of float
        Angular acceleration per angle (1/s^2); one number, or one for each joint.
    rest : float or sequence of float, optional
        Angle of the relaxed joint (rad); one number, or one for each joint.

    Examples
    --------
    >>> TorsionSpring(stiffness=4.0).parameters
    {'stiffness': 4.0, 'rest': 0.0}
    """

    stiffness: float | Sequence[float] = quantity(ANGULAR_ACCELERATION, per_joint=True)
    rest: float | Sequence[float] = quantity(NUMBER, per_joint=True, default=0.0)

    @property
    def terms(self) -> Terms:
        """Torque of the spring."""
        return Terms(joint=_spring, stored=_stored, winds=False)

    @property
    def vanishes(self) -> bool:
        """Whether there is no spring."""
        return _is_zero(self.stiffness)


def _spring(t: float, angle: float, rate: float, p: Any) -> float:
    return -p.stiffness * (angle - p.rest)


def _stored(angle: float, p: Any) -> float:
    return 0.5 * p.stiffness * (angle - p.rest) ** 2


@dataclass(frozen=True)
class ConstantTorque(Effect):
    """Steady torque at the first joint, counter-clockwise.  It is not included in the energy.

    Parameters
    ----------
    constant_torque : float
        Angular acceleration (rad/s^2).

    Examples
    --------
    >>> ConstantTorque(2.0).parameters
    {'constant_torque': 2.0}
    """

    constant_torque: float = quantity(ANGULAR_ACCELERATION)

    @property
    def terms(self) -> Terms:
        """Torque at the first joint."""
        return Terms(torque=_constant_torque)

    @property
    def vanishes(self) -> bool:
        """Whether there is no torque."""
        return self.constant_torque == 0.0


def _constant_torque(t: float, p: Any) -> float:
    return p.constant_torque
