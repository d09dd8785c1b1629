"""Maps whose basins are known, and what is said of them."""

import json
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from math import cos, pi, sin, tanh
from typing import Any

import numpy as np

import systems
from cellmap import (
    Basins,
    CellGrid,
    ForcedSystem,
    PointMap,
    angle,
    discrete_map,
    find_basins,
    interpolated_map,
    stroboscopic_map,
)

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


WINDOW = CellGrid((-2.2, -2.2), (2.2, 2.2), (125, 115))
RUNS: dict[str, tuple[Callable[[], PointMap], Any, dict[str, int]]] = {
    # Two attractors that the sample finds; one pass.
    "one pass": (duffing, WINDOW, {}),
    # Small basins are found among the active orbits, and the sweep begins again for some of them.
    "small basins": (
        pendulum,
        CellGrid((-pi, -500.0), (pi, 500.0), (100, 85)),
        {"max_periods": 600, "longest_period": 8},
    ),
    # Everything is left after each pass.
    "undecided": (lambda: CONSERVATIVE, CellGrid((-0.6, -0.6), (0.6, 0.6), (70, 65)), {"max_periods": 520}),
    # The same with multi-period steps, on whose division orbits depend.
    "multi-period steps": (
        lambda: interpolated_map(CONSERVATIVE, CellGrid((-1, -1), (1, 1), (60, 60)), outside="escape", max_step=8),
        CellGrid((-0.6, -0.6), (0.6, 0.6), (70, 65)),
        {"max_periods": 520},
    ),
    # A cover in the place of a neighbourhood: all initial conditions are labelled again.
    "chaotic": (systems.henon_map, CellGrid((-2.0, -2.0), (2.0, 2.0), (95, 95)), {"max_periods": 500}),
    "given starts": (
        lambda: discrete_map(lambda x, p: (x[0] / 2 + 1 / (2 * x[0]),), {}, ("x",), name="newton"),
        np.random.default_rng(0).uniform(-3.0, 3.0, (4, 9000, 1)),
        {},
    ),
}
"""Maps, initial conditions and settings of runs that go on after an end, and of images from coarse to fine."""


def found(name: str, **how: Any) -> Basins:
    make, places, settings = RUNS[name]
    return find_basins(make(), places, **settings, **how)


class Made(dict[str, Basins]):
    """Basins that are found when they are asked for."""

    def __init__(self, cases: Mapping[str, Callable[[], Basins]]) -> None:
        self.cases = cases

    def __missing__(self, name: str) -> Basins:
        return self.setdefault(name, self.cases[name]())


def assert_same(one: Basins, other: Basins) -> None:
    """All but times and the map is equal, to the last bit; settings are as files keep them."""
    assert_same_record(one, other, "attractors", "cost", "point_map", "settings")
    assert json.loads(json.dumps(one.settings)) == json.loads(json.dumps(other.settings))
    assert one.cost.steps == other.cost.steps
    assert len(one.attractors) == len(other.attractors)
    for a, b in zip(one.attractors, other.attractors, strict=True):
        assert_same_record(a, b)


def assert_same_record(one: Any, other: Any, *but: str) -> None:
    """All fields are equal to the last bit, those of records in them too; NaN equals NaN."""
    for f in (f for f in fields(one) if f.name not in but):
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
