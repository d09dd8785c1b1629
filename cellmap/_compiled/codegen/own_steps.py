"""Frame of integrators in which each lane has a step of its own: one period of many initial conditions.

The function has the signature that :mod:`cellmap._compiled.codegen.period` describes.  What it is called with besides
is its context, numbers all: the relative tolerance, the largest number of steps, the longest step, for each component
the size up to which it counts in the relative tolerance, and for each its absolute tolerance.  In the place of a number
of steps, a block has the number by which the tolerance of a single step is divided.

A step is as long as its own error allows, and refused where that was too long.  Its error counts as far as later steps
do not damp it; the sum of that is what ``error`` receives.  It is infinite for a lane that has not come to the end.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from ..kernels.blocks import LANES
from ..machine_code import vector_width
from . import simd_math
from .instructions import Instructions, Value, module_text, number, total, where
from .period import (
    ARGUMENTS,
    CompiledPeriod,
    Values,
    blocks_of_orbits,
    compiled_advance,
    lanes_in_use,
    loaded_parameters,
)
from .rosenbrock import OwnStep, OwnStepOfLane

NUMBERS = 3
"""Numbers of the context before those of the components."""

_FIRST = 1e-4  # first step, as a fraction of the period; it grows or shrinks soon
_HIGHER = 10.0
_SHORTEST = 1e-15  # shortest step, as a fraction of the period


def compiled_own_steps(step: OwnStep, dimension: int, parameters: int, quick: bool = False) -> CompiledPeriod:
    """Compile the function."""
    return compiled_advance(own_steps_text(step, dimension, parameters, vector_width()), quick)


@dataclass(frozen=True)
class _StepControl:
    """Data that all lanes of a block share: times, lengths of steps, tolerances, and the part of these for one step."""

    end: Value
    first: Value
    least: Value
    longest: Value
    rtol: Value
    atol: Values
    largest: Values
    fraction: Value


def own_steps_text(step: OwnStep, dimension: int, parameters: int, width: int) -> str:
    """Return the text of a module with the function, for vectors of some width."""
    out, components = Instructions(width), range(dimension)
    times, lengths = out.array(LANES), out.array(LANES)
    p = loaded_parameters(out, parameters)
    numbers = [out.load(out.address("%context", i)) for i in range(NUMBERS + 2 * dimension)]
    (rtol, limit, longest), start, period = numbers[:NUMBERS], out.argument("%start"), out.argument("%period")
    largest, atol = numbers[NUMBERS : NUMBERS + dimension], numbers[NUMBERS + dimension :]
    end, first, least = start + period, period * _FIRST, period * _SHORTEST
    per_lane = step(out, p)
    most = out.result(f"fptosi double {limit.text} to i64").text
    with out.loop("block", blocks_of_orbits(out)) as block:
        used, taken = lanes_in_use(out, block), out.address("%steps", block)
        fraction = out.result(f"sitofp i64 {out.load_whole(taken)} to double")
        shared = _StepControl(end, first, least, longest, rtol, atol, largest, fraction)
        place_of_block = out.whole("mul", block, dimension * LANES)
        x, error = out.address("%x", place_of_block), out.address("%error", place_of_block)
        _fill(out, "cleared", dimension * LANES, {error: number(0.0)})
        _fill(out, "ended", LANES, {times: end})
        _fill(out, "begun", used, {times: start, lengths: first})
        with out.loop("step", most) as number_of_step:
            out.store_whole(out.whole("add", number_of_step, 1), taken)
            with out.loop_over_lanes(used) as lane:
                rows = [out.whole("add", lane, j * LANES) for j in components]
                places = [out.address(base, row) for base in (x, error) for row in rows]
                places += [out.address(times, lane), out.address(lengths, lane)]
                known = [out.load(place, vector=True) for place in places]
                for place, value in zip(places, _moved(shared, per_lane, dimension, known), strict=True):
                    out.store(out.as_vector(value), place)
            _leave_at_the_end(out, times, end)
        with out.loop("closed", LANES, out.width) as lane:
            at_end = out.load(out.address(times, lane), vector=True) >= end
            for j in components:
                place = out.address(error, out.whole("add", lane, j * LANES))
                out.store(where(at_end, abs(out.load(place, vector=True)), float("inf")), place)
    return module_text(out.function("advance", ARGUMENTS), out)


def _fill(out: Instructions, name: str, count: str | int, values: Mapping[str, Value]) -> None:
    """Write a loop that fills arrays, each with a number."""
    with out.loop(name, count, out.width) as place:
        for array, value in values.items():
            out.store(out.as_vector(value), out.address(array, place))


def _moved(shared: _StepControl, per_lane: OwnStepOfLane, dimension: int, known: Values) -> list[Value]:
    """Write a step of a lane: states, errors brought along, time, and the length that was wanted, before and after.

    A lane at the end goes on in vain: nothing of it is kept.
    """
    before, brought, (t, wanted) = known[:dimension], known[dimension : 2 * dimension], known[2 * dimension :]
    left = shared.end - t
    h = where(left > 0.0, simd_math.fmin(simd_math.fmin(wanted, shared.longest), left), shared.first)
    after, local, passed = per_lane(t, h, before, brought)
    scales = [
        floor + shared.rtol * simd_math.fmin(simd_math.fmax(abs(u), abs(v)), largest)
        for floor, u, v, largest in zip(shared.atol, before, after, shared.largest, strict=True)
    ]
    size = shared.fraction * total(_sizes(local, scales, after))
    takes = where((size <= 1.0) & (left > 0.0), 1.0, 0.0)
    lost = where((left > 0.0) & takes.equals(0.0) & (h < shared.least), 1.0, 0.0)
    arrived = _chosen(lost, shared.end, takes, where(h >= left, shared.end, t + h), t)
    states = [_chosen(lost, number(float("inf")), takes, y, x) for y, x in zip(after, before, strict=True)]
    # The error of the step is smaller than that of the order below by about its own relative size to the power 1/5.
    power = _eighth_root(total(map(abs, local)) / total(map(abs, after)))
    power = simd_math.fmin(_HIGHER * power * simd_math.sqrt(power), number(1.0))
    errors = [where(takes > 0.0, b + power * e, a) for a, b, e in zip(brought, passed, local, strict=True)]
    return [*states, *errors, arrived, _next_length(h, size, takes, wanted)]


def _next_length(h: Value, size: Value, takes: Value, wanted: Value) -> Value:
    """Write how long the next step is to be after one of a relative error."""
    # The power 3/16, near the 1/5 that a method of order 5 asks for, by square roots.
    eighth = _eighth_root(simd_math.fmax(size, number(1e-12)))
    change = 0.9 / (eighth * simd_math.sqrt(eighth))
    bounded = simd_math.fmin(simd_math.fmax(change, number(0.2)), number(6.0))
    following = h * where(size < 1e300, bounded, 0.1)
    return where((takes > 0.0) & (h < wanted), simd_math.fmax(following, wanted), following)


def _sizes(errors: Values, scales: Values, states: Values) -> Iterator[Value]:
    """Write the relative errors; a state that is not finite makes them NaN."""
    for error, scale, state in zip(errors, scales, states, strict=True):
        yield abs(error) / scale
        yield 0.0 * state


def _chosen(lost: Value, at_end: Value, takes: Value, moved: Value, kept: Value) -> Value:
    """Return one of three, for a lane that is lost, takes the step, or does not."""
    return where(lost > 0.0, at_end, where(takes > 0.0, moved, kept))


def _eighth_root(x: Value) -> Value:
    return simd_math.sqrt(simd_math.sqrt(simd_math.sqrt(x)))


def _leave_at_the_end(out: Instructions, times: str, end: Value) -> None:
    """Leave the loop over steps where all lanes are at the end."""
    arrived: Value | None = None
    for lane in range(0, LANES, out.width):
        these = out.compare("oge", out.load(out.address(times, lane), vector=True), end)
        arrived = these if arrived is None else out.logical("and", arrived, these)
    assert arrived is not None
    out.write(f"br i1 {out.over_lanes('and', arrived)}, label %step.done, label %step.end")
    out.label("unreached")
