"""Frame of the integrators: one period of many initial conditions, in SIMD lanes, as LLVM instructions.

The function is

    advance(context, x, steps, start, period, p, error, orbits)

with addresses of arrays: blocks ``x`` of shape (blocks, dimension, LANES), a number of steps for each block, the same
for all of them, the time at which the period begins, its length, the parameters, and ``error`` of the shape of x, which
receives the sum of the estimated local errors of each component; and the number of orbits in the blocks.  Lanes of the
last block beyond these hold copies, which may be moved on or not.  The context is for functions that serve several
systems, see :mod:`cellmap._compiled.codegen.switching`, and for steps that call others.

A few blocks at a time are the outer loop, then the steps of these, then the vectors of their lanes; the body of the
innermost loop is one whole step, straight-line code.  A method supplies it as a :data:`Step`; see :mod:`runge_kutta`
and :mod:`taylor`.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..._lib.arrays import Floats, Ints
from ..kernels.blocks import LANES
from ..machine_code import MachineCode, machine_code, vector_width
from .instructions import Instructions, Value, module_text, number, total

_SHIFT = LANES.bit_length() - 1

CHECKED = 256
"""Steps between two looks at whether any lane of a block is still finite."""

_TOGETHER, _ROWS = 4, 32
"""Blocks that step together, so that what lanes have in common is computed for more of them, and components of all
these: as many as stay in the first cache."""

NO_LENGTH = 1e-290  # length of a vector that has vanished, and has no error

ARGUMENTS = (
    "ptr %context, ptr noalias %x, ptr noalias %steps, double %start, double %period, ptr noalias %p, "
    "ptr noalias %error, i64 %orbits"
)
_PROTOTYPE = ctypes.CFUNCTYPE(
    None, *[ctypes.c_void_p] * 3, *[ctypes.c_double] * 2, *[ctypes.c_void_p] * 2, ctypes.c_int64
)
_NO_CONTEXT = np.zeros(1, np.int64)


@dataclass(frozen=True, eq=False)
class CompiledPeriod:
    """A function ``advance`` in memory: its address, what it is called with, and what holds its code."""

    address: int
    code: Any
    context: Ints = field(default_factory=lambda: _NO_CONTEXT)

    def __call__(
        self, x: Floats, steps: Ints, start: float, period: float, p: Floats, error: Floats, orbits: int | None = None
    ) -> None:
        """Move blocks of lanes on in place, full ones by default; as described above."""
        count = len(x) * LANES if orbits is None else orbits
        arrays = (self.context, x, steps, p, error)
        context, states, numbers, parameters, errors = (array.ctypes.data for array in arrays)
        _PROTOTYPE(self.address)(context, states, numbers, start, period, parameters, errors, count)


Values = Sequence[Value]
PerLane = Callable[[Values], tuple[Values, Values]]
PerStep = Callable[[Value, Value], PerLane]
Step = Callable[[Instructions, Values], PerStep]
"""Writer of one step of a method, for one right-hand side: three functions, each of which returns the next.

The first is given the parameters and writes what runs before everything.  The second is given the time and the size of
a step, and writes what all lanes share.  The third turns the states of a lane into those after the step, and returns
estimates of their local errors as well.
"""


def compiled_period(step: Step, dimension: int, parameters: int, quick: bool = False) -> CompiledPeriod:
    """Compile the function ``advance`` described above."""
    return compiled_advance(period_text(step, dimension, parameters, vector_width()), quick)


@functools.lru_cache(maxsize=256)
def compiled_advance(text: str, quick: bool = False) -> CompiledPeriod:
    """Compile a module with a function ``advance``; equal formulas share one."""
    loaded = machine_code(text, quick)
    return CompiledPeriod(loaded.address("advance"), loaded)


def period_text(step: Step, dimension: int, parameters: int, width: int) -> str:
    """Return the text of a module with the function ``advance`` described above, for vectors of some width."""
    out, components, together = Instructions(width), range(dimension), max(1, min(_TOGETHER, _ROWS // dimension))
    per_step = step(out, loaded_parameters(out, parameters))
    with out.loop("block", blocks_of_orbits(out), together) as block:
        used, steps = lanes_in_use(out, block, together), out.load_whole("%steps")
        h = out.argument("%period") / out.result(f"sitofp i64 {steps} to double")
        first = out.whole("mul", block, dimension * LANES)
        x, error = out.address("%x", first), out.address("%error", first)
        with out.loop("cleared", out.whole("mul", whole_blocks(out, used), dimension * LANES), out.width) as place:
            out.store(out.as_vector(number(0.0)), out.address(error, place))
        with out.loop("step", steps) as number_of_step:
            elapsed = out.result(f"sitofp i64 {number_of_step} to double") * h
            per_lane = per_step(out.argument("%start") + elapsed, h)
            with out.loop_over_lanes(used) as lane:
                rows = _rows_of(out, lane, dimension)
                states, errors = ([out.address(base, row) for row in rows] for base in (x, error))
                after, local = per_lane([out.load(state, vector=True) for state in states])
                for j in components:
                    out.store(out.as_vector(after[j]), states[j])
                    size = abs(out.as_vector(local[j]))
                    out.store(out.load(errors[j], vector=True) + size, errors[j])
            _leave_if_nothing_is_finite(out, x, number_of_step, dimension, used)
    return module_text(out.function("advance", ARGUMENTS), out)


def compiled_rows(step: Step, dimension: int, parameters: int) -> MachineCode:
    """Compile ``step(rows, count, p)``, which moves the rows of an array (count, dimension) on by one step, one by one.

    It is for orbits that are followed alone, whose periods come one after the other: there lanes stay empty.
    """
    out, components = Instructions(1), range(dimension)
    per_lane = step(out, loaded_parameters(out, parameters))(out.number(0.0), out.number(1.0))
    with out.loop("row", "%count") as row:
        first = out.result(f"mul i64 {row}, {dimension}").text
        places = [out.address("%rows", out.result(f"add i64 {first}, {j}").text) for j in components]
        after, _ = per_lane([out.load(place) for place in places])
        for j, place in enumerate(places):
            out.store(after[j], place)
    return machine_code(module_text(out.function("step", "ptr noalias %rows, i64 %count, ptr noalias %p"), out))


def relative_errors(step: Step, dimension: int) -> Step:
    """Return the step of states with tangent vectors behind them, whose errors are made relative to their lengths.

    A relative error stays what it is while the vector grows or shrinks, whatever the size it began with.  Lengths are
    sums of absolute values after the step.
    """

    def of_function(out: Instructions, p: Values) -> PerStep:
        per_step = step(out, p)

        def of_step(t: Value, h: Value) -> PerLane:
            per_lane = per_step(t, h)

            def of_lane(x: Values) -> tuple[Values, Values]:
                after, errors = per_lane(x)
                found = list(errors[:dimension])
                for first in range(dimension, len(after), dimension):
                    length = total([abs(v) for v in after[first : first + dimension]])
                    part = 1.0 / (length + NO_LENGTH)
                    found += [part * e for e in errors[first : first + dimension]]
                return after, found

            return of_lane

        return of_step

    return of_function


def _rows_of(out: Instructions, lane: str, dimension: int) -> list[str]:
    """Return where the components of a vector of lanes are, given its first lane among those of several blocks."""
    before = out.whole("mul", out.whole("ashr", lane, _SHIFT), (dimension - 1) * LANES)
    first = out.whole("add", lane, before)
    return [out.whole("add", first, j * LANES) for j in range(dimension)]


def whole_blocks(out: Instructions, orbits: str) -> str:
    """Return the number of blocks that orbits fill, the last one not always to its end."""
    return out.whole("ashr", out.whole("add", orbits, LANES - 1), _SHIFT)


def blocks_of_orbits(out: Instructions) -> str:
    """Return the number of blocks that the orbits fill."""
    return whole_blocks(out, "%orbits")


def lanes_in_use(out: Instructions, block: str, together: int = 1) -> str:
    """Return the number of orbits in some blocks, from one on."""
    left, most = out.whole("sub", "%orbits", out.whole("mul", block, LANES)), together * LANES
    fewer = out.result(f"icmp slt i64 {left}, {most}").text
    return out.result(f"select i1 {fewer}, i64 {left}, i64 {most}").text


def loaded_parameters(out: Instructions, parameters: int) -> list[Value]:
    """Load the parameters from the array p."""
    return [out.load(out.address("%p", i)) for i in range(parameters)]


def _leave_if_nothing_is_finite(out: Instructions, x: str, step: str, dimension: int, used: str) -> None:
    """Look now and then whether a lane is finite: many steps are taken where few have failed, and there it is worth it.

    A lane is finite where all components are.
    """
    place = out.whole("and", step, CHECKED - 1)
    out.write(f"%checked = icmp eq i64 {place}, {CHECKED - 1}")
    out.write("br i1 %checked, label %look, label %step.end")
    out.label("look")
    with out.loop("looked", used, out.width) as lane:
        whole: Value | None = None
        for row in _rows_of(out, lane, dimension):
            size = out.intrinsic("fabs", out.load(out.address(x, row), vector=True))
            finite = out.compare("olt", size, number(float("inf")))
            whole = finite if whole is None else whole & finite
        assert whole is not None, "a system has components"
        out.write(f"br i1 {out.over_lanes('or', whole)}, label %step.end, label %looked.end")
        out.label("looked.unreached")
    out.jump("block.end")
    out.label("unreached")
