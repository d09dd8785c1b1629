"""Invariant circles over a parameter, and Arnold tongues against extrema computed by SciPy."""

from math import cos, pi, sin

import numpy as np
import pytest
from cases import quotient
from scipy.optimize import brentq, minimize_scalar

from cellmap import angle, discrete_map
from cellmap.bifurcations import CircleStatus, arnold_tongue, continue_circle


def delayed(a=2.18):
    return discrete_map(lambda x, p: (p.a * x[0] * (1 - x[1]) + p.e * x[0] ** 2, x[0]), {"a": a, "e": 0.0}, ("x", "y"))


def circle_map(k):
    return discrete_map(
        lambda x, p: (x[0] + p.omega - p.k / (2 * pi) * sin(2 * pi * x[0]),),
        {"omega": 0.5, "k": k},
        (angle("x", "", 1.0, 0.0),),
    )


def frequency(x0, p, q, k):
    """Return omega of the orbit of the circle map through x0 with the rotation number p/q."""

    def missed(omega):
        x = x0
        for _ in range(q):
            x += omega - k / (2 * pi) * sin(2 * pi * x)
        return x - x0 - p

    return float(brentq(missed, p / q - 0.2, p / q + 0.2, xtol=1e-15))


def borders(p, q, k):
    places = np.linspace(0.0, 1.0, 12 * q)
    found = [frequency(x, p, q, k) for x in places]
    step, ends = places[1], []
    for sign in (1.0, -1.0):
        x = places[int(np.argmin(sign * np.array(found)))]
        best = minimize_scalar(
            lambda v, s=sign: s * frequency(v, p, q, k),
            bounds=(x - step, x + step),
            method="bounded",
            options={"xatol": 1e-8},
        )
        ends.append(sign * best.fun)
    return ends


RATIOS = [(p, q) for q in range(2, 10) for p in range(1, q) if np.gcd(p, q) == 1]
FEW = {(1, 2), (2, 5), (1, 9)}


@pytest.mark.parametrize(
    ("p", "q"), [pytest.param(*r, marks=pytest.mark.thorough if r in FEW else pytest.mark.slow) for r in RATIOS]
)
def test_tongues_of_the_sine_circle_map(p, q):
    window = (p / q - 0.08, p / q + 0.08)
    tongue = arnold_tongue(circle_map(0.8), p, q, ("omega", "k"), window, (0.5, 0.95), [0.1], step=0.1)
    np.testing.assert_allclose(tongue.values, borders(p, q, 0.8), atol=1e-12)
    for curve, side in ((tongue.left, 0), (tongue.right, 1)):
        ends = curve.values[[0, -1]]
        for omega, k in ends[(ends[:, 0] > window[0] + 1e-9) & (ends[:, 0] < window[1] - 1e-9)]:
            np.testing.assert_allclose(omega, borders(p, q, float(k))[side], atol=1e-12)


def test_the_widest_tongue_has_a_closed_form():
    """It ends at omega = +-k/(2 pi); steps are a fiftieth of the intervals by default."""
    tongue = arnold_tongue(circle_map(0.8), 0, 1, ("omega", "k"), (-0.2, 0.2), (0.5, 0.95), [0.1])
    np.testing.assert_allclose(tongue.values, [-0.4 / pi, 0.4 / pi], rtol=1e-12)
    for curve in (tongue.left, tongue.right):
        np.testing.assert_allclose(np.abs(curve.values[:, 0]), curve.values[:, 1] / (2 * pi), rtol=1e-9)
        steps = np.linalg.norm(np.diff(curve.values, axis=0) / [0.4, 0.45], axis=1)
        assert 0.005 < steps.max() <= 0.0201


def test_a_tongue_of_an_angle_that_turns_backwards():
    """With damping b, orbits with one full rotation backwards are fixed points from w = 2 pi - k/(1 - b) to + it."""

    def image(x, p):
        y = p.b * x[1] + p.k * sin(x[0])
        return x[0] - p.w - y, y

    damped = discrete_map(image, {"w": 6.0, "k": 0.6, "b": 0.25}, (angle("x"), "y"))
    tongue = arnold_tongue(damped, -1, 1, ("w", "k"), (5.0, 7.5), (0.5, 0.7), [0.1, 0.0], step=0.5)
    np.testing.assert_allclose(tongue.values, [2 * pi - 0.8, 2 * pi + 0.8], rtol=1e-12)
    assert tongue.orbit.rotations == (-1, 0)


def test_the_circle_of_the_delayed_logistic_map():
    # Aronson, Chory, Hall, McGehee (1982): a circle is born at a = 2 with the rotation number 1/6.
    values = np.array([2.002, 2.004, 2.05, 2.1, 2.17, 2.19, 2.25])
    branch = continue_circle(delayed(), "a", values, [0.5, 0.4])
    assert branch.status[:5] == (CircleStatus.SMOOTH,) * 5
    assert branch.status[5:] == (CircleStatus.LOCKED, CircleStatus.BROKEN)
    assert branch.loss_of_smoothness == (2.19, 2.25)
    first, second = branch.rotation[:2]
    assert 2.0 * first - second == pytest.approx(1.0 / 6.0, abs=2e-6)  # linear in a - 2
    assert (np.diff(branch.rotation[:6]) < 0.0).all()
    assert branch.period[5] == 7
    assert branch.rotation[5] == pytest.approx(1.0 / 7.0, abs=1e-15)
    assert (branch.invariance_errors[:5] < 1e-7).all()
    # The mean of the turns around the mean of a long orbit, without weights.
    x, y, places = 0.5, 0.4, []
    for k in range(42000):
        x, y = 2.1 * x * (1.0 - y), x
        places += [(x, y)] if k >= 2000 else []
    shift = np.array(places) - np.mean(places, axis=0)
    turns = np.diff(np.arctan2(shift[:, 1], shift[:, 0]) / (2 * pi)) % 1.0
    assert branch.rotation[3] == pytest.approx(turns.mean(), abs=3e-5)
    # Closer to the loss of smoothness the curve is analytic on a narrower strip.
    assert branch.decay[4] < 0.5 * branch.decay[2]


@pytest.mark.thorough
def test_a_narrow_tongue_is_found_from_orbits_that_have_not_settled():
    axes = (1 / 3 - 0.05, 1 / 3 + 0.05), (0.2, 0.9)
    tongue = arnold_tongue(circle_map(0.3), 1, 3, ("omega", "k"), *axes, [0.1], transient=50, periods=500, step=0.1)
    np.testing.assert_allclose(tongue.values, borders(1, 3, 0.3), atol=1e-12)


@pytest.mark.parametrize("c", [0.3, 0.6])
def test_the_decay_of_a_circle_in_closed_form(c):
    """The unit circle in the coordinate z = w / (1 - c w), whose Fourier series is geometric."""

    def mapped(x, p):
        u, v = quotient(x[0], x[1], 1 + p.c * x[0], p.c * x[1])
        size = 1 + p.q * (1 - u * u - v * v)
        u, v = size * (u * cos(1) - v * sin(1)), size * (u * sin(1) + v * cos(1))
        return quotient(u, v, 1 - p.c * u, -p.c * v)

    exact = discrete_map(mapped, {"c": c, "q": 0.2}, ("x", "y"))
    branch = continue_circle(exact, "q", [0.1, 0.2, 0.3], [1.0, 0.1])
    np.testing.assert_allclose(branch.decay, -np.log(c), rtol=0.02)
    np.testing.assert_allclose(branch.rotation, 1.0 / (2.0 * pi), atol=1e-12)
