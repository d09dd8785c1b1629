"""Failures of the integration are reported: singularities, missed tolerances, stiffness."""

import warnings
from collections.abc import Callable, Mapping
from math import cos, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from two_tiers import at_once

from cellmap import ForcedSystem, Status, angle, stroboscopic_map
from cellmap.maps import Impact, ToleranceWarning


def test_what_is_not_finite_spoils_no_neighbour() -> None:
    """The right-hand side is not a number where abs(x) > 1: those orbits end, all others keep their bits."""

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return 0.01 * sqrt(1.0 - x[0] ** 2) - 0.1 * x[0], -x[1] + cos(t)

    strobe = stroboscopic_map(ForcedSystem(rhs, {}, 2 * pi, ("x", "v")))
    initial_conditions = np.column_stack([np.linspace(-1.05, 0.9, 400), np.linspace(-1.0, 1.0, 400)])
    bad = np.abs(initial_conditions[:, 0]) > 1.0
    images = strobe.iterate(initial_conditions, 1)
    assert 5 < bad.sum() < 20
    assert np.array_equal(images.status == Status.DIVERGED, bad)
    assert np.isnan(images.points[bad]).all() and not images.rotations[bad].any()
    assert np.array_equal(images.points[~bad], strobe(initial_conditions[~bad]))


@pytest.mark.parametrize(
    "rate",
    [lambda x: x**2, lambda x: x**2 if x < 1e300 else 2.0 * x**2, lambda x: x**2 if x != 1e300 else 2.0 * x**2],
    ids=["traced", "branching", "as it is"],
)
def test_a_blow_up_in_finite_time(rate: Callable[[float], float]) -> None:
    """x' = x^2 has x(1) = x0 / (1 - x0): finite for x0 < 1, blown up within the period for x0 > 1."""

    system = ForcedSystem(lambda t, x, p: (rate(x[0]),), {}, 1.0, ("x",))
    initial_conditions = np.array([[-5.0], [0.0], [0.5], [0.9], [0.99], [1.01], [1.5], [100.0]])
    images = stroboscopic_map(system, rtol=1e-9, atol=1e-9).iterate(initial_conditions, 1)
    assert images.status.tolist() == [Status.OK] * 5 + [Status.DIVERGED] * 3
    exact = initial_conditions[:5] / (1.0 - initial_conditions[:5])
    assert images.points[:5] == pytest.approx(exact, rel=1e-7)
    assert np.isnan(images.points[5:]).all()


def test_angles_too_fast_for_any_number_of_steps_have_diverged(problems: Mapping[str, ForcedSystem]) -> None:
    images = stroboscopic_map(problems["forced pendulum"]).iterate([[0.0, 1e200], [0.0, 1.0]], 1)
    assert images.status.tolist() == [Status.DIVERGED, Status.OK]
    assert np.isfinite(images.points).all(axis=1).tolist() == (images.status < Status.ESCAPED).tolist()


def test_a_missed_tolerance_is_said(problems: Mapping[str, ForcedSystem]) -> None:
    strobe = stroboscopic_map(problems["forced pendulum"], rtol=1e-13, atol=1e-13, method="RK45", max_steps=64)
    initial_conditions = [[1.0, 2.0], [0.5, 3.0]]
    for use in (strobe, lambda x: strobe.iterate(x, 2), lambda x: strobe.orbit(x, 2)):
        with pytest.warns(ToleranceWarning, match="2 of 2 orbits of forced pendulum did not meet the tolerance"):
            use(initial_conditions)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToleranceWarning)
        images = strobe.iterate(initial_conditions, 1)
    assert (images.status == Status.INACCURATE).all()
    best = stroboscopic_map(problems["forced pendulum"])(initial_conditions)
    assert images.points == pytest.approx(best, abs=1e-4)


def test_a_missed_tolerance_is_not_forgotten(problems: Mapping[str, ForcedSystem]) -> None:
    """The status stays with the orbit through later periods that are accurate again."""
    system = ForcedSystem(lambda t, x, p: (x[1], -8.0 * x[1] - sin(x[0])), {}, 2 * pi, (angle("theta"), "v"))
    strobe = stroboscopic_map(system, method="RK45", rtol=1e-6, atol=1e-6, max_steps=300)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToleranceWarning)
        orbit = strobe.orbit([[1.0, 3000.0], [1.0, 0.0]], 4)
    assert orbit.status[:, 0].tolist() == [Status.OK] + [Status.INACCURATE] * 4
    assert (orbit.status[:, 1] == Status.OK).all()


@pytest.mark.parametrize("period", [1e-6, 1e6])
def test_tiny_and_huge_periods(period: float) -> None:
    """x' = (cos(w t) - x) w in units of the period's own phase: the map is that of w = 1."""

    def rhs(t: float, x: Any, p: Any) -> tuple[float]:
        return ((cos(p.w * t) - x[0]) * p.w,)

    system = ForcedSystem(rhs, {"w": 2 * pi / period}, lambda p: 2 * pi / p.w, ("x",))
    # x(2 pi) = exp(-2 pi) (x0 - 1/2) + 1/2 for x' = cos(s) - x.
    assert stroboscopic_map(system)([3.0]) == pytest.approx(np.exp(-2 * pi) * 2.5 + 0.5, abs=1e-8)


quiet = pytest.mark.filterwarnings("ignore::cellmap.maps.ToleranceWarning")

METHODS = ("DOP853", "RK45", "Taylor", "Rosenbrock")
FIRST = [("DOP853", 256), ("RK45", 16384), ("Taylor", 16384), ("Rosenbrock", 256)]
ALL = at_once(FIRST, later=[(method, steps) for method in METHODS for steps in (256, 16384)])
VOLTAGE = 0.09


def electrode(t, x, p):
    """An electrode on a spring (Younis, MEMS Linear and Nonlinear Statics and Dynamics, 2011), which touches at 1."""
    return x[1], -x[0] - p.damping * x[1] + VOLTAGE / (1.0 - x[0]) ** 2


def images(rhs, period, places, names, method="auto", steps=16384, params=None, **options):
    system = ForcedSystem(rhs, params or {}, period, names, **options)
    return stroboscopic_map(system, method=method, max_steps=steps).iterate(places, 1)


CASES = {
    "collision": (lambda t, x, p: (x[1], -1.0 / x[0] ** 2), [[1.0, 0.0], [3.0, 0.0]], 2.0),  # after pi/sqrt(8) x^1.5
    "root": (lambda t, x, p: (-1.0 / x[0], x[1]), [[1.2, 0.0], [1.5, 0.0]], 1.0),  # x^2 - 2 t
    "tangent": (lambda t, x, p: (1.0 + x[0] ** 2, 0.0 * x[1]), [[0.7, 0.0], [0.3, 0.0]], 1.0),
}


@quiet
@pytest.mark.parametrize(("method", "steps"), ALL)
@pytest.mark.parametrize("name", list(CASES))
def test_orbits_end_at_poles(name, method, steps):
    rhs, places, period = CASES[name]
    found = images(rhs, period, places, ("x", "v"), method, steps)
    assert found.status.tolist() == [Status.DIVERGED, Status.OK]


@quiet
@pytest.mark.parametrize("method", at_once(["Rosenbrock", "DOP853"], later=["Taylor", "mixed"]))
def test_no_orbit_goes_on_beyond_a_pole(method):
    """x' = 1 / (1 - x)^2 is at 1 after the time (1 - x)^3 / 3; a step of loose tolerance passes that place unseen."""
    places = np.append(np.linspace(-1.5, 0.99, 200), 1.0 - 10.0 ** -np.arange(2.0, 12.0))[:, None]
    found = images(lambda t, x, p: (1.0 / (1.0 - x[0]) ** 2,), 1.0, places, ("x",), method)
    left = (1.0 - places[:, 0]) ** 3 - 3.0
    assert (found.status == np.where(left < 0.0, Status.DIVERGED, Status.OK)).all()
    np.testing.assert_allclose(found.points[left > 0.0, 0], 1.0 - np.cbrt(left[left > 0.0]), rtol=1e-8, atol=1e-8)


@quiet
@pytest.mark.parametrize(("steps", "far"), at_once([(256, False), (16384, True)], later=[(256, True), (16384, False)]))
def test_poles_beside_switches_and_stops(steps, far):
    """Coulomb friction of 0.01, located; or a stop on the other side.  The electrode is released beyond the saddle."""
    friction = 0.0 if far else 0.01

    def rhs(t, x, p):
        return x[1], -x[0] + VOLTAGE / (1.0 - x[0]) ** 2 - (0.0 if far else friction * (1 if x[1] > 0 else -1))

    stop = [Impact(lambda t, x, p: x[0] + 0.9, lambda t, x, p: (x[0], -0.5 * x[1]))] if far else []
    found = images(rhs, 20.0, [[0.95, 0.0], [0.1, 0.0]], ("x", "v"), "auto", steps, impacts=stop)
    assert found.status.tolist() == [Status.DIVERGED, Status.OK]


def kepler(t, x, p):
    cube = sqrt(x[0] * x[0] + x[1] * x[1]) ** 3
    return x[2], x[3], -x[0] / cube, -x[1] / cube


@quiet
@pytest.mark.parametrize("method", METHODS)
def test_orbits_that_pass_close_to_a_pole_do_not_end(method):
    """Ellipses close after 2 pi, also those of 0.0005 beside the centre; without angular momentum bodies collide."""
    shapes = np.array([0.5, 0.9, 0.99, 0.999, 1.0])
    places = np.zeros((5, 4))
    places[:, 0], places[:, 3] = 1.0 + shapes, np.sqrt((1.0 - shapes) / (1.0 + shapes))
    found = images(kepler, 2 * pi, places, ("x", "y", "u", "v"), method)
    assert (found.status[:2] == Status.OK).all() and (found.status[2:4] <= Status.INACCURATE).all()
    assert found.status[4] == Status.DIVERGED
    assert found.points[:2] == pytest.approx(places[:2], abs=1e-7)
    assert found.points[2:4] == pytest.approx(places[2:4], abs=1e-2)


@quiet
@pytest.mark.parametrize("method", at_once(["DOP853", "Rosenbrock"], later=METHODS))
def test_what_grows_for_ever_diverges(method):
    """Exponentials pass 1e100 after 230 times of growth."""
    linear = images(lambda t, x, p: (50.0 * x[0], -x[1]), 2 * pi, [1.0, 1.0], ("x", "y"), method)
    focus = ForcedSystem(lambda t, x, p: (x[0] - 3.0 * x[1], 3.0 * x[0] + x[1]), {}, 2 * pi, ("x", "y"))
    turning = stroboscopic_map(focus, method=method).iterate([[1.0, 0.0]] * 2, 40)
    assert linear.status == Status.DIVERGED and (turning.status == Status.DIVERGED).all()


@quiet
def test_an_inaccurate_image_has_a_digit():
    """x' = x^2 ends at 1 / (1/x - 1): 999 and nearly 10^7, where 256 equal steps have an error of as much."""
    with pytest.warns(ToleranceWarning, match="others diverge, and near a singularity .* by ends="):
        found = images(lambda t, x, p: (x[0] ** 2,), 1.0, [[0.999], [1.0 - 1e-7], [1.001]], ("x",), steps=256)
    assert found.status.tolist() == [Status.INACCURATE, Status.INACCURATE, Status.DIVERGED]
    assert found.points[:2, 0] == pytest.approx([999.0, 1e7 - 1.0], rel=0.05)


@quiet
@pytest.mark.parametrize("method", at_once(["DOP853"], later=["RK45"]))
def test_jumps_are_no_poles(method):
    """x' = x^(-1/2) passes zero at infinite speed, friction holds a mass: they miss the tolerance, and do not end."""
    friction = images(
        lambda t, x, p: (x[1], -x[0] - 0.3 * (1 if x[1] > 0 else -1) + 0.1 * cos(t)),
        2 * pi,
        [0.2, 0.1],
        ("x", "v"),
        method,
    )
    assert friction.status == Status.INACCURATE
    fast = images(lambda t, x, p: (abs(x[0]) ** -0.5,), 2.0, [-0.5], ("x",), method)
    exact = (1.5 * (2.0 - 0.5**1.5 / 1.5)) ** (2 / 3)
    assert fast.status == Status.INACCURATE
    assert fast.points == pytest.approx([exact], rel=0.05)
