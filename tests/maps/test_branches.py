"""Right-hand sides with branches: kinks, jumps, sliding motions, roots and poles, in closed form or by SciPy."""

import math
from math import asin, ceil, cos, exp, expm1, floor, hypot, log, log1p, pi, sin, sqrt, tanh

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from two_tiers import at_once

from cellmap import ForcedSystem, Status, discrete_map, stroboscopic_map
from cellmap.maps import Impact, ToleranceWarning, jacobian


def strobe(rhs, period, dimension=2, tolerance=1e-9, **options):
    system = ForcedSystem(rhs, {}, period, ("x", "v", "z")[:dimension], **options)
    return stroboscopic_map(system, rtol=tolerance, atol=tolerance)


def image(rhs, period, place, tolerance=1e-9, **options):
    orbits = strobe(rhs, period, len(place), tolerance, **options).iterate(place, 1)
    assert orbits.status == Status.OK
    return orbits.points


def by_scipy(rhs, period, place):
    """A thousand steps and more, so that no feature is passed over."""
    kept = {"rtol": 1e-12, "atol": 1e-13, "max_step": period / 1000}
    return solve_ivp(lambda t, x: rhs(t, x, None), (0.0, period), place, "DOP853", **kept).y[:, -1]


def steps_at(nearest):
    return lambda t, x, p: (0.3 - nearest(x[0]),)


def half_and_half(first):
    """x' = 1 in the first half of the unit of time, -x in the second."""
    return lambda t, x, p: (1.0 if first(t) else -x[0],)


def rate_of(function):
    return lambda t, x, p: (function(x[0]),)


def one_side_branches(side):
    """x' = -1 above zero; below, 2 or 1/2 as y passes 1; or the mirror image.

    Both sides push back onto x = 0: with the part p of the upper side, -p + (1 - p) r = 0, p = r/(1 + r).  y' is 1
    above and 0 below, so y grows by p: from t = 1/2 on by 2/3 up to y = 1, after another 3/4, and by 1/3 from there on.
    """

    return lambda t, x, p: (-side, 1.0) if side * x[0] > 0.0 else (side * (2.0 if x[1] < 1.0 else 0.5), 0.0)


def harvest(t, x, p):
    """A quarter of each year a population is harvested, down to a threshold, below which it recovers.

    It falls to the threshold by x' = -2 x^2, stays there, and grows by the logistic law from t = 1/4.
    """
    return (x[0] * (1.5 - 2.0 * x[0]) - (1.5 * x[0] if t % 1.0 < 0.25 and x[0] > 0.4 else 0.0),)


def grown(x, time):
    return 0.75 / (1.0 + (0.75 / x - 1.0) * exp(-1.5 * time))


def pushed_off(t, x, p):
    """x' = 1 below zero; above, -1 below the ramp t - 1 and 2 above it, which falls from 1 to -1 at t = 2.

    From -5/4 to the surface at t = 5/4, at rest there up to t = 2, and from then on x = 2 (t - 2).
    """
    return ((2.0 if x[0] > t % 2.0 - 1.0 else -1.0) if x[0] > 0.0 else 1.0,)


def taken_along(t, x, p):
    """x' = -2 above the ramp t - 1, which falls from 1 to -1 at t = 2, and 2 below it: x slides with it twice."""
    return (-2.0 if x[0] > t % 2.0 - 1.0 else 2.0,)


def clipped(t, x, p):
    """v' = -v from -1.7 to -1; then v' = -v - 0.75 grows from 1/4 at -1, up to v = -0.75/1.1."""
    return (-x[0] - (np.clip(-1.1 * x[0], -0.5, 0.75) if x[0] > -1.0 else 0.0),)


def pair(first, second):
    return lambda t, x, p: (first(x[0], x[1]), second(x[0], x[1]))


def two_rates(x):
    """Two falls by 0.8 down to the root -5 of x + x^2/5, and by 0.809 below it."""
    return -0.8 + min(-x, -0.009 if x + 0.2 * x**2 > 0 else 0.0)


CASES = {
    # The ramp falls at t = 1 while x < 2, where it does not count; from x = 2 at t = 1.25 on it is t - 1.
    "ramp on one side": (lambda t, x, p: ((t % 1.0) if x[0] > 2.0 else 1.6,), 2.0, 0.0, 2.0 + 0.5 * (1.0 - 0.25**2)),
    # x grows by 1 up to x = 2.5; from there on x' = floor(x), which is 2 up to x = 3 and then 3.
    "stairs on one side": (rate_of(lambda x: float(floor(x)) if x > 2.5 else 1.0), 3.0, 0.0, 3.0 + 3.0 * (0.5 - 0.25)),
    "minimum": (rate_of(two_rates), 8.0, -1.5, -5.0 - 0.809 * (8.0 - 3.5 / 0.8)),
    "inner branch": (clipped, log(1.7) + 0.5, -1.7, -0.75 - 0.25 * exp(-0.5)),
    "branch below a sliding motion": (one_side_branches(1.0), 3.0, (0.5, 0.0), (0.0, 1.0 + (3.0 - 1.25) / 3.0)),
    "surface that comes to push": (pushed_off, 4.0, -1.25, 4.0),
    "surface that jumps away": (taken_along, 4.0, -0.5, 1.0),
    "surface that ends": (harvest, 1.0, 0.45, grown(0.4, 0.75)),
    "surface of two years": (harvest, 2.0, 0.45, grown(1.0 / (1.0 / grown(0.4, 0.75) + 2.0 * 0.25), 0.75)),
    "no sliding": (lambda t, x, p: ((-1.0 if x[0] > 0.0 else 1.0) + 0.5 * cos(t),), 2 * pi, 9.0, 9.0 - 2 * pi),
    "floor of the state, above": (rate_of(lambda x: 1.0 if floor(x) < 0 else 0.0), 1.0, 0.2, 0.2),
    "sign of a maximum, passed": (rate_of(lambda x: 0.5 + np.sign(max(x, 0.0))), 1.0, -0.25, 0.75),
    "minimum that is zero": (rate_of(lambda x: 1.0 if min(x, 0.0) < 0 else 0.25), 1.0, -0.5, 0.125),
    "sign of a floor": (rate_of(lambda x: 0.5 + np.sign(floor(x))), 1.0, 0.2, 0.7),
    "int, passed": (rate_of(lambda x: 0.4 - int(x)), 1.0, -1.1, (1.0 - 0.1 / 1.4) * 0.4 - 1.0),
    "trunc": (rate_of(lambda x: 0.5 - np.trunc(x)), 1.0, 0.8, 1.0),
    "round": (steps_at(round), 2.0, 1.7, 0.5),
    "np.rint": (steps_at(np.rint), 2.0, 1.7, 0.5),
    "round to tenths": (rate_of(lambda x: 0.03 - np.round(x, 1)), 4.0, 0.0, 0.05),
    "square wave": (half_and_half(lambda t: floor(2.0 * t) % 2 < 1), 1.0, 0.2, 0.7 * exp(-0.5)),
    "square wave by a power": (half_and_half(lambda t: (-1.0) ** floor(2.0 * t) > 0), 1.0, 0.2, 0.7 * exp(-0.5)),
    # x is held at 1, or at 0, by a step or a relay until y passes zero at t = 1/2; then the surface moves by 1/2.
    "step falls": (
        pair(lambda x, y: 0.3 - floor(x + 0.5 * floor(y)), lambda x, y: -1.0),
        1.0,
        (1.2, 0.5),
        (1.15, -0.5),
    ),
    "relay falls": (
        pair(lambda x, y: 0.3 - np.sign(x + 0.5 * floor(y)), lambda x, y: -1.0),
        1.0,
        (0.0, 0.5),
        (0.5, -0.5),
    ),
    # y rests at zero from t = 0.1 on, where both signs are 0.3: x' = -0.3 after x' = -1.
    "multiple of a sign": (
        pair(lambda x, y: -np.sign(y), lambda x, y: 0.3 - np.sign(2.0 * y)),
        1.0,
        (0.0, 0.07),
        (-0.37, 0.0),
    ),
    "end of a domain": (rate_of(lambda x: -asin(min(x, 1.0))), 0.4 / asin(1.0), 1.4, 1.0),
}


LATER = (
    "stairs on one side",
    "branch below a sliding motion",
    "surface that jumps away",
    "surface that ends",
    "floor of the state, above",
    "minimum that is zero",
    "sign of a floor",
    "trunc",
    "np.rint",
    "square wave",
    "step falls",
)


@pytest.mark.parametrize("name", at_once([name for name in CASES if name not in LATER], later=LATER))
def test_images_in_closed_form(name):
    rhs, period, place, exact = CASES[name]
    found = image(rhs, period, np.atleast_1d(place))
    error = 1e-8 if name in ("minimum", "no sliding") else 1e-9
    assert found == pytest.approx(np.atleast_1d(exact), abs=error)


@pytest.mark.parametrize("place", [[0.2, 0.0], [1.8, 0.0], [1.0, 0.0], [-1.3, 0.0]])
@pytest.mark.parametrize("steps", at_once([floor], later=[lambda x: ceil(x) - 1.0, lambda x: x - x % 1.0]))
def test_a_quantised_feedback_holds_the_state_at_a_step(place, steps):
    """x' = 1/2 - floor(x) pushes back onto x = 1 from both sides, where y' is the mean of 0 and 1 (Filippov)."""
    found = image(lambda t, x, p: (0.5 - steps(x[0]), steps(x[0])), 4.0, place)
    time, y = {0.2: (1.6, 0.0), 1.8: (1.6, 1.6), 1.0: (0.0, 0.0)}.get(place[0], (0.0, 0.0))
    if place[0] == -1.3:  # 0.3 at the speed 2.5, then 1 at 1.5, 1 at 0.5
        time, y = 0.3 / 2.5 + 1.0 / 1.5 + 1.0 / 0.5, -2.0 * 0.3 / 2.5 - 1.0 / 1.5
    assert found == pytest.approx([1.0, y + 0.5 * (4.0 - time)], abs=1e-9)


def forced_steps(t, x, p):
    return 0.5 + 0.8 * sin(t) - floor(x[0]), floor(x[0])


def test_a_force_takes_the_state_off_a_step():
    """It stays at x = 1 while the force a is between 0 and 1, is above while t1 < t < t2, and below from t3 on."""
    integral = lambda t: 0.5 * t + 0.8 * (1.0 - cos(t))  # noqa: E731
    t1, t3 = asin(0.625), pi + asin(0.625)
    t2 = brentq(lambda t: integral(t) - integral(t1) - (t - t1), pi / 2, t3, xtol=1e-14)
    y = integral(t1) + (t2 - t1) + integral(t3) - integral(t2)
    expected = [1.0 + integral(2 * pi) - integral(t3), y]
    assert image(forced_steps, 2 * pi, [1.0, 0.0]) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    "larger", at_once([max], later=[np.maximum, lambda a, b: -min(-a, -b), lambda a, b: 0.5 * (a + b + abs(a - b))])
)
def test_the_larger_of_a_number_and_a_sign(larger):
    """x' = -1 above zero and a = 0.2 + 0.1 sin t below; at rest y' is the weight of the side above, a/(1 + a).

    The mean of 1/(1 + a) over a period is 1/sqrt(1.2^2 - 0.1^2).
    """

    def rhs(t, x, p):
        return -larger(-0.2 - 0.1 * sin(t), np.sign(x[0])), (1.0 if x[0] > 0.0 else 0.0)

    found = image(rhs, 2 * pi, [0.0, 0.0])
    assert found == pytest.approx([0.0, 2 * pi * (1.0 - 1.0 / (1.2**2 - 0.1**2) ** 0.5)], abs=1e-9)


@pytest.mark.parametrize("power", at_once([0.5], later=[1.5, 1 / 3]))
@pytest.mark.parametrize("tolerance", at_once([1e-9], later=[1e-6]))
def test_powers_of_a_distance_that_passes_zero(power, tolerance):
    """x = t - 1/3, so that v is the integral of |x| to a power: its derivatives have poles at zero."""
    found = image(lambda t, x, p: (1.0, abs(x[0]) ** power), 1.0, [-1 / 3, 0.0], tolerance)
    exact = ((1 / 3) ** (power + 1) + (2 / 3) ** (power + 1)) / (power + 1)
    assert found == pytest.approx([2 / 3, exact], abs=2 * tolerance)


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


@pytest.mark.parametrize("tolerance", at_once([1e-9], later=[1e-6, 1e-12]))
@pytest.mark.parametrize("phase", at_once([0.37, 0.5], later=[0.1, 0.93]))
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


def test_of_two_numbers_that_are_as_near_the_even_one():
    rounded = discrete_map(lambda x, p: (round(x[0]) + 0.0, np.round(x[1])), {}, ("x", "y"))
    places = np.array([[0.5, 1.5], [2.5, -0.5], [-1.5, 3.5], [0.49, 1.51]])
    np.testing.assert_array_equal(rounded(places), np.round(places))


def test_a_branch_that_changes_at_an_impact():
    """A body falls with a = 0.7 and rises with a = 1.3, as dry friction has it, and bounces once."""
    bounce = Impact(lambda t, x, p: x[0], lambda t, x, p: (x[0], -0.7 * x[1]))
    system = ForcedSystem(lambda t, x, p: (x[1], -1.0 - 0.3 * np.sign(x[1])), {}, 1.0, ("x", "v"), impacts=[bounce])

    def exact(x, v):
        speed = sqrt(v * v + 1.4 * x)
        fall, rise = (v + speed) / 0.7, 0.7 * speed
        rest = 1.0 - fall
        assert 0 < rest < rise / 1.3
        return np.array([rise * rest - 0.65 * rest**2, rise - 1.3 * rest])

    place, step = np.array([0.5, -1.0]), 1e-6
    strobe = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
    assert strobe(place) == pytest.approx(exact(*place), abs=1e-12)
    columns = [(exact(*(place + e)) - exact(*(place - e))) / (2 * step) for e in step * np.eye(2)]
    np.testing.assert_allclose(jacobian(strobe, place), np.stack(columns, axis=-1), atol=1e-8)


@pytest.mark.parametrize(
    "function",
    [
        lambda x, p: ((p.r * x[0] if x[0] < 0.5 else p.r * (1.0 - x[0])),),
        lambda x, p: (p.r * min(x[0], 1.0 - x[0]),),
        lambda x, p: ((p.r * x[0]) % 1.0,),
        lambda x, p: (x[0] - floor(p.r * x[0]) / 2.0,),
        lambda x, p: (float(np.sign(x[0] - 0.5)) * p.r * (0.25 <= x[0] <= 0.75),),
        lambda x, p: (np.clip(p.r * x[0], 0.25, np.heaviside(x[0] - 0.5, 0.5)),),
        lambda x, p: (int(p.r * (x[0] - 0.5)) + math.fmod(p.r * (x[0] - 0.5), 1.0),),
        lambda x, p: (math.copysign(p.r, x[0] - 0.5) + math.trunc(3.0 * x[0]) + math.ceil(p.r * x[0]) // 2,),
        lambda x, p: (np.where(x[0] >= 0.5, p.r, -abs(x[0] - 0.3)),),
        lambda x, p: (sorted((x[0], 0.5, 1.0 - x[0]))[1],),
    ],
)
def test_discrete_maps_with_branches_are_what_python_computes(function):
    """Exactly, on either side and where numbers are equal."""
    point_map = discrete_map(function, {"r": 1.75}, ("x",))
    assert point_map.unknown_formulas == ""
    parameters = type("P", (), {"r": 1.75})
    for x in (0.0, 0.25, 0.3, 0.5, 0.7499, 0.75, 1.0, 0.123):
        expected = float(function((x,), parameters)[0])
        assert point_map([x])[0] == pytest.approx(expected, rel=1e-15, abs=1e-16), x


@pytest.mark.parametrize(
    ("rates", "period", "place", "status"),
    [
        # Several jumps at one surface: Filippov's solution has one weight for both, and each mode another one.
        (lambda x: (-ceil(x[1]), -0.3 - floor(x[1])), 1.0, (0.0, 0.07), Status.INACCURATE),
        (lambda x: (-floor(2.0 * x[1]), -0.3 - floor(x[1])), 1.0, (0.0, 0.07), Status.INACCURATE),
        # y rests at 1, where floor(x + floor(y)/2) is 0 below the step and 1 above: a mode has one of them.
        (
            lambda x: (-1.0, 0.5 - floor(x[1]) + 0.4 * floor(x[0] + 0.5 * floor(x[1])), floor(x[1])),
            0.4,
            (0.95, 0.9, 0.0),
            Status.INACCURATE,
        ),
        # Signs and whole parts jump where y comes to rest: more steps change the first digit of x, which is finite.
        (lambda x: (-np.sign(x[1]), -0.3 - floor(x[1])), 1.0, (0.0, 0.07), Status.OUT_OF_STEPS),
    ],
)
def test_what_has_no_image_is_reported(rates, period, place, status):
    with pytest.warns(ToleranceWarning, match="out of steps|did not meet the tolerance"):
        assert strobe(lambda t, x, p: rates(x), period, len(place)).iterate(place, 1).status == status


def contact(t, x, p):
    """A force that is there where the depth of the contact, which is never negative, is positive."""
    depth = max(x[0] - 1.0, 0.0)
    force = 20.0 * depth + 0.8 * x[1] if depth > 0 else 0.0
    return x[1], -x[0] - 0.1 * x[1] - force + 0.8 * cos(t)


def corner(t, x, p):
    """Distance from the origin, nearer and nearer by: series converge no farther than the origin is away."""
    r = hypot(x[0], x[1])
    return 1.0 + (0.5 * log1p(r - 0.5) if r > 0.5 else 0.0), 0.1 * x[0]


def bell(t, x, p):
    """A short push where x passes zero, beside a kink far away."""
    return x[1], -x[0] + 3.0 * exp(-400.0 * x[0] ** 2) - 0.3 * abs(x[0] - 0.9) + 0.2 * cos(t)


def step(t, x, p):
    """A force that changes its sign within a tenth."""
    return x[1], -tanh(40.0 * x[0]) - 0.1 * max(x[1], -0.2) + 0.3 * cos(t)


def hidden_in_the_condition(t, x, p):
    """A kink at x = tanh(30 v), whose series are those of a constant where v is far from zero."""
    return x[1], -x[0] - 0.4 * abs(x[0] - 0.9 * tanh(30.0 * x[1])) + 0.5 * cos(t)


BY_SCIPY = {
    "contact": (contact, 2 * pi, (0.5, 0.0), 2e-6),
    # Free fall from height 1 onto a spring of force x**1.5.
    "contact of Hertz": (lambda t, x, p: (x[1], 40.0 * max(-x[0], 0.0) ** 1.5 - 1.0), 2.5, (1.0, 0.0), 1e-8),
    **{f"corner at {offset}": (corner, 2.0, (-1.0, offset + 0.05), 2e-9) for offset in (1e-1, 1e-2, 1e-4)},
    # A negative radius is outside of the domain; the constructor and the compiler pass it by.
    "powers": (lambda t, x, p: (x[1], x[0] ** -4.2 - x[0] ** -3.0 - 0.1 * x[1]), 1.0, (1.2, 0.0), 2e-9),
    "small numbers": (rate_of(lambda x: -1e9 * expm1(1e-9 * x) + 0.1 * abs(x + 5.0)), 1.0, (1.0,), 1e-9),
    "bell": (bell, 2 * pi, (-1.7, 1.3), 2e-8),
    "step": (step, 2 * pi, (1.2, -0.9), 2e-8),
    "hidden in the condition": (hidden_in_the_condition, 2 * pi, (0.4, 2.0), 2e-8),
    # No displacement brings the state onto the surface where tanh'(x) is 1e-13.
    "all but a surface in time": (
        lambda t, x, p: (x[1], abs(sin(4.233 * t) + tanh(x[0]))),
        2 * pi / 4.233 * 3,
        (1.5820062840014977, 1.1642603715907947),
        3e-8,
    ),
    # It counts where v > 0; x falls by three steps before that, from then on SciPy's steps are good to 1e-5.
    "stairs that have moved on": (
        lambda t, x, p: (x[1], -1.8 * x[0] + (0.0 if x[1] < 0.0 else floor(-0.34 - 1.819 * x[0]))),
        3.92208820672883,
        (-1.2671640964227877, 1.0968864044205793),
        1e-4,
    ),
}


@pytest.mark.parametrize("name", at_once(["contact", "corner at 0.01", "powers"], later=BY_SCIPY))
def test_images_are_those_of_scipy(name):
    rhs, period, place, error = BY_SCIPY[name]
    assert image(rhs, period, place) == pytest.approx(by_scipy(rhs, period, place), abs=error)


LATE = pytest.mark.thorough


def wakes(t, x, p):
    return x[1], -x[0] + ((0.8 if x[1] < 0.5 else -0.3 * x[0]) if x[0] > 0.2 else 0.1) + 0.4 * sin(t)


def machine(t, x, p):
    wall, stairs = 5.0 * (x[0] - 0.3) if x[0] > 0.3 else 0.0, 0.3 * floor(2.0 * x[0] + 0.1)
    chopper = 0.8 if x[0] < 2.0 * ((t / pi) % 1.0) - 1.0 else 0.0
    return x[1], cos(t) - 0.2 * x[1] - x[0] - wall - chopper - stairs


def tanks(t, x, p):
    between = 0.5 * np.sign(x[0] - x[1]) * np.sqrt(abs(x[0] - x[1]))
    return 0.3 * (1 + sin(2 * pi * t)) - between, between - 0.4 * np.sqrt(max(x[1], 0.0))


@pytest.mark.parametrize(
    ("rhs", "period", "points", "tolerance", "size", "error"),
    [
        pytest.param(wakes, 2 * pi, [[-0.7, 1.4], [0.9, -0.8], [-1.2, 0.3]], 1e-12, 1e-6, 1e-4, marks=LATE),
        # Neighbours of a state that has come to a step are on it as well.
        (forced_steps, 2 * pi, [[0.2, 0.0], [1.5, 0.0], [2.7, 0.1]], 1e-11, 1e-5, 1e-5),
        pytest.param(machine, 2 * pi, np.random.default_rng(4).uniform(-2, 2, (10, 2)), 1e-13, 1e-6, 1e-5, marks=LATE),
        (tanks, 1.0, [[0.5, 0.55]], 1e-12, 1e-6, 1e-4),  # by differences: levels meet, where roots have poles
        (tanks, 1.0, [[2.0, 0.5]], 1e-12, 1e-6, 1e-8),
    ],
)
def test_derivatives_are_those_of_differences(rhs, period, points, tolerance, size, error):
    exact, points = strobe(rhs, period, tolerance=tolerance), np.array(points)
    columns = [(exact(points + size * e) - exact(points - size * e)) / (2.0 * size) for e in np.eye(2)]
    np.testing.assert_allclose(jacobian(exact, points), np.stack(columns, axis=-1), rtol=0.0, atol=error)


def test_equality_is_that_of_values():
    def pendulum(t, x, p):
        q, v = x
        return v, -q * (1.0 if q == 0 else math.sin(q) / q) - (0.1 * v if p.kind == 1 else 0.0)

    def smooth(t, x, p):
        return x[1], -math.sin(x[0]) - 0.1 * p.kind * x[1]

    places = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.5]]  # at rest, and on the surface where sin(q) / q is written apart
    for kind in (1.0, 0.0):
        first, second = (
            stroboscopic_map(ForcedSystem(rhs, {"kind": kind}, 2.0, ("q", "v"))) for rhs in (pendulum, smooth)
        )
        assert first.unknown_formulas == ""
        assert np.abs(first(places) - second(places)).max() < 1e-9
        assert np.abs(jacobian(first, places) - jacobian(second, places)).max() < 1e-7
    image = discrete_map(
        lambda x, p: (7.0 if x[0] != 0.5 else 1.0, np.where(x[1] == x[0], 3.0, x[1] or -1.0)), {}, ("x", "y")
    )
    assert image([[0.5, 0.0], [0.5, 0.5], [0.25, 2.0]]).tolist() == [[1.0, -1.0], [1.0, 3.0], [7.0, 2.0]]
