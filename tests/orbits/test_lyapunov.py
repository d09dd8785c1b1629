"""Lyapunov exponents: exact values, their errors and convergence, per step and per time."""

from __future__ import annotations

import time
from dataclasses import replace
from math import exp, log, pi, sin, sqrt
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

import systems
from cellmap import (
    CellGrid,
    ForcedSystem,
    PointMap,
    Status,
    discrete_map,
    interpolated_map,
    lyapunov_spectrum,
    periodic_orbit,
    plot,
    set_threads,
    stroboscopic_map,
)
from cellmap.maps.tangent import tangent
from cellmap.orbits import LyapunovSpectrum

mpl.use("Agg")
import matplotlib.pyplot as plt


def linear(matrix: Any) -> PointMap:
    rows = tuple(map(tuple, matrix))

    def product(x: Any, p: Any) -> tuple[float, ...]:
        return tuple(sum(a * b for a, b in zip(row, x, strict=True)) for row in rows)

    return discrete_map(product, {}, tuple("abcd"[: len(rows)]))


def lorenz(t: float, x: Any, p: Any) -> tuple[float, float, float]:
    u, v, w = x
    return p.sigma * (v - u), u * (p.rho - w) - v, u * v - p.beta * w


# --- exact values


@pytest.mark.parametrize("diagonal", [(0.5,), (1.5, 0.2), (0.9, -1.1), (1.2, 0.5, -0.3), (3.0, 1.0, 0.5, 0.01)])
def test_a_linear_map_has_the_logarithms_of_its_eigenvalues(diagonal: tuple[float, ...]) -> None:
    matrix = np.diag(diagonal) + np.triu(np.full((len(diagonal),) * 2, 0.3), 1)
    found = lyapunov_spectrum(linear(matrix), np.zeros((2, 3, len(diagonal))), 300, 200)
    assert found.exponents.shape == (2, 3, len(diagonal))
    exact = np.sort(np.log(np.abs(diagonal)))[::-1]
    assert found.exponents == pytest.approx(np.broadcast_to(exact, found.exponents.shape), abs=1e-9)
    assert found.standard_errors == pytest.approx(0.0, abs=1e-9)


def test_the_cat_map() -> None:
    """The logarithms of (3 +- sqrt 5)/2, along the eigenvectors of a symmetric matrix."""
    found = lyapunov_spectrum(linear([[2.0, 1.0], [1.0, 1.0]]), [0.0, 0.0], 100, 100)
    golden = log((3.0 + sqrt(5.0)) / 2.0)
    assert found.exponents == pytest.approx([golden, -golden], abs=1e-13)
    unstable = np.array([(1.0 + sqrt(5.0)) / 2.0, 1.0])
    unstable /= np.linalg.norm(unstable)
    assert abs(found.directions[:, 0] @ unstable) == pytest.approx(1.0, abs=1e-12)
    assert found.directions.T @ found.directions == pytest.approx(np.eye(2), abs=1e-12)


def test_the_logistic_map() -> None:
    """ln 2 at mu = 4, for almost every initial condition."""
    initial_conditions = np.random.default_rng(0).uniform(0.0, 1.0, (100, 1))
    found = lyapunov_spectrum(systems.logistic_map(), initial_conditions, 2000)
    (mean,), (error,) = found.pooled
    assert error < 5e-4
    assert mean == pytest.approx(log(2.0), abs=3.0 * error)
    low, high = found.interval(0.95)
    assert ((low < log(2.0)) & (log(2.0) < high)).mean() > 0.9


def test_henon() -> None:
    """0.419 and -1.623 (references; Sprott 2003 has 0.41922 and -1.62319); their sum is ln 0.3 exactly."""
    initial_conditions = np.random.default_rng(0).uniform(-0.1, 0.1, (64, 2))
    found = lyapunov_spectrum(systems.henon_map(), initial_conditions, 4000)
    mean, error = found.pooled
    assert (error < 1e-3).all()
    assert (np.abs(mean - [0.41922, -1.62319]) < 3.0 * error).all()
    assert found.sums == pytest.approx(log(0.3), abs=1e-12)


def test_a_single_orbit_in_one_compiled_loop() -> None:
    """A million periods of one orbit in seconds of a loaded machine; 10^7 a second on a quiet one."""
    henon = systems.henon_map()
    lyapunov_spectrum(henon, [0.1, 0.1], 20)
    began = time.process_time()
    found = lyapunov_spectrum(henon, [0.1, 0.1], 1_000_000)
    assert time.process_time() - began < 1.0
    assert (np.abs(found.exponents - [0.41922, -1.62319]) < 3.0 * found.standard_errors).all()
    assert found.sums == pytest.approx(log(0.3), abs=1e-12)


def test_orbits_do_not_depend_on_their_company() -> None:
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


def test_standard_errors_are_those_of_repetition() -> None:
    """The spread of the exponents of 200 independent orbits, within a quarter."""
    initial_conditions = np.random.default_rng(1).uniform(-0.1, 0.1, (200, 2))
    found = lyapunov_spectrum(systems.henon_map(), initial_conditions, 2000)
    spread = found.exponents.std(axis=0, ddof=1)
    assert np.sqrt((found.standard_errors**2).mean(axis=0)) == pytest.approx(spread, rel=0.25)


def test_the_lorenz_system() -> None:
    """0.9056, 0, -14.572 (Sprott 2003); the sum is -(sigma + 1 + beta)."""
    system = ForcedSystem(lorenz, {"sigma": 10.0, "rho": 28.0, "beta": 8.0 / 3.0}, 0.25, ("u", "v", "w"))
    initial_conditions = np.random.default_rng(2).uniform((-5.0, -5.0, 15.0), (5.0, 5.0, 25.0), (32, 3))
    found = lyapunov_spectrum(stroboscopic_map(system), initial_conditions, 400, 150)
    mean, error = (v / found.period for v in found.pooled)
    assert (np.abs(mean - [0.9056, 0.0, -14.572]) < 3.0 * error + 1e-3).all()
    assert error[0] < 0.02
    assert found.sums / found.period == pytest.approx(-(10.0 + 1.0 + 8.0 / 3.0), abs=1e-8)


# --- flows: per step and per time


def test_the_forced_duffing_oscillator_contracts_by_its_damping() -> None:
    strobe = stroboscopic_map(systems.two_well_duffing(damping=0.15, forcing=0.3))
    found = lyapunov_spectrum(strobe, [[0.1, 0.0], [1.0, 0.5], [-1.5, 0.2]], 200, 50)
    assert found.per_time.sum(axis=-1) == pytest.approx(-0.15, abs=1e-10)
    assert found.exponents == pytest.approx(2.0 * pi * found.per_time, rel=1e-14)
    assert found.per_time_errors == pytest.approx(found.standard_errors / (2.0 * pi), rel=1e-14)


def test_without_damping_exponents_come_in_pairs() -> None:
    strobe = stroboscopic_map(systems.two_well_duffing(damping=0.0, forcing=0.3))
    found = lyapunov_spectrum(strobe, [[0.0, 0.0], [0.05, 0.1], [1.0, 0.0]], 300, 20)
    assert found.sums == pytest.approx(0.0, abs=1e-9)
    assert found.exponents[:, 0] == pytest.approx(-found.exponents[:, 1], abs=1e-9)
    assert found.exponents[0, 0] > 0.1


@pytest.mark.slow
def test_a_hamiltonian_flow_of_two_degrees_has_two_pairs(problems: Any) -> None:
    """Undamped double pendulum: symplectic up to a change of coordinates, so exponents are opposite in the mean."""
    found = lyapunov_spectrum(stroboscopic_map(problems["double pendulum"]), [2.0, 1.0, 0.0, 0.0], 400, 0)
    values, error = found.exponents, found.standard_errors.max()
    assert values + values[::-1] == pytest.approx(0.0, abs=max(4.0 * error, 0.02))
    assert values.sum() == pytest.approx(0.0, abs=0.02)


def test_the_driven_pendulum_of_hard_case_7() -> None:
    """alpha = 0.25, gamma = 0.05, beta = 0.55: chaotic, and the sum is -0.05 x 2 pi in each period."""
    strobe = stroboscopic_map(systems.dimensionless_pendulum(0.25, 0.55, 0.05))
    initial_conditions = np.random.default_rng(3).uniform(-1.0, 1.0, (32, 2))
    found = lyapunov_spectrum(strobe, initial_conditions, 400, 200)
    assert found.sums == pytest.approx(-0.05 * 2.0 * pi, abs=1e-9)
    mean, error = found.pooled
    assert mean[0] > 10.0 * error[0]
    assert found.lyapunov_time == pytest.approx(2.0 * pi / found.exponents[:, 0])


@pytest.mark.parametrize(
    ("system", "guess", "period"),
    [
        (systems.two_well_duffing(), (-0.78, 0.03), 1),
        (systems.dimensionless_pendulum(0.5, 0.1, 0.03), (0.67, 1.16), 2),
        (systems.dimensionless_pendulum(-0.1, 0.545, 0.2), (2.18, 1.19), 1),
    ],
)
def test_multipliers_are_exponentials_of_exponents(system: ForcedSystem, guess: Any, period: int) -> None:
    """abs(multipliers) of a periodic orbit = exp(period x T x exponents per time); fluctuations are of order 1/n."""
    strobe = stroboscopic_map(system)
    orbit = periodic_orbit(strobe, guess, period)
    found = lyapunov_spectrum(strobe, orbit.points[0], 4000, 100)
    sizes = np.sort(np.abs(orbit.multipliers))[::-1]
    assert np.exp(period * strobe.period * found.per_time) == pytest.approx(sizes, rel=3e-3)


# --- records and rules


def test_exponents_converge_along_their_record() -> None:
    found = lyapunov_spectrum(systems.henon_map(), [0.1, 0.1], 1000)
    assert found.convergence.shape == (100, 2)
    assert found.steps.tolist() == list(range(10, 1001, 10))
    assert found.convergence[-1] == pytest.approx(found.exponents, rel=1e-12)
    assert found.growth.sum(axis=0) == pytest.approx(1000 * found.exponents, rel=1e-12)
    short = lyapunov_spectrum(systems.henon_map(), [0.1, 0.1], 500)
    assert found.convergence[49] == pytest.approx(short.exponents, rel=1e-12)


def test_a_direction_that_vanishes() -> None:
    found = lyapunov_spectrum(discrete_map(lambda x, p: (0.5 * x[0], 0.0 * x[1]), {}, ("x", "y")), [0.1, 0.2], 40)
    assert found.exponents.tolist() == [pytest.approx(log(0.5)), -np.inf]
    assert not found.ended


@pytest.mark.slow
def test_stick_slip_motion_loses_a_direction() -> None:
    """States that stick at one place are one state from then on: the derivative is singular."""
    found = lyapunov_spectrum(stroboscopic_map(systems.stick_slip_oscillator()), [[0.3, 0.1], [-0.5, 0.2]], 40, 20)
    assert (found.exponents[:, 1] == -np.inf).all()
    assert np.isfinite(found.exponents[:, 0]).all()


def test_orbits_that_end_have_no_exponents() -> None:
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


def test_of_an_interpolated_map_the_exact_map_is_examined() -> None:
    exact = systems.henon_map()
    table = interpolated_map(exact, CellGrid((-2.0, -2.0), (2.0, 2.0), (16, 16)))
    assert np.array_equal(
        lyapunov_spectrum(table, [0.1, 0.1], 50).exponents, lyapunov_spectrum(exact, [0.1, 0.1], 50).exponents
    )


def test_angles_may_have_any_number_of_rotations() -> None:
    strobe = stroboscopic_map(systems.dimensionless_pendulum(0.25, 0.55, 0.05))
    found = lyapunov_spectrum(strobe, [[1.0, 0.5], [1.0 + 6.0 * pi, 0.5]], 20, 0)
    assert found.exponents[0] == pytest.approx(found.exponents[1], abs=1e-9)
    assert (np.abs(found.ends[:, 0]) <= pi).all()


def test_the_same_bits_for_any_number_of_threads() -> None:
    initial_conditions = np.random.default_rng(4).uniform(-0.1, 0.1, (2100, 2))
    results = []
    for count in (1, 2):
        set_threads(count)
        results.append(lyapunov_spectrum(systems.henon_map(), initial_conditions, 30, 30))
    assert np.array_equal(results[0].exponents, results[1].exponents)
    assert np.array_equal(results[0].standard_errors, results[1].standard_errors)


def test_orbits_of_a_flow_in_one_compiled_loop() -> None:
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
def test_sums_of_exponents_are_exact_at_any_tolerance(tolerance: float) -> None:
    """What tells orbits of conservative systems apart: the sum of exponents is -damping (Liouville) to 1e-8."""
    strobe = stroboscopic_map(systems.two_well_duffing(damping=0.0, forcing=0.3), rtol=tolerance, atol=tolerance)
    found = lyapunov_spectrum(strobe, [[0.0, 0.0], [0.05, 0.1], [1.0, 0.0]], 100, 0)
    assert found.sums == pytest.approx(0.0, abs=1e-8)


def test_an_orbit_on_a_pole_of_the_derivative_goes_on() -> None:
    """|a| as a root has no derivative at 0 by its formula: there it is that of differences."""

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return -x[0] + sqrt(x[1] * x[1]), 0.0 * x[1]

    strobe = stroboscopic_map(ForcedSystem(rhs, {}, 1.0, ("q", "a")))
    found = lyapunov_spectrum(strobe, [[0.3, 1.0], [0.3, 0.0]], 20, 5)
    assert found.status.tolist() == [Status.OK, Status.OK]
    assert found.exponents == pytest.approx(np.array([[0.0, -1.0]] * 2), abs=1e-6)
    assert found.ends == pytest.approx(np.array([[1.0, 1.0], [0.0, 0.0]]), abs=1e-7)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"point_map": 3}, TypeError, "give a PointMap"),
        ({"initial_conditions": np.empty((0, 2))}, ValueError, "initial_conditions is empty"),
        ({"initial_conditions": [[0.0, np.nan]]}, ValueError, "remove points that are not finite"),
        ({"initial_conditions": [0.0]}, ValueError, "must hold the 2 state variables"),
        ({"periods": 19}, ValueError, "periods=19: give a whole number of at least 20"),
        ({"transient": -1}, ValueError, "transient=-1"),
    ],
)
def test_bad_input_is_refused(change: dict[str, Any], error: type[Exception], message: str) -> None:
    arguments = {
        "point_map": systems.henon_map(),
        "initial_conditions": [[0.1, 0.1]],
        "periods": 20,
        "transient": 0,
    } | change
    with pytest.raises(error, match=message):
        lyapunov_spectrum(**arguments)


def test_an_interval_needs_a_confidence() -> None:
    found = lyapunov_spectrum(systems.henon_map(), [0.1, 0.1], 20)
    for wrong in (0.0, 1.0, 2.0):
        with pytest.raises(ValueError, match="confidence"):
            found.interval(wrong)


def test_the_figure() -> None:
    found = lyapunov_spectrum(stroboscopic_map(systems.two_well_duffing()), [[0.5, 0.1], [1.0, 0.0]], 40)
    assert isinstance(found, LyapunovSpectrum)
    ax = plot.lyapunov_spectrum(found, per_time=True)
    curves = [line for line in ax.lines if len(line.get_xdata()) == len(found.steps)]
    assert len(curves) == 4
    assert ax.get_ylabel() == "exponents per unit of time"
    assert curves[0].get_ydata() == pytest.approx(found.convergence[:, 0, 0] / found.period)
    with pytest.raises(TypeError, match="give a LyapunovSpectrum"):
        plot.lyapunov_spectrum(found.exponents)  # type: ignore[arg-type]
    plt.close("all")


def test_a_map_without_derivatives_is_differenced() -> None:
    """A branch that is never taken keeps the function from being traced."""
    plain = discrete_map(lambda x, p: (1.2 * sin(x[0]) + 0.3 * x[1], 0.4 * x[0]), {}, ("x", "y"))
    odd = discrete_map(
        lambda x, p: (1.2 * sin(x[0]) + 0.3 * x[1], 0.4 * x[0] if x[0] < 1e9 else exp(0.0)), {}, ("x", "y")
    )
    one, other = (lyapunov_spectrum(m, [0.2, 0.1], 60).exponents for m in (plain, odd))
    assert other == pytest.approx(one, abs=1e-6)


def test_standard_errors_cover_as_often_as_they_say() -> None:
    """Hénon's map, 0.41922 (Sprott, Chaos and Time-Series Analysis, 2003), and Lorenz's equations, 0.9056 (ibid.)."""
    henon = discrete_map(lambda x, p: (1.0 - 1.4 * x[0] ** 2 + x[1], 0.3 * x[0]), {}, ("x", "y"))

    def lorenz(t: float, x: Any, p: Any) -> tuple[float, ...]:
        return 10.0 * (x[1] - x[0]), x[0] * (28.0 - x[2]) - x[1], x[0] * x[1] - 8.0 / 3.0 * x[2]

    half = stroboscopic_map(ForcedSystem(lorenz, {}, 0.5, ("x", "y", "z")), rtol=1e-8, atol=1e-8)
    for point_map, exponent, size, shift in ((henon, 0.41922, 0.1, (0.0, 0.0)), (half, 0.4528, 10.0, (0.0, 0.0, 25.0))):
        points = np.random.default_rng(1).uniform(-size, size, (100, point_map.dimension)) + shift
        interval = lyapunov_spectrum(point_map, points, 300, 100).interval(0.95)
        lower, upper = (np.asarray(bound)[..., 0] for bound in interval)
        assert np.mean((lower <= exponent) & (exponent <= upper)) >= 0.9
