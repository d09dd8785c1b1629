"""Further good calls, which go where those with one small system and few options do not."""

from collections.abc import Callable
from functools import cache
from math import tanh
from typing import Any

import numpy as np
import small_systems as small

import cellmap
import systems
from cellmap import CellGrid, Coordinate, ForcedSystem, angle, bifurcations, discrete_map, find_basins, sets
from cellmap.analysis import boundary, fractal
from cellmap.bifurcations import Crossing


def halves(*names: Any, **values: float) -> Any:
    """Return a map that halves each coordinate, or takes it to one of two signs: that of a name in capitals."""
    signs = [str(getattr(name, "name", name)).isupper() for name in names]
    return discrete_map(
        lambda x, p: tuple(tanh(2 * v) if two else v / 2 for v, two in zip(x, signs, strict=True)), values, names
    )


@cache
def ring() -> Any:
    """Return phases on a ring that come together, at any common phase."""

    def rhs(x: Any, p: Any) -> Any:
        return tuple(x[i] + 0.2 * (np.sin(x[i - 1] - x[i]) + np.sin(x[(i + 1) % 5] - x[i])) for i in range(5))

    phases = discrete_map(rhs, {}, [angle(f"phi_{i}") for i in range(5)])
    return find_basins(phases, np.random.default_rng(0).uniform(-0.7, 0.7, (30, 5)))


@cache
def circles() -> Any:
    values = [2.05, 2.1, 2.18, 2.26]
    return bifurcations.continue_circle(small.delayed_logistic(), "a", values, [0.5, 0.4], transient=500)


@cache
def cascade() -> Any:
    logistic = systems.logistic_map(2.8)
    return bifurcations.period_doubling_cascade(
        logistic, cellmap.periodic_orbit(logistic, [0.5]), "mu", 4.0, doublings=2
    )


@cache
def henon() -> Any:
    """Return branches of fixed points with a fold, and of what comes from the doubling."""
    exact = systems.henon_map(0.2, 0.3)
    return cellmap.continue_orbit(exact, cellmap.periodic_orbit(exact, [0.5, 0.2]), "a", -0.5, 1.4, step=0.1)


def born(power: int) -> Any:
    """Return the branch of 0, from which another one comes at r = 1."""
    exact = discrete_map(lambda x, p: (p.r * x[0] - x[0] ** power,), {"r": 0.5}, ("x",))
    return cellmap.continue_orbit(exact, cellmap.periodic_orbit(exact, [0.0]), "r", 0.5, 1.5, step=0.2)


def stability(**given: Any) -> Any:
    exact, axes = systems.henon_map(0.2, 0.3), (("a", np.linspace(-0.6, 1.2, 10)), ("b", np.linspace(-0.5, 0.5, 5)))
    return {"stability": cellmap.stability_map(exact, cellmap.periodic_orbit(exact, [0.5, 0.2]), *axes), **given}


def limit_cycle() -> Any:
    def rhs(t: float, x: Any, p: Any) -> Any:
        growth = p.a * (1.0 - x[0] ** 2 - x[1] ** 2)
        return growth * x[0] - x[1], growth * x[1] + x[0]

    return ForcedSystem(rhs, {"a": 0.1}, 6.0, ("x", "y"))


@cache
def motion() -> Any:
    """Return an orbit that swings, and one that rotates."""
    outputs = {"energy": lambda t, x, p: (0.5 * x[1] ** 2 - np.cos(x[0]),), "tip": lambda t, x, p: (x[0], x[1], 0.0)}
    system = ForcedSystem(
        lambda t, x, p: (x[1], -np.sin(x[0]) + 0.1 * np.cos(t)), {}, 2 * np.pi, (angle("theta"), "v"), outputs=outputs
    )
    return cellmap.trajectory(system, [[0.5, 0.0], [0.5, 3.0]], 2, samples_per_period=8)


FURTHER: dict[str, Callable[[], dict[str, Any]]] = {
    "save_auto of branch points": lambda: {"result": [born(3), born(2)], "path": "b.branch"},
    "periodic_orbit of a limit cycle": lambda: {
        "point_map": cellmap.maps.section_map(limit_cycle(), ("y", 0.0, 1)),
        "guess": [0.9],
    },
    "section_map of strange names": lambda: {
        "system": ForcedSystem(small.spiral, {"d": 0.1}, 6.0, ("side", "value")),
        "section": ("value", 0.0, 1),
    },
    "plot_basins of a line": lambda: {"basins": find_basins(halves("X"), CellGrid((-1.5,), (1.5,), (30,)))},
    "plot_basins of points": lambda: {"basins": find_basins(halves("X", "y"), small.CLOUD[:50] - 0.5)},
    "plot_basins in a plane": lambda: {
        "basins": find_basins(halves("x", "y", "Z"), small.CLOUD[:60].reshape(40, 3) - 0.5),
        "plane": ("Z", 0),
    },
    "plot_basins of phases": lambda: {"basins": ring(), "plane": ("phi_0", 2), "reference": "phi_1"},
    "plot_basins of a slice": lambda: {
        "basins": find_basins(halves("x", Coordinate("U", "V"), "y"), CellGrid((-1, -1, 0.5), (1, 1, 0.5), (4, 4, 1)))
    },
    "plot_basins in colours": lambda: {"colours": {0: "white", 1: "black"}},
    "plot_basins of a chaotic attractor": lambda: {
        "basins": find_basins(systems.henon_map(1.4 * small.NUDGE), CellGrid((-2, -2), (2, 2), (12, 12))),
        "shade": True,
    },
    "plot_fractions of many": lambda: {
        "basins": find_basins(halves(*"ABCD"), CellGrid((-1,) * 4, (1,) * 4, (2,) * 4)),
        "largest": 5,
    },
    "plot_bifurcation_diagram of few": lambda: {
        "diagram": bifurcations.bifurcation_diagram(
            systems.logistic_map(), "mu", [2.8, 3.2], [0.3], periods=64, follow="both"
        )
    },
    "plot_branches of a cascade": lambda: {"branches": cascade().branches, "colour": "red"},
    "plot_branches of the second coordinate": lambda: {"branches": [henon()], "coordinate": "y"},
    "plot_stability_map of maps": lambda: stability(measured=[[0.4, 0.2], [0.4, 200.0], [-0.7, 0.1]]),
    "plot_stability_map with errors": lambda: stability(
        measured=[[0.4, 0.2, 0.05], [0.9, -0.1, 0.0]], colours={Crossing.MINUS_ONE: "red"}
    ),
    "plot_bifurcation_curves of two kinds": lambda: {
        "curves": [
            bifurcations.continue_bifurcation(henon(), b, "b", (-2.0, 4.0), (-1.2, 0.4), step=0.4)
            for b in henon().bifurcations
        ]
    },
    "plot_invariant_circles that break": lambda: {"branch": circles()},
    "plot_invariant_circles by decay": lambda: {"branch": circles(), "show": "decay"},
    "plot_invariant_circles as curves": lambda: {"branch": circles(), "show": "circles", "coordinates": ("y", "x")},
    "plot_attractor_atlas of one kind": lambda: {"show": 1},
    "plot_time_series of outputs": lambda: {
        "trajectory": motion(),
        "names": ("v", "energy", "tip"),
        "labels": ["swing", "turn"],
    },
    "plot_time_series of an angle": lambda: {"trajectory": motion(), "names": "theta"},
    "plot_phase_portrait of angles": lambda: {"trajectory": motion(), "labels": ["swing", "turn"]},
    "plot_phase_portrait the other way": lambda: {"trajectory": motion(), "coordinates": ("v", "theta")},
    "plot_boxes of three coordinates": lambda: {
        "boxes": sets.BoxSet(CellGrid((0, 0, 0), (1, 1, 1), (2, 3, 4)), [1, 6]),
        "values": [3.0, 5.0],
        "coordinates": (2, 0),
    },
    "plot_boxes of a line": lambda: {"boxes": sets.BoxSet(CellGrid((0,), (1,), (4,)), [1, 3]), "values": [2.0, 7.0]},
    "plot_boxes with names": lambda: {"names": ("q", "v"), "facecolor": "red"},
    "plot_eigenvector of a line": lambda: {
        "operator": sets.transfer_operator(
            sets.BoxSet.full(CellGrid((0,), (1,), (8,))),
            discrete_map(lambda x, p: (1 - abs(2 * x[0] - 1),), {}, ("x",)),
        )
    },
    "plot_morse_graph of two cubics": lambda: {
        "graph": sets.morse_graph(
            discrete_map(lambda x, p: (1.5 * x[0] - x[0] ** 3 / 2, 1.5 * x[1] - x[1] ** 3 / 2), {}, ("x", "y")),
            CellGrid((-1.7, -1.7), (1.6, 1.6), (2, 2)),
            4,
            periods=3,
        )
    },
    "plot_morse_graph of a chaotic set": lambda: {
        "graph": sets.morse_graph(systems.henon_map(1.4 * small.NUDGE), CellGrid((-1.5, -0.5), (1.4, 0.6), (4, 4)), 4)
    },
    "plot_cell_mapping of several periods": lambda: {
        "mapping": sets.simple_cell_mapping(small.wells(), small.WINDOW, periods=3),
        "show_steps": True,
    },
    "plot_absorption of all": lambda: {"group": None},
    "plot_absorption of the last": lambda: {"group": -1},
    "plot_invariant_measure of a line": lambda: {
        "chain": sets.generalized_cell_mapping(systems.logistic_map(3.9 * small.NUDGE), CellGrid((0,), (1,), (20,)))
    },
    "plot_fit of boxes": lambda: {"result": fractal.box_dimension(small.CLOUD)},
    "plot_fit with a name": lambda: {"label": "growth", "shade": False},
    "plot_chaotic_saddle of a line": lambda: {
        "saddle": boundary.chaotic_saddle(
            discrete_map(lambda x, p: (1.5 - 3 * abs(x[0] - 0.5),), {}, ("x",)), CellGrid((0,), (1,), (1,)), n_points=5
        )
    },
}
"""Changes of good arguments; the first word of each is the function."""
