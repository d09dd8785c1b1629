"""Shared frame of the integrators: one period of many initial conditions, in SIMD lanes.

The generated function is

    advance(context, x, steps, start, period, p, error, orbits)

with addresses of arrays: blocks ``x`` of shape (blocks, dimension, LANES), the number of steps of each block, the time
at which the period begins, its length, the parameters, and ``error`` of the shape of x, which receives the sum of the
estimated local errors of each component; and the number of orbits in the blocks.  Lanes of the last block beyond these
hold copies, which may be moved on or not.  The loop over lanes is innermost and its body is one whole step,
straight-line code on scalars.  What does not depend on the state stands before that loop.

A method supplies the code of a step; see :mod:`runge_kutta` and :mod:`taylor`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from ..kernels.blocks import LANES

HEADER = """\
import math
from numba import carray, cfunc, njit
from cellmap._compiled.for_numba import INLINE, LOOP, PERIOD
from cellmap._compiled.kernels import simd_math
from cellmap._compiled.kernels.sums import dot

"""

CHECKED = 256
"""Steps between two looks at whether any lane of a block is still finite."""


@dataclass(frozen=True)
class StepCode:
    """Source lines of one step of a method, for one right-hand side.

    ``once`` runs before everything, ``per_step`` before the lane loop of each step (it sees the step size h and the
    time t), ``per_lane`` in the lane loop: it turns x0, x1, ... into y0, y1, ... and leaves estimates of the local
    error in e0, e1, ....
    """

    once: tuple[str, ...]
    per_step: tuple[str, ...]
    per_lane: tuple[str, ...]


def lane_module(code: StepCode, dimension: int, parameters: int) -> str:
    """Return the text of a module with the function ``advance`` described above."""
    components = range(dimension)
    lines = [
        "@cfunc(PERIOD, **LOOP)",
        "def advance(context, states, steps, start, period, p, errors, orbits):",
        f"    blocks = (orbits + {LANES - 1}) // {LANES}",
        f"    x = carray(states, (blocks, {dimension}, {LANES}))",
        f"    error = carray(errors, (blocks, {dimension}, {LANES}))",
        *indent(1, (f"p{i} = p[{i}]" for i in range(parameters))),
        *indent(1, code.once),
        "    for b in range(blocks):",
        "        h = period / steps[b]",
        *indent(2, (f"x_{j} = x[b, {j}]; e_{j} = error[b, {j}]" for j in components)),
        *indent(2, (f"e_{j}[:] = 0.0" for j in components)),
        "        for step in range(steps[b]):",
        "            t = start + step * h",
        *indent(3, code.per_step),
        f"            for i in range({LANES}):",
        *indent(4, (f"x{j} = x_{j}[i]" for j in components)),
        *indent(4, code.per_lane),
        *indent(4, (f"x_{j}[i] = y{j}; e_{j}[i] += abs(e{j})" for j in components)),
        # A large number of steps follows failures with fewer: stop as soon as no lane is finite any more.
        f"            if step % {CHECKED} == {CHECKED - 1} and steps[b] >= {CHECKED}:",
        "                finite = 0",
        f"                for i in range({LANES}):",
        "                    finite += " + " and ".join(f"abs(x_{j}[i]) < math.inf" for j in components),
        "                if finite == 0:",
        "                    break",
    ]
    return HEADER + called(dimension) + "\n".join(lines) + "\n"


def called(dimension: int) -> str:
    """Return the text of a function ``defined``: that of the user, and NaN where it raises an exception.

    A lane whose function raises would end the work on all lanes.
    """
    targets = "".join(f"y{j}, " for j in range(dimension))
    return "\n".join(
        [
            "@njit(**INLINE)",
            "def defined(t, x, p):",
            "    try:",
            f"        {targets}= rhs(t, x, p)",
            "    except Exception:",
            *indent(2, (f"y{j} = math.nan" for j in range(dimension))),
            f"    return {targets}",
            "",
            "",
        ]
    )


def indent(depth: int, lines: Iterable[str]) -> list[str]:
    """Indent source lines by `depth` levels."""
    return ["    " * depth + line for line in lines]
