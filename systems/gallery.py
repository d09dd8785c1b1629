"""The reference systems as the explorer offers them, each with the window that it shows first."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import systems
from cellmap import CellGrid
from cellmap.explorer import Explored

_CELLS = 500


def _explored(name: str, *limits: Sequence[float], nodes: int = 0, cells: int = _CELLS) -> Explored:
    """Return a factory's system with a window: the least and the largest value of each coordinate."""
    lower, upper = (tuple(limit[k] for limit in limits) for k in (0, 1))
    region = CellGrid(lower, upper, (cells,) * len(limits))
    return Explored(name, getattr(systems, name), region, nodes, f"import systems\n\nsystem = systems.{name}()\n")


_TURN = (-pi, pi)

GALLERY = (
    _explored("driven_pendulum", _TURN, (-400.0, 400.0), nodes=64),
    _explored("two_well_duffing", (-2.2, 2.2), (-2.2, 2.2)),
    _explored("duffing_oscillator", (-4.0, 4.0), (-4.0, 4.0), nodes=128),
    _explored("moon_li_duffing", (-2.0, 2.0), (-1.5, 1.5), nodes=128),
    _explored("ueda_oscillator", (-4.0, 4.0), (-6.0, 6.0)),
    _explored("helmholtz_oscillator", (-1.0, 1.5), (-1.0, 1.0)),
    _explored("van_der_pol_oscillator", (-3.0, 3.0), (-4.0, 4.0)),
    _explored("forced_pendulum", _TURN, (-4.0, 4.0)),
    _explored("dimensionless_pendulum", _TURN, (-2.0, 2.0), nodes=128),
    _explored("compound_pendulum", _TURN, (-400.0, 400.0), nodes=128),
    _explored("mathieu_equation", (-2.0, 2.0), (-2.0, 2.0)),
    _explored("hill_equation", (-2.0, 2.0), (-2.0, 2.0)),
    _explored("stick_slip_oscillator", (-2.0, 2.0), (-2.0, 2.0), cells=200),
    _explored("magnetic_pendulum", (-2.0, 2.0), (-2.0, 2.0), (-2.0, 2.0), (-2.0, 2.0), cells=300),
    _explored("double_pendulum", _TURN, _TURN, (-200.0, 200.0), (-200.0, 200.0), cells=200),
    _explored("triple_pendulum", *3 * [_TURN], *3 * [(-200.0, 200.0)], cells=100),
    _explored("henon_map", (-2.0, 2.0), (-2.0, 2.0)),
    _explored("grebogi_ott_yorke_map", _TURN, (-0.5, 0.5)),
    _explored("mcdonald_map", (0.0, 1.0), (-1.5, 1.5)),
    _explored("standard_map", _TURN, _TURN, cells=200),
    _explored("logistic_map", (0.0, 1.0)),
)
"""The explorer opens with the first one."""
