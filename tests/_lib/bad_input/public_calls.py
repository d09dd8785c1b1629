"""All that is public and can be called, with arguments that each call takes."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Callable, Mapping
from functools import cache
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from small_systems import (
    CLOUD,
    LABELS,
    POINTS,
    WINDOW,
    circle_of_delayed_logistic,
    delayed_logistic,
    doublings_of_henon,
    folds_of_a_cubic_map,
    interpolated,
    leaving,
    outer_saddle,
    rotating,
    spiral,
    swinging,
    two_wells,
    wells,
)

import cellmap
import systems
from cellmap import CellGrid, angle
from cellmap._lib.signatures import makers


@cache
def sample(name: str) -> Any:
    """Return a record of a class, from the function that makes them."""
    match name:
        case "PointMap":
            return wells()
        case "ForcedSystem":
            return swinging()
        case "CellGrid":
            return WINDOW
        case "Coordinate":
            return angle("theta")
        case "PeriodicOrbit":
            return cellmap.periodic_orbit(wells(), [0.0, 0.0])
        case "Attractor":
            return sample("Basins").attractors[0]
        case "Certificate":
            return cellmap.certify(interpolated())
        case "Bifurcation":
            return sample("Branch").bifurcations[0]
        case "FunctionZero":
            return doublings_of_henon().with_zeros({"x": cellmap.bifurcations.OrbitFunction(0, value=0.5)}).zeros[0]
        case "BifurcationCurve":
            return doublings_of_henon()
        case "CodimensionTwo":
            return doublings_of_henon().codimension_two()[0]
        case "NewCurve":
            return sample("CodimensionTwo").new_curves[0]
        case "ConnectingOrbit":
            return cellmap.bifurcations.connecting_orbits(*outer_saddle(), max_steps=16, n_samples=512)[0]
        case "Tangency":
            branch = cellmap.bifurcations.continue_connection(sample("ConnectingOrbit"), "a", 1.3, 1.41)
            return branch.tangencies[0]
        case "SectionMap":
            return cellmap.section_map(rotating(), ("q", 0.0, 1))
        case "BoxSet":
            return cellmap.sets.BoxSet.full(CellGrid((-1.5, -1.0), (1.5, 1.0), (8, 4)))
        case "Option":
            return sample("Plan").chosen
        case "Fit":
            return called("fit_line", good_arguments("fit_line"))
    maker = MADE_BY[name].replace(",", "").split()[0]
    return called(maker, good_arguments(maker))


LEFT_OUT = ("derivative", "fun", "signs", "error", "quantity", "explore")
"""Methods that are the user's function, which integrators call many times; one that exact maps do not have; what
declares a field where a class is defined; and what serves a page until it is closed."""

BY_HAND = ("ForcedSystem", "Coordinate", "CellGrid", "BoxSet")
WITH_METHODS = ("PointMap", "SectionMap", "Option", "Fit")


GIVEN: dict[str, Callable[[], Any]] = {
    "coordinates": lambda: ("x", "y"),
    "params": lambda: {"r": 1.5, "s": 0.5},
    "attractors": lambda: sample("Basins").attractors,
    "parameter": lambda: "r",
    "initial_conditions": lambda: POINTS,
    "points": lambda: POINTS,
    "point": lambda: POINTS[0],
    "initial_condition": lambda: POINTS[0],
    "guess": lambda: POINTS[0],
    "equilibrium": lambda: (0.0, 0.0),
    "lower": lambda: 1.3,
    "upper": lambda: 2.2,
    "label": lambda: 0,
    "region": lambda: WINDOW,
    "depth": lambda: 4,
    "kind": lambda: "unstable",
    "values": lambda: (1.4, 1.5),
    "value": lambda: 1.6,
    "t": lambda: 0.3,
    "x": lambda: (0.1, 0.2),
    "y": lambda: (0.1, 0.2),
    "axis": lambda: 0,
    "tree": lambda: sample("Basins").to_xarray(),
    "cells": lambda: (0.5, 1.5),
    "keys": lambda: np.array([1, 2]),
    "functions": lambda: {"x": cellmap.bifurcations.OrbitFunction(0, value=0.5)},
    "until": lambda: {"x": cellmap.bifurcations.OrbitFunction(0, value=0.5)},
    "place": lambda: 1,
    "mask": lambda: np.arange(32) % 2 == 0,
    "before": lambda: 0,
    "after": lambda: 0,
    "confidence": lambda: 0.9,
    "accuracy": lambda: 1e-3,
    "order": lambda: 2,
    "lengths": lambda: (0.03, 0.04),
    "masses": lambda: (1.0, 2.0),
    "effective_length": lambda: 0.5,
    "part": lambda: systems.Gravity(9.8),
    "units": lambda: systems.Units(length=2.0),
    "potential": lambda: systems.effective_potential(swinging()),
    "near": lambda: 0.0,
    **{
        quantity: lambda: 0.5
        for quantity in "length amplitude frequency damping alpha beta gamma frequency_ratio amplitude_ratio".split()
    },
}
"""Values of arguments by their names, where the type says too little."""

SMALL = {
    "max_periods": 60,
    "longest_period": 2,
    "periods": 4,
    "transient": 2,
    "n_samples": 40,
    "n_points": 40,
    "audit": 10,
    "max_points": 40,
    "n_trials": 32,
    "n_discs": 30,
    "max_pairs": 400,
    "min_uncertain": 5,
    "n_frequencies": 4,
    "n_offsets": 2,
    "refinements": 2,
    "lifetime": 5,
    "samples": 4,
    "samples_per_period": 4,
    "doublings": 1,
    "n_eigenvalues": 1,
    "group": 0,
    "max_initial_conditions": 16,
}
"""Whole numbers that make calls short."""

SPECIAL: dict[str, Callable[[], dict[str, Any]]] = {
    "ForcedSystem": lambda: {"rhs": spiral, "params": {"d": 0.2}, "period": 6.0, "coordinates": ("q", "v")},
    "Coordinate": lambda: {"name": "theta", "period": 2 * pi},
    "CellGrid": lambda: {"lower": (0.0, 0.0), "upper": (1.0, 1.0), "shape": (4, 4)},
    "BoxSet": lambda: {"grid": WINDOW, "keys": np.array([1, 2])},
    "angle": lambda: {"name": "theta"},
    "discrete_map": lambda: {"function": two_wells, "params": {"r": 1.5, "s": 0.5}, "coordinates": ("x", "y")},
    "flow_map": lambda: {"system": rotating(), "time": 1.0},
    "section_map": lambda: {"system": rotating(), "section": ("q", 0.0, 1)},
    "swept_map": lambda: {"point_map": wells(), "parameters": "r"},
    "swept_system": lambda: {"system": swinging(), "parameters": "gamma"},
    "integrate": lambda: {"begin": 1.0, "duration": 2.0},
    "sampled_drive": lambda: {"samples": (1.0, 0.5, -1.0, -0.5), "frequency": 2.0},
    "release_limits": lambda: {"angles": 8, "tolerance": 1e-3, "max_periods": 60},
    "find_well": lambda: {"near": 0.0},
    "scene": lambda: {"body": systems.Pendulum(0.0272), "effects": systems.VerticalDrive(0.003, 50.0)},
    "critical_values": lambda: {"parameter": "beta", "lower": 0.1, "upper": 0.4, "n_points": 8},
    "connecting_orbits": lambda: {
        **dict(zip(("point_map", "source"), outer_saddle(), strict=True)),
        **{"max_steps": 16, "n_samples": 512, "radius": 0.05},
    },
    "continue_connection": lambda: {"parameter": "a", "lower": 1.35, "upper": 1.45, "max_points": 4},
    "continue_tangency": lambda: {
        **{"parameters": ("a", "b"), "first": (1.3, 1.4), "second": (-0.35, -0.25), "max_points": 4},
    },
    "save_auto": lambda: {"result": sample("Branch"), "path": "b.branch"},
    "continue_circle": lambda: {
        **{"point_map": delayed_logistic(), "parameter": "a", "values": (2.02, 2.03), "initial_condition": (0.5, 0.4)},
        **{"transient": 500},
    },
    "switch_circle": lambda: circle_of_delayed_logistic(),
    "arnold_tongue": lambda: {
        **{"point_map": delayed_logistic(), "rotations": 1, "period": 7, "parameters": ("a", "e")},
        **{"first": (2.15, 2.22), "second": (-0.01, 0.01), "initial_condition": (0.5, 0.4)},
        **{"transient": 1000, "periods": 100, "max_points": 2},
    },
    "attractor_atlas": lambda: {"x": ("r", (1.4, 1.5)), "y": ("s", (0.4, 0.5)), "curves": 0, "longest_period": 2},
    "AttractorAtlas.fraction": lambda: {"family": 0},
    "plot_attractor_atlas": lambda: {"show": "number"},
    "stability_map": lambda: {"x": ("alpha", (0.1, 0.2, 0.3)), "y": ("beta", (0.1, 0.2, 0.3))},
    "jury_margins": lambda: {"matrix": [[0.5, 0.0], [0.1, 0.2]]},
    "continue_bifurcation": lambda: {"parameter": "s", "first": (1.3, 2.2), "second": (0.4, 0.6), "step": 0.05},
    "switch_curve": lambda: {"first": (0.0, 4.0), "second": (-1.5, 0.9), "step": 0.2},
    "continue_codimension_two": lambda: {
        **{"curve": folds_of_a_cubic_map(), "point": folds_of_a_cubic_map().codimension_two()[0], "parameter": "c"},
        **dict.fromkeys(("first", "second", "third"), (-1.0, 1.0)),
        "step": 0.2,
    },
    "plot_bifurcation_curves": lambda: {"curves": doublings_of_henon()},
    "find_branches": lambda: {"parameter": "r", "lower": 1.3, "upper": 1.6, "n_values": 1, "step": 0.1},
    "codimension_two_form": lambda: {
        **{"point_map": cellmap.discrete_map(lambda x, p: (x[0] - p.s * x[0] ** 3,), {"s": 1.0}, ("x",))},
        **{"point": [0.0], "kind": cellmap.bifurcations.CodimensionTwoKind.CUSP},
    },
    "normal_form": lambda: {"point": [0.0, 0.0], "kind": cellmap.bifurcations.BifurcationKind.PITCHFORK},
    "continue_orbit": lambda: {"orbit": sample("Attractor"), "lower": 1.3, "upper": 2.3, "step": 0.05},
    "period_doubling_cascade": lambda: {"limit": 2.5, "orbit": sample("Attractor")},
    "switch_branch": lambda: {"lower": 1.3, "upper": 2.2, "step": 0.05},
    "certify": lambda: {"basins": interpolated()},
    "TransferOperator.cycle": lambda: {"order": 2},
    "TransferOperator.almost_invariant_sets": lambda: {"n_sets": 2},
    "Branch.of_kind": lambda: {"kind": cellmap.bifurcations.BifurcationKind.PERIOD_DOUBLING},
    "CellGrid.on": lambda: {"coordinates": wells().coordinates},
    "SectionMap.returns": lambda: {"points": [[1.0]]},
    "bifurcation_diagram": lambda: {"periods": 20},
    "covariant_vectors": lambda: {"point_map": systems.henon_map(), "periods": 20},
    "lyapunov_spectrum": lambda: {"periods": 20},
    "exponent_test": lambda: {"periods": 40},
    "zero_one_test": lambda: {"periods": 200, "n_frequencies": 20},
    "alignment_test": lambda: {"periods": 44},
    "edge_orbit": lambda: {"periods": 3},
    "chaotic_saddle": lambda: {"point_map": leaving(), "attractors": (), "max_stagger": 0.1},
    "escape_rate": lambda: {"point_map": leaving(), "attractors": (), "n_samples": 2000, "max_periods": 20},
    "zero_one_test_of_series": lambda: {"series": CLOUD[:, 0], "n_frequencies": 20},
    "binomial_interval": lambda: {"count": 3, "trials": 10},
    "symmetric_groups": lambda: {"basins": sample("Basins"), "symmetries": {"none": lambda x: x}},
    "random_ball": lambda: {"radius": 0.5},
    "random_box": lambda: {"ranges": {"x": (0.0, 1.0)}},
    "node_stability": lambda: {"source": sample("Basins"), "attractors": (), "nodes": {"first": {"x": (0.0, 1.0)}}},
    "survivability": lambda: {"allowed": {"x": (-1.0, 1.0)}, "distribution": WINDOW},
    "tipping_probabilities": lambda: {"before": sample("Basins"), "after": sample("Basins")},
    "largest_ball": lambda: {"basins": sample("Basins")},
    "boundary_dimension": lambda: {"basins": LABELS, "sizes": (1, 2, 4, 8), "lattice": None},
    "image_uncertainty_exponent": lambda: {"basins": LABELS},
    "basin_entropy": lambda: {"basins": sample("Basins"), "box_size": 3},
    "fractal_boundary_test": lambda: {"basins": sample("Basins"), "radius": 2.0, "n_discs": 100},
    "wada_merging": lambda: {"basins": sample("Basins")},
    "uncertainty_exponent": lambda: {"source": sample("Basins"), "max_pairs": 4096},
    "box_dimension": lambda: {"points": CLOUD},
    "generalized_dimensions": lambda: {"points": CLOUD, "sizes": (0.4, 0.3, 0.2, 0.15), "fit_range": (0.1, 0.5)},
    "correlation_dimension": lambda: {"points": CLOUD, "theiler": 0},
    "kaplan_yorke_dimension": lambda: {"exponents": (0.4, -1.6)},
    "fit_line": lambda: {"x": np.arange(8.0), "y": 2.0 * np.arange(8.0) + 0.1 * CLOUD[:8, 0]},
    "smooth_boundary_entropy": lambda: {"dimension": 2},
    "inverse_stroboscopic_map": lambda: {"system": rotating()},
    "plot_eigenvector": lambda: {"index": 1},
    "plot_draw": lambda: {"result": sample("Basins")},
    "to_dataframe": lambda: {"result": sample("Basins")},
    "to_xarray": lambda: {"result": sample("Basins")},
    "plot_fit": lambda: {"result": sample("Fit")},
    "save_basins": lambda: {"basins": sample("Basins"), "path": "basins.h5"},
    "Proof.save": lambda: {"path": "proof.h5"},
    "load_basins": lambda: {"path": saved_basins()},
    "cluster_orbits": lambda: {"initial_conditions": POINTS, "transient": 2, "periods": 2},
    "classify_by_features": lambda: {"initial_conditions": POINTS, "transient": 2, "periods": 2, "min_size": 2},
    "rebuild_map": lambda: {"source": wells(), "recipe": dict(wells().recipe)},
    "recompute_basins": lambda: {"basins": sample("Basins"), "source": wells()},
    "set_threads": lambda: {"count": 2},
    "animate": lambda: {"trajectory": sample("Trajectory"), "output": "positions"},
    "ForcedSystem.output": lambda: {"name": "positions", "t": 0.0, "states": POINTS},
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
            chosen[p.name] = sample(record) if record in RECORDS else GIVEN[p.name]()
    return chosen


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
