"""Compiled kernels: the loop over lanes is vector code, without a call."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import pytest

from cellmap import ForcedSystem
from cellmap._compiled.codegen.kernel import flow_kernel, jet_flow_kernel, traced_function
from cellmap._compiled.codegen.methods import choose_method
from cellmap._compiled.codegen.period import compiled_period, period_text

# Arithmetic on doubles, in the assembly of x86 (SSE2, AVX, AVX-512) and of ARM (NEON).
PACKED = re.compile(r"\s(v?(add|sub|mul|div|fn?m(add|sub)\w*)pd|f(add|sub|mul|div|mla|mls)(\.2d)?\s+v\d+\.2d)\b")
SCALAR = re.compile(r"\s(v?(add|sub|mul|div|fn?m(add|sub)\w*)sd|f(add|sub|mul|div|n?madd|n?msub)\s+d\d+)\b")
CALL = re.compile(r"^\s+(call\w*|blr?)\s")
LABEL = re.compile(r"^([.\w$]+):")
JUMP = re.compile(r"^\s+(?:j\w+|b(?:\.\w+)?|cbn?z\s+\w+,|tbn?z\s+\w+,\s*#\d+,)\s+([.\w$]+)\s*$")


@dataclass(frozen=True)
class Loop:
    packed: int
    scalar: int
    calls: int


def innermost_loops(assembly: str) -> list[Loop]:
    """Count the instructions of every loop that holds no other loop; all jumps back to a label are of one loop."""
    lines = assembly.splitlines()
    labels = {m[1]: i for i, line in enumerate(lines) if (m := LABEL.match(line))}
    jumps = {i: labels.get(m[1]) for i, line in enumerate(lines) if (m := JUMP.match(line))}
    spans = {(begin, end) for end, begin in jumps.items() if begin is not None and begin < end}
    spans = {(begin, max(e for b, e in spans if b == begin)) for begin, _ in spans}
    loops = []
    for begin, end in sorted(spans):
        if not any(begin <= b and e <= end and (b, e) != (begin, end) for b, e in spans):
            body = lines[begin:end]
            loops.append(Loop(*(sum(bool(p.search(line)) for line in body) for p in (PACKED, SCALAR, CALL))))
    return loops


def lane_loop(assembly: str) -> Loop:
    return max(innermost_loops(assembly), key=lambda loop: loop.packed + loop.scalar)


def assembly_of(rhs: Callable[..., Any], dimension: int, names: tuple[str, ...], method: str = "auto") -> str:
    traced = traced_function(rhs, dimension, names)
    step: Any = choose_method(method, traced, 1e-9).write(traced)
    assembly: str = compiled_period(step, dimension, len(names)).code.assembly
    return assembly


def text_of(traced: Any, method: str, parameters: int = 0) -> str:
    """Instructions of a period, in vectors of four."""
    step: Any = choose_method(method, traced, 1e-9).write(traced)
    return period_text(step, len(traced.states), parameters, 4)


@pytest.mark.usefixtures("usual_arguments")
@pytest.mark.parametrize(
    ("name", "method"), [("pendulum, 3 mm", "DOP853"), ("pendulum, 3 mm", "Taylor"), ("double pendulum", "DOP853")]
)
def test_the_lane_loop_is_vector_code_without_a_call(problems, name, method):
    system = problems[name]
    assembly = assembly_of(system.rhs, system.dimension, tuple(system.params), method)
    loops = [loop for loop in innermost_loops(assembly) if loop.packed > 100]
    assert loops, "no loop holds packed arithmetic"
    assert all(loop.calls == 0 and loop.scalar == 0 for loop in loops)
    assert all(loop.calls == 0 for loop in innermost_loops(assembly) if loop.scalar > 100)


def test_the_c_library_is_called_for_large_angles_alone(problems: Mapping[str, ForcedSystem]) -> None:
    traced = traced_function(problems["double pendulum"].rhs, 4, tuple(problems["double pendulum"].params))
    text = text_of(traced, "DOP853", 3)
    in_lanes = text[text.index("lane.body:") : text.index("lane.done:")]
    blocks = re.split(r"^(?=\S+:$)", in_lanes, flags=re.MULTILINE)
    called = {block.split(":")[0] for block in blocks if re.search(r"call .*@(?!llvm\.)", block)}
    assert called
    assert all(re.fullmatch(r"seldom\d+", name) for name in called)


def test_a_branch_on_the_state_is_vector_code_and_a_function_without_vector_form_a_call() -> None:
    """The control of the tests above: atan2 comes from libm, and the detector sees it."""

    def branching(t: float, x: Any, p: Any) -> tuple[float, float]:
        stiffness = 1.0 if x[0] > 0.0 else p.k
        return x[1], math.sin(t) - stiffness * x[0]

    assert lane_loop(assembly_of(branching, 2, ("k",), "RK45")).calls == 0
    assert lane_loop(assembly_of(lambda t, x, p: (x[1], -math.atan2(x[0], 1.0)), 2, (), "DOP853")).calls > 0


def test_a_step_of_the_undriven_pendulum_evaluates_one_sine_a_stage() -> None:
    traced = traced_function(lambda t, x, p: (x[1], -math.sin(x[0])), 2, ())
    for method, stages in (("DOP853", 12), ("RK45", 7)):
        text = text_of(traced, method)
        assert text.count(" = call <4 x double> @lanes.sin.4(") == stages
        assert "cos" not in text


def test_what_depends_on_time_alone_stands_before_the_lane_loop(problems: Mapping[str, ForcedSystem]) -> None:
    system = problems["pendulum, 3 mm"]
    traced = traced_function(system.rhs, 2, tuple(system.params))
    for method in ("DOP853", "RK45", "Taylor"):
        body = text_of(traced, method, len(system.params))
        before, in_lanes = body[body.index("entry:") :].split("lane.body:")
        assert "call double @cos(" in before
        assert "call double @cos(" not in in_lanes
        # Those of the estimates of errors, and none by a parameter.
        assert in_lanes.count(" = fdiv ") == (2 if method == "DOP853" else 0)


def test_kernels_hold_no_parameter_values(problems: Mapping[str, ForcedSystem]) -> None:
    system = problems["Duffing"]
    other = system.with_params(forcing=0.123456, damping=0.654321, frequency=1.5)
    names = tuple(system.params)
    assert flow_kernel(system.rhs, 2, names, "auto", 1e-9) is flow_kernel(other.rhs, 2, names, "auto", 1e-9)
    assert jet_flow_kernel(system.rhs, 2, names, 1e-12, 1) is jet_flow_kernel(other.rhs, 2, names, 1e-12, 1)
