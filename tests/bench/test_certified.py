"""Cost of certifying a basin image, next to direct integration of the same image."""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import numpy as np
import pytest
from peers import best_time

from cellmap import CellGrid, ForcedSystem, certify, find_basins, interpolated_map, stroboscopic_map
from systems import dimensionless_parameters, dimensionless_pendulum, duffing_oscillator, forced_pendulum

SPEED = 2 * pi * 50  # rad/s of the drive: figure 19's pendulum in units of it


def shaken(amplitude: float) -> ForcedSystem:
    parameters = dimensionless_parameters(amplitude=amplitude, length=0.0272, frequency=50.0, damping=10.0)
    return dimensionless_pendulum(**parameters)


CASES = {
    "pendulum of figure 19, 2 mm (smooth)": (shaken(0.002), (pi, 100 / SPEED), 1.3, 256),
    "pendulum of figure 19, 4 mm (smooth)": (shaken(0.004), (pi, 100 / SPEED), 1.3, 256),
    "inverted pendulum (smooth)": (dimensionless_pendulum(-0.1, 0.545, 0.2), (pi, 4.0), 1.125, 512),
    "five-attractor Duffing": (duffing_oscillator(0.08, 0.0, 1.0, 0.2, 1.0), (1.0, 1.0), 1.6, 256),
    "forced pendulum (fractal)": (forced_pendulum(), (pi, 4.0), 2.25, 512),
}


@pytest.mark.parametrize("side", [500, 1000])
@pytest.mark.parametrize("name", CASES)
def test_certificate_against_direct_integration(say: Callable[[str], None], name: str, side: int) -> None:
    system, window, margin, cells = CASES[name]
    exact = stroboscopic_map(system)
    reach = (window[0] if window[0] == pi else margin * window[0], margin * window[1])
    table = interpolated_map(exact, CellGrid((-reach[0], -reach[1]), reach, (cells, cells)), outside="integrate")
    grid = CellGrid((-window[0], -window[1]), window, (side, side))
    basins = find_basins(table, grid)
    certificate = certify(basins)
    seconds = best_time(lambda: certify(basins), rounds=2)
    direct = find_basins(exact, grid, attractors=basins.attractors)
    integration = best_time(lambda: find_basins(exact, grid, attractors=basins.attractors), rounds=2)
    before, after = (np.count_nonzero(b.labels != direct.labels) for b in (basins, certificate.basins))
    say(
        f"certified picture, {name}, {side} x {side}: {seconds / integration:.3f} of direct integration "
        f"({integration:.2f} s); labels that differ from it: {before} before, {after} after; "
        f"{certificate.redone} redone, {certificate.open} open"
    )
