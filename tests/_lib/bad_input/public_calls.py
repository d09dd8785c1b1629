"""All that is public and can be called, with arguments that each call takes."""

import importlib
import inspect
import re
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import small_systems as small
import sympy
from further_calls import FURTHER

import cellmap
import systems
from cellmap import CellGrid, angle, bifurcations
from cellmap._lib.signatures import makers

SAMPLES: dict[str, Callable[[], Any]] = {
    "PointMap": small.wells,
    "ForcedSystem": small.swinging,
    "CellGrid": lambda: small.WINDOW,
    "Coordinate": lambda: angle("theta"),
    "PeriodicOrbit": lambda: cellmap.periodic_orbit(small.wells(), [0.0, 0.0]),
    "Attractor": lambda: sample("Basins").attractors[0],
    "Certificate": lambda: cellmap.certify(small.interpolated()),
    "Bifurcation": lambda: sample("Branch").bifurcations[0],
    "FunctionZero": lambda: small.doublings_of_henon().with_zeros(GIVEN["functions"]).zeros[0],
    "BifurcationCurve": small.doublings_of_henon,
    "CodimensionTwo": lambda: small.doublings_of_henon().codimension_two()[0],
    "NewCurve": lambda: sample("CodimensionTwo").new_curves[0],
    "ConnectingOrbit": lambda: bifurcations.connecting_orbits(*small.outer_saddle(), max_steps=16, n_samples=512)[0],
    "Tangency": lambda: bifurcations.continue_connection(sample("ConnectingOrbit"), "a", 1.3, 1.41).tangencies[0],
    "SectionMap": lambda: called("section_map", good_arguments("section_map")),
    "BoxSet": lambda: cellmap.sets.BoxSet.full(CellGrid((-1.5, -1.0), (1.5, 1.0), (8, 4))),
    "Option": lambda: sample("Plan").chosen,
    "Fit": lambda: called("fit_line", good_arguments("fit_line")),
}
"""Records that no function makes with its good arguments."""


@cache
def sample(name: str) -> Any:
    """Return a record of a class, from the function that makes them."""
    if name in SAMPLES:
        return SAMPLES[name]()
    maker = MADE_BY[name].replace(",", "").split()[0]
    return called(maker, good_arguments(maker))


LEFT_OUT = ("derivative", "fun", "signs", "error", "quantity", "explore")
"""Methods that are the user's function, which integrators call many times; one that exact maps do not have; what
declares a field where a class is defined; and what serves a page until it is closed."""

BY_HAND = ("ForcedSystem", "Coordinate", "CellGrid", "BoxSet")
WITH_METHODS = ("PointMap", "SectionMap", "Option", "Fit")


GIVEN: dict[str, Any] = {
    **dict.fromkeys("initial_conditions points".split(), small.POINTS),
    **dict.fromkeys("point initial_condition guess".split(), small.POINTS[0]),
    **dict.fromkeys("x y".split(), (0.1, 0.2)),
    **dict.fromkeys("label axis before after".split(), 0),
    **{key: {"x": bifurcations.OrbitFunction(0, value=0.5)} for key in "functions until".split()},
    **dict.fromkeys("length amplitude frequency damping alpha beta gamma".split(), 0.5),
    **dict.fromkeys("frequency_ratio amplitude_ratio effective_length".split(), 0.5),
    **{"coordinates": ("x", "y"), "params": {"r": 1.5, "s": 0.5}, "parameter": "r", "values": (1.4, 1.5), "value": 1.6},
    **{"equilibrium": (0.0, 0.0), "depth": 4, "kind": "unstable", "t": 0.3, "cells": (0.5, 1.5)},
    **{"keys": np.array([1, 2]), "mask": np.arange(32) % 2 == 0, "place": 1, "confidence": 0.9, "accuracy": 1e-3},
    **{"order": 2, "lengths": (0.03, 0.04), "masses": (1.0, 2.0), "near": 0.0, "lower": 1.3, "upper": 2.2},
    **{"region": small.WINDOW, "part": systems.Gravity(9.8), "units": systems.Units(length=2.0), "names": {0: "first"}},
}
"""Values of arguments by their names, where the type says too little."""

COMPUTED: dict[str, Callable[[], Any]] = {
    "attractors": lambda: sample("Basins").attractors,
    "tree": lambda: sample("Basins").to_xarray(),
    "potential": lambda: systems.effective_potential(small.swinging()),
}

SMALL = {
    **dict.fromkeys("n_samples n_points max_points".split(), 40),
    **dict.fromkeys("n_frequencies periods samples samples_per_period".split(), 4),
    **dict.fromkeys("longest_period n_offsets refinements transient".split(), 2),
    **{"max_periods": 60, "n_trials": 32, "n_discs": 30, "max_pairs": 400, "max_initial_conditions": 16},
    **{"audit": 10, "min_uncertain": 5, "lifetime": 5, "doublings": 1, "n_eigenvalues": 1, "group": 0},
}
"""Whole numbers that make calls short."""

FEW = {"max_points": 4}

SPECIAL: dict[str, Callable[[], dict[str, Any]]] = {
    "ForcedSystem": lambda: {"rhs": small.spiral, "params": {"d": 0.2}, "period": 6.0},
    "ForcedSystem.from_scipy": lambda: {"fun": lambda t, y, d: (y[1], -y[0] - d * y[1]), "args": (0.2,), "period": 6.0},
    "ForcedSystem.from_sympy": lambda: {
        "equations": [sympy.Symbol("v"), -sympy.Symbol("q")],
        "params": {},
        "period": 6.0,
        "coordinates": ("q", "v"),
    },
    "Coordinate": lambda: {"name": "theta", "period": 6.0},
    "CellGrid": lambda: {"lower": (0.0, 0.0), "upper": (1.0, 1.0), "shape": (4, 4)},
    "angle": lambda: {"name": "theta"},
    "discrete_map": lambda: {"function": small.two_wells},
    "flow_map": lambda: {"system": small.rotating(), "time": 1.0},
    "section_map": lambda: {"system": small.rotating(), "section": ("q", 0.0, 1)},
    "swept_map": lambda: {"parameters": "r"},
    "swept_system": lambda: {"parameters": "gamma"},
    "integrate": lambda: {"begin": 1.0, "duration": 2.0},
    "sampled_drive": lambda: {"samples": (1.0, 0.5, -1.0, -0.5), "frequency": 2.0},
    "release_limits": lambda: {"angles": 4, "tolerance": 1e-2},
    "find_well": lambda: {"near": 0.0},
    "scene": lambda: {"body": systems.Pendulum(0.0272), "effects": systems.VerticalDrive(0.003, 50.0)},
    "critical_values": lambda: {"parameter": "beta", "lower": 0.1, "upper": 0.4, "n_points": 8},
    "connecting_orbits": lambda: {
        **dict(zip(("point_map", "source"), small.outer_saddle(), strict=True)),
        **{"max_steps": 16, "n_samples": 512, "radius": 0.05},
    },
    "continue_connection": lambda: {"parameter": "a", "lower": 1.35, "upper": 1.45} | FEW,
    "continue_tangency": lambda: {"parameters": ("a", "b"), "first": (1.3, 1.4), "second": (-0.35, -0.25)} | FEW,
    "save_auto": lambda: {"path": "b.branch"},
    "read_ode": lambda: {"path": str(Path(__file__).parents[2] / "exchange/pendulum.ode"), "period": 2 * np.pi},
    "continue_circle": lambda: {
        **{"point_map": small.delayed_logistic(), "parameter": "a", "values": (2.02, 2.03)},
        **{"initial_condition": (0.5, 0.4), "transient": 500},
    },
    "switch_circle": small.circle_of_delayed_logistic,
    "arnold_tongue": lambda: {
        **{"point_map": small.turning(), "rotations": 0, "period": 1, "parameters": ("w", "k")},
        **{"first": (-0.8, 0.8), "second": (0.4, 0.6), "initial_condition": (0.5,)},
        **{"transient": 100, "periods": 64, "max_points": 2},
    },
    "attractor_atlas": lambda: {"x": ("r", (1.4, 1.5)), "y": ("s", (0.4, 0.5)), "curves": 0, "longest_period": 2},
    "AttractorAtlas.fraction": lambda: {"family": 0},
    "plot_attractor_atlas": lambda: {"show": "number"},
    "stability_map": lambda: {"x": ("alpha", (0.1, 0.2, 0.3)), "y": ("beta", (0.1, 0.2, 0.3))},
    "jury_margins": lambda: {"matrix": [[0.5, 0.0], [0.1, 0.2]]},
    "continue_bifurcation": lambda: {"parameter": "s", "first": (1.3, 2.2), "second": (0.4, 0.6), "step": 0.05},
    "switch_curve": lambda: {"first": (0.0, 4.0), "second": (-1.5, 0.9), "step": 0.2},
    "continue_codimension_two": lambda: {
        **dict(zip(("curve", "point"), small.cusp_of_a_cubic_map(), strict=True)),
        **{**dict.fromkeys(("first", "second", "third"), (-1.0, 1.0)), "parameter": "c", "step": 0.2},
    },
    "plot_bifurcation_curves": lambda: {"curves": sample("BifurcationCurve")},
    "find_branches": lambda: {"upper": 1.6, "n_values": 1, "step": 0.1},
    "codimension_two_form": lambda: {
        **{"point_map": cellmap.discrete_map(lambda x, p: (x[0] - p.s * x[0] ** 3,), {"s": 1.0}, ("x",))},
        **{"point": [0.0], "kind": bifurcations.CodimensionTwoKind.CUSP},
    },
    "normal_form": lambda: {"point": (0.0, 0.0), "kind": bifurcations.BifurcationKind.PITCHFORK},
    "continue_orbit": lambda: {"orbit": sample("Attractor"), "step": 0.05},
    "period_doubling_cascade": lambda: {"limit": 2.5, "orbit": sample("Attractor")},
    "switch_branch": lambda: {"step": 0.05},
    "certify": lambda: {"basins": small.interpolated()},
    "TransferOperator.almost_invariant_sets": lambda: {"n_sets": 2},
    "Branch.of_kind": lambda: {"kind": bifurcations.BifurcationKind.PERIOD_DOUBLING},
    "CellGrid.on": lambda: {"coordinates": small.wells().coordinates},
    "SectionMap.returns": lambda: {"points": [[1.0]]},
    "bifurcation_diagram": lambda: {"periods": 20},
    "covariant_vectors": lambda: {"point_map": systems.henon_map(), "periods": 20},
    "lyapunov_spectrum": lambda: {"periods": 20},
    "exponent_test": lambda: {"periods": 40},
    "zero_one_test": lambda: {"periods": 200, "n_frequencies": 20},
    "alignment_test": lambda: {"periods": 44},
    "edge_orbit": lambda: {"periods": 3},
    "chaotic_saddle": lambda: {"point_map": small.leaving(), "attractors": (), "max_stagger": 0.1},
    "escape_rate": lambda: {"point_map": small.leaving(), "attractors": (), "n_samples": 2000, "max_periods": 20},
    "zero_one_test_of_series": lambda: {"series": small.CLOUD[:, 0], "n_frequencies": 20},
    "binomial_interval": lambda: {"count": 3, "trials": 10},
    "symmetric_groups": lambda: {"symmetries": {"none": lambda x: x}},
    "random_ball": lambda: {"radius": 0.5},
    "random_box": lambda: {"ranges": {"x": (0.0, 1.0)}},
    "node_stability": lambda: {"nodes": {"first": {"x": (0.0, 1.0)}}},
    "survivability": lambda: {"allowed": {"x": (-1.0, 1.0)}},
    "boundary_dimension": lambda: {"basins": small.LABELS, "sizes": (1, 2, 4, 8), "lattice": None},
    "image_uncertainty_exponent": lambda: {"basins": small.LABELS},
    "basin_entropy": lambda: {"box_size": 3},
    "fractal_boundary_test": lambda: {"radius": 2.0, "n_discs": 100},
    "uncertainty_exponent": lambda: {"max_pairs": 4096},
    "box_dimension": lambda: {"points": small.CLOUD},
    "generalized_dimensions": lambda: {"points": small.CLOUD, "sizes": (0.4, 0.3, 0.2, 0.15), "fit_range": (0.1, 0.5)},
    "correlation_dimension": lambda: {"points": small.CLOUD, "theiler": 0},
    "kaplan_yorke_dimension": lambda: {"exponents": (0.4, -1.6)},
    "fit_line": lambda: {"x": np.arange(8.0), "y": 2.0 * np.arange(8.0) + 0.1 * small.CLOUD[:8, 0]},
    "smooth_boundary_entropy": lambda: {"dimension": 2},
    "plot_eigenvector": lambda: {"index": 1},
    "plot_draw": lambda: {"result": sample("Basins")},
    "to_dataframe": lambda: {"result": sample("Basins")},
    "to_xarray": lambda: {"result": sample("Basins")},
    "save_basins": lambda: {"path": "basins.h5"},
    "Proof.save": lambda: {"path": "proof.h5"},
    "load_basins": lambda: {"path": saved_basins()},
    "classify_by_features": lambda: {"min_size": 2},
    "rebuild_map": lambda: {"source": small.wells(), "recipe": dict(small.wells().recipe)},
    "recompute_basins": lambda: {"source": small.wells()},
    "set_threads": lambda: {"count": 2},
    "animate": lambda: {"output": "positions"},
    "ForcedSystem.output": lambda: {"name": "positions", "states": small.POINTS},
    "Trajectory.output": lambda: {"name": "positions"},
}


@cache
def saved_basins() -> Path:
    return cellmap.save_basins(sample("Basins"), Path("kept.h5").absolute())


ROOMS = (
    "maps orbits bifurcations attractors basins sets analysis analysis.fractal analysis.resilience analysis.boundary "
    "exchange"
)


@cache
def public_things() -> Mapping[str, Any]:
    """Return all that the library and its systems offer, by names; figures have plot_ before theirs."""
    found = {name: getattr(systems, name) for name in getattr(systems, "__all__", dir(systems))}
    for room in ("", *ROOMS.split(), "plot"):
        module = importlib.import_module(f"cellmap.{room}".strip("."))
        found |= {("plot_" if room == "plot" else "") + name: getattr(module, name) for name in module.__all__}
    return found


MADE_BY = {
    name: makers(member)
    for name, member in public_things().items()
    if inspect.isclass(member) and member.__module__.startswith("cellmap.") and makers(member)
}
"""Where records come from, as errors say it."""


def targets() -> Mapping[str, Callable[[], Callable[..., Any]]]:
    """Return all that can be called, by names: functions, records that are made by hand, and methods of records."""
    found: dict[str, Callable[[], Callable[..., Any]]] = {}
    for name, member in public_things().items():
        if (inspect.isfunction(member) or name in BY_HAND) and name not in LEFT_OUT:
            found[name] = lambda member=member: member
        if inspect.isclass(member) and (name in MADE_BY or name in BY_HAND or name in WITH_METHODS):
            for method, function in vars(member).items():
                known = inspect.isfunction(function) or isinstance(function, classmethod)
                if known and not method.startswith("_") and method not in LEFT_OUT:
                    found[f"{name}.{method}"] = lambda name=name, method=method: getattr(sample(name), method)
    return found


TARGETS = targets()


@cache
def parameters(name: str) -> tuple[inspect.Parameter, ...]:
    return tuple(p for p in inspect.signature(TARGETS[name]()).parameters.values() if p.kind is not p.VAR_KEYWORD)


@cache
def good_arguments(name: str) -> Mapping[str, Any]:
    """Return arguments that a call takes, by names; they keep it short."""
    chosen = SPECIAL.get(name, dict)()
    for p in parameters(name):
        kind = str(p.annotation)
        if p.name in chosen:
            continue
        if p.name in SMALL and kind.startswith(("int", "Sequence[int] | int", "Samples")):
            chosen[p.name] = SMALL[p.name]
        elif p.default is p.empty:
            record = kind.split(" |")[0]
            if record in RECORDS:
                chosen[p.name] = sample(record)
            else:
                chosen[p.name] = COMPUTED[p.name]() if p.name in COMPUTED else GIVEN[p.name]
    return chosen


def cases(name: str) -> Mapping[str, Mapping[str, Any]]:
    """Return good calls: one, and one with all switches turned; none of a plan, which measures times, nor of cycles."""
    if "plan" in re.split(r"[._]", name.lower()) or name in ("Option.meets", "TransferOperator.cycle"):
        return {}
    turned = {p.name: not p.default for p in parameters(name) if isinstance(p.default, bool) and p.name != "progress"}
    further = {key: changes() for key, changes in FURTHER.items() if key.split()[0] == name}
    changed = {name: {}, " ".join([name, *turned]): turned, **further}
    return {key: {**good_arguments(name), **changes} for key, changes in changed.items()}


RECORDS = {*MADE_BY, *BY_HAND, *WITH_METHODS}


def called(name: str, arguments: Mapping[str, Any]) -> Any:
    function = TARGETS[name]()
    given = parameters(name)
    several = [k for k, p in enumerate(given) if p.kind is p.VAR_POSITIONAL]
    by_place = [p.name for k, p in enumerate(given) if p.kind is p.POSITIONAL_ONLY or k <= max(several, default=-1)]
    named = {key: value for key, value in arguments.items() if key not in by_place}
    return function(*(arguments[key] for key in by_place if key in arguments), **named)


def words_of(message: str) -> set[str]:
    """Return what a message names as arguments, ``word=``."""
    return set(re.findall(r"(?<![\w.{'\"])([a-z_][a-z_0-9]*)=(?!=)", message))


def arguments_named(word: str, name: str, message: str = "") -> bool:
    """Whether a word is an argument of a public function, of the class of a method, or of what the message names."""
    parts = name.split(".")
    things = [public_things()[parts[0]], *(getattr(public_things()[parts[0]], method) for method in parts[1:])]
    things += [public_things()[other] for other in re.findall(r"\w+", message) if other in public_things()]
    for thing in things:
        if callable(thing):
            given = inspect.signature(thing).parameters
            if word in given or any(p.kind is p.VAR_KEYWORD for p in given.values()):
                return True
    return False
