"""Ellipsoids around attracting orbits: the equations that they solve, and the points that they hold."""

import numpy as np
import pytest

from cellmap import discrete_map
from cellmap.maps import swept_map
from cellmap.maps.coordinates import as_coordinates
from cellmap.orbits import ellipsoids
from cellmap.orbits.ellipsoids import ParameterRegions


@pytest.mark.parametrize(("period", "d"), [(1, 2), (3, 1), (4, 3)])
def test_forms_solve_the_periodic_lyapunov_equation(period, d):
    steps = np.random.default_rng(d).normal(size=(period, d, d)) * 0.4 / d
    forms = ellipsoids.lyapunov_forms(steps, 0.9)
    ahead = np.roll(forms, -1, axis=0)
    assert steps.transpose(0, 2, 1) @ ahead @ steps / 0.81 + np.eye(d) == pytest.approx(forms, rel=1e-9)


def test_metrics_contract_by_the_largest_multiplier():
    """The first has eigenvectors, the second one a double eigenvalue 1/2, for which 3/4 is taken."""
    metrics, factors = ellipsoids._metrics(np.array([[[0.9, 5.0], [0.0, -0.1]], [[0.5, 1.0], [0.0, 0.5]]]))
    assert factors == pytest.approx([0.9, 0.75])
    for matrix, metric, factor in zip(
        [[[0.9, 5.0], [0.0, -0.1]], [[0.5, 1.0], [0.0, 0.5]]], metrics, factors, strict=True
    ):
        shrunk = np.transpose(matrix) @ metric @ matrix
        assert np.linalg.eigvals(np.linalg.solve(metric, shrunk)).real.max() <= factor**2 * (1 + 1e-9)


def test_states_move_by_periods_of_their_own():
    half = discrete_map(lambda x, p: (0.5 * x[0], -x[1]), {}, ("x", "y"))
    shifts = np.array([[[0.1, 0.2]], [[0.4, -0.2]], [[0.0, 0.3]]])
    after, alive = ellipsoids.displaced(half, np.zeros((3, 2)), shifts, np.array([1, 2, 1]))
    assert alive.all()
    assert after[:, 0] == pytest.approx(np.array([[0.05, -0.2], [0.1, -0.2], [0.0, -0.3]]))


def test_directions_in_a_plane_are_equal_steps_around_a_circle():
    assert ellipsoids.directions(2, 4, 9) == pytest.approx(np.array([[1, 0], [0, 1], [-1, 0], [0, -1]]), abs=1e-15)
    assert np.linalg.norm(ellipsoids.directions(3, 4, 9), axis=1) == pytest.approx(np.ones(9))


def test_points_are_owned_by_the_first_ellipsoid_that_holds_them():
    """Two at the first parameter point, around 0 and 1; none at the second; one at the third, around 5."""
    rows = ParameterRegions.empty(1).with_more(
        ParameterRegions(
            np.array([2, 0, 0]),
            np.array([7, 3, 4]),
            np.array([[5.0], [0.0], [1.0]]),
            np.full((3, 1, 1), 4.0),
            np.empty(0, int),
        ),
        0,
        3,
    )
    points = np.array([[0.4], [1.4], [0.6], [5.2], [5.0], [9.0]])
    found = rows.owners(points, np.array([0, 0, 0, 2, 1, 0]), as_coordinates(["x"]))
    assert found.tolist() == [3, 4, 4, 7, -1, -1]


def test_regions_around_an_orbit_end_where_it_no_longer_attracts():
    """a x + x^3/2 with a = 0.5 contracts for abs(x) < 1, to the mean of 1 and a from 2^-0.5 on, at two parameters."""
    cubic = discrete_map(lambda x, p: (p.a * x[0] + 0.5 * x[0] ** 3,), {"a": 0.5}, ("x",))
    orbit = np.array([[[0.0, 0.5]], [[0.0, 0.1]]])
    found = ellipsoids.regions_around(
        swept_map(cubic, "a"), orbit, np.array([[[[0.5]]], [[[0.1]]]]), np.ones(2, int), np.arange(2), np.array([16.0])
    )
    assert found.owner.tolist() == [0, 1] and found.has_any(3).tolist() == [True, True, False]
    # Half-widths are 4 over powers of two: 0.5 < 2^-0.5 is the largest; with a = 0.1 it is 0.5 < 0.9^0.5 as well.
    assert ellipsoids.half_widths(found.metric)[:, 0] == pytest.approx([0.5, 0.5])
    assert found.renumbered(np.array([1]), 2).owner.tolist() == [-1, 0]


def test_products_of_steps_begin_at_each_point():
    steps = np.random.default_rng(0).normal(size=(3, 2, 2))
    found = ellipsoids.products(steps, 3)
    assert found[1] == pytest.approx(steps[0] @ steps[2] @ steps[1])
    around = ellipsoids.monodromy_of(steps[None], np.array([3]), np.zeros(3, int), np.arange(3))
    assert around == pytest.approx(found)
