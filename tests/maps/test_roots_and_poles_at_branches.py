"""Branches where a right-hand side is not smooth, or hides a pole that it removes: closed forms, and SciPy."""

from __future__ import annotations

from math import exp, hypot, log1p, pi, sin

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from cellmap import ForcedSystem, Status, stroboscopic_map
from cellmap.maps import Impact, jacobian


def image(rhs, period, place, tolerance=1e-9, **options):
    system = ForcedSystem(rhs, {}, period, ("x", "v")[: len(place)], **options)
    orbits = stroboscopic_map(system, rtol=tolerance, atol=tolerance).iterate(place, 1)
    assert orbits.status == Status.OK
    return orbits.points


@pytest.mark.parametrize("power", [0.5, 1.5, 1 / 3])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
def test_powers_of_a_distance_that_passes_zero(power, tolerance):
    """x = t - 1/3, so that v is the integral of |x| to a power: its derivatives have poles at zero."""
    found = image(lambda t, x, p: (1.0, abs(x[0]) ** power), 1.0, [-1 / 3, 0.0], tolerance)
    exact = ((1 / 3) ** (power + 1) + (2 / 3) ** (power + 1)) / (power + 1)
    assert found == pytest.approx([2 / 3, exact], abs=2 * tolerance)


def test_a_contact_of_hertz():
    """Free fall from height 1 onto a spring of force x**1.5: energy is kept, and the way back takes as long."""
    found = image(lambda t, x, p: (x[1], 40.0 * max(-x[0], 0.0) ** 1.5 - 1.0), 2.5, [1.0, 0.0])
    energy = found[1] ** 2 / 2 + found[0] + 16.0 * max(-found[0], 0.0) ** 2.5
    assert energy == pytest.approx(1.0, abs=1e-8)
    deepest = solve_ivp(
        lambda t, x: (x[1], 40.0 * max(-x[0], 0.0) ** 1.5 - 1.0), (0.0, 2.5), [1.0, 0.0], "DOP853",
        rtol=1e-12, atol=1e-13, max_step=1e-3,
    )  # fmt: skip
    assert found == pytest.approx(deepest.y[:, -1], abs=1e-8)


def gate(v):
    """Opening of a gate (Hodgkin and Huxley 1952) with its limit at zero, as programs have it."""
    return 1.0 - v / 2 if abs(v) < 1e-6 else v / (exp(v) - 1.0)


@pytest.mark.parametrize("begin", [-3.0, 3.0])
def test_a_pole_that_a_branch_removes(begin):
    """On a line through it x is the integral of a function without a pole."""
    way = -2.0 * begin
    found = image(lambda t, x, p: (way, gate(x[0])), 1.0, [begin, 0.0])
    exact = quad(lambda t: gate(begin + way * t), 0.0, 1.0, epsabs=1e-12)[0]
    assert found == pytest.approx([-begin, exact], abs=2e-9)


def test_a_corner_of_a_length():
    """Distance from the origin, nearer and nearer by: series converge no farther than the origin is away."""

    def rhs(t, x, p):
        r = hypot(x[0], x[1])
        return 1.0 + (0.5 * log1p(r - 0.5) if r > 0.5 else 0.0), 0.1 * x[0]

    fine = {"rtol": 1e-12, "atol": 1e-13, "max_step": 1e-3}
    for offset in (1e-1, 1e-2, 1e-4):
        found = image(rhs, 2.0, [-1.0, offset + 0.05])
        exact = solve_ivp(lambda t, x: rhs(t, x, None), (0.0, 2.0), [-1.0, offset + 0.05], "DOP853", **fine)
        assert found == pytest.approx(exact.y[:, -1], abs=2e-9)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("phase", [0.1, 0.37, 0.5, 0.93])
def test_each_kick_happens_once(tolerance, phase):
    """Three kicks at zeros of a sine, which motion as slow as this would be tempted to pass in long steps."""
    kick = Impact(lambda t, x, p: -sin(6 * pi * (t - phase)), lambda t, x, p: (x[0], x[1] + 1.0))
    found = image(lambda t, x, p: (x[1], 0.0 * x[0]), 1.0, [0.0, 0.0], tolerance, impacts=[kick])
    assert found == pytest.approx([sum(1.0 - (phase + j / 3) % 1.0 for j in range(3)), 3.0], abs=2 * tolerance)


def test_a_kick_at_the_end_belongs_to_the_next_period():
    """A latch that a clock sets: at 1e-9 the sine at its end was all but zero, and the latch was set too early."""
    clock = Impact(lambda t, x, p: sin(2 * pi * t), lambda t, x, p: (x[0], 1.0), direction=1, solid=False)
    reached = Impact(lambda t, x, p: 0.55 - x[0], lambda t, x, p: (x[0], 0.0), solid=False)
    for tolerance in (1e-6, 1e-9, 1e-12):
        found = image(
            lambda t, x, p: (1.0 - 0.4 * x[0] if x[1] > 0.5 else -x[0], 0.0), 1.0, [0.3, 0.0], tolerance,
            impacts=[clock, reached],
        )  # fmt: skip
        on = np.log((1 - 0.4 * 0.3) / (1 - 0.4 * 0.55)) / 0.4
        assert found == pytest.approx([0.55 * exp(on - 1.0), 0.0], abs=2 * tolerance)


def test_derivatives_of_maps_with_roots():
    """Levels of two tanks, against differences of images with steps of 1e-6."""

    def rhs(t, x, p):
        between = 0.5 * np.sign(x[0] - x[1]) * np.sqrt(abs(x[0] - x[1]))
        return 0.3 * (1 + sin(2 * pi * t)) - between, between - 0.4 * np.sqrt(max(x[1], 0.0))

    strobe = stroboscopic_map(ForcedSystem(rhs, {}, 1.0, ("a", "b")), rtol=1e-12, atol=1e-12)
    places, step = np.array([[0.5, 0.55], [2.0, 0.5]]), 1e-6
    columns = [(strobe(places + step * e) - strobe(places - step * e)) / (2 * step) for e in np.eye(2)]
    found, differences = jacobian(strobe, places), np.stack(columns, axis=-1)
    assert found[0] == pytest.approx(differences[0], abs=1e-4)  # by differences: levels meet, where roots have poles
    assert found[1] == pytest.approx(differences[1], abs=1e-8)


def test_a_power_outside_its_domain_is_no_complex_number():
    """A negative radius is outside the domain of the right-hand side; the constructor and the compiler pass it by."""
    system = ForcedSystem(lambda t, x, p: (x[1], x[0] ** -4.2 - x[0] ** -3.0 - 0.1 * x[1]), {}, 1.0, ("r", "v"))
    found = stroboscopic_map(system)([1.2, 0.0])
    exact = solve_ivp(system.fun, (0.0, 1.0), [1.2, 0.0], "DOP853", rtol=1e-12, atol=1e-13)
    assert found == pytest.approx(exact.y[:, -1], abs=2e-9)
