"""Orbits at many values of parameters: states within the steps of the map, and quantities that depend on them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from .._compiled.codegen.kernel import over_states
from .._compiled.codegen.rebind import over_arrays
from .._compiled.codegen.trace import entry_of, parameter_record
from .._lib.arrays import Bools, Floats, Ints
from .._lib.checks import shown
from .parameters_as_states import swept_map
from .poincare import Section, SectionMap
from .point_map import PointMap
from .stroboscopic import Stroboscopic
from .system import ForcedSystem
from .trajectories import Sampler

S = TypeVar("S", Stroboscopic, Section)

Quantity = int | str | Callable[[Any, Any, Any], Any]
"""Number or name of a coordinate, name of one of the outputs of a system, or a function f(t, x, p)."""


@dataclass(frozen=True, eq=False)
class SweptOrbits:
    """Orbits through points (n, d) at values (n, m) of some parameters of a map, followed for some steps.

    The tolerances are those of the map, or `finest` if that is less.
    """

    exact: PointMap
    names: tuple[str, ...]
    values: Floats
    points: Floats
    steps: int
    finest: float = np.inf

    def __getitem__(self, rows: Ints | Bools) -> SweptOrbits:
        return replace(self, values=self.values[rows], points=self.points[rows])

    @property
    def is_flow(self) -> bool:
        """Whether there is motion between the points of an orbit."""
        return isinstance(self.exact.spec, Stroboscopic | Section)

    @property
    def beginning(self) -> tuple[Floats, Floats]:
        """Times (1, n) and states (1, n, ...) at the points."""
        spec = self.exact.spec
        phase = spec.phase if isinstance(spec, Stroboscopic) else 0.0
        return np.full((1, len(self.points)), phase) * self._lengths, self._whole_states[None]

    def motion(self, samples: int) -> tuple[Floats, Floats]:
        """Return times (times + 1, n), some in each step, from the first point to the last one, and states there."""
        spec, names, points, values = self.exact.spec, self.names, self.points, self.values
        if isinstance(spec, Section):
            returning, cycles = _cycles(spec, names, samples, self.finest)
            place, lengths = np.column_stack([points, values]), np.zeros(len(points))
            for _ in range(self.steps):
                back = returning.returns(place)
                place, lengths = back.points, lengths + back.times
            states = cycles.states(np.column_stack([self._whole_states, values, lengths]), 1)[0]
            return np.arange(len(states))[:, None] / samples * lengths, states[..., : self.exact.dimension + 1]
        if not isinstance(spec, Stroboscopic):
            swept, orbit = swept_map(self.exact, *names), [np.column_stack([points, values])]
            for _ in range(self.steps):
                orbit.append(swept(orbit[-1]))
            times = np.broadcast_to(np.arange(self.steps + 1.0)[:, None], (self.steps + 1, len(points)))
            return times, np.array(orbit)[..., : self.exact.dimension]
        sampler = _sampler(spec, names, samples, self.finest)
        if sampler is not None:
            states = sampler.states(np.column_stack([points, values]), self.steps)[0][..., : self.exact.dimension]
        else:
            each = (
                Sampler(_finer(replace(spec, system=_at(spec.system, names, value)), self.finest), samples)
                for value in values
            )
            ends = [s.states(p[None], self.steps)[0] for s, p in zip(each, points, strict=True)]
            states = np.concatenate(ends, axis=1)
        times = (spec.phase + np.arange(len(states))[:, None] / samples) * self._lengths
        return np.broadcast_to(times, states.shape[:2]), states

    def rates(self, states: Floats) -> Floats:
        """Return the rates of change (times, n, ...) of states (times, n, ...) of a system without forcing."""
        spec = self.exact.spec
        assert isinstance(spec, Section)
        return over_states(spec.system.rhs, 0.0, states, self._given)

    def quantity(self, quantity: Quantity, times: Floats, states: Floats) -> Floats:
        """Return a quantity (n, times) of states (times, n, ...), with all coordinates of a system, at times."""
        exact = self.exact
        spec, d = exact.spec, exact.dimension
        if isinstance(quantity, int | np.integer):
            if isinstance(quantity, bool) or not -d <= quantity < d:
                raise ValueError(f"quantity={quantity!r}: the coordinates have the numbers 0 to {d - 1}")
            quantity = exact.coordinates[quantity].name
        system = spec.system if isinstance(spec, Stroboscopic | Section) else None
        outputs = system.outputs if system is not None else {}
        axes = [c.name for c in (exact.coordinates if system is None else system.axes)]
        if isinstance(quantity, str):
            if quantity in axes:
                return states[..., axes.index(quantity)].T
            if quantity not in outputs:
                raise ValueError(
                    f"quantity={quantity!r}: the coordinates are {axes}, the outputs {sorted(outputs) or 'none'}"
                )
        function = outputs[quantity] if isinstance(quantity, str) else quantity
        if not callable(function):
            raise TypeError(
                f"quantity={shown(quantity)}: give a coordinate, one of the outputs of the system, or a function "
                "f(t, x, p)"
            )
        try:
            found = over_states(function, times, states, self._given)
            if found.dtype.kind not in "biuf":
                raise TypeError(f"it returns {shown(found)}, not real numbers")
        except (TypeError, ValueError, AttributeError, IndexError) as error:
            raise (ValueError if isinstance(error, ValueError) else TypeError)(
                f"quantity={shown(quantity)}: {error}; give a function f(t, x, p) of the coordinates {axes} and the "
                f"parameters {list(exact.params)}"
            ) from error
        return found[..., 0].astype(float).T

    @property
    def _whole_states(self) -> Floats:
        """Points (n, ...) with the coordinate that is constant on a section."""
        spec = self.exact.spec
        if not isinstance(spec, Section):
            return self.points
        return np.insert(self.points, spec.place, spec.section[1], axis=1)

    @property
    def _given(self) -> dict[str, Any]:
        """Parameters, of which some are arrays (n,)."""
        return dict(self.exact.params) | dict(zip(self.names, self.values.T, strict=True))

    @property
    def _lengths(self) -> Any:
        """Periods (n,) of a stroboscopic map, or 1."""
        spec = self.exact.spec
        period: Any = spec.system.period if isinstance(spec, Stroboscopic) else 1.0
        record = parameter_record(tuple(self._given))(*self._given.values())
        return over_arrays(period)(record) if callable(period) else period


@functools.lru_cache(maxsize=16)
def _sampler(spec: Stroboscopic, names: tuple[str, ...], samples: int, finest: float) -> Sampler | None:
    swept = spec.swept(names)
    return None if swept is None else Sampler(_finer(swept, finest), samples)


@functools.lru_cache(maxsize=16)
def _cycles(spec: Section, names: tuple[str, ...], samples: int, finest: float) -> tuple[SectionMap, Sampler]:
    """Return the map of first returns with parameters as states, and the motion over a time that is a state as well."""
    finer = _finer(spec, finest)
    swept, system, own_rhs = finer.swept(names), spec.system, spec.system.rhs
    if swept is None:
        raise TypeError(f"system={system!r}: measures over returns need a right-hand side that can be traced")
    own, places = parameter_record(tuple(system.params)), [entry_of(name) for name in system.params]
    fields = list(dict.fromkeys(base for base, _ in places))
    entries = tuple((fields.index(base), entry) for base, entry in places)

    def rhs(t: Any, x: Any, p: Any) -> Any:
        return own_rhs(t, x, own(*[p[field][entry] if entry else p[field] for field, entry in entries]))

    timed = ForcedSystem(rhs, {**system.params, "T_": 1.0}, lambda p: p.T_, system.axes, system.name)
    strobe = Stroboscopic(timed, 0.0, finer.rtol, finer.atol, "auto", spec.max_steps).swept((*names, "T_"))
    assert strobe is not None, "the same formulas"
    return swept.build(), Sampler(strobe, samples)


def _finer(spec: S, finest: float) -> S:
    atol = tuple(min(a, finest) for a in spec.atol) if isinstance(spec.atol, tuple) else min(spec.atol, finest)
    return replace(spec, rtol=min(spec.rtol, finest), atol=atol)


def _at(system: ForcedSystem, names: tuple[str, ...], values: Floats) -> ForcedSystem:
    return system.with_params(**dict(zip(names, values.tolist(), strict=True)))
