"""Discontinuous systems, and an oracle for them.

The oracle works on the plain functions of a system and shares nothing with the integrator: it follows one mode at a
time with SciPy's DOP853, and at an event tries every mode and takes the one that is consistent.
"""

import cmath
import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, inf, pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from cellmap import ForcedSystem
from cellmap._compiled.codegen.rebind import rebind
from systems import (
    DryFriction,
    Gravity,
    Pendulum,
    QuadraticDrag,
    VerticalDrive,
    ViscousDamping,
    dimensionless_pendulum,
    double_pendulum,
    scene,
    stick_slip_oscillator,
)

Array = NDArray[np.float64]
Mode = tuple[int, ...]


@dataclass(frozen=True)
class Oracle:
    """Filippov's solution by SciPy.  A mode holds the sign of each switch, and 0 where it slides."""

    system: ForcedSystem

    @functools.cached_property
    def of_complex_numbers(self) -> Callable[..., Any]:
        """The functions of the switches, for complex steps."""
        assert self.system.switches is not None
        return rebind(self.system.switches, {n: getattr(cmath, n) for n in ("sin", "cos", "exp", "sqrt")})

    def heights(self, t: float, x: Array) -> Array:
        assert self.system.switches is not None
        return np.array(self.system.switches(t, tuple(x), self.system.parameters), dtype=float)

    def force(self, t: float, x: Array, signs: Array) -> Array:
        return np.array(self.system.rhs(t, tuple(x), self.system.parameters, tuple(signs)), dtype=float)

    def parts(self, t: float, x: Array) -> tuple[Array, Array, Array, Array]:
        """f_0, g_i, grad h_i and the time derivatives of h_i; derivatives by complex steps."""
        switches, p, tiny = self.of_complex_numbers, self.system.parameters, 1e-30
        normals = np.array(
            [[complex(v).imag for v in switches(t, tuple(x + 1j * tiny * e), p)] for e in np.eye(len(x))]
        ).T
        passing = np.array([complex(v).imag for v in switches(t + 1j * tiny, tuple(map(complex, x)), p)])
        one_by_one = np.eye(len(passing))
        middle = self.force(t, x, np.zeros(len(passing)))
        above, below = (np.array([self.force(t, x, side * e) for e in one_by_one]) for side in (1.0, -1.0))
        return (
            middle + (0.5 * (above + below) - middle).sum(axis=0),
            0.5 * (above - below),
            normals / tiny,
            passing / tiny,
        )

    def signs(self, t: float, x: Array, mode: Mode) -> Array:
        return _signs(self.parts(t, x), mode) if 0 in mode else np.array(mode, dtype=float)

    def field(self, t: float, x: Array, mode: Mode) -> Array:
        if 0 not in mode:
            return self.force(t, x, np.array(mode, dtype=float))
        parts = self.parts(t, x)
        return parts[0] + _signs(parts, mode) @ parts[1]

    def consistent(self, t: float, x: Array, mode: Mode, on: Sequence[int]) -> Mode:
        """Of all modes of the switches on their surfaces the one that violates least what a mode has to meet."""
        parts = f, jumps, normals, passing = self.parts(t, x)
        gains = normals @ jumps.T
        best, least = mode, inf
        for sides in itertools.product((0, 1, -1), repeat=len(on)):
            trial = list(mode)
            for e, side in zip(on, sides, strict=True):
                trial[e] = side
            if any(side == 0 and gains[e, e] >= 0.0 for e, side in zip(on, sides, strict=True)):
                continue
            signs = _signs(parts, tuple(trial))
            rates = passing + normals @ f + gains @ signs
            violation = max(
                abs(signs[e]) - 1.0 if side == 0 else -side * rates[e] / max(abs(gains[e, e]), 1e-300)
                for e, side in zip(on, sides, strict=True)
            )
            if violation < least - 1e-9:
                best, least = tuple(trial), violation
        return best

    def image(self, ic: ArrayLike, log: list[tuple[float, Array, Mode, Mode]] | None = None) -> Array:
        """State after one period; the log takes time, state, and the modes before and after each event."""
        t, end, x = 0.0, self.system.length, np.array(ic, dtype=float)
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


def _signs(parts: tuple[Array, Array, Array, Array], mode: Mode) -> Array:
    """Return the signs of a mode; those of switches that slide keep the orbit on their surfaces."""
    result, held = np.array(mode, dtype=float), [e for e, side in enumerate(mode) if side == 0]
    if held:
        f, jumps, normals, passing = parts
        gains = normals @ jumps.T
        rates = passing + normals @ f + gains @ result
        result[held] = np.linalg.solve(gains[np.ix_(held, held)], -rates[held])
    return result


def differences(oracle: Oracle, ic: Array, scale: Array, h: float = 2e-5) -> Array:
    """Derivative of the oracle's image by central differences of order 4, in units of the scale."""
    columns = []
    for direction in np.diag(scale):
        values = [oracle.image(ic + k * h * direction) for k in (-2, -1, 1, 2)]
        columns.append((values[0] - 8.0 * values[1] + 8.0 * values[2] - values[3]) / (12.0 * h * scale))
    return np.array(columns).T


def curved(t: float, x: Any, p: Any) -> tuple[float]:
    return (x[0] + 0.3 * x[1] + 0.1 * x[0] ** 2,)


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
    "all frictions": (
        lambda: scene(Pendulum(1.0), Gravity(9.8), DryFriction(2.0), ViscousDamping(0.2), QuadraticDrag(0.3), DRIVE),
        (pi, 8.0),
    ),
    "double pendulum, often stuck": (lambda: double_pendulum(friction=3000.0, damping=5.0), (pi, pi, 30.0, 30.0)),
    "double pendulum, light tip": (
        lambda: double_pendulum(friction=600.0, damping=5.0, mass_2=1e-3),
        (pi, pi, 30.0, 30.0),
    ),
}
EVERY_CASE = {**CASES, **SLOW_CASES}
AT_ONCE = ("weak dry friction",)


def initial_conditions_of(span: Sequence[float], count: int) -> Array:
    return np.random.default_rng(1).uniform(-1.0, 1.0, (count, len(span))) * span


def rubbed(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
    return x[1], -p.stiffness * x[0] - p.friction * s[0] + p.force * cos(p.frequency * t + p.phase)


def speed(t: float, x: Any, p: Any) -> tuple[float]:
    return (x[1],)


def table(**params: float) -> ForcedSystem:
    """A mass on a table: x'' = -stiffness x - friction sign(x') + force cos(frequency t + phase)."""
    values = {"stiffness": 1.0, "friction": 0.1, "force": 0.0, "frequency": 1.0, "phase": 0.0, **params}
    return ForcedSystem(rubbed, values, lambda p: 2.0 * pi / p.frequency, ("x", "v"), switches=speed)
