"""Random maps, by new parameters of a few compiled families: errors of tables, and labels of certificates."""

from math import cos, exp, inf, pi, sin

import numpy as np
import pytest

from cellmap import (
    Basins,
    CellGrid,
    Label,
    PointMap,
    angle,
    certify,
    discrete_map,
    find_basins,
    interpolated_map,
)
from cellmap.basins import Certificate, Evidence
from cellmap.basins.certification.cell_owners import within
from cellmap.basins.certification.table_errors import TableErrors

pytestmark = pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")

ORDERS = (1, 3, 5)
COARSE = 1e6  # a tolerance that leaves no cell to the exact map


def relaxation(x, p):
    """Holomorphic: z - (a + i b) (z^4 + ...), whose attractors are roots of the polynomial."""
    u, v = 1.0, 0.0
    for r, i in ((p.r3, p.i3), (p.r2, p.i2), (p.r1, p.i1), (p.r0, p.i0)):
        u, v = u * x[0] - v * x[1] + r, u * x[1] + v * x[0] + i
    return x[0] - (p.a * u - p.b * v), x[1] - (p.a * v + p.b * u)


def folds(x, p):
    """All images are in a bounded region."""
    return p.a * sin(p.k * x[0] + p.l * x[1]) + p.b * x[1], p.c * cos(p.m * x[0] - p.k * x[1]) + p.d * x[0]


def space(x, p):
    """Three dimensions; the first two components are harmonic in part."""
    return (
        p.a * (x[0] * x[0] + x[1] * x[1] - 2 * x[2] * x[2]) + p.b * sin(p.k * x[0]) * sin(p.k * x[1]),
        p.a * exp(p.k * x[0]) * cos(p.k * x[2]),
        p.b * cos(p.k * x[0] + p.l * x[1] + p.m * x[2]),
    )


def kicked_rotor(x, p):
    y = p.b * x[1] + p.k * sin(x[0]) + p.l
    return x[0] + y, y


def henon(x, p):
    """Henon's map with a cubic term."""
    return 1.0 - p.a * x[0] * x[0] + x[1] - p.c * x[0] * x[0] * x[0], p.b * x[0]


def descent(x, p):
    """Steps of length h down a double well along each axis, which are coupled."""
    return (
        x[0] - p.h * (x[0] * x[0] * x[0] - x[0] + p.k * x[1] + p.l),
        x[1] - p.h * (p.m * x[1] * x[1] * x[1] - x[1] - p.k * x[0]),
    )


RANGES = {
    folds: dict(
        zip("abcdklm", ((0.5, 2), (-0.5, 0.5), (0.5, 2), (-0.5, 0.5), (0.3, 2), (-1, 1), (0.3, 2)), strict=True)
    ),
    space: dict(zip("abklm", ((-2, 2), (-2, 2), (-2, 2), (-2, 2), (-2, 2)), strict=True)),
    kicked_rotor: {"b": (0.05, 0.8), "k": (0.5, 6), "l": (-0.5, 0.5)},
    henon: {"a": (0.1, 1.3), "b": (-0.9, 0.9), "c": (-0.1, 0.2)},
    descent: {"h": (0.1, 0.7), "k": (-0.5, 0.5), "l": (-0.4, 0.4), "m": (0.3, 1.5)},
}
ROTOR = (angle("theta"), "v")
WINDOWS = {relaxation: (2.2, 2.2), folds: (3.0, 3.0), kicked_rotor: (pi, 6.0), henon: (2.5, 2.5), descent: (1.8, 1.8)}
SPACE = (2.0, 2.0, 2.0)


def maps_with_attractors(*chosen) -> dict:
    """Return a map for each family, with all parameters 0."""
    names = {f: list(ranges) for f, ranges in RANGES.items()}
    names[relaxation] = ["a", "b", *(f"{part}{k}" for part in "ri" for k in range(4))]
    coordinates = {kicked_rotor: ROTOR, space: ("x", "y", "z")}
    return {f: discrete_map(f, dict.fromkeys(names[f], 0.0), coordinates.get(f, ("x", "y"))) for f in chosen or WINDOWS}


def map_with_attractors(rng: np.random.Generator, made: dict) -> tuple[PointMap, tuple[float, ...]]:
    """Return a random map of some families, and half of the window to look at."""
    family = list(made)[rng.integers(len(made))]
    if family is relaxation:
        roots = rng.normal(size=4) + 1j * rng.normal(size=4)
        if rng.random() < 0.4:  # a mirror image, as of z^3 - z
            roots = np.array([0.0, 1.0, -1.0, 0.0]) * rng.uniform(0.5, 1.5)
        c, step = np.poly(roots), rng.uniform(0.02, 0.25) * np.exp(1j * (rng.random() < 0.5) * rng.uniform(-1.0, 1.0))
        params = {"a": step.real, "b": step.imag}
        params |= {f"{part}{k}": float(getattr(c[4 - k], name)) for k in range(4) for part, name in PARTS.items()}
    else:
        params = {name: rng.uniform(*limits) for name, limits in RANGES[family].items()}
    return made[family].with_params(**params), WINDOWS.get(family, SPACE)


PARTS = {"r": "real", "i": "imag"}


def coarse_table(rng: np.random.Generator, exact: PointMap, half: tuple[float, float]) -> PointMap:
    """Return an interpolated map on 8 to 64 cells a side of any order, with and without fallback cells."""
    wide = half
    if rng.random() >= 0.5:
        wide = tuple(w if c.is_angle else 1.5 * w for w, c in zip(half, exact.coordinates, strict=True))
    cells = int(2.0 ** rng.uniform(3.0, 6.0))
    grid = CellGrid(tuple(-w for w in wide), wide, (cells, cells))
    outside = "escape" if rng.random() < 0.4 else "integrate"
    return interpolated_map(exact, grid, int(rng.choice(ORDERS)), outside, rng.choice([None, 1.0, COARSE]))


def wrong_labels(icm: PointMap, reference: PointMap, half: tuple[float, float], side: int, periods: int) -> np.ndarray:
    """Count labels, and wrong ones, by their evidence, shape (2, 4), against a reference of the exact map."""
    window = CellGrid(tuple(-w for w in half), half, (side, side))
    certificate = certify(find_basins(icm, window, max_periods=periods), audit=50, max_cost=inf)
    if icm.recipe["outside"] == "escape":
        reference = within(icm.table.grid, reference)
    truth = find_basins(reference, window, max_periods=periods, attractors=certificate.basins.attractors)
    wrong = different(certificate, truth)
    return np.array(
        [np.bincount(certificate.evidence.ravel()[rows.ravel()], minlength=4) for rows in (wrong | True, wrong)]
    )


def different(certificate: Certificate, truth: Basins) -> np.ndarray:
    """Tell which labels name another attractor than the truth does; one that is new to a certificate is another."""
    mine = certificate.basins.attractors
    numbers = [next((k for k, a in enumerate(mine) if a is b), len(mine) + 1) for b in truth.attractors]
    labels = np.where(truth.labels >= 0, np.array([*numbers, 0])[np.maximum(truth.labels, -1)], truth.labels)
    return (labels != certificate.basins.labels) & (truth.labels != Label.UNDECIDED)


# --- errors of tables


def errors_and_bounds(rng: np.random.Generator, made: dict, order: int, tolerance: float | None) -> float:
    """Return the largest error in the cells of a random table over that which certificates reckon with.

    The window is a part of that of the map, and has 8 to 45 square or oblong cells a side.
    """
    exact, half = map_with_attractors(rng, made)
    d, oblong = exact.dimension, rng.random() < 0.3
    half = np.array(half) * 2.0 ** rng.uniform(-3.0, -1.0, d if oblong else 1)
    shape = 2.0 ** rng.uniform(3.0, 5.5 if d == 2 else 4.0, d if oblong else 1)
    middle = rng.normal(size=d) * half * 0.3
    grid = CellGrid(tuple(middle - half), tuple(middle + half), tuple(np.broadcast_to(shape.astype(int), d).tolist()))
    icm = interpolated_map(exact, grid, order, tolerance=tolerance)
    inside = rng.uniform(-0.5, 0.5, (max(20_000 // grid.size, 1), *(1,) * grid.dimension, grid.dimension))
    points = grid.centres() + inside * grid.widths
    ours, theirs = icm.iterate(points, 1).points, exact.iterate(points, 1).points
    errors = (np.abs(ours - theirs) / grid.widths).max(axis=(0, -1)).ravel()
    bounds = TableErrors.of(icm, 4.0, False).errors
    rounding = 1e-13 * max(1.0, np.abs(theirs).max()) / grid.widths.min()
    kept = ~icm.table.fallback.ravel() & (errors > rounding)
    return float((errors / bounds)[kept].max()) if kept.any() else 0.0


@pytest.mark.parametrize("order", ORDERS)
def test_errors_stay_below_the_bounds_of_certificates(order):
    rng, made = np.random.default_rng(order), maps_with_attractors(descent, folds)
    assert 0.2 < max(errors_and_bounds(rng, made, order, COARSE) for _ in range(10)) < 1.0


@pytest.mark.thorough
def test_errors_stay_below_the_bounds_of_certificates_for_60_random_maps():
    rng, made = np.random.default_rng(2024), maps_with_attractors(relaxation, folds, henon, descent, space)
    largest = [
        [errors_and_bounds(rng, made, order, tolerance) for order in ORDERS for tolerance in (None, COARSE)]
        for _ in range(60)
    ]
    assert np.max(largest) < 1.0
    assert np.median(largest) > 0.1  # the bounds are of use


# --- labels


@pytest.mark.parametrize(
    ("seed", "families", "number", "side", "periods", "least"),
    [
        (1, [descent], 4, 40, 100, 100),
        pytest.param(300, [], 300, 50, 300, 10_000, marks=pytest.mark.slow),
    ],
)
def test_no_certified_label_is_wrong(seed, families, number, side, periods, least):
    rng, made, counts = np.random.default_rng(seed), maps_with_attractors(*families), np.zeros((2, 4), int)
    for _ in range(number):
        exact, half = map_with_attractors(rng, made)
        counts += wrong_labels(coarse_table(rng, exact, half), exact, half, side, periods)
    assert (counts[0, : Evidence.OPEN] > least).all()
    assert (counts[1, : Evidence.OPEN] == 0).all()
