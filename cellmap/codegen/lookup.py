"""Iteration of a tabulated map: look-ups of a tensor B-spline, in blocks of starts.

The generated function is

    look_up(points, turns, left, table, strides, origin, inverse, cells, circle, rough, lower, turn)

It moves row i of ``points`` on by ``left[i]`` periods, or until the row leaves the table or enters a cell marked in
``rough``; ``left`` keeps the periods that were not made.  Starts of a block take turns period by period, so that the
processor works on many independent look-ups at once.

``origin``, ``inverse`` (one over the node distance) and ``cells`` describe the table; ``circle`` is the number of node
distances in a turn, 0 on the line; ``lower`` and ``turn`` say how angles are kept.
"""

from __future__ import annotations

import functools

from .lanes import indent
from .module import generated_module

BLOCK = 64


@functools.cache
def lookup_kernel(dimension: int, order: int):  # type: ignore[no-untyped-def]
    """Return the compiled ``look_up`` for maps of a dimension and splines of an order."""
    return generated_module(_text(dimension, order)).look_up


def _text(d: int, order: int) -> str:
    axes = range(d)
    inner = min(d, 2)
    places = "".join(f"f{a}, " for a in range(d - inner, d))
    lines = [
        "from math import floor",
        "import numpy as np",
        "from numba import njit",
        "from cellmap.kernels.contraction import contraction",
        "from cellmap.kernels.options import KERNEL",
    ]
    if d > 2:
        lines += [
            "from cellmap.kernels.contraction import basis_polynomials",
            f"BASIS = np.array(basis_polynomials({order}))",
        ]
    lines += [
        f"contract = contraction({inner}, {order}, {d})",
        "",
        "@njit('void(float64[:, ::1], int64[:, ::1], int64[::1], float64[::1], int64[::1], float64[::1],"
        " float64[::1], int64[::1], float64[::1], boolean[::1], float64[::1], float64[::1])', **KERNEL)",
        "def look_up(points, turns, left, table, strides, origin, inverse, cells, circle, rough, lower, turn):",
        *indent(1, (f"origin{a} = origin[{a}]; inverse{a} = inverse[{a}]; cells{a} = cells[{a}]" for a in axes)),
        *indent(1, (f"circle{a} = circle[{a}]; stride{a} = strides[{a}]" for a in axes)),
        *indent(1, (f"lower{a} = lower[{a}]; turn{a} = turn[{a}]; inverse_turn{a} = 1.0 / turn{a}" for a in axes)),
        "    any_rough = rough.size > 0",
        f"    member = np.empty({BLOCK}, np.int64)",
    ]
    if d > 2:
        lines += [f"    weights = np.empty(({d - 2}, {order + 1}))"]
    lines += [
        f"    for begin in range(0, points.shape[0], {BLOCK}):",
        f"        count = min({BLOCK}, points.shape[0] - begin)",
        "        for m in range(count):",
        "            member[m] = begin + m",
        "        while count > 0:",
        "            kept = 0",
        "            for m in range(count):",
        "                i = member[m]",
        "                if left[i] == 0:",
        "                    continue",
    ]
    body: list[str] = []
    for a in axes:
        body += [
            f"x{a} = points[i, {a}]",
            f"u{a} = (x{a} - origin{a}) * inverse{a}",
            f"if circle{a} > 0.0:",
            f"    u{a} -= circle{a} * floor(u{a} / circle{a})",
            f"    u{a} = u{a} if 0.0 <= u{a} < circle{a} else 0.0",
        ]
    inside = " and ".join(f"0.0 <= u{a} <= cells{a}" for a in axes)
    body.append(f"inside = {inside}")
    body.append("if inside:")
    for a in axes:
        body += [f"    c{a} = min(np.int64(u{a}), cells{a} - 1)", f"    f{a} = u{a} - c{a}"]
    flat = "c0"
    for a in axes[1:]:
        flat = f"({flat}) * cells{a} + c{a}"
    body += ["    if any_rough:", f"        inside = not rough[{flat}]"]
    body += ["if not inside:", "    continue", "left[i] -= 1", "member[kept] = i", "kept += 1"]
    body.append("offset = " + " + ".join(f"c{a} * stride{a}" for a in axes))
    if d <= 2:
        stride = "stride0" if d == 2 else "0"
        body.append(f"moved = contract(table, offset, {stride}, ({places}))")
        body += [f"y{a} = x{a} + moved[{a}]" for a in axes]
    else:
        body += [f"y{a} = x{a}" for a in axes]
        for a in range(d - 2):
            body += [
                f"for k in range({order + 1}):",
                f"    w = BASIS[k, {order}]",
                f"    for power in range({order - 1}, -1, -1):",
                f"        w = w * f{a} + BASIS[k, power]",
                f"    weights[{a}, k] = w",
            ]
        depth = 0
        weight, shift = [], []
        for a in range(d - 2):
            body.append("    " * depth + f"for k{a} in range({order + 1}):")
            depth += 1
            weight.append(f"weights[{a}, k{a}]")
            shift.append(f"k{a} * stride{a}")
        body.append("    " * depth + f"w = {' * '.join(weight)}")
        body.append(
            "    " * depth + f"moved = contract(table, offset + {' + '.join(shift)}, stride{d - 2}, ({places}))"
        )
        body += ["    " * depth + f"y{a} += w * moved[{a}]" for a in axes]
    for a in axes:
        body += [
            f"if turn{a} > 0.0:",
            f"    whole = floor((y{a} - lower{a}) * inverse_turn{a})",
            "    if whole != 0.0:",
            f"        y{a} -= whole * turn{a}",
            f"        y{a} = max(y{a}, lower{a})",
            f"        turns[i, {a}] += np.int64(whole)",
            f"points[i, {a}] = y{a}",
        ]
    lines += indent(4, body)
    lines += ["            count = kept"]
    return "\n".join(lines) + "\n"
