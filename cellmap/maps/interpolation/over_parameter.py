"""Interpolation over cells and a parameter: tables of a map at Chebyshev values of the parameter, combined."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..._compiled.codegen.spline_sum import WIDTH
from ..._lib.arrays import Bools, Floats
from ..._lib.checks import claim_memory
from ..cell_table import CellTable
from ..coordinates import difference, turns_of
from ..grid import CellGrid, grid_points
from ..orbit_batch import Cost, Orbits, Status
from ..point_map import PointMap, follow
from .interpolated import Interpolated, allowed_errors, table_memory
from .spline_coefficients import nodes_of, number_of_nodes
from .table_making import errors_in_cells, spline_coefficients_of

F = TypeVar("F", np.float32, np.float64)

FEWEST = 16
"""Values of a parameter from which tables over it are worth a try."""

_PART = 1e-3, 0.1  # errors over the parameter, in errors that cells are allowed: small, and the largest

_LEVELS = (5, 9)  # Chebyshev nodes; those of a level are among those of the next
CHECKED = np.array([0.85, -0.55])
"""Places between nodes, from -1 to 1, at which errors are measured."""

_SAMPLE = 1024  # nodes of the grid from which the level is chosen, before any table is made
_COMPARED = 64  # random points of the window at which a combined table is compared with the exact map
_WRONG = 3.0  # a combined table is rejected if its error there exceeds the allowed one by this factor
_LOST = 0.02  # fraction of the cells that may become fallback cells
_MORE = 1.1  # factor over the fallback cells at one value, to which that fraction is added


@dataclass(frozen=True)
class Chebyshev:
    """Polynomial interpolation at the extrema of a Chebyshev polynomial on an interval, by the barycentric formula.

    It converges as fast as the function is smooth there (Berrut and Trefethen, SIAM Review 46 (2004) 501).
    """

    low: float
    high: float
    number: int

    def placed(self, places: Floats) -> Floats:
        """Return the values at places from -1 to 1."""
        return 0.5 * (self.low + self.high) + 0.5 * (self.high - self.low) * places

    @property
    def nodes(self) -> Floats:
        """Nodes, in decreasing order."""
        nodes = self.placed(np.cos(np.pi * np.arange(self.number) / (self.number - 1)))
        nodes[[0, -1]] = self.high, self.low
        return nodes

    def factors(self, value: float) -> Floats:
        """Return the factors with which the values at the nodes are to be added."""
        apart = value - self.nodes
        if (apart == 0.0).any():
            return (apart == 0.0).astype(float)
        factors = (-1.0) ** np.arange(self.number) / apart
        factors[[0, -1]] *= 0.5
        return np.asarray(factors / factors.sum())

    def scales(self, values: Floats) -> Floats:
        """Return by how much the error is larger than at some values, where it is largest.

        That of a smooth function is in proportion to the distances from all nodes, multiplied.
        """
        nodes = self.nodes
        everywhere = np.linspace(self.low, self.high, 1001)
        largest = np.abs(np.prod(everywhere[:, None] - nodes, axis=1)).max()
        return np.asarray(largest / np.abs(np.prod(values[:, None] - nodes, axis=1)))


def errors_over_parameter(spec: Interpolated) -> Floats:
    """Return the largest errors of interpolation over a parameter, for each coordinate.

    They are small against those that cells of the table are allowed, and at least the tolerance of the exact map, where
    that is a tenth of these at most.
    """
    allowed, (rtol, atol) = allowed_errors(spec.grid, spec.order, spec.tolerance), spec.exact.tolerance
    own = atol + rtol * np.abs([spec.grid.lower, spec.grid.upper]).max(axis=0)
    return np.clip(own, _PART[0] * allowed, _PART[1] * allowed)


def combined(factors: Floats, arrays: Sequence[NDArray[F]] | NDArray[F], out: NDArray[F]) -> NDArray[F]:
    """Write the sum of arrays with factors, in this order."""
    np.multiply(arrays[0], out.dtype.type(factors[0]), out=out)
    for factor, array in zip(factors[1:], arrays[1:], strict=True):
        if factor:
            out += out.dtype.type(factor) * array
    return out


@dataclass(frozen=True, eq=False)
class ParameterTable:
    """Interpolated maps for all values of a parameter in an interval.

    B-spline coefficients are linear in the images, so that those at a value are combined from those at the nodes, and
    errors in cells are at most combined with the absolute values of the same factors.

    ``spec``: specification of such a map; ``nodes``: values of `parameter` with a table; ``tables``: those;
    ``missed``: bound of the error over the parameter in each cell, in cell widths; ``spoilt``: further fallback cells.
    """

    spec: Interpolated
    parameter: str
    nodes: Chebyshev
    tables: tuple[CellTable, ...]
    missed: NDArray[np.float32]
    spoilt: Bools

    def covers(self, value: float) -> bool:
        """Tell whether a value of the parameter is in the interval."""
        return self.nodes.low <= value <= self.nodes.high

    def at(self, value: float, exact: PointMap | None = None) -> PointMap:
        """Return the interpolated map at a value of the parameter, of the exact map there where that is known."""
        began = time.perf_counter()
        spec, grid, factors = self.spec, self.spec.grid, self.nodes.factors(value)
        first = self.tables[0].coefficients
        flat = np.zeros(first.size + WIDTH)
        coefficients = flat[: first.size].reshape(first.shape)
        combined(factors, [t.coefficients for t in self.tables], coefficients)
        with np.errstate(invalid="ignore"):  # cells whose centres have no image
            error = combined(np.abs(factors), [t.indicator for t in self.tables], np.empty(grid.shape, np.float32))
            error = np.fmax(error + self.missed, self.missed)
        allowed = allowed_errors(grid, spec.order, spec.tolerance) / grid.widths
        fallback = self.spoilt | ~(error <= allowed.min())
        table = CellTable(grid, spec.order, coefficients, error, fallback)
        exact = spec.exact.with_params(**{self.parameter: value}) if exact is None else exact
        return replace(spec, exact=exact, table=table, cost=Cost(seconds=time.perf_counter() - began)).make()

    def serves(self, point_map: PointMap) -> bool:
        """Tell whether a map of :meth:`at` has the images of its exact map at some points.

        What a parameter does only between the nodes and the values at which errors are measured is seen here alone.
        """
        assert point_map.exact is not None and point_map.table is not None
        grid, fallback = self.spec.grid, point_map.table.fallback.ravel()
        places = np.random.default_rng(0).uniform(grid.lower, grid.upper, (_COMPARED, grid.dimension))
        places = places[~fallback[grid.locate(places)]]
        images, exact = (follow(m, places, 1).points for m in (point_map, point_map.exact))
        missed = np.abs(difference(images, exact, point_map.coordinates))
        return bool((missed <= _WRONG * allowed_errors(grid, self.spec.order, self.spec.tolerance)).all())


def tables_over(
    spec: Interpolated, parameter: str, interval: tuple[float, float], values: int
) -> ParameterTable | None:
    """Return tables over a parameter for so many values in an interval, with both ends.

    None where they would be no fewer than half of the values, where the images of the nodes depend on the parameter in
    such a way that polynomials do not approximate them (jumps, kinks, nodes without image), and where there is no
    memory for them or no map at the nodes: then the table of each value is to be computed by itself.  The number of
    nodes is chosen by the errors that a sample shows; the error that remains is measured at values between the nodes.
    """
    making = tables_in_steps(spec, parameter, interval, values)
    try:
        while True:
            next(making)
    except StopIteration as end:
        return end.value


def tables_in_steps(
    spec: Interpolated, parameter: str, interval: tuple[float, float], values: int
) -> Generator[None, None, ParameterTable | None]:
    """Make :func:`tables_over` a parameter one after the other, for callers that have other things to do meanwhile."""
    spec = replace(spec, grid=spec.grid.on(spec.exact.coordinates), table=None)
    if values < FEWEST or not interval[0] < interval[1]:
        return None
    try:
        needed = (max(_LEVELS) + len(CHECKED)) * table_memory(spec.grid, spec.order)
        claim_memory(f"tables over {parameter}", needed, "take fewer cells")
        maps = [exact for _, exact in _maps(spec, parameter, Chebyshev(*interval, _LEVELS[-1]).nodes)]
        number = _level(spec, maps)
        if number is None or 2 * (number + len(CHECKED)) > values:
            return None
        nodes, tables, measured = Chebyshev(*interval, number), list[CellTable](), list[tuple[Floats, Bools]]()
        for exact in maps[:: (_LEVELS[-1] - 1) // (number - 1)]:
            yield
            tables.append(_table(spec, exact))
        for value, exact in _maps(spec, parameter, nodes.placed(CHECKED)):
            yield
            measured.append(_missed(spec, exact, nodes.factors(value), tables))
    except (ValueError, ArithmeticError, MemoryError):  # a parameter that cannot have all values, for instance
        return None
    return _accepted(spec, parameter, nodes, tables, measured)


def _maps(spec: Interpolated, parameter: str, values: Floats) -> Iterator[tuple[float, PointMap]]:
    for value in values.tolist():
        yield value, spec.exact.with_params(**{parameter: value})


def _level(spec: Interpolated, maps: Sequence[PointMap]) -> int | None:
    """Choose the number of nodes from the images of a sample at the nodes of the last level, None if it is too few."""
    axes, grid = nodes_of(spec.grid, spec.order), spec.grid
    rows = np.random.default_rng(0).choice(number_of_nodes(grid, spec.order), _SAMPLE)
    chosen = grid_points(axes, np.unique(rows))
    turn = turns_of(spec.exact.coordinates)[1]
    images, there = [], np.ones(len(chosen), bool)
    for exact in maps:
        orbits = Orbits.starting(chosen.copy())
        exact.advance(orbits, 1)
        images.append(orbits.points + orbits.rotations * turn)
        there &= orbits.status < Status.ESCAPED
    every = np.array(images)[:, there]
    few, fine = (Chebyshev(-1.0, 1.0, number) for number in _LEVELS)
    allowed, error = errors_over_parameter(spec), np.zeros(0)
    for k in range(1, len(every), 2):
        missed = np.einsum("k,knd->nd", few.factors(fine.nodes[k]), every[::2]) - every[k]
        error = np.maximum(error, np.abs(missed)) if error.size else np.abs(missed)
    # Twice as many nodes square the error of an analytic function, in units of the function.
    size = np.ptp(every, axis=0).max(axis=0, initial=1e-300) if error.size else np.ones(grid.dimension)
    for number, left in zip(_LEVELS, (error, error**2 / size), strict=True):
        if error.size and (left <= allowed).all(axis=-1).sum() >= (1.0 - _LOST) * len(chosen):
            return number
    return None


def _table(spec: Interpolated, exact: PointMap) -> CellTable:
    coefficients, spoilt = spline_coefficients_of(exact, spec.grid, spec.order, False)
    smooth = CellTable.unexamined(spec.grid, spec.order, coefficients)
    allowed = allowed_errors(spec.grid, spec.order, spec.tolerance)
    indicator, fallback = errors_in_cells(exact, smooth, allowed, False)
    return replace(smooth, indicator=indicator, fallback=fallback | spoilt)


def _missed(spec: Interpolated, exact: PointMap, factors: Floats, tables: Sequence[CellTable]) -> tuple[Floats, Bools]:
    """Return the error of combined tables in each cell, by coordinate, and the cells next to nodes without image."""
    coefficients, lost = spline_coefficients_of(exact, spec.grid, spec.order, False)
    difference = combined(factors, [t.coefficients for t in tables], np.empty(coefficients.shape)) - coefficients
    return _largest_in_cells(np.abs(difference), spec.grid, spec.order), lost


def _accepted(
    spec: Interpolated,
    parameter: str,
    nodes: Chebyshev,
    tables: Sequence[CellTable],
    measured: Sequence[tuple[Floats, Bools]],
) -> ParameterTable | None:
    """Return tables with the errors that were measured between their nodes, None where these are too large."""
    scales = nodes.scales(nodes.placed(CHECKED))
    missed = np.max([scale * error for scale, (error, _) in zip(scales, measured, strict=True)], axis=0)
    allowed, before = errors_over_parameter(spec), [t.fallback for t in tables]
    spoilt = np.any([*before, *(lost for _, lost in measured)], axis=0) | ~(missed <= allowed).all(axis=-1)
    usual = float(np.mean(before))
    if spoilt.mean() > _MORE * usual + _LOST or usual > 0.5:
        return None
    widest = (missed / spec.grid.widths).max(axis=-1).astype(np.float32)
    return ParameterTable(spec, parameter, nodes, tuple(tables), widest, spoilt)


def _largest_in_cells(values: Floats, grid: CellGrid, order: int) -> Floats:
    """Return the largest coefficients of each cell: a sum of B-splines is nowhere larger, for these add up to 1."""
    for axis, n in enumerate(grid.shape):
        before = (slice(None),) * axis
        values = np.max([values[(*before, slice(k, k + n))] for k in range(order + 1)], axis=0)
    return values
