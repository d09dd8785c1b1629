"""Curves of solutions traced both ways."""

import numpy as np
import pytest

from cellmap.orbits.arclength import Box, both_ways, continuation_steps, corrected, trace


def circle(unknowns):
    """x^2 + q^2 = 1."""
    return np.array([unknowns @ unknowns - 1.0]), 2.0 * unknowns[None]


@pytest.mark.parametrize(
    ("upper", "ends"), [(2.0, ("closed", "closed")), (0.5, ("left the interval", "left the interval"))]
)
def test_a_circle_is_traced_once_and_an_arc_of_it_from_end_to_end(upper, ends):
    """Whole, and for q below 1/2, where 2/3 of it are left."""
    start, box = corrected(circle, np.array([0.0, -1.0]), np.array([1.0, 0.0])), Box.of([[-2.0, upper]], 1.0)
    assert start is not None
    places, found = both_ways(lambda begin: trace(circle, begin, box, 0.1, 200), start)
    assert found == ends
    turns = np.unwrap([np.arctan2(*p.unknowns) for p in places]) / (2.0 * np.pi)
    assert (np.abs(np.diff(turns)) < 0.1 / np.pi).all()
    assert abs(turns[-1] - turns[0]) == pytest.approx(1.0 if upper > 1.0 else 2.0 / 3.0, abs=0.02)


def test_a_step_that_is_refused_is_repeated_shorter():
    start, box = corrected(circle, np.array([0.0, -1.0]), np.array([1.0, 0.0])), Box.of([[-2.0, 2.0]], 1.0)
    refuse = lambda step, may_refuse: "refused" if may_refuse and step.length > 0.02 else None  # noqa: E731
    places, end = trace(circle, start, box, 0.1, 1000, visit=refuse)
    assert end == "closed"
    steps = np.linalg.norm(np.diff([p.unknowns for p in places], axis=0), axis=1)
    assert steps.max() <= 0.02 and len(places) > 2 * np.pi / 0.02


def test_a_zero_on_a_step_is_located():
    """Where x is 0.2 on the circle, by interpolation, and where (x - 0.2)^3 is 0, which takes longer."""
    start = corrected(circle, np.array([0.0, -1.0]), np.array([1.0, 0.0]))
    step = next(continuation_steps(circle, start, 0.5, np.zeros(2, bool)))
    for power in (1, 3):
        place = step.located(lambda p, power=power: (p.unknowns[0] - 0.2) ** power)
        assert place.unknowns == pytest.approx([0.2, -(0.96**0.5)], abs=1e-5 if power == 3 else 1e-12)
    assert step.where(0, 0.2).unknowns == pytest.approx([0.2, -(0.96**0.5)], abs=1e-12)
    middle = step.at(0.5 * step.length)
    assert step.since(middle).length == pytest.approx(middle.tangent @ (step.end.unknowns - middle.unknowns))
    assert step.interpolated(0.25).unknowns == pytest.approx(0.75 * start.unknowns + 0.25 * step.end.unknowns)
