"""Iteration of a tabulated map: look-ups of a tensor B-spline, in blocks of starts.

The generated function is

    look_up(points, turns, left, table, strides, origin, inverse, cells, circle, reach, lower, turn)

It moves row i of ``points`` on by ``left[i]`` periods, or until the row leaves the table or enters a cell that the
table does not serve; ``left`` keeps the periods that were not made.  It returns the number of look-ups.

``origin``, ``inverse`` (one over the node distance) and ``cells`` describe the table; ``circle`` is the number of node
distances in a turn, 0 on the line; ``lower`` and ``turn`` say how angles are kept.  ``strides`` has the doubles between
neighbours along each axis and then those of the whole table of one period; the tables of 2, 4, ... periods follow that
one in ``table``.  ``reach`` says for each cell how many of the tables serve there, 0 for none; an empty one stands for
one everywhere.  A row takes the longest leap that its cell allows and that does not go past its ``left``.

The states of a block are kept component by component.  Places in the table and whole turns are found for all of its
lanes at once, full or not, in vector code, so that a start has the same image whatever its neighbours are; the sums
over coefficients follow row by row, where :mod:`cellmap.kernels.contraction` makes vectors along the table.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator

from .lanes import indent
from .module import generated_module

BLOCK = 64


@functools.cache
def lookup_kernel(dimension: int, order: int):  # type: ignore[no-untyped-def]
    """Return the compiled ``look_up`` for maps of a dimension and splines of an order."""
    return generated_module(lookup_text(dimension, order)).look_up


def lookup_text(dimension: int, order: int) -> str:
    """Return the text of a module with the function ``look_up`` described above."""
    axes = range(dimension)
    outer = max(dimension - 2, 0)  # axes that are summed by loops, before the vectors of the last two
    lines = [
        "from math import floor",
        "import numpy as np",
        "from numba import njit",
        "from cellmap.kernels.contraction import basis_polynomials, contraction",
        "from cellmap.kernels.options import KERNEL",
        f"BASIS = np.array(basis_polynomials({order}))",
        f"contract = contraction({dimension - outer}, {order}, {dimension})",
        "",
        "@njit('int64(float64[:, ::1], int64[:, ::1], int64[::1], float64[::1], int64[::1], float64[::1],"
        " float64[::1], int64[::1], float64[::1], uint8[::1], float64[::1], float64[::1])', **KERNEL)",
        "def look_up(points, turns, left, table, strides, origin, inverse, cells, circle, reach, lower, turn):",
        *indent(1, _constants(dimension)),
        *indent(1, (f"x_{a} = np.empty({BLOCK}); w_{a} = np.empty({BLOCK}); f_{a} = np.empty({BLOCK})" for a in axes)),
        *indent(1, (f"{name} = np.zeros({BLOCK}, np.int64)" for name in ("member", "rest", "cell", "first", "inside"))),
    ]
    lines += ["    made = 0"]
    if outer:
        lines += [f"    weights = np.empty(({outer}, {order + 1}))"]
    lines += [
        f"    for begin in range(0, points.shape[0], {BLOCK}):",
        f"        count = min({BLOCK}, points.shape[0] - begin)",
        f"        for m in range({BLOCK}):",
        "            i = begin + min(m, count - 1)",
        "            member[m] = i; rest[m] = left[i]",
        *indent(3, (f"x_{a}[m] = points[i, {a}]; w_{a}[m] = 0.0" for a in axes)),
        "        while count > 0:",
        f"            for m in range({BLOCK}):",
        *indent(4, _places(dimension)),
        "            m = 0",
        "            while m < count:",
        *indent(4, _steps(dimension)),
        *indent(4, _sums(dimension, order, outer)),
        "                m += 1",
        f"            for m in range({BLOCK}):",
        *indent(4, _turns(dimension)),
        # Mostly all rows have the same number of periods to make, and are through together.
        "            remaining = 0",
        "            for m in range(count):",
        "                remaining |= rest[m]",
        "            if remaining == 0:",
        "                for m in range(count):",
        *indent(5, _written_back(dimension)),
        "                count = 0",
        "    return made",
    ]
    return "\n".join(lines) + "\n"


def _constants(dimension: int) -> Iterator[str]:
    """Numbers of the table and the angles; those that would divide by a turn are 0 on the line."""
    for a in range(dimension):
        yield f"origin{a} = origin[{a}]; inverse{a} = inverse[{a}]; stride{a} = strides[{a}]; cells{a} = cells[{a}]"
        yield f"circle{a} = circle[{a}]; line{a} = not circle{a} > 0.0; lower{a} = lower[{a}]; turn{a} = turn[{a}]"
        yield f"around{a} = 0.0 if line{a} else 1.0 / circle{a}"
        yield f"cut{a} = lower{a} if turn{a} > 0.0 else 0.0; inverse_turn{a} = 1.0 / turn{a} if turn{a} > 0.0 else 0.0"
        yield f"last{a} = cells{a} - 1.0"
    yield f"size = strides[{dimension}]; levels = reach.size > 0"


def _places(dimension: int) -> Iterator[str]:
    """Cell and place in it of one lane; the first cell where the lane is outside of the table."""
    axes = range(dimension)
    for a in axes:
        yield f"u{a} = (x_{a}[m] - origin{a}) * inverse{a}"
        yield f"u{a} -= circle{a} * floor(u{a} * around{a})"
        yield f"u{a} = u{a} if line{a} | ((0.0 <= u{a}) & (u{a} < circle{a})) else 0.0"
    yield "within = " + " & ".join(f"(0.0 <= u{a}) & (u{a} <= cells{a})" for a in axes)
    for a in axes:
        yield f"u{a} = u{a} if within else 0.0"
        yield f"c{a} = min(floor(u{a}), last{a})"
        yield f"f_{a}[m] = u{a} - c{a}"
        yield f"n{a} = np.int64(c{a})"
    yield "first[m] = " + " + ".join(f"n{a} * stride{a}" for a in axes)
    flat = "n0"
    for a in axes[1:]:
        flat = f"({flat}) * cells{a} + n{a}"
    yield f"cell[m] = {flat}"
    yield "inside[m] = within"


def _steps(dimension: int) -> Iterator[str]:
    """Choose the table of a row; a row that cannot go on is written back, and the last one takes its lane."""
    axes = range(dimension)
    yield "level = inside[m] if rest[m] > 0 else 0"
    yield "if levels and level > 0:"
    yield "    level = np.int64(reach[np.uint64(cell[m])])"
    yield "    while level > 1 and rest[m] >> (level - 1) == 0:"
    yield "        level -= 1"
    yield "if level == 0:"
    yield from indent(1, _written_back(dimension))
    yield "    count -= 1"
    for name in ("member", "rest", "cell", "first", "inside", *(f"{v}_{a}" for a in axes for v in "xwf")):
        yield f"    {name}[m] = {name}[count]"
    yield "    continue"
    yield "made += 1"
    yield "rest[m] -= 1 << (level - 1)"
    yield "offset = first[m] + (level - 1) * size"


def _written_back(dimension: int) -> Iterator[str]:
    """Return the state of a lane to its row."""
    yield "i = np.uint64(member[m]); left[i] = rest[m]"
    for a in range(dimension):
        yield f"points[i, {a}] = x_{a}[m]; turns[i, {a}] += np.int64(w_{a}[m])"


def _sums(dimension: int, order: int, outer: int) -> Iterator[str]:
    """Add the displacement to the state of a row."""
    axes = range(dimension)
    places = "".join(f"f_{a}[m], " for a in axes[outer:])
    if not outer:
        yield f"moved = contract(table, offset, {'stride0' if dimension == 2 else '0'}, ({places}))"
        yield from (f"x_{a}[m] += moved[{a}]" for a in axes)
        return
    yield from (f"y{a} = x_{a}[m]" for a in axes)
    for a in range(outer):
        yield f"for k in range({order + 1}):"
        yield f"    w = BASIS[k, {order}]"
        yield f"    for power in range({order - 1}, -1, -1):"
        yield f"        w = w * f_{a}[m] + BASIS[k, power]"
        yield f"    weights[{a}, k] = w"
    for a in range(outer):
        yield "    " * a + f"for k{a} in range({order + 1}):"
    shift = " + ".join(f"k{a} * stride{a}" for a in range(outer))
    yield from indent(
        outer,
        (
            "w = " + " * ".join(f"weights[{a}, k{a}]" for a in range(outer)),
            f"moved = contract(table, offset + {shift}, stride{outer}, ({places}))",
            *(f"y{a} += w * moved[{a}]" for a in axes),
        ),
    )
    yield from (f"x_{a}[m] = y{a}" for a in axes)


def _turns(dimension: int) -> Iterator[str]:
    """Bring the angles of one lane back into their turn and count."""
    for a in range(dimension):
        yield f"y{a} = x_{a}[m]"
        yield f"whole = floor((y{a} - cut{a}) * inverse_turn{a})"
        yield f"y{a} -= whole * turn{a}"
        yield f"x_{a}[m] = lower{a} if y{a} < lower{a} else y{a}"
        yield f"w_{a}[m] += whole"
