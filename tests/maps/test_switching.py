"""Discontinuous right-hand sides: sliding and sticking, crossings, events in time; against exact solutions and SciPy.

The oracle works on the plain functions of a system and shares nothing with the integrator: it follows one mode at a
time with SciPy's DOP853, and at an event tries every mode and takes the one that is consistent.
"""

from __future__ import annotations

import cmath
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import acos, asin, cos, erf, exp, gamma, inf, pi, sin, sqrt, tan
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from cellmap import ForcedSystem, stroboscopic_map, trajectory
from cellmap._compiled.codegen.kernel import switching_kernel
from cellmap._compiled.codegen.rebind import rebind
from cellmap._compiled.kernels.blocks import LANES
from cellmap._lib.threads import set_threads
from cellmap.maps import jacobian
from cellmap.maps.orbit_batch import CHUNK, Status
from cellmap.orbits import lyapunov_spectrum
from systems import (
    DryFriction,
    Gravity,
    Pendulum,
    QuadraticDrag,
    SquareDrive,
    VerticalDrive,
    ViscousDamping,
    dimensionless_pendulum,
    double_pendulum,
    scene,
    stick_slip_oscillator,
    triple_pendulum,
)

Array = NDArray[np.float64]
Mode = tuple[int, ...]


@dataclass(frozen=True)
class Oracle:
    """Filippov's solution by SciPy.  A mode holds the sign of each switch, and 0 where it slides."""

    system: ForcedSystem

    def heights(self, t: float, x: Array) -> Array:
        assert self.system.switches is not None
        return np.array(self.system.switches(t, tuple(x), self.system.parameters), dtype=float)

    def parts(self, t: float, x: Array) -> tuple[Array, Array, Array, Array]:
        """f_0, g_i, grad h_i and the time derivatives of h_i; derivatives by complex steps."""
        assert self.system.switches is not None
        p, tiny = self.system.parameters, 1e-30
        switches = rebind(self.system.switches, {n: getattr(cmath, n) for n in ("sin", "cos", "exp", "sqrt")})
        normals = np.array(
            [[complex(v).imag for v in switches(t, tuple(x + 1j * tiny * e), p)] for e in np.eye(len(x))]
        ).T
        passing = np.array([complex(v).imag for v in switches(t + 1j * tiny, tuple(map(complex, x)), p)])
        count = len(passing)

        def force(signs: Array) -> Array:
            return np.array(self.system.rhs(t, tuple(x), p, tuple(signs)), dtype=float)

        middle = force(np.zeros(count))
        above, below = (np.array([force(side * e) for e in np.eye(count)]) for side in (1.0, -1.0))
        return (
            middle + (0.5 * (above + below) - middle).sum(axis=0),
            0.5 * (above - below),
            normals / tiny,
            passing / tiny,
        )

    def signs(self, t: float, x: Array, mode: Mode) -> Array:
        result, held = np.array(mode, dtype=float), [e for e, side in enumerate(mode) if side == 0]
        if held:
            f, jumps, normals, passing = self.parts(t, x)
            gains = normals @ jumps.T
            rates = passing + normals @ f + gains @ result
            result[held] = np.linalg.solve(gains[np.ix_(held, held)], -rates[held])
        return result

    def field(self, t: float, x: Array, mode: Mode) -> Array:
        f, jumps, _, _ = self.parts(t, x)
        return f + self.signs(t, x, mode) @ jumps

    def consistent(self, t: float, x: Array, mode: Mode, on: Sequence[int]) -> Mode:
        """Of all modes of the switches on their surfaces the one that violates least what a mode has to meet."""
        f, jumps, normals, passing = self.parts(t, x)
        gains = normals @ jumps.T
        best, least = mode, inf
        for sides in itertools.product((0, 1, -1), repeat=len(on)):
            trial = list(mode)
            for e, side in zip(on, sides, strict=True):
                trial[e] = side
            if any(side == 0 and gains[e, e] >= 0.0 for e, side in zip(on, sides, strict=True)):
                continue
            signs = self.signs(t, x, tuple(trial))
            rates = passing + normals @ f + gains @ signs
            violation = max(
                abs(signs[e]) - 1.0 if side == 0 else -side * rates[e] / max(abs(gains[e, e]), 1e-300)
                for e, side in zip(on, sides, strict=True)
            )
            if violation < least - 1e-9:
                best, least = tuple(trial), violation
        return best

    def image(self, start: ArrayLike, log: list[tuple[float, Array, Mode, Mode]] | None = None) -> Array:
        """State after one period; the log takes time, state, and the modes before and after each event."""
        t, end, x = 0.0, self.system.length, np.array(start, dtype=float)
        heights = self.heights(t, x)
        mode = tuple(map(int, np.sign(heights)))
        mode = self.consistent(t, x, mode, [e for e, side in enumerate(mode) if side == 0]) if 0 in mode else mode
        zeros = [0] * len(mode)  # order of the zero that the height of a switch has at the beginning of its mode
        for _ in range(200):
            events = [self._event(e, mode, zeros[e], t) for e in range(len(mode))]

            def fun(time: float, y: Array, mode: Mode = mode) -> Array:
                return self.field(time, y, mode)

            options: dict[str, Any] = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}
            solution = solve_ivp(fun, (t, end), x, events=events, max_step=0.01 * self.system.length, **options)
            assert solution.status >= 0
            if solution.status == 0:
                return solution.y[:, -1]
            e = next(e for e, times in enumerate(solution.t_events) if len(times))
            # The event is located on the dense output; the last step is taken again to where it really is.
            t, x = solution.t[-2], solution.y[:, -2]
            to = solution.t_events[e][0]
            for _ in range(4):
                y = solve_ivp(fun, (t, to), x, **options).y[:, -1] if to > t else x
                value, delta = events[e](to, y), 1e-7 * self.system.length
                slope = (events[e](to + delta, y + delta * fun(to, y)) - value) / delta
                if slope == 0.0 or abs(value / slope) < 1e-16 * self.system.length:
                    break
                to = max(t, to - value / slope)
            t, x = to, solve_ivp(fun, (t, to), x, **options).y[:, -1] if to > t else x
            before, zeros = mode, [0] * len(mode)
            if mode[e] == 0:
                mode = (*mode[:e], int(np.sign(self.signs(t, x, mode)[e])), *mode[e + 1 :])
                zeros[e] = 2
            else:
                normal = self.parts(t, x)[2][e]
                if normal.any():
                    x = x - normal * (self.heights(t, x)[e] / (normal @ normal))
                on = [e, *(i for i, side in enumerate(mode) if side == 0)]
                mode = self.consistent(t, x, mode, on)
                zeros = [int(i in on and side != 0) for i, side in enumerate(mode)]
            if log is not None:
                log.append((t, x, before, mode))
        raise AssertionError("no end of events")

    def _event(self, e: int, mode: Mode, zero: int, begin: float) -> Callable[[float, Array], float]:
        def event(t: float, y: Array) -> float:
            if mode[e] == 0:
                return 1.0 - abs(self.signs(t, y, mode)[e])
            passed = (t - begin) / self.system.length
            if zero and passed < 1e-9:
                return 1.0
            return mode[e] * self.heights(t, y)[e] / passed**zero

        event.terminal = True  # type: ignore[attr-defined]
        event.direction = -1.0  # type: ignore[attr-defined]
        return event


def differences(oracle: Oracle, start: Array, scale: Array, h: float = 2e-5) -> Array:
    """Derivative of the oracle's image by central differences of order 4, in units of the scale."""
    columns = []
    for direction in np.diag(scale):
        values = [oracle.image(start + k * h * direction) for k in (-2, -1, 1, 2)]
        columns.append((values[0] - 8.0 * values[1] + 8.0 * values[2] - values[3]) / (12.0 * h * scale))
    return np.array(columns).T


# Agreement with the oracle


def curved(t: float, x: Any, p: Any) -> tuple[float]:
    return (x[0] + 0.3 * x[1] + 0.1 * x[0] ** 2,)


def moving(t: float, x: Any, p: Any) -> tuple[float]:
    return (x[0] + 0.4 * x[1] - 0.5 * sin(t) - 0.1 * cos(2.0 * t),)


def relay(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
    return x[1], -p.thrust * s[0] - 0.3 * x[0] - 0.05 * x[1] + 0.7 * cos(t)


def two_masses(t: float, x: Any, p: Any, s: Any) -> tuple[float, ...]:
    """Two masses on springs, one rubbing on the table and the other on the first."""
    a, b, u, v = x
    first, second = p.table * s[0], p.between * s[1]
    return u, v, -a - 0.5 * (a - b) - first + second + p.force * cos(t), -0.7 * b - 0.5 * (b - a) - 2.0 * second


def two_speeds(t: float, x: Any, p: Any) -> tuple[float, float]:
    return x[2], x[3] - x[2]


def relay_at(thrust: float, switches: Any) -> ForcedSystem:
    return ForcedSystem(relay, {"thrust": thrust}, 2.0 * pi, ("x", "v"), switches=switches)


def masses_at(table: float, between: float, force: float = 1.0) -> ForcedSystem:
    params = {"table": table, "between": between, "force": force}
    return ForcedSystem(two_masses, params, 2.0 * pi, ("a", "b", "u", "v"), switches=two_speeds)


def with_effects(*effects: Any) -> ForcedSystem:
    return scene(Pendulum(1.0), *effects)


DRIVE = VerticalDrive(amplitude=0.3, frequency=1.0)
CASES: dict[str, tuple[Callable[[], ForcedSystem], tuple[float, ...]]] = {
    "weak dry friction": (lambda: dimensionless_pendulum(0.5, 0.3, 0.03, 0.01), (pi, 2.0)),
    "dry friction": (lambda: dimensionless_pendulum(0.5, 0.3, 0.03, 0.2), (pi, 2.0)),
    "strong dry friction": (lambda: dimensionless_pendulum(0.5, 0.3, 0.03, 0.5), (pi, 2.0)),
    "curved surface, crossed": (lambda: relay_at(0.3, curved), (2.0, 2.0)),
    "curved surface": (lambda: relay_at(1.5, curved), (2.0, 2.0)),
    "Stribeck": (lambda: stick_slip_oscillator(), (1.0, 1.0)),
    "strongly forced Stribeck": (lambda: stick_slip_oscillator(forcing=0.6), (1.0, 1.0)),
    "two masses": (lambda: masses_at(0.3, 0.15), (1.0, 1.0, 1.0, 1.0)),
    "two masses, often stuck": (lambda: masses_at(0.7, 0.2), (1.0, 1.0, 1.0, 1.0)),
}
SLOW_CASES: dict[str, tuple[Callable[[], ForcedSystem], tuple[float, ...]]] = {
    "moving surface, crossed": (lambda: relay_at(0.3, moving), (2.0, 2.0)),
    "moving surface": (lambda: relay_at(1.5, moving), (2.0, 2.0)),
    "no gravity": (lambda: with_effects(DryFriction(2.0), DRIVE), (pi, 5.0)),
    "all frictions": (
        lambda: with_effects(Gravity(9.8), DryFriction(2.0), ViscousDamping(0.2), QuadraticDrag(0.3), DRIVE),
        (pi, 8.0),
    ),
    "square wave": (
        lambda: with_effects(Gravity(9.8), DryFriction(2.0), SquareDrive(10.0, 1.0, phase=0.3)),
        (pi, 8.0),
    ),
    "double pendulum, weak": (lambda: double_pendulum(friction=20.0, damping=5.0), (pi, pi, 30.0, 30.0)),
    "double pendulum": (lambda: double_pendulum(friction=600.0, damping=5.0), (pi, pi, 30.0, 30.0)),
    "double pendulum, often stuck": (lambda: double_pendulum(friction=3000.0, damping=5.0), (pi, pi, 30.0, 30.0)),
    "double pendulum, heavy tip": (
        lambda: double_pendulum(friction=600.0, damping=5.0, mass_2=50.0),
        (pi, pi, 30.0, 30.0),
    ),
    "double pendulum, light tip": (
        lambda: double_pendulum(friction=600.0, damping=5.0, mass_2=1e-3),
        (pi, pi, 30.0, 30.0),
    ),
}
EVERY_CASE = {**CASES, **SLOW_CASES}
AT_ONCE = ("weak dry friction",)


def starts_of(span: Sequence[float], count: int) -> Array:
    return np.random.default_rng(1).uniform(-1.0, 1.0, (count, len(span))) * span


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        *[(name, 1e-9) for name in CASES if "masses" not in name and "Stribeck" not in name],
        *[pytest.param(name, 1e-9, marks=pytest.mark.slow) for name in CASES if "Stribeck" in name],
        *[pytest.param(name, 1e-6, marks=pytest.mark.slow) for name in CASES if "masses" in name],
        *[pytest.param(name, 1e-12, marks=pytest.mark.slow) for name in EVERY_CASE],
        *[pytest.param("dry friction", t, marks=pytest.mark.slow) for t in (1e-4, 1e-6, 1e-13)],
    ],
)
def test_images_agree_with_the_oracle(name: str, tolerance: float, allowance: Callable[..., Array]) -> None:
    make, span = EVERY_CASE[name]
    system, initial_conditions = make(), starts_of(span, 12)
    oracle = Oracle(system)
    images = stroboscopic_map(system, rtol=tolerance, atol=tolerance).iterate(initial_conditions, 1)
    assert (images.status == Status.OK).all()
    exact = np.array([oracle.image(start) for start in initial_conditions])
    floor = 1e-11 * np.abs(exact).max()
    assert (np.abs(images.unwrapped - exact) <= floor + allowance(system, exact, tolerance, tolerance)).all()


@pytest.mark.parametrize("name", [n if n in AT_ONCE else pytest.param(n, marks=pytest.mark.slow) for n in EVERY_CASE])
def test_derivatives_agree_with_the_oracle(name: str) -> None:
    """Saltation at crossings, loss of rank where sliding begins, none where it ends."""
    make, span = EVERY_CASE[name]
    system, initial_conditions = make(), starts_of(span, 2 if name in AT_ONCE else 6)
    scale = np.array(span)
    matrices = jacobian(stroboscopic_map(system), initial_conditions) * (scale[None, :] / scale[:, None])
    for start, matrix in zip(initial_conditions, matrices, strict=True):
        expected = differences(Oracle(system), start, scale)
        assert matrix == pytest.approx(expected, abs=1e-9 + 1e-6 * np.abs(expected).max())


def test_sections_at_negative_times_are_those_a_period_later() -> None:
    make, span = CASES["weak dry friction"]
    system, initial_conditions = make(), starts_of(span, 64)
    before, after = (
        stroboscopic_map(system, phase=phase).iterate(initial_conditions, 1).unwrapped for phase in (-1.3, 0.7)
    )
    np.testing.assert_allclose(before, after, atol=1e-8)


@pytest.mark.slow
def test_the_cases_see_every_mode() -> None:
    """Of two switches each slides alone, on both sides of the other, and both at once."""
    every = set(itertools.product((-1, 0, 1), repeat=2))
    for system, span in ((masses_at(0.7, 0.2), [1.0] * 4), (double_pendulum(friction=3000.0), [pi, pi, 30.0, 30.0])):
        log: list[tuple[float, Array, Mode, Mode]] = []
        for start in starts_of(span, 40):
            Oracle(system).image(start, log)
        assert {mode for _, _, *modes in log for mode in modes} == every


@pytest.mark.slow
def test_three_links() -> None:
    """The most switches tested; every one of them sticks now and then."""
    system = triple_pendulum(friction=2500.0, frequency=50.0)
    initial_conditions = starts_of([pi] * 3 + [20.0] * 3, 8)
    log: list[tuple[float, Array, Mode, Mode]] = []
    exact = np.array([Oracle(system).image(start, log) for start in initial_conditions])
    images = stroboscopic_map(system, rtol=1e-9, atol=1e-9).iterate(initial_conditions, 1)
    assert (images.status == Status.OK).all()
    assert images.unwrapped == pytest.approx(exact, rel=1e-8, abs=1e-8)
    assert {e for _, _, _, after in log for e, side in enumerate(after) if side == 0} == {0, 1, 2}


def test_the_determinant_is_that_of_damping_and_jumps() -> None:
    """det DP = exp(-gamma T) times, for each crossing, deceleration after over deceleration before."""
    system = dimensionless_pendulum(0.5, 0.3, 0.03, 0.1)
    oracle, strobe, seen = Oracle(system), stroboscopic_map(system), 0
    for start in starts_of((pi, 2.0), 12):
        log: list[tuple[float, Array, Mode, Mode]] = []
        oracle.image(start, log)
        if all(0 not in after for _, _, _, after in log):
            expected = exp(-0.03 * system.length)
            for t, x, before, after in log:
                expected *= oracle.field(t, x, after)[1] / oracle.field(t, x, before)[1]
            assert np.linalg.det(jacobian(strobe, start)) == pytest.approx(expected, rel=1e-9)
            seen += len(log)
    assert seen > 5


@pytest.mark.slow
def test_derivatives_multiply_over_periods() -> None:
    """Three periods at once are those of the system watched at every third."""
    system = relay_at(1.5, curved)
    slow = ForcedSystem(relay, {"thrust": 1.5}, 6.0 * pi, ("x", "v"), switches=curved)
    initial_conditions = starts_of((2.0, 2.0), 6)
    assert jacobian(stroboscopic_map(system), initial_conditions, 3) == pytest.approx(
        jacobian(stroboscopic_map(slow), initial_conditions), rel=1e-9, abs=1e-9
    )


# Exact solutions


def bang_bang(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
    return x[1], -s[0]


def tilted_line(t: float, x: Any, p: Any) -> tuple[float]:
    return (x[0] + p.tilt * x[1],)


def parabolas(x: float, v: float, tilt: float, left: float) -> tuple[float, float] | None:
    """Motion x'' = -sign(x + tilt v) after a time, parabola by parabola; None where it begins to slide."""
    sign = 1.0 if x + tilt * v > 0.0 else -1.0
    height = x + tilt * v
    while True:
        # sign h = sign (height + slope t) - t^2/2
        slope = v - tilt * sign
        stay = sign * slope + sqrt(slope * slope + 2.0 * abs(height))
        stay = stay if stay > 0.0 else inf
        if stay >= left:
            return x + v * left - 0.5 * sign * left**2, v - sign * left
        x, v, left = x + v * stay - 0.5 * sign * stay**2, v - sign * stay, left - stay
        height, sign = 0.0, -sign
        if abs(v) < abs(tilt):
            return None


@pytest.mark.slow
def test_thrust_towards_a_tilted_line() -> None:
    """Ten crossings and more, between which the distance from the line is a parabola and the series ends early."""
    rng, count = np.random.default_rng(0), 0
    system = ForcedSystem(bang_bang, {"tilt": 0.0}, 12.0, ("x", "v"), switches=tilted_line)
    for tilt in (-0.037, 0.0, 0.01, 0.041):
        initial_conditions = rng.uniform(-1.0, 1.0, (300, 2)) * (1.0, 2.0)
        images = stroboscopic_map(system.with_params(tilt=tilt)).iterate(initial_conditions, 1)
        for start, image, status in zip(initial_conditions.tolist(), images.unwrapped, images.status, strict=True):
            if (exact := parabolas(*start, tilt, 12.0)) is not None:
                assert image == pytest.approx(exact, abs=1e-10)
                assert status == Status.OK
                count += 1
    assert count > 900


def rubbed(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
    return x[1], -p.stiffness * x[0] - p.friction * s[0] + p.force * cos(p.frequency * t + p.phase)


def speed(t: float, x: Any, p: Any) -> tuple[float]:
    return (x[1],)


def table(**params: float) -> ForcedSystem:
    """A mass on a table: x'' = -stiffness x - friction sign(x') + force cos(frequency t + phase)."""
    values = {"stiffness": 1.0, "friction": 0.1, "force": 0.0, "frequency": 1.0, "phase": 0.0, **params}
    return ForcedSystem(rubbed, values, lambda p: 2.0 * pi / p.frequency, ("x", "v"), switches=speed)


def test_a_trajectory_rests_between_samples() -> None:
    """From speed 1, x'' = -sign x': at x = 1/2 from t = 1 on."""
    motion = trajectory(table(stiffness=0.0, friction=1.0), [0.0, 1.0], 1)
    t = np.minimum(motion.times, 1.0)
    assert motion.states == pytest.approx(np.transpose([t - 0.5 * t * t, 1.0 - t]), abs=1e-9)


def test_states_that_stick_at_one_place_have_lost_a_direction() -> None:
    """All that sticks has the velocity 0: the derivative of a period is singular from then on."""
    sticking = dimensionless_pendulum(0.5, 0.3, 0.03, 0.5)
    found = lyapunov_spectrum(stroboscopic_map(sticking), [[0.3, 0.1]], 20, 1)
    assert found.exponents[0, 1] == -np.inf


def swings(x: float, friction: float, time: float) -> tuple[float, float]:
    """Free motion from rest: half circles about +-friction, one pi of time each, until the spring is held."""
    while time > 0.0 and abs(x) > friction:
        centre, left = (friction if x > 0.0 else -friction), min(time, pi)
        if left < pi:
            return centre + (x - centre) * cos(left), -(x - centre) * sin(left)
        x, time = 2.0 * centre - x, time - pi
    return x, 0.0


@pytest.mark.parametrize("tolerance", [*(pytest.param(t, marks=pytest.mark.slow) for t in (1e-6, 1e-12)), 1e-9])
def test_amplitudes_fall_by_twice_the_friction_each_half_swing(tolerance: float) -> None:
    """Lorenz (1924): steps of 2 mu, and rest inside abs(x) <= mu after the number of half swings that this takes."""
    mu, time = 0.1, 9.3
    strobe = stroboscopic_map(table(friction=mu, frequency=2.0 * pi / time), rtol=tolerance, atol=tolerance)
    initial_conditions = np.random.default_rng(0).uniform(-1.2, 1.2, 2000)
    images = strobe.iterate(np.column_stack([initial_conditions, np.zeros(2000)]), 1)
    exact = np.array([swings(x, mu, time) for x in initial_conditions.tolist()])
    assert (images.status == Status.OK).all()
    assert (np.abs(images.points - exact) <= tolerance * (1.0 + np.abs(exact))).all()
    assert 0.1 < (images.points[:, 1] == 0.0).mean() < 0.9


@pytest.mark.slow
def test_rest_after_many_half_swings() -> None:
    strobe = stroboscopic_map(table(friction=0.1), rtol=1e-12, atol=1e-12)
    for x in (0.95, 1.0 - 1e-9, -3.77):
        assert strobe.iterate([x, 0.0], 12).points == pytest.approx(swings(x, 0.1, inf), abs=1e-12)


@pytest.mark.parametrize(("force", "friction", "frequency"), [(1.0, 0.3, 0.7), (1.0, 0.5, 1.3), (2.0, 0.2, 2.5)])
@pytest.mark.slow
def test_den_hartogs_motion_without_stops(force: float, friction: float, frequency: float) -> None:
    """Den Hartog (1931): half a period from the amplitude A to -A, mirrored in the other half.

    With r the frequency and V = 1/(1 - r^2), A^2 = V^2 force^2 - (friction tan(pi/(2r))/r)^2.  Each turning multiplies
    the determinant by (A - f - friction)/(A - f + friction), f being the force there.
    """
    r, gain = frequency, 1.0 / (1.0 - frequency**2)
    lag = asin(-friction * tan(pi / (2.0 * r)) / (r * gain * force))
    lag = lag if gain > 0.0 else pi - lag
    amplitude = gain * force * cos(lag)
    system = table(force=force, friction=friction, frequency=r, phase=lag)
    strobe = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
    assert strobe([amplitude, 0.0]) == pytest.approx([amplitude, 0.0], abs=1e-11)
    assert strobe.iterate([amplitude + 0.1, 0.1], 400).points == pytest.approx([amplitude, 0.0], abs=1e-9)
    # The derivative is taken at a quarter of a period, away from the turnings.
    phase = 0.25
    (start,) = trajectory(system, [amplitude, 0.0], 1, samples_per_period=4).states[1:2]
    pull = amplitude - force * cos(lag)
    expected = ((pull - friction) / (pull + friction)) ** 2
    assert np.linalg.det(jacobian(stroboscopic_map(system, phase=phase), start)) == pytest.approx(expected, rel=1e-7)


@pytest.mark.slow
def test_a_force_that_grows_beyond_the_friction_and_falls_below_it() -> None:
    """x'' = f sin t - mu sign x': slips from asin(mu/f) on, until the impulses balance; then back alike."""
    force, mu = 1.0, 0.8
    begin = asin(mu / force)

    def velocity(t: float) -> float:
        return force * (cos(begin) - cos(t)) - mu * (t - begin)

    end = brentq(velocity, pi - begin, pi, xtol=1e-15)
    slip = force * (cos(begin) * (end - begin) + sin(begin) - sin(end)) - 0.5 * mu * (end - begin) ** 2
    system = table(stiffness=0.0, friction=mu, force=force, phase=-0.5 * pi)
    motion = trajectory(system, [0.2, 0.0], 2, samples_per_period=8, rtol=1e-12, atol=1e-12)
    assert motion.strobe == pytest.approx(np.array([[0.2, 0.0]] * 3), abs=1e-12)
    assert motion.states[4] == pytest.approx([0.2 + slip, 0.0], abs=1e-12)
    assert motion.states[2, 1] == pytest.approx(velocity(0.5 * pi), abs=1e-12)
    assert np.array_equal(motion.states[1], [0.2, 0.0])
    assert np.array_equal(motion.states[4], motion.states[5])


@pytest.mark.parametrize("excess", [0.0, 1e-15, 1e-12, 1e-9, 1e-6])
def test_a_force_that_only_just_reaches_the_friction(excess: float) -> None:
    """Touched, the limit lets nothing go; passed by a little, the mass slips by the order of its square."""
    system = table(stiffness=0.0, friction=0.5, force=0.5 * (1.0 + excess), phase=-0.5 * pi)
    images = stroboscopic_map(system).iterate([0.2, 0.0], 3)
    assert images.status == Status.OK
    assert images.points == pytest.approx([0.2, 0.0], abs=1e-12 + 10.0 * excess)


@pytest.mark.slow
def test_a_square_wave_on_a_spring() -> None:
    """x'' = -2 zeta x' - x + sign(cos t): pieces of a linear flow, by matrix exponentials."""

    def rhs(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
        return x[1], -0.2 * x[1] - x[0] + p.force * s[0]

    def clock(t: float, x: Any, p: Any) -> tuple[float]:
        return (cos(t) - p.level,)

    initial_conditions = np.random.default_rng(0).uniform(-2.0, 2.0, (20, 2))
    for level in (0.0, 0.3, -0.9):
        system = ForcedSystem(rhs, {"force": 1.3, "level": level}, 2.0 * pi, ("x", "v"), switches=clock)
        exact, matrix = initial_conditions, np.array([[0.0, 1.0], [-1.0, -0.2]])
        for sign, stay in ((1.3, acos(level)), (-1.3, 2.0 * pi - 2.0 * acos(level)), (1.3, acos(level))):
            exact = (exact - (sign, 0.0)) @ expm(stay * matrix).T + (sign, 0.0)
        strobe = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
        assert strobe(initial_conditions) == pytest.approx(exact, abs=1e-11)


@pytest.mark.slow
def test_errors_fall_with_the_order_of_the_method_across_events() -> None:
    """A method of order 8 with fixed steps; turning, stopping and starting again lie inside of them."""
    system = table(friction=0.4, force=1.0, frequency=0.7)
    assert system.switches is not None
    kernel = switching_kernel((system.rhs, system.switches), 2, tuple(system.params), 1e-2, False)
    assert kernel is not None and kernel.estimate_order == 7
    initial_conditions = np.random.default_rng(0).uniform(-1.5, 1.5, (LANES, 2))
    params = np.array(list(system.params.values()))

    def images(steps: int) -> Array:
        blocks = initial_conditions.T[None].copy()
        kernel.advance(blocks, np.array([steps]), 0.0, system.length, params, np.empty_like(blocks))
        return blocks[0].T

    exact = images(400)
    errors = np.array([np.abs(images(steps) - exact).max() for steps in (8, 16, 32)])
    assert exact == pytest.approx(np.array([Oracle(system).image(start) for start in initial_conditions]), abs=1e-11)
    assert (np.log2(errors[:-1] / errors[1:]) > 7.0).all()


# Starts on a surface


def two_springs(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
    return x[1], -(1.5 + 0.5 * s[0]) * x[0] - 0.1 * x[1] + p.force * cos(t)


def position(t: float, x: Any, p: Any) -> tuple[float]:
    return (x[0],)


@pytest.mark.parametrize("force", [-1.0, 1.0])
@pytest.mark.slow
def test_a_start_that_touches_a_surface_leaves_it_on_the_right_side(force: float) -> None:
    """Position and velocity zero where one spring meets another: only the acceleration tells where it goes."""
    system = ForcedSystem(two_springs, {"force": force}, 2.0 * pi, ("x", "v"), switches=position)
    images = stroboscopic_map(system, rtol=1e-12, atol=1e-12).iterate([[0.0, 0.0], [1e-14, 0.0], [-1e-14, 0.0]], 1)
    assert (images.status == Status.OK).all()
    assert images.unwrapped == pytest.approx(np.tile(images.unwrapped[1], (3, 1)), abs=1e-11)


def test_rest_on_a_surface_is_rest() -> None:
    """Nothing moves, so the switching function is zero throughout."""
    system = ForcedSystem(two_springs, {"force": 0.0}, 2.0 * pi, ("x", "v"), switches=position)
    images = stroboscopic_map(system, rtol=1e-12, atol=1e-12).iterate([[0.0, 0.0], [1e-305, 0.0]], 3)
    assert (images.status == Status.OK).all()
    assert np.abs(images.points).max() <= 1e-305


def test_the_derivative_at_a_start_that_sticks() -> None:
    """Neighbours of the start with a small velocity stop at once: their image does not depend on it."""
    strobe = stroboscopic_map(dimensionless_pendulum(0.5, 0.3, 0.03, 1.0))
    assert jacobian(strobe, [0.3, 0.0]) == pytest.approx(np.diag([1.0, 0.0]), abs=1e-15)
    slope = (strobe([0.3, 1e-5]) - strobe([0.3, -1e-5])) / 2e-5
    assert slope == pytest.approx([0.0, 0.0], abs=1e-4)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_surface_that_repels_is_left_to_the_side_of_the_smooth_part(side: float) -> None:
    """x' = sign x + 0.5 side: both sides lead away from 0; what decides is f_0, and + where it is zero."""

    def rhs(t: float, x: Any, p: Any, s: Any) -> tuple[float]:
        return (s[0] + p.drift,)

    system = ForcedSystem(rhs, {"drift": 0.5 * side}, 1.0, ("x",), switches=position)
    strobe = stroboscopic_map(system, rtol=1e-4, atol=1e-4)
    assert strobe([[0.0], [1e-13], [-1e-13]]) == pytest.approx(
        np.array([[1.5 * side], [1.0 + 0.5 * side], [-1.0 + 0.5 * side]]), abs=1e-11
    )
    still = stroboscopic_map(system.with_params(drift=0.0), rtol=1e-4, atol=1e-4)
    assert still([0.0]) == pytest.approx([1.0])


@pytest.mark.slow
def test_a_start_on_two_surfaces() -> None:
    """Both masses at rest: held, one let go, both let go."""
    for force, table_friction, between, stuck in (
        (0.1, 0.3, 0.2, True),
        (1.0, 0.3, 0.2, False),
        (1.0, 0.1, 0.01, False),
    ):
        system = masses_at(table_friction, between, force)
        image = stroboscopic_map(system, rtol=1e-6, atol=1e-6)([0.1, 0.05, 0.0, 0.0])
        assert image == pytest.approx(Oracle(system).image([0.1, 0.05, 0.0, 0.0]), abs=2e-6)
        assert (np.abs(image - [0.1, 0.05, 0.0, 0.0]).max() < 1e-15) == stuck


@pytest.mark.slow
def test_what_sticks_stays_to_the_last_bit() -> None:
    strobe = stroboscopic_map(dimensionless_pendulum(0.5, 0.3, 0.03, 0.4))
    settled = strobe.iterate(starts_of((pi, 2.0), 500), 60).points
    stuck = settled[np.abs(np.sin(settled[:, 0])) < 0.4 / 0.81]
    assert len(stuck) > 50 and not stuck[:, 1].any()
    assert np.array_equal(strobe.iterate(stuck, 1000).points, stuck)
    masses = stroboscopic_map(masses_at(0.7, 0.4, force=0.2), rtol=1e-6, atol=1e-6)
    held = masses.iterate(starts_of([0.3] * 4, 200), 20).points
    later = masses.iterate(held, 1000).points
    assert not held[:, 2:].any() and not later[:, 2:].any()
    assert later == pytest.approx(held, abs=1e-11)  # a speed that is held against another one is held to rounding


@pytest.mark.parametrize("miss", [0.0, 1e-12, -1e-12, 1e-6, -1e-6])
def test_grazing(miss: float) -> None:
    """An orbit that touches the surface between two springs, or all but: the jump of the force there vanishes."""

    def rhs(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
        return x[1], -x[0] - 0.5 * p.extra * (1.0 - s[0]) * (x[0] + 1.0)

    def wall(t: float, x: Any, p: Any) -> tuple[float]:
        return (x[0] + 1.0,)

    system = ForcedSystem(rhs, {"extra": 5.0}, 2.0 * pi, ("x", "v"), switches=wall)
    start = [1.0 - miss, 0.0]
    images = stroboscopic_map(system).iterate(start, 1)
    assert images.status == Status.OK
    assert images.points == pytest.approx(start, abs=1e-8 + 20.0 * max(-miss, 0.0))


# Purity


def test_an_image_does_not_depend_on_its_neighbours() -> None:
    """Bit by bit, whether or not others stick: order and number of the orbits, and the number of threads."""
    strobe = stroboscopic_map(dimensionless_pendulum(0.5, 0.3, 0.03, 0.4))
    initial_conditions = np.random.default_rng(0).uniform(-1.0, 1.0, (CHUNK + 777, 2)) * (pi, 3.0)
    images = strobe.iterate(initial_conditions, 2).points
    order = np.random.default_rng(1).permutation(len(initial_conditions))
    assert np.array_equal(strobe.iterate(initial_conditions[order], 2).points, images[order])
    for count in (1, 2, LANES - 1, LANES + 1):
        for first in range(0, 3 * LANES, 7):
            part = slice(first, first + count)
            assert np.array_equal(strobe.iterate(initial_conditions[part], 2).points, images[part])
    for threads in (1, 2):
        set_threads(threads)
        assert np.array_equal(strobe.iterate(initial_conditions, 2).points, images)


def test_one_bad_lane_does_not_disturb_the_others() -> None:
    strobe = stroboscopic_map(dimensionless_pendulum(0.5, 0.3, 0.03, 0.4))
    initial_conditions = starts_of((pi, 3.0), 2 * LANES)
    bad = initial_conditions.copy()
    bad[5], bad[40] = (1.0, 1e300), (1e15, -1e200)
    images, again = strobe.iterate(initial_conditions, 1), strobe.iterate(bad, 1)
    good = np.arange(len(initial_conditions)) % 35 != 5
    assert np.array_equal(images.points[good], again.points[good])
    assert (again.status[~good] != Status.OK).all()


# What is refused, and what has no end


def test_no_switches_no_events() -> None:
    """Without friction there is nothing of all this, whether it was asked for or is absent."""
    free, rough = dimensionless_pendulum(delta=0.0), dimensionless_pendulum(delta=0.1)
    assert free.switches is None and free.rhs is dimensionless_pendulum().rhs and rough.rhs is not free.rhs
    smooth = stroboscopic_map(free)
    limit = stroboscopic_map(rough.with_params(delta=0.0))
    initial_conditions = starts_of((pi, 2.0), 20)
    assert limit(initial_conditions) == pytest.approx(smooth(initial_conditions), abs=1e-9)


@pytest.mark.parametrize(
    ("rhs", "switches", "error", "message"),
    [
        (lambda t, x, p, s: (x[1], -s[0] * s[1]), lambda t, x, p: (x[0], x[1]), ValueError, "multiplies signs"),
        (lambda t, x, p, s: (x[1], -s[0] * gamma(x[0] + 9.0)), speed, TypeError, "analytic functions of math"),
        (rubbed, lambda t, x, p: (erf(x[1]) - 0.1,), TypeError, "analytic functions of math"),
        (rubbed, lambda t, x, p: x[1], TypeError, "and return a tuple"),
        (rubbed, lambda t, x: (x[1],), TypeError, r"switches as switches\(t, x, p\)"),
        (rubbed, 3, TypeError, "switches=3: give a function"),
    ],
)
def test_what_cannot_be_integrated_is_refused(rhs: Any, switches: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        stroboscopic_map(ForcedSystem(rhs, dict(table().params), 2.0 * pi, ("x", "v"), switches=switches))


@pytest.mark.parametrize("method", ["DOP853", "RK45"])
def test_methods_without_events_are_refused(method: str) -> None:
    with pytest.raises(ValueError, match=f"method='{method}': a discontinuous right-hand side needs"):
        stroboscopic_map(table(), method=method)


@pytest.mark.slow
def test_events_without_end_are_reported() -> None:
    """x'' = -sign x - 0.4 sign x' comes to rest at the origin in a finite time, after infinitely many crossings."""

    def twisting(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
        return x[1], -s[0] - 0.4 * s[1]

    system = ForcedSystem(twisting, {}, 6.0, ("x", "v"), switches=lambda t, x, p: (x[0], x[1]))
    images = stroboscopic_map(system, rtol=1e-4).iterate([[30.0, 0.0], [0.1, 0.0], [0.0, 0.0]], 1)
    assert images.status[0] == Status.OK
    assert (images.status[1:] != Status.OK).all()


@pytest.mark.slow
def test_a_switching_function_without_a_value_is_reported() -> None:
    def edge(t: float, x: Any, p: Any) -> tuple[float]:
        return (x[1] + 0.0 * sqrt(x[0]),)

    system = ForcedSystem(rubbed, dict(table(stiffness=0.0, force=1.0).params), 2.0 * pi, ("x", "v"), switches=edge)
    images = stroboscopic_map(system, rtol=1e-4).iterate([[20.0, 1.0], [0.01, -1.0]], 1)
    assert images.status.tolist() == [Status.OK, Status.DIVERGED]
    assert np.isnan(images.points[1]).all() and np.isfinite(images.points[0]).all()
