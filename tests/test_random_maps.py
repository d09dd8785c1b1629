"""Random maps, by new parameters of a few compiled families: errors of tables, and labels of certificates."""

from __future__ import annotations

from math import cos, exp, sin

import numpy as np
import pytest

from cellmap import CellGrid, PointMap, discrete_map, interpolated_map
from cellmap.table_errors import TableErrors

ORDERS = (1, 3, 5)
COARSE = 1e6  # a tolerance that leaves no cell to the exact map

DEGREE = 6


def polynomial(x, p):
    """Holomorphic: a polynomial of z = x + i y with complex coefficients."""
    u, v = p.r6, p.i6
    for r, i in ((p.r5, p.i5), (p.r4, p.i4), (p.r3, p.i3), (p.r2, p.i2), (p.r1, p.i1), (p.r0, p.i0)):
        u, v = u * x[0] - v * x[1] + r, u * x[1] + v * x[0] + i
    return u, v


def exponential(x, p):
    """Holomorphic: a exp((k + i l) z) + b z."""
    size, phase = p.a * exp(p.k * x[0] - p.l * x[1]), p.k * x[1] + p.l * x[0]
    return size * cos(phase) + p.b * x[0], size * sin(phase) + p.b * x[1]


def waves(x, p):
    """Not holomorphic."""
    bump = p.d * exp(-p.l * p.l * (x[0] * x[0] + x[1] * x[1]))
    return (
        p.a * sin(p.k * x[0] + p.l * x[1]) + p.b * x[0] * x[1] * cos(p.m * x[0]),
        p.c * cos(p.m * x[1] - p.k * x[0]) + bump,
    )


def space(x, p):
    """Three dimensions; the first two components are harmonic in part."""
    return (
        p.a * (x[0] * x[0] + x[1] * x[1] - 2 * x[2] * x[2]) + p.b * sin(p.k * x[0]) * sin(p.k * x[1]),
        p.a * exp(p.k * x[0]) * cos(p.k * x[2]),
        p.b * cos(p.k * x[0] + p.l * x[1] + p.m * x[2]),
    )


FAMILIES = {
    polynomial: ("x y", " ".join(f"{part}{k}" for part in "ri" for k in range(DEGREE + 1))),
    exponential: ("x y", "k l a b"),
    waves: ("x y", "a b c d k l m"),
    space: ("x y z", "a b k l m"),
}


def families(*chosen):
    """Return a map for each family, with all parameters 0."""
    return {
        f: discrete_map(f, dict.fromkeys(names.split(), 0.0), tuple(coordinates.split()))
        for f, (coordinates, names) in FAMILIES.items()
        if f in chosen or not chosen
    }


def smooth_map(rng: np.random.Generator, made: dict) -> tuple[PointMap, CellGrid]:
    """Return a map whose images stay within some windows, and a grid of 8 to 45 square or oblong cells a side."""
    while True:
        family = rng.choice(list(made))
        exact = made[family]
        params = {name: rng.normal() * rng.choice([0.3, 1.0, 2.0]) for name in exact.params}
        if family is polynomial:
            params = {name: value * (rng.random() < 0.5) for name, value in params.items()}
        exact, d = exact.with_params(**params), exact.dimension
        half = np.full(d, 2.0 ** rng.uniform(-2.0, 1.5))
        most = 5.5 if d == 2 else 4.0
        shape = (int(2.0 ** rng.uniform(3.0, most)),) * d
        if rng.random() < 0.3:
            half = half * 2.0 ** rng.uniform(-1.0, 1.0, d)
            shape = tuple(int(n) for n in 2.0 ** rng.uniform(3.0, most, d))
        middle = rng.normal(size=d) * half * 0.3
        grid = CellGrid(tuple(middle - half), tuple(middle + half), shape)
        # The nodes past the edges of a window belong to it, and images 100 windows away count as none.
        wide = middle + rng.uniform(-1.0, 1.0, (2000, d)) * half * (1.0 + 20.0 / min(shape))
        if np.abs(exact.iterate(wide, 1).points / half).max() < 100.0:
            return exact, grid


def errors_and_bounds(rng: np.random.Generator, made: dict, order: int, tolerance: float | None) -> float:
    """Return the largest error in the cells of a random table over that which certificates reckon with."""
    exact, grid = smooth_map(rng, made)
    icm = interpolated_map(exact, grid, order, tolerance=tolerance)
    inside = rng.uniform(-0.5, 0.5, (max(20_000 // grid.size, 1), *(1,) * grid.dimension, grid.dimension))
    points = grid.centres() + inside * grid.widths
    ours, theirs = icm.iterate(points, 1).points, exact.iterate(points, 1).points
    errors = (np.abs(ours - theirs) / grid.widths).max(axis=(0, -1)).ravel()
    bounds = TableErrors.of(icm, 4.0, False).errors
    rounding = 1e-13 * max(1.0, np.abs(theirs).max()) / grid.widths.min()
    kept = ~icm.table.rough.ravel() & (errors > rounding)
    return float((errors / bounds)[kept].max()) if kept.any() else 0.0


@pytest.mark.filterwarnings("ignore:.* of the cells are left:UserWarning")
@pytest.mark.parametrize("order", ORDERS)
def test_errors_stay_below_the_bounds_of_certificates(order):
    rng, made = np.random.default_rng(order), families(polynomial, waves)
    assert 0.2 < max(errors_and_bounds(rng, made, order, COARSE) for _ in range(10)) < 1.0


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.* of the cells are left:UserWarning")
def test_errors_stay_below_the_bounds_of_certificates_for_300_random_maps():
    rng, made = np.random.default_rng(2024), families()
    largest = [
        [errors_and_bounds(rng, made, order, tolerance) for order in ORDERS for tolerance in (None, COARSE)]
        for _ in range(300)
    ]
    assert np.max(largest) < 1.0
    assert np.median(largest) > 0.1  # the bounds are of use
