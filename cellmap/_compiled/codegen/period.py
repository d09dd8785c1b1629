"""Frame of the integrators: one period of many initial conditions, in SIMD lanes, as LLVM instructions.

The function is

    advance(context, x, steps, start, period, p, error, orbits)

with the arrays that :mod:`cellmap._compiled.codegen.lanes` describes, by address, and the number of orbits.  The
context is for functions that serve several systems, see :mod:`cellmap._compiled.codegen.switching`, and not used here.
Blocks are the outer loop, then the steps of a block, then the vectors of its lanes; the body of the innermost loop is
one whole step.
"""

from __future__ import annotations

import ctypes
import functools
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..._lib.arrays import Floats, Ints
from ..kernels.blocks import LANES
from ..machine_code import MachineCode, machine_code, vector_width
from .instructions import Instructions, Value, module_text, number
from .lanes import CHECKED, StepCode
from .statements import Scope, translate

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
        """Move blocks of lanes on in place, full ones by default; see :mod:`cellmap._compiled.codegen.lanes`."""
        count = len(x) * LANES if orbits is None else orbits
        arrays = (self.context, x, steps, p, error)
        context, states, numbers, parameters, errors = (array.ctypes.data for array in arrays)
        _PROTOTYPE(self.address)(context, states, numbers, start, period, parameters, errors, count)


@functools.lru_cache(maxsize=256)
def compiled_period(code: StepCode, dimension: int, parameters: int) -> CompiledPeriod:
    """Compile the function ``advance`` of :mod:`cellmap._compiled.codegen.lanes`."""
    loaded = machine_code(period_text(code, dimension, parameters, vector_width()))
    return CompiledPeriod(loaded.address("advance"), loaded)


def period_text(code: StepCode, dimension: int, parameters: int, width: int) -> str:
    """Return the text of a module with the function ``advance`` described above, for vectors of some width."""
    out, components = Instructions(width), range(dimension)
    once = parameter_scope(out, parameters)
    translate(out, code.once, once)
    with out.loop("block", blocks_of_orbits(out)) as block:
        used = lanes_in_use(out, block)
        steps = out.result(f"load i64, ptr {out.address('%steps', block)}, align 8").text
        first = out.result(f"mul i64 {block}, {dimension * LANES}").text
        x, error = out.address("%x", first), out.address("%error", first)
        with out.loop("cleared", dimension * LANES, out.width) as place:
            out.store(out.as_vector(number(0.0)), out.address(error, place))
        h = out.result(f"fdiv double %period, {out.result(f'sitofp i64 {steps} to double').text}")
        with out.loop("step", steps) as step:
            elapsed = out.binary("fmul", out.result(f"sitofp i64 {step} to double"), h)
            per_step = {**once, "h": h, "t": out.binary("fadd", Value("%start"), elapsed)}
            translate(out, code.per_step, per_step)
            with out.loop_over_lanes(used) as lane:
                rows = [out.result(f"add i64 {lane}, {j * LANES}").text for j in components]
                states, errors = ([out.address(base, row) for row in rows] for base in (x, error))
                per_lane = {**per_step, **{f"x{j}": out.load(states[j], vector=True) for j in components}}
                translate(out, code.per_lane, per_lane)
                for j in components:
                    out.store(out.as_vector(per_lane[f"y{j}"]), states[j])
                    size = out.intrinsic("fabs", out.as_vector(per_lane[f"e{j}"]))
                    out.store(out.binary("fadd", out.load(errors[j], vector=True), size), errors[j])
            _leave_if_nothing_is_finite(out, x, step, dimension, used)
    return module_text(out.function("advance", ARGUMENTS), out)


@functools.lru_cache(maxsize=256)
def compiled_rows(code: StepCode, dimension: int, parameters: int) -> MachineCode:
    """Compile ``step(rows, count, p)``, which moves the rows of an array (count, dimension) on by one step, one by one.

    It is for orbits that are followed alone, whose periods come one after the other: there lanes stay empty.
    """
    out, components = Instructions(1), range(dimension)
    scope = {**parameter_scope(out, parameters), "t": number(0.0), "h": number(1.0)}
    translate(out, (*code.once, *code.per_step), scope)
    with out.loop("row", "%count") as row:
        first = out.result(f"mul i64 {row}, {dimension}").text
        places = [out.address("%rows", out.result(f"add i64 {first}, {j}").text) for j in components]
        inside = {**scope, **{f"x{j}": out.load(place) for j, place in enumerate(places)}}
        translate(out, code.per_lane, inside)
        for j, place in enumerate(places):
            out.store(inside[f"y{j}"], place)
    return machine_code(module_text(out.function("step", "ptr noalias %rows, i64 %count, ptr noalias %p"), out))


def blocks_of_orbits(out: Instructions) -> str:
    """Return the number of blocks that the orbits fill."""
    return out.whole("sdiv", out.whole("add", "%orbits", LANES - 1), LANES)


def lanes_in_use(out: Instructions, block: str) -> str:
    """Return the number of orbits in a block."""
    left = out.whole("sub", "%orbits", out.whole("mul", block, LANES))
    fewer = out.result(f"icmp slt i64 {left}, {LANES}").text
    return out.result(f"select i1 {fewer}, i64 {left}, i64 {LANES}").text


def parameter_scope(out: Instructions, parameters: int) -> Scope:
    """Load the parameters from the array p; their names are p0, p1, ...."""
    return {f"p{i}": out.load(out.address("%p", i)) for i in range(parameters)}


def _leave_if_nothing_is_finite(out: Instructions, x: str, step: str, dimension: int, used: str) -> None:
    """Look now and then whether a lane is finite: many steps are taken where few have failed, and there it is worth it.

    The flag of a vector of lanes is set where all components are finite.
    """
    place = out.result(f"and i64 {step}, {CHECKED - 1}").text
    out.write(f"%checked = icmp eq i64 {place}, {CHECKED - 1}")
    out.write("br i1 %checked, label %look, label %step.end")
    out.label("look")
    found: Value | None = None
    for lane in range(0, LANES, out.width):
        whole: Value | None = None
        for j in range(dimension):
            size = out.intrinsic("fabs", out.load(out.address(x, j * LANES + lane), vector=True))
            finite = out.compare("olt", size, number(float("inf")))
            whole = finite if whole is None else out.logical("and", whole, finite)
        assert whole is not None, "a system has components"
        among = out.as_vector(Value(out.result(f"icmp slt i64 {lane}, {used}").text, flag=True))
        whole = out.logical("and", whole, among)
        found = whole if found is None else out.logical("or", found, whole)
    assert found is not None
    out.write(f"br i1 {out.over_lanes('or', found)}, label %step.end, label %block.end")
    out.label("unreached")
