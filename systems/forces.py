"""Combination of the effects of a scene, channel by channel, for the equation of motion of a body."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from cellmap.maps import StateFunction

from .effects import FieldTerm, JointTerm, PlaceTerm, RubbingTerm, StoredTerm, Terms


@dataclass(frozen=True)
class Forces:
    """Sums of the terms that are present; None where there are none.

    Functions of fields take the tuple s of all signs: those of the joints' angular velocities, if there is dry friction
    or drag, then those of the clocks.

    Parameters
    ----------
    joints : int
        Number of joints n.  The state is the n absolute angles, then the n angular velocities.
    vertical, horizontal, torque : callable or None
        ``f(t, p, s)``, as in :class:`Terms`.
    joint : tuple of callable or None
        For each joint ``f(t, angle, rate, sign, p)`` with the sign of the joint's angular velocity, which is used only
        with dry friction or drag.
    rubbing : tuple of int
        Joints with dry friction or drag: their angular velocities are the first switching functions, in this order.
    switches : callable or None
        Switching functions ``f(t, x, p)``.
    weight : callable or None
        ``weight(t, p)``: the steady part of `vertical`, without signs.
    stored : tuple of callable or None
        For each joint ``stored(angle, p)``, as in :class:`Terms`.
    place : callable or None
        As in :class:`Terms`.
    """

    joints: int
    vertical: FieldTerm | None
    horizontal: FieldTerm | None
    torque: FieldTerm | None
    joint: tuple[RubbingTerm | None, ...]
    rubbing: tuple[int, ...]
    switches: StateFunction | None
    weight: FieldTerm | None
    stored: tuple[StoredTerm | None, ...]
    place: PlaceTerm | None

    def sign_at(self, joint: int, s: Sequence[float]) -> float:
        """Return the sign of the angular velocity of a joint, out of all signs; 0 where nothing rubs."""
        return s[self.rubbing.index(joint)] if joint in self.rubbing else 0.0


@dataclass(frozen=True)
class Acting:
    """Terms of an effect in a scene, with the names of the scene's parameters.

    Parameters
    ----------
    terms : Terms
        The terms.
    joint : int or None
        The joint at which those of joints act; None for all joints.
    """

    terms: Terms
    joint: int | None = None

    def at(self, joint: int) -> bool:
        """Return whether terms of joints act at this one."""
        return self.joint is None or self.joint == joint


def combined(effects: Sequence[Acting], joints: int) -> Forces:
    """Return the forces of effects with the given terms on a body with the given number of joints."""
    at = [[effect.terms for effect in effects if effect.at(i)] for i in range(joints)]
    rubbing = tuple(i for i in range(joints) if any(term.rubbing is not None for term in at[i]))
    switches = _joint_rates(joints, rubbing) if rubbing else None
    place: PlaceTerm | None = None
    fields: dict[str, list[FieldTerm]] = {"vertical": [], "horizontal": [], "torque": []}
    signs = len(rubbing)
    terms = [effect.terms for effect in effects]
    for term in terms:
        for channel, summands in fields.items():
            if (field := getattr(term, channel)) is not None:
                summands.append(_signed(field, signs, signs + len(term.clocks)))
        signs += len(term.clocks)
        for clock in term.clocks:
            switches = _followed(switches, clock)
        if term.place is not None:
            place = term.place if place is None else _moved(place, term.place)
    return Forces(
        joints=joints,
        **{channel: _total(summands) for channel, summands in fields.items()},
        joint=tuple(_total([f for term in here for f in _of_joint(term)]) for here in at),
        rubbing=rubbing,
        switches=switches,
        weight=_total([t.vertical for t in terms if t.vertical is not None and t.period is None and not t.clocks]),
        stored=tuple(_total([t.stored for t in here if t.stored is not None]) for here in at),
        place=place,
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


def _total(terms: Sequence[Callable[..., Any]]) -> Callable[..., Any] | None:
    return total(terms) if terms else None


def _signed(field: FieldTerm, first: int, last: int) -> FieldTerm:
    """Let a field take its own signs out of all of them."""
    if first == last:

        def smooth(t: float, p: Any, s: Sequence[float]) -> float:
            return field(t, p)

        return smooth

    def jumping(t: float, p: Any, s: Sequence[float]) -> float:
        return field(t, p, *s[first:last])

    return jumping


def _of_joint(term: Terms) -> list[RubbingTerm]:
    smooth = [] if term.joint is None else [_unsigned(term.joint)]
    return smooth if term.rubbing is None else [*smooth, term.rubbing]


def _unsigned(joint: JointTerm) -> RubbingTerm:
    def smooth(t: float, angle: float, rate: float, sign: float, p: Any) -> float:
        return joint(t, angle, rate, p)

    return smooth


def _joint_rates(joints: int, rubbing: tuple[int, ...]) -> StateFunction:
    def rates(t: float, x: Sequence[float], p: Any) -> tuple[float, ...]:
        return tuple([x[joints + i] - x[joints + i - 1] if i else x[joints] for i in rubbing])

    return rates


def _followed(before: StateFunction | None, clock: FieldTerm) -> StateFunction:
    if before is None:

        def alone(t: float, x: Sequence[float], p: Any) -> tuple[float, ...]:
            return (clock(t, p),)

        return alone

    def followed(t: float, x: Sequence[float], p: Any) -> tuple[float, ...]:
        return (*before(t, x, p), clock(t, p))

    return followed


def _moved(one: PlaceTerm, other: PlaceTerm) -> PlaceTerm:
    def moved(t: float, p: Any) -> tuple[float, float]:
        (x, y), (u, v) = one(t, p), other(t, p)
        return x + u, y + v

    return moved
