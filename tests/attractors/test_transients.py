"""Orbits followed on beyond the periods that they have lasted: where they end, and what that says about them."""

from __future__ import annotations

import numpy as np
from small_maps import logistic

from cellmap import CellGrid, discrete_map, find_attractors, find_basins
from cellmap.attractors.chaos import examine
from cellmap.attractors.transients import Reason, follow_on

# From below 1 orbits go to the fixed point at 0, from above to infinity; at 1 the multiplier is 1.5.
SLOW = discrete_map(lambda x, p: (x[0] + 0.5 * x[0] * (x[0] - 1.0),), {}, ("x",))
BESIDE = 1e-6  # ln(1e6) / ln(1.5) = 34 periods until the distance is about 1


def test_orbits_that_end_later_are_late_or_ending():
    sink = find_attractors(SLOW, [[0.5]])
    followed = follow_on(SLOW, np.array([[1 - BESIDE], [1 + BESIDE]]), np.zeros(2, bool), sink, age=20)
    assert followed.reasons.tolist() == [Reason.LATE, Reason.ENDING]
    assert len(followed.lasting) == 0


def test_they_are_followed_for_five_times_their_age():
    sink = find_attractors(SLOW, [[0.5]])
    followed = follow_on(SLOW, np.array([[1 - BESIDE], [1 + BESIDE]]), np.zeros(2, bool), sink, age=5)
    assert followed.lasting.tolist() == [0, 1], "25 periods are not enough"
    x = np.array([1 - BESIDE, 1 + BESIDE])
    for _ in range(25):
        x = x + 0.5 * x * (x - 1.0)
    np.testing.assert_allclose(followed.orbits.points[:, 0], x, rtol=1e-9)


def test_basins_name_what_escapes_later():
    """Ten cells within 0.001 of the repelling fixed point, from which orbits go to infinity after some 20 periods."""
    sink = find_attractors(SLOW, [[0.5]])
    basins = find_basins(SLOW, CellGrid((1.0,), (1.001,), (10,)), max_periods=10, attractors=sink)
    assert basins.undecided == {Reason.ENDING: 10}


def test_at_the_age_of_zero_nothing_is_followed():
    """Five times nothing, where no chaotic attractor is known."""
    points = np.array([[0.9], [0.3]])
    followed = follow_on(SLOW, points, np.zeros(2, bool), find_attractors(SLOW, [[0.5]]), age=0)
    assert followed.lasting.tolist() == [0, 1]
    assert np.array_equal(followed.orbits.points, points)


def test_an_unstable_fixed_point_keeps_its_reason_among_chaotic_orbits():
    """1 - 1/r of the logistic map at r = 3.9."""
    chaotic = logistic(3.9).iterate(np.linspace(0.2, 0.4, 10)[:, None], 200).points
    found = examine(logistic(3.9), np.vstack([chaotic, [[1 - 1 / 3.9]]]), age=100)
    assert len(found.attractors) == 1
    assert found.reasons == (Reason.PERIODIC,)
