"""Frame of integrators in which each lane has a step of its own: one period of many initial conditions.

The function has the signature that :mod:`cellmap._compiled.codegen.period` describes.  What it is called with besides
is its context, numbers all: the relative tolerance, the largest number of steps, the longest step, for each component
the size up to which it counts in the relative tolerance, and for each its absolute tolerance.  In the place of a number
of steps, a block has the number by which the tolerance of a single step is divided.

A step is as long as its own error allows, and refused where that was too long.  Its error counts as far as later steps
do not damp it; the sum of that is what ``error`` receives.  It is infinite for a lane that has not come to the end.
"""

from __future__ import annotations

import functools

from ..kernels.blocks import LANES
from ..machine_code import machine_code, vector_width
from .instructions import Instructions, Value, module_text, number
from .period import ARGUMENTS, CompiledPeriod, blocks_of_orbits, lanes_in_use, parameter_scope
from .rosenbrock import OwnStepCode
from .statements import Scope, translate

NUMBERS = 3
"""Numbers of the context before those of the components."""

_FIRST = 1e-4  # of the period, a step that grows or shrinks soon
_HIGHER = 10.0
_SHORTEST = 1e-15  # of the period


@functools.lru_cache(maxsize=256)
def compiled_own_steps(code: OwnStepCode, dimension: int, parameters: int) -> CompiledPeriod:
    """Compile the function."""
    loaded = machine_code(own_steps_text(code, dimension, parameters, vector_width()))
    return CompiledPeriod(loaded.address("advance"), loaded)


def own_steps_text(code: OwnStepCode, dimension: int, parameters: int, width: int) -> str:
    """Return the text of a module with the function, for vectors of some width."""
    out, components = Instructions(width), range(dimension)
    times, lengths = out.array(LANES), out.array(LANES)
    once = parameter_scope(out, parameters)
    once |= {name: out.load(out.address("%context", i)) for i, name in enumerate(("rtol", "limit", "longest"))}
    once |= {f"largest{j}": out.load(out.address("%context", NUMBERS + j)) for j in components}
    once |= {f"atol{j}": out.load(out.address("%context", NUMBERS + dimension + j)) for j in components}
    once |= {"period": Value("%period"), "end": out.binary("fadd", Value("%start"), Value("%period"))}
    translate(out, [f"first = period * {_FIRST!r}", f"least = period * {_SHORTEST!r}", *code.once], once)
    limit = out.result(f"fptosi double {once['limit'].text} to i64").text
    with out.loop("block", blocks_of_orbits(out)) as block:
        used = lanes_in_use(out, block)
        fraction = out.result(f"sitofp i64 {out.load_whole(out.address('%steps', block))} to double")
        first = out.whole("mul", block, dimension * LANES)
        x, error = out.address("%x", first), out.address("%error", first)
        with out.loop("cleared", dimension * LANES, out.width) as place:
            out.store(out.as_vector(number(0.0)), out.address(error, place))
        with out.loop("ended", LANES, out.width) as place:
            out.store(out.as_vector(once["end"]), out.address(times, place))
        with out.loop("begun", used, out.width) as place:
            out.store(out.as_vector(Value("%start")), out.address(times, place))
            out.store(out.as_vector(once["first"]), out.address(lengths, place))
        taken = out.address("%steps", block)
        with out.loop("step", limit) as step:
            out.store_whole(out.whole("add", step, 1), taken)
            with out.loop_over_lanes(used) as lane:
                rows = [out.whole("add", lane, j * LANES) for j in components]
                states, errors = ([out.address(base, row) for row in rows] for base in (x, error))
                here, length = out.address(times, lane), out.address(lengths, lane)
                scope: Scope = {**once, "fraction": fraction, "t": out.load(here, vector=True)}
                scope |= {"wanted": out.load(length, vector=True)}
                scope |= {f"x{j}": out.load(states[j], vector=True) for j in components}
                scope |= {f"a{j}": out.load(errors[j], vector=True) for j in components}
                translate(out, [*_before(), *code.per_lane, *_after(dimension)], scope)
                for j in components:
                    out.store(out.as_vector(scope[f"x{j}"]), states[j])
                    out.store(out.as_vector(scope[f"a{j}"]), errors[j])
                out.store(out.as_vector(scope["t"]), here)
                out.store(out.as_vector(scope["wanted"]), length)
            _leave_at_the_end(out, times, once["end"])
        with out.loop("closed", LANES, out.width) as lane:
            arrived = out.compare("oge", out.load(out.address(times, lane), vector=True), once["end"])
            for j in components:
                place = out.address(error, out.whole("add", lane, j * LANES))
                size = out.intrinsic("fabs", out.load(place, vector=True))
                out.store(out.select(arrived, size, number(float("inf"))), place)
    return module_text(out.function("advance", ARGUMENTS), out)


def _before() -> list[str]:
    """Write the length of a step.  A lane at the end goes on in vain: nothing of it is kept."""
    return [
        "left = end - t",
        "h = simd_math.fmin(simd_math.fmin(wanted, longest), left) if left > 0.0 else first",
    ]


def _after(dimension: int) -> list[str]:
    """Write what becomes of a step: taken or refused, and how long the next one is to be."""
    components = range(dimension)
    lines = [
        f"z{j} = atol{j} + rtol * simd_math.fmin(simd_math.fmax(abs(x{j}), abs(y{j})), largest{j})" for j in components
    ]
    # A state that is not finite makes the sum NaN.
    total = " + ".join(f"abs(e{j}) / z{j} + 0.0 * y{j}" for j in components)
    lines += [
        f"u = fraction * ({total})",
        "takes = 1.0 if u <= 1.0 and left > 0.0 else 0.0",
        "lost = 1.0 if left > 0.0 and takes == 0.0 and h < least else 0.0",
        # The power 3/16, near the 1/5 that a method of order 5 asks for, by square roots.
        "eighth = math.sqrt(math.sqrt(math.sqrt(simd_math.fmax(u, 1e-12))))",
        "change = 0.9 / (eighth * math.sqrt(eighth))",
        "bounded = simd_math.fmin(simd_math.fmax(change, 0.2), 6.0)",
        "next = h * (bounded if u < 1e300 else 0.1)",
        "wanted = simd_math.fmax(next, wanted) if takes > 0.0 and h < wanted else next",
        "reached = end if h >= left else t + h",
        "t = end if lost > 0.0 else (reached if takes > 0.0 else t)",
    ]
    lines += [f"x{j} = float('inf') if lost > 0.0 else (y{j} if takes > 0.0 else x{j})" for j in components]
    # The error of the step is smaller than that of the order below by about its own relative size to the power 1/5.
    lines.append(
        f"rel = ({' + '.join(f'abs(e{j})' for j in components)}) / ({' + '.join(f'abs(y{j})' for j in components)})"
    )
    lines += [
        "power = math.sqrt(math.sqrt(math.sqrt(rel)))",
        f"power = simd_math.fmin({_HIGHER!r} * power * math.sqrt(power), 1.0)",
    ]
    return lines + [f"a{j} = b{j} + power * e{j} if takes > 0.0 else a{j}" for j in components]


def _leave_at_the_end(out: Instructions, times: str, end: Value) -> None:
    """Leave the loop over steps where all lanes are at the end."""
    arrived: Value | None = None
    for lane in range(0, LANES, out.width):
        these = out.compare("oge", out.load(out.address(times, lane), vector=True), end)
        arrived = these if arrived is None else out.logical("and", arrived, these)
    assert arrived is not None
    out.write(f"br i1 {out.over_lanes('and', arrived)}, label %step.done, label %step.end")
    out.label("unreached")
