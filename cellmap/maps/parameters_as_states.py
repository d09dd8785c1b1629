"""Maps with parameters appended to the state, for vectorised parameter sweeps.

A parameter becomes a further state variable with derivative zero.  Every function of initial conditions then works on
parameters too: SIMD lanes over parameter values, and derivatives of an image with respect to a parameter.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._compiled.codegen.trace import entry_of, parameter_record
from .._lib.checks import known_parameter
from .._lib.computed import computed_once
from .._lib.signatures import checked
from .coordinates import Coordinate
from .formulas import unknown_formulas
from .impacts import Impact
from .orbit_batch import Orbits
from .point_map import PointMap
from .specification import MapSpec, specification
from .system import ForcedSystem


@checked
def swept_map(point_map: PointMap, *parameters: str) -> PointMap:
    """Return a map with some parameters appended to the state.

    Parameters
    ----------
    point_map : PointMap
        A map of some dimension d; for an interpolated map, the exact map behind it is used.
    parameters : str
        Names of m different parameters.

    Returns
    -------
    PointMap
        Map of (x, q), of dimension d + m: x is mapped as with the parameters q, and q is constant.

    Raises
    ------
    ValueError
        For a name that the map does not have, or for a parameter on which the period of the right-hand side depends
        although the period is given as a number.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> logistic = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 3.0}, ("x",))
    >>> swept_map(logistic, "r")([[0.5, 2.0], [0.5, 4.0]])
    array([[0.5, 2. ],
           [1. , 4. ]])
    """
    exact = point_map.without_table
    _check_names(parameters, exact.params)
    return Swept(exact, parameters).build()


def _check_names(parameters: tuple[str, ...], known: Mapping[str, float]) -> None:
    for name in parameters:
        known_parameter("parameters", name, known)
    if not parameters or len(set(parameters)) < len(parameters):
        raise ValueError(f"parameters={parameters!r}: give the names of one or several different parameters")


@dataclass(frozen=True, eq=False)
class Swept(MapSpec[PointMap]):
    """Specification of a map with some parameters appended to the state; see :func:`swept_map`."""

    kind = "swept"
    exact: PointMap
    names: tuple[str, ...]

    @computed_once
    def vectorised(self) -> MapSpec[PointMap] | None:
        """The specification with the parameters appended to the state, where the formulas are known."""
        return self.exact.specified.swept(self.names)

    def make(self) -> PointMap:
        """Return the map, without its specification."""
        found = self.vectorised
        return _row_by_row(self.exact, self.names) if found is None else found.make()

    def with_params(self, params: Mapping[str, float]) -> Swept:
        """Return the specification with other values of the parameters."""
        return replace(self, exact=self.exact.with_params(**params))

    def swept(self, names: tuple[str, ...]) -> MapSpec[PointMap] | None:
        """Return the specification with some parameters appended to the state, where the formulas are known."""
        found = self.vectorised
        return None if found is None else found.swept(names)

    def curve_step(
        self, order: int, finer: bool = False, part: tuple[int, int] = (0, 1)
    ) -> Callable[[Orbits], None] | None:
        """Return a step of orbits of (x, x', x'', ...), derivatives along a curve up to an order; None if unknown."""
        found = self.vectorised
        return None if found is None else found.curve_step(order, finer, part)

    def parts(self, count: int) -> tuple[Callable[..., tuple[Any, Any]], ...] | None:
        """Return the tangent maps of equal parts of a step, one after the other; None where it cannot be divided."""
        found = self.vectorised
        return None if found is None else found.parts(count)

    @property
    def recipe(self) -> dict[str, Any]:
        """Plain values for a file."""
        return {"kind": self.kind, "names": self.names, "exact": self.exact.recipe}

    @classmethod
    def from_recipe(cls, source: Any, recipe: Mapping[str, Any]) -> Swept:
        """Return the specification of a recipe."""
        return cls(specification(source, recipe["exact"]).build(), tuple(recipe["names"]))


def swept_axes(axes: Sequence[Coordinate], names: Sequence[str]) -> tuple[Coordinate, ...]:
    """Return coordinates followed by those of parameters; a parameter called like a state variable is marked."""
    taken = {c.name for c in axes}
    return (*axes, *(Coordinate(f"parameter {name}" if name in taken else name) for name in names))


@checked
def swept_system(system: ForcedSystem, *parameters: str) -> ForcedSystem:
    """Return a system with some parameters appended to the state.

    Parameters
    ----------
    system : ForcedSystem
        A system of some dimension d.
    parameters : str
        Names of m different parameters.

    Returns
    -------
    ForcedSystem
        System of (x, q), of dimension d + m, in which the parameters q are constant.  Where the period is a function of
        the parameters, its time is counted in periods.

    Raises
    ------
    ValueError
        For a name that the system does not have, or for a parameter on which the period of the right-hand side depends
        although the period is given as a number.
    TypeError
        For a right-hand side that cannot be traced.

    Examples
    --------
    >>> decay = ForcedSystem(lambda t, x, p: (-p.rate * x[0],), {"rate": 1.0}, 1.0, ("x",))
    >>> swept_system(decay, "rate").derivative(0.0, (2.0, 3.0))
    (-6.0, 0.0)
    """
    _check_names(parameters, system.params)
    made = with_states(system, parameters)
    if made is None:
        raise TypeError(f"rhs of {system.name} cannot be traced: write it with plain arithmetic and functions of math")
    return made


def with_states(system: ForcedSystem, names: tuple[str, ...]) -> ForcedSystem | None:
    """Return a system with some parameters as further states; None where its right-hand side cannot be traced.

    Where the period is a function of parameters, time is counted in periods.
    """
    period = system.period if callable(system.period) else None
    functions, described = (system.rhs, system.switches, period), (system.dimension, tuple(system.params), names)
    if unknown_formulas(system):
        return None
    rhs, switches = _swept_functions(functions, *described)
    try:
        return ForcedSystem(
            rhs,
            system.params,
            system.period if period is None else 1.0,
            swept_axes(system.axes, names),
            system.name,
            switches,
            _swept_impacts(tuple(system.impacts), period, *described),
            dict(zip(system.ends, _swept_guards(tuple(system.ends.values()), period, *described), strict=True)),
        )
    except ValueError as error:
        if period is None and "period" in str(error):
            raise ValueError(
                f"parameters={names!r}: the period of the right-hand side changes with a parameter, and period="
                f"{system.period!r} is a number; give ForcedSystem a function, such as "
                "period=lambda p: 2 * pi / p.omega"
            ) from error
        raise


@functools.lru_cache(maxsize=256)
def _swept_functions(
    functions: tuple[Callable[..., Any], Callable[..., Any] | None, Callable[..., Any] | None],
    dimension: int,
    all_names: tuple[str, ...],
    names: tuple[str, ...],
) -> tuple[Callable[..., Any], Callable[..., Any] | None]:
    """Return right-hand side and switches that read some parameters from the state; the same ones every time."""
    rhs, switches, period = functions
    with_swept, at_rest = _reader(dimension, all_names, names), (0.0,) * len(names)

    def moving(t: float, x: Sequence[float], p: Any, s: Sequence[float] = ()) -> Sequence[float]:
        q = with_swept(x, p)
        signs = (s,) if s else ()
        if period is None:
            return (*rhs(t, x[:dimension], q, *signs), *at_rest)
        length = period(q)
        return (*[length * rate for rate in rhs(length * t, x[:dimension], q, *signs)], *at_rest)

    return moving, None if switches is None else _reading(switches, period, dimension, with_swept)


@functools.lru_cache(maxsize=256)
def _swept_impacts(
    impacts: tuple[Impact, ...],
    period: Callable[..., Any] | None,
    dimension: int,
    all_names: tuple[str, ...],
    names: tuple[str, ...],
) -> tuple[Impact, ...]:
    """Return impacts that read some parameters from the state, and leave them as they are; the same ones every time."""
    with_swept = _reader(dimension, all_names, names)

    def swept(impact: Impact) -> Impact:
        guard, reset = (_reading(f, period, dimension, with_swept) for f in (impact.guard, impact.reset))
        return replace(impact, guard=guard, reset=lambda t, x, p: (*reset(t, x, p), *x[dimension:]))

    return tuple(map(swept, impacts))


@functools.lru_cache(maxsize=256)
def _swept_guards(
    guards: tuple[Callable[..., Any], ...],
    period: Callable[..., Any] | None,
    dimension: int,
    all_names: tuple[str, ...],
    names: tuple[str, ...],
) -> tuple[Callable[..., Any], ...]:
    """Return guards of ends that read some parameters from the state; the same ones every time."""
    with_swept = _reader(dimension, all_names, names)
    return tuple(_reading(guard, period, dimension, with_swept) for guard in guards)


@functools.lru_cache(maxsize=256)
def swept_guard(
    guard: Callable[..., Any], dimension: int, all_names: tuple[str, ...], names: tuple[str, ...]
) -> Callable[..., Any]:
    """Return the guard of an end of a discrete map that reads some parameters from the state; the same every time."""
    with_swept = _reader(dimension, all_names, names)
    return lambda x, p: guard(x[:dimension], with_swept(x, p))


@functools.lru_cache(maxsize=256)
def swept_function(
    function: Callable[..., Any], dimension: int, all_names: tuple[str, ...], names: tuple[str, ...]
) -> Callable[..., Any]:
    """Return the function of a discrete map that reads some parameters from the state; the same one every time."""
    with_swept = _reader(dimension, all_names, names)

    def mapped(x: Sequence[float], p: Any) -> Sequence[float]:
        return (*function(x[:dimension], with_swept(x, p)), *x[dimension:])

    return mapped


def _reader(dimension: int, all_names: tuple[str, ...], names: tuple[str, ...]) -> Callable[..., Any]:
    """Return the function that makes the record of all parameters, of which some are read from the state."""
    record = parameter_record(all_names)
    entries = [entry_of(name) for name in all_names]
    fields = list(dict.fromkeys(base for base, _ in entries))
    places = tuple(
        (dimension + names.index(name) if name in names else -1, fields.index(base), entry)
        for name, (base, entry) in zip(all_names, entries, strict=True)
    )

    def with_swept(x: Sequence[float], p: Any) -> Any:
        return record(*[x[k] if k >= 0 else p[field][entry] if entry else p[field] for k, field, entry in places])

    return with_swept


def _reading(
    function: Callable[..., Any], period: Callable[..., Any] | None, dimension: int, with_swept: Callable[..., Any]
) -> Callable[..., Any]:
    """Return a function of time, state and parameters that reads some of the parameters from the state."""

    def read(t: float, x: Sequence[float], p: Any) -> Any:
        q = with_swept(x, p)
        return function(t if period is None else period(q) * t, x[:dimension], q)

    return read


def _row_by_row(exact: PointMap, names: tuple[str, ...]) -> PointMap:
    """Return a swept map that makes a map for each set of parameters: the way that is always open."""
    d = exact.dimension

    def advance(orbits: Orbits, periods: int) -> None:
        values, rows = np.unique(orbits.points[:, d:], axis=0, return_inverse=True)
        for k, value in enumerate(values):
            mine = np.flatnonzero((rows.ravel() == k) & orbits.alive)
            if len(mine):
                part = orbits[mine]
                inner = Orbits(part.points[:, :d].copy(), part.rotations[:, :d].copy(), part.status, part.work)
                exact.with_params(**dict(zip(names, value.tolist(), strict=True))).advance(inner, periods)
                part.points[:, :d], part.rotations[:, :d], part.status = inner.points, inner.rotations, inner.status
                part.points[~part.alive] = np.nan
                orbits[mine] = part

    return PointMap(
        name=exact.name,
        coordinates=swept_axes(exact.coordinates, names),
        params=exact.params,
        advance=advance,
        period=exact.period,
        tolerance=exact.tolerance,
        is_flow=exact.is_flow,
        no_image=exact.no_image,
        ends=exact.ends,
        unknown_formulas=exact.unknown_formulas,
    )
