"""What plans predict, next to what becomes of them."""

from __future__ import annotations

from math import pi

import pytest

import systems
from cellmap import CellGrid, plan

SIDE = 500
CASES = {
    "pendulum": (systems.driven_pendulum, (-pi, -100), (pi, 100)),
    "two-well Duffing": (systems.two_well_duffing, (-2.2, -2.2), (2.2, 2.2)),
    "forced pendulum": (systems.forced_pendulum, (-pi, -4), (pi, 4)),
    "Henon map": (systems.henon_map, (-2, -2), (2, 2)),
    "pendulum with dry friction": (lambda: systems.driven_pendulum(friction=0.05), (-pi, -100), (pi, 100)),
}


@pytest.mark.parametrize("name", CASES)
def test_prediction_and_outcome(name, say):
    make, lower, upper = CASES[name]
    side = SIDE // 2 if "friction" in name else SIDE
    planned = plan(make(), CellGrid(lower, upper, (side, side)))
    for accuracy in (1e-3, 1e-6, 1e-9):
        again = planned.at(accuracy)
        outcome = again.outcome(again.basins())
        say(f"plan of {name}, {side} x {side}, accuracy {accuracy:.0e}, by {again.chosen}: {outcome}")
        assert outcome.met or not again.met
