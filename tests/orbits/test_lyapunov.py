"""Lyapunov exponents: exact values, their errors and convergence, per step and per time."""

from dataclasses import replace
from math import log, pi, sqrt

import matplotlib.pyplot as plt
import numpy as np
import pytest

import systems
from cellmap import (
    ForcedSystem,
    Status,
    discrete_map,
    lyapunov_spectrum,
    periodic_orbit,
    plot,
    set_threads,
    stroboscopic_map,
)
from cellmap.maps.tangent import tangent
from cellmap.orbits.lyapunov_qr import is_positive


def lorenz(t, x, p):
    u, v, w = x
    return p.sigma * (v - u), u * (p.rho - w) - v, u * v - p.beta * w


LORENZ = ForcedSystem(lorenz, {"sigma": 10.0, "rho": 28.0, "beta": 8.0 / 3.0}, 0.25, ("u", "v", "w"))

# --- exact values


@pytest.mark.parametrize("diagonal", [(0.5,), (1.5, 0.2), (0.9, -1.1), (1.2, 0.5, -0.3), (3.0, 1.0, 0.5, 0.01)])
def test_a_linear_map_has_the_logarithms_of_its_eigenvalues(linear, diagonal):
    matrix = np.diag(diagonal) + np.triu(np.full((len(diagonal),) * 2, 0.3), 1)
    found = lyapunov_spectrum(linear(matrix), np.zeros((2, 3, len(diagonal))), 300, 200)
    assert found.exponents.shape == (2, 3, len(diagonal))
    exact = np.sort(np.log(np.abs(diagonal)))[::-1]
    assert found.exponents == pytest.approx(np.broadcast_to(exact, found.exponents.shape), abs=1e-9)
    assert found.standard_errors == pytest.approx(0.0, abs=1e-9)


def test_the_cat_map(linear):
    """The logarithms of (3 +- sqrt 5)/2, along the eigenvectors of a symmetric matrix."""
    found = lyapunov_spectrum(linear([[2.0, 1.0], [1.0, 1.0]]), [0.0, 0.0], 100, 100)
    golden = log((3.0 + sqrt(5.0)) / 2.0)
    assert found.exponents == pytest.approx([golden, -golden], abs=1e-13)
    unstable = np.array([(1.0 + sqrt(5.0)) / 2.0, 1.0])
    unstable /= np.linalg.norm(unstable)
    assert abs(found.directions[:, 0] @ unstable) == pytest.approx(1.0, abs=1e-12)
    assert found.directions.T @ found.directions == pytest.approx(np.eye(2), abs=1e-12)


def test_henon():
    """0.419 and -1.623 (references; Sprott 2003 has 0.41922 and -1.62319); their sum is ln 0.3 exactly."""
    initial_conditions = np.random.default_rng(0).uniform(-0.1, 0.1, (64, 2))
    found = lyapunov_spectrum(systems.henon_map(), initial_conditions, 4000)
    mean, error = found.pooled
    assert (error < 1e-3).all()
    assert (np.abs(mean - [0.41922, -1.62319]) < 3.0 * error).all()
    assert found.lyapunov_time == pytest.approx(1.0 / found.exponents[:, 0])
    assert found.sums == pytest.approx(log(0.3), abs=1e-12)


def test_orbits_do_not_depend_on_their_company():
    """Alone or in a batch, in any number of threads, and by the loop over matrices to rounding."""
    henon, initial_conditions = systems.henon_map(), np.random.default_rng(3).uniform(-0.1, 0.1, (40, 2))
    many = lyapunov_spectrum(henon, initial_conditions, 30, 0)
    for k in (0, 17, 39):
        alone = lyapunov_spectrum(henon, initial_conditions[k], 30, 0)
        for name in ("exponents", "ends", "directions"):
            assert np.array_equal(getattr(alone, name), getattr(many, name)[k])
    stepwise = lyapunov_spectrum(replace(henon, stretch=None), initial_conditions, 30, 0)
    assert many.exponents == pytest.approx(stepwise.exponents, abs=1e-6)  # chaos stretches rounding by e^12
    assert np.abs(np.einsum("nij,nij->nj", many.directions, stepwise.directions)) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.thorough
def test_the_lorenz_system():
    """0.9056, 0, -14.572 (Sprott 2003); the sum is -(sigma + 1 + beta)."""
    initial_conditions = np.random.default_rng(2).uniform((-5.0, -5.0, 15.0), (5.0, 5.0, 25.0), (32, 3))
    found = lyapunov_spectrum(stroboscopic_map(LORENZ), initial_conditions, 400, 150)
    mean, error = (v / found.period for v in found.pooled)
    assert (np.abs(mean - [0.9056, 0.0, -14.572]) < 3.0 * error + 1e-3).all()
    assert error[0] < 0.02
    assert found.sums / found.period == pytest.approx(-(10.0 + 1.0 + 8.0 / 3.0), abs=1e-8)


# --- flows: per step and per time


def test_the_forced_duffing_oscillator_contracts_by_its_damping():
    strobe = stroboscopic_map(systems.two_well_duffing(damping=0.15, forcing=0.3))
    found = lyapunov_spectrum(strobe, [[0.1, 0.0], [1.0, 0.5], [-1.5, 0.2]], 200, 50)
    assert found.per_time.sum(axis=-1) == pytest.approx(-0.15, abs=1e-10)
    assert found.exponents == pytest.approx(2.0 * pi * found.per_time, rel=1e-14)
    assert found.per_time_errors == pytest.approx(found.standard_errors / (2.0 * pi), rel=1e-14)


def test_multipliers_are_exponentials_of_exponents():
    """abs(multipliers) of a periodic orbit = exp(period x T x exponents per time); fluctuations are of order 1/n."""
    strobe = stroboscopic_map(systems.dimensionless_pendulum(0.5, 0.1, 0.03))
    orbit = periodic_orbit(strobe, (0.67, 1.16), 2)
    found = lyapunov_spectrum(strobe, orbit.points[0], 4000, 100)
    sizes = np.sort(np.abs(orbit.multipliers))[::-1]
    assert np.exp(2 * strobe.period * found.per_time) == pytest.approx(sizes, rel=3e-3)


# --- records and rules


def test_exponents_converge_along_their_record():
    found = lyapunov_spectrum(systems.henon_map(), [0.1, 0.1], 1000)
    assert found.convergence.shape == (100, 2)
    assert found.steps.tolist() == list(range(10, 1001, 10))
    assert found.convergence[-1] == pytest.approx(found.exponents, rel=1e-12)
    assert found.growth.sum(axis=0) == pytest.approx(1000 * found.exponents, rel=1e-12)
    short = lyapunov_spectrum(systems.henon_map(), [0.1, 0.1], 500)
    assert found.convergence[49] == pytest.approx(short.exponents, rel=1e-12)


def test_a_direction_that_vanishes():
    found = lyapunov_spectrum(discrete_map(lambda x, p: (0.5 * x[0], 0.0 * x[1]), {}, ("x", "y")), [0.1, 0.2], 40)
    assert found.exponents.tolist() == [pytest.approx(log(0.5)), -np.inf]
    assert not found.ended


@pytest.mark.thorough
def test_stick_slip_motion_loses_a_direction():
    """States that stick at one place are one state from then on: the derivative is singular."""
    found = lyapunov_spectrum(stroboscopic_map(systems.stick_slip_oscillator()), [[0.3, 0.1], [-0.5, 0.2]], 40, 20)
    assert (found.exponents[:, 1] == -np.inf).all()
    assert np.isfinite(found.exponents[:, 0]).all()


def test_orbits_that_end_have_no_exponents():
    found = lyapunov_spectrum(systems.henon_map(), [[0.1, 0.1], [9.0, 9.0]], 100, 20)
    assert found.ended.tolist() == [False, True]
    assert found.status.tolist() == [Status.OK, Status.DIVERGED]
    assert np.isnan(found.exponents[1]).all()
    assert np.isnan(found.ends[1]).all()
    assert np.isfinite(found.exponents[0]).all()
    assert np.isfinite(found.pooled[0]).all()
    assert "1 terminated" in repr(found)
    late = lyapunov_spectrum(systems.henon_map(1.5), [[0.1, 0.1]], 5000, 0)  # beyond the boundary crisis
    assert late.ended.all()
    assert np.isnan(late.pooled[0]).all()
    assert np.isnan(late.lyapunov_time).all()


def test_angles_may_have_any_number_of_rotations():
    strobe = stroboscopic_map(systems.dimensionless_pendulum(0.25, 0.55, 0.05))
    found = lyapunov_spectrum(strobe, [[1.0, 0.5], [1.0 + 6.0 * pi, 0.5]], 20, 0)
    assert found.exponents[0] == pytest.approx(found.exponents[1], abs=1e-9)
    assert (np.abs(found.ends[:, 0]) <= pi).all()


def test_orbits_of_a_flow_in_one_compiled_loop():
    """The same bits for any number of threads and any company, and the growth of products of matrices of 1e-12."""
    strobe = stroboscopic_map(systems.ueda_oscillator())
    initial_conditions = np.random.default_rng(4).uniform(-1.0, 1.0, (150, 2))
    results = []
    for count in (1, 3):
        set_threads(count)
        results.append(lyapunov_spectrum(strobe, initial_conditions, 20, 2))
    assert np.array_equal(results[0].exponents, results[1].exponents)
    alone = lyapunov_spectrum(strobe, initial_conditions[70:71], 20, 2)
    assert np.array_equal(results[0].growth[:, 70:71], alone.growth)
    frame, point, growth = np.eye(2), initial_conditions[70], []
    for _ in range(6):
        image, matrix = tangent(strobe, point)
        frame, upper = np.linalg.qr(matrix @ frame)
        growth.append(np.log(np.abs(np.diag(upper))))
        point = image
    assert np.stack(growth)[2:] == pytest.approx(alone.growth[:4, 0], abs=1e-6)


@pytest.mark.parametrize("tolerance", [1e-5, 1e-9])
def test_sums_of_exponents_are_exact_at_any_tolerance(tolerance):
    """What tells orbits of conservative systems apart: the sum of exponents is -damping (Liouville) to 1e-8."""
    strobe = stroboscopic_map(systems.two_well_duffing(damping=0.0, forcing=0.3), rtol=tolerance, atol=tolerance)
    found = lyapunov_spectrum(strobe, [[0.0, 0.0], [0.05, 0.1], [1.0, 0.0]], 100, 0)
    assert found.sums == pytest.approx(0.0, abs=1e-8)
    assert found.exponents[0, 0] > 0.1


def test_an_orbit_on_a_pole_of_the_derivative_goes_on():
    """|a| as a root has no derivative at 0 by its formula: there it is that of differences."""

    def rhs(t, x, p):
        return -x[0] + sqrt(x[1] * x[1]), 0.0 * x[1]

    strobe = stroboscopic_map(ForcedSystem(rhs, {}, 1.0, ("q", "a")))
    found = lyapunov_spectrum(strobe, [[0.3, 1.0], [0.3, 0.0]], 20, 5)
    assert found.status.tolist() == [Status.OK, Status.OK]
    assert found.exponents == pytest.approx(np.array([[0.0, -1.0]] * 2), abs=1e-6)
    assert found.ends == pytest.approx(np.array([[1.0, 1.0], [0.0, 0.0]]), abs=1e-7)


def test_the_figure():
    found = lyapunov_spectrum(stroboscopic_map(systems.two_well_duffing()), [[0.5, 0.1], [1.0, 0.0]], 40)
    ax = plot.lyapunov_spectrum(found, per_time=True)
    curves = [line for line in ax.lines if len(line.get_xdata()) == len(found.steps)]
    assert len(curves) == 4
    assert ax.get_ylabel() == "exponents per unit of time"
    assert curves[0].get_ydata() == pytest.approx(found.convergence[:, 0, 0] / found.period)
    plt.close("all")


def test_evidence_of_chaos_is_above_five_errors_and_a_thousandth():
    assert is_positive(np.array([0.0099, 0.0101, 0.0009, 0.0011]), np.array([2e-3, 2e-3, 0.0, 0.0])).tolist() == [
        *(False, True, False, True)
    ]


@pytest.mark.thorough
def test_standard_errors_cover_as_often_as_they_say():
    """Hénon's map, 0.41922 (Sprott, Chaos and Time-Series Analysis, 2003), and Lorenz's equations, 0.9056 (ibid.)."""
    half = stroboscopic_map(replace(LORENZ, period=0.5), rtol=1e-8, atol=1e-8)
    cases = (systems.henon_map(), 0.41922, 0.1, (0.0, 0.0)), (half, 0.4528, 10.0, (0.0, 0.0, 25.0))
    for point_map, exponent, size, shift in cases:
        points = np.random.default_rng(1).uniform(-size, size, (100, point_map.dimension)) + shift
        interval = lyapunov_spectrum(point_map, points, 300, 100).interval(0.95)
        lower, upper = (np.asarray(bound)[..., 0] for bound in interval)
        assert np.mean((lower <= exponent) & (exponent <= upper)) >= 0.9
