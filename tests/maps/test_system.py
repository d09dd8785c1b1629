"""Forced systems: what they accept, and what they say where they do not."""

import pickle
import warnings
from functools import partial
from math import cos, floor, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest

from cellmap import ForcedSystem, angle, discrete_map, stroboscopic_map
from cellmap.maps import swept_map


def duffing(t: float, x: Any, p: Any) -> tuple[float, float]:
    q, v = x
    return v, q - q**3 - p.delta * v + p.gamma * cos(p.omega * t)


PARAMS = {"delta": 0.15, "gamma": 0.2, "omega": 2.0}


def system(**changes: Any) -> ForcedSystem:
    arguments: dict[str, Any] = {"rhs": duffing, "params": PARAMS, "period": pi, "coordinates": ("q", "v")}
    return ForcedSystem(**{**arguments, **changes})


def test_the_right_hand_side_in_plain_python_and_for_scipy() -> None:
    one = system()
    assert one.derivative(0.0, [1.0, 2.0]) == (2.0, -0.3 + 0.2)
    assert np.array_equal(one.fun(0.0, np.array([1.0, 2.0])), one.derivative(0.0, (1.0, 2.0)))
    assert one.fun(0.0, np.array([1.0, 2.0])).dtype == float


def test_parameters_are_copied_and_become_floats() -> None:
    given: dict[str, Any] = {"delta": 1, "gamma": np.float32(0.5), "omega": True * 2}
    one = system(params=given)
    given["delta"] = 7
    assert one.params == {"delta": 1.0, "gamma": 0.5, "omega": 2.0}
    assert all(type(v) is float for v in one.params.values())


def test_an_angle_must_be_one() -> None:
    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -sin(2 * pi * x[0] / 360.0)

    degrees = angle("theta", "deg", period=360.0)
    assert system(rhs=rhs, coordinates=(degrees, "v")).axes[0] is degrees
    assert system(rhs=rhs, coordinates=(angle("theta", period=720.0), "v")).dimension == 2
    with pytest.raises(ValueError, match=r"one period of theta further on .*, so theta is not an angle of period 180"):
        system(rhs=rhs, coordinates=(angle("theta", period=180.0), "v"))


def test_functions_of_many_kinds() -> None:
    class Duffing:
        def __call__(self, t: float, x: Any, p: Any) -> tuple[float, float]:
            return duffing(t, x, p)

        def rhs(self, t: float, x: Any, p: Any) -> tuple[float, float]:
            return duffing(t, x, p)

    for rhs in (Duffing(), Duffing().rhs, partial(duffing), lambda t, x, p: list(duffing(t, x, p))):
        assert system(rhs=rhs).derivative(0.0, (1.0, 2.0)) == duffing(0.0, (1.0, 2.0), system().parameters)


def test_numpy_functions_of_the_state_as_a_whole() -> None:
    """Their formulas are known, as those of the same function by components."""
    whole = stroboscopic_map(system(rhs=lambda t, x, p: np.sin(x)))
    parts = stroboscopic_map(system(rhs=lambda t, x, p: (sin(x[0]), sin(x[1]))))
    assert np.array_equal(whole([0.3, -1.0]), parts([0.3, -1.0]))


def test_what_right_hand_sides_and_their_parameters_may_be() -> None:
    """Not defined everywhere, with parameters called like methods of tuples, and with truth values as switches."""
    assert system(rhs=lambda t, x, p: (sqrt(cos(t) - 0.9), -x[1]), period=2 * pi).dimension == 2
    named = system(rhs=lambda t, x, p: (x[1], -p.count * x[0] + p.index), params={"count": 2.0, "index": 3.0})
    assert named.derivative(0.0, (1.0, 0.0)) == (0.0, 1.0)
    block = system(rhs=lambda t, x, p, s: (x[1], -x[0] - 0.3 * s[0]), switches=lambda t, x, p: (x[1] > 0.0,))
    assert block.signs(0.0, (0.0, 1.0)) == (1.0,)


def reverses(t, x, p):
    q, v = x
    if q < p.wall:
        v = -p.e * v
    return v, cos(t) - q


def reverses_a_copy(t, x, p):
    x = np.array(x)
    if x[0] < p.wall:
        x[1] = -x[1]
    return x[1], cos(t) - x[0]


def bends_upwards(t, x, p):
    a, b, vb = x
    if b < p.wall and vb < 0.0:
        vb = abs(vb)
    return -a, vb, cos(t) - b


@pytest.mark.parametrize(
    ("rhs", "names"), [(reverses, ("q", "v")), (reverses_a_copy, ("q", "v")), (bends_upwards, ("a", "b", "vb"))]
)
def test_a_reversed_velocity_is_warned_of(rhs, names):
    system = ForcedSystem(rhs, {"wall": 0.0, "e": 0.8}, 2 * pi, names)
    with pytest.warns(UserWarning, match=rf"velocity: {names[-2]} changes with {names[-1]} .* impacts=") as caught:
        stroboscopic_map(system)
    assert caught[0].filename == __file__


@pytest.mark.parametrize(
    "rhs",
    [
        lambda t, x, p: (x[1], -x[0] - 0.3 * abs(x[1]) * x[1]),  # drag
        lambda t, x, p: (x[1], -50.0 * x[0] if x[0] < 0.0 else -x[0]),  # a soft wall
        lambda t, x, p: (-x[1] if sin(t) < 0.0 else x[1], -x[0]),  # gears change with time
        lambda t, x, p: (abs(x[1]), -x[0]),  # a ratchet
        lambda t, x, p: (2.0 * x[1] if x[0] > 0.0 else x[1], -x[0]),  # gears
        lambda t, x, p: (0.5 * x[1] if x[0] > 0.0 else x[1], -x[0]),
        lambda t, x, p: (x[1] - x[0] if x[0] > 0.0 else x[1], -x[0]),
    ],
)
def test_other_branches_are_not_warned_of(rhs):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        stroboscopic_map(ForcedSystem(rhs, {}, 2 * pi, ("q", "v")))


def test_parameters_are_read_only():
    """What is built from them would not follow."""
    params = system().params
    for change in (lambda p: p.__setitem__("delta", 1.0), lambda p: p.update(delta=1.0), lambda p: p.pop("delta")):
        with pytest.raises(TypeError, match=r"with_params\(name=value\)"):
            change(params)
    with pytest.raises(KeyError, match=r"params\['d'\]: choose one of 'delta', .*; params.get\(key\) is None"):
        params["d"]
    assert pickle.loads(pickle.dumps(params)) == params == PARAMS
    assert {**params, "e": 2.0} == PARAMS | {"e": 2.0}


def test_jumps_at_the_ends_of_the_period():
    """sin(2 pi) is -2.4e-16, on the other side of the jump than sin(0); a ramp in switches is reset there too."""
    ForcedSystem(lambda t, x, p: (x[1], -x[0] + np.sign(np.sin(t))), {}, 2 * pi, ("q", "v"))
    ramp = {"switches": lambda t, x, p: (x[0] - t / 3 + floor(t / 3),)}
    ForcedSystem(lambda t, x, p, s: (x[1], -x[0] + s[0]), {}, 3.0, ("q", "v"), **ramp)
    with pytest.raises(ValueError, match="rhs with its switches at t"):
        ForcedSystem(lambda t, x, p, s: (x[1], -x[0] + s[0]), {}, 2.0, ("q", "v"), **ramp)


MATRIX = np.array([[0.0, 0.3], [0.2, 0.0]])
POWERS = np.array([0.5, -0.1])


def coupled(t: float, x: Any, p: Any) -> tuple[Any, ...]:
    return tuple(-x[i] + p.P[i] * cos(t) + p.c * sum(p.K[i, j] * (x[j] - x[i]) for j in range(2)) for i in range(2))


SYSTEM = ForcedSystem(coupled, {"K": MATRIX, "c": 2.0, "P": POWERS}, 2 * pi, ("a", "b"))


def test_arrays_are_as_good_as_numbers() -> None:
    def by_numbers(t: float, x: Any, p: Any) -> tuple[float, float]:
        return -x[0] + 0.5 * cos(t) + 0.6 * (x[1] - x[0]), -x[1] - 0.1 * cos(t) + 0.4 * (x[0] - x[1])

    exact, numbers = (stroboscopic_map(s) for s in (SYSTEM, ForcedSystem(by_numbers, {}, 2 * pi, ("a", "b"))))
    np.testing.assert_allclose(exact([0.3, 0.4]), numbers([0.3, 0.4]), rtol=1e-9)
    assert list(exact.params)[:5] == ["K[0, 0]", "K[0, 1]", "K[1, 0]", "K[1, 1]", "c"]
    assert "K: 4 entries" in repr(SYSTEM) and "K: 4 entries" in repr(exact)
    np.testing.assert_array_equal(SYSTEM.parameters.K, MATRIX)


def test_arrays_and_entries_change_and_are_swept() -> None:
    exact, own = stroboscopic_map(SYSTEM), {"K[0, 1]": 0.2, "K[1, 0]": 0.3}
    changed = SYSTEM.with_params(K=MATRIX.T)
    np.testing.assert_array_equal(changed.parameters.K, MATRIX.T)
    np.testing.assert_array_equal(exact.with_params(**own)([0.3, 0.4]), stroboscopic_map(changed)([0.3, 0.4]))
    expected = exact.with_params(**{"K[0, 1]": 0.7})([0.3, 0.4])
    np.testing.assert_allclose(swept_map(exact, "K[0, 1]")([[0.3, 0.4, 0.7]])[0, :2], expected, rtol=1e-8)


def test_pickles_and_discrete_maps() -> None:
    again = pickle.loads(pickle.dumps(SYSTEM))
    assert again.params == SYSTEM.params
    linear = discrete_map(lambda x, p: tuple(p.A @ np.array(x)), {"A": MATRIX}, ("x", "y"))
    np.testing.assert_allclose(linear([1.0, 2.0]), MATRIX @ [1.0, 2.0], rtol=1e-15)
