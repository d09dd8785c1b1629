"""Tensor B-splines: those of a cell as polynomials, how coefficients lie in memory, and their sums as instructions.

The value of a tensor B-spline in a cell is a sum over (order + 1)^d coefficients, each with one value for each
component of the map.  Coefficients of the last axis lie side by side with their components, so a row is a few SIMD
vectors.  Rows are summed with the weights of the other axes, and the last axis is summed at the end.  Compilers do not
find this by themselves; here the types say it.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from fractions import Fraction
from math import comb

from .instructions import Instructions, Value, number

WIDTH = 4
"""Doubles in a vector of coefficients.  Rows are padded to a multiple of it by weights of zero, so tables need WIDTH
spare doubles."""


@functools.cache
def basis_polynomials(order: int) -> tuple[tuple[float, ...], ...]:
    """Coefficients, lowest power first, of the order + 1 B-splines that live in a cell, as polynomials on [0, 1).

    The k-th is the cardinal B-spline of the given order on its (order - k)-th unit interval (Schoenberg 1946).
    """
    rows = []
    for k in range(order + 1):
        row = [Fraction(0)] * (order + 1)
        # B(u) = sum_j (-1)^j C(order+1, j) (u - j)_+^order / order!  at  u = f + order - k.
        for j in range(order - k + 1):
            shift = order - k - j
            for power in range(order + 1):
                row[power] += Fraction((-1) ** j * comb(order + 1, j) * comb(order, power) * shift ** (order - power))
        factorial = Fraction(1)
        for m in range(2, order + 1):
            factorial *= m
        rows.append(tuple(float(c / factorial) for c in row))
    return tuple(rows)


def spline_sum(
    out: Instructions, table: str, offset: str, stride: str, places: Sequence[Value], order: int, components: int
) -> list[Value]:
    """Write the sum over the last one or two axes of a table, and return its components.

    The table is row-major, of shape (..., nodes, nodes, components), at an address; `offset` is the number of doubles
    before the first coefficient of the cell, `stride` that between neighbours along the first of two axes (unused for
    one), `places` are those in the cell.
    """
    row = (order + 1) * components
    vectors = -(-row // WIDTH)
    columns = [min(j // components, order + 1) for j in range(vectors * WIDTH)]
    wide = f"<{WIDTH} x double>"

    def operation(instruction: str) -> Value:
        return out.result(instruction, vector=True)

    def load(position: str, v: int) -> Value:
        base = out.result(f"getelementptr double, ptr {table}, i64 {position}").text
        address = out.result(f"getelementptr double, ptr {base}, i64 {v * WIDTH}").text
        return operation(f"load {wide}, ptr {address}, align 8")

    if len(places) == 1:
        sums = [load(offset, v) for v in range(vectors)]
    else:
        outer, position = _weights(out, places[0], order), offset
        sums = []
        for a in range(order + 1):
            weight = out.result(f"extractelement <{order + 1} x double> {outer.text}, i32 {a}")
            factor = _copies(out, weight, WIDTH)
            terms = [operation(f"fmul contract {wide} {factor.text}, {load(position, v).text}") for v in range(vectors)]
            sums = [
                term if a == 0 else operation(f"fadd contract {wide} {term.text}, {sums[v].text}")
                for v, term in enumerate(terms)
            ]
            position = out.result(f"add i64 {position}, {stride}").text
    inner = _weights(out, places[-1], order)
    weighted = []
    for v in range(vectors):
        chosen = ", ".join(f"i32 {c}" for c in columns[v * WIDTH : (v + 1) * WIDTH])
        kind = f"<{order + 1} x double>"
        # The number after the last weight is zero.
        spread = operation(f"shufflevector {kind} {inner.text}, {kind} zeroinitializer, <{WIDTH} x i32> <{chosen}>")
        weighted.append(operation(f"fmul {wide} {sums[v].text}, {spread.text}"))
    return _by_component(out, weighted, components)


def _copies(out: Instructions, value: Value, width: int) -> Value:
    """Return a vector with one number in all places."""
    kind = f"<{width} x double>"
    first = out.result(f"insertelement {kind} poison, double {value.text}, i32 0").text
    return out.result(f"shufflevector {kind} {first}, {kind} poison, <{width} x i32> zeroinitializer", vector=True)


def _weights(out: Instructions, place: Value, order: int) -> Value:
    """Return the weights of the B-splines of a cell at a place in it, by Horner's rule."""
    kind, basis = f"<{order + 1} x double>", basis_polynomials(order)
    powers = [f"<{', '.join(f'double {number(row[m]).text}' for row in basis)}>" for m in range(order + 1)]
    x, total = _copies(out, place, order + 1).text, powers[order]
    for m in range(order - 1, -1, -1):
        product = out.result(f"fmul contract {kind} {total}, {x}").text
        total = out.result(f"fadd contract {kind} {product}, {powers[m]}").text
    return Value(total, vector=True)


def _by_component(out: Instructions, vectors: list[Value], components: int) -> list[Value]:
    """Add the elements that belong to one component."""
    kind = f"<{WIDTH} x double>"
    if WIDTH % components == 0:
        total = functools.reduce(lambda a, b: out.result(f"fadd {kind} {a.text}, {b.text}", vector=True), vectors)
        width = WIDTH
        while width > components:
            width //= 2
            source, half = f"<{2 * width} x double> {total.text}", f"<{width} x double>"
            parts = []
            for begin in (0, width):
                chosen = ", ".join(f"i32 {begin + i}" for i in range(width))
                parts.append(out.result(f"shufflevector {source}, {source}, <{width} x i32> <{chosen}>").text)
            total = out.result(f"fadd {half} {parts[0]}, {parts[1]}", vector=True)
        return [out.result(f"extractelement <{components} x double> {total.text}, i32 {c}") for c in range(components)]
    sums: list[Value | None] = [None] * components
    for j in range(len(vectors) * WIDTH):
        vector, c = vectors[j // WIDTH], j % components
        element = out.result(f"extractelement {kind} {vector.text}, i32 {j % WIDTH}")
        known = sums[c]
        sums[c] = element if known is None else out.result(f"fadd double {known.text}, {element.text}")
    return [s for s in sums if s is not None]
