"""Attractors followed to other parameters, against searches that begin from nothing."""

from math import pi, tanh

import numpy as np
import pytest
from small_maps import distance, points_inside

import systems
from cellmap import CellGrid, PointMap, discrete_map, find_attractors, find_basins, stroboscopic_map
from cellmap.attractors import continue_attractors
from cellmap.attractors.continued import orbits_followed
from cellmap.attractors.regions.trapping import still_trapping
from cellmap.orbits import Kind

WIDE = CellGrid((-pi, -300.0), (pi, 300.0), (20, 20)).centres()
PLANE = CellGrid((-0.5, -0.2), (0.5, 0.2), (10, 10)).centres()
UNIT = np.linspace(0.05, 0.95, 20)[:, None]


def pendulum(amplitude: float) -> PointMap:
    return stroboscopic_map(systems.driven_pendulum(amplitude=amplitude))


def tilted(x, p):
    """Steps downhill in x^4/4 - x^2/2 - t x: two wells where abs(t) < 2/sqrt(27)."""
    return (x[0] + 0.2 * (x[0] - x[0] ** 3 + p.t),)


TILTED = discrete_map(tilted, {"t": 0.0}, ("x",))
LINE = np.linspace(-2.0, 2.0, 21)[:, None]


@pytest.mark.parametrize(
    ("make", "initial_conditions", "before", "after"),
    [(pendulum, WIDE, 0.003, 0.00305), (systems.henon_map, PLANE, 0.5, 0.51), (systems.logistic_map, UNIT, 3.4, 3.42)],
    ids=["pendulum", "Henon", "logistic"],
)
def test_attractors_are_those_of_a_search(make, initial_conditions, before, after) -> None:
    followed = continue_attractors(make(after), find_attractors(make(before), initial_conditions))
    searched = find_attractors(make(after), initial_conditions)
    assert [(a.kind, a.period, a.rotations) for a in followed] == [(a.kind, a.period, a.rotations) for a in searched]
    for one, other in zip(followed, searched, strict=True):
        assert np.abs(one.points - other.points).max() <= 1e-10 * np.abs(initial_conditions).max()
        sizes = [np.linalg.det(a.neighbourhood.metrics[0]) ** (-0.5 / len(a.coordinates)) for a in (one, other)]
        assert sizes[0] > 0.7 * sizes[1]
        inside = points_inside(one, 200)
        moved = distance(one, make(after).iterate(inside, one.period).points)
        assert (moved <= one.neighbourhood.contraction * distance(one, inside) + 1e-9).all()


def test_regions_are_moved_with_their_attractors_without_a_search_for_others() -> None:
    grid, extent = CellGrid((-pi, -500.0), (pi, 500.0), (6, 6)), np.array([2 * pi, 1000.0])
    followed = orbits_followed(pendulum(0.0031), find_attractors(pendulum(0.003), grid.centres()), extent)
    assert len(followed) == 4
    for orbit in followed.values():
        assert still_trapping(pendulum(0.0031), orbit, extent, orbit.neighbourhood) is not None


def test_labels_are_those_of_attractors_that_were_searched() -> None:
    grid = CellGrid((-pi, -300.0), (pi, 300.0), (30, 30))
    known = continue_attractors(pendulum(0.00305), find_basins(pendulum(0.003), grid).attractors)
    followed, searched = find_basins(pendulum(0.00305), grid, attractors=known), find_basins(pendulum(0.00305), grid)
    assert np.array_equal(followed.labels, searched.labels)


def test_what_vanishes_or_loses_its_stability_is_left_out() -> None:
    """A well vanishes at t = 2/sqrt(27) = 0.3849; a cycle of period 2 doubles at r = 1 + sqrt(6) = 3.449."""
    both = find_attractors(TILTED.with_params(t=0.38), LINE)
    assert len(both) == 2
    assert len(continue_attractors(TILTED.with_params(t=0.384), both)) == 2
    (well,) = continue_attractors(TILTED.with_params(t=0.39), both)
    assert well.points[0, 0] > 1.0
    (cycle,) = find_attractors(systems.logistic_map(3.44), UNIT)
    assert cycle.period == 2
    assert continue_attractors(systems.logistic_map(3.46), [cycle]) == ()


def test_two_that_become_one_are_listed_once() -> None:
    """tanh(a x) has two fixed points beside 0 for a > 1, and for a < 1 that at 0 alone."""
    wells = discrete_map(lambda x, p: (tanh(p.a * x[0]),), {"a": 1.02}, ("x",))
    two = find_attractors(wells, LINE)
    assert len(two) == 2
    assert len(continue_attractors(wells.with_params(a=0.9), two, extent=np.array([4.0]))) == 1


def test_attractors_that_are_not_periodic_are_left_to_a_search() -> None:
    (chaotic,) = find_attractors(systems.henon_map(), PLANE)
    assert chaotic.kind is Kind.CHAOTIC
    assert continue_attractors(systems.henon_map(1.39), [chaotic]) == ()
    with pytest.raises(ValueError, match="attractors holds an attractor in"):
        continue_attractors(systems.logistic_map(3.4), [chaotic])
