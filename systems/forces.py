"""Combination of the effects of a scene, channel by channel, for the equation of motion of a body."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from cellmap.maps.system import StateFunction

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
    joint : callable or None
        ``joint(t, angle, rate, sign, p)`` with the sign of the joint's angular velocity, which is used only with dry
        friction or drag.
    rubs : bool
        Whether the angular velocities of the joints are switching functions.
    switches : callable or None
        Switching functions ``f(t, x, p)``.
    weight : callable or None
        ``weight(t, p)``: the steady part of `vertical`, without signs.
    stored, place : callable or None
        As in :class:`Terms`.
    """

    joints: int
    vertical: FieldTerm | None
    horizontal: FieldTerm | None
    torque: FieldTerm | None
    joint: RubbingTerm | None
    rubs: bool
    switches: StateFunction | None
    weight: FieldTerm | None
    stored: StoredTerm | None
    place: PlaceTerm | None


def combined(terms: Sequence[Terms], joints: int) -> Forces:
    """Return the forces of effects with the given terms on a body with the given number of joints."""
    rubs = any(term.rubbing is not None for term in terms)
    switches = _joint_rates(joints) if rubs else None
    place: PlaceTerm | None = None
    fields: dict[str, list[FieldTerm]] = {"vertical": [], "horizontal": [], "torque": []}
    joint: list[RubbingTerm] = []
    signs = joints if rubs else 0
    for term in terms:
        for channel, summands in fields.items():
            if (field := getattr(term, channel)) is not None:
                summands.append(_signed(field, signs, signs + len(term.clocks)))
        signs += len(term.clocks)
        for clock in term.clocks:
            switches = _followed(switches, clock)
        if term.joint is not None:
            joint.append(_unsigned(term.joint))
        if term.rubbing is not None:
            joint.append(term.rubbing)
        if term.place is not None:
            place = term.place if place is None else _moved(place, term.place)
    return Forces(
        joints=joints,
        **{channel: _total(summands) for channel, summands in fields.items()},
        joint=_total(joint),
        rubs=rubs,
        switches=switches,
        weight=_total([t.vertical for t in terms if t.vertical is not None and t.period is None and not t.clocks]),
        stored=_total([t.stored for t in terms if t.stored is not None]),
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


def _unsigned(joint: JointTerm) -> RubbingTerm:
    def smooth(t: float, angle: float, rate: float, sign: float, p: Any) -> float:
        return joint(t, angle, rate, p)

    return smooth


def _joint_rates(joints: int) -> StateFunction:
    def rates(t: float, x: Sequence[float], p: Any) -> tuple[float, ...]:
        return (x[joints], *[x[i] - x[i - 1] for i in range(joints + 1, 2 * joints)])

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
