"""Right-hand sides that jump: sliding and sticking, crossings, events in time; against exact solutions and SciPy."""

from __future__ import annotations

from math import cos, inf, pi, sqrt
from typing import Any

import numpy as np
import pytest

from cellmap import ForcedSystem, jacobian, stroboscopic_map
from cellmap.kernels.options import LANES
from cellmap.pointmap import CHUNK, Status
from cellmap.threads import set_threads
from systems import dimensionless_pendulum

# Exact solutions


def bang_bang(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
    return x[1], -s[0]


def tilted_line(t: float, x: Any, p: Any) -> tuple[float]:
    return (x[0] + p.tilt * x[1],)


def parabolas(x: float, v: float, tilt: float, left: float) -> tuple[float, float] | None:
    """Motion x'' = -sign(x + tilt v) after a time, parabola by parabola; None where it begins to slide."""
    sign = 1.0 if x + tilt * v > 0.0 else -1.0
    height = x + tilt * v
    while True:
        # sign h = sign (height + slope t) - t^2/2
        slope = v - tilt * sign
        stay = sign * slope + sqrt(slope * slope + 2.0 * abs(height))
        stay = stay if stay > 0.0 else inf
        if stay >= left:
            return x + v * left - 0.5 * sign * left**2, v - sign * left
        x, v, left = x + v * stay - 0.5 * sign * stay**2, v - sign * stay, left - stay
        height, sign = 0.0, -sign
        if abs(v) < abs(tilt):
            return None


def test_thrust_towards_a_tilted_line() -> None:
    """Ten crossings and more, between which the distance from the line is a parabola and the series ends early."""
    rng, count = np.random.default_rng(0), 0
    system = ForcedSystem(bang_bang, {"tilt": 0.0}, 12.0, ("x", "v"), switches=tilted_line)
    for tilt in (-0.037, 0.0, 0.01, 0.041):
        starts = rng.uniform(-1.0, 1.0, (300, 2)) * (1.0, 2.0)
        images = stroboscopic_map(system.with_params(tilt=tilt), rtol=1e-12, atol=1e-12).iterate(starts, 1)
        for start, image, status in zip(starts.tolist(), images.unwrapped, images.status, strict=True):
            if (exact := parabolas(*start, tilt, 12.0)) is not None:
                assert image == pytest.approx(exact, abs=1e-11)
                assert status == Status.OK
                count += 1
    assert count > 900


# Starts on a surface


def two_springs(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
    return x[1], -(1.5 + 0.5 * s[0]) * x[0] - 0.1 * x[1] + p.force * cos(t)


def position(t: float, x: Any, p: Any) -> tuple[float]:
    return (x[0],)


@pytest.mark.parametrize("force", [-1.0, 1.0])
def test_a_start_that_touches_a_surface_leaves_it_on_the_right_side(force: float) -> None:
    """Position and velocity zero where one spring meets another: only the acceleration tells where it goes."""
    system = ForcedSystem(two_springs, {"force": force}, 2.0 * pi, ("x", "v"), switches=position)
    images = stroboscopic_map(system, rtol=1e-12, atol=1e-12).iterate([[0.0, 0.0], [1e-14, 0.0], [-1e-14, 0.0]], 1)
    assert (images.status == Status.OK).all()
    assert images.unwrapped == pytest.approx(np.tile(images.unwrapped[1], (3, 1)), abs=1e-11)


def test_rest_on_a_surface_is_rest() -> None:
    """Nothing moves, so the switching function is zero throughout."""
    system = ForcedSystem(two_springs, {"force": 0.0}, 2.0 * pi, ("x", "v"), switches=position)
    images = stroboscopic_map(system, rtol=1e-12, atol=1e-12).iterate([[0.0, 0.0], [1e-305, 0.0]], 3)
    assert (images.status == Status.OK).all()
    assert np.abs(images.points).max() <= 1e-305


def test_the_derivative_at_a_start_that_sticks() -> None:
    """Neighbours of the start with a small velocity stop at once: their image does not depend on it."""
    strobe = stroboscopic_map(dimensionless_pendulum(0.5, 0.3, 0.03, 1.0))
    assert jacobian(strobe, [0.3, 0.0]) == pytest.approx(np.diag([1.0, 0.0]), abs=1e-15)
    slope = (strobe([0.3, 1e-5]) - strobe([0.3, -1e-5])) / 2e-5
    assert slope == pytest.approx([0.0, 0.0], abs=1e-4)


# Purity


def test_an_image_does_not_depend_on_its_neighbours() -> None:
    """Bit by bit, whether or not others stick: order and number of the starts, and the number of threads."""
    strobe = stroboscopic_map(dimensionless_pendulum(0.5, 0.3, 0.03, 0.4))
    starts = np.random.default_rng(0).uniform(-1.0, 1.0, (CHUNK + 777, 2)) * (pi, 3.0)
    images = strobe.iterate(starts, 2).points
    order = np.random.default_rng(1).permutation(len(starts))
    assert np.array_equal(strobe.iterate(starts[order], 2).points, images[order])
    for count in (1, 2, LANES - 1, LANES + 1):
        for first in range(0, 3 * LANES, 7):
            part = slice(first, first + count)
            assert np.array_equal(strobe.iterate(starts[part], 2).points, images[part])
    for threads in (1, 2):
        set_threads(threads)
        assert np.array_equal(strobe.iterate(starts, 2).points, images)
