"""Right-hand sides with branches: kinks and jumps are met as events, against an integrator that restarts at them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, floor, pi, sin
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from cellmap import ForcedSystem, Status, stroboscopic_map

PERIOD = 2.0 * pi
TOLERANCE = 1e-9

Piece = tuple[str, tuple[float, ...]]


def wall(q: float, c: float, k: float) -> float:
    return k * (q - c) if q > c else 0.0


def either(t: float, q: float, v: float, c: float, a: float, b: float) -> float:
    if q > c:
        if sin(t) > 0.0:
            return a * v
        return -a * q
    return b


def force(kind: str, t: float, x: Sequence[float], c: tuple[float, ...]) -> float:
    """Return a force, as a user would write it."""
    q, v = x
    match kind:
        case "wall":
            return wall(q, c[0], c[1])
        case "max":
            return c[1] * max(q - c[0], 0.3 * v)
        case "abs":
            return c[1] * abs(v) * v + c[0] * abs(q - 0.1)
        case "sign":
            return c[1] * float(np.sign(q - c[0]))
        case "square wave":
            return c[1] * (1.0 if sin(t + c[0]) >= 0.0 else -0.5)
        case "ramp":
            return c[1] * ((3.0 * t / PERIOD + c[0]) % 1.0)
        case "stairs":
            return c[1] * floor(2.0 * q + c[0])
        case "chopper":
            return c[1] if q < 2.0 * ((2.0 * t / PERIOD) % 1.0) - 1.0 else 0.0
    return either(t, q, v, c[0], c[1], 0.5)


SURFACES: dict[str, Callable[[float, Sequence[float], tuple[float, ...]], list[float]]] = {
    "wall": lambda t, x, c: [x[0] - c[0]],
    "max": lambda t, x, c: [x[0] - c[0] - 0.3 * x[1]],
    "abs": lambda t, x, c: [x[1], x[0] - 0.1],
    "sign": lambda t, x, c: [x[0] - c[0]],
    "square wave": lambda t, x, c: [sin(t + c[0])],
    "ramp": lambda t, x, c: [sin(pi * (3.0 * t / PERIOD + c[0]))],
    "stairs": lambda t, x, c: [sin(pi * (2.0 * x[0] + c[0]))],
    "chopper": lambda t, x, c: [
        sin(pi * 2.0 * t / PERIOD),
        x[0] - 2.0 * ((2.0 * t / PERIOD) % 1.0) + 1.0,
    ],
    "nested": lambda t, x, c: [x[0] - c[0], sin(t)],
}
"""Functions that change their sign wherever the force has a kink or a jump."""


@dataclass(frozen=True)
class Pieces:
    """An oscillator with several forces; made of plain functions, as a right-hand side or one force after the other."""

    pieces: tuple[Piece, ...]

    def __call__(self, t: float, x: Sequence[float], p: Any) -> tuple[float, float]:
        q, v = x
        total = p.drive * cos(t) - p.damping * v - q
        for kind, constants in self.pieces:
            total = total - force(kind, t, x, constants)
        return v, total

    def events(self) -> list[Callable[[float, NDArray[np.float64]], float]]:
        found = []
        for kind, constants in self.pieces:
            for i in range(len(SURFACES[kind](0.0, (0.0, 0.0), constants))):

                def event(t: float, x: Any, kind: str = kind, c: tuple[float, ...] = constants, i: int = i) -> float:
                    return SURFACES[kind](t, x, c)[i]

                event.terminal = True  # type: ignore[attr-defined]
                found.append(event)
        return found


def reference(pieces: Pieces, params: dict[str, float], start: NDArray[np.float64]) -> NDArray[np.float64]:
    """Integrate a period; start anew at each event, where each step sees one side of all surfaces.

    The side is that of a place a little further on, at which all decisions are taken by plain Python.
    """
    names = type("P", (), params)
    events = pieces.events()
    t, x = 0.0, np.array(start)
    for _ in range(200):
        ahead = 1e-12
        side = x + ahead * np.array(pieces(t + ahead, x, names))
        # A step of a few units of rounding moves over the surface, and is part of the result.
        t, x = t + ahead, side
        solution = solve_ivp(
            lambda t, x: pieces(t, x, names),
            (t, PERIOD),
            x,
            "DOP853",
            rtol=1e-12,
            atol=1e-12,
            max_step=0.02,
            events=events,
        )
        x, t = solution.y[:, -1], float(solution.t[-1])
        if solution.status == 0 or t + ahead >= PERIOD:
            return x
    raise AssertionError("more than 200 events")


def drawn(rng: np.random.Generator, count: int) -> Pieces:
    kinds = rng.choice(list(SURFACES), size=count, replace=False)
    return Pieces(tuple((str(k), (round(rng.uniform(-0.6, 0.6), 3), round(rng.uniform(0.2, 1.5), 3))) for k in kinds))


def check(pieces: Pieces, rng: np.random.Generator, starts: int) -> tuple[float, int]:
    """Return the largest error of images that are said to be good, as a multiple of the tolerance, and their number."""
    params = {"drive": round(rng.uniform(0.2, 2.0), 3), "damping": round(rng.uniform(0.02, 0.3), 3)}
    strobe = stroboscopic_map(ForcedSystem(pieces, params, PERIOD, ("q", "v")), rtol=TOLERANCE, atol=TOLERANCE)
    points = rng.uniform(-2.0, 2.0, (starts, 2))
    orbits = strobe.iterate(points, 1)
    good = orbits.status == Status.OK
    worst = 0.0
    for point, image in zip(points[good], orbits.points[good], strict=True):
        exact = reference(pieces, params, point)
        worst = max(worst, float(np.max(np.abs(image - exact) / (TOLERANCE * (1.0 + np.abs(exact))))))
    return worst, int(good.sum())


@pytest.mark.parametrize("kind", SURFACES)
def test_a_kink_or_jump_is_met(kind: str) -> None:
    pieces = Pieces(((kind, (0.37, 0.9)),))
    worst, good = check(pieces, np.random.default_rng(3), 5)
    assert good == 5
    assert worst < 10.0


@pytest.mark.parametrize("seed", range(6))
def test_several_at_once(seed: int) -> None:
    rng = np.random.default_rng(seed)
    worst, good = check(drawn(rng, 3), rng, 5)
    print(worst, good)
    assert worst < 10.0
