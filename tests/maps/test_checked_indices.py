"""Loops over impacts, friction and coupled branches stay inside of their arrays, as seen where indices are checked."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings

import pytest

PROGRAM = """
import warnings
from math import cos, pi
import numpy as np
from cellmap import ForcedSystem, stroboscopic_map
from cellmap.maps import Impact

warnings.simplefilter("ignore")


def slides(t, x, p, s):
    return x[1], 0.3 * cos(t) - x[0] - 0.2 * s[0]


def tangled(t, x, p):
    a = x[0] if -0.3 < x[1] < 0.9 else 0.1
    b = (x[0] > 0.2) * x[1] + (x[1] + 0.3 * a < 0) * 0.3 + 0.1 * np.floor(2.0 * x[0])
    return x[1], 0.5 * cos(t) - x[0] - 0.2 * x[1] + 0.4 * b - 0.3 * np.sign(x[1])


def blocks(t, x, p, s):
    return x[1], 0.9 * cos(t) - x[0] - 0.3 * s[0], x[3], x[0] - 1.5 * x[2] - 0.2 * s[1]


wall = Impact(lambda t, x, p: 0.2 - x[0], lambda t, x, p: (x[0], -0.5 * x[1]))
walls = Impact(lambda t, x, p: 0.4 - x[0] + x[2], lambda t, x, p: (x[0], 0.5 * x[3], x[2], 0.5 * x[1]))
velocities = lambda t, x, p: (x[1], x[3])
systems = [
    ForcedSystem(slides, {}, 2 * pi, ("q", "v"), switches=lambda t, x, p: (x[1],), impacts=[wall]),
    ForcedSystem(slides, {}, 2 * pi, ("q", "v"), switches=lambda t, x, p: (x[1],)),
    ForcedSystem(tangled, {}, 2 * pi, ("q", "v")),
    ForcedSystem(blocks, {}, 2 * pi, ("a", "b", "c", "d"), switches=velocities, impacts=[walls]),
]
for system in systems:
    places = np.random.default_rng(2).uniform(-1.0, 0.1, (70, system.dimension))
    images = stroboscopic_map(system).iterate(places, 3)
    print(np.count_nonzero(images.status), images.points.tobytes().hex()[:200])
"""


@pytest.mark.thorough
def test_indices_of_switches_and_impacts(capsys: pytest.CaptureFixture[str]) -> None:
    """A check that fails ends the process; those that hold change no bit."""
    environment = {**os.environ, "CELLMAP_BOUNDS_CHECK": "1"}
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr[-2000:]
    with warnings.catch_warnings():
        exec(compile(PROGRAM, "without checks", "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out == done.stdout
    assert done.stdout.count("\n") == 4
