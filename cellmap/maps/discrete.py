"""Discrete maps."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .._compiled.codegen.captured import Watched
from .._compiled.codegen.expression import ImpureError
from .._compiled.codegen.kernel import discrete_kernel, map_enclosure, tangent_step, traced_function, why_untraced
from .._compiled.codegen.period import CompiledPeriod
from .._compiled.codegen.trace import State, Trace, as_state, parameter_record
from .._compiled.kernels.blocks import END_PLACE
from .._compiled.kernels.frames import Framed, FrameStep, carrying
from .._compiled.machine_code import MachineCode
from .._lib.arrays import Floats
from .._lib.checks import named, parameter_values, shown
from .._lib.computed import computed_once
from .._lib.signatures import checked
from .compiled_advance import DiscreteAdvance
from .coordinates import Coordinate, as_coordinates, turns_of
from .impacts import check_ends
from .misread import (
    as_vectors,
    asks_for_more,
    called_twice,
    check_compiled,
    lacking,
    too_few,
    trial_state,
    undefined,
    warn_of_cost,
)
from .orbit_batch import Orbits, Status
from .parameters_as_states import swept_axes, swept_function, swept_guard
from .periodicity import value_at
from .point_map import PointMap
from .specification import MapSpec
from .tangent import derivatives_of, tangent_by_lanes

if TYPE_CHECKING:
    from .._compiled.codegen.enclosures import CompiledEnclosure

_BOUND = 1e100


@checked
def discrete_map(
    function: Callable[[Sequence[float], Any], Sequence[float]],
    params: Mapping[str, float] | Any,
    coordinates: Iterable[str | Coordinate],
    name: str = "",
    ends: Mapping[str, Callable[[Sequence[float], Any], float]] | None = None,
) -> PointMap:
    """Return the point map of a plain function.

    Parameters
    ----------
    function : callable
        Pure function ``function(x, p)`` of the tuple of state variables and the named tuple of parameters; returns the
        tuple of images.  Angles need not be wrapped.
    params : mapping of str to float or ndarray, dataclass or namedtuple
        Parameters by name; entries of arrays have names such as "K[0, 1]".
    coordinates : sequence of str or Coordinate
        State variables.
    name : str, optional
        Name for files and plots; by default the name of `function`.
    ends : mapping of str to callable, optional
        Ends of orbits by name, such as ``{"extinct": lambda x, p: p.fewest - x[0]}``: an orbit ends in the step after
        which, or before which, such a guard is positive, and has a label of that name.

    Returns
    -------
    PointMap
        The map, vectorised over points.  Orbits that exceed 1e100 have diverged.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers, or a function that returns a wrong number of components.

    Examples
    --------
    >>> def henon(x, p):
    ...     return 1 - p.a * x[0] ** 2 + x[1], p.b * x[0]
    >>> discrete_map(henon, {"a": 1.4, "b": 0.3}, ("x", "y"))([0.0, 0.0])
    array([1., 0.])
    """
    return Discrete(function, params, tuple(as_coordinates(coordinates)), name, {} if ends is None else ends).build()


@functools.lru_cache(maxsize=256)
def with_ends(function: Callable[..., Any], guards: tuple[Callable[..., Any], ...]) -> Callable[..., Any]:
    """Return a function whose images are beyond all bounds where a guard is positive; the same one every time."""
    if not guards:
        return function
    plain, *plain_guards = (getattr(f, "py_func", f) for f in (function, *guards))  # numba's take plain tuples alone

    def mapped(x: Sequence[float], p: Any) -> Sequence[float]:
        image = State(plain(x, p))
        for state in (x, image):
            for number, guard in enumerate(plain_guards, 1):
                if guard(state, p) > 0.0:
                    return (number * END_PLACE, *image[1:])
        return image

    return mapped


@dataclass(frozen=True, eq=False)
class Discrete(MapSpec[PointMap]):
    """Specification of the map of a plain function; see :func:`discrete_map`."""

    kind = "discrete"
    function: Callable[[Sequence[float], Any], Sequence[float]]
    params: Mapping[str, float]
    coordinates: tuple[Coordinate, ...]
    name: str
    ends: Mapping[str, Callable[[Sequence[float], Any], float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        function = self.function
        if not callable(function):
            raise TypeError(f"function={function!r}: give a function of (x, p)")
        set_field = functools.partial(object.__setattr__, self)
        set_field("params", parameter_values(self.params))
        set_field("name", named(self.name, function))
        _check_components(function, self.params, self.coordinates)
        record = parameter_record(tuple(self.params))(*self.params.values())
        set_field("ends", check_ends(self.ends, "x, p", (trial_state(len(self.coordinates)), record)))
        _ = self._watched  # the function as it is now

    @property
    def _mapped(self) -> Callable[..., Any]:
        """The function, whose images are beyond all bounds where orbits end."""
        return with_ends(self.function, tuple(self.ends.values()))

    @computed_once
    def _watched(self) -> Watched:
        """The function, which is not to be another one when more is compiled of it."""
        function, record = self._mapped, parameter_record(tuple(self.params))(*self.params.values())

        def sample() -> list[float]:
            places = [[size + 0.1 * j for j in range(len(self.coordinates))] for size in (0.1, 0.37, 1.3)]
            states = [as_state(function, place) for place in places]
            return [v for x in states for v in value_at(lambda t: function(x, record), 0.0)]  # noqa: B023

        return Watched(f"function of {self.name}", function, sample)

    @computed_once
    def _formulas(self) -> str:
        """Why the formulas of the function are not known; empty if they are."""
        return why_untraced(_timeless(self._mapped), len(self.coordinates), self.params)

    def _kernel(self, order: int, only_smooth: bool = False) -> CompiledPeriod | None:
        self._watched.check()
        d, names = len(self.coordinates), tuple(self.params)
        return discrete_kernel(_timeless(self._mapped), d, names, order, not self._formulas, only_smooth)

    def make(self) -> PointMap:
        """Return the map, without its specification."""
        name, d = self.name, len(self.coordinates)
        try:
            kernel = self._kernel(0)
        except TypeError as error:
            raise TypeError(f"function={shown(self.function)}: {error}") from error
        assert kernel is not None, "without tangents there is always one"
        parameters = np.array([float(v) for v in self.params.values()])
        if self._formulas:
            record = parameter_record(tuple(self.params))(*self.params.values())
            place, function = (*trial_state(d), *parameters.tolist()), _timeless(self._mapped)
            check_compiled("function", lambda t, x: function(t, State(x), record), kernel, d, parameters, 0.0)
            warn_of_cost(f"function of {name}", self._formulas, function, tuple(self.params), place, kernel, "")
        lower, turn = turns_of(self.coordinates)
        anywhere = np.zeros(2 * d)

        @functools.cache
        def tangent_advance() -> DiscreteAdvance:
            compiled = derivatives_of(name, self._kernel(1))
            return DiscreteAdvance(compiled, parameters, _BOUND, anywhere, anywhere)

        def derivative(points: Floats, directions: int | None = None) -> tuple[Floats, Floats]:
            return tangent_by_lanes(tangent_advance(), points, d, directions)

        @functools.cache
        def step_of_frames() -> MachineCode:
            self._watched.check()
            return derivatives_of(name, tangent_step(_timeless(self._mapped), d, tuple(self.params)))

        def stretch(orbits: Orbits, frames: Floats, periods: int) -> Floats:
            step = FrameStep(step_of_frames().address("step"), parameters, lower, turn, _BOUND)
            growth, ended, before = np.empty((len(orbits), d)), ~orbits.alive, ~orbits.alive
            carrying(d)(step, Framed(orbits.points, orbits.rotations, frames, ended), periods, growth)
            orbits.end(ended & ~before, Status.DIVERGED)
            return growth

        return PointMap(
            name=name,
            coordinates=self.coordinates,
            params=self.params,
            advance=DiscreteAdvance(kernel, parameters, _BOUND, lower, turn),
            tangent=derivative,
            stretch=None if self._formulas else stretch,
            unknown_formulas=self._formulas,
            ends=tuple(self.ends),
        )

    def swept(self, names: tuple[str, ...]) -> Discrete | None:
        """Return the specification with some parameters appended to the state, where the formulas are known."""
        if self._formulas:
            return None
        described = len(self.coordinates), tuple(self.params), names
        ends = {name: swept_guard(guard, *described) for name, guard in self.ends.items()}
        function, axes = swept_function(self.function, *described), swept_axes(self.coordinates, names)
        return replace(self, function=function, coordinates=axes, ends=ends)

    def curve_step(
        self, order: int, finer: bool = False, part: tuple[int, int] = (0, 1)
    ) -> Callable[[Orbits], None] | None:
        """Return a step of orbits of (x, x', x'', ...), derivatives along a curve up to an order; None if unknown."""
        d = len(self.coordinates)
        kernel = self._kernel(order, only_smooth=True)
        if kernel is None or part[1] > 1:
            return None
        parameters, anywhere = np.array([float(v) for v in self.params.values()]), np.zeros((order + 1) * d)
        advance = DiscreteAdvance(kernel, parameters, _BOUND, anywhere, anywhere)
        return lambda orbits: advance(orbits, 1)

    def parts(self, count: int) -> tuple[Callable[..., tuple[Any, Any]], ...] | None:
        """Return the tangent map of the step, which cannot be divided; None without known derivatives."""
        if count > 1 or self._formulas or self._kernel(1) is None:
            return None
        tangent = self.build().tangent
        return None if tangent is None else (tangent,)

    def trace(self) -> Trace | None:
        """Return the formulas, None where they are not known."""
        self._watched.check()
        known = not self._formulas
        return traced_function(_timeless(self._mapped), len(self.coordinates), tuple(self.params)) if known else None

    def enclosure(self) -> CompiledEnclosure:
        """Return the compiled enclosure of images of boxes."""
        self._watched.check()
        return map_enclosure(_timeless(self._mapped), len(self.coordinates), tuple(self.params))

    @property
    def recipe(self) -> dict[str, Any]:
        """Plain values for a file."""
        return {"kind": self.kind}


@functools.lru_cache(maxsize=256)
def _timeless(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function with a time that it does not use; the same object for the same function."""
    plain = getattr(function, "py_func", function)  # numba's takes plain tuples alone

    def at_any_time(t: float, x: Sequence[float], p: Any) -> Sequence[float]:
        image: Sequence[float] = plain(x, p)
        return image

    at_any_time.__qualname__ = getattr(function, "__qualname__", type(function).__name__)  # for error messages
    return at_any_time


def _check_components(function: Callable[..., Any], params: Mapping[str, float], axes: Sequence[Coordinate]) -> None:
    record = parameter_record(tuple(params))(*params.values())
    beyond: Exception | None = None
    for start in (0.1, 0.37, 1.3):
        try:
            state = as_state(function, (start + 0.1 * j for j in range(len(axes))))
            image = called_twice("function", function, state, record)
        except ImpureError:
            raise
        except AttributeError as error:
            raise lacking("function", error) from error
        except NameError as error:
            raise undefined("function", error) from error
        except TypeError as error:
            raise TypeError(
                f"function must be callable as function(x, p) and return a tuple: {error}{as_vectors(str(error))}"
            ) from error
        except Exception as error:
            beyond = error if asks_for_more(error) else beyond
            continue  # outside the domain of the function
        try:
            count = len(image)
        except TypeError:
            raise TypeError(
                f"function returns {image!r}: return a tuple, one image for each coordinate, `return (value,)` for one"
            ) from None
        if count != len(axes):
            raise ValueError(
                f"function returns {count} components for {len(axes)} coordinates: return one image for each"
            )
        return
    if beyond is not None:
        raise too_few("function", axes, beyond) from beyond
