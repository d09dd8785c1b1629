"""Small systems, and what is found of them, that the calls of public functions are given."""

from functools import cache
from typing import Any

import numpy as np

import cellmap
import systems
from cellmap import CellGrid, ForcedSystem, PointMap, angle, discrete_map
from cellmap.bifurcations import continue_bifurcation


def two_wells(x: Any, p: Any) -> tuple[Any, Any]:
    """Attractors at sqrt(r - 1) to either side, a saddle between them, doublings of the period from r = 2 on."""
    return p.r * x[0] - x[0] ** 3, p.s * x[1]


def spiral(t: Any, x: Any, p: Any) -> tuple[Any, Any]:
    return x[1], -x[0] - 2 * p.d * x[1]


NUDGE = 1.0
"""A factor that hardly differs from 1 where results are looked for that depend on rounding."""

WINDOW = CellGrid((-1.5, -1.0), (1.5, 1.0), (12, 8))
POINTS = np.array([[0.4, 0.1], [-0.3, 0.2]])
CLOUD = np.random.default_rng(0).random((2000, 2))
LABELS = (np.add.outer(np.arange(64) ** 2, np.arange(64) * 40) > 1500).astype(int)


@cache
def wells() -> PointMap:
    return discrete_map(two_wells, {"r": 1.55, "s": 0.5}, ("x", "y"), "two wells")


@cache
def leaving() -> PointMap:
    """Orbits leave the window but for a Cantor set."""
    return wells().with_params(r=2.7)


@cache
def swinging() -> ForcedSystem:
    return systems.dimensionless_pendulum(gamma=0.3)


@cache
def rotating() -> ForcedSystem:
    return ForcedSystem(spiral, {"d": 0.1}, 6.0, ("q", "v"))


@cache
def interpolated() -> cellmap.Basins:
    table = cellmap.interpolated_map(wells(), WINDOW, order=1, tolerance=0.3)
    return cellmap.find_basins(table, WINDOW, max_periods=60)


@cache
def delayed_logistic() -> Any:
    """Return a map with an invariant circle."""
    return discrete_map(
        lambda x, p: (p.a * x[0] * (1 - x[1]) + p.e * x[0] ** 2, x[0]), {"a": 2.18, "e": 0.0}, ("x", "y"), "delayed"
    )


def turning() -> Any:
    """Return a map of the circle, locked to rest where abs(w) < k."""
    return discrete_map(lambda x, p: (x[0] + p.w - p.k * np.sin(x[0]),), {"w": 0.1, "k": 0.5}, (angle("t"),))


def circle_of_delayed_logistic() -> dict[str, Any]:
    """Return what is needed to follow that circle from its birth."""
    exact = delayed_logistic().with_params(a=1.9)
    branch = cellmap.continue_orbit(exact, cellmap.periodic_orbit(exact, [0.47, 0.47]), "a", 1.5, 2.1, step=0.1)
    found = {"branch": branch, "bifurcation": branch.bifurcations[0]}
    return found | {"lower": 1.5, "upper": 2.1, "step": 0.05, "max_points": 3}


@cache
def outer_saddle() -> tuple[Any, Any]:
    """Return a map with homoclinic orbits, and their saddle."""
    turned = discrete_map(
        lambda x, p: (p.a - x[0] ** 2 + p.b * x[1], x[0]), {"a": 1.4, "b": -0.3}, ("x", "y"), "turned"
    )
    return turned, cellmap.periodic_orbit(turned, [-2.0, -2.0])


@cache
def cusp_of_a_cubic_map() -> tuple[Any, Any]:
    """Return a curve of folds, and its cusp at a = b = 0, for c = 0."""
    params = {"a": -1.0, "b": 0.5, "c": 0.0}
    cubic = discrete_map(lambda x, p: (x[0] + p.a + p.b * x[0] + p.c * x[0] ** 2 - x[0] ** 3,), params, ("x",))
    branch = cellmap.continue_orbit(cubic, cellmap.periodic_orbit(cubic, [-1.2]), "a", -1.0, 1.0, step=0.1)
    box = {"first": (-1.0, 1.0), "second": (-1.0, 1.0)}
    fold = branch.of_kind(cellmap.bifurcations.BifurcationKind.FOLD)[0]
    curve = continue_bifurcation(branch, fold, "b", **box, step=0.1)
    return curve, curve.codimension_two()[0]


@cache
def doublings_of_henon() -> Any:
    """Return a curve of period doublings with a 1:2 resonance, at a = 3 and b = -1."""
    henon = systems.henon_map(0.2, 0.3)
    branch = cellmap.continue_orbit(henon, cellmap.periodic_orbit(henon, [0.5, 0.2]), "a", 0.0, 1.4, step=0.1)
    box = {"first": (0.0, 4.0), "second": (-1.5, 0.9)}
    return continue_bifurcation(branch, branch.bifurcations[0], "b", **box, step=0.1)
