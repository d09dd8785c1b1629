"""Measures of periodic orbits over their period, against closed forms and balances."""

from math import copysign, cos, pi, sin

import matplotlib.pyplot as plt
import numpy as np
import pytest
from branch_kinds import FOLD
from cases import branch_of
from scipy.integrate import solve_ivp

from cellmap import ForcedSystem, bifurcation_diagram, discrete_map, plot, stroboscopic_map
from cellmap.bifurcations import OrbitFunction, continue_bifurcation, switch_branch
from cellmap.exchange import from_xarray, to_dataframe
from systems import duffing_oscillator


@pytest.fixture(scope="module")
def resonance():
    spring = stroboscopic_map(duffing_oscillator(damping=0.1, forcing=0.3, frequency=1.0), rtol=1e-11, atol=1e-11)
    return branch_of(spring, [0.7, 0.0], "frequency", 0.8, 2.2, step=0.02)


def test_the_power_that_is_dissipated_is_the_power_of_the_force(resonance):
    lost = resonance.measure(lambda t, x, p: p.damping * x[1] ** 2, "mean")
    given = resonance.measure(lambda t, x, p: p.forcing * cos(p.frequency * t) * x[1], "mean")
    np.testing.assert_allclose(lost, given, rtol=1e-8)
    np.testing.assert_allclose(0.1 * resonance.measure("v", "norm") ** 2, lost, rtol=1e-12)


def test_points_of_discrete_orbits_stand_for_all_times():
    logistic = discrete_map(lambda x, p: (p.r * x[0] * (1.0 - x[0]),), {"r": 2.8}, ("x",))
    first = branch_of(logistic, [0.6], "r", 2.5, 3.4)
    second = switch_branch(first, first.bifurcations[0], 2.5, 3.4)
    r = second.values
    for sign, measure in ((1.0, "maximum"), (-1.0, "minimum")):
        expected = (r + 1.0 + sign * np.sqrt((r - 3.0) * (r + 1.0))) / (2.0 * r)
        np.testing.assert_allclose(second.measure(0, measure), expected, rtol=1e-10)
    ax = plot.branches([first, second], measure="maximum")
    assert ax.get_ylabel() == "maximum of $x$"


def test_measures_along_a_curve(resonance):
    fold = resonance.of_kind(FOLD)[0]
    curve = continue_bifurcation(resonance, fold, "forcing", (0.8, 2.2), (0.25, 0.35), step=0.1)
    assert np.isfinite(curve.measure("x", "amplitude")).all() and curve.measure("x").shape == curve.values.shape[:1]


def test_sweeps_have_the_measures_of_the_branch_that_they_follow(resonance):
    spring = resonance.point_map
    response = bifurcation_diagram(spring, "frequency", [0.8, 1.0, 2.2], [0.7, 0.0], transient=400, exponents=False)
    amplitude = response.measure("x", "amplitude")
    for row in amplitude:
        np.testing.assert_allclose(row[[0, 2]], resonance.measure("x", "amplitude")[[0, -1]], rtol=1e-6)
    (ax,) = plot.bifurcation_diagram(response, coordinate="x", measure="amplitude", ax=plt.figure().subplots())
    assert ax.get_ylabel() == "amplitude of $x$"
    np.testing.assert_allclose(ax.get_lines()[0].get_ydata(), amplitude[1], rtol=1e-12)


def test_chaotic_motion_dissipates_what_the_force_gives_it():
    """Over 20 periods: rounding errors are 1e-7 after these, and 1 after 40.

    The motion does not return, so that a mean of samples has an error from its two ends, 1 / 20 of 3e-5.
    """
    wells = duffing_oscillator(damping=0.2, linear=-1.0, forcing=0.3, frequency=1.0)
    exact = stroboscopic_map(wells, rtol=1e-11, atol=1e-11)
    diagram = bifurcation_diagram(
        exact, "forcing", [0.3], [0.1, 0.2], "none", periods=20, longest_period=9, exponents=False
    )
    assert diagram.period[0, 0] == 0
    lost, given = (
        diagram.measure(f, "mean")[0, 0]
        for f in (lambda t, x, p: p.damping * x[1] ** 2, lambda t, x, p: p.forcing * cos(p.frequency * t) * x[1])
    )
    points = diagram.points[0, 0]
    x, v = np.array([points[0], exact(points[-1])]).T
    first, last = 0.5 * v**2 - 0.5 * x**2 + 0.25 * x**4
    assert lost == pytest.approx(given - (last - first) / (20 * 2.0 * pi), abs=2e-6)
    times = np.linspace(0.0, 2.0 * pi, 2001)
    each = [solve_ivp(wells.fun, (0.0, 2 * pi), y, "DOP853", times, rtol=1e-10, atol=1e-10).y[0] for y in points]
    assert diagram.measure("x")[0, 0] == pytest.approx(np.max(each), abs=3e-5)
    assert diagram.measure("x", "minimum")[0, 0] == pytest.approx(np.min(each), abs=3e-5)


def test_tables_and_labelled_arrays_have_columns_of_functions(resonance):
    functions = {"peak": OrbitFunction("x", "amplitude", value=0.5), "force": lambda t, x, p: p.forcing}
    table, labelled = resonance.to_dataframe(functions), resonance.to_xarray(functions)
    np.testing.assert_array_equal(table["peak"], resonance.measure("x", "amplitude") - 0.5)
    np.testing.assert_array_equal(labelled["peak"], table["peak"])
    assert set(table["force"]) == {0.3} and "peak" not in resonance.to_dataframe()
    logistic = discrete_map(lambda x, p: (p.r * x[0] * (1.0 - x[0]),), {"r": 2.8}, ("x",))
    diagram = bifurcation_diagram(logistic, "r", [2.0, 3.2], [0.3])
    least = {"least": OrbitFunction("x", "minimum")}
    known = np.array([0.5, (4.2 - np.sqrt(0.2 * 4.2)) / 6.4])
    np.testing.assert_allclose(diagram.to_xarray(least)["least"], [known, known], rtol=1e-6)
    table = diagram.to_dataframe(least)
    np.testing.assert_allclose(table["least"], known[(table["r"] > 3).astype(int)], rtol=1e-6)
    again = from_xarray(diagram.to_xarray(), logistic)
    np.testing.assert_array_equal(again.measure("x"), diagram.measure("x"))
    with pytest.raises(ValueError, match="point_map=None"):
        from_xarray(diagram.to_xarray()).measure("x")
    with pytest.raises(TypeError, match="functions="):
        to_dataframe(resonance.bifurcations, least)


def test_high_harmonics_and_signals_with_jumps_and_kinks_have_no_wrong_measure():
    # x'' + x'/2 + 4 x = F cos t + h^2 cos(h t), whose linear response is in closed form.
    h = 64
    system = ForcedSystem(
        lambda t, x, p: (x[1], -4.0 * x[0] - 0.5 * x[1] + p.F * cos(t) + h * h * cos(h * t)),
        {"F": 1.0},
        2.0 * pi,
        ("x", "v"),
    )
    linear = stroboscopic_map(system, rtol=1e-10, atol=1e-10)
    branch = branch_of(linear, [0.3, 0.0], "F", 0.9, 1.1, step=0.5)
    low, high = branch.values[-1] / (3.0 + 0.5j), h * h / (4.0 - h * h + 0.5j * h)
    t = np.linspace(0.0, 2.0 * pi, 400001)
    x = (low * np.exp(1j * t) + high * np.exp(1j * h * t)).real
    found = [branch.measure("x", measure)[-1] for measure in ("maximum", "mean", "norm")]
    assert found == pytest.approx([x.max(), 0.0, np.sqrt(0.5 * (abs(low) ** 2 + abs(high) ** 2))], abs=1e-7)
    for n in (64, 69, 2368):
        values = [branch.measure(lambda t, x, p, n=n: cos(n * t), m)[-1] for m in ("maximum", "mean", "norm")]
        known = np.isfinite(values)
        np.testing.assert_allclose(np.array(values)[known], np.array([1.0, 0.0, np.sqrt(0.5)])[known], atol=1e-9)
        assert known.all() == (n < 100) == known.any()
    for function, least, greatest in (
        (lambda t, x, p: max(0.0, cos(t - 1.0)), 0.0, 1.0),
        (lambda t, x, p: abs(cos(t - 1.0)), 0.0, 1.0),
        (lambda t, x, p: abs(cos(t - 1.0)) + 0.5 * sin(t - 1.0), -0.5, np.sqrt(1.25)),
    ):
        assert branch.measure(function, "minimum") == pytest.approx(least, abs=1e-9)
        assert branch.measure(function, "maximum") == pytest.approx(greatest, abs=1e-9)
    jumps = [branch.measure(lambda t, x, p: copysign(1.0, x[1]), m)[-1] for m in ("minimum", "maximum", "amplitude")]
    assert jumps == [-1.0, 1.0, 1.0]
