"""Maps and basins with known answers."""

from typing import Any

import pytest

from cellmap import Basins, CellGrid, PointMap, discrete_map, find_basins
from cellmap.analysis.resilience import FatalShock, minimal_fatal_shock


def _cubic(x: Any, p: Any) -> tuple[float, ...]:
    u = x[0] - p.c
    return (p.c + 1.5 * u - 0.5 * u**3,)


def _disc(x: Any, p: Any) -> tuple[float, ...]:
    return tuple(0.5 * (1.0 + sum(v * v for v in x)) * v for v in x)


@pytest.fixture(scope="session")
def cubic() -> PointMap:
    """Fixed points c - 1, c + 1; basins are bounded by c, and by c -+ sqrt(3), whose image is c."""
    return discrete_map(_cubic, {"c": 0.0}, ("x",))


@pytest.fixture(scope="session")
def line(cubic: PointMap) -> Basins:
    return find_basins(cubic, CellGrid((-1.5,), (1.5,), (300,)))


@pytest.fixture(scope="session")
def disc() -> Basins:
    """The basin of the origin is the open unit disc; all else diverges."""
    return find_basins(discrete_map(_disc, {}, ("x", "y")), CellGrid((-1.5, -1.5), (1.5, 1.5), (101, 77)))


@pytest.fixture(scope="session")
def shocks(pendulum: Basins) -> list[FatalShock]:
    """Out of the hanging and out of the inverted pendulum."""
    return [minimal_fatal_shock(pendulum, k, n_trials=1024) for k in (0, 1)]
