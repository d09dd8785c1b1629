"""Specifications: what a point map is built from, and built from again elsewhere."""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, replace
from typing import Any, ClassVar, Generic, TypeVar

from .._lib.checks import shown

M = TypeVar("M", covariant=True)
S = TypeVar("S")
_KINDS: dict[str, type[MapSpec[Any]]] = {}


@dataclass(frozen=True, eq=False)
class MapSpec(ABC, Generic[M]):
    """Specification of a point map: derive from it for a kind of map of your own.

    Write a frozen dataclass with a name in `kind`, the arguments of the map as fields, and a method :meth:`make` that
    returns a :class:`PointMap`.  ``spec.build()`` is then the map, with all that maps can do:
    :meth:`PointMap.with_params` and :func:`swept_map` build it with other parameters, other processes and workers
    build it from its fields, and :func:`rebuild_map` builds it from what a file holds.

    Parameters of the map are in a field ``params``, or in one called ``system`` that has a method ``with_params``; a
    specification that keeps them elsewhere overrides :meth:`with_params`.  A file holds the fields that are numbers,
    strings or tuples of them; functions and systems come from the `source` that :func:`rebuild_map` is given.

    Examples
    --------
    >>> from cellmap import PointMap
    >>> from cellmap.maps import Coordinate, rebuild_map
    >>> @dataclass(frozen=True)
    ... class Relaxation(MapSpec[PointMap]):
    ...     kind = "relaxation"
    ...     params: Mapping[str, float]
    ...     target: float = 0.0
    ...
    ...     def make(self):
    ...         factor, target = self.params["factor"], self.target
    ...
    ...         def advance(orbits, periods):  # at most 16384 of them, in place; angles wrapped, full rotations counted
    ...             now = orbits.points[orbits.alive]
    ...             orbits.points[orbits.alive] = target + factor**periods * (now - target)
    ...
    ...         return PointMap("relaxation", (Coordinate("x"),), self.params, advance)
    >>> slow = Relaxation({"factor": 0.5}, target=1.0).build()
    >>> slow.iterate([0.0], 3).points
    array([0.875])
    >>> slow.with_params(factor=0.1)([0.0])
    array([0.9])
    >>> slow.recipe
    {'kind': 'relaxation', 'target': 1.0}
    >>> rebuild_map(slow, slow.recipe)([0.0])
    array([0.5])
    """

    kind: ClassVar[str]
    """Name of the kind of map, by which files know it."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        known = _KINDS.get(cls.kind)
        if known is not None and known.__module__ != cls.__module__:
            raise TypeError(f"kind={cls.kind!r} of {cls.__name__} is that of {known.__module__}: give another name")
        _KINDS[cls.kind] = cls

    def __reduce__(self) -> tuple[Callable[..., MapSpec[M]], tuple[()]]:
        return functools.partial(type(self), **{f.name: getattr(self, f.name) for f in fields(self)}), ()

    @abstractmethod
    def make(self) -> M:
        """Return the map, without its specification."""

    def build(self) -> M:
        """Return the map."""
        return with_spec(self.make(), self)

    def with_params(self, params: Mapping[str, float]) -> MapSpec[M]:
        """Return the specification with other values of the parameters, all of which are given."""
        system = getattr(self, "system", None)
        changes = {"params": params} if system is None else {"system": system.with_params(**params)}
        return replace(self, **changes)

    def with_phase(self, phase: float) -> MapSpec[M]:
        """Return the specification with another phase of the forcing."""
        raise ValueError(f"phase={phase!r}: a {self.kind} map has none; give a stroboscopic map")

    def swept(self, names: tuple[str, ...]) -> MapSpec[M] | None:
        """Return the specification with some parameters appended to the state; None if `with_params` must serve."""
        return None

    def curve_step(
        self, order: int, finer: bool = False, part: tuple[int, int] = (0, 1)
    ) -> Callable[[Any], None] | None:
        """Return a step of orbits of (x, x', x'', ...), derivatives along a curve up to an order; None if unknown.

        With `finer` the tolerance is a tenth, for an estimate of the error.  A `part` (k, n) is the one with number k
        of n equal parts of the step.
        """
        return None

    def parts(self, count: int) -> tuple[Callable[..., tuple[Any, Any]], ...] | None:
        """Return the tangent maps of equal parts of a step, one after the other; None where it cannot be divided.

        With ``directions=k`` derivatives are those by the first k coordinates.
        """
        return None

    @property
    def is_explicit(self) -> bool:
        """Whether another method might be chosen that is made for stiff systems."""
        return False

    @property
    def recipe(self) -> dict[str, Any]:
        """Plain values for a file, from which :func:`rebuild_map` builds the map again."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {"kind": self.kind, **{name: value for name, value in values.items() if _is_plain(value)}}

    @classmethod
    def from_recipe(cls, source: Any, recipe: Mapping[str, Any]) -> MapSpec[M]:
        """Return the specification of a recipe; fields that the recipe lacks are those of the source."""
        values = {}
        for f in fields(cls):
            if f.name in recipe:
                value = recipe[f.name]
                values[f.name] = tuple(value) if isinstance(value, list) else value
            elif isinstance(getattr(source, "spec", None), cls):
                values[f.name] = getattr(source.spec, f.name)
            elif f.name == "system" and not hasattr(source, "spec"):
                values[f.name] = source
            elif f.default is MISSING and f.default_factory is MISSING:
                raise no_source(source, recipe)
        return cls(**values)


def with_spec(made: S, spec: MapSpec[Any]) -> S:
    """Return a new map with its specification; it is lost where :func:`dataclasses.replace` changes the map."""
    object.__setattr__(made, "spec", spec)
    return made


def specification(source: Any, recipe: Mapping[str, Any]) -> MapSpec[Any]:
    """Return the specification that a recipe describes, given the system or the map that it belongs to."""
    kind = recipe.get("kind")
    if kind not in _KINDS:
        raise ValueError(
            f"recipe of kind {kind!r} cannot be rebuilt from {source!r}: give its system, with a recipe of the kinds "
            f"{sorted(_KINDS)}, or import the module that defines the MapSpec of this kind"
        )
    return _KINDS[kind].from_recipe(source, recipe)


def no_source(source: Any, recipe: Mapping[str, Any]) -> ValueError:
    """Return the error for a source that is not that of a recipe."""
    kind = recipe.get("kind")
    return ValueError(
        f"recipe of kind {kind!r} cannot be rebuilt from {shown(source)}: give its system, or a map of the same kind"
    )


def _is_plain(value: Any) -> bool:
    if isinstance(value, tuple | list):
        return all(map(_is_plain, value))
    return value is None or isinstance(value, bool | int | float | str)
