"""First results of new processes: with nothing of a system compiled, and with everything on disk.

Everything of the library's own has been compiled before, as it is after the first use on a machine.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

LAPS = """
import time
before = time.perf_counter()
def lap(what):
    global before
    now = time.perf_counter()
    print(f"{what}: {now - before:.2f} s", flush=True)
    before = time.perf_counter()
"""

README = (
    LAPS
    + """
from math import cos, pi
from cellmap import CellGrid, ForcedSystem, find_basins, interpolated_map, stroboscopic_map
def rhs(t, x, p):
    q, v = x
    return v, q - q**3 - p.delta * v + p.gamma * cos(p.omega * t)
duffing = ForcedSystem(rhs, {"delta": 0.15, "gamma": 0.2, "omega": 1.0}, period=2 * pi, coordinates=("q", "v"))
grid = CellGrid(lower=(-2.2, -2.2), upper=(2.2, 2.2), shape=(300, 300))
find_basins(interpolated_map(stroboscopic_map(duffing), grid), grid)
lap("program of the README to its labels, 300^2, import included")
"""
)

NETWORK = (
    """
from math import cos, pi, sin
import numpy as np
from cellmap import ForcedSystem, stroboscopic_map
"""
    + LAPS
    + """
n = 100
links = [(i, (i + k) % n) for i in range(n) for k in ((1, n // 2 - 3) if i % 3 == 0 else (1,))]
near = [[(set(link) - {i}).pop() for link in links if i in link] for i in range(n)]
def rhs(t, x, p):
    power = [p.P * (-1) ** i + (p.f * cos(t) if i == 0 else 0.0) for i in range(n)]
    pulls = [sum(sin(x[i] - x[j]) for j in near[i]) for i in range(n)]
    return (*x[n:], *(power[i] - p.alpha * x[n + i] - p.K * pulls[i] for i in range(n)))
grid = ForcedSystem(rhs, {"P": 1.0, "f": 0.1, "K": 8.0, "alpha": 0.1}, 2 * pi, [f"x{i}" for i in range(2 * n)])
exact = stroboscopic_map(grid)
exact(np.zeros((1, 2 * n)))
lap("first image of 100 machines in a network")
exact(np.random.default_rng(0).uniform(-1.0, 1.0, (1000, 2 * n)))
lap("1000 orbits for a period")
"""
)

SCENES = (
    LAPS
    + """
from math import pi
import numpy as np
from cellmap import CellGrid, ForcedSystem, find_basins, section_map, stroboscopic_map
from cellmap.maps import jacobian
from systems import driven_pendulum
from systems import Chain
from systems import VerticalDrive
from systems import DryFriction, Gravity, ViscousDamping
from systems import scene

def chain(links, effect):
    body = Chain(lengths=(0.032,) * links, masses=(1.0, 0.25, 0.2, 0.1)[:links])
    return scene(body, Gravity(9.8), VerticalDrive(amplitude=0.006, frequency=50.0), effect)

def lorenz(t, x, p):
    return p.s * (x[1] - x[0]), x[0] * (p.r - x[2]) - x[1], x[0] * x[1] - p.b * x[2]

systems = {
    "pendulum": driven_pendulum(),
    "pendulum with dry friction": driven_pendulum(friction=10.0),
    "double pendulum": chain(2, ViscousDamping(10.0)),
    "double pendulum with dry friction": chain(2, DryFriction(300.0)),
    "chain of four links with dry friction": chain(4, DryFriction(300.0)),
}
lap("import")
for name, system in systems.items():
    start = np.full(system.dimension, 0.3)
    strobe = stroboscopic_map(system)
    strobe(start)
    lap(f"{name}, first map")
    if system.dimension < 8:
        jacobian(strobe, start)
        lap(f"{name}, Jacobian")
    if system.dimension == 4:
        cells = 60 if name == "double pendulum" else 30
        grid = CellGrid((-pi, -pi, -1.0, -1.0), (pi, pi, 1.0, 1.0), (cells, cells, 1, 1))
        find_basins(strobe, grid, max_periods=200)
        lap(f"{name}, {cells} x {cells} slice")
section_map(ForcedSystem(lorenz, {"s": 10.0, "r": 28.0, "b": 8 / 3}, 1.0, ("x", "y", "z")), ("z", 27.0, 1))([1.0, 1.0])
lap("section map of Lorenz's system")
"""
)


@pytest.mark.parametrize("program", [README, SCENES, NETWORK], ids=["readme", "scenes", "network"])
def test_first_results(program: str, tmp_path: Path, say: Callable[[str], None]) -> None:
    def run(folder: str) -> list[str]:
        environment = {**os.environ, "CELLMAP_CACHE_DIR": str(tmp_path / folder)}
        command = [sys.executable, "-c", program]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.splitlines()

    run("first")  # compiles what is the library's own
    say("")
    for cold, warm in zip(run("second"), run("second"), strict=True):
        say(f"{cold} cold, {warm.split(': ')[1]} with everything on disk")
