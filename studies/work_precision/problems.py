"""Systems whose maps are measured, and points whose images are frozen in references.json, computed in 80 bits."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass
from math import pi
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cellmap import CellGrid, ForcedSystem
from systems import dimensionless_pendulum, double_pendulum, duffing_oscillator, forced_pendulum, two_well_duffing

TABLE = Path(__file__).with_name("references.json")
"""Images by another program in a longer arithmetic; ``python -m studies.work_precision.references`` makes it again."""

POINTS = 200


@dataclass(frozen=True)
class Problem:
    """A system, the window of initial conditions, and a window that orbits from there hardly leave."""

    name: str
    system: ForcedSystem
    window: tuple[float, ...]
    reach: tuple[float, ...]

    @property
    def initial_conditions(self) -> NDArray[np.float64]:
        """Random points in the window, shape (POINTS, dimension), with few enough digits to be written exactly."""
        span = np.array(self.window)
        return np.random.default_rng(1).uniform(-span, span, (POINTS, len(span))).round(6)

    @property
    def images(self) -> NDArray[np.float64]:
        """Frozen images of these points after one period, angles unwrapped."""
        return np.array(_frozen()[self.name]["images"])

    def grid(self, cells: int) -> CellGrid:
        """Return a grid over the window."""
        return CellGrid(tuple(-w for w in self.window), self.window, (cells,) * len(self.window))

    def table(self, cells: int) -> CellGrid:
        """Return a grid for a table, over the reach."""
        return CellGrid(tuple(-w for w in self.reach), self.reach, (cells,) * len(self.reach))


@functools.cache
def _frozen() -> dict[str, dict[str, list[list[float]]]]:
    table: dict[str, dict[str, list[list[float]]]] = json.loads(TABLE.read_text(encoding="utf-8"))
    return table


def five_attractor_duffing() -> ForcedSystem:
    """Return x'' + 0.08 x' + x^3 = 0.2 cos t, which has five attractors."""
    return duffing_oscillator(damping=0.08, linear=0.0, cubic=1.0, forcing=0.2, frequency=1.0)


PROBLEMS = (
    Problem("driven pendulum", dimensionless_pendulum(-0.1, 0.545, 0.08), (pi, 4.0), (pi, 5.0)),
    Problem("forced pendulum", forced_pendulum(), (pi, 4.0), (pi, 9.0)),
    Problem("two-well Duffing", two_well_duffing(), (2.2, 2.2), (2.9, 2.9)),
    Problem("five-attractor Duffing", five_attractor_duffing(), (1.0, 1.0), (1.6, 1.6)),
    Problem("double pendulum", double_pendulum(), (pi, pi, 60.0, 60.0), (pi, pi, 150.0, 150.0)),
)
"""Problems of the first two parts."""
