"""Forced systems: what they accept, and what they say where they do not."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable
from functools import partial
from math import cos, floor, inf, nan, pi, sin, sqrt
from typing import Any

import numpy as np
import pytest
import scipy.special

from cellmap import Coordinate, ForcedSystem, angle, stroboscopic_map


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


def test_a_record_of_names_values_and_coordinates() -> None:
    one = system(coordinates=(angle("q"), "v"), rhs=lambda t, x, p: (x[1], -sin(x[0])), name="swing")
    assert one.dimension == 2
    assert one.axes == (angle("q"), Coordinate("v"))
    assert one.parameters.delta == 0.15
    assert one.length == pi
    assert repr(one) == "ForcedSystem(swing: delta=0.15, gamma=0.2, omega=2; period 3.14159)"
    assert system().name == "duffing"


def test_parameters_are_copied_and_become_floats() -> None:
    given: dict[str, Any] = {"delta": 1, "gamma": np.float32(0.5), "omega": True * 2}
    one = system(params=given)
    given["delta"] = 7
    assert one.params == {"delta": 1.0, "gamma": 0.5, "omega": 2.0}
    assert all(type(v) is float for v in one.params.values())


def test_changed_parameters_make_another_system() -> None:
    one = system()
    other = one.with_params(gamma=0.3)
    assert one.with_params({"gamma": 0.3}).params == one.with_params({"gamma": 0.1}, gamma=0.3).params == other.params
    with pytest.raises(TypeError, match=r"values=0\.3: give a dictionary of parameters"):
        one.with_params(0.3)  # type: ignore[arg-type]
    assert (one.parameters.gamma, other.parameters.gamma) == (0.2, 0.3)
    assert other.rhs is one.rhs
    assert (other.name, other.axes, other.length) == (one.name, one.axes, one.length)
    with pytest.raises(ValueError, match=r"params has no \['gama'\]: this system has \['delta', 'gamma', 'omega'\]"):
        one.with_params(gama=0.3)


def test_an_angle_must_be_one() -> None:
    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -sin(2 * pi * x[0] / 360.0)

    degrees = angle("theta", "deg", period=360.0)
    assert system(rhs=rhs, coordinates=(degrees, "v")).axes[0] is degrees
    assert system(rhs=rhs, coordinates=(angle("theta", period=720.0), "v")).dimension == 2
    with pytest.raises(ValueError, match=r"one period of theta further on .*, so theta is not an angle of period 180"):
        system(rhs=rhs, coordinates=(angle("theta", period=180.0), "v"))


def test_a_period_that_follows_a_parameter() -> None:
    one = system(period=lambda p: 2 * pi / p.omega)
    assert one.length == pi
    assert one.with_params(omega=4.0).length == pi / 2


def test_a_fixed_period_is_checked_against_changed_parameters() -> None:
    with pytest.raises(ValueError, match="give the period of the forcing"):
        system().with_params(omega=3.0)


def test_functions_of_many_kinds() -> None:
    class Duffing:
        def __call__(self, t: float, x: Any, p: Any) -> tuple[float, float]:
            return duffing(t, x, p)

        def rhs(self, t: float, x: Any, p: Any) -> tuple[float, float]:
            return duffing(t, x, p)

    for rhs in (Duffing(), Duffing().rhs, partial(duffing), lambda t, x, p: list(duffing(t, x, p))):
        assert system(rhs=rhs).derivative(0.0, (1.0, 2.0)) == duffing(0.0, (1.0, 2.0), system().parameters)


def unpacking(t: float, x: tuple[float, ...], p: Any) -> tuple[float, ...]:
    q, v = x
    return v, -q


def test_numpy_functions_of_the_state_as_a_whole() -> None:
    """Their formulas are known, as those of the same function by components."""
    whole = stroboscopic_map(system(rhs=lambda t, x, p: np.sin(x)))
    parts = stroboscopic_map(system(rhs=lambda t, x, p: (sin(x[0]), sin(x[1]))))
    assert np.array_equal(whole([0.3, -1.0]), parts([0.3, -1.0]))
    with pytest.raises(TypeError, match="cannot be compiled"):  # of pairs one is the larger: not of their entries
        stroboscopic_map(system(rhs=lambda t, x, p: max((-x[0], -x[1]), (-x[1], 2.0 * x[0]))))


def test_a_right_hand_side_that_is_not_defined_everywhere() -> None:
    assert system(rhs=lambda t, x, p: (sqrt(cos(t) - 0.9), -x[1]), period=2 * pi).dimension == 2


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"rhs": 3}, TypeError, r"rhs=3: give a function rhs\(t, x, p\)"),
        ({"rhs": lambda t, x: x}, TypeError, r"rhs must be callable as rhs\(t, x, p\)"),
        ({"rhs": lambda t, x, p: None}, TypeError, "rhs must be callable .* and return a tuple"),
        ({"rhs": lambda t, x, p: 1.0}, TypeError, "rhs must be callable .* and return a tuple"),
        ({"rhs": lambda t, x, p: (x[1],)}, ValueError, r"rhs returns 1 components for 2 coordinates \(q, v\)"),
        ({"rhs": lambda t, x, p: (*x, 0.0)}, ValueError, r"rhs returns 3 components for 2 coordinates \(q, v\)"),
        ({"rhs": lambda t, x, p: -0.5 * x}, TypeError, r"x and p are tuples: write x\[0\], x\[1\], .* np.array"),
        ({"rhs": lambda t, x, p: (x[1], absent * x[0])}, ValueError, "'absent' is not defined.*or make it a parameter"),  # noqa: F821
        ({"rhs": unpacking, "coordinates": "qv"}, ValueError, r"coordinates='qv' has .* such as \('q', 'v'\)"),
        ({"params": {"P": [1.0, 2.0]}}, TypeError, r"params\['P'\]=\[1.0, 2.0\]: .* or an array of them"),
        ({"rhs": lambda t, x, p: ("a", "b")}, TypeError, "its components must be real numbers"),
        ({"rhs": lambda t, x, p: (1j, 0.0)}, TypeError, "its components must be real numbers"),
        ({"rhs": lambda t, x, p: (x[1], p.absent)}, ValueError, "rhs asks for a parameter that params lacks"),
        ({"rhs": lambda t, x, p: (sqrt(-1.0 - x[0]), x[1])}, ValueError, "rhs fails at every state tried"),
        ({"period": 3.0}, ValueError, "period=3.0: rhs at t = .* give the period of the forcing"),
        ({"period": 0.0}, ValueError, "period=0.0: give a number above 0"),
        ({"period": -pi}, ValueError, "period=-3.14.*: give a number above 0"),
        ({"period": nan}, ValueError, "period=nan: give a finite number"),
        ({"period": inf}, ValueError, "period=inf: give a finite number"),
        ({"period": None}, TypeError, "period=None: give one real number"),
        ({"period": "pi"}, TypeError, "period='pi': give one real number"),
        ({"period": "3.14"}, TypeError, "period='3.14': give one real number"),
        ({"period": lambda p: p.absent}, ValueError, "period asks for a parameter that params lacks: p.absent"),
        ({"period": lambda p: nan}, ValueError, "period=nan: give a finite number"),
        ({"params": {**PARAMS, "delta": nan}}, ValueError, r"params\['delta'\]=nan: give a finite number"),
        ({"params": {**PARAMS, "delta": inf}}, ValueError, r"params\['delta'\]=inf: give a finite number"),
        ({"params": {**PARAMS, "delta": "much"}}, TypeError, r"params\['delta'\]='much': give one real number"),
        ({"params": {**PARAMS, "delta": "0.15"}}, TypeError, r"params\['delta'\]='0.15': give one real number"),
        ({"params": {**PARAMS, "delta": None}}, TypeError, r"params\['delta'\]=None: give one real number"),
        ({"params": {**PARAMS, "delta": 1j}}, TypeError, r"params\['delta'\]=1j: give one real number"),
        ({"params": {**PARAMS, "delta": [1.0, 2.0]}}, TypeError, r"params\['delta'\]=\[1.0, 2.0\]: give one real"),
        ({"params": {**PARAMS, "not a name": 1.0}}, ValueError, "params has the name 'not a name'"),
        ({"params": {**PARAMS, "_hidden": 1.0}}, ValueError, "params has the name '_hidden'"),
        ({"params": {**PARAMS, "lambda": 1.0}}, ValueError, "params has the name 'lambda'"),
        ({"params": {**PARAMS, 3: 1.0}}, ValueError, "params has the name 3"),
        ({"params": [0.15, 0.2]}, TypeError, "params=.*: give a mapping of names to numbers"),
        (
            {"coordinates": (angle("q"), "v")},
            ValueError,
            "so q is not an angle of period 6.28319; give period= its period",
        ),
        ({"coordinates": ()}, ValueError, "one different name for each state variable"),
        ({"coordinates": ("q", "q")}, ValueError, "one different name for each state variable"),
        ({"coordinates": ("q", 3)}, TypeError, "give a name or a Coordinate for each"),
        ({"coordinates": ("q",)}, ValueError, "not enough values to unpack .* one coordinate for each state variable"),
    ],
)
def test_bad_systems_are_refused(changes: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        system(**changes)


def test_a_parameter_may_have_the_name_of_a_method_of_tuples() -> None:
    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -p.count * x[0] + p.index

    one = system(rhs=rhs, params={"count": 2.0, "index": 3.0})
    assert one.derivative(0.0, (1.0, 0.0)) == (0.0, 1.0)


@pytest.mark.parametrize("period", [1e-9, 1e9])
def test_tiny_and_huge_periods(period: float) -> None:
    rhs: Callable[..., Any] = lambda t, x, p: (x[1], -x[0] + cos(2 * pi * t / period))  # noqa: E731
    assert system(rhs=rhs, period=period).length == period


def rubbed(t, x, p, s):
    return x[1], -x[0] - p.limit * s[0]


@pytest.mark.parametrize(
    ("signs", "message"),
    [((1.0, 1.0), "give 1, one for each switching function"), ((7.0,), "at most 1"), ("a", "one real number")],
)
def test_signs_that_do_not_fit_are_refused(signs, message):
    block = ForcedSystem(rubbed, {"limit": 0.3}, 1.0, ("x", "v"), switches=lambda t, x, p: (x[1],))
    assert block.derivative(0.0, (0.5, 0.0), (1.0,)) == (0.0, -0.8)
    with pytest.raises((TypeError, ValueError), match=message):
        block.derivative(0.0, (0.5, 0.0), signs)


def test_switches_may_be_truth_values():
    block = ForcedSystem(rubbed, {"limit": 0.3}, 1.0, ("x", "v"), switches=lambda t, x, p: (x[1] > 0.0,))
    assert block.signs(0.0, (0.0, 1.0)) == (1.0,)


def test_more_signs_than_switches():
    with pytest.raises(ValueError, match="as many switches as there are signs"):
        ForcedSystem(lambda t, x, p, s: (x[1], s[1]), {}, 1.0, ("x", "v"), switches=lambda t, x, p: (x[1],))


def q_and_v(t, x, p):
    return x[1], -x[0] - p.d * x[1] + cos(t)


@pytest.mark.parametrize(
    ("rhs", "coordinates", "message"),
    [
        (lambda t, x, p: (x[1], -x[0] - p["d"] * x[1]), ("q", "v"), r"p\['name'\]: p is a named tuple; write p.name"),
        (lambda t, x, p: (x.v, -x.q), ("q", "v"), r"reads x.v: x is a plain tuple; begin with `q, v = x`"),
        (q_and_v, "qv", r"coordinates='qv' is one name: give one for each, such as \('q', 'v'\)"),
        (lambda x, t, p: (x[1], -x[0] - p.d * x[1] + cos(t)), ("q", "v"), r"state before the time: .* rhs\(t, x, p\)"),
    ],
    ids=["p[name]", "x.name", "one name", "x before t"],
)
def test_right_hand_sides_that_misread_their_arguments(rhs, coordinates, message):
    """The message names what was meant."""
    with pytest.raises((TypeError, ValueError), match=message):
        ForcedSystem(rhs, {"d": 0.1}, 2 * pi, coordinates)


def writes(t, x, p):
    if x[0] < 0.0:
        x[1] = -x[1]
    return x[1], -x[0]


def multiplies(t, x, p):
    x *= -1
    return x[1], -x[0]


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
    q, v = x
    if q < p.wall and v < 0.0:
        v = abs(v)
    return v, cos(t) - q


@pytest.mark.parametrize("rhs", [writes, multiplies])
def test_a_state_that_is_written_to_is_refused(rhs):
    """On whichever side of a branch; the message names what was meant."""
    with pytest.raises(TypeError, match=r"changes the state x .* declare impacts=\[Impact\(guard, reset\)\]"):
        stroboscopic_map(ForcedSystem(rhs, {}, 1.0, ("q", "v")))


def test_a_right_hand_side_without_a_memory():
    """What it would remember of its last call is no event: it is not called in the order of time."""
    last = [1.0]

    def remembers(t, x, p):
        last[0] = x[0]
        return x[1], -last[0]

    with pytest.raises(ValueError, match=r"changes a value outside of it: .* impacts="):
        ForcedSystem(remembers, {}, 1.0, ("q", "v"))


@pytest.mark.parametrize("rhs", [reverses, reverses_a_copy, bends_upwards])
def test_a_reversed_velocity_is_warned_of(rhs):
    system = ForcedSystem(rhs, {"wall": 0.0, "e": 0.8}, 2 * pi, ("q", "v"))
    with pytest.warns(UserWarning, match=r"reverses a velocity: q changes with v .* impacts=") as caught:
        stroboscopic_map(system)
    assert caught[0].filename == __file__


@pytest.mark.parametrize(
    "rhs",
    [
        lambda t, x, p: (x[1], -x[0] - 0.3 * abs(x[1]) * x[1]),  # drag
        lambda t, x, p: (x[1], -50.0 * x[0] if x[0] < 0.0 else -x[0]),  # a soft wall
        lambda t, x, p: (-x[1] if sin(t) < 0.0 else x[1], -x[0]),  # gears change with time
        lambda t, x, p: (abs(x[1]), -x[0]),  # a ratchet
        lambda t, x, p: (2.0 * x[1] if x[0] > 0.0 else x[1], -x[0]),
        lambda t, x, p: (x[1] - x[0] if x[0] > 0.0 else x[1], -x[0]),
    ],
)
def test_other_branches_are_not_warned_of(rhs):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        stroboscopic_map(ForcedSystem(rhs, {}, 2 * pi, ("q", "v")))


def test_parameters_are_read_only():
    """What is built from them would not follow."""
    system = ForcedSystem(q_and_v, {"d": 0.1}, 2 * pi, ("q", "v"))
    for change in (lambda p: p.__setitem__("d", 1.0), lambda p: p.update(d=1.0), lambda p: p.pop("d")):
        with pytest.raises(TypeError, match=r"with_params\(name=value\)"):
            change(system.params)
    assert system.params == {"d": 0.1}
    with pytest.raises(KeyError, match=r"params\['gamma'\]: choose one of 'd'; params.get\(key\) is None for others"):
        system.params["gamma"]
    assert pickle.loads(pickle.dumps(system.params)) == system.params
    assert {**system.params, "e": 2.0} == {"d": 0.1, "e": 2.0}


def test_jumps_at_the_ends_of_the_period():
    """sin(2 pi) is -2.4e-16, on the other side of the jump than sin(0); a ramp in switches is reset there too."""
    ForcedSystem(lambda t, x, p: (x[1], -x[0] + np.sign(np.sin(t))), {}, 2 * pi, ("q", "v"))
    ramp = {"switches": lambda t, x, p: (x[0] - t / 3 + floor(t / 3),)}
    ForcedSystem(lambda t, x, p, s: (x[1], -x[0] + s[0]), {}, 3.0, ("q", "v"), **ramp)
    with pytest.raises(ValueError, match="rhs with its switches at t"):
        ForcedSystem(lambda t, x, p, s: (x[1], -x[0] + s[0]), {}, 2.0, ("q", "v"), **ramp)


def test_compilers_message_is_one_line():
    def foreign(t, x, p):
        return x[1], -scipy.special.jv(0, x[0])

    with pytest.raises(TypeError, match=r"The compiler says: Unknown attribute 'jv'[^\n]*$"):
        stroboscopic_map(ForcedSystem(foreign, {}, 2 * pi, ("q", "v")))([0.1, 0.2])
