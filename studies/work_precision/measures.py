"""Exponents and dimensions of known value: their error against seconds."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from math import log

import numpy as np
from numpy.typing import NDArray

from cellmap import CellGrid, lyapunov_spectrum
from cellmap.analysis.fractal import box_dimension, image_uncertainty_exponent, uncertainty_exponent
from systems import logistic_map, mcdonald_map

from .chart import Chart, Run

REGION = CellGrid((0.0, -2.0), (1.0, 2.0), (64, 64))
STRETCHING = 3, 1.5  # of McDonald's map, whose boundary has the uncertainty exponent ln 1.5 / ln 3


def compare(quick: bool) -> list[Chart]:
    """Return a chart for each measure."""
    return [_exponent(quick), _dimension(quick), _lyapunov(quick)]


def _timed(series: str, settings: Sequence[int], work: Callable[[int], tuple[float, float]], exact: float) -> list[Run]:
    """Run work for each setting; it returns a value and its standard error."""
    runs = []
    for setting in settings:
        began = time.perf_counter()
        value, error = work(setting)
        seconds = time.perf_counter() - began
        said = f"{value:.4f} ± {error:.4f}, exactly {exact:.4f}"
        runs.append(Run(series, f"{setting:,}", seconds, abs(value - exact), said))
    return runs


def _side(ends: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return to which side orbits escape: beyond 1 / (growth - 1) = 2 they stay there."""
    return np.where(ends[..., 1] > 2.0, 1, np.where(ends[..., 1] < -2.0, 0, -1))


def _exponent(quick: bool) -> Chart:
    exact = log(STRETCHING[1]) / log(STRETCHING[0])
    point_map = mcdonald_map(*STRETCHING)
    few, many = (4, 6) if quick else (4, 7)

    def by_pairs(pairs: int) -> tuple[float, float]:
        found = uncertainty_exponent(point_map, REGION, outcome=_side, max_pairs=pairs, min_uncertain=10**9)
        return found.exponent, found.standard_error

    def by_image(side: int) -> tuple[float, float]:
        grid = CellGrid(REGION.lower, REGION.upper, (side, side))
        found = image_uncertainty_exponent(_side(point_map.iterate(grid.centres(), 30).points))
        return found.exponent, found.standard_error

    runs = _timed("pairs of points", [10**k for k in range(few, many)], by_pairs, exact)
    runs += _timed("a basin image", [256, 512, 1024] if quick else [256, 512, 1024, 2048, 4096], by_image, exact)
    return Chart("uncertainty exponent of McDonald's map", "s", "error of the exponent", tuple(runs), 1e-5)


def _dimension(quick: bool) -> Chart:
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
    exact = log(3) / log(2)

    def by_points(number: int) -> tuple[float, float]:
        choices = np.random.default_rng(0).integers(0, 3, (40, number))
        points = np.full((number, 2), 0.3)
        for choice in choices:
            points = 0.5 * (points + corners[choice])
        found = box_dimension(points)
        return found.dimension, found.standard_error

    runs = _timed("box counting", [10**k for k in range(4, 6 if quick else 8)], by_points, exact)
    return Chart("dimension of Sierpinski's triangle, random points", "s", "error of the dimension", tuple(runs), 1e-5)


def _lyapunov(quick: bool) -> Chart:
    def by_steps(steps: int) -> tuple[float, float]:
        found = lyapunov_spectrum(logistic_map(4.0), [0.3], periods=steps)
        return float(found.exponents[0]), float(found.standard_errors[0])

    runs = _timed("orbit", [10**k for k in range(3, 5 if quick else 7)], by_steps, log(2))
    return Chart("Lyapunov exponent of the logistic map at 4", "s", "error of the exponent", tuple(runs), 1e-6)
