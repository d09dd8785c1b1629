"""Iteration of an interpolated map: tensor B-splines evaluated in blocks of initial conditions, as LLVM instructions.

The function is

    look_up(points, turns, left, table, strides, origin, inverse, cells, circle, reach, lower, turn)

It moves row i of ``points`` on by ``left[i]`` periods, or until the row leaves the table or enters a cell that the
table does not serve; ``left`` keeps the periods that were not made.  It returns the number of look-ups.

``origin``, ``inverse`` (one over the node distance) and ``cells`` describe the table; ``circle`` is the number of node
distances in the period of an angle, 0 on the line; ``lower`` and ``turn`` are branch cuts and periods of angles.
``strides`` has the doubles between neighbours along each axis and then those of the whole table of one period; the
tables of 2, 4, ... periods follow that one in ``table``.  ``reach`` is the number of tables that may be used in each
cell, 0 for none; an empty one stands for one everywhere.  A row takes the longest multi-period step that its cell
allows and that does not go past its ``left``.

The states of a block are kept component by component.  Places on the grid and full rotations are found for all of its
lanes at once, full or not, in vector code, so that an initial condition has the same image whatever its neighbours are;
the sums over coefficients follow row by row, see :mod:`cellmap._compiled.codegen.spline_sum`.  Cell indices are whole
numbers, kept as doubles until they are used.
"""

from __future__ import annotations

import ctypes
import functools
import operator
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._lib.arrays import Floats, Ints
from ..machine_code import MachineCode, machine_code, vector_width
from . import simd_math
from .instructions import Instructions, Value, module_text, number, total, where
from .spline_sum import basis_polynomials, spline_sum

BLOCK = 64

_ARRAYS = "points turns left table strides origin inverse cells circle reach lower turn".split()
_REACH = _ARRAYS[3:].index("reach")
_EVERYWHERE = np.ones(1, np.uint8)  # one table serves in all cells
_PROTOTYPE = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(_ARRAYS), ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p)


@dataclass(frozen=True, eq=False)
class LookUp:
    """The compiled ``look_up``; called with its arrays, the work of which is in front."""

    address: int
    machine_code: MachineCode  # lives as long as the function

    def __call__(self, points: Floats, rotations: Ints, left: Ints, *table: Any) -> int:
        """Move rows on by look-ups; return how many these are."""
        return self.with_table(points, rotations, left, *addresses_of(table))

    def with_table(self, points: Floats, rotations: Ints, left: Ints, addresses: Sequence[int], several: int) -> int:
        """Return a table with the addresses that :func:`addresses_of` gives."""
        made = ctypes.c_int64()
        work = [array.ctypes.data for array in (points, rotations, left)]
        _PROTOTYPE(self.address)(*work, *addresses, len(points), several, ctypes.addressof(made))
        return made.value


def addresses_of(table: Sequence[NDArray[Any]]) -> tuple[list[int], int]:
    """Return the addresses of the arrays of a table, and the number of cells that have a reach."""
    several = table[_REACH].size
    arrays = [array if k != _REACH or several else _EVERYWHERE for k, array in enumerate(table)]
    return [array.ctypes.data for array in arrays], several


@functools.cache
def lookup_kernel(dimension: int, order: int) -> LookUp:
    """Return the compiled ``look_up`` for maps of a dimension and splines of an order."""
    loaded = machine_code(lookup_text(dimension, order, vector_width()))
    return LookUp(loaded.address("look_up"), loaded)


def lookup_text(dimension: int, order: int, width: int) -> str:
    """Return the text of a module with the function ``look_up`` described above."""
    out = Instructions(width)
    block = _Block.reserved(out, dimension)
    strides = [out.load_whole(out.address("%strides", a)) for a in range(dimension + 1)]
    axes = _loaded_axes(out, strides)
    made = out.array(1, "i64")
    out.store_whole(0, made)
    weights = [out.array(order + 1) for _ in range(dimension - 2)]
    with out.loop("begin", "%number", BLOCK) as begin:
        _fill(out, block, begin)
        out.jump("sweep")
        out.label("sweep")
        _write_places(out, block, axes)
        _write_rows(out, block, strides, weights, order, made)
        _write_turns(out, block, axes)
        _write_back_all(out, block)
        out.branch("sgt", out.load_whole(block.count), 0, "again", "through")
        out.jump("sweep")
        out.label("through")
    out.store_whole(out.load_whole(made), "%made")
    arguments = ", ".join([*(f"ptr noalias %{a}" for a in _ARRAYS), "i64 %number", "i64 %levels", "ptr noalias %made"])
    return module_text(out.function("look_up", arguments), out)


@dataclass(frozen=True)
class _Block:
    """Addresses of the data of the rows of a block: state, full rotations, place in the cell, component-wise."""

    x: tuple[str, ...]
    w: tuple[str, ...]
    f: tuple[str, ...]
    cell: str
    first: str
    inside: str
    member: str
    rest: str
    count: str
    row: str

    @classmethod
    def reserved(cls, out: Instructions, dimension: int) -> _Block:
        x, w, f = (tuple(out.array(BLOCK) for _ in range(dimension)) for _ in range(3))
        doubles = [out.array(BLOCK) for _ in range(3)]
        return cls(x, w, f, *doubles, *(out.array(size, "i64") for size in (BLOCK, BLOCK, 1, 1)))

    @property
    def dimension(self) -> int:
        return len(self.x)

    def arrays(self) -> Iterator[str]:
        """Addresses of all that belongs to a row."""
        yield from (*self.x, *self.w, *self.f, self.cell, self.first, self.inside, self.member, self.rest)


@dataclass(frozen=True)
class _Axis:
    """Numbers of the table, and of the angle, along one axis; reciprocals of periods are 0 on the line."""

    origin: Value
    inverse: Value
    circle: Value
    lower: Value
    turn: Value
    cells: Value
    stride: Value
    around: Value
    inverse_turn: Value
    cut: Value
    last: Value


def _loaded_axes(out: Instructions, strides: Sequence[str]) -> list[_Axis]:
    axes = []
    for a, stride in enumerate(strides[:-1]):
        names = ("origin", "inverse", "circle", "lower", "turn")
        origin, inverse, circle, lower, turn = (out.load(out.address(f"%{name}", a)) for name in names)
        whole = (out.load_whole(out.address("%cells", a)), stride)
        cells, apart = (out.result(f"sitofp i64 {count} to double") for count in whole)
        around, inverse_turn = (where(period > 0.0, 1.0 / period, 0.0) for period in (circle, turn))
        cut = where(turn > 0.0, lower, 0.0)
        axes.append(_Axis(origin, inverse, circle, lower, turn, cells, apart, around, inverse_turn, cut, cells - 1.0))
    return axes


def _fill(out: Instructions, block: _Block, begin: str) -> None:
    """Copy rows into the block; the last one is repeated where rows run out."""
    d, rest = block.dimension, out.whole("sub", "%number", begin)
    shorter = out.result(f"icmp slt i64 {rest}, {BLOCK}").text
    count = out.result(f"select i1 {shorter}, i64 {rest}, i64 {BLOCK}").text
    out.store_whole(count, block.count)
    last = out.whole("sub", count, 1)
    with out.loop("filled", BLOCK) as m:
        within = out.result(f"icmp slt i64 {m}, {last}").text
        member = out.whole("add", begin, out.result(f"select i1 {within}, i64 {m}, i64 {last}").text)
        out.store_whole(member, out.address(block.member, m))
        out.store_whole(out.load_whole(out.address("%left", member)), out.address(block.rest, m))
        source = out.address("%points", out.whole("mul", member, d))
        for a in range(d):
            out.store(out.load(out.address(source, a)), out.address(block.x[a], m))
            out.store(number(0.0), out.address(block.w[a], m))


def _write_places(out: Instructions, block: _Block, axes: Sequence[_Axis]) -> None:
    """Find cell and place in it of every lane; the first cell where the lane is outside of the table."""
    with out.loop_over_lanes(BLOCK, "placed") as m:
        states = [out.load(out.address(x, m), vector=True) for x in block.x]
        places = []
        for x, axis in zip(states, axes, strict=True):
            u = (x - axis.origin) * axis.inverse
            u = u - axis.circle * simd_math.floor(u * axis.around)
            places.append(where((axis.circle <= 0.0) | ((u >= 0.0) & (u < axis.circle)), u, 0.0))
        inside = where(functools.reduce(operator.and_, _limits(places, axes)), 1.0, 0.0)
        numbers, fractions = [], []
        for place, axis in zip(places, axes, strict=True):
            u = where(inside > 0.0, place, 0.0)
            below = simd_math.floor(u)
            numbers.append(where(axis.last < below, axis.last, below))
            fractions.append(u - numbers[-1])
        first = total(n * axis.stride for n, axis in zip(numbers, axes, strict=True))
        cell = numbers[0]
        for n, axis in zip(numbers[1:], axes[1:], strict=True):
            cell = cell * axis.cells + n
        for f, base in zip(fractions, block.f, strict=True):
            out.store(f, out.address(base, m))
        for value, base in ((first, block.first), (cell, block.cell), (inside, block.inside)):
            out.store(value, out.address(base, m))


def _limits(places: Sequence[Value], axes: Sequence[_Axis]) -> Iterator[Value]:
    """Write the comparisons that hold inside of the table."""
    for u, axis in zip(places, axes, strict=True):
        yield u >= 0.0
        yield u <= axis.cells


def _write_rows(
    out: Instructions, block: _Block, strides: Sequence[str], weights: list[str], order: int, made: str
) -> None:
    """Move each row on by the table that serves it.

    A row that cannot go on is written back, and the last one takes its lane.
    """
    out.store_whole(0, block.row)
    out.jump("rows")
    out.label("rows")
    m, count = out.load_whole(block.row), out.load_whole(block.count)
    out.branch("slt", m, count, "row", "rows.done")
    rest = out.load_whole(out.address(block.rest, m))
    level = _level(out, block, m, rest)
    out.branch("eq", level, 0, "stopped", "moves")
    _write_back(out, block, m)
    fewer = out.whole("sub", count, 1)
    out.store_whole(fewer, block.count)
    for base in block.arrays():
        out.store_whole(out.load_whole(out.address(base, fewer)), out.address(base, m))
    out.jump("rows")
    out.label("moves")
    table_number = out.whole("sub", level, 1)
    out.store_whole(out.whole("add", out.load_whole(made), 1), made)
    out.store_whole(out.whole("sub", rest, out.whole("shl", 1, table_number)), out.address(block.rest, m))
    first = out.result(f"fptosi double {out.load(out.address(block.first, m)).text} to i64").text
    offset = out.whole("add", first, out.whole("mul", table_number, strides[-1]))
    _write_sum(out, block, strides, weights, order, offset, m)
    out.store_whole(out.whole("add", m, 1), block.row)
    out.jump("rows")
    out.label("rows.done")


def _level(out: Instructions, block: _Block, m: str, rest: str) -> str:
    """Return the number of the table that a row takes, counted from 1; 0 where it cannot go on.

    Table k makes 2^(k - 1) periods: it serves as long as k is at most the number of binary digits of what is left.
    """
    out.declared |= {"declare i64 @llvm.ctlz.i64(i64, i1)", "declare i64 @llvm.smin.i64(i64, i64)"}
    cell = out.result(f"fptosi double {out.load(out.address(block.cell, m)).text} to i64").text
    several = out.result("icmp ne i64 %levels, 0").text
    place = out.result(f"select i1 {several}, i64 {cell}, i64 0").text
    reach = out.result(f"load i8, ptr {out.result(f'getelementptr i8, ptr %reach, i64 {place}').text}").text
    reached = out.result(f"zext i8 {reach} to i64").text
    digits = out.whole("sub", 64, out.result(f"call i64 @llvm.ctlz.i64(i64 {rest}, i1 false)").text)
    level = out.result(f"call i64 @llvm.smin.i64(i64 {reached}, i64 {digits})").text
    inside = out.result(f"fcmp ogt double {out.load(out.address(block.inside, m)).text}, 0.0").text
    return out.result(f"select i1 {inside}, i64 {level}, i64 0").text


def _write_sum(
    out: Instructions, block: _Block, strides: Sequence[str], weights: list[str], order: int, offset: str, m: str
) -> None:
    """Add the displacement to the state of a row.

    The last two axes are summed in vectors; those before, if there are any, by loops.
    """
    d, outer = block.dimension, len(weights)
    places = [out.load(out.address(block.f[a], m)) for a in range(d)]
    for a, base in enumerate(weights):
        for k, row in enumerate(basis_polynomials(order)):
            total = number(row[order])
            for power in range(order - 1, -1, -1):
                total = out.binary("fadd", out.binary("fmul", total, places[a]), number(row[power]))
            out.store(total, out.address(base, k))

    def add(factor: Value | None, start: str) -> None:
        stride = strides[outer] if d > 1 else "0"
        moved = spline_sum(out, "%table", start, stride, places[outer:], order, d)
        for a in range(d):
            term = moved[a] if factor is None else out.binary("fmul", factor, moved[a])
            x = out.address(block.x[a], m)
            out.store(out.binary("fadd", out.load(x), term), x)

    def over_axes(a: int, factor: Value | None, start: str) -> None:
        if a == outer:
            add(factor, start)
            return
        with out.loop(f"axis{a}", order + 1) as k:
            weight = out.load(out.address(weights[a], k))
            product = weight if factor is None else out.binary("fmul", factor, weight)
            over_axes(a + 1, product, out.whole("add", start, out.whole("mul", k, strides[a])))

    over_axes(0, None, offset)


def _write_turns(out: Instructions, block: _Block, axes: Sequence[_Axis]) -> None:
    """Bring the angles of every lane back into their period and count."""
    with out.loop_over_lanes(BLOCK, "wrapped") as m:
        states, rotations = (
            [out.load(out.address(base, m), vector=True) for base in bases] for bases in (block.x, block.w)
        )
        wrapped = []
        for x, w, axis in zip(states, rotations, axes, strict=True):
            whole = simd_math.floor((x - axis.cut) * axis.inverse_turn)
            y = x - whole * axis.turn
            wrapped.append((where(y < axis.lower, axis.lower, y), w + whole))
        for (y, w), x_base, w_base in zip(wrapped, block.x, block.w, strict=True):
            out.store(y, out.address(x_base, m))
            out.store(w, out.address(w_base, m))


def _write_back_all(out: Instructions, block: _Block) -> None:
    """Write all rows back where no row has a period left, as is usual: rows of a block end together."""
    out.store_whole(0, block.row)
    count = out.load_whole(block.count)
    with out.loop("pending", count) as m:
        some = out.whole("or", out.load_whole(block.row), out.load_whole(out.address(block.rest, m)))
        out.store_whole(some, block.row)
    out.branch("eq", out.load_whole(block.row), 0, "finished", "unfinished")
    with out.loop("back", count) as m:
        _write_back(out, block, m)
    out.store_whole(0, block.count)
    out.jump("unfinished")
    out.label("unfinished")


def _write_back(out: Instructions, block: _Block, m: str) -> None:
    """Return the state of a lane to its row."""
    d, member = block.dimension, out.load_whole(out.address(block.member, m))
    out.store_whole(out.load_whole(out.address(block.rest, m)), out.address("%left", member))
    first = out.whole("mul", member, d)
    points, rotations = out.address("%points", first), out.address("%turns", first)
    for a in range(d):
        out.store(out.load(out.address(block.x[a], m)), out.address(points, a))
        made = out.result(f"fptosi double {out.load(out.address(block.w[a], m)).text} to i64").text
        place = out.address(rotations, a)
        out.store_whole(out.whole("add", out.load_whole(place), made), place)
