"""The reference systems as the explorer offers them, each with the window that it shows first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import cos, pi
from pathlib import Path

import systems
from cellmap import CellGrid
from cellmap.explorer import Explored, ExploredScene

_CELLS = 500


def _explored(
    name: str,
    *limits: Sequence[float],
    about: str,
    nodes: int = 0,
    cells: int = _CELLS,
    si: bool = False,
    drawn_as: str = "",
) -> Explored:
    """Return a factory's system with a window: the least and the largest value of each coordinate."""
    lower, upper = (tuple(limit[k] for limit in limits) for k in (0, 1))
    region = CellGrid(lower, upper, (cells,) * len(limits))
    make = getattr(systems, name)
    source = f"import systems\n\nsystem = systems.{name}()\n"
    pivot = _pivot if si else None
    return Explored(
        name,
        make,
        region,
        nodes,
        source,
        about,
        make().parameter_units,
        drawn_as=drawn_as,
        pivot=pivot,
        thumbnail=_thumbnail(name),
    )


def _thumbnail(name: str) -> Path | None:
    """Return the small image of a system, if there is one."""
    path = Path(__file__).parent / "thumbnails" / f"{name}.png"
    return path if path.exists() else None


def _pivot(t: float, params: Mapping[str, float]) -> tuple[float, float]:
    """Return where the pivot of a driven pendulum is, in lengths of its first rod."""
    size = next(params[name] for name in ("length", "length_1", "distance") if name in params)
    turn = 2.0 * pi * params.get("frequency", 0.0) * t + params.get("phase", 0.0)
    return 0.0, params.get("amplitude", 0.0) / size * cos(turn)


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


_ABOUT_SCENES = "A body and the effects on it, each of which is switched on and off below."


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
        _ABOUT_SCENES,
        systems.scene(made, *acting, period=period).parameter_units,
        drawn_as="chain",
    )


SCENE = ExploredScene(
    "scene",
    "Scene from parts",
    tuple(_BODIES),
    tuple(_EFFECTS),
    ("pendulum", "gravity", "viscous damping", "vertical drive"),
    _scene,
    _ABOUT_SCENES,
    _thumbnail("scene"),
)
"""A body and effects that are switched on and off in the page."""

GALLERY: tuple[Explored | ExploredScene, ...] = (
    _explored(
        "driven_pendulum",
        _TURN,
        (-400.0, 400.0),
        nodes=64,
        si=True,
        about="A pendulum whose pivot is shaken up and down: it hangs, stands upside down or rotates.",
    ),
    _explored(
        "two_well_duffing",
        (-2.2, 2.2),
        (-2.2, 2.2),
        about="A particle in two wells, pushed periodically, whose basins wind around each other.",
    ),
    _explored(
        "duffing_oscillator",
        (-4.0, 4.0),
        (-4.0, 4.0),
        nodes=128,
        about="A spring that stiffens, pushed periodically: small and large oscillations are both stable.",
    ),
    _explored(
        "moon_li_duffing",
        (-2.0, 2.0),
        (-1.5, 1.5),
        nodes=128,
        about="A beam between two magnets on a shaken frame, whose basins Moon and Li found fractal.",
    ),
    _explored(
        "ueda_oscillator",
        (-4.0, 4.0),
        (-6.0, 6.0),
        about="A cubic spring without a linear part, pushed periodically, with Ueda's strange attractor.",
    ),
    _explored(
        "helmholtz_oscillator",
        (-1.0, 1.5),
        (-1.0, 1.0),
        about="A well with one barrier, as of a ship that may capsize: forcing erodes the safe basin.",
    ),
    _explored(
        "van_der_pol_oscillator",
        (-3.0, 3.0),
        (-4.0, 4.0),
        about="An oscillator that sustains itself: it locks to the forcing, or keeps a frequency of its own.",
    ),
    _explored(
        "forced_pendulum",
        _TURN,
        (-4.0, 4.0),
        about="A pendulum with a periodic torque: it swings, turns over in either sense, or is chaotic.",
    ),
    _explored(
        "dimensionless_pendulum",
        _TURN,
        (-2.0, 2.0),
        nodes=128,
        about="The pendulum on a shaken pivot, with the time in units of the drive.",
    ),
    _explored(
        "compound_pendulum",
        _TURN,
        (-400.0, 400.0),
        nodes=128,
        si=True,
        about="A rigid body on a shaken pivot, with the values of a rod in the laboratory.",
    ),
    _explored(
        "mathieu_equation",
        (-2.0, 2.0),
        (-2.0, 2.0),
        about="A linear spring of periodic stiffness: rest is unstable in tongues over delta and epsilon.",
    ),
    _explored(
        "hill_equation",
        (-2.0, 2.0),
        (-2.0, 2.0),
        about="A linear spring whose stiffness has three harmonics, each with tongues of instability.",
    ),
    _explored(
        "stick_slip_oscillator",
        (-2.0, 2.0),
        (-2.0, 2.0),
        cells=200,
        about="A mass on a moving belt, held by dry friction: it sticks until the spring tears it loose.",
    ),
    _explored(
        "magnetic_pendulum",
        (-2.0, 2.0),
        (-2.0, 2.0),
        (-2.0, 2.0),
        (-2.0, 2.0),
        cells=300,
        drawn_as="above",
        about="A pendulum above three magnets: at which one it comes to rest depends finely on where it began.",
    ),
    _explored(
        "double_pendulum",
        _TURN,
        _TURN,
        (-200.0, 200.0),
        (-200.0, 200.0),
        cells=200,
        si=True,
        drawn_as="chain",
        about="Two pendulums, one below the other, on a shaken pivot: the image is a slice through four coordinates.",
    ),
    _explored(
        "triple_pendulum",
        *3 * [_TURN],
        *3 * [(-200.0, 200.0)],
        cells=100,
        si=True,
        drawn_as="chain",
        about="Three pendulums in a chain on a pivot that is shaken fast, by which they can all stand upright.",
    ),
    _explored(
        "power_grid",
        _TURN,
        _TURN,
        (-15.0, 15.0),
        (-15.0, 15.0),
        cells=200,
        about="Machines on a grid, the first of which is forced: after which disturbances do they stay in step.",
    ),
    _explored(
        "josephson_chain",
        _TURN,
        _TURN,
        (-4.0, 4.0),
        (-4.0, 4.0),
        cells=100,
        about="Equal Josephson junctions in series, with a resistor in parallel to all of them.",
    ),
    _explored(
        "ring_of_wells",
        *6 * [(-2.0, 2.0)],
        cells=100,
        about="A ring of forced oscillators, each in two wells and coupled to its neighbours.",
    ),
    _explored(
        "lorenz_96",
        *4 * [(-8.0, 8.0)],
        cells=100,
        about="Lorenz's model of a quantity around a circle of latitude: steady, travelling waves, chaos.",
    ),
    _explored(
        "henon_map",
        (-2.0, 2.0),
        (-2.0, 2.0),
        about="A map that stretches and folds the plane: a strange attractor, and orbits that diverge.",
    ),
    _explored(
        "grebogi_ott_yorke_map",
        _TURN,
        (-0.5, 0.5),
        about="Two fixed points whose common boundary is fractal, with a dimension that is known.",
    ),
    _explored(
        "mcdonald_map",
        (0.0, 1.0),
        (-1.5, 1.5),
        about="A map whose basin boundary is a curve without a tangent, known in closed form.",
    ),
    _explored(
        "standard_map",
        _TURN,
        _TURN,
        cells=200,
        about="A kicked rotor without damping: islands of regular motion lie in a chaotic sea, and nothing attracts.",
    ),
    _explored(
        "logistic_map",
        (0.0, 1.0),
        about="Growth with a limit: fixed points, doublings of the period, chaos.",
    ),
    SCENE,
)
"""The explorer opens with the first one."""
