"""Iteration of interpolated maps: orbits advanced by periods without integration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..._compiled.codegen.lookup import addresses_of, lookup_kernel
from ..._compiled.codegen.spline_sum import WIDTH
from ..._compiled.kernels.labelling import PeriodStep, Table, find_outside
from ..._lib.arrays import Bools, Floats, Ints
from ..cell_table import CellTable
from ..compiled_advance import UNKNOWN_STEP, CompiledAdvance
from ..coordinates import turns_of
from ..grid import CellGrid
from ..orbit_batch import Orbits, Status, portions
from ..point_map import PointMap
from .spline_coefficients import padded

_CHEAPER = 32  # look-ups that cost as much as a period of integration


class LookUps(CompiledAdvance):
    """Iteration of interpolated maps of 1, 2, 4, ... periods, with the exact map in fallback cells.

    `coefficients` are those of the first table, in the memory that all of them share.
    """

    def __init__(self, exact: PointMap, tables: Sequence[CellTable], outside: str) -> None:
        grid, coefficients = tables[0].grid, tables[0].coefficients
        self._exact, self._integrate, self._grid = exact, outside == "integrate", grid
        self._look_up = lookup_kernel(grid.dimension, tables[0].order)
        lower, turn = turns_of(exact.coordinates)
        if len(tables) == 1:
            flat = padded(coefficients)
        else:
            flat = np.concatenate([*(t.coefficients.ravel() for t in tables), np.zeros(WIDTH)])
        self.coefficients = flat[: coefficients.size].reshape(coefficients.shape)
        strides = np.array([*self.coefficients.strides[:-1], coefficients.nbytes]) // flat.itemsize
        reach = np.zeros(0, np.uint8)
        if len(tables) > 1 or tables[0].fallback.any():
            reach = np.sum([~t.fallback.ravel() for t in tables], axis=0, dtype=np.uint8)
        circle = np.where(grid.wraps, np.array(grid.shape, float), turn / grid.widths)
        self._description = (
            flat,
            strides,
            np.array(grid.lower),
            _inverse_widths(grid),
            np.array(grid.shape),
            circle,
            reach,
            lower,
            turn,
        )
        # The arrays live as long as this, and their addresses are asked for in each period.
        self._addresses = addresses_of(self._description)
        addresses, levels = self._addresses
        _, _, origin, inverse, cells, circle, _, lower, turn = self._description
        self._table = Table(
            function=self._look_up.address,
            arrays=tuple(addresses),
            levels=levels,
            escapes=int(not self._integrate),
            origin=origin,
            inverse=inverse,
            cells=cells.astype(float),
            circle=circle,
        )

    @property
    def step(self) -> PeriodStep:
        """Look-ups, and the steps of the exact map where that is compiled."""
        exact, table, (*_, lower, turn) = self._exact.advance, self._table, self._description
        of_exact = exact.step if isinstance(exact, CompiledAdvance) else UNKNOWN_STEP
        return of_exact._replace(table=table, lower=lower, turn=turn)

    @property
    def stages(self) -> int:
        """Evaluations of the right-hand side in a step of the exact map."""
        return self._exact.advance.stages if isinstance(self._exact.advance, CompiledAdvance) else 1

    def __call__(self, orbits: Orbits, periods: int) -> None:
        """Move a batch on, in place."""
        for some in portions(periods, len(orbits) // _CHEAPER):
            for now in orbits.living():
                self._advance(now, some)

    def _advance(self, now: Orbits, periods: int) -> None:
        """Move orbits on that are alive, in place."""
        if not now.points.flags.c_contiguous:  # look-ups find the rows by their address
            rows = replace(now, points=np.ascontiguousarray(now.points))
            self._advance(rows, periods)
            now.points[:] = rows.points
            return
        left = np.full(len(now), periods, np.int64)
        for part in self._moving(now, left):
            stopped = now[part]
            if not self._integrate:
                stopped.end(self._outside(stopped.points), Status.ESCAPED)
            for carried in stopped.living():
                self._exact.advance(carried, 1)
            now[part] = stopped
            left[part] = np.where(stopped.alive, left[part] - 1, 0)

    def _moving(self, orbits: Orbits, left: Ints) -> Iterator[Ints]:
        """Look up until every orbit is through, yielding those that the table cannot carry on."""
        everyone = np.arange(len(orbits))
        part = everyone
        while len(part):
            if part is everyone:
                made = self._look_up.with_table(orbits.points, orbits.rotations, left, *self._addresses)
            else:
                some, remaining = orbits[part], left[part]
                made = self._look_up.with_table(some.points, some.rotations, remaining, *self._addresses)
                orbits[part], left[part] = some, remaining
            orbits.work.look_ups += made
            part = part[left[part] > 0]
            if len(part):
                yield part

    def _outside(self, points: Floats) -> Bools:
        outside = np.empty(len(points), bool)
        find_outside(self._table, points, outside)
        return outside


def _inverse_widths(grid: CellGrid) -> Floats:
    """Return cells per unit of length, rounded so that the upper edges of the window are inside of it."""
    inverse, span = 1.0 / grid.widths, np.subtract(grid.upper, grid.lower)
    while (beyond := span * inverse > grid.shape).any():
        inverse[beyond] = np.nextafter(inverse[beyond], 0.0)
    return inverse
