"""Chains of pendulums, against the Lagrangian, the mass-matrix form and the numbers of tests/REFERENCES.md."""

from __future__ import annotations

from itertools import product
from math import cos, exp, pi, sin, sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp

from cellmap import ForcedSystem, stroboscopic_map
from cellmap._compiled.codegen.kernel import traced_function
from cellmap._compiled.codegen.rebind import rebind
from cellmap._compiled.codegen.trace import STATEFUL, TIMED
from cellmap.maps import jacobian
from systems import (
    Chain,
    ConstantTorque,
    DryFriction,
    Effect,
    Gravity,
    QuadraticDrag,
    RotatingDrive,
    Terms,
    TorqueDrive,
    TorsionSpring,
    VerticalDrive,
    ViscousDamping,
    chain_pendulum,
    double_pendulum,
    driven_pendulum,
    scene,
    triple_pendulum,
)
from systems.forces import Acting, combined

W = 2.0 * pi * 50.0
LINKS = (0.11, 0.07, 0.05, 0.13, 0.09, 0.06, 0.1, 0.08)
MASSES = (0.3, 0.5, 0.2, 0.7, 0.4, 0.25, 0.35, 0.45)


def dense(
    system: ForcedSystem, links: int, up: float, aside: float, joints: NDArray[np.float64], x: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Accelerations by M q'' = F of REFERENCES.md, with the angular accelerations at the joints given."""
    length = np.array([system.params[f"length_{i + 1}"] for i in range(links)])
    mass = np.array([system.params[f"mass_{i + 1}"] for i in range(links)])
    carried = np.cumsum(mass[::-1])[::-1]
    angles, rates = x[:links], x[links:]
    i = np.arange(links)
    inertia = carried[np.maximum.outer(i, i)] * np.outer(length, length)
    apart = angles[:, None] - angles[None, :]
    torques = mass[0] * length[0] ** 2 * np.append(joints, 0.0)
    force = -(inertia * np.sin(apart)) @ rates**2
    force -= carried * length * (up * np.sin(angles) + aside * np.cos(angles))
    force += torques[:-1] - torques[1:]
    return np.linalg.solve(inertia * np.cos(apart), force)


def relative(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.diff(values, prepend=0.0)


@pytest.mark.parametrize("links", [1, 2, 3, 5, 8])
def test_the_mass_matrix_form(links: int) -> None:
    """All effects at once: gravity, a drive in both directions, every kind of friction, springs, torque."""
    effects = (
        Gravity(9.8),
        RotatingDrive(0.004, 0.007, 3.0, 0.3),
        ViscousDamping(1.5),
        QuadraticDrag(0.2),
        DryFriction(2.5),
        TorsionSpring(6.0, 0.2),
        ConstantTorque(1.1),
    )
    system = scene(Chain(LINKS[:links], MASSES[:links]), *effects)
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
    upward = Gravity(9.8).terms, ViscousDamping(1.0).terms, Terms(vertical=lambda t, p: p.lift)
    rhs = rebind(
        Chain.compose(combined([Acting(terms) for terms in upward], links)), {"sin": sympy.sin, "cos": sympy.cos}
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
    return sympy, [r.doit().subs(place) for r in residuals], angles


def test_the_equation_of_lagrange_is_an_identity() -> None:
    """Two links: the numerators of the residuals vanish as polynomials, with cos^2 = 1 - sin^2."""
    sympy, residuals, angles = lagrange(2)
    sines, cosines = sympy.symbols("s1:3"), sympy.symbols("c1:3")
    table = dict(zip([f(a) for f in (sympy.sin, sympy.cos) for a in angles], [*sines, *cosines], strict=True))
    circles = [c**2 + s**2 - 1 for s, c in zip(sines, cosines, strict=True)]
    for residual in residuals:
        numerator = sympy.numer(sympy.together(sympy.expand_trig(residual).xreplace(table)))
        _, rest = sympy.reduced(sympy.expand(numerator), circles, *cosines, *sines)
        assert rest == 0


def test_the_equation_of_lagrange_at_random_states() -> None:
    """Three links, with 40 digits."""
    import mpmath

    sympy, residuals, _ = lagrange(3)
    symbols = sorted(set().union(*[r.free_symbols for r in residuals]), key=str)
    function = sympy.lambdify(symbols, residuals, "mpmath", cse=True)
    rng = np.random.default_rng(0)
    with mpmath.workdps(40):
        for _ in range(3):
            values = map(mpmath.mpf, rng.uniform(0.3, 2.0, len(symbols)).tolist())
            assert max(abs(r) for r in function(*values)) < 1e-30


def test_the_explicit_double_pendulum() -> None:
    """(13) to (20) of the report, corrected: theta from down, y up."""
    system = double_pendulum(0.3, 0.2, 0.7, 0.4, amplitude=0.01, frequency=4.0, damping=0.0)
    rng = np.random.default_rng(1)
    m1, m2, l1, l2 = 0.7, 0.4, 0.3, 0.2
    for t in (0.0, 0.03, 0.11):
        a, b, u, v = rng.uniform(-4.0, 4.0, 4)
        d, field = a - b, 9.8 - 0.01 * (8.0 * pi) ** 2 * cos(8.0 * pi * t)
        share = 2.0 * (m1 + m2 * sin(d) ** 2)
        first = m2 * (l1 * u * u * sin(2 * d) + 2 * l2 * v * v * sin(d))
        first += field * ((2 * m1 + m2) * sin(a) + m2 * sin(a - 2 * b))
        second = m2 * l2 * v * v * sin(2 * d)
        second += (m1 + m2) * (2 * l1 * u * u * sin(d) + field * (sin(2 * a - b) - sin(b)))
        assert system.derivative(t, (a, b, u, v)) == pytest.approx(
            (u, v, -first / (l1 * share), second / (l2 * share)), rel=1e-12
        )


def test_the_double_pendulum_after_one_period() -> None:
    strobe = stroboscopic_map(double_pendulum(damping=0.0), rtol=1e-12, atol=1e-12)
    scale = np.array([1.0, 1.0, W, W])
    expected = (2.039335961693, 0.736205328087, 0.119529455898, 0.271635760474)
    assert strobe(np.array([1.0, -0.5, 0.2, 0.1]) * scale) / scale == pytest.approx(expected, abs=1e-11)


def linear_modes(system: ForcedSystem, state: tuple[float, ...]) -> NDArray[np.float64]:
    """Eigenvalues lambda of small motions q'' = -g lambda q about an equilibrium, by complex steps."""
    links = len(state)
    rhs = rebind(system.rhs, {"sin": np.sin, "cos": np.cos})
    columns = []
    for j in range(links):
        x = [*map(complex, state), *[0j] * links]
        x[j] += 1e-30j
        columns.append([v.imag / 1e-30 for v in rhs(0.0, tuple(x), system.parameters)[links:]])
    return np.sort(np.linalg.eigvals(-np.array(columns).T / 9.8).real)


@pytest.mark.parametrize("ratio", [0.25, 1.0])
def test_small_motions_about_the_four_rest_states(ratio: float) -> None:
    system = double_pendulum(mass_2=ratio, amplitude=0.0, damping=0.0)
    r, length = 1.0 + ratio, 0.032
    both = np.array([r - sqrt(r * r - r), r + sqrt(r * r - r)]) / length
    flipped = np.array([-sqrt(r), sqrt(r)]) / length
    assert linear_modes(system, (0.0, 0.0)) == pytest.approx(both, rel=1e-13)
    assert linear_modes(system, (pi, pi)) == pytest.approx(-both[::-1], rel=1e-13)
    assert linear_modes(system, (0.0, pi)) == pytest.approx(flipped, rel=1e-13)
    assert linear_modes(system, (pi, 0.0)) == pytest.approx(flipped, rel=1e-13)


@pytest.mark.parametrize("state", list(product((0.0, pi), repeat=3)))
def test_small_motions_of_the_triple_pendulum(state: tuple[float, ...]) -> None:
    """Eigenvalues of M^-1 K with M_ij = mu_max l_i l_j s_i s_j and K = diag(mu_i l_i s_i)."""
    system = triple_pendulum(0.03, 0.02, 0.05, 0.5, 0.7, 0.3, amplitude=0.0, damping=0.0)
    length, signs = np.array([0.03, 0.02, 0.05]), np.cos(state)
    carried = np.array([1.5, 1.0, 0.3])
    i = np.arange(3)
    inertia = carried[np.maximum.outer(i, i)] * np.outer(length * signs, length * signs)
    expected = np.sort(np.linalg.eigvals(np.linalg.solve(inertia, np.diag(carried * length * signs))).real)
    assert linear_modes(system, state) == pytest.approx(expected, rel=1e-12)


def floquet(system: ForcedSystem, state: tuple[float, ...]) -> float:
    """Largest multiplier of an equilibrium, by the linear equation along it."""
    n = 2 * len(state)
    rhs = rebind(system.rhs, {"sin": np.sin, "cos": np.cos})

    def fun(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        columns = []
        for j in range(n):
            x = [*map(complex, state), *[0j] * len(state)]
            x[j] += 1e-30j
            columns.append([np.imag(v) / 1e-30 for v in rhs(t, tuple(x), system.parameters)])
        return (np.array(columns).T @ y.reshape(n, n)).ravel()

    solution = solve_ivp(fun, (0.0, system.length), np.eye(n).ravel(), method="DOP853", rtol=1e-10, atol=1e-12)
    return float(np.abs(np.linalg.eigvals(solution.y[:, -1].reshape(n, n))).max())


def test_with_the_defaults_every_rest_state_is_stable() -> None:
    for system, links in ((double_pendulum(), 2), (triple_pendulum(), 3)):
        for state in product((0.0, pi), repeat=links):
            assert floquet(system, state) < 1.0


@pytest.mark.parametrize(
    ("amplitude", "stable"), [(3.52e-3, True), (3.53e-3, False), (4.44e-3, False), (4.46e-3, False), (9.54e-3, False)]
)
def test_the_hanging_double_pendulum_at_24_hz(amplitude: float, stable: bool) -> None:
    """Equal masses, undamped: stable below 3.523140841 mm."""
    system = double_pendulum(mass_2=1.0, amplitude=amplitude, frequency=24.0, damping=0.0)
    assert (floquet(system, (0.0, 0.0)) < 1.0 + 1e-6) == stable


@pytest.mark.parametrize(
    ("amplitude", "stable"), [(4.45e-3, False), (4.455e-3, True), (9.54e-3, True), (9.55e-3, False)]
)
def test_the_flipping_states_at_24_hz(amplitude: float, stable: bool) -> None:
    """Equal masses, undamped: both stable from 4.452842149 to 9.546244854 mm, (pi, pi) never."""
    system = double_pendulum(mass_2=1.0, amplitude=amplitude, frequency=24.0, damping=0.0)
    for state in ((0.0, pi), (pi, 0.0)):
        assert (floquet(system, state) < 1.0 + 1e-6) == stable
    assert floquet(system, (pi, pi)) > 1.01


def test_a_light_outer_mass_leaves_the_single_pendulum() -> None:
    """Mass ratio 1e-6: REFERENCES.md has a difference of 5.7e-7 in units of the drive."""
    strobe = stroboscopic_map(double_pendulum(mass_2=1e-6, damping=0.0), rtol=1e-12, atol=1e-12)
    single = stroboscopic_map(driven_pendulum(0.032, 0.006, 50.0, 0.0), rtol=1e-12, atol=1e-12)
    image = strobe(np.array([1.0, -0.5, 0.2 * W, 0.1 * W]))[[0, 2]] / [1.0, W]
    difference = np.abs(image - single([1.0, 0.2 * W]) / [1.0, W]).max()
    assert difference == pytest.approx(5.7e-7, abs=5e-9)


@pytest.mark.parametrize("ratio", [1e-9, 1e9])
def test_extreme_masses_keep_their_digits(ratio: float) -> None:
    """The elimination from the tip subtracts nothing that is nearly equal."""
    import mpmath

    system = double_pendulum(mass_1=1.0, mass_2=ratio)
    x = (1.0, -0.5, 60.0, 30.0)
    with mpmath.workdps(40):
        rhs = rebind(system.rhs, {"sin": mpmath.sin, "cos": mpmath.cos})
        exact = rhs(mpmath.mpf(0), tuple(map(mpmath.mpf, x)), system.parameters)
        assert system.derivative(0.0, x) == pytest.approx([float(v) for v in exact], rel=1e-14)


def test_one_link_is_the_single_pendulum() -> None:
    one = chain_pendulum((0.0272,), (0.4,))
    initial_conditions = np.random.default_rng(3).uniform(-3.0, 3.0, (20, 2)) * [1.0, 30.0]
    assert [c.name for c in one.axes] == ["theta1", "theta1'"]
    assert stroboscopic_map(one)(initial_conditions) == pytest.approx(
        stroboscopic_map(driven_pendulum())(initial_conditions), rel=1e-8, abs=1e-8
    )


def test_energy_is_kept_by_what_keeps_it() -> None:
    """Gravity and springs, no drive and no friction."""
    for effects in ((Gravity(9.8),), (Gravity(9.8), TorsionSpring(30.0, 0.4)), (TorsionSpring(30.0, 0.4),), ()):
        system = scene(Chain(LINKS[:4], MASSES[:4]), *effects, period=1.0)
        start = np.array([1.0, -2.0, 0.5, 3.0, 4.0, -2.0, 0.0, 1.0])
        solution = solve_ivp(system.fun, (0.0, 1.0), start, method="DOP853", rtol=1e-12, atol=1e-12)
        energies = system.output("energy", solution.t, solution.y.T)
        assert not effects or np.ptp(energies[:, 0]) > 1e-3
        assert energies.sum(axis=-1) == pytest.approx(energies[0].sum(), rel=1e-9)


def test_viscous_damping_takes_what_the_joints_take() -> None:
    """d(energy)/dt = -gamma m_1 l_1^2 (sum of the squares of relative rates)."""
    system = chain_pendulum(LINKS[:3], MASSES[:3], amplitude=0.0, damping=3.0)
    x = np.array([0.4, 2.0, -1.0, 3.0, -1.0, 2.0])
    derivative = system.fun(0.0, x)
    h = 1e-6
    slope = (system.output("energy", 0.0, x + h * derivative) - system.output("energy", 0.0, x - h * derivative)).sum()
    lost = 3.0 * MASSES[0] * LINKS[0] ** 2 * (relative(x[3:]) ** 2).sum()
    assert slope / (2.0 * h) == pytest.approx(-lost, rel=1e-7)


def test_volumes_shrink_as_liouville_says() -> None:
    """det DP = det M(q0) / det M(q(T)) exp(-int tr(M^-1 C)), with C of the joints."""
    system = double_pendulum()
    start = np.array([1.0, -0.5, 60.0, 30.0])
    unit = 0.032**2

    def inertia(x: Any) -> NDArray[np.float64]:
        lean = 0.25 * cos(x[0] - x[1])
        return unit * np.array([[1.25, lean], [lean, 0.25]])

    solution = solve_ivp(system.fun, (0.0, 0.02), start, method="DOP853", rtol=1e-12, atol=1e-12, dense_output=True)
    damping = 10.0 * unit * np.array([[2.0, -1.0], [-1.0, 1.0]])
    lost = quad(lambda t: np.trace(np.linalg.solve(inertia(solution.sol(t)), damping)), 0.0, 0.02, epsabs=1e-10)[0]
    ratio = np.linalg.det(inertia(start)) / np.linalg.det(inertia(solution.y[:, -1]))
    scale = np.array([1.0, 1.0, 100.0, 100.0])
    matrix = jacobian(stroboscopic_map(system, rtol=1e-11, atol=1e-11), start) * (scale[None, :] / scale[:, None])
    assert np.linalg.det(matrix) == pytest.approx(ratio * exp(-lost), rel=1e-8)


def test_dry_friction_acts_on_relative_rates() -> None:
    system = double_pendulum(friction=2.5, damping=0.0, amplitude=0.0)
    x = (0.3, 0.2, 3.0, 1.0)
    assert system.switches is not None
    assert system.switches(0.0, x, system.parameters) == (3.0, -2.0)
    assert system.signs(0.0, (0.3, 0.2, 3.0, 3.0)) == (1.0, 0.0)
    free = double_pendulum(damping=0.0, amplitude=0.0)
    for signs in product((-1.0, 0.0, 0.4, 1.0), repeat=2):
        joints = -2.5 * np.array(signs)
        expected = dense(free, 2, 9.8, 0.0, joints, np.array(x))
        assert system.derivative(0.0, x, signs)[2:] == pytest.approx(expected, rel=1e-13)
    corners = [np.array(system.derivative(0.0, x, s)) for s in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))]
    assert corners[0] + corners[3] == pytest.approx(corners[1] + corners[2], rel=1e-13)  # affine: no product of signs


@pytest.mark.parametrize(
    ("effects", "lanes", "before"),
    [
        ((), {"sin": 2, "cos": 2, "div": 1}, {}),
        ((Gravity(9.8),), {"sin": 2, "cos": 2, "div": 1}, {}),
        ((Gravity(9.8), VerticalDrive(0.006, 50.0)), {"sin": 2, "cos": 2, "div": 1}, {"cos": 1}),
        ((Gravity(9.8), RotatingDrive(0.006, 0.006, 50.0)), {"sin": 2, "cos": 2, "div": 1}, {"sin": 1, "cos": 1}),
        ((TorqueDrive(1.0, 50.0),), {"sin": 2, "cos": 2, "div": 1}, {"cos": 1}),
    ],
)
def test_what_the_trace_of_the_double_pendulum_holds(
    effects: tuple[Effect, ...], lanes: dict[str, int], before: dict[str, int]
) -> None:
    system = scene(Chain((0.032, 0.032), (1.0, 0.25)), *effects, period=0.02)
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
    counts = [operations(chain_pendulum(LINKS[:n], MASSES[:n])) for n in range(1, 9)]
    steps = np.diff(counts)[1:]
    assert (steps == steps[-1]).sum() >= 5
    assert counts[1] <= 45 and counts[7] <= 330
    assert operations(double_pendulum(damping=0.0)) <= 35


def test_chains_of_as_many_links_share_their_right_hand_side() -> None:
    assert double_pendulum().rhs is chain_pendulum((1.0, 2.0), (3.0, 4.0)).rhs
    assert double_pendulum().rhs is not triple_pendulum().rhs
    assert double_pendulum(friction=0.0).switches is None
    assert double_pendulum(friction=1.0).rhs is double_pendulum(friction=2.0).rhs is not double_pendulum().rhs


def test_places_of_the_masses() -> None:
    system = triple_pendulum(1.0, 2.0, 3.0, amplitude=0.5, frequency=1.0)
    x = (pi / 2, 0.0, pi, 0.0, 0.0, 0.0)
    assert system.output("positions", 0.0, x) == pytest.approx([0.0, 0.5, 1.0, 0.5, 1.0, -1.5, 1.0, 1.5], abs=1e-15)
    assert system.output("positions", [0.25, 0.5], [x, x]).shape == (2, 8)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Chain((1.0, 0.0), (1.0, 1.0)), ValueError, "length_2=0.0: give a number above 0"),
        (lambda: Chain((1.0, 1.0), (1.0, -1.0)), ValueError, "mass_2=-1.0: give a number above 0"),
        (lambda: Chain((1.0, 1.0), (1.0,)), ValueError, r"masses=\(1.0,\): give one for each of the 2 lengths"),
        (lambda: Chain((), ()), ValueError, r"lengths=\(\): give at least one number"),
        (lambda: Chain(1.0, 1.0), TypeError, "lengths=1.0: give a sequence of numbers"),  # type: ignore[arg-type]
        (lambda: Chain("12", "12"), TypeError, "lengths='12': give a sequence of numbers"),  # type: ignore[arg-type]
        (lambda: double_pendulum(friction=-1.0), ValueError, "friction=-1.0: give a number of at least 0"),
        (lambda: triple_pendulum(length_3=-1.0), ValueError, "length_3=-1.0: give a number above 0"),
    ],
)
def test_bad_chains_are_refused(make: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()


def test_a_period_of_three_links_is_that_of_scipy() -> None:
    system = triple_pendulum()
    initial_conditions = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 6)) * [pi, pi, pi, 50.0, 50.0, 50.0]
    images = stroboscopic_map(system).iterate(initial_conditions, 1).unwrapped
    for state, image in zip(initial_conditions, images, strict=True):
        exact = solve_ivp(system.fun, (0.0, system.length), state, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        assert image == pytest.approx(exact, rel=1e-8, abs=1e-8)
