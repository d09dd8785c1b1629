"""Right-hand sides with arrays, methods and helpers: the formulas are those that tuples give."""

import dataclasses
import functools
import math
import types
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.linalg as la
import pytest
from numpy import zeros
from scipy import integrate, interpolate, special

from cellmap import ForcedSystem, discrete_map, stroboscopic_map
from cellmap._compiled.codegen.expression import UntraceableError, in_order
from cellmap._compiled.codegen.trace import Trace, is_faithful, parameter_record, trace

NAMES, VALUES = ("delta", "gamma", "omega"), (0.15, 0.2, 1.0)
MASS, STIFFNESS = np.eye(2), np.array([[0.0, 1.0], [1.0, -0.15]])

Form = Callable[[float, Any, Any], Any]


def force(t: float, x: Any, p: Any) -> Any:
    return x[0] - x[0] ** 3 - p.delta * x[1] + p.gamma * np.cos(p.omega * t)


def as_tuple(t: float, x: Any, p: Any) -> Any:
    return x[1], force(t, x, p)


def filled(make: Callable[[], Any]) -> Form:
    def rhs(t: float, x: Any, p: Any) -> Any:
        dx = make()
        dx[0] = x[1]
        dx[1] = force(t, x, p)
        return dx

    return rhs


def joined(join: Callable[[Any, Any], Any]) -> Form:
    def rhs(t: float, x: Any, p: Any) -> Any:
        x = np.array(x)
        q, v = x[:1], x[1:]
        return join(v, q - q**3 - p.delta * v + p.gamma * np.cos(p.omega * t))

    return rhs


def in_place(t: float, x: Any, p: Any) -> Any:
    dx = np.array([x[1], x[0]])
    dx[1] -= x[0] ** 3
    dx[1:] -= p.delta * x[1]
    dx += np.array([0.0, p.gamma * np.cos(p.omega * t)])
    return dx


@dataclasses.dataclass(frozen=True)
class Spring:
    k: float = 1.0

    def force(self, q: Any) -> Any:
        found = np.zeros(1)
        found[0] = self.k * q - math.pow(q, 3)
        return found[0]

    def __call__(self, q: Any) -> Any:
        return self.force(q)


class Base:
    def rhs(self, t: float, x: Any, p: Any) -> Any:
        return x[1], self.force(x[0]) - p.delta * x[1] + p.gamma * self.drive(p.omega * t)

    def drive(self, phase: Any) -> Any:
        return np.cos(phase)

    def force(self, q: Any) -> Any:
        raise NotImplementedError


class Oscillator(Base):
    def __init__(self) -> None:
        self.spring = Spring()

    @property
    def law(self) -> Any:
        return self.spring.force

    def force(self, q: Any) -> Any:
        return self.law(q)

    def __call__(self, t: float, x: Any, p: Any) -> Any:
        return super().rhs(t, x, p)


HELPERS = types.ModuleType("helpers")
HELPERS.spring = Spring()  # type: ignore[attr-defined]
HELPERS.force = lambda q: HELPERS.spring(q)  # type: ignore[attr-defined]

SAME: dict[str, Form] = {
    "zeros": filled(lambda: np.zeros(2)),
    "zeros of floats": filled(lambda: zeros((2,), dtype=np.float64)),
    "empty": filled(lambda: np.empty(2)),
    "full": filled(lambda: np.full(2, 0.0)),
    "a copy of an array outside": filled(lambda: STIFFNESS[0].copy()),
    "array of floats": lambda t, x, p: np.array([x[1], force(t, x, p)], float),
    "asarray of floats": lambda t, x, p: as_tuple(t, np.asarray(x, dtype="float64"), p),
    "astype": lambda t, x, p: np.array(as_tuple(t, x, p)).astype(float),
    "concatenate": joined(lambda a, b: np.concatenate([a, b])),
    "hstack": joined(lambda a, b: np.hstack((a, b))),
    "r_": joined(lambda a, b: np.r_[a, b]),
    "stack": lambda t, x, p: np.stack(as_tuple(t, x, p)),
    "append": lambda t, x, p: np.append(x[1], force(t, x, p)),
    "reshape": lambda t, x, p: np.array([as_tuple(t, x, p)]).T.reshape(2),
    "arrays of arrays": lambda t, x, p: np.array([np.array(x), [force(t, x, p), 0.0]])[[0, 1], [1, 0]],
    "in place": in_place,
    "sum": lambda t, x, p: np.array([[x[1], 0.0], [force(t, x, p), 0.0]]).sum(axis=1),
    "prod": lambda t, x, p: (
        x[1], x[0] - np.prod([x[0], x[0], x[0]]) - p.delta * x[1] + p.gamma * np.cos(p.omega * t)
    ),
    "a matrix of constants": lambda t, x, p: MASS @ as_tuple(t, x, p),
    "a mask of constants": lambda t, x, p: np.array([*as_tuple(t, x, p), x[0]])[np.array([True, True, False])],
    "a method": Oscillator().rhs,
    "an object": Oscillator(),
    "a module": lambda t, x, p: (x[1], HELPERS.force(x[0]) - p.delta * x[1] + p.gamma * np.cos(p.omega * t)),
    "a partial": functools.partial(lambda m, t, x, p: filled(lambda: np.zeros(2))(t, x, p) * m, 1.0),
}  # fmt: skip
"""Forms with the very formulas of the tuple."""

ALIKE: dict[str, Form] = {
    "a matrix": lambda t, x, p: (
        np.array([[0, 1.0], [1.0, -p.delta]]) @ x + [0.0, -(x[0] ** 3) + p.gamma * np.cos(p.omega * t)]
    ),
    "clip, where": lambda t, x, p: np.where(np.array(x) > 9.0, 0.0, np.clip(as_tuple(t, x, p), None, 5.0)),
    "outer": lambda t, x, p: (x[1], np.outer(x, x)[0, 0] * -x[0] + x[0] + p.gamma * np.cos(t)),
    "norm of rows": lambda t, x, p: la.norm([x, (1.0, x[0])], axis=1),
    "largest": lambda t, x, p: (np.max(x), np.array(x).min()),
    "mean, cumsum": lambda t, x, p: (np.mean(x), np.cumsum(x)[-1]),
    "select": lambda t, x, p: np.select([np.array(x) > 0.3, np.array(x) > 0.0], [x, np.sin(x)], -1.0),
    "polynomials": lambda t, x, p: (np.polyval([1.0, p.delta, 0.0], x[0]), np.poly1d([2.0, 1.0])(x[1])),
    "einsum, kron": lambda t, x, p: np.einsum("ij,j", STIFFNESS, x) + np.kron([2.0], x),
    "numbers of NumPy": lambda t, x, p: (np.float64(2.0) * x[1], x[0] / np.float64(p.delta) - np.float64(x[1])),
    "a mask": lambda t, x, p: masked(x),
}


def masked(x: Any) -> Any:
    dx = np.array(x)
    dx[dx > 0.5] = 0.25
    return dx


def operations(traced: Trace) -> int:
    return sum(bool(node.arguments) for node in in_order(traced.outputs))


@pytest.mark.parametrize("form", SAME)
def test_arrays_and_methods_have_the_formulas_of_tuples(form: str) -> None:
    assert repr(trace(SAME[form], 2, NAMES).outputs) == repr(trace(as_tuple, 2, NAMES).outputs)


@pytest.mark.parametrize("form", ALIKE)
def test_what_numpy_computes_of_arrays_is_traced(form: str) -> None:
    traced = trace(ALIKE[form], 2, NAMES)
    assert is_faithful(traced, ALIKE[form], VALUES, parameter_record(NAMES)(*VALUES))
    assert operations(traced) > 1


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
def test_linear_equations_of_matrices_that_move_are_solved_as_lapack_solves_them(n: int) -> None:
    """Without a pivot that may vanish: the diagonal does, where x is nought."""
    rng = np.random.default_rng(n)
    fixed = rng.normal(size=(n, n)) * (1.0 - np.eye(n))

    def matrix(x: Any) -> Any:
        m = fixed.copy()
        for i in range(n):
            m[i, i] = x[i] if n > 1 else 1.0 + x[i] ** 2
        return m

    def rhs(t: float, x: Any, p: Any) -> Any:
        m = matrix(x)
        return np.linalg.solve(m, np.sin(x)) + la.inv(m).dot(x) * np.linalg.det(m)

    traced = trace(rhs, n, ())
    assert traced.is_analytic
    assert is_faithful(traced, rhs, (), ())


REFUSED: dict[str, tuple[str, Form]] = {
    "eigenvalues": ("eigvals has no formula", lambda t, x, p: np.linalg.eigvals([[x[0], 1.0], [1.0, x[1]]])),
    "large matrices": ("up to 6 rows", lambda t, x, p: la.inv(np.eye(7) + x[0])[0][:2]),
    "whole numbers": ("array of integers", lambda t, x, p: whole(x)),
    "lengths": ("counts", lambda t, x, p: [x[0] for _ in range(int(x[1]))]),
}


def whole(x: Any) -> Any:
    dx = np.zeros(2, dtype=int)
    dx[0] = x[1]
    return dx


@pytest.mark.parametrize("form", REFUSED)
def test_what_has_no_formula_says_why(form: str) -> None:
    reason, function = REFUSED[form]
    with pytest.raises(UntraceableError, match=reason):
        trace(function, 2, ())


def test_a_motion_with_an_array_takes_no_more_than_one_of_tuples() -> None:
    """By the same code, and bit for bit."""
    maps = [stroboscopic_map(ForcedSystem(f, dict(zip(NAMES, VALUES, strict=True)), 2 * math.pi, ("q", "v")))
            for f in (as_tuple, SAME["zeros"])]  # fmt: skip
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 2))
    assert np.array_equal(maps[0](points), maps[1](points))
    assert maps[1].unknown_formulas == ""


def test_objects_and_arrays_of_the_user_stay_as_they_are() -> None:
    oscillator, before = Oscillator(), STIFFNESS.copy()
    trace(oscillator, 2, NAMES)
    trace(SAME["a copy of an array outside"], 2, NAMES)
    assert type(oscillator) is Oscillator
    assert type(oscillator.spring) is Spring
    assert type(STIFFNESS) is np.ndarray
    assert np.array_equal(STIFFNESS, before)


EQUAL, APART = np.linspace(-3.0, 3.0, 13), np.array([-3.0, -1.2, 0.0, 0.4, 1.0, 3.0])
TURN = np.linspace(0.0, 2.0 * math.pi, 9)
ROUND = interpolate.CubicSpline(TURN, np.append(np.cos(TURN[:-1]), 1.0), bc_type="periodic")
SPLINES: dict[str, Any] = {
    "equal distances": interpolate.CubicSpline(EQUAL, np.tanh(EQUAL)),
    "other distances": interpolate.CubicSpline(APART, np.tanh(APART)),
    "monotone": interpolate.PchipInterpolator(APART, APART**3),
    "of SciPy's B-splines": interpolate.make_interp_spline(EQUAL, np.sin(3.0 * EQUAL)),
    "periodic": ROUND,
    "a derivative": ROUND.derivative(),
}


@pytest.mark.parametrize("kind", SPLINES)
def test_splines_are_those_of_scipy(kind: str) -> None:
    spline = SPLINES[kind]
    image = discrete_map(lambda x, p: (spline(x[0]) + spline(x[0], 1),), {}, ("x",))
    for place in (-4.0, -1.2, 0.1, 2.9, 3.5):
        assert image([place])[0] == pytest.approx(float(spline(place) + spline(place, 1)), abs=1e-12)


@pytest.mark.parametrize(
    "kind", [k if k == "other distances" else pytest.param(k, marks=pytest.mark.thorough) for k in SPLINES]
)
def test_splines_are_located_at_their_knots(kind: str) -> None:
    spline = SPLINES[kind]

    def rhs(t: float, x: Any, p: Any) -> Any:
        return x[1], -spline(x[0]) - 0.1 * x[1] + 0.3 * ROUND(t)

    strobe = stroboscopic_map(ForcedSystem(rhs, {}, 2.0 * math.pi, ("q", "v")))
    assert strobe.unknown_formulas == ""
    found = integrate.solve_ivp(lambda t, y: rhs(t, y, None), (0.0, 2.0 * math.pi), (0.5, 0.3), "DOP853", None,
                                rtol=1e-10, atol=1e-10, max_step=0.05).y[:, -1]  # fmt: skip
    assert strobe([0.5, 0.3]) == pytest.approx(found, abs=2e-7)


def test_tables_that_repeat_count_their_pieces_by_one_switch() -> None:
    """Of a state and of a shifted time: a period begins where a piece does, in the middle of a motion."""
    places = np.linspace(0.0, 2.0, 9)

    def rhs(t: float, x: Any, p: Any) -> Any:
        force = np.interp(x[0], places, np.sin(np.pi * places), period=2.0)
        return x[1], 0.3 - force - 0.1 * x[1] + 0.2 * ROUND(t + 1.0)

    system = ForcedSystem(rhs, {}, 2.0 * math.pi, ("q", "v"))
    found = integrate.solve_ivp(system.fun, (0.0, 2.0 * math.pi), (0.5, 0.8), rtol=1e-8, atol=1e-10, max_step=0.01).y[
        :, -1
    ]
    assert stroboscopic_map(system)([0.5, 0.8]) == pytest.approx(found, abs=1e-5)


def test_special_functions_with_a_formula_have_it_and_others_say_so() -> None:
    def rhs(t: float, x: Any, p: Any) -> Any:
        return special.expit(x[0]) + special.ndtr(x[1]) + np.sinc(x[0]), special.erf(np.array(x))[1] + special.logit(
            0.3
        )

    assert is_faithful(trace(rhs, 2, ()), rhs, (), ())
    with pytest.raises(UntraceableError, match=r"jv has no formula .*CubicSpline\(s, jv\(0, s\)\)"):
        trace(lambda t, x, p: (special.jv(0, x[0]),), 1, ())
