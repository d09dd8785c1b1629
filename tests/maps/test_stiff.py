"""Stiff systems: the method that "auto" chooses meets the tolerance, without any argument being touched."""

from math import cos, exp, pi, sin
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from two_tiers import at_once

from cellmap import ForcedSystem, Status, stroboscopic_map
from cellmap._compiled.codegen import rosenbrock
from cellmap.maps import ToleranceWarning, jacobian
from cellmap.maps.orbit_batch import Orbits
from cellmap.maps.stroboscopic import method_of
from tests.reference.stiff import CASES, Case


def system_of(case: Case) -> ForcedSystem:
    names = [f"x{j}" for j in range(len(case.initial_condition))]
    return ForcedSystem(case.rhs, case.params, case.period, names)


@pytest.mark.parametrize("tolerance", at_once([1e-9], later=[1e-6]))
@pytest.mark.parametrize("name", at_once(["van der Pol, mu = 100", "Robertson"], later=CASES))
def test_stiff_systems_meet_their_tolerance(name: str, tolerance: float) -> None:
    case = CASES[name]
    strobe = stroboscopic_map(system_of(case), rtol=tolerance, atol=tolerance * 1e-3)
    orbit = strobe.iterate(case.initial_condition, 1)
    assert orbit.status == Status.OK
    assert orbit.points == pytest.approx(case.image, rel=2.0 * tolerance, abs=2e-3 * tolerance)


def test_the_method_follows_from_the_work() -> None:
    stiff, usual = (method_of(stroboscopic_map(system_of(CASES[f"van der Pol, mu = {mu}"]))) for mu in (1000, 1))
    assert stiff == "Rosenbrock" != usual


@pytest.mark.parametrize("tolerance", at_once([1e-6], later=[1e-5, 1e-7]))
def test_thin_layers_are_seen(tolerance: float) -> None:
    """Few steps of the period pass over the layer, a thousandth wide, in which friction turns round."""
    strobe = stroboscopic_map(system_of(CASES["tanh(1000 v)"]), rtol=tolerance, atol=tolerance)
    assert method_of(strobe) == "Rosenbrock"
    assert (strobe.iterate(np.random.default_rng(0).uniform(-2.0, 2.0, (64, 2)), 1).status == Status.OK).all()


def roll(t: float, x: Any, p: Any) -> tuple[float, float]:
    return x[1], -0.1 * x[1] - 0.05 * x[1] ** 3 - x[0] + x[0] ** 3 + 0.06 * sin(0.85 * t)


def test_orbits_that_are_not_stiff_do_not_pay_for_those_that_are() -> None:
    """Ships that capsize grow by e^20 in a period, damped by their cubed velocity; those that roll are not stiff."""
    system = ForcedSystem(roll, {}, 2.0 * pi / 0.85, ("y", "v"))
    mixed, explicit = stroboscopic_map(system), stroboscopic_map(system, method="Taylor")
    rolling = np.random.default_rng(0).uniform(-0.3, 0.3, (40, 2))
    capsizing = np.array([[1.15, 0.2], [1.15, 0.9], [-1.1, -0.6], [0.9, 0.8]])
    assert method_of(mixed) == "mixed"
    apart, alike = Orbits.starting(rolling.copy()), Orbits.starting(rolling.copy())
    mixed.specified.motion(apart)
    explicit.specified.motion(alike)
    assert apart.work.evaluations == alike.work.evaluations
    np.testing.assert_array_equal(apart.points, alike.points)
    with pytest.warns(ToleranceWarning, match="4 of 4 orbits of roll are out of steps"):
        explicit.iterate(capsizing, 1)
    found = mixed.iterate(np.concatenate([rolling, capsizing]), 1)
    assert (found.status == Status.OK).all()
    np.testing.assert_array_equal(found.points[40:], [mixed(x) for x in capsizing])
    matrices = jacobian(mixed, np.concatenate([rolling[:2], capsizing[:2]]))
    for x, image, matrix in zip([*rolling[:2], *capsizing[:2]], found.points[[0, 1, 40, 41]], matrices, strict=True):
        exact = with_derivatives(x, system.length)
        np.testing.assert_allclose(image, exact[:2], rtol=3e-9, atol=1e-9)
        np.testing.assert_allclose(matrix.ravel(), exact[2:], rtol=1e-7, atol=1e-8)


def with_derivatives(x: Any, time: float) -> Any:
    """Return where a ship is after a time, with the derivatives, by SciPy's Radau method."""

    def rates(t: float, z: Any) -> list[float]:
        slope, damping = 3.0 * z[0] ** 2 - 1.0, -0.1 - 0.15 * z[1] ** 2
        return [*roll(t, z[:2], None), *z[4:], *(slope * z[2:4] + damping * z[4:])]

    found = solve_ivp(rates, (0.0, time), [*x, 1.0, 0.0, 0.0, 1.0], "Radau", rtol=1e-10, atol=1e-10)
    return found.y[:, -1]


def cubic(t: float, x: Any, p: Any) -> tuple[float, float]:
    return x[1], -p.rate * (x[1] - cos(t)) - (x[0] ** 3)


def test_a_stable_linear_part_of_any_size_is_forgotten() -> None:
    """x' = -L (x - cos t): the image is cos 0 + sin 0 / L + O(1 / L^2), from wherever it began."""
    for rate in (1e2, 1e4, 1e8, 1e12):
        system = ForcedSystem(lambda t, x, p: (-p.rate * (x[0] - cos(t)),), {"rate": rate}, 2.0 * pi, ("x",))
        images = stroboscopic_map(system)([[0.5], [-2.0], [1e6]])
        assert images[:, 0] == pytest.approx(1.0 / (1.0 + 1.0 / rate**2), abs=2e-9)


def test_jacobians_of_stiff_maps() -> None:
    """Its determinant is exp of the mean trace (Liouville): exp(-2 pi rate), and columns are differences of images."""
    strobe = stroboscopic_map(ForcedSystem(cubic, {"rate": 3000.0}, 2.0 * pi, ("x", "v")), rtol=1e-11, atol=1e-11)
    assert method_of(strobe) == "Rosenbrock"
    point, step = np.array([0.7, 0.2]), 1e-4
    columns = [(strobe(point + step * e) - strobe(point - step * e)) / (2.0 * step) for e in np.eye(2)]
    np.testing.assert_allclose(jacobian(strobe, point), np.stack(columns, axis=-1), rtol=1e-5, atol=1e-7)


def test_its_coefficients_meet_the_conditions_of_order_five() -> None:
    """Stability function: exp(z) to order 5, and zero at infinity; nodes and sums are those of the stages."""
    z_values, gamma = np.array([-0.1, -0.2]), rosenbrock.GAMMA

    def after_a_step(z: complex) -> complex:
        stages: list[complex] = []
        for i, couplings in enumerate(rosenbrock._COUPLINGS):
            if i < len(rosenbrock._STAGES):
                u = 1.0 + sum(a * k for a, k in zip(rosenbrock._STAGES[i], stages, strict=True))
            else:
                u = u + stages[-1]
            known = sum(c * k for c, k in zip(couplings, stages, strict=True))
            stages.append((z * u + known) / (1.0 / gamma - z))
        return u + stages[-1]

    errors = np.array([abs(after_a_step(z) - np.exp(z)) for z in z_values])
    assert np.log2(errors[1] / errors[0]) > 5.8
    assert abs(after_a_step(-1e12)) < 1e-9
    assert max(abs(after_a_step(1j * y)) for y in np.linspace(0.0, 50.0, 2001)) <= 1.0 + 1e-9


@pytest.mark.parametrize("tolerance", at_once([1e-6], later=[1e-9]))
@pytest.mark.parametrize("narrowness", at_once([2e4], later=[500.0]))
def test_a_short_pulse_is_not_passed_over(narrowness: float, tolerance: float) -> None:
    """A fast variable follows a pulse of a hundredth of the period, from rest: a linear system, in closed form."""

    def pulse(t: float) -> float:
        return exp(narrowness * (cos(2 * pi * (t - 0.37)) - 1))

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return -p.k * (x[0] - 5 * exp(p.w * (cos(2 * pi * (t - 0.37)) - 1))), x[0] - 0.5 * x[1]

    k, system = 1000.0, ForcedSystem(rhs, {"k": 1000.0, "w": narrowness}, 1.0, ("fast", "slow"))
    strobe = stroboscopic_map(system, rtol=tolerance, atol=tolerance)
    found = strobe.iterate([2.0, 1.0], 1)
    passed = quad(lambda s: pulse(s) * exp(-0.5 * (1 - s)), 0.25, 0.5, points=[0.37], epsabs=1e-13)[0]
    slow = exp(-0.5) + (2.0 * exp(-0.5) + 5.0 * k * passed) / (k - 0.5)
    assert method_of(strobe) == "Rosenbrock"
    assert found.status == Status.OK
    assert found.points == pytest.approx([0.0, slow], abs=2 * tolerance)
