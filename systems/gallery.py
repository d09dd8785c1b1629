"""The reference systems as the explorer offers them, each with the window that it shows first."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import systems
from cellmap import CellGrid
from cellmap.explorer import Explored, ExploredScene

_CELLS = 500


def _explored(name: str, *limits: Sequence[float], nodes: int = 0, cells: int = _CELLS) -> Explored:
    """Return a factory's system with a window: the least and the largest value of each coordinate."""
    lower, upper = (tuple(limit[k] for limit in limits) for k in (0, 1))
    region = CellGrid(lower, upper, (cells,) * len(limits))
    return Explored(name, getattr(systems, name), region, nodes, f"import systems\n\nsystem = systems.{name}()\n")


_TURN = (-pi, pi)
_LENGTH = 0.0272
_FREQUENCY = 50.0

_BODIES: dict[str, systems.Body] = {
    "pendulum": systems.Pendulum(length=_LENGTH),
    "compound pendulum": systems.CompoundPendulum(mass=0.1, inertia=8e-5, distance=0.025),
    "double pendulum": systems.Chain(lengths=(0.032, 0.032), masses=(1.0, 0.25)),
}
_EFFECTS: dict[str, systems.Effect] = {
    "gravity": systems.Gravity(gravity=9.8),
    "viscous damping": systems.ViscousDamping(damping=10.0),
    "quadratic drag": systems.QuadraticDrag(drag=0.1),
    "dry friction": systems.DryFriction(friction=100.0),
    "torsion spring": systems.TorsionSpring(stiffness=1000.0),
    "constant torque": systems.ConstantTorque(constant_torque=200.0),
    "vertical drive": systems.VerticalDrive(amplitude=0.003, frequency=_FREQUENCY),
    "horizontal drive": systems.HorizontalDrive(amplitude=0.001, frequency=_FREQUENCY),
    "rotating drive": systems.RotatingDrive(vertical_amplitude=0.002, horizontal_amplitude=0.002, frequency=_FREQUENCY),
    "torque drive": systems.TorqueDrive(torque=500.0, frequency=_FREQUENCY),
    "square drive": systems.SquareDrive(acceleration=200.0, frequency=_FREQUENCY),
}
_ROUGH = {"quadratic drag", "dry friction", "square drive"}  # switches: an interpolated map would follow them poorly


def _scene(body: str, effects: Sequence[str]) -> Explored:
    """Return the scene of some parts."""
    made, acting = _BODIES[body], [_EFFECTS[effect] for effect in effects]
    parts = (made, *acting)
    driven = any(effect.endswith("drive") for effect in effects)
    period = None if driven else 1.0 / _FREQUENCY
    names = sorted({type(part).__name__ for part in parts} | {"scene"}, key=str.lower)
    call = ", ".join(map(repr, parts)) + ("" if driven else f", period={period!r}")
    limits = [_TURN, _TURN, (-200.0, 200.0), (-200.0, 200.0)] if body == "double pendulum" else [_TURN, (-400.0, 400.0)]
    lower, upper = (tuple(limit[k] for limit in limits) for k in (0, 1))
    smooth = len(limits) == 2 and _ROUGH.isdisjoint(effects)
    return Explored(
        "scene",
        lambda: systems.scene(made, *acting, period=period),
        CellGrid(lower, upper, ((_CELLS if smooth else 200),) * len(limits)),
        128 if smooth else 0,
        f"from systems import {', '.join(names)}\n\nsystem = scene({call})\n",
    )


SCENE = ExploredScene(
    "scene",
    "Scene from parts",
    tuple(_BODIES),
    tuple(_EFFECTS),
    ("pendulum", "gravity", "viscous damping", "vertical drive"),
    _scene,
)
"""A body and effects that are switched on and off in the page."""

GALLERY: tuple[Explored | ExploredScene, ...] = (
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
    _explored("power_grid", _TURN, _TURN, (-15.0, 15.0), (-15.0, 15.0), cells=200),
    _explored("josephson_chain", _TURN, _TURN, (-4.0, 4.0), (-4.0, 4.0), cells=100),
    _explored("ring_of_wells", *6 * [(-2.0, 2.0)], cells=100),
    _explored("lorenz_96", *4 * [(-8.0, 8.0)], cells=100),
    _explored("henon_map", (-2.0, 2.0), (-2.0, 2.0)),
    _explored("grebogi_ott_yorke_map", _TURN, (-0.5, 0.5)),
    _explored("mcdonald_map", (0.0, 1.0), (-1.5, 1.5)),
    _explored("standard_map", _TURN, _TURN, cells=200),
    _explored("logistic_map", (0.0, 1.0)),
    SCENE,
)
"""The explorer opens with the first one."""
