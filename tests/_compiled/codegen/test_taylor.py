"""Taylor steps: every recurrence, and the order."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cellmap import ForcedSystem
from cellmap._compiled.codegen.kernel import flow_kernel, frame_kernel, traced_function
from cellmap._compiled.codegen.methods import MOST_WORK, choose_method, taylor_order
from cellmap._compiled.codegen.period import compiled_period
from cellmap._compiled.codegen.taylor import taylor_steps
from cellmap._compiled.codegen.trace import Trace, parameter_record, trace
from cellmap._compiled.kernels.blocks import LANES


def step(traced: Trace, initial_condition: list[float], t: float, h: float, parameters: list[float], order: int) -> Any:
    """Image after one Taylor step, and the error estimate."""
    advance = compiled_period(taylor_steps(traced, order), len(initial_condition), len(parameters))
    block = np.repeat(np.array(initial_condition)[None, :, None], LANES, axis=2)
    errors = np.empty_like(block)
    advance(block, np.array([1]), t, h, np.array(parameters, dtype=float), errors)
    assert (block == block[..., :1]).all()
    return block[0, :, 0], errors[0, :, 0]


def exact(function, initial_condition, t, h, parameters):
    """Image after time h by SciPy's DOP853 in eight small steps or more, right to rounding."""
    p = parameter_record(("k",))(*parameters)
    options = {"method": "DOP853", "rtol": 3e-14, "atol": 1e-16, "max_step": 0.125 * h}
    return solve_ivp(lambda t, y: function(t, tuple(y), p), (t, t + h), initial_condition, **options).y[:, -1]


def one_of_each(t: float, x: Any, p: Any) -> tuple[Any, ...]:
    """Nine equations that hold every operation, with states, time and parameters as operands."""
    a, b, c, d, e, f, g, u, v = x
    return (
        math.sin(a) * math.cos(b) - a * t,
        math.exp(-b) / (1.0 + a * a) + math.cos(t) * math.sin(t),
        math.log(c) - math.sqrt(c) + math.log(2.0 + t),
        math.tan(0.3 * d) - math.tanh(d) + math.atan(d * t),
        math.sinh(0.5 * e) - math.cosh(e * t),
        f**2.5 - f**-2 + (1.0 + t) ** p.k,
        p.k / g - (a - 3.0) / (2.0 + t) + 2.0 / (1.0 + t),
        -u * u * u + math.exp(p.k * t) * u,
        math.sqrt(2.0 + t) * v - math.tanh(t) + math.tan(0.2 * t) + 0.25,
    )


INITIAL_CONDITION = [0.4, -0.3, 1.7, 0.6, 0.2, 1.1, 2.0, 0.5, -0.7]


def test_every_recurrence_and_the_order() -> None:
    traced = trace(one_of_each, 9, ("k",))
    assert traced is not None and traced.is_analytic
    t, order = 0.3, 6
    errors = []
    for h in (0.08, 0.04):
        image, estimate = step(traced, INITIAL_CONDITION, t, h, [0.8], order)
        errors.append(np.abs(image - exact(one_of_each, INITIAL_CONDITION, t, h, [0.8])))
        assert (errors[-1] <= estimate).all()
    # The local error of order 6 falls by 2^7 at half the step; components that are at rounding show no order.
    falling = errors[1] > 1e-12
    assert falling.sum() >= 6
    assert np.log2(errors[0][falling] / errors[1][falling]) == pytest.approx(order + 1, abs=0.6)


def test_the_exponential_is_its_series() -> None:
    traced = trace(lambda t, x, p: (x[0],), 1, ())
    image, estimate = step(traced, [1.0], 0.0, 1.0, [], 12)
    assert image[0] == pytest.approx(sum(1.0 / math.factorial(k) for k in range(13)), rel=1e-15)
    assert estimate[0] == pytest.approx(1.0 / math.factorial(12) + 0.5 / math.factorial(11), rel=1e-14)


def test_a_right_hand_side_of_time_alone() -> None:
    traced = trace(lambda t, x, p: (math.cos(t), 1.0, t * t, 0.0), 4, ())
    image, _ = step(traced, [0.0, 1.0, 2.0, 3.0], 0.5, 0.25, [], 14)
    assert image == pytest.approx(
        [math.sin(0.75) - math.sin(0.5), 1.25, 2.0 + (0.75**3 - 0.5**3) / 3.0, 3.0], rel=1e-15
    )


def test_order_follows_from_the_tolerance() -> None:
    assert [taylor_order(rtol) for rtol in (1e-6, 1e-9, 1e-12)] == [12, 15, 18]
    assert taylor_order(1.0) == 8
    assert taylor_order(1e-14) == 20


def test_auto_takes_the_cheaper_method(problems: Mapping[str, ForcedSystem]) -> None:
    chosen = {
        name: choose_method("auto", traced_function(s.rhs, s.dimension, tuple(s.params)), 1e-9).name
        for name, s in problems.items()
    }
    assert chosen["pendulum, 3 mm"] == chosen["Duffing"] == "Taylor"
    assert chosen["double pendulum"] == "DOP853"
    assert choose_method("auto", None, 1e-9).name == "DOP853"


DIVISORS: dict[str, tuple[Any, str]] = {
    "inertia": (lambda t, x: 2.0 - math.cos(x[0]) ** 2, "Taylor"),
    "number": (lambda t, x: 2.0, "Taylor"),
    "bell": (lambda t, x: 1.0 + 1e4 * x[0] ** 2, "DOP853"),
    "pulse": (lambda t, x: 1.1 + math.cos(t), "DOP853"),
}


@pytest.mark.parametrize(("divisor", "method"), DIVISORS.values(), ids=DIVISORS)
def test_series_divide_by_what_turns(divisor: Any, method: str) -> None:
    """By the inertia of linkages, and not by what may be a narrow bell or pulse."""
    traced = traced_function(lambda t, x, p: (x[1], (math.cos(t) - math.sin(x[0])) / divisor(t, x)), 2, ())
    assert choose_method("auto", traced, 1e-9).name == method


@pytest.mark.thorough
def test_states_alone_are_expanded_up_to_more_work(problems: Mapping[str, ForcedSystem]) -> None:
    """The series of a double pendulum cost less than Runge-Kutta steps, those of its derivatives more.

    Their order is so low that a step stays in the cache of instructions.
    """
    system = problems["double pendulum"]
    traced = traced_function(system.rhs, 4, tuple(system.params))
    assert [choose_method("auto", traced, rtol, False, MOST_WORK).estimate_order for rtol in (1e-6, 1e-12)] == [11, 11]
    assert flow_kernel(system.rhs, 4, tuple(system.params), "auto", 1e-9).method == "Taylor"
    found = frame_kernel(system.rhs, 4, tuple(system.params), 1e-9)
    assert found[0].method == "DOP853"


def test_what_has_no_series_is_refused() -> None:
    for force in (abs, lambda q: 2.0**q, lambda q: 1.0 if q > 0 else -1.0):
        with pytest.raises(ValueError, match=r"method='Taylor' needs .* use method='DOP853'"):
            flow_kernel(lambda t, x, p, f=force: (x[1], -f(x[0])), 2, (), "Taylor", 1e-9)
