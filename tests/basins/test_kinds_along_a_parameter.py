"""Images that follow a parameter through chaos, tori, continua and back equal those of basins found from nothing."""

from collections.abc import Callable, Sequence
from math import cos, pi, tanh

import numpy as np
import pytest

import systems
from cellmap import CellGrid, ForcedSystem, PointMap, discrete_map, find_basins, stroboscopic_map
from cellmap.basins import LiveBasins
from cellmap.orbits import Kind


def flow(rhs: Callable[..., object], period: float, **params: float) -> PointMap:
    return stroboscopic_map(ForcedSystem(rhs, params, period, ("q", "v")), rtol=1e-6, atol=1e-6)


def two_wells(t, x, p):
    return x[1], x[0] - x[0] ** 3 - 0.15 * x[1] + p.g * cos(t)


def van_der_pol(t, x, p):
    return x[1], p.mu * (1 - x[0] ** 2) * x[1] - x[0]


def plane(rhs: Callable[..., object], **params: float) -> PointMap:
    return discrete_map(rhs, params, ("x", "y"))


SQUARE = CellGrid((-2, -2), (2, 2), (12, 12))
RING = CellGrid((-1, -1, 0, 0, 0), (1, 1, 0.1, 0.1, 0.1), (6, 6, 1, 1, 1))
WALKS: dict[str, tuple[Callable[[], PointMap], CellGrid, str, Sequence[float]]] = {
    "logistic map": (lambda: systems.logistic_map(3.2), CellGrid((0,), (1,), (40,)), "mu", (3.2, 3.7, 3.83)),
    "Hénon map": (
        lambda: plane(lambda x, p: (1 - p.a * x[0] ** 2 + x[1], 0.3 * x[0]), a=0.9),
        CellGrid((-1.5, -0.5), (1.5, 0.5), (16, 16)),
        "a",
        (0.9, 1.4, 1.06, 1.5),
    ),
    "delayed logistic map": (
        lambda: plane(lambda x, p: (p.a * x[0] * (1 - x[1]), x[0]), a=1.9),
        CellGrid((0.05, 0.05), (0.95, 0.95), (16, 16)),
        "a",
        (1.9, 2.1, 2.27, 2.15, 1.9),
    ),
    "continuum of fixed points": (
        lambda: plane(lambda x, p: (x[0] - p.c * x[0], 0.5 * x[1]), c=0.1),
        SQUARE,
        "c",
        (0.1, 0.0, 2.0, 0.2, 0.0),
    ),
    "tilted wells": (
        lambda: discrete_map(lambda x, p: (x[0] + 0.2 * (x[0] - x[0] ** 3 + p.t),), {"t": 0.0}, ("x",)),
        CellGrid((-2,), (2,), (51,)),
        "t",
        (0.0, 0.5, 0.3, -0.5, 0.0),
    ),
    "ring of five": (
        lambda: discrete_map(
            lambda x, p: tuple(tanh(p.a * x[i] + 0.2 * x[(i + 1) % 5]) for i in range(5)), {"a": 1.5}, tuple("abcde")
        ),
        RING,
        "a",
        (1.5, 0.7, -1.5, 1.5),
    ),
    "limit cycle": (lambda: flow(van_der_pol, 1.0, mu=1.0), SQUARE, "mu", (1.0, -0.5, 1.0)),
    "two wells": (lambda: flow(two_wells, 2 * pi, g=0.2), SQUARE, "g", (0.2, 0.3, 0.25)),
}


QUICK = ("delayed logistic map", "continuum of fixed points")
MET = {
    "two wells": {Kind.CHAOTIC},
    "delayed logistic map": {Kind.QUASIPERIODIC},
    "continuum of fixed points": {Kind.EQUILIBRIA, Kind.CONTINUUM},
}
"""Kinds that are met on the way."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in QUICK else pytest.mark.thorough) for name in WALKS]
)
def test_images_along_a_parameter_are_those_of_basins_found_from_nothing(name: str) -> None:
    make, grid, parameter, values = WALKS[name]
    point_map = make()
    live, met = LiveBasins(point_map, grid, max_periods=500), set()
    for value in values:
        frame = live.image({parameter: value})
        alone = find_basins(point_map.with_params(**{parameter: value}), grid, max_periods=500)
        assert frame is not None
        assert frame.complete
        assert [a.kind for a in frame.basins.attractors] == [a.kind for a in alone.attractors]
        assert np.array_equal(frame.basins.labels, alone.labels)
        met |= {a.kind for a in alone.attractors}
    assert met >= MET.get(name, set())
