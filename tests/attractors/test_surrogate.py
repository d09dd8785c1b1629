"""One chaotic attractor of all orbits, for which an interpolated map is followed in the place of the map."""

from __future__ import annotations

import numpy as np
import pytest

from cellmap import discrete_map
from cellmap.attractors.surrogate import only_attractor
from cellmap.attractors.transients import Late

NONE_LATE = Late(np.empty((0, 2)), np.empty(0, np.int64))
FOLD = discrete_map(lambda x, p: (4.0 * p.a * x[0] * (1.0 - x[0]), 0.5 * x[1]), {"a": 0.95}, ("x", "y"))
CYCLE_OF_20 = 0.9491767575122371
"""x = 1/2, where the slope is zero, is on a cycle: it attracts a millionth of the interval at once."""


def only(a: float, periods: int):
    point_map = FOLD.with_params(a=a)
    begin = np.random.default_rng(0).uniform((0.2, -1e-3), (0.9, 1e-3), (1024, 2))
    points = point_map.iterate(begin, 64).points
    return only_attractor(point_map, points, np.ones(2), [], NONE_LATE, 64, periods)


def test_cycle_inside_of_chaos_is_seen_by_the_surrogate():
    x = 0.5
    for _ in range(20):
        x = 4.0 * CYCLE_OF_20 * x * (1.0 - x)
    assert x == pytest.approx(0.5, abs=1e-9)
    assert only(CYCLE_OF_20, 64) is not None  # 32 orbits, followed for 1,000 periods, do not come to it
    assert only(CYCLE_OF_20, 2000) is None


def test_attractor_is_the_one_that_long_orbits_show():
    """Lyapunov exponents from the derivative along an orbit of 200,000 steps, and log(1/2) across."""
    x, total = 0.3, 0.0
    for _ in range(200_000):
        total += np.log(abs(3.8 * (1.0 - 2.0 * x)))
        x = 3.8 * x * (1.0 - x)
    found = only(0.95, 2000)
    assert found is not None and found.cover.trapped.all()
    assert found.exponents == pytest.approx([total / 200_000, np.log(0.5)], abs=0.01)


def test_no_attractor_where_orbits_leave_or_have_more_than_two_coordinates():
    assert only(1.02, 2000) is None
    three = discrete_map(lambda x, p: (3.8 * x[0] * (1.0 - x[0]), 0.5 * x[1], 0.5 * x[2]), {}, ("x", "y", "z"))
    late = Late(np.empty((0, 3)), np.empty(0, np.int64))
    assert only_attractor(three, np.full((600, 3), 0.3), np.ones(3), [], late, 64, 2000) is None
