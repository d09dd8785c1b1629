"""Right-hand sides with SciPy's signature."""

import functools
from math import pi
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cellmap import ForcedSystem, discrete_map, stroboscopic_map

Y = (0.5, 0.3)
K = np.array([[0.0, 1.0], [-1.0, -0.2]])


def duffing(t: float, y: Any, delta: float, gamma: float, omega: float = 1.0) -> Any:
    dy = np.zeros(2)
    dy[0] = y[1]
    dy[1] = y[0] - y[0] ** 3 - delta * y[1] + gamma * np.cos(omega * t)
    return dy


def any_number(t: float, y: Any, *args: float) -> Any:
    return duffing(t, y, *args)


def in_slices(t: float, y: Any) -> Any:
    q, v = y[:1], y[1:]
    return np.concatenate([v, q - q**3 - 0.15 * v + 0.2 * np.cos(t)])


def linear(t: float, y: Any, stiffness: Any, drive: Any) -> Any:
    return stiffness @ y + np.array([0.0, drive(t)])


@pytest.mark.parametrize(
    ("fun", "args", "params", "names"),
    [
        (duffing, (0.15, 0.2), None, ["delta", "gamma", "omega"]),
        (duffing, (0.15,), {"omega": 1.0, "gamma": 0.2}, ["delta", "gamma", "omega"]),
        (any_number, (), {"d": 0.15, "g": 0.2, "w": 1.0}, ["d", "g", "w"]),
        (in_slices, (), None, []),
        (functools.partial(duffing, delta=0.15, gamma=0.2), (), None, []),
        (linear, (K, np.cos), None, [f"stiffness[{i}, {j}]" for i in range(2) for j in range(2)]),
    ],
)
def test_what_solve_ivp_takes_is_taken(fun: Any, args: Any, params: Any, names: list[str]) -> None:
    system = ForcedSystem.from_scipy(fun, args, period=2 * pi, coordinates=("q", "v"), params=params)
    assert list(system.params) == names
    strobe = stroboscopic_map(system)
    assert strobe.unknown_formulas == ""
    given = (*args, *(params or {}).values()) if fun is not duffing else (0.15, 0.2, 1.0)
    found = solve_ivp(fun, (0.0, 2 * pi), Y, "DOP853", rtol=1e-11, atol=1e-11, args=given).y[:, -1]
    assert strobe(Y) == pytest.approx(found, abs=1e-8)


@pytest.mark.parametrize(
    ("fun", "args", "params", "words"),
    [
        (3, (), None, "fun=3: give a function"),
        (duffing, (0.15,), None, "asks for gamma"),
        (duffing, (1.0, 2.0, 3.0, 4.0), None, "takes 3 arguments besides t and y"),
        (duffing, (1.0, 2.0), {"mass": 1.0}, "no argument 'mass'; there are delta"),
        (duffing, (1.0, 2.0), {"delta": 1.0}, "args holds delta already"),
        (any_number, (1.0, 2.0), None, "name them by params"),
    ],
)
def test_arguments_are_checked(fun: Any, args: Any, params: Any, words: str) -> None:
    with pytest.raises((TypeError, ValueError), match=words):
        ForcedSystem.from_scipy(fun, args, period=2 * pi, coordinates=("q", "v"), params=params)


def test_a_refusal_says_the_line_that_works() -> None:
    params = {"delta": 0.15, "gamma": 0.2, "omega": 1.0}
    with pytest.raises(TypeError, match=r"lambda t, x, p: duffing\(t, np.array\(x\), p.delta, p.gamma, p.omega\)"):
        ForcedSystem(lambda_less(duffing), params, 2 * pi, ("q", "v"))
    with pytest.raises(TypeError, match=r"lambda t, x, p: in_slices\(t, np.array\(x\)\)"):
        ForcedSystem(in_slices, {}, 2 * pi, ("q", "v"))


def lambda_less(fun: Any) -> Any:
    """Return the function with all of its arguments asked for."""

    def duffing(t: float, y: Any, delta: float, gamma: float, omega: float) -> Any:
        return fun(t, y, delta, gamma, omega)

    return duffing


def unpacked(x: Any, p: Any) -> Any:
    a, b = x
    return b, a


@pytest.mark.parametrize("function", [lambda x, p: (x[1], x[0]), unpacked])
def test_coordinates_in_one_string_are_one_name_for_maps_too(function: Any) -> None:
    with pytest.raises(ValueError, match=r"coordinates='ab'.*\('a', 'b'\)"):
        discrete_map(function, {}, "ab")
