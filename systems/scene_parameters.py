"""Parameters of a scene: names that tell its effects apart, and terms that read parameters by these names."""

from __future__ import annotations

import functools
import re
from collections import Counter, namedtuple
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from .effects import Effect, JointTerm, PeriodTerm, RubbingTerm, Terms
from .forces import Acting
from .quantities import Part

Names = Mapping[str, str]
"""Name in the scene of each parameter of an effect."""


def names_in_scene(body: Part, effects: Sequence[Effect]) -> list[Names]:
    """Return the names of the parameters of effects in a scene.

    A parameter has its own name.  Where an effect shares a name with the body or with another effect, all of its names
    get the kind of the effect as prefix, such as ``vertical_drive_amplitude``, and among effects of one kind its number
    too, such as ``vertical_drive_2_amplitude``.  The names depend on which effects are given, and not on their values.
    """
    owners = Counter(name for part in (body, *effects) for name in part.parameters)
    kinds = Counter(map(_kind, effects))
    met: Counter[str] = Counter()
    found: list[Names] = []
    for effect in effects:
        kind = _kind(effect)
        met[kind] += 1
        clashes = any(owners[name] > 1 for name in effect.parameters)
        prefix = f"{kind}_{met[kind]}_" if kinds[kind] > 1 else f"{kind}_"
        found.append({name: prefix + name if clashes else name for name in effect.parameters})
    for name, count in Counter([*body.parameters, *(name for names in found for name in names.values())]).items():
        if count > 1:
            raise ValueError(f"effects: several parameters are called {name!r}, even with prefixes; rename a field")
    return found


def _kind(effect: Effect) -> str:
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", type(effect).__name__.strip("_")).lower()


def acting(effect: Effect, names: Names, joints: int) -> list[tuple[Acting, dict[str, float]]]:
    """Return how an effect acts in a scene, at all joints or at one, and the scene's parameters for that.

    An effect with a number for each joint acts at each joint on its own, and not at all where it is zero.
    """
    each = effect.of_each_joint
    if not each:
        return [_acting(effect, names, None)]
    for name in each:
        if len(getattr(effect, name)) != joints:
            raise ValueError(
                f"{name}={getattr(effect, name)!r}: give one number, or one for each of the {joints} joints of the body"
            )
    if effect.terms != Terms(
        joint=effect.terms.joint,
        rubbing=effect.terms.rubbing,
        stored=effect.terms.stored,
        winds=effect.terms.winds,
    ):
        raise ValueError(
            f"{each[0]}={getattr(effect, each[0])!r}: give one number, as the effect acts on the pivot too"
        )
    at_joints = [(i, effect.at_joint(i)) for i in range(joints)]
    return [
        _acting(single, {n: names[f"{n}_{i + 1}" if n in each else n] for n in single.parameters}, i)
        for i, single in at_joints
        if not single.vanishes
    ]


def _acting(effect: Effect, names: Names, joint: int | None) -> tuple[Acting, dict[str, float]]:
    terms = effect.terms
    if any(own != name for own, name in names.items()):
        terms = renamed(terms, tuple(names.items()))
    return Acting(terms, joint), {names[own]: value for own, value in effect.parameters.items()}


@functools.cache
def renamed(terms: Terms, names: tuple[tuple[str, str], ...]) -> Terms:
    """Return terms that find their parameters by other names, given as pairs of their own name and that of the scene.

    The same terms and names give the same functions: kernels are kept by the identity of their right-hand side.
    """
    view = _view(names)
    changes: dict[str, Any] = {"clocks": tuple(_of_time(clock, view) for clock in terms.clocks)}
    for channel, reading in _READING.items():
        if (function := getattr(terms, channel)) is not None:
            changes[channel] = reading(function, view)
    return replace(terms, **changes)


def _view(names: tuple[tuple[str, str], ...]) -> Callable[[Any], Any]:
    """Return the parameters of an effect, by its own names, from those of the scene."""
    record = namedtuple("Parameters", [own for own, _ in names])  # type: ignore[misc]  # names are known at run time
    values: Callable[[Any], tuple[float, ...]] = _no_values
    for _, name in names:
        values = _followed(values, name)

    def view(p: Any) -> Any:
        return record(*values(p))

    return view


def _no_values(p: Any) -> tuple[float, ...]:
    return ()


def _followed(before: Callable[[Any], tuple[float, ...]], name: str) -> Callable[[Any], tuple[float, ...]]:
    def values(p: Any) -> tuple[float, ...]:
        return (*before(p), getattr(p, name))

    return values


def _of_time(function: Callable[..., Any], view: Callable[[Any], Any]) -> Callable[..., Any]:
    """Let a function of one argument, the parameters and perhaps signs read parameters by their names in the scene."""

    def term(t: float, p: Any, *signs: float) -> Any:
        return function(t, view(p), *signs)

    return term


def _of_joint(function: JointTerm, view: Callable[[Any], Any]) -> JointTerm:
    def term(t: float, angle: float, rate: float, p: Any) -> float:
        return function(t, angle, rate, view(p))

    return term


def _of_rubbing(function: RubbingTerm, view: Callable[[Any], Any]) -> RubbingTerm:
    def term(t: float, angle: float, rate: float, sign: float, p: Any) -> float:
        return function(t, angle, rate, sign, view(p))

    return term


def _of_parameters(function: PeriodTerm, view: Callable[[Any], Any]) -> PeriodTerm:
    def term(p: Any) -> float:
        return function(view(p))

    return term


_READING: dict[str, Callable[..., Any]] = {
    **dict.fromkeys(("vertical", "horizontal", "torque", "place", "stored"), _of_time),
    "joint": _of_joint,
    "rubbing": _of_rubbing,
    "period": _of_parameters,
}
