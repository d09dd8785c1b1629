"""Failures of the integration are reported, and bad arguments refused."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from math import atan2, cos, inf, nan, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cellmap import CellGrid, ForcedSystem, Status, angle, stroboscopic_map
from cellmap.maps import ToleranceWarning

# Failures are said


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


@pytest.mark.parametrize("form", ["traced", "branching", "as it is"])
def test_a_blow_up_in_finite_time(form: str) -> None:
    """x' = x^2 has x(1) = x0 / (1 - x0): finite for x0 < 1, blown up within the period for x0 > 1."""

    def traced(t: float, x: Any, p: Any) -> tuple[float]:
        return (x[0] ** 2,)

    def branching(t: float, x: Any, p: Any) -> tuple[float]:
        return (x[0] ** 2 if x[0] < 1e300 else 2.0 * x[0] ** 2,)

    def as_it_is(t: float, x: Any, p: Any) -> tuple[float]:
        return (x[0] ** 2 if x[0] != 1e300 else 2.0 * x[0] ** 2,)

    forms = {"traced": traced, "branching": branching, "as it is": as_it_is}
    system = ForcedSystem(forms[form], {}, 1.0, ("x",))
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


def test_stiff_damping_is_met_or_said() -> None:
    """gamma T = 2000: explicit methods need steps of 2.785 / gamma, many more than usual; none is silently wrong."""
    system = ForcedSystem(lambda t, x, p: (x[1], -2000.0 * x[1] - x[0]), {}, 1.0, ("x", "v"))
    fast = 0.5 * (2000.0 + sqrt(2000.0**2 - 4.0))
    slow = 1.0 / fast
    exact = (fast * np.exp(-slow) - slow * np.exp(-fast)) / (fast - slow)
    images = stroboscopic_map(system).iterate([1.0, 0.0], 1)
    assert images.status == Status.OK
    assert images.points[0] == pytest.approx(exact, abs=2e-9)


@pytest.mark.parametrize("period", [1e-6, 1e6])
def test_tiny_and_huge_periods(period: float) -> None:
    """x' = (cos(w t) - x) w in units of the period's own phase: the map is that of w = 1."""

    def rhs(t: float, x: Any, p: Any) -> tuple[float]:
        return ((cos(p.w * t) - x[0]) * p.w,)

    system = ForcedSystem(rhs, {"w": 2 * pi / period}, lambda p: 2 * pi / p.w, ("x",))
    # x(2 pi) = exp(-2 pi) (x0 - 1/2) + 1/2 for x' = cos(s) - x.
    assert stroboscopic_map(system)([3.0]) == pytest.approx(np.exp(-2 * pi) * 2.5 + 0.5, abs=1e-8)


# Bad input


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"system": 3}, TypeError, "system=3: give a ForcedSystem"),
        ({"phase": nan}, ValueError, "phase=nan: give a finite number"),
        ({"phase": "0"}, TypeError, "phase='0': give one real number"),
        ({"rtol": 0.0}, ValueError, "rtol=0.0: give a number of at least 1e-14"),
        ({"rtol": -1e-9}, ValueError, "rtol=-1e-09: give a number of at least 1e-14"),
        ({"rtol": inf}, ValueError, "rtol=inf: give a finite number"),
        ({"atol": 1e-15}, ValueError, "atol=1e-15: give a number of at least 1e-14"),
        ({"atol": None}, TypeError, "atol=None: give one real number"),
        ({"method": "RK4"}, ValueError, "method='RK4': choose one of 'auto', 'DOP853', 'RK45', 'Taylor'"),
        ({"method": None}, ValueError, "method=None: choose one of"),
        ({"method": ["RK45"]}, ValueError, "choose one of"),
        ({"max_steps": 2}, ValueError, "max_steps=2: give a whole number of at least 4"),
        ({"max_steps": 1e4}, TypeError, "max_steps=10000.0: give a whole number"),
        ({"max_steps": True}, TypeError, "max_steps=True: give a whole number"),
    ],
)
def test_bad_arguments_are_refused(
    problems: Mapping[str, ForcedSystem], changes: dict[str, Any], error: type[Exception], message: str
) -> None:
    arguments: dict[str, Any] = {"system": problems["Duffing"], **changes}
    with pytest.raises(error, match=message):
        stroboscopic_map(**arguments)


def test_taylor_refuses_what_has_no_series() -> None:
    system = ForcedSystem(lambda t, x, p: (x[1], -atan2(x[0], 1.0 + x[1] * x[1])), {}, 1.0, ("x", "v"))
    with pytest.raises(ValueError, match="use method='DOP853'"):
        stroboscopic_map(system, method="Taylor")
    assert stroboscopic_map(system).recipe["method"] == "DOP853"


def test_what_cannot_be_compiled_is_refused_clearly() -> None:
    table = {"a": 1.0}

    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -table["a"] * (x[0] if x[0] != 0 else 2.0 * x[0])

    with pytest.raises(TypeError, match="cannot be compiled: write it with plain arithmetic"):
        stroboscopic_map(ForcedSystem(rhs, {}, 1.0, ("x", "v")))


def test_capsizing_ships_end_and_the_others_come_back() -> None:
    """Roll with quadratic damping, branches of abs included: which orbits blow up in a period, by SciPy's RK45."""

    def roll(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -x[0] + x[0] ** 3 - p.d * x[1] - p.q * x[1] * abs(x[1]) + p.f * sin(p.w * t)

    ship = ForcedSystem(roll, {"d": 0.02, "q": 0.1, "f": 0.06, "w": 0.85}, 2 * pi / 0.85, ("angle", "rate"))
    places = CellGrid((-1.2, -1.2), (1.2, 1.2), (8, 8)).centres().reshape(-1, 2)

    def capsized(t: float, x: Any) -> float:
        return abs(x[0]) - 50.0

    capsized.terminal = True  # type: ignore[attr-defined]
    expected = [solve_ivp(ship.fun, (0.0, ship.length), x, events=capsized).status == 1 for x in places]
    images = stroboscopic_map(ship).iterate(places, 1)
    assert 10 < sum(expected) < 54
    assert np.array_equal(np.isin(images.status, [Status.OUT_OF_STEPS, Status.DIVERGED]), expected)
    assert (images.status[~np.array(expected)] == Status.OK).all()
    assert (images.status[expected] == Status.DIVERGED).mean() > 0.9
