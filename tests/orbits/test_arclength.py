"""Curves of solutions traced both ways."""

import numpy as np
import pytest

from cellmap.orbits.arclength import Box, both_ways, corrected, trace


@pytest.mark.parametrize(
    ("upper", "ends"), [(2.0, ("closed", "closed")), (0.5, ("left the interval", "left the interval"))]
)
def test_a_circle_is_traced_once_and_an_arc_of_it_from_end_to_end(upper, ends):
    """x^2 + q^2 = 1, whole and for q below 1/2, where 2/3 of it are left."""

    def circle(unknowns):
        return np.array([unknowns @ unknowns - 1.0]), 2.0 * unknowns[None]

    start, box = corrected(circle, np.array([0.0, -1.0]), np.array([1.0, 0.0])), Box.of([[-2.0, upper]], 1.0)
    assert start is not None
    places, found = both_ways(lambda begin: trace(circle, begin, box, 0.1, 200), start)
    assert found == ends
    turns = np.unwrap([np.arctan2(*p.unknowns) for p in places]) / (2.0 * np.pi)
    assert (np.abs(np.diff(turns)) < 0.1 / np.pi).all()
    assert abs(turns[-1] - turns[0]) == pytest.approx(1.0 if upper > 1.0 else 2.0 / 3.0, abs=0.02)
