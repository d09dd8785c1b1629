"""Derivatives of the map against its images: processor time of one thread, 4,096 orbits."""

from __future__ import annotations

import numpy as np
import pytest
from peers import best_times

import systems
from cellmap import lyapunov_spectrum, stroboscopic_map
from cellmap.maps import jacobian
from cellmap.maps.orbit_batch import Orbits
from cellmap.maps.tangent import tangent

PERIODS = 100


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize(
    "name", ["ueda_oscillator", "two_well_duffing", "forced_pendulum", "van_der_pol_oscillator", "double_pendulum"]
)
def test_derivatives_against_images(say, one_thread, name, tolerance):
    strobe = stroboscopic_map(getattr(systems, name)(), rtol=tolerance, atol=tolerance)
    points = np.random.default_rng(0).uniform(-2.0, 2.0, (4096, strobe.dimension))
    some = points[:512]
    images, derivatives, newton = best_times(
        [
            lambda: strobe.advance(Orbits.starting(points.copy()), 1),
            lambda: jacobian(strobe, points),
            lambda: tangent(strobe, points),
        ]
    )
    orbits, exponents = best_times(
        [
            lambda: strobe.advance(Orbits.starting(some.copy()), PERIODS),
            lambda: lyapunov_spectrum(strobe, some, PERIODS, 0),
        ]
    )
    say(
        f"{name}, {tolerance:g}: an image {1e6 * images / len(points):.2f} us, jacobian {derivatives / images:.2f} "
        f"times, derivatives for Newton's method {newton / images:.2f} times; "
        f"Lyapunov exponents {exponents / orbits:.2f} times their orbits"
    )
