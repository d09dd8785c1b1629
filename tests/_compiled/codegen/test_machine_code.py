"""Machine code from formulas: the same instructions for all processors, and the meaning that the formulas have."""

import ctypes
import io
import math
import re
import sys
import threading
from typing import Any

import numpy as np
import pytest

from cellmap._compiled import machine_code
from cellmap._compiled.codegen.instructions import Instructions
from cellmap._compiled.codegen.kernel import discrete_kernel, tangent_step, traced_function
from cellmap._compiled.codegen.methods import choose_method
from cellmap._compiled.codegen.period import period_text
from cellmap._compiled.kernels.blocks import LANES
from cellmap._compiled.machine_code import assembly_for, object_code


def applied(function: Any, points: Any, parameters: tuple[float, ...] = ()) -> Any:
    """Images of points (n, d) under a traced function of the state, in lanes."""
    n, d = points.shape
    padded = np.zeros((-(-n // LANES) * LANES, d))
    padded[:n] = points
    blocks = np.ascontiguousarray(padded.reshape(-1, LANES, d).transpose(0, 2, 1))
    names = tuple(f"p{i}" for i in range(len(parameters)))
    kernel = discrete_kernel(lambda t, x, p: function(x, p), d, names, 0)
    kernel(blocks, np.ones(len(blocks), np.int64), 0.0, 1.0, np.array(parameters), np.empty_like(blocks))
    return blocks.transpose(0, 2, 1).reshape(-1, d)[:n]


@pytest.mark.parametrize("name", ["sin", "cos", "tan", "exp", "sinh", "cosh", "tanh", "atan"])
def test_elementary_functions_are_the_same_in_vectors_and_alone_to_the_bit(name: str) -> None:
    function = getattr(math, name)
    values = np.concatenate([np.random.default_rng(0).uniform(-30.0, 30.0, 1000), [0.0, -0.0, 1e9, 800.0, math.nan]])
    alone = tangent_step(lambda t, x, p: (function(x[0]),), 1, ())
    rows, none = np.stack([values, np.zeros_like(values)], axis=1), np.zeros(1)
    step = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p)(alone.address("step"))
    step(rows.ctypes.data, len(rows), none.ctypes.data)
    found = applied(lambda x, p: (function(x[0]),), values[:, None])[:, 0]
    assert np.array_equal(found, rows[:, 0], equal_nan=True)


def test_the_worked_example_of_the_documentation() -> None:
    """Each operation of a step is one instruction of LLVM, and those of shared numbers are computed once."""
    out = Instructions(4)
    h = out.load("%h")
    with out.loop_over_lanes(LANES):
        0.5 * h * out.load("%x", vector=True)
    body = "\n".join(out.lines)
    before, inside = body.split("lane.body:")
    assert re.findall("fmul contract .*", before) == ["fmul contract double 0x3FE0000000000000, %v1"]
    assert len(re.findall("fmul contract .*", inside)) == 1
    assert re.search(r"fmul contract <4 x double> %v\d+, %v\d+", inside)


PROCESSORS = {
    "x86_64-unknown-linux-gnu haswell": (4, r"vfn?m(add|sub)\d+pd\s.*%ymm"),
    "x86_64-unknown-linux-gnu znver4": (8, r"vfn?m(add|sub)\d+pd\s.*%zmm"),
    "arm64-apple-macosx13.0.0 apple-m1": (4, r"fml[as]\.2d\s+v"),
}


@pytest.mark.parametrize("processor", PROCESSORS)
def test_other_processors_get_vector_code(processor: str) -> None:
    """Object code for AVX2, AVX-512 and NEON, with fused multiply-adds on vectors."""
    triple, cpu = processor.split()
    width, packed = PROCESSORS[processor]

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -p.damping * x[1] - (1.0 + 0.2 * math.cos(t)) * math.sin(x[0])

    traced = traced_function(rhs, 2, ("damping",))
    step: Any = choose_method("auto", traced, 1e-9).write(traced)
    text = period_text(step, 2, 1, width)
    assert len(object_code(text, triple, cpu, "")) > 1000
    assert len(re.findall(packed, assembly_for(text, triple, cpu, ""))) > 100


class Terminal(io.StringIO):
    """A terminal that tells when something is written to it."""

    def __init__(self) -> None:
        super().__init__()
        self.told = threading.Event()

    def isatty(self) -> bool:
        return True

    def flush(self) -> None:
        self.told.set()


@pytest.mark.parametrize("terms", [3, 2000])
def test_the_compilation_of_large_formulas_is_announced(terms: int, monkeypatch: Any) -> None:
    """What is compiled, and how large it is: on the terminal while the compiler is at work."""
    terminal = Terminal()

    def slow(text: str, *arguments: Any) -> bytes:
        if terms > 100:
            assert terminal.told.wait(20.0)
        return object_code("", *arguments[:-1])

    def long_sum(t: float, x: Any, p: Any) -> Any:
        total = x[0]
        for k in range(terms):
            total = total * (k + 0.25) + x[0] - 0.5 * k
        return (total,)

    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(machine_code, "_PATIENCE", 0.0)
    monkeypatch.setattr(machine_code, "object_code", slow)
    monkeypatch.setattr(machine_code, "compiled_once", lambda text, compiled, level: compiled())
    with pytest.raises(AttributeError):  # nothing has been compiled
        discrete_kernel(long_sum, 1, (), 0)
    found = re.search(r"compiles the formulas of .*long_sum: ([\d,]+) instructions", terminal.getvalue())
    assert (found is not None) is (terms > 100)
    assert found is None or 3 * terms < int(found[1].replace(",", "")) < 10 * terms
