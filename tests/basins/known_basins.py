"""Maps whose basins are known, and what is said of them."""

from __future__ import annotations

from math import cos, pi, sin, tanh

import systems
from cellmap import (
    Basins,
    CellGrid,
    angle,
    discrete_map,
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
