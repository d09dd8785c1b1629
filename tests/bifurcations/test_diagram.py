"""Bifurcation diagrams: exact cycles and exponents, hysteresis against folds found by AUTO, orbits that end."""

from math import log, pi, sin, sqrt, tanh

import matplotlib.pyplot as plt
import numpy as np
import pytest

import systems
from cellmap import Status, angle, bifurcation_diagram, discrete_map, plot, set_threads, stroboscopic_map
from cellmap.orbits.lyapunov_qr import exponents_of_cycles

LOGISTIC = systems.logistic_map()
DUFFING = stroboscopic_map(systems.duffing_oscillator())


def parabola(x, p):
    return (x[0] * x[0] + p.c,)


def wells(x, p):
    return (tanh(p.a * x[0]),)


def branching(x, p):
    return (p.mu * x[0] * (1.0 - x[0]) if x[0] < 0.5 else p.mu * (1.0 - x[0]) * x[0],)


def circle(x, p):
    return (x[0] + 2 * pi * p.rate - 0.95 * sin(x[0]),)


# --- exact results


@pytest.mark.parametrize("follow", ["none", "up", "down"])
def test_cycle_of_two_of_the_logistic_map(follow):
    """x = (r + 1 +- sqrt((r - 3)(r + 1))) / 2r with the multiplier 4 + 2 r - r^2."""
    values = np.array([3.1, 3.2, 3.3, 3.4])
    diagram = bifurcation_diagram(LOGISTIC, "mu", values, [0.3], follow)
    assert (diagram.period == 2).all()
    for k, r in enumerate(values):
        root = sqrt((r - 3) * (r + 1))
        assert np.sort(diagram.points[0, k, -2:, 0]) == pytest.approx(
            [(r + 1 - root) / (2 * r), (r + 1 + root) / (2 * r)], abs=1e-12
        )
        assert diagram.exponents[0, k, 0] == pytest.approx(log(abs(4 + 2 * r - r * r)) / 2, abs=1e-9)
    assert (diagram.standard_errors == 0).all()


def test_doublings_and_windows_of_the_logistic_map():
    """May (1976): doublings at 3, 1 + sqrt(6) and 3.5440903, the window of period 3 from 1 + sqrt(8) to 3.8414990."""
    periods = {
        **{2.99: 1, 3.01: 2, 1 + sqrt(6) - 0.01: 2, 1 + sqrt(6) + 0.005: 4, 3.542: 4, 3.546: 8},
        **{1 + sqrt(8) - 1e-3: 0, 1 + sqrt(8) + 1e-3: 3, 3.841: 3, 3.842: 6},
    }
    diagram = bifurcation_diagram(LOGISTIC, "mu", list(periods), [0.3], follow="none", transient=20_000)
    assert diagram.period[0].tolist() == list(periods.values())


def test_slow_approach_is_no_longer_period():
    """Below a doubling an orbit comes in from side to side: it has no period yet, never twice the true one."""
    for transient in (0, 30, 100, 300, 1000, 5000):
        values = [2.97, 2.99, 3.0, 3.44, 3.54]
        found = bifurcation_diagram(LOGISTIC, "mu", values, [0.3], "none", transient, exponents=False).period
        assert all(period in (0, true) for period, true in zip(found[0], (1, 1, 1, 2, 4), strict=True))


def test_long_cycles_of_strong_contraction():
    """The smallest multiplier of a cycle is far below the rounding of the largest."""
    rng = np.random.default_rng(0)
    turned, _ = np.linalg.qr(rng.standard_normal((2, 2)))
    steps = np.tile(turned @ np.diag([0.9, 1e-3]) @ turned.T, (1, 32, 1, 1))
    assert exponents_of_cycles(steps)[0] == pytest.approx([log(0.9), log(1e-3)], abs=1e-12)


def test_exponents_of_a_map_that_branches():
    """A function that cannot be traced, against the same one as a formula."""
    maps = discrete_map(branching, {"mu": 3.0}, ("x",)), LOGISTIC
    by_steps, exact = (bifurcation_diagram(m, "mu", [3.2, 3.5, 4.0], [0.3], "none", 300) for m in maps)
    assert by_steps.points[0, :2] == pytest.approx(exact.points[0, :2], abs=1e-12)
    assert by_steps.exponents[0, :2] == pytest.approx(exact.exponents[0, :2], abs=1e-9)
    chaos = by_steps.points[0, 2, 128 - 9 * 12 :, 0]  # 9 of 10 stretches of the orbit, the first aligns frames
    assert by_steps.exponents[0, 2, 0] == pytest.approx(np.log(np.abs(4 * (1 - 2 * chaos))).mean(), abs=1e-9)


@pytest.mark.parametrize(("rate", "p", "q"), [(0.5, 1, 2), (0.342, 1, 3), (-0.342, -1, 3), (1.5, 3, 2)])
def test_rotation_numbers_of_the_circle_map(rate, p, q):
    diagram = bifurcation_diagram(discrete_map(circle, {"rate": 0.0}, (angle("a"),)), "rate", [rate], [0.3])
    assert (diagram.period == q).all()
    assert (diagram.rotation_numbers == p / q).all()
    assert (np.abs(diagram.points) <= pi).all()


# --- hysteresis


@pytest.fixture(scope="module")
def duffing():
    return bifurcation_diagram(DUFFING, "frequency", np.linspace(1.3, 1.8, 26), [0.0, 0.0], transient=300, periods=64)


def test_orbit_leaves_an_equilibrium_that_has_lost_its_stability():
    """tanh(a x): 0 is stable up to a = 1."""
    maps, values = discrete_map(wells, {"a": 1.0}, ("x",)), [0.5, 0.8, 1.5, 2.0]
    followed = bifurcation_diagram(maps, "a", values, [0.0], follow="up")
    assert np.abs(followed.points[0, :2]) == pytest.approx(0.0, abs=1e-9)
    ends = np.abs(followed.points[0, 2:, -1, 0])
    assert np.tanh(np.array(values[2:]) * ends) == pytest.approx(ends, abs=1e-9)
    assert (ends > 0.5).all()
    still = bifurcation_diagram(maps, "a", values, [0.0], follow="up", perturbation=0.0)
    assert (still.points == 0.0).all()
    assert still.exponents[0, :, 0] == pytest.approx(np.log(values), abs=1e-12)


# --- orbits that end, several initial conditions, one batch


def test_orbits_that_end_are_marked_and_begin_again():
    """x^2 + c: bounded for c up to 1/4, from the start 0."""
    values = np.array([-0.5, 0.0, 0.2, 0.3, 0.4])
    diagram = bifurcation_diagram(discrete_map(parabola, {"c": 0.0}, ("x",)), "c", values, [0.0])
    ended = np.tile(values > 0.25, (2, 1))
    assert ((diagram.status == Status.DIVERGED) == ended).all()
    assert (np.isnan(diagram.points).all(axis=(2, 3)) == ended).all()
    assert (np.isnan(diagram.exponents[..., 0]) == ended).all()
    assert (np.isfinite(diagram.points).all(axis=(2, 3)) == ~ended).all()
    assert diagram.restarted.tolist() == [[False, False, False, True, True], [False, False, True, True, False]]
    fixed = (1 - np.sqrt(1 - 4 * values[:3])) / 2
    assert diagram.points[:, :3, -1, 0] == pytest.approx(np.tile(fixed, (2, 1)), abs=1e-5)
    assert not diagram.chaotic.any()


def test_orbit_that_falls_off_begins_at_its_initial_condition():
    """(x - d)^2 + d: the fixed point d has the basin d - 1 < x < d + 1."""

    def moved(x, p):
        return ((x[0] - p.d) ** 2 + p.d,)

    maps, values = discrete_map(moved, {"d": 0.0}, ("x",)), [1.0, 2.5, 2.6]
    diagram = bifurcation_diagram(maps, "d", values, [1.8], follow="up")
    assert diagram.restarted.tolist() == [[False, True, False]]
    assert (diagram.status == Status.OK).all()
    assert diagram.points[0, :, -1, 0] == pytest.approx(values, abs=1e-12)


@pytest.mark.parametrize("follow", ["both", "none"])
def test_same_bits_for_any_number_of_threads(follow):
    def diagram(threads):
        set_threads(threads)
        return bifurcation_diagram(DUFFING, "frequency", np.linspace(1.3, 1.8, 5), [[0.0, 0.0], [1.0, 0.0]], follow, 50)

    one, three = diagram(1), diagram(3)
    for name in ("points", "exponents", "standard_errors", "period", "rotation_numbers"):
        assert (getattr(one, name) == getattr(three, name)).all()


# --- figures


def test_figure_shows_all_points(duffing):
    upper, lower = plot.bifurcation_diagram(duffing, coordinate="x")
    drawn = [line for line in upper.get_lines() if line.get_marker() == "."]
    assert [line.get_xdata().size for line in drawn] == [26 * 64] * 2
    assert {t.get_text() for t in upper.get_legend().get_texts()} == {"up", "down"}
    assert (upper.get_ylabel(), lower.get_xlabel(), upper.get_title()) == ("$x$", "frequency", "Duffing")
    _, ax = plt.subplots()
    assert plot.bifurcation_diagram(duffing, coordinate=1, ax=ax) == (ax,)
    assert (ax.get_ylabel(), ax.get_xlabel()) == ("$v$", "frequency")
    for wrong in ("y", 2):
        with pytest.raises(ValueError, match=f"coordinate={wrong!r}"):
            plot.bifurcation_diagram(duffing, coordinate=wrong)
