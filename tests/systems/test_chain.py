"""Chains of pendulums, against the Lagrangian, the mass-matrix form and the numbers of tests/REFERENCES.md."""

from __future__ import annotations

from math import cos, pi, sin
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from chain_equations import LINKS, MASSES, dense, relative

import systems
from cellmap import ForcedSystem
from cellmap._compiled.codegen.kernel import traced_function
from cellmap._compiled.codegen.rebind import rebind
from cellmap._compiled.codegen.trace import STATEFUL, TIMED
from systems.forces import Acting, combined


@pytest.mark.parametrize("links", [1, 2, 3, 5, 8])
def test_the_mass_matrix_form(links: int) -> None:
    """All effects at once: gravity, a drive in both directions, every kind of friction, springs, torque."""
    effects = (
        systems.Gravity(9.8),
        systems.RotatingDrive(0.004, 0.007, 3.0, 0.3),
        systems.ViscousDamping(1.5),
        systems.QuadraticDrag(0.2),
        systems.DryFriction(2.5),
        systems.TorsionSpring(6.0, 0.2),
        systems.ConstantTorque(1.1),
    )
    system = systems.scene(systems.Chain(LINKS[:links], MASSES[:links]), *effects)
    rng = np.random.default_rng(links)
    w = 6.0 * pi
    for t in (0.0, 0.1, 0.27):
        x = rng.uniform(-4.0, 4.0, 2 * links)
        s = rng.uniform(-1.0, 1.0, links)
        angle, rate = relative(x[:links]), relative(x[links:])
        joints = -1.5 * rate - 0.2 * rate**2 * s - 2.5 * s - 6.0 * (angle - 0.2)
        joints[0] += 1.1
        up = 9.8 - 0.004 * w * w * cos(w * t + 0.3)
        aside = 0.007 * w * w * sin(w * t + 0.3)
        expected = dense(system, links, up, aside, joints, x)
        seen = system.derivative(t, tuple(x), tuple(s))
        assert seen[:links] == tuple(x[links:])
        assert seen[links:] == pytest.approx(expected, rel=1e-11, abs=1e-11)


def lagrange(links: int) -> Any:
    """Residuals of the equations of Lagrange, with Rayleigh's dissipation, for the accelerations of a chain."""
    sympy = pytest.importorskip("sympy")
    t, g, lift, damping = sympy.symbols("t g Y gamma")
    lengths, masses = sympy.symbols(f"l1:{links + 1}"), sympy.symbols(f"m1:{links + 1}")
    functions = [sympy.Function(f"q{i}")(t) for i in range(links)]
    x, y, kinetic, potential = 0, sympy.Function("y")(t), 0, 0
    pivot = y
    for q, length, mass in zip(functions, lengths, masses, strict=True):
        x, y = x + length * sympy.sin(q), y - length * sympy.cos(q)
        kinetic += mass * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2
        potential += mass * g * y
    rates = [q.diff(t) for q in functions]
    lost = masses[0] * lengths[0] ** 2 * damping / 2
    lost *= sum((r - b) ** 2 for r, b in zip(rates, [0, *rates[:-1]], strict=True))
    residuals = [
        (kinetic - potential).diff(r).diff(t) - (kinetic - potential).diff(q) + lost.diff(r)
        for q, r in zip(functions, rates, strict=True)
    ]
    upward = systems.Gravity(9.8).terms, systems.ViscousDamping(1.0).terms, systems.Terms(vertical=lambda t, p: p.lift)
    rhs = rebind(
        systems.Chain.compose(combined([Acting(terms) for terms in upward], links)),
        {"sin": sympy.sin, "cos": sympy.cos},
    )
    values = {f"length_{i + 1}": v for i, v in enumerate(lengths)}
    values |= {f"mass_{i + 1}": v for i, v in enumerate(masses)}
    p = SimpleNamespace(**values, gravity=g, damping=damping, lift=lift)
    angles, speeds = sympy.symbols(f"a1:{links + 1}"), sympy.symbols(f"b1:{links + 1}")
    found = rhs(t, (*angles, *speeds), p)[links:]
    found = [e.xreplace({f: sympy.Rational(f) for f in e.atoms(sympy.Float)}) for e in found]
    place = [(pivot.diff(t, 2), lift), (pivot.diff(t), sympy.Symbol("V"))]
    place += [(q.diff(t, 2), f) for q, f in zip(functions, found, strict=True)]
    place += [(r, b) for r, b in zip(rates, speeds, strict=True)]
    place += [(q, a) for q, a in zip(functions, angles, strict=True)]
    return sympy, [r.doit().subs(place) for r in residuals]


@pytest.mark.thorough
def test_the_equation_of_lagrange_at_random_states() -> None:
    """Three links, with 40 digits."""
    import mpmath

    sympy, residuals = lagrange(3)
    symbols = sorted(set().union(*[r.free_symbols for r in residuals]), key=str)
    function = sympy.lambdify(symbols, residuals, "mpmath", cse=True)
    rng = np.random.default_rng(0)
    with mpmath.workdps(40):
        for _ in range(3):
            values = map(mpmath.mpf, rng.uniform(0.3, 2.0, len(symbols)).tolist())
            assert max(abs(r) for r in function(*values)) < 1e-30


def test_the_explicit_double_pendulum() -> None:
    """(13) to (20) of the report, corrected: theta from down, y up."""
    system = systems.double_pendulum(0.3, 0.2, 0.7, 0.4, amplitude=0.01, frequency=4.0, damping=0.0)
    rng = np.random.default_rng(1)
    m1, m2, l1, l2 = 0.7, 0.4, 0.3, 0.2
    for t in (0.0, 0.03, 0.11):
        a, b, u, v = rng.uniform(-4.0, 4.0, 4)
        d, field = a - b, 9.8 - 0.01 * (8.0 * pi) ** 2 * cos(8.0 * pi * t)
        term = 2.0 * (m1 + m2 * sin(d) ** 2)
        first = m2 * (l1 * u * u * sin(2 * d) + 2 * l2 * v * v * sin(d))
        first += field * ((2 * m1 + m2) * sin(a) + m2 * sin(a - 2 * b))
        second = m2 * l2 * v * v * sin(2 * d)
        second += (m1 + m2) * (2 * l1 * u * u * sin(d) + field * (sin(2 * a - b) - sin(b)))
        assert system.derivative(t, (a, b, u, v)) == pytest.approx(
            (u, v, -first / (l1 * term), second / (l2 * term)), rel=1e-12
        )


@pytest.mark.parametrize(
    ("effects", "lanes", "before"),
    [
        ((systems.Gravity(9.8), systems.VerticalDrive(0.006, 50.0)), {"sin": 2, "cos": 2, "div": 1}, {"cos": 1}),
        (
            (systems.Gravity(9.8), systems.RotatingDrive(0.006, 0.006, 50.0)),
            {"sin": 2, "cos": 2, "div": 1},
            {"sin": 1, "cos": 1},
        ),
        ((systems.TorqueDrive(1.0, 50.0),), {"sin": 2, "cos": 2, "div": 1}, {"cos": 1}),
    ],
)
def test_what_the_trace_of_the_double_pendulum_holds(
    effects: tuple[systems.Effect, ...], lanes: dict[str, int], before: dict[str, int]
) -> None:
    system = systems.scene(systems.Chain((0.032, 0.032), (1.0, 0.25)), *effects, period=0.02)
    costly = {"sin", "cos", "div"}
    trace = traced_function(system.rhs, 4, tuple(system.params))
    assert trace is not None and trace.is_analytic
    levels = trace.levels()
    for level, expected in ((STATEFUL, lanes), (TIMED, before)):
        names = [n.operation for n in levels if n.arguments and levels[n] == level and n.operation in costly]
        assert {n: names.count(n) for n in names} == expected
    assert not any(n.operation == "constant" and n.value == 0.0 for n in levels)


def operations(system: ForcedSystem) -> int:
    trace = traced_function(system.rhs, system.dimension, tuple(system.params))
    assert trace is not None
    return sum(1 for n, level in trace.levels().items() if n.arguments and level == STATEFUL)


def test_the_right_hand_side_grows_with_the_number_of_links() -> None:
    counts = [operations(systems.chain_pendulum(LINKS[:n], MASSES[:n])) for n in range(1, 9)]
    steps = np.diff(counts)[1:]
    assert (steps == steps[-1]).sum() >= 5
    assert counts[1] <= 45 and counts[7] <= 330
    assert operations(systems.double_pendulum(damping=0.0)) <= 35


def test_chains_of_as_many_links_share_their_right_hand_side() -> None:
    assert systems.double_pendulum().rhs is systems.chain_pendulum((1.0, 2.0), (3.0, 4.0)).rhs
    assert systems.double_pendulum().rhs is not systems.triple_pendulum().rhs
    assert systems.double_pendulum(friction=0.0).switches is None
    assert (
        systems.double_pendulum(friction=1.0).rhs
        is systems.double_pendulum(friction=2.0).rhs
        is not systems.double_pendulum().rhs
    )


def test_places_of_the_masses() -> None:
    system = systems.triple_pendulum(1.0, 2.0, 3.0, amplitude=0.5, frequency=1.0)
    x = (pi / 2, 0.0, pi, 0.0, 0.0, 0.0)
    assert system.output("positions", 0.0, x) == pytest.approx([0.0, 0.5, 1.0, 0.5, 1.0, -1.5, 1.0, 1.5], abs=1e-15)
    assert system.output("positions", [0.25, 0.5], [x, x]).shape == (2, 8)
