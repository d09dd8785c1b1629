"""Proved labels: which part of the window, at what cost next to direct integration, and orbits as theorems."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise
from math import pi

import numpy as np
import pytest

from cellmap import (
    CellGrid,
    ForcedSystem,
    PointMap,
    discrete_map,
    find_basins,
    find_periodic_orbits,
    interpolated_map,
    periodic_orbit,
    stroboscopic_map,
)
from cellmap.basins import prove
from cellmap.basins.proofs.regions import alike
from cellmap.orbits import NotProvedError, prove_orbit
from systems import dimensionless_parameters, dimensionless_pendulum, duffing_oscillator

PENDULUM = dimensionless_parameters(length=0.0272, frequency=50.0, amplitude=0.004, damping=10.0)


def shaken(amplitude: float) -> ForcedSystem:
    return dimensionless_pendulum(
        **dimensionless_parameters(amplitude=amplitude, length=0.0272, frequency=50.0, damping=10.0)
    )


FLOWS = {
    "pendulum, 4 mm, 500^2 (asked 93 %, 8 times)": (shaken(0.004), (pi, 0.32), 500, 0),
    "pendulum, 4 mm, 500^2, one split (asked 98 %)": (shaken(0.004), (pi, 0.32), 500, 1),
    "pendulum, 10 mm, 1000^2 (asked 40 %)": (shaken(0.010), (pi, 0.32), 1000, 0),
    "pendulum, 10 mm, 500^2, two splits (asked 50 % in 60 s)": (shaken(0.010), (pi, 0.32), 500, 2),
    "inverted pendulum, damping 0.6, 500^2 (asked 90 %)": (dimensionless_pendulum(-0.1, 0.545, 0.6), (pi, 4), 500, 1),
    # A chaotic saddle fills the upright basin: 44 % of cells of 1000^2 have neighbours of nearly its settling time.
    "inverted pendulum, damping 0.2, 500^2": (dimensionless_pendulum(-0.1, 0.545, 0.2), (pi, 4.0), 500, 1),
    "two-well Duffing, strongly damped, 500^2 (asked 60 %)": (duffing_oscillator(0.5, -1.0, 1.0, 0.2), (2, 2), 500, 1),
    "hardening Duffing, 500^2 (asked 80 %)": (duffing_oscillator(0.1, 1.0, 1.0, 0.5, 1.5), (3, 3), 500, 1),
}


@pytest.mark.parametrize("name", FLOWS)
def test_proved_flows(say: Callable[[str], None], one_thread: None, name: str) -> None:
    system, window, side, splits = FLOWS[name]
    exact = stroboscopic_map(system)
    reach = (window[0] if window[0] == pi else 1.5 * window[0], 1.5 * window[1])
    table = interpolated_map(exact, CellGrid((-reach[0], -reach[1]), reach, (256, 256)), outside="integrate")
    say(of_a_map(name, table, CellGrid((-window[0], -window[1]), window, (side, side)), splits))


def of_a_map(name: str, point_map: PointMap, grid: CellGrid, splits: int) -> str:
    """Prove basins and say what came out, in seconds of the processor."""
    small = CellGrid(grid.lower, grid.upper, (16, 16))
    prove(find_basins(point_map, small), splits=0)  # compiles
    basins = find_basins(point_map, grid)
    began = time.process_time()
    direct = find_basins(point_map.without_table, grid, attractors=basins.attractors)
    integration = time.process_time() - began
    began = time.process_time()
    proof = prove(basins, splits=splits)
    seconds = time.process_time() - began
    sure, known = alike(direct.labels, proof.grid.wraps) & (direct.labels >= 0), proof.labels >= 0
    return (
        f"{name}: {100 * proof.share:.2f} % proved, {100 * known[sure].mean():.1f} % of cells whose neighbours agree "
        f"({100 * sure.mean():.1f} %), in {seconds:.1f} s, {seconds / integration:.1f} times direct integration "
        f"({integration:.1f} s); {proof.cost.evaluations:,} boxes; "
        f"{np.count_nonzero(proof.labels[known] != direct.labels[known])} differ; "
        + "; ".join(f"{basins.label_name(k)} {area:.4g}" for k, area in proof.areas.items())
    )


def newton(x, p):
    """z - (z**3 + a z + b) / (3 z**2 + a), for real a and b."""
    u, v = x
    re, im = u**3 - 3 * u * v * v + p.a * u + p.b, 3 * u * u * v - v**3 + p.a * v
    dr, di = 3 * (u * u - v * v) + p.a, 6 * u * v
    size = dr * dr + di * di
    return u - (re * dr + im * di) / size, v - (im * dr - re * di) / size


def quadratic(x, p):
    return x[0] ** 2 - x[1] ** 2 + p.a, 2 * x[0] * x[1] + p.b


def henon(x, p):
    return 1 - p.a * x[0] ** 2 + x[1], p.b * x[0]


MAPS = {
    "Newton's method for z^3 - 1": (newton, {"a": 0.0, "b": -1.0}, 2.0),
    "Newton's method for z^3 - 2 z - 3": (newton, {"a": -2.0, "b": -3.0}, 2.0),
    "quadratic map of the plane": (quadratic, {"a": -0.1, "b": 0.2}, 1.5),
    "Henon with a sink": (henon, {"a": 1.0, "b": -0.3}, 2.5),
}


@pytest.mark.parametrize("name", MAPS)
def test_proved_discrete_maps(say: Callable[[str], None], one_thread: None, name: str) -> None:
    function, params, window = MAPS[name]
    point_map = discrete_map(function, params, ("x", "y"))
    grid = CellGrid((-window, -window), (window, window), (500, 500))
    for splits in (0, 1):  # `prove` has one by default
        say(of_a_map(f"{name}, {splits} splits (asked 90 % of cells that agree)", point_map, grid, splits))


def test_orbits_as_theorems(say: Callable[[str], None]) -> None:
    five = stroboscopic_map(duffing_oscillator(0.08, 0.0, 1.0, 0.2, 1.0))
    basins = find_basins(five, CellGrid((-1, -1), (1, 1), (60, 60)))
    orbits = [a.points[: a.period] for a in basins.attractors]
    saddles = [o for q in (1, 3) for o in find_periodic_orbits(five, CellGrid((-1, -1), (1, 1), (40, 40)), q)]
    for what, some in (("attractors", orbits), ("other orbits", [o for o in saddles if abs(o.multipliers[0]) > 1.0])):
        proved = []
        for orbit in some:
            try:
                proved.append(prove_orbit(five, orbit))
            except NotProvedError as error:
                say(f"five-attractor Duffing: {error}")
        say(f"five-attractor Duffing, {what}: {len(proved)} of {len(some)} proved: " + "; ".join(map(repr, proved)))
    logistic = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 3.835}, ("x",))
    stable = 0
    values = np.linspace(3.829, 3.8414, 400)
    for low, high in pairwise(values.tolist()):
        here = logistic.with_params(r=0.5 * (low + high))
        stable += bool(prove_orbit(here, periodic_orbit(here, [0.5], 3), {"r": (low, high)}).stable)
    say(f"logistic map, r from 3.829 to 3.8414: a stable orbit of period 3 proved in {stable} of 399 pieces")
    ends = (
        dimensionless_parameters(amplitude=a, length=0.0272, frequency=50.0, damping=10.0)["beta"]
        for a in (0.0030, 0.0031)
    )
    betas = np.linspace(*ends, 26)
    for low, high in pairwise(betas.tolist()):
        exact = stroboscopic_map(dimensionless_pendulum(**{**PENDULUM, "beta": 0.5 * (low + high)}))
        say(
            f"inverted state, beta in ({low:.6f}, {high:.6f}): {prove_orbit(exact, [[pi, 0.0]], {'beta': (low, high)})}"
        )
