"""Right-hand sides of every kind: branches, helpers, loops, functions without vector form."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from two_tiers import at_once

from cellmap import ForcedSystem, discrete_map, stroboscopic_map
from cellmap.maps import Impact, Status, jacobian, section_map

ImagesOf = Callable[..., NDArray[np.float64]]


def test_no_parameters_one_variable_and_an_unforced_flow() -> None:
    decay = ForcedSystem(lambda t, x, p: (-x[0],), {}, 1.0, ("x",))
    for method in ("DOP853", "RK45", "Taylor"):
        assert stroboscopic_map(decay, method=method)([2.0]) == pytest.approx(2.0 * np.exp(-1.0), rel=1e-8)


EQUAL, SINE = np.linspace(-2.0, 2.0, 9), np.sin(np.linspace(-2.0, 2.0, 9)) * 2.0
MANY = np.linspace(-2.0, 2.0, 101)
UNEQUAL, FORCE = [-2.0, -1.0, 0.0, 0.3, 0.5, 1.5, 2.1], [-3.0, -1.0, 0.0, 0.1, 0.2, 0.9, 3.0]
TIMES, DRIVE = np.linspace(0.0, 2 * math.pi, 13), np.cos(np.linspace(0.0, 2 * math.pi, 13))

AT_ONCE = "other distances", "jumps at the ends", "of time, with a period", "computed in place"
FORCES: dict[str, Callable[[float, float], Any]] = {
    "equal distances": lambda t, q: np.interp(q, EQUAL, SINE),
    "a hundred pieces": lambda t, q: np.interp(q, MANY, MANY**3),
    "other distances": lambda t, q: np.interp(q, UNEQUAL, FORCE),
    "jumps at the ends": lambda t, q: np.interp(q, EQUAL, SINE, left=-1.0, right=0.5),
    "of time": lambda t, q: q - np.interp(t % (2 * math.pi), TIMES, DRIVE),
    "of time, with a period": lambda t, q: q - np.interp(t, TIMES[:-1], DRIVE[:-1], period=2 * math.pi),
    "computed in place": lambda t, q: np.interp(q, np.linspace(-2, 2, 5), np.sin(np.linspace(-2, 2, 5))),
    "two of them": lambda t, q: np.interp(q, EQUAL, SINE) + np.interp(q * q, UNEQUAL, FORCE),
}


def pieces(force: Callable[[float, float], Any], state: Any, kinks: int = 400) -> Any:
    """The end of a period by short steps of a method that no kink between two of them disturbs much."""

    def fun(t: float, x: Any) -> Any:
        return x[1], -float(force(t, x[0])) - 0.1 * x[1] + 0.2 * math.cos(t)

    return solve_ivp(fun, (0.0, 2 * math.pi), state, rtol=1e-12, atol=1e-12, max_step=2 * math.pi / kinks).y[:, -1]


@pytest.mark.parametrize("name", at_once(AT_ONCE, later=FORCES))
def test_images_of_flows_are_those_of_scipy(name: str) -> None:
    force = FORCES[name]

    def rhs(t: float, x: Any, p: Any) -> Any:
        return x[1], -force(t, x[0]) - 0.1 * x[1] + 0.2 * math.cos(t)

    point_map = stroboscopic_map(ForcedSystem(rhs, {}, 2 * math.pi, ("q", "v")))
    assert not point_map.unknown_formulas
    points = [[0.3, 0.4], [1.4, 0.2], [-1.7, -1.3]]
    images = point_map.iterate(points, 1)
    assert (images.status == Status.OK).all()
    for point, image in zip(points, images.points, strict=True):
        assert image == pytest.approx(pieces(force, point), abs=2e-8)


@pytest.mark.parametrize("ends", [{}, {"left": -7.0, "right": 9.0}])
def test_values_of_maps_are_those_of_numpy(ends: dict[str, float]) -> None:
    rng = np.random.default_rng(0)
    for count in (1, 2, 3, 64, 300):
        places, values = np.sort(rng.normal(size=count)), rng.normal(size=count)
        points = np.concatenate([rng.normal(scale=1.5, size=500), places])
        found = discrete_map(lambda x, p, a=places, b=values: (np.interp(x[0], a, b, **ends),), {}, ("q",))
        assert found(points[:, np.newaxis])[:, 0] == pytest.approx(np.interp(points, places, values, **ends), abs=1e-13)


def test_slopes_of_maps_are_those_of_the_pieces() -> None:
    found = jacobian(discrete_map(lambda x, p: (np.interp(x[0], UNEQUAL, FORCE),), {}, ("q",)), [[0.4], [-1.5], [9.0]])
    assert found[:, 0, 0] == pytest.approx([0.5, 2.0, 0.0], rel=1e-12)


FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "polyval": lambda q: np.polyval([1.0, -2.0, 0.5], q),
    "logaddexp": lambda q: np.logaddexp(q, 0.5),
    "float_power": lambda q: np.float_power(q + 3.0, 1.5),
    "deg2rad": np.deg2rad,
    "degrees": math.degrees,
    "radians": math.radians,
    "signbit": lambda q: 1.0 * np.signbit(q),
    "fsum": lambda q: math.fsum([q, 1.0, q * q]),
    "functions of arrays": lambda q: np.sin(np.array([q, 1.0])).sum() + np.sum(np.cos(np.array([0.5, q]))),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_of_numpy_have_formulas(name: str) -> None:
    function = FUNCTIONS[name]
    found = discrete_map(lambda x, p: (function(x[0]),), {}, ("q",))
    assert not found.unknown_formulas
    points = np.linspace(-1.9, 1.9, 40)
    expected = [float(function(q)) for q in points.tolist()]
    assert found(points[:, np.newaxis])[:, 0] == pytest.approx(expected, rel=1e-14, abs=1e-15)


K = np.array([[2.0, -1.0], [-1.0, 2.0]])


def in_coordinates(t, x, p):
    a, b, u, v = x
    return u, v, -2.0 * a + b - 0.1 * u - a**3 + p.g * math.cos(t), a - 2.0 * b - 0.1 * v - b**3


def force(t, p):
    return p.g * math.cos(t) * np.array([1.0, 0.0])


ARRAYS = (
    lambda t, x, p: [*x[2:], *(force(t, p) - 0.1 * x[2:] - K @ x[:2] - x[:2] ** 3)],
    lambda t, x, p: x[2:] + tuple(x[:2] @ -K - x[2:] * 0.1 - x[:2] * x[:2] * x[:2] + force(t, p)),
    lambda t, x, p: np.r_[x[2:], (x[::-1][:2] * -0.1 - x[1::-1] @ K - np.power(x[1::-1], 3))[::-1] + force(t, p)],
    lambda t, x, p: np.concatenate([x[[2, 3]], -K.dot(x[:2]) - 0.1 * x.reshape(2, 2)[1] - x[0:2] ** 3 + force(t, p)]),
    lambda t, x, p: (
        x[2],
        x[3],
        *(force(t, p) - K @ (np.add(x[:2], x[2:]) - x[2:]) - x[2:] / 10.0 - (-x[:2]) ** 2 * x[:2]),
    ),
)


@pytest.mark.parametrize("rhs", ARRAYS)
def test_a_state_is_an_array_where_arithmetic_is_done_with_all_of_it(rhs):
    states = np.random.default_rng(0).normal(size=(5, 4))
    found, expected = (
        stroboscopic_map(ForcedSystem(f, {"g": 0.3}, 2 * math.pi, ("a", "b", "u", "v"))) for f in (rhs, in_coordinates)
    )
    assert found.unknown_formulas == ""
    assert np.abs(found(states) - expected(states)).max() < 1e-9
    assert np.abs(jacobian(found, states) - jacobian(expected, states)).max() < 1e-8
    sections = [
        section_map(
            ForcedSystem(lambda t, x, p, f=f: f(0.0, x, p), {"g": 0.3}, 1.0, ("a", "b", "u", "v")), ("a", 0.0, 1)
        )
        for f in (rhs, in_coordinates)
    ]
    assert np.abs(np.subtract(*[s([[0.1, 0.8, 0.2], [0.3, 0.5, -0.1]]) for s in sections])).max() < 1e-9


def test_what_is_sorted_is_compiled_or_has_branches():
    """Order statistics of four states, whose comparisons depend on one another; the motion is that of SciPy."""
    begin = np.array([0.3, -0.4, 0.55, 0.2])
    for rhs in (lambda t, x, p: -x - 0.1 * np.sort(x), lambda t, x, p: -x - np.median(x)):
        exact = solve_ivp(lambda t, x, f=rhs: f(t, x, None), (0.0, 2.0), begin, rtol=1e-11, atol=1e-12).y[:, -1]
        assert stroboscopic_map(ForcedSystem(rhs, {}, 2.0, tuple("abcd")))(begin) == pytest.approx(exact, abs=1e-8)


def test_functions_of_maps_take_states_as_arrays():
    image = discrete_map(lambda x, p: K @ x - 0.1 * x**3, {}, ("x", "y"), ends={"far": lambda x, p: x @ x - 9.0})
    assert np.array_equal(image([1.0, 0.5]), K @ [1.0, 0.5] - 0.1 * np.array([1.0, 0.125]))
    assert np.isnan(image([2.9, 1.0])).all()
    system = ForcedSystem(
        lambda t, x, p: (x[1], -x[0]),
        {},
        math.pi,
        ("q", "v"),
        impacts=[Impact(lambda t, x, p: x.sum() + 2.0, lambda t, x, p: -x)],
        outputs={"energy": lambda t, x, p: (0.5 * x @ x if x[0] > 0.0 else 0.0,)},
    )
    assert stroboscopic_map(system)([1.0, 0.0]) == pytest.approx([-1.0, 0.0], abs=1e-9)
    assert system.output("energy", 0.0, [[1.0, 2.0], [-1.0, 2.0]]).ravel().tolist() == [2.5, 0.0]
