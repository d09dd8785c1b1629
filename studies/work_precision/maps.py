"""One period of a map: exact maps by several programs, and tables of several orders and sizes."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

import cellmap
from cellmap import PointMap, interpolated_map, stroboscopic_map

from .chart import Chart, Run, best_seconds, largest
from .peers import PEERS, installed
from .problems import PROBLEMS, Problem

LOOKUPS = 50  # periods that a table is iterated for
_ANY = 1e9  # without fallback cells: the error of interpolation is measured
FULL_SIZES = {2: (32, 64, 128, 256, 512, 1024), 4: (16, 24, 32)}
QUICK_SIZES = {2: (32, 64, 128), 4: (12,)}


def exact_maps(quick: bool) -> list[Chart]:
    """Return for each problem the seconds that a million periods take on one thread, against the largest error."""
    tolerances = (1e-5, 1e-9, 1e-13) if quick else tuple(10.0**-k for k in range(3, 15))
    charts = []
    cellmap.set_threads(1)
    try:
        for problem in PROBLEMS[: 2 if quick else None]:
            runs = [*_own_methods(problem, tolerances, quick), *_peers(problem, tolerances, quick)]
            charts.append(
                Chart(f"exact map, {problem.name}", "s for 10⁶ periods, one core", "largest error", tuple(runs))
            )
    finally:
        cellmap.set_threads(None)
    return charts


def _own_methods(problem: Problem, tolerances: tuple[float, ...], quick: bool) -> Iterator[Run]:
    many = np.tile(problem.initial_conditions, (5 if quick else 20, 1))
    for method in ("Taylor", "DOP853", "RK45"):
        for tolerance in tolerances:
            if method == "RK45" and tolerance < 1e-10:
                continue  # so many steps that nobody would take it
            point_map = stroboscopic_map(problem.system, rtol=tolerance, atol=tolerance, method=method)
            images = point_map.iterate(problem.initial_conditions, 1).unwrapped
            seconds = best_seconds(lambda m=point_map: m.iterate(many, 1), 3)  # type: ignore[misc]
            error = largest(images - problem.images)
            yield Run(f"cellmap {method}", f"{tolerance:.0e}", 1e6 * seconds / len(many), error)


def _peers(problem: Problem, tolerances: tuple[float, ...], quick: bool) -> Iterator[Run]:
    for name in installed():
        make, _, most = PEERS[name]
        many = np.tile(problem.initial_conditions, (20, 1))[: min(most, 400) if quick else most]
        for tolerance in tolerances[::2] if "SciPy" in name else tolerances:
            run = make(problem.system, tolerance)
            few = problem.initial_conditions[:most]
            error = largest(run(few) - problem.images[:most])
            seconds = best_seconds(lambda r=run, m=many: r(m), 1 if "SciPy" in name else 3)  # type: ignore[misc]
            yield Run(name, f"{tolerance:.0e}", 1e6 * seconds / len(many), error)


def tables(quick: bool) -> list[Chart]:
    """Return for each problem the seconds of interpolation and iteration, against the error of a period."""
    charts = []
    for problem in PROBLEMS[: 2 if quick else None]:
        exact = stroboscopic_map(problem.system, rtol=1e-12, atol=1e-12)
        initial_conditions = (
            problem.grid(100 if problem.system.dimension == 2 else 10).centres().reshape(-1, exact.dimension)
        )
        sizes = (QUICK_SIZES if quick else FULL_SIZES)[exact.dimension]
        kinds = [(1, 1), (3, 1), (5, 1), *([(5, 4)] if exact.dimension == 2 else [])]
        runs = [
            _table(problem, exact, initial_conditions, order, max_step, cells)
            for order, max_step in kinds
            for cells in sizes
        ]
        periods = f"{len(initial_conditions):,} orbits, {LOOKUPS} periods"
        charts.append(
            Chart(f"interpolated maps, {problem.name}", f"s with interpolation, {periods}", "median error", tuple(runs))
        )
    return charts


def _table(
    problem: Problem, exact: PointMap, initial_conditions: np.ndarray, order: int, max_step: int, cells: int
) -> Run:
    """Measure one interpolated map; multi-period steps are taken where they are as accurate as their default asks."""
    settings: dict[str, Any] = {"tolerance": _ANY} if max_step == 1 else {"max_step": max_step}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of coarse grids, which are what is measured
        table = interpolated_map(exact, problem.table(cells), order=order, outside="integrate", **settings)
    assert table.table is not None
    errors = np.abs(table.iterate(problem.initial_conditions, 1).unwrapped - problem.images).max(axis=1)
    seconds = best_seconds(lambda: table.iterate(initial_conditions, LOOKUPS), 2)
    more = f"interpolated in {table.cost.seconds:.2g} s, largest error {errors.max():.1e}"
    name = f"order {order}" + (f", steps of {max_step} periods" if max_step > 1 else "")
    return Run(name, f"{cells} cells a side", table.cost.seconds + seconds, float(np.median(errors)), more)
