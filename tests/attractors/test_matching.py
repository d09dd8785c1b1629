"""Attractors of neighbouring parameter values, matched by distance and rotation number."""

from math import pi

import numpy as np
import pytest

from cellmap import Attractor, angle
from cellmap.attractors.matching import attractor_distance, match_attractors
from cellmap.orbits import Kind


def fixed(*points, rotations=0, period=None):
    places = np.array(points, dtype=float)[:, None]
    kind = Kind.ROTATING if rotations else Kind.PERIODIC
    return Attractor(
        kind, period or len(places), places, (rotations,), np.zeros(1, complex), np.zeros(1), (angle("a"),)
    )


def test_distances_wrap():
    circle = np.array([2 * pi])
    assert attractor_distance(fixed(pi - 0.1), fixed(-pi + 0.1), circle) == pytest.approx(0.2 / (2 * pi))
    # A cycle that has just doubled is as near as its points have moved apart.
    assert attractor_distance(fixed(1.0), fixed(0.9, 1.1), circle) == pytest.approx(0.1 / (2 * pi))
    assert attractor_distance(fixed(1.0), fixed(1.0, 2.0), circle) == pytest.approx(0.5 / (2 * pi))


def test_matching_takes_the_least_sum():
    known = {5: fixed(0.0), 7: fixed(0.3)}
    assert match_attractors([fixed(0.25), fixed(0.55)], known, np.ones(1), 0.5) == {0: 5, 1: 7}
    assert match_attractors([fixed(0.25), fixed(2.0)], known, np.ones(1), 0.5) == {0: 7}
    assert match_attractors([fixed(2.0)], known, np.ones(1), 0.5) == {}
    assert match_attractors([], known, np.ones(1), 0.5) == match_attractors([fixed(0.0)], {}, np.ones(1), 0.5) == {}


def test_matching_prefers_the_same_rotation_number():
    known = {0: fixed(0.0, rotations=1), 1: fixed(0.3)}
    assert match_attractors([fixed(0.12), fixed(0.18, rotations=1)], known, np.ones(1), 0.5) == {0: 1, 1: 0}
    assert match_attractors([fixed(0.3, rotations=1)], {0: fixed(0.0)}, np.ones(1), 0.5) == {}
    assert match_attractors([fixed(0.2, rotations=1)], {0: fixed(0.0)}, np.ones(1), 0.5) == {0: 0}


def test_matching_may_refuse_unlike_attractors():
    near, other = fixed(0.0, rotations=1), fixed(0.0)
    assert match_attractors([near], {0: other}, np.ones(1), 0.5) == {0: 0}
    assert match_attractors([near], {0: other}, np.ones(1), 0.5, unlike=np.inf) == {}


def test_matching_knows_that_periods_double():
    assert match_attractors([fixed(0.3, period=4)], {0: fixed(0.0, period=2)}, np.ones(1), 0.5) == {0: 0}
    assert match_attractors([fixed(0.3, period=6)], {0: fixed(0.0, period=4)}, np.ones(1), 0.5) == {}
