"""Trapping regions in many dimensions, from Lyapunov functions and few images."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov

from cellmap import discrete_map, find_attractors
from cellmap.attractors import lyapunov_regions
from cellmap.orbits.ellipsoids import lyapunov_forms

D = 6
RATES = np.array([0.9, 0.8, -0.7, 0.6, 0.5, 0.4])
AXES = np.eye(D) - np.full((D, D), 2.0 / D)  # a mirror


def cubic_step(x, p):
    """Return y -> a y + b y^3 for each coordinate y along the axes: |y| < sqrt((1 - |a|) / b) is the basin of 0."""
    mean = sum(x) / D
    y = [v - 2.0 * mean for v in x]
    z = [a * v + (p.b if a > 0 else -p.b) * v * v * v for a, v in zip(RATES.tolist(), y, strict=True)]
    mean = sum(z) / D
    return tuple(v - 2.0 * mean for v in z)


@pytest.fixture(scope="module")
def cubic():
    return discrete_map(cubic_step, {"b": 1.0}, tuple(f"x{i}" for i in range(D)))


def test_forms_solve_the_discrete_lyapunov_equation():
    rng = np.random.default_rng(0)
    step = rng.standard_normal((1, 5, 5)) / 4
    expected = solve_discrete_lyapunov((step[0] / 0.9).T, np.eye(5))
    assert lyapunov_forms(step, 0.9)[0] == pytest.approx(expected, rel=1e-10)
    steps = rng.standard_normal((3, 5, 5)) / 4
    forms = lyapunov_forms(steps, 0.8)
    for k in range(3):
        after = steps[k].T @ forms[(k + 1) % 3] @ steps[k] / 0.8**2
        assert forms[k] - after == pytest.approx(np.eye(5), abs=1e-9)


def test_the_region_lies_in_the_basin_that_is_known_exactly_and_takes_few_images(cubic, monkeypatch):
    images = []

    def counted(point_map, centres, shifts, *more):
        images.append(shifts.shape[0] * shifts.shape[1])
        return displaced(point_map, centres, shifts, *more)

    displaced = lyapunov_regions.displaced
    monkeypatch.setattr(lyapunov_regions, "displaced", counted)
    (origin,) = find_attractors(cubic, np.random.default_rng(2).uniform(-0.3, 0.3, (8, D)) @ AXES)
    region = origin.neighbourhood
    assert origin.verified and 0.9 < region.contraction < 1.0
    # The farthest points of the ellipsoid along the axes, against the borders of the basin.
    reach = np.sqrt(np.diag(AXES @ np.linalg.inv(region.metrics[0]) @ AXES.T))
    border = np.sqrt(1.0 - np.abs(RATES))
    assert (reach < border).all()
    assert (reach / border).max() > 0.1
    assert sum(images) <= 1000


def test_orbits_from_the_whole_region_of_a_cycle_come_to_it(cubic):
    """Beyond its period-doubling at a = -1 the first coordinate has the cycle y = +-sqrt(-1 - a) of y -> a y + y^3."""

    def step(x, p):
        return (-1.2 * x[0] + x[0] * x[0] * x[0], *(0.5 * x[i] + 0.3 * x[i - 1] * x[i - 1] for i in range(1, D)))

    cycles = find_attractors(
        discrete_map(step, {"b": 1.0}, tuple(f"x{i}" for i in range(D))),
        np.random.default_rng(3).uniform(-0.3, 0.3, (64, D)),
    )
    (cycle,) = cycles
    assert cycle.period == 2 and cycle.verified
    assert np.abs(cycle.points[:, 0]) == pytest.approx(np.sqrt(0.2), rel=1e-9)
    roots = np.linalg.cholesky(np.linalg.inv(cycle.neighbourhood.metrics))
    sphere = np.random.default_rng(4).standard_normal((2, 512, D))
    points = cycle.points[:, None] + np.einsum(
        "pij,pnj->pni", roots, sphere / np.linalg.norm(sphere, axis=-1, keepdims=True)
    )
    for _ in range(200):
        points = np.stack(step(points.T, None), axis=0).T
    apart = np.abs(points - cycle.points[:, None]).max(axis=-1)
    assert apart.max() < 1e-9
