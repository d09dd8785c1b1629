"""Zeros and extreme values of functions along branches and curves, against closed forms and SciPy."""

from __future__ import annotations

from math import cos, pi, sin
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from cellmap import ForcedSystem, angle, continue_orbit, discrete_map, periodic_orbit, plot, stroboscopic_map
from cellmap.bifurcations import Branch, OrbitFunction, continue_bifurcation, switch_branch
from cellmap.exchange import save_auto, to_dataframe
from systems import duffing_oscillator, henon_map

PEAK = OrbitFunction("x", "amplitude", extremum=True)
R = 1.0 + np.sqrt(5.0)


@pytest.fixture(scope="module")
def linear() -> Branch:
    """x'' + b x' + x = cos(w t) has the amplitude 1/sqrt((1 - w^2)^2 + (b w)^2), largest at w^2 = 1 - b^2/2."""
    system = ForcedSystem(
        lambda t, x, p: (x[1], cos(p.w * t) - x[0] - p.b * x[1]),
        {"w": 0.5, "b": 0.2},
        period=lambda p: 2.0 * pi / p.w,
        coordinates=("x", "v"),
    )
    exact = stroboscopic_map(system)
    branch = continue_orbit(exact, periodic_orbit(exact, [1.0, 0.0]), "w", 0.5, 1.5, step=0.05)
    level, own = OrbitFunction("x", "maximum", value=2.0), {"w=1": lambda t, x, p: p.w - 1.0}
    return branch.with_zeros({"peak": PEAK, "level": level, **own})


def test_peaks_and_levels_of_a_linear_resonance(linear: Branch) -> None:
    names = [z.name for z in linear.zeros]
    assert names == ["level", "peak", "w=1", "level"]
    low, high = ((2.0 - 0.04 + s * np.sqrt(0.04**2 - 4.0 * 0.04 + 1.0)) / 2.0 for s in (-1.0, 1.0))
    expected = [np.sqrt(low), np.sqrt(0.98), 1.0, np.sqrt(high)]
    np.testing.assert_allclose([z.value for z in linear.zeros], expected, rtol=0, atol=1e-11)
    assert all(z.unstable == 0 for z in linear.zeros)
    assert not linear.bifurcations and linear.special_points == linear.zeros


def test_curves_of_peaks_and_of_equal_amplitude(linear: Branch) -> None:
    level, peak = linear.zeros[:2]
    box = (0.9, 1.1), (0.15, 0.3)
    peaks = continue_bifurcation(linear, peak, "b", *box, step=0.1)
    w, b = peaks.values.T
    np.testing.assert_allclose(w**2, 1.0 - 0.5 * b**2, rtol=0, atol=1e-10)
    assert (peaks.kind, peaks.codimension_two(), len(peaks.ends)) == ("peak", (), 2)
    assert {*b[[0, -1]].round(12)} == {0.15, 0.3}
    levels = continue_bifurcation(linear, level, "b", (0.5, 1.5), (0.19, 0.8), step=0.2)
    w, b = levels.values.T
    np.testing.assert_allclose((1.0 - w**2) ** 2 + (b * w) ** 2, 0.25, rtol=0, atol=1e-11)
    levels = levels.with_zeros({"w=1": lambda t, x, p: p.w - 1.0})
    assert levels.zeros[0].values == pytest.approx([1.0, 0.5], abs=1e-11)
    assert levels.zeros[0].params == levels.zeros[0].orbit.params == pytest.approx({"w": 1.0, "b": 0.5})
    ax = plot.bifurcation_curves([levels, peaks])
    assert [t.get_text() for t in ax.texts] == ["w=1"]
    plt.close("all")


def test_the_peak_of_a_hardening_spring_is_where_shooting_with_scipy_has_it() -> None:
    system = duffing_oscillator(damping=0.1, forcing=0.1, frequency=0.8)
    spring = stroboscopic_map(system)
    branch = continue_orbit(spring, periodic_orbit(spring, [0.3, 0.0]), "frequency", 0.8, 1.6, step=0.03)
    (peak,) = branch.with_zeros({"peak": PEAK}).zeros

    def amplitude(w: float, guess: Any) -> tuple[float, Any]:
        fun = system.with_params(frequency=w).fun

        def flow(y: Any, **more: Any) -> Any:
            return solve_ivp(fun, (0.0, 2.0 * pi / w), y, "DOP853", rtol=1e-12, atol=1e-12, **more)

        start = fsolve(lambda y: flow(y).y[:, -1] - y, guess, xtol=1e-13)
        turns = flow(start, events=lambda t, y: y[1]).y_events[0][:, 0]
        return 0.5 * (turns.max() - turns.min()), start

    (before, _), (here, _), (after, _) = (amplitude(peak.value + h, peak.point) for h in (-2e-4, 0.0, 2e-4))
    vertex = peak.value + 2e-4 * (before - after) / (2.0 * (before - 2.0 * here + after))
    assert here > max(before, after)
    assert vertex == pytest.approx(peak.value, abs=1e-5)


def test_maps_in_closed_form() -> None:
    logistic = discrete_map(lambda x, p: (p.r * x[0] * (1.0 - x[0]),), {"r": 2.0}, ("x",))
    fixed = continue_orbit(logistic, periodic_orbit(logistic, [0.5]), "r", 1.5, 3.5, step=0.05)
    # x = 1 - 1/r: the parabola (r - 1)(4 - r) has its vertex at 5/2; zeros at points of the branch and at its end.
    functions = {
        "vertex": OrbitFunction(lambda t, x, p: x[0] * p.r * (4.0 - p.r), extremum=True),
        "start": lambda t, x, p: p.r - 2.0,
        "end": lambda t, x, p: 3.5 - p.r,
        "x": OrbitFunction("x", value=0.6),
    }
    found = {z.name: z.value for z in fixed.with_zeros(functions).zeros}
    assert found == pytest.approx({"vertex": 2.5, "start": 2.0, "end": 3.5, "x": 2.5}, abs=1e-10)
    doubled = switch_branch(fixed, fixed.bifurcations[-1], 1.5, 3.6, step=0.05).with_zeros(
        {"superstable": OrbitFunction("x", "minimum", value=0.5)}
    )
    (zero,) = doubled.zeros
    assert zero.value == pytest.approx(R, abs=1e-12) and abs(zero.multipliers[0]) < 1e-8
    curve = henon_map(0.2, 0.3)
    branch = continue_orbit(curve, periodic_orbit(curve, [0.5, 0.2]), "a", -0.2, 0.6)
    flips = continue_bifurcation(branch, branch.bifurcations[-1], "b", (0.0, 1.4), (-0.5, 0.9), step=0.05)
    # Period doublings at a = 3/4 (1 - b)^2, along which a + b is least at (1/3, 1/3).
    least = flips.with_zeros({"least": OrbitFunction(lambda t, x, p: p.a + p.b, extremum=True)}).zeros
    assert least[0].values == pytest.approx([1.0 / 3.0, 1.0 / 3.0], abs=1e-9) and len(least) == 1


def test_branch_cuts_are_no_zeros_and_functions_that_vanish_are_refused() -> None:
    circle = discrete_map(lambda x, p: (x[0] - 0.5 * sin(x[0] - p.q),), {"q": 1.0}, (angle("theta"),))
    branch = continue_orbit(circle, periodic_orbit(circle, [1.0]), "q", -1.0, 4.0, step=0.03)
    (zero,) = branch.with_zeros({"straight": "theta"}).zeros
    assert zero.value == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(ValueError, match=r"functions\['same'\]: it is zero at all points"):
        branch.with_zeros({"same": lambda t, x, p: sin(x[0] - p.q)})
    with pytest.raises(ValueError, match="quantity='speed'"):
        branch.with_zeros({"fast": "speed"})
    with pytest.raises(ValueError, match="measure='peak'"):
        OrbitFunction("theta", "peak")


def test_labels_in_figures_tables_and_files(linear: Branch, tmp_path: Path) -> None:
    ax = plot.branches(linear, measure="amplitude")
    assert [t.get_text() for t in ax.texts] == [z.name for z in linear.zeros]
    table = to_dataframe(linear.special_points)
    assert list(table["kind"]) == ["level", "peak", "w=1", "level"]
    lines = save_auto(linear, tmp_path / "b.linear", measures=True).read_text().splitlines()
    users = [line for line in lines if line[10:14] == "  -4"]
    assert [float(line[19:38]) for line in users] == pytest.approx([z.value for z in linear.zeros], rel=1e-10)
    assert float(users[1][57:76]) == pytest.approx(1.0 / np.sqrt(0.02**2 + 0.04 * 0.98), rel=1e-9)
    plt.close("all")


def test_a_closed_branch_has_each_zero_once() -> None:
    # Fixed points on the circle x^2 + q^2 = 1, from q = 0 on.
    isola = discrete_map(lambda x, p: (x[0] + 0.3 * (1.0 - x[0] ** 2 - p.q**2),), {"q": 0.0}, ("x",))
    branch = continue_orbit(isola, periodic_orbit(isola, [1.0]), "q", -1.5, 1.5, step=0.05)
    assert branch.ends == ("closed", "closed")
    np.testing.assert_allclose(branch.points[[0, -1], 0], 1.0, rtol=1e-13)
    functions = {"q": lambda t, x, p: p.q, "half": lambda t, x, p: p.q - 0.5, "x": OrbitFunction("x", extremum=True)}
    found = sorted((z.name, z.point[0]) for z in branch.with_zeros(functions).zeros)
    side = np.sqrt(0.75)
    expected = [("half", -side), ("half", side), ("q", -1.0), ("q", 1.0), ("x", -1.0), ("x", 1.0)]
    assert [name for name, _ in found] == [name for name, _ in expected]
    np.testing.assert_allclose([x for _, x in found], [x for _, x in expected], atol=1e-9)


@pytest.fixture(scope="module")
def parabola() -> Branch:
    """Fixed points x^2 = q, from (1/2, 1/4) on: the initial orbit is where the two parts of the branch meet."""
    fold = discrete_map(lambda x, p: (x[0] + p.q - x[0] ** 2,), {"q": 0.25}, ("x",))
    return continue_orbit(fold, periodic_orbit(fold, [0.5]), "q", -0.3, 0.8)


def test_zeros_and_extrema_at_the_initial_orbit_are_found_once(parabola: Branch) -> None:
    functions = {
        "q": lambda t, x, p: p.q - 0.25,
        "touches": lambda t, x, p: (x[0] - 0.5) ** 2,
        "least": OrbitFunction(lambda t, x, p: (x[0] - 0.5) ** 2, extremum=True),
        "last": lambda t, x, p: x[0] - p.q - np.sqrt(0.8) + 0.8,
    }
    zeros = [(z.name, z.point[0]) for z in parabola.with_zeros(functions).zeros]
    names = sorted(name for name, _ in zeros)
    assert names == ["last", "last", "least", "q", "q", "touches"]
    # x - x^2 has the same value at x and at 1 - x.
    expected = {"q": {-0.5, 0.5}, "touches": {0.5}, "least": {0.5}, "last": {np.sqrt(0.8), 1.0 - np.sqrt(0.8)}}
    for name, places in expected.items():
        np.testing.assert_allclose(sorted(x for n, x in zeros if n == name), sorted(places), atol=1e-9)


def test_zeros_of_high_multiplicity_lose_no_others(parabola: Branch) -> None:
    functions = {f"{n}": lambda t, x, p, n=n: (x[0] - 0.31) ** n for n in (3, 5, 9)}
    found = parabola.with_zeros({**functions, "x": OrbitFunction("x", value=0.2)}).zeros
    assert [z.name for z in found] == ["x", "3", "5", "9"]
    np.testing.assert_allclose([z.point[0] for z in found], [0.2, 0.31, 0.31, 0.31], rtol=0, atol=1e-13)


def test_extrema_are_found_on_large_constants_and_where_they_are_flat(parabola: Branch) -> None:
    functions = {
        "quartic": OrbitFunction(lambda t, x, p: (x[0] - 0.31) ** 4, extremum=True),
        "large": OrbitFunction(lambda t, x, p: 1e6 + (x[0] - 0.31) ** 2, extremum=True),
        "inflection": OrbitFunction(lambda t, x, p: (x[0] - 0.31) ** 3, extremum=True),
    }
    found = {z.name: z.point[0] for z in parabola.with_zeros(functions).zeros}
    # Truncation of the slope's differences, 16 (3e-4)^4, under a cube root; rounding of 1e6 beside a slope.
    assert found == {"quartic": pytest.approx(0.31, abs=5e-5), "large": pytest.approx(0.31, abs=1e-6)}


def test_functions_that_are_zero_on_a_stretch_are_said_so_once(parabola: Branch) -> None:
    functions = {
        "kink": lambda t, x, p: max(0.0, x[0] - 0.31),
        "half": lambda t, x, p: (x[0] - abs(p.q) ** 0.5) * (x[0] + 0.5),
    }
    with pytest.warns(RuntimeWarning, match=r"functions\['(kink|half)'\]: it is zero along stretches") as caught:
        found = parabola.with_zeros({**functions, "x": OrbitFunction("x", value=0.2)}).zeros
    assert len(caught) == 2 and [z.name for z in found] == ["half", "x"]
    np.testing.assert_allclose([z.point[0] for z in found], [-0.5, 0.2], rtol=0, atol=1e-12)


def test_angles_are_continuous_along_a_branch_and_zero_up_to_full_rotations() -> None:
    # The pendulum stands upright: theta - c does not depend on c, and has the mean pi.
    pendulum = ForcedSystem(
        lambda t, x, p: (x[1], 4.0 * sin(x[0] - p.c) - 0.5 * x[1] + 0.3 * cos(t)),
        {"c": -0.3},
        2.0 * pi,
        (angle("theta"), "v"),
    )
    exact = stroboscopic_map(pendulum)
    branch = continue_orbit(exact, periodic_orbit(exact, [pi - 0.3, 0.0]), "c", -0.3, 0.5, step=0.1)
    np.testing.assert_allclose(branch.measure("theta", "mean") - branch.values, pi, rtol=0, atol=1e-9)
    assert np.ptp(branch.measure("theta", "maximum") - branch.values) < 1e-8
    functions = {
        "mean": OrbitFunction("theta", "mean", value=pi),
        "more": OrbitFunction("theta", "mean", value=pi + 0.2),
        "first": OrbitFunction("theta", value=pi),
        "none": OrbitFunction("theta", "mean", extremum=True),
    }
    found = {z.name: z.value for z in branch.with_zeros(functions).zeros}
    first = -0.3 + pi - branch.points[0, 0]
    assert found == pytest.approx({"mean": 0.0, "more": 0.2, "first": first}, abs=1e-9)


def _branching(t: float, x: Any, p: Any) -> float:
    return 1.0 if x[0] > 0.0 else 0.0


def test_wrong_functions_are_refused_with_a_remedy(parabola: Branch) -> None:
    for given, message in (
        ({"value": "1"}, "value='1': give one real number"),
        ({"value": np.nan}, "value=nan: give a finite number"),
        ({"extremum": "no"}, "extremum='no': give True or False"),
        ({"measure": "max"}, "measure='max': choose one of 'maximum', 'minimum'"),
    ):
        with pytest.raises((TypeError, ValueError), match=message):
            OrbitFunction("x", **given)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="functions=None: give a mapping"):
        parabola.with_zeros(None)  # type: ignore[arg-type]
    wrong: tuple[Any, ...] = (
        lambda x: x,
        lambda t, x, p: p.b,
        lambda t, x, p: x[5],
        _branching,
        lambda t, x, p: 1j * x[0],
        lambda t, x, p: None,
    )
    for function in wrong:
        with pytest.raises(
            (TypeError, ValueError, AttributeError, IndexError), match=r"quantity=.*; give a function f\("
        ):
            parabola.measure(function, None)
    np.testing.assert_array_equal(parabola.measure(np.int64(0)), parabola.measure(0))
