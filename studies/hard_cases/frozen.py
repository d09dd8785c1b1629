"""Initial conditions with frozen images: tests/reference/hard_cases.json, with 33 digits, by another program."""

from __future__ import annotations

import functools
import json
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cellmap import ForcedSystem, stroboscopic_map
from cellmap.maps import Iterate, ToleranceWarning
from systems import double_pendulum, driven_pendulum

OSCILLATOR_SIZES = (1e-8, 1e-4, 1.0, 1e4, 1e8)
"""Stiffnesses, dampings and drives of the linear oscillators x'' + d x' + k x = f cos t in the table."""

OSCILLATOR_START = (0.7, -0.2)

TABLE = Path(__file__).parents[2] / "tests" / "reference" / "hard_cases.json"


NO_DRIVE = 1e-30
"""Amplitude (m) of a drive that no digit sees: the right-hand side is compiled already, as that with a drive."""


@dataclass(frozen=True)
class Problem:
    """An initial condition of a system, and the number of periods after which its image is known."""

    system: ForcedSystem
    start: tuple[float, ...]
    periods: int = 1

    @property
    def record(self) -> dict[str, object]:
        """What the table repeats of the problem, so that no image is taken for that of another."""
        return {
            "system": self.system.name,
            "params": dict(self.system.params),
            "period": self.system.length,
            "start": list(self.start),
            "periods": self.periods,
        }


def damped(damping: float) -> Problem:
    """Return a pendulum under a huge viscous damping."""
    return Problem(driven_pendulum(damping=damping), (1.0, 50.0))


def shaken(amplitude: float) -> Problem:
    """Return a pendulum on a pivot that moves farther than the rod is long."""
    return Problem(driven_pendulum(amplitude=amplitude), (1.0, 50.0))


def buzzing(frequency: float) -> Problem:
    """Return a pendulum whose pivot moves fast and little, always at the same speed; undamped, after a millisecond."""
    system = driven_pendulum(amplitude=0.15 / frequency, frequency=frequency, damping=0.0)
    return Problem(system, (3.0, 2.0), round(frequency / 1000.0))


def unequal(mass_2: float, periods: int = 1) -> Problem:
    """Return an undamped, driven double pendulum of very unequal masses."""
    return Problem(double_pendulum(mass_2=mass_2, damping=0.0, amplitude=0.003), (0.5, -0.3, 3.0, -2.0), periods)


def spinning(rate: float) -> Problem:
    """Return an undriven, undamped pendulum in fast rotation."""
    return Problem(driven_pendulum(amplitude=NO_DRIVE, damping=0.0), (0.0, rate), 100)


PROBLEMS = {
    **{f"damping {d:g} /s": damped(d) for d in (1e4, 1e5, 1e6, 1e7)},
    **{f"amplitude {a:g} m": shaken(a) for a in (0.1, 1.0, 10.0)},
    **{f"{f:g} Hz": buzzing(f) for f in (5e3, 5e4, 5e5)},
    **{f"mass ratio {r:g}": unequal(r) for r in (1e-8, 1e-6, 1e6, 1e8)},
    "whip 1e4": unequal(1e4, periods=3),
    "whip 1e6": unequal(1e6, periods=3),
    "rate 1e6 rad/s": spinning(1e6),
}


@functools.cache
def table() -> dict[str, Any]:
    """Return the table."""
    result: dict[str, Any] = json.loads(TABLE.read_text(encoding="utf-8"))
    return result


def frozen_image(name: str) -> NDArray[np.float64]:
    """Return the unwrapped image of a problem."""
    row = table()["images"][name]
    problem = PROBLEMS[name].record
    if {key: row[key] for key in problem} != problem:
        raise ValueError(f"{TABLE.name} has another problem under the name {name!r}: make it again")
    return np.array(row["image"])


def image(name: str, **options: float) -> Iterate:
    """Return the image of a problem by the library; its status tells of a missed tolerance, not a warning."""
    problem = PROBLEMS[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ToleranceWarning)
        return stroboscopic_map(problem.system, **options).iterate(problem.start, problem.periods)  # type: ignore[arg-type]


def error(name: str, found: Iterate) -> float:
    """Return the largest error of an image, each component relative to 1 + its size."""
    exact = frozen_image(name)
    return float(np.abs((found.unwrapped - exact) / (1.0 + np.abs(exact))).max())
