"""Derivatives of the map against its images: processor time of one thread, 4,096 orbits."""

from __future__ import annotations

import time

import numpy as np
import pytest

import systems
from cellmap import lyapunov_spectrum, stroboscopic_map
from cellmap.maps import jacobian
from cellmap.maps.orbit_batch import Orbits
from cellmap.maps.tangent import tangent

PERIODS = 100


def least_cost(call, rounds=5):
    costs = []
    for _ in range(rounds):
        began = time.process_time()
        call()
        costs.append(time.process_time() - began)
    return min(costs)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize(
    "name", ["ueda_oscillator", "two_well_duffing", "forced_pendulum", "van_der_pol_oscillator", "double_pendulum"]
)
def test_derivatives_against_images(say, one_thread, name, tolerance):
    strobe = stroboscopic_map(getattr(systems, name)(), rtol=tolerance, atol=tolerance)
    points = np.random.default_rng(0).uniform(-2.0, 2.0, (4096, strobe.dimension))
    works = (lambda: strobe.advance(Orbits.starting(points.copy()), 1), lambda: jacobian(strobe, points))
    images, derivatives, newton = (least_cost(f) for f in (*works, lambda: tangent(strobe, points)))
    some = points[:512]
    orbits = least_cost(lambda: strobe.advance(Orbits.starting(some.copy()), PERIODS), 2) / PERIODS / len(some)
    frames = least_cost(lambda: lyapunov_spectrum(strobe, some, PERIODS, 0), 2) / PERIODS / len(some)
    say(
        f"{name}, {tolerance:g}: an image {1e6 * images / len(points):.2f} us, jacobian {derivatives / images:.2f} "
        f"times, derivatives for Newton's method {newton / images:.2f} times; a period of an orbit {1e6 * orbits:.2f} us, "
        f"its Lyapunov exponents {frames / orbits:.2f} times"
    )
