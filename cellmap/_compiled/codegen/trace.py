"""From a plain right-hand side to its expressions, by running it once on symbols."""

from __future__ import annotations

import dis
import functools
import random
from collections import namedtuple
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .arrays import in_a_trace, is_symbolic
from .branches import BranchingGraph
from .elementary import elementary_functions
from .evaluation import evaluated
from .expression import (
    JUMPING,
    Comparison,
    ComparisonError,
    Expression,
    UndefinedError,
    UntraceableError,
    in_order,
    is_analytic,
)
from .rebind import CANONICAL_NAMES, rebind, uses_numpy
from .tables import TableError

CONSTANT, TIMED, STATEFUL = range(3)
"""What an expression depends on: parameters alone, time as well, or the state."""


class StateMisusedError(TypeError):
    """A function changes the state that it is given, or writes a sum of its parts, which has two meanings."""


class State(tuple[Any, ...]):
    """State variables as functions receive them: a tuple that is an array where arithmetic is done with all of it.

    ``x + (a, b)`` joins tuples; every other operation is that of arrays.  ``x[1:] + x[:1]``, which would be either, and
    what would change a state are errors that say what to write.
    """

    __slots__ = ()

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, slice):
            return State(super().__getitem__(key))
        try:
            return super().__getitem__(key)
        except TypeError:
            return self._array[key]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or not hasattr(np.ndarray, name):
            raise AttributeError(f"the state has no attribute {name!r}", name=name, obj=self)
        return getattr(self._array, name)

    @property
    def _array(self) -> Any:
        return in_a_trace(np.array(list(self), dtype=object)) if is_symbolic(self) else np.array(list(self))

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        """Apply a function of NumPy to the array."""
        return getattr(ufunc, method)(*(i._array if isinstance(i, State) else i for i in inputs), **options)

    def __add__(self, other: Any) -> Any:
        if isinstance(other, State):
            raise StateMisusedError(
                "x[1:] + x[:1] joins tuples and adds arrays, and the state is both: write (*x[1:], *x[:1]) to join "
                "parts of the state, np.add(x[1:], x[:1]) to add them"
            )
        return super().__add__(other) if type(other) is tuple else self._array + other

    def __radd__(self, other: Any) -> Any:
        return other + tuple(self) if type(other) is tuple else other + self._array

    def _refused(self, *_: Any) -> Any:
        raise StateMisusedError(
            "a function changes the state x that it is given, which has no effect on the motion: begin with "
            "`q, v = x` and compute with those names. Where the state of a flow is meant to jump, as a velocity that "
            "an impact reverses, declare impacts=[Impact(guard, reset)]"
        )

    __setitem__ = __delitem__ = __iadd__ = __imul__ = _refused


def _of_array(name: str) -> Callable[..., Any]:
    """Return a method of a state that is that of the array."""

    def apply(self: State, *others: Any) -> Any:
        return getattr(self._array, name)(*(o._array if isinstance(o, State) else o for o in others))

    return apply


for _name in "sub mul truediv floordiv mod pow matmul".split():
    setattr(State, f"__{_name}__", _of_array(f"__{_name}__"))
    setattr(State, f"__r{_name}__", _of_array(f"__r{_name}__"))
for _name in "neg pos abs gt ge lt le".split():
    setattr(State, f"__{_name}__", _of_array(f"__{_name}__"))


def as_state(function: Any, values: Iterable[Any]) -> tuple[Any, ...]:
    """Return a state as a function takes it: what numba has compiled takes plain tuples alone."""
    return tuple(values) if hasattr(function, "py_func") else State(values)


CANONICAL_NAMES[State] = "state"


@dataclass(frozen=True, eq=False)
class Trace:
    """Expressions of the components of a function of time, state and parameters."""

    graph: BranchingGraph
    states: tuple[Expression, ...]
    time: Expression
    parameters: tuple[Expression, ...]
    outputs: tuple[Expression, ...]

    def __repr__(self) -> str:
        return f"Trace({len(self.outputs)} components, {len(in_order(self.outputs))} nodes)"

    def run(
        self, function: Callable[..., Sequence[Any]], names: Sequence[str], *further: Any
    ) -> Callable[[], Sequence[Any]]:
        """Return how to run ``function(t, x, p, ...)`` on the inputs; what it raises is the reason why that fails."""
        record = parameter_record(tuple(names))(*self.parameters)
        self.graph.of_numpy = any("[" in name for name in names) or uses_numpy(function)

        def run() -> Sequence[Any]:
            try:
                twin = rebind(function, elementary_functions(), inside=in_a_trace)
                found = twin(self.time, State(self.states), record, *further)
                several = (found,) if isinstance(found, Expression | Comparison | int | float) else found
                return tuple(self.graph.lift(e) for e in several)
            except (ComparisonError, StateMisusedError, TableError, UntraceableError):
                raise
            except Exception as error:
                kind = UndefinedError if _is_meant(error) else UntraceableError
                raise kind(f"{type(error).__name__}: {error}") from error

        return run

    @property
    def is_analytic(self) -> bool:
        """Whether the components have power series."""
        return is_analytic(self.outputs)

    @property
    def has_branches(self) -> bool:
        """Whether state or time decide what is computed."""
        return any(n.operation in JUMPING and level != CONSTANT for n, level in self.levels().items())

    @property
    def resting(self) -> tuple[int, ...]:
        """Numbers of the states whose derivative is zero."""
        return tuple(j for j, e in enumerate(self.outputs) if e.vanishes)

    def with_resting_inputs(self) -> Trace:
        """Return the trace with each resting state as an input "sign": a number of a lane that stays as it is."""
        inputs = {self.states[j]: self.graph.node("sign", value=j) for j in self.resting}
        return replace(self, outputs=self.graph.substituted(self.outputs, inputs)) if inputs else self

    def levels(self) -> dict[Expression, int]:
        """Return for each node whether it depends on parameters alone, on time, or on the state."""
        inputs = {"state": STATEFUL, "time": TIMED}
        levels: dict[Expression, int] = {}
        for node in in_order(self.outputs):
            own = inputs.get(node.operation, CONSTANT)
            levels[node] = max([own, *(levels[a] for a in node.arguments)])
        return levels


def _is_meant(error: Exception) -> bool:
    """Whether plain numbers would lead to an exception as well: it is raised by a statement, or by arithmetic."""
    if isinstance(error, ArithmeticError):
        return True
    place = error.__traceback__
    assert place is not None, "it has been raised"
    while place.tb_next is not None:
        place = place.tb_next
    code, module = place.tb_frame.f_code, place.tb_frame.f_globals.get("__name__", "")
    raised = code.co_code[place.tb_lasti] == dis.opmap["RAISE_VARARGS"]
    outside_of_domain = isinstance(error, ValueError) and module == elementary_functions.__module__
    return outside_of_domain or (raised and module.partition(".")[0] not in {"cellmap", "numpy", "scipy"})


@functools.lru_cache(maxsize=256)
def parameter_record(names: tuple[str, ...]) -> Any:
    """Return the named tuple for parameters of these names, always the same one.

    Entries of arrays, with names such as "K[0, 1]", are given one by one and are arrays K in the tuple.
    """
    bases = tuple(dict.fromkeys(name.partition("[")[0] for name in names))
    if bases == names:
        return namedtuple("Parameters", names)
    return _WithArrays(parameter_record(bases), names)


class _WithArrays:
    """Maker of records of parameters, some of which are entries of arrays."""

    def __init__(self, record: Any, names: tuple[str, ...]) -> None:
        self.record, self.places = record, [entry_of(name) for name in names]
        found = {base: [i for name, i in self.places if name == base] for base in record._fields}
        self.shapes = {base: tuple(max(k) + 1 for k in zip(*found[base], strict=True)) for base in found}
        if any(found[base] != list(np.ndindex(self.shapes[base])) for base in found):
            raise ValueError(f"params has entries of arrays, but not all of them in order: {', '.join(names)}")

    def __call__(self, *values: Any) -> Any:
        kind = float if all(isinstance(v, int | float) for v in values) else object
        fields: dict[str, Any] = {base: np.empty(shape, kind) for base, shape in self.shapes.items() if shape}
        for (base, place), value in zip(self.places, values, strict=True):
            if place:
                fields[base][place] = value
            else:
                fields[base] = value
        return self.record(**fields)


def entry_of(name: str) -> tuple[str, tuple[int, ...]]:
    """Return the name of a parameter, and the indices where it is an entry of an array, such as "K[0, 1]"."""
    base, _, indices = name.partition("[")
    return base, tuple(int(i) for i in indices.rstrip("]").split(", ")) if indices else ()


def trace(function: Callable[..., Sequence[Any]], dimension: int, parameters: Sequence[str]) -> Trace:
    """Run ``function(t, x, p)`` on symbols.  Branches become selections.

    Raises
    ------
    UntraceableError
        Where that fails, with the reason: a loop ends on a value, say, or the function has an error of its own.
    """
    inputs = empty_trace(dimension, len(parameters), BranchingGraph(modes=False))
    return replace(inputs, outputs=inputs.graph.trace_paths(inputs.run(function, parameters)))


def empty_trace(dimension: int, parameters: int, graph: BranchingGraph) -> Trace:
    """Return the inputs of a function, on a graph."""
    states = tuple(graph.node("state", value=i) for i in range(dimension))
    symbols = tuple(graph.node("parameter", value=i) for i in range(parameters))
    return Trace(graph, states, graph.node("time"), symbols, ())


def is_faithful(
    traced: Trace, function: Callable[..., Sequence[Any]], parameters: tuple[float, ...], record: Any
) -> bool:
    """Compare a trace with its function, in plain Python, at a few places of several sizes.

    A function may do what its trace does not show: catch exceptions, or ask for the type of a number.
    """
    rng = random.Random(0)
    places, expected = [], []
    for size in (0.0, 0.1, 1.0, 1.0, 10.0):
        state = as_state(function, (size * rng.uniform(-1.0, 1.0) for _ in traced.states))
        t = rng.uniform(0.0, 10.0)
        try:
            found = list(function(t, state, record))
            if any(isinstance(v, complex) for v in found):
                continue  # outside the domain of a power
            values = [float(v) for v in found]
        except Exception:
            continue  # outside the domain of the function
        if len(values) != len(traced.outputs):
            return False
        places.append((*state, t))
        expected.append(values)
    if not places:
        return True
    columns = np.transpose(places)
    inputs = dict(zip((*traced.states, traced.time, *traced.parameters), (*columns, *parameters), strict=True))
    seen = np.stack([np.broadcast_to(v, len(places)) for v in evaluated(traced.outputs, inputs)], axis=1)
    wanted = np.array(expected)
    scale = 1e-300 + np.nanmax(np.abs(wanted), axis=1, initial=0.0, keepdims=True)
    with np.errstate(invalid="ignore"):
        alike = np.abs(wanted - seen) <= 1e-9 * scale
    return bool((alike | np.isnan(wanted) | (np.abs(wanted) >= 1e300)).all())
