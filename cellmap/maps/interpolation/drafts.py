"""Drafts of interpolated maps: without the exact images of the cells' centres, which examine a table."""

from __future__ import annotations

import time
from dataclasses import replace

from ..cell_table import CellTable
from ..orbit_batch import Cost
from ..point_map import PointMap
from .interpolated import Interpolated, allowed_errors
from .spline_coefficients import number_of_nodes
from .table_making import errors_in_cells, leading_errors_in_cells, spline_coefficients_of
from .tabulation import TableTiles


def draft_of(spec: Interpolated) -> PointMap:
    """Return an interpolated map whose fallback cells follow from differences of the coefficients alone."""
    began = time.perf_counter()
    grid, order, tiles = spec.grid.on(spec.exact.coordinates), spec.order, TableTiles()
    coefficients, spoilt = spline_coefficients_of(spec.exact, grid, order, False, tiles)
    smooth = CellTable.unexamined(grid, order, coefficients)
    indicator, fallback = leading_errors_in_cells(smooth, allowed_errors(grid, order, spec.tolerance))
    table = replace(smooth, indicator=indicator, fallback=fallback | spoilt)
    cost = Cost(
        seconds=time.perf_counter() - began,
        steps=number_of_nodes(grid, order),
        evaluations=tiles.work.evaluations,
    )
    return replace(spec, grid=grid, table=table, cost=cost).make()


def examined(draft: PointMap) -> PointMap:
    """Return the map of a draft as :func:`interpolated_map` makes it, from the coefficients of the draft."""
    spec, began, tiles = draft.spec, time.perf_counter(), TableTiles()
    assert isinstance(spec, Interpolated)
    assert spec.table is not None
    allowed = allowed_errors(spec.grid, spec.order, spec.tolerance)
    smooth = CellTable.unexamined(spec.grid, spec.order, spec.table.coefficients)
    indicator, fallback = errors_in_cells(spec.exact, smooth, allowed, False, tiles)
    # With what the centres tell, an error is never smaller than without: the draft adds cells without nodes alone.
    table = replace(smooth, indicator=indicator, fallback=fallback | spec.table.fallback)
    cost = replace(
        spec.cost,
        seconds=spec.cost.seconds + time.perf_counter() - began,
        steps=spec.cost.steps + spec.grid.size,
        evaluations=spec.cost.evaluations + tiles.work.evaluations,
    )
    return replace(spec, table=table, cost=cost).make()
