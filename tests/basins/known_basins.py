"""Maps whose basins are known, and what is said of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from math import cos, pi, sin, tanh
from typing import Any

import numpy as np

import systems
from cellmap import Basins, CellGrid, ForcedSystem, PointMap, angle, discrete_map, stroboscopic_map

W = 2 * pi * 50  # the drive of the report's pendulum, rad/s


def circle_grid(speed: float, cells: int) -> CellGrid:
    return CellGrid((-pi, -speed), (pi, speed), (cells, cells))


def counts(basins: Basins) -> list[int]:
    return [f.count for f in basins.fractions.values()]


def fractions(basins: Basins) -> list[float]:
    return [f.fraction for f in basins.fractions.values()]


def halves(x, p):
    return (0.5 * x[0],)


def two_wells(x, p):
    return (tanh(2 * x[0]),)


LINE = discrete_map(two_wells, {}, ("x",), name="two wells")


def goy(x, p):
    """Grebogi, Ott, Yorke 1983, Physical Review Letters 50, 935."""
    theta, y = x
    return theta + 1.32 * sin(2 * theta) - 0.90 * sin(4 * theta) - y * sin(theta), -0.3 * cos(theta)


GOY = discrete_map(goy, {}, (angle("theta", lower=0.0), "x"), name="Grebogi, Ott, Yorke")
DUFFING = stroboscopic_map(systems.two_well_duffing())


def forced(t, x, p):
    return x[1], x[0] - x[0] ** 3 - p.delta * x[1] + p.gamma * cos(t)


FORCED = ForcedSystem(forced, {"delta": 0.2, "gamma": 0.1}, 2 * pi, ("q", "v"), "Duffing")


def duffing(phase: float = 0.0, **params: float) -> PointMap:
    return stroboscopic_map(FORCED.with_params(**params), phase, rtol=1e-5, atol=1e-5)


@cache
def pendulum() -> PointMap:
    """The report's pendulum at 10 mm, with small basins."""
    return stroboscopic_map(systems.driven_pendulum(amplitude=0.010), rtol=1e-6, atol=1e-6)


def conservative(x, p):
    """Hénon's area-preserving map: nothing settles, some orbits diverge."""
    y = x[1] - p.b * x[0] * x[0]
    return x[0] * p.c - y * p.s, x[0] * p.s + y * p.c


CONSERVATIVE = discrete_map(conservative, {"b": 1.0, "c": cos(1.327), "s": sin(1.327)}, ("x", "y"))


class Made(dict[str, Basins]):
    """Basins that are found when they are asked for."""

    def __init__(self, cases: Mapping[str, Callable[[], Basins]]) -> None:
        self.cases = cases

    def __missing__(self, name: str) -> Basins:
        return self.setdefault(name, self.cases[name]())


def assert_same_record(one: Any, other: Any) -> None:
    """All fields are equal to the last bit, those of records in them too; NaN equals NaN."""
    for f in fields(one):
        a, b = getattr(one, f.name), getattr(other, f.name)
        if isinstance(a, np.ndarray):
            assert (a.dtype, a.shape) == (b.dtype, b.shape), f.name
            assert a.tobytes() == b.tobytes(), f.name
        elif is_dataclass(a):
            assert_same_record(a, b)
        elif isinstance(a, float):
            assert np.array_equal(a, b, equal_nan=True)
        else:
            assert a == b, f.name
