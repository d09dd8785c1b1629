"""Tensor B-spline sums in LLVM vectors.

The value of a tensor B-spline in a cell is a sum over (order + 1)^d coefficients, each with one value for each
component of the map.  Coefficients of the last axis lie side by side with their components, so a row is a few SIMD
vectors.  Rows are summed with the weights of the other axes, and the last axis is summed at the end.  LLVM's automatic
vectorisers do not find this; here it is said outright, and any processor gets the best it has for these vectors.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from fractions import Fraction
from math import comb
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

WIDTH = 4
"""Doubles in a vector.  Rows are padded to a multiple of it by weights of zero, so tables need WIDTH spare doubles."""

_DOUBLE = ir.DoubleType()


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


def _constant(values: Sequence[float]) -> ir.Constant:
    return ir.Constant(ir.VectorType(_DOUBLE, len(values)), [ir.Constant(_DOUBLE, float(v)) for v in values])


def _splat(builder: Any, scalar: Any, width: int) -> Any:
    vector = builder.insert_element(ir.Constant(ir.VectorType(_DOUBLE, width), ir.Undefined), scalar, _index(0))
    return builder.shuffle_vector(vector, vector, ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width))


def _index(i: int) -> ir.Constant:
    return ir.Constant(ir.IntType(32), i)


def _multiply_add(builder: Any, a: Any, b: Any, c: Any) -> Any:
    return builder.fadd(builder.fmul(a, b, flags=("contract",)), c, flags=("contract",))


def _weights(builder: Any, fraction: Any, order: int) -> Any:
    """Vector of the weights of the B-splines of a cell at a place in it, by Horner's rule."""
    basis = basis_polynomials(order)
    powers = [_constant([row[m] for row in basis]) for m in range(order + 1)]
    place = _splat(builder, fraction, order + 1)
    value: Any = powers[order]
    for m in range(order - 1, -1, -1):
        value = _multiply_add(builder, value, place, powers[m])
    return value


def _spread(builder: Any, weights: Any, columns: Sequence[int]) -> Any:
    """Vector of the listed weights; zero for a number past the last of them."""
    chosen = ir.Constant(ir.VectorType(ir.IntType(32), len(columns)), list(columns))
    return builder.shuffle_vector(weights, ir.Constant(weights.type, None), chosen)


@functools.cache
def contraction(axes: int, order: int, components: int) -> Any:
    """Return a compiled-code function ``contract(table, offset, strides, fractions)`` for the last one or two axes.

    It sums a row-major table of shape (..., nodes, nodes, components), flat, from the first coefficient of a cell.
    ``strides`` holds the doubles between neighbours of the first of two axes (unused for one); ``fractions`` is the
    tuple of places in the cell.  The result is a tuple of the components.
    """
    row = (order + 1) * components
    vectors = -(-row // WIDTH)
    columns = [min(j // components, order + 1) for j in range(vectors * WIDTH)]

    @intrinsic
    def contract(_context: Any, table: Any, offset: Any, stride: Any, fractions: Any) -> Any:
        result = types.UniTuple(types.float64, components)

        def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            array, start, step, places = arguments
            data = context.make_array(signature.args[0])(context, builder, array).data
            place = [builder.extract_value(places, a) for a in range(axes)]
            vector = ir.VectorType(_DOUBLE, WIDTH)

            def load(position: Any, v: int) -> Any:
                address = builder.gep(data, [builder.add(position, ir.Constant(position.type, v * WIDTH))])
                return builder.load(builder.bitcast(address, vector.as_pointer()), align=8)

            if axes == 1:
                sums = [load(start, v) for v in range(vectors)]
            else:
                outer = _weights(builder, place[0], order)
                sums = [None] * vectors
                position = start
                for a in range(order + 1):
                    weight = _splat(builder, builder.extract_element(outer, _index(a)), WIDTH)
                    for v in range(vectors):
                        term = load(position, v)
                        first = sums[v] is None
                        sums[v] = builder.fmul(weight, term) if first else _multiply_add(builder, weight, term, sums[v])
                    position = builder.add(position, step)
            inner = _weights(builder, place[-1], order)
            total = [
                builder.fmul(sums[v], _spread(builder, inner, columns[v * WIDTH : (v + 1) * WIDTH]))
                for v in range(vectors)
            ]
            return cgutils.pack_array(builder, _fold(builder, total, components))

        return result(types.Array(types.float64, 1, "C"), types.int64, types.int64, fractions), build

    return contract


def _fold(builder: Any, vectors: list[Any], components: int) -> list[Any]:
    """Add the elements that belong to one component."""
    if WIDTH % components == 0:
        total = functools.reduce(builder.fadd, vectors)
        width = WIDTH
        while width > components:
            width //= 2
            low = ir.Constant(ir.VectorType(ir.IntType(32), width), list(range(width)))
            high = ir.Constant(ir.VectorType(ir.IntType(32), width), list(range(width, 2 * width)))
            total = builder.fadd(builder.shuffle_vector(total, total, low), builder.shuffle_vector(total, total, high))
        return [builder.extract_element(total, _index(c)) for c in range(components)]
    sums: list[Any] = [None] * components
    for v, vector in enumerate(vectors):
        for i in range(WIDTH):
            c, element = (v * WIDTH + i) % components, builder.extract_element(vector, _index(i))
            sums[c] = element if sums[c] is None else builder.fadd(sums[c], element)
    return sums
