"""Right-hand sides with branches: kinks and jumps are met as events, against an integrator that restarts at them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, floor, pi, sin
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from cellmap import ForcedSystem, Status, discrete_map, stroboscopic_map
from cellmap.maps import jacobian

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


def reference(
    pieces: Pieces, params: dict[str, float], ic: NDArray[np.float64], max_step: float = 0.02
) -> NDArray[np.float64]:
    """Integrate a period; restart at each event, where each step sees one side of all surfaces.

    A visit to the other side that is shorter than a step is not seen.

    The side is that of a place a little further on, at which all decisions are taken by plain Python.
    """
    names = type("P", (), params)
    events = pieces.events()
    t, x = 0.0, np.array(ic)
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
            rtol=1e-13,
            atol=1e-14,
            max_step=max_step,
            events=events,
        )
        x, t = solution.y[:, -1], float(solution.t[-1])
        if solution.status == 0 or t + ahead >= PERIOD:
            return x
    raise AssertionError("more than 200 events")


def drawn(rng: np.random.Generator, count: int) -> Pieces:
    kinds = rng.choice(list(SURFACES), size=count, replace=False)
    return Pieces(tuple((str(k), (round(rng.uniform(-0.6, 0.6), 3), round(rng.uniform(0.2, 1.5), 3))) for k in kinds))


def check(pieces: Pieces, rng: np.random.Generator, initial_conditions: int) -> tuple[float, int]:
    """Return the largest error of images that are said to be good, as a multiple of the tolerance, and their number."""
    params = {"drive": round(rng.uniform(0.2, 2.0), 3), "damping": round(rng.uniform(0.02, 0.3), 3)}
    strobe = stroboscopic_map(ForcedSystem(pieces, params, PERIOD, ("q", "v")), rtol=TOLERANCE, atol=TOLERANCE)
    points = rng.uniform(-2.0, 2.0, (initial_conditions, 2))
    orbits = strobe.iterate(points, 1)
    good = orbits.status == Status.OK
    worst = 0.0
    for point, image in zip(points[good], orbits.points[good], strict=True):
        for max_step in (0.02, 0.002):
            exact = reference(pieces, params, point, max_step)
            error = float(np.max(np.abs(image - exact) / (TOLERANCE * (1.0 + np.abs(exact)))))
            if error < 1.0:
                break
        worst = max(worst, error)
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
    worst, _ = check(drawn(rng, 3), rng, 3)
    assert worst < 10.0


def test_a_short_visit_to_the_other_side() -> None:
    """Of 1e-4 of a period's time: steps of 0.02 of the reference pass over it, and those of 0.002 do not."""
    pieces = Pieces((("max", (-0.382, 1.001)), ("chopper", (0.561, 0.353))))
    params, place = {"drive": 0.549, "damping": 0.055}, np.array([-0.9845993, 1.16261766])
    image = stroboscopic_map(ForcedSystem(pieces, params, PERIOD, ("q", "v")), rtol=TOLERANCE, atol=TOLERANCE)(place)
    coarse, fine = (reference(pieces, params, place, max_step) for max_step in (0.02, 0.002))
    assert np.abs(image - fine).max() < 10 * TOLERANCE
    assert np.abs(image - coarse).max() > 1e4 * TOLERANCE


def test_a_conditional_is_the_switch_that_it_stands_for() -> None:
    """An `if` and signs that are given are the same system; so are a sign and the friction that it stands for."""

    def stop(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -x[0] - (p.k * (x[0] - 1.0) if x[0] > 1.0 else 0.0) - 0.1 * x[1] + cos(t)

    def named_stop(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
        return x[1], -x[0] - 0.5 * (1.0 + s[0]) * p.k * (x[0] - 1.0) - 0.1 * x[1] + cos(t)

    def rubs(t: float, x: Any, p: Any) -> tuple[float, float]:
        return x[1], -x[0] - 0.05 * p.k * np.sign(x[1]) + 1.2 * cos(t)

    def named_rubs(t: float, x: Any, p: Any, s: Any) -> tuple[float, float]:
        return x[1], -x[0] - 0.05 * p.k * s[0] + 1.2 * cos(t)

    points = np.random.default_rng(2).uniform(-2.0, 2.0, (100, 2))
    for plain, named, surface in (
        (stop, named_stop, lambda t, x, p: (x[0] - 1.0,)),
        (
            rubs,
            named_rubs,
            lambda t, x, p: (x[1],),
        ),
    ):
        first = stroboscopic_map(ForcedSystem(plain, {"k": 20.0}, PERIOD, ("q", "v")))
        second = stroboscopic_map(ForcedSystem(named, {"k": 20.0}, PERIOD, ("q", "v"), switches=surface))
        np.testing.assert_allclose(first(points), second(points), rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(jacobian(first, points[:20]), jacobian(second, points[:20]), rtol=1e-9, atol=1e-9)


def test_jacobians_hold_across_kinks_and_jumps() -> None:
    """Against differences of images at 1e-13."""
    pieces = Pieces((("wall", (0.3, 5.0)), ("chopper", (0.0, 0.8)), ("stairs", (0.1, 0.3))))
    strobe = stroboscopic_map(
        ForcedSystem(pieces, {"drive": 1.0, "damping": 0.2}, PERIOD, ("q", "v")), 0.0, 1e-13, 1e-13
    )
    points = np.random.default_rng(4).uniform(-2.0, 2.0, (10, 2))
    step = 1e-6
    columns = [(strobe(points + step * e) - strobe(points - step * e)) / (2.0 * step) for e in np.eye(2)]
    np.testing.assert_allclose(jacobian(strobe, points), np.stack(columns, axis=-1), rtol=1e-5, atol=1e-5)


def test_a_sliding_mode_is_met_where_both_sides_push_back() -> None:
    """x' = -sign(x) + cos(t)/2 from x = 1: it reaches zero where t = 1 + sin(t)/2, and stays."""
    strobe = stroboscopic_map(
        ForcedSystem(lambda t, x, p: ((-1.0 if x[0] > 0.0 else 1.0) + 0.5 * cos(t),), {}, PERIOD, ("x",))
    )
    assert strobe([[1.0], [-0.7], [0.0]]) == pytest.approx(0.0, abs=1e-12)
    assert strobe([[9.0]]) == pytest.approx(9.0 - PERIOD, abs=1e-8)


@pytest.mark.parametrize(
    "function",
    [
        lambda x, p: ((p.r * x[0] if x[0] < 0.5 else p.r * (1.0 - x[0])),),
        lambda x, p: (p.r * min(x[0], 1.0 - x[0]),),
        lambda x, p: ((p.r * x[0]) % 1.0,),
        lambda x, p: (x[0] - floor(p.r * x[0]) / 2.0,),
        lambda x, p: (float(np.sign(x[0] - 0.5)) * p.r * (0.25 <= x[0] <= 0.75),),
        lambda x, p: (np.clip(p.r * x[0], 0.25, np.heaviside(x[0] - 0.5, 0.5)),),
        lambda x, p: (int(p.r * (x[0] - 0.5)) + math.fmod(p.r * (x[0] - 0.5), 1.0),),
        lambda x, p: (math.copysign(p.r, x[0] - 0.5) + math.trunc(3.0 * x[0]) + math.ceil(p.r * x[0]) // 2,),
        lambda x, p: (np.where(x[0] >= 0.5, p.r, -abs(x[0] - 0.3)),),
        lambda x, p: (sorted((x[0], 0.5, 1.0 - x[0]))[1],),
    ],
)
def test_discrete_maps_with_branches_are_what_python_computes(function: Callable[..., Any]) -> None:
    """Exactly, on either side and where numbers are equal."""
    point_map = discrete_map(function, {"r": 1.75}, ("x",))
    assert point_map.unknown_formulas == ""
    parameters = type("P", (), {"r": 1.75})
    for x in (0.0, 0.25, 0.3, 0.5, 0.7499, 0.75, 1.0, 0.123):
        expected = float(function((x,), parameters)[0])
        assert point_map([x])[0] == pytest.approx(expected, rel=1e-15, abs=1e-16), x
