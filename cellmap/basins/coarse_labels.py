"""Labels by a map of a coarser tolerance, by attractors of the map itself, with an audit of a part of them."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.checks import finite_number, warn_caller
from ..attractors.kinds.transients import UnsettledWarning
from ..attractors.labels import Label
from ..attractors.search import MAX_PERIODS, find_attractors
from ..attractors.settling.residence import is_same
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor
from .classification import labeller
from .initial_conditions import InitialConditions
from .record import Basins

AUDITED = 1024
"""Initial conditions that are labelled again by the map itself, half of them where neighbours differ."""

ALLOWED = 1e-3
"""Fraction of wrong labels, as the audit estimates it, from which on all are labelled again."""

_SEARCHED = 1024  # initial conditions from which attractors are searched for


def coarser(point_map: PointMap, rtol: float) -> PointMap:
    """Return the map to another relative tolerance, and an absolute one that is larger by the same factor.

    Raises
    ------
    ValueError
        For maps without a tolerance, and for tolerances that are not larger than that of the map.
    """
    spec: Any = None if point_map.table is not None else point_map.spec
    own, atol = getattr(spec, "rtol", None), getattr(spec, "atol", None)
    if own is None:
        raise ValueError(f"label_rtol={rtol!r}: labels of {point_map!r} have no tolerance: leave it out")
    if finite_number("label_rtol", rtol, above=0.0) <= own:
        raise ValueError(f"label_rtol={rtol!r}: the map has rtol={own!r}: give a larger one, or leave it out")
    larger = np.asarray(atol) * (rtol / own)
    made = replace(spec, rtol=rtol, atol=tuple(larger.tolist()) if larger.ndim else float(larger)).build()
    assert isinstance(made, PointMap)
    return made


def audited_basins(
    find: Callable[[PointMap, Sequence[Attractor]], Basins],
    point_map: PointMap,
    places: InitialConditions,
    rtol: float,
    settings: Mapping[str, Any],
    known: Sequence[Attractor],
) -> Basins:
    """Return basins with labels by a coarser map, unless an audit finds that too many of them are wrong.

    ``find`` labels all initial conditions by a map and attractors.  Attractors and trapping regions are those of the
    map itself: a coarser one has others, which differ by its error.  What the audit has found is in the settings.
    """
    coarse, total = coarser(point_map, rtol), len(places)
    few = np.sort(np.random.default_rng(0).choice(total, min(total, _SEARCHED), replace=False))
    points, periods = places.wrapped(few, point_map), settings["max_periods"] or MAX_PERIODS
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnsettledWarning)
        attractors = find_attractors(point_map, points, periods, settings["longest_period"], known)
    basins, audit = None, _compared(coarse, point_map, attractors, points, periods)
    if audit["wrong"] <= ALLOWED:
        basins, audit = _audited(find(coarse, attractors), point_map, attractors, places)
    if basins is None or audit["wrong"] > ALLOWED:
        basins = find(point_map, attractors)
    elif audit["differing"]:
        warn_caller(
            f"{audit['differing']} of {audit['audited']} initial conditions that were audited have another label with "
            f"the map itself, which suggests that {audit['wrong']:.2%} of all labels are wrong; leave out label_rtol"
        )
    found = {**basins.settings, "map": dict(point_map.recipe), "label_rtol": rtol, "audit": audit}
    return replace(basins, settings=found, point_map=point_map)


def _compared(
    coarse: PointMap, exact: PointMap, attractors: Sequence[Attractor], points: Floats, periods: int
) -> dict[str, float]:
    """Label some initial conditions by both maps: on fractal boundaries few show that many labels are wrong."""
    if not attractors:
        return {"audited": 0, "differing": 0, "wrong": 1.0}
    labels, others = (labeller(used, attractors, max_periods=periods)(points) for used in (coarse, exact))
    differing = int(np.count_nonzero(labels != others))
    return {"audited": len(points), "differing": differing, "wrong": differing / len(points)}


def _audited(
    basins: Basins, point_map: PointMap, attractors: Sequence[Attractor], places: InitialConditions
) -> tuple[Basins, dict[str, float]]:
    """Label some initial conditions again; return basins with these labels, and what was found.

    They are ``audited``, ``differing`` of them have another label, and ``wrong`` is the fraction of all that are
    estimated to be so, from those where neighbours differ and from the others.
    """
    if not all(any(is_same(a, b) for b in attractors) for a in basins.attractors):
        return basins, {"audited": 0, "differing": 0, "wrong": 1.0}
    labels, times = basins.labels.copy(), basins.settling_time.copy()
    flat, flat_times = labels.reshape(-1), times.reshape(-1)
    beside = _beside_others(basins).ravel()
    # Those that no initial condition has come to by the coarser map have numbers behind the others.
    others = [a for a in attractors if not any(is_same(a, b) for b in basins.attractors)]
    exact = labeller(point_map, [*basins.attractors, *others], max_periods=basins.settings["max_periods"])
    audited = differing = 0
    wrong = 0.0
    for group in (beside, ~beside):
        rows = _some(np.flatnonzero(group & (flat != Label.UNLABELLED)))
        if not len(rows):
            continue
        found = exact.settle(places.wrapped(rows, point_map))
        if (found.labels >= len(basins.attractors)).any():
            return basins, {"audited": audited + len(rows), "differing": differing, "wrong": 1.0}
        differ = int(np.count_nonzero(found.labels != flat[rows]))
        flat[rows], flat_times[rows] = found.labels, found.times
        audited, differing = audited + len(rows), differing + differ
        wrong += differ / len(rows) * int(np.count_nonzero(group)) / len(flat)
    again = replace(basins, labels=labels, settling_time=times)
    return again, {"audited": audited, "differing": differing, "wrong": wrong}


def _some(rows: Ints) -> Ints:
    return rows if len(rows) <= AUDITED // 2 else np.sort(np.random.default_rng(1).choice(rows, AUDITED // 2, False))


def _beside_others(basins: Basins) -> Bools:
    """Tell which initial conditions have a neighbour along an axis of the grid with another label."""
    labels, found = basins.labels, np.zeros(basins.labels.shape, bool)
    for axis in range(labels.ndim if basins.grid is not None else 0):
        differ = np.diff(labels, axis=axis) != 0
        for side in (slice(None, -1), slice(1, None)):
            found[(slice(None),) * axis + (side,)] |= differ
    return found
