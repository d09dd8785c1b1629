"""One Newton method: solutions of any multiplicity, errors of images, parameters that are held."""

from types import SimpleNamespace

import numpy as np
import pytest

from cellmap import discrete_map, periodic_orbit
from cellmap.maps import swept_map
from cellmap.orbits.lyapunov_qr import swept_derivatives
from cellmap.orbits.multipliers import multipliers_of
from cellmap.orbits.newton import newton, solutions, stable_orbit
from cellmap.orbits.orbit_equations import OrbitProblem, natural_sizes
from systems import logistic_map


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("multiplicity", [1, 2, 3])
def test_steps_go_on_until_they_stop_falling(multiplicity, damped):
    """(x - 2)^m: a residual of rounding, 1e-16, belongs to a distance of 1e-16^(1/m)."""

    def power(rows, points):
        apart = points - 2.0
        return apart**multiplicity, (multiplicity * apart ** (multiplicity - 1))[..., None]

    points, _, settled = solutions(power, np.array([[2.1], [1.7]]), np.ones(1), damped=damped)
    assert settled.all()
    assert np.abs(points - 2.0).max() < 4.0 * 1e-14 ** (1.0 / multiplicity)


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("noise", [1e-14, 1e-12, 1e-10])
def test_errors_of_images_end_it_where_they_leave_the_solution(noise, damped):
    """The cosine of x is x at 0.7390851332151607 (Bertrand 1865)."""

    def disturbed(rows, points):
        error = noise * np.sin(1e15 * points)
        return np.cos(points) - points + error, (-np.sin(points) - 1.0)[..., None]

    points, _, settled = solutions(disturbed, np.linspace(0.5, 1.0, 40)[:, None], np.ones(1), damped=damped)
    assert settled.all()
    assert np.abs(points - 0.7390851332151607).max() <= noise


def test_parameters_that_differ_from_guess_to_guess_are_held():
    """Fixed points of the Henon map at 50 pairs of parameters at once, from the quadratic equation."""
    henon = discrete_map(lambda x, p: (1 - p.a * x[0] ** 2 + x[1], p.b * x[0]), {"a": 1.4, "b": 0.3}, ("x", "y"))
    a, b = np.random.default_rng(0).uniform((0.1, -0.5), (1.4, 0.5), (50, 2)).T
    x = (b - 1 + np.sqrt((1 - b) ** 2 + 4 * a)) / (2 * a)
    guesses = np.stack([x + 0.05, b * x - 0.02, a, b], axis=-1)
    points, settled = newton(swept_map(henon, "a", "b"), guesses, np.ones(50, np.int64), np.ones(2))
    assert settled.all()
    assert np.array_equal(points[:, 2:], guesses[:, 2:])
    np.testing.assert_allclose(points[:, :2], np.stack([x, b * x], axis=-1), rtol=1e-13)


@pytest.mark.parametrize("damped", [False, True])
def test_what_stops_falling_far_from_a_solution_is_none(damped):
    """T_3 = 4 x^3 - 3 x has periodic points cos(2 pi k / (3^n -+ 1)), which are less than 1e-7 apart next to 1."""
    cubic = discrete_map(lambda x, p: (4 * x[0] ** 3 - 3 * x[0],), {}, ("x",))
    guesses = np.concatenate([1.0 - np.geomspace(1e-9, 1e-2, 3000), np.linspace(-1.0, 1.0, 3000)])[:, None]
    points, settled = newton(cubic, guesses, np.full(len(guesses), 8), np.ones(1), 1.0, damped=damped)
    angles = np.arccos(np.clip(points[settled, 0], -1.0, 1.0)) / (2.0 * np.pi)
    apart = [np.abs(angles * m - np.round(angles * m)) / m for m in (3**8 - 1, 3**8 + 1)]
    assert settled.sum() > 3000
    # The slope of T_3^8 is at least 3^8, so that it is known to rounding where cosines are.
    assert np.minimum(*apart).max() < 1e-9


def test_orbits_begin_at_the_largest_of_the_points_that_are_nearest_to_the_origin():
    """x -> x^3 - 2.2 x: the points +-sqrt(1.2) of the orbit of period two are equally near."""
    odd = discrete_map(lambda x, p: (x[0] ** 3 - 2.2 * x[0],), {}, ("x",))
    for guess in (1.1, -1.1):
        assert periodic_orbit(odd, [guess], 2).points[:, 0] == pytest.approx([1.2**0.5, -(1.2**0.5)])


def test_multipliers_of_two_by_two_matrices_are_their_eigenvalues():
    matrices = np.random.default_rng(0).normal(size=(200, 2, 2))
    found = multipliers_of(matrices, np.linalg.det(matrices))
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(np.linalg.eigvals(matrices)), abs=1e-10)
    # The small one of 1e8 and 1e-8 is that of the determinant.
    assert multipliers_of(np.array([[1e8, 1.0], [1.0, 2e-8]]), np.array(1.0)) == pytest.approx([1e8, 1e-8], rel=1e-12)


def test_a_determinant_changes_its_sign_where_a_multiplier_passes_minus_one():
    for entry in (-0.9, -1.1):
        problem = SimpleNamespace(dimension=2, matrix=lambda _, entry=entry: np.diag([entry, 0.5]))
        assert OrbitProblem.doublings(problem, None) == pytest.approx((entry + 1.0) * 1.5)


def test_natural_sizes_and_orbits_that_attract():
    """Of mu x (1 - x): at 3.2 the fixed point has the multiplier -1.2, and the orbit of period two 0.16."""
    logistic = logistic_map(3.2)
    assert stable_orbit(logistic, np.array([1.0 - 1.0 / 3.2]), 1, np.ones(1)) is None
    found = stable_orbit(logistic, np.array([0.5130445]), 2, np.ones(1))
    assert found is not None and found.period == 2 and found.multipliers == pytest.approx([0.16], abs=1e-5)
    assert natural_sizes(logistic, np.array([1.0 - 1.0 / 3.2]), 1) == pytest.approx([1.0 - 1.0 / 3.2])


def test_derivatives_of_steps_at_parameters_of_their_own():
    """mu (1 - 2 x), by one map with the parameter among its coordinates, and without one."""
    points, values = np.array([[0.1], [0.2], [0.3]]), np.array([3.0, 2.0, 3.0])
    logistic = logistic_map(3.0)
    for swept in (swept_map(logistic, "mu"), SimpleNamespace(tangent=None)):
        found = swept_derivatives(logistic, swept, "mu", points, values)
        assert found.ravel() == pytest.approx(values * (1.0 - 2.0 * points[:, 0]), abs=1e-9)
