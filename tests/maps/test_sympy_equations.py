"""Equations of motion written with SymPy, against the same equations written by hand."""

from collections.abc import Callable
from math import cos, pi, sin
from typing import Any

import pytest
import sympy as sp
from sympy.physics.mechanics import KanesMethod, LagrangesMethod, Particle, Point, ReferenceFrame, dynamicsymbols

from cellmap import ForcedSystem, stroboscopic_map

T = sp.Symbol("t")
M, L, G, K, C, A, B, W = sp.symbols("m l g k c a b w", positive=True)
THETA = dynamicsymbols("theta")
Q, V = sp.symbols("q v")
F, H = sp.Function("F")(T), sp.Function("H")(T)
VALUES = {M: 0.1, L: 0.3, G: 9.81, K: 0.01, C: 2e-3, A: 0.02, B: 0.03, W: 20.0}
X = (0.3, -0.7, 0.4)


def energy() -> Any:
    """Lagrangian of a pendulum with a spring, on a pivot that is driven in both directions."""
    x, y = A * sp.cos(W * T) + L * sp.sin(THETA), B * sp.sin(W * T) - L * sp.cos(THETA)
    return M * (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 - M * G * y - K * THETA**2 / 2


def by_hand(t: float, x: Any, p: Any) -> tuple[float, float]:
    q, v = x
    forces = p.a * p.w**2 * cos(p.w * t) * cos(q) + (p.b * p.w**2 * sin(p.w * t) - p.g) * sin(q)
    return v, forces / p.l - (p.k * q + p.c * v) / (p.m * p.l**2)


def test_a_pendulum_on_a_pivot_driven_in_both_directions_is_derived_from_its_lagrangian() -> None:
    of_energy, rate = energy(), THETA.diff(T)
    motion = of_energy.diff(rate).diff(T) - of_energy.diff(THETA) + C * rate
    system = ForcedSystem.from_sympy(motion, VALUES, 2 * sp.pi / W, ("theta", "v"))
    same = ForcedSystem(by_hand, system.params, lambda p: 2 * pi / p.w, ("theta", "v"))
    found, expected = stroboscopic_map(system, rtol=1e-11), stroboscopic_map(same, rtol=1e-11)
    assert found.unknown_formulas == ""
    assert found.iterate((0.5, 0.0), 5).points == pytest.approx(expected.iterate((0.5, 0.0), 5).points, abs=1e-9)
    assert system.with_params(w=30.0).length == pytest.approx(2 * pi / 30.0)


def lagrange() -> tuple[Any, Any]:
    two = LagrangesMethod(F.diff(T) ** 2 + F.diff(T) * H.diff(T) + H.diff(T) ** 2 / 2 - F**2 + H * sp.cos(T), [F, H])
    # 2 F'' + H'' = -2 F and F'' + H'' = cos t
    return two, lambda t, x: (x[2], x[3], -2 * x[0] - cos(t), 2 * x[0] + 2 * cos(t))


def kane() -> tuple[Any, Any]:
    frame, point = ReferenceFrame("N"), Point("P")
    point.set_vel(frame, H * frame.x)
    method = KanesMethod(frame, q_ind=[F], u_ind=[H], kd_eqs=[F.diff(T) - H])
    method.kanes_equations([Particle("body", point, M)], [(point, (sp.cos(T) - F) * frame.x)])
    return method, lambda t, x: (x[1], (cos(t) - x[0]) / 0.1)


@pytest.mark.parametrize(
    ("given", "coordinates"),
    [
        (lambda: (sp.Matrix([V, -Q + sp.cos(T)]), lambda t, x: (x[1], -x[0] + cos(t))), ("q", "v")),
        (lambda: ({V: -Q + sp.cos(T), Q: V}, lambda t, x: (-x[1] + cos(t), x[0])), None),
        (lambda: ([sp.Eq(F.diff(T, 2), -F)], lambda t, x: (-x[1], x[0])), ("w", "F")),
        (lambda: ([F.diff(T, 3) + 2 * F.diff(T, 2) + F], lambda t, x: (x[1], x[2], -2 * x[2] - x[0])), None),
        (lambda: ([F.diff(T, 2) + H.diff(T), H.diff(T) - F], lambda t, x: (x[2], x[0], -x[0])), ("F", "H", "w")),
        (lambda: ([sp.Derivative(F * F.diff(T), T) - 1], lambda t, x: (x[1], (1 - x[1] ** 2) / x[0])), None),
        (lagrange, None),
        (kane, None),
    ],
)
def test_forms_of_equations(given: Callable[[], Any], coordinates: Any) -> None:
    equations, expected = given()
    system = ForcedSystem.from_sympy(equations, {M: 0.1}, 2 * sp.pi, coordinates)
    state = X[: system.dimension] if system.dimension < 4 else (*X, 0.9)
    assert system.derivative(0.6, state) == pytest.approx(expected(0.6, state), rel=1e-14)


@pytest.mark.parametrize(
    ("force", "value"),
    [
        (sp.Piecewise((2 * Q, Q > 0), (Q, True)), lambda q: 2 * q if q > 0 else q),
        (sp.sign(Q) + sp.Abs(Q), lambda q: (q > 0) - (q < 0) + abs(q)),
        (sp.Heaviside(Q, 0), lambda q: float(q > 0)),
        (sp.Mod(Q, 1), lambda q: q % 1),
        (sp.Max(Q, 0) - sp.Min(Q, V), lambda q: max(q, 0) - min(q, -0.7)),
        (sp.sec(Q) + sp.coth(1 + Q**2), lambda q: 1 / cos(q) + 1 / float(sp.tanh(1 + q * q))),
    ],
)
def test_functions_of_sympy(force: Any, value: Callable[[float], float]) -> None:
    system = ForcedSystem.from_sympy([V, force], {}, 1.0, ("q", "v"))
    assert stroboscopic_map(system).unknown_formulas == ""
    for q in (-0.3, 0.8):
        assert system.derivative(0.0, (q, -0.7))[1] == pytest.approx(value(q), rel=1e-14)


@pytest.mark.parametrize(
    ("equations", "coordinates", "words"),
    [
        ([F.diff(T, 2) - K * F], None, "give a value for k"),
        ([F.diff(T) - H], None, r"H\(t\), of which no derivative is given"),
        ([F.diff(T) ** 2], None, "not linear in the highest derivatives"),
        ([F.diff(T) + H.diff(T), 2 * F.diff(T) + 2 * H.diff(T)], None, "Singular"),
        ([V, Q], None, "2 expressions without derivatives"),
        ([F.diff(T, 2)], ("q", "v"), "give 2, of which F and names"),
        ([sp.Function("u")(T, Q).diff(T)], None, "functions of time alone"),
        (["__import__('os')"], ("q",), "give expressions and equations of SymPy"),
    ],
)
def test_what_is_no_system_is_refused(equations: Any, coordinates: Any, words: str) -> None:
    with pytest.raises((TypeError, ValueError), match=words):
        ForcedSystem.from_sympy(equations, {}, 1.0, coordinates)
