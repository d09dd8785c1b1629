"""Continuation of attractors and basin fractions in a parameter, with persistent labels."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Floats, thinned
from .._lib.checks import claim_memory, finite_number, known_parameter, monotone_values, whole_number
from .._lib.records import Keyed
from .._lib.signatures import checked
from .._lib.threads import progress_bar
from ..attractors.continued import continue_attractors
from ..attractors.matching import persistent_labels
from ..attractors.regions.extents import region_extent
from ..attractors.search import MAX_PERIODS, affordable_period, find_attractors
from ..attractors.settling.labels import LABEL_NAMES
from ..attractors.settling.residence import is_same
from ..maps.coordinates import wrap
from ..maps.grid import CellGrid
from ..maps.orbit_batch import Cost
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor, Kind
from .continuation_maps import MapsOverValues
from .continuation_record import BasinContinuation, ContinuationInterrupt
from .continuation_states import LabelsOverValues
from .finding import find_basins
from .initial_conditions import InitialConditions
from .label_store import basins_memory

_SEEDS = 4  # points of a former attractor from which it is sought again, and as many beside them
_ASIDE = 1e-3  # distance of the points beside, in extents: the attractor may have lost its stability
_KEPT = 1024  # points that are kept of a chaotic attractor


@checked
def continue_basins(
    point_map: PointMap,
    parameter: str,
    values: ArrayLike,
    initial_conditions: CellGrid | ArrayLike,
    max_periods: int = MAX_PERIODS,
    longest_period: int = 32,
    threshold: float = 0.1,
    resume: BasinContinuation | None = None,
    progress: bool = False,
) -> BasinContinuation:
    """Continue attractors and their basin fractions over values of a parameter.

    At each parameter value attractors are searched from the points of those at previous values, so that attractors with
    small basins are not lost, and from all initial conditions as in :func:`find_basins`.  An attractor takes the label
    of the one that it matches, first at the previous value, then among those that have vanished and are not unlike it
    (see `threshold`); an attractor without a match is new.

    Parameters
    ----------
    point_map : PointMap
        Exact, interpolated or discrete map; an interpolated map is computed again at each value.
    parameter : str
        Name of the parameter.
    values : array_like, shape (n,)
        Parameter values, increasing or decreasing, in the unit of the parameter.  They are taken in this order.
    initial_conditions : CellGrid or array_like, shape (..., dimension)
        Grid of cells whose centres are the initial conditions, or the initial conditions themselves, such as a random
        sample.
    max_periods : int, optional
        Periods after which an initial condition whose orbit has not settled is undecided.
    longest_period : int, optional
        Longest period of a periodic attractor.
    threshold : float, optional
        Largest distance between matching attractors at consecutive values: the mean distance of points of one to the
        nearest of the other, in periods of angles and in spans of the initial conditions along other coordinates. The
        distance is doubled between unlike attractors: those of different rotation numbers, or of periods of which none
        divides the other.
    resume : BasinContinuation, optional
        A previous result for the first of the values, from the same map and initial conditions; only the others are
        computed.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.

    Returns
    -------
    BasinContinuation
        Attractors, counts and fractions with standard errors.  It can be pickled.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, or a result to resume that does not fit.
    MemoryError
        If the labels do not fit into memory.
    ContinuationInterrupt
        After Ctrl-C, a KeyboardInterrupt that holds the values computed so far.

    Warns
    -----
    ToleranceWarning
        If the integrator missed its tolerance along some orbits.

    References
    ----------
    Datseris, Rossi, Wagemakers, Chaos 33 (2023) 073151.

    Examples
    --------
    >>> from math import tanh
    >>> from cellmap import discrete_map
    >>> wells = discrete_map(lambda x, p: (tanh(p.a * x[0]),), {"a": 1.0}, ("x",), "wells")
    >>> sweep = continue_basins(wells, "a", [0.5, 0.9, 1.5, 2.0], CellGrid((-1,), (1,), (100,)))
    >>> sweep
    BasinContinuation(wells, a from 0.5 to 2: 4 values, 3 attractors)
    >>> sweep.fractions
    array([[1. , 0. , 0. ],
           [1. , 0. , 0. ],
           [0. , 0.5, 0.5],
           [0. , 0.5, 0.5]])
    """
    known_parameter("parameter", parameter, point_map.params)
    axis = monotone_values("values", values)
    places = InitialConditions.of(initial_conditions, point_map)
    given = cast("CellGrid | Floats", places.given if places.grid is None else places.grid)
    total = len(places)
    settings = {
        "max_periods": whole_number("max_periods", max_periods, at_least=1),
        "longest_period": affordable_period(longest_period),
        "threshold": finite_number("threshold", threshold, above=0.0),
        "map": dict(point_map.recipe),
    }
    maps = MapsOverValues(point_map, parameter, axis)
    kept = 8 * _KEPT * point_map.dimension * axis.size
    claim_memory(
        f"basins of {total:,} initial conditions at {axis.size:,} values",
        basins_memory(total) + kept,
        "take fewer initial conditions",
    )
    extent = region_extent(point_map, _corners(given))
    began = time.perf_counter()
    done = _Done() if resume is None else _resumed(resume, point_map, parameter, axis, given, settings)

    def result() -> BasinContinuation:
        return done.result(point_map, parameter, axis, given, settings, time.perf_counter() - began)

    label = f"basins of {point_map.name} against {parameter}" if progress else None
    labels = LabelsOverValues(maps, axis, places)
    with progress_bar(axis.size - len(done.attractors), label) as tick:
        for number in range(len(done.attractors), axis.size):
            try:
                done.add(_step(maps.at(number), labels, given, settings, done, extent))
            except KeyboardInterrupt as interrupt:
                raise ContinuationInterrupt(result()) from interrupt
            tick(1)
    return result()


@dataclass(eq=False)
class _Done:
    """Results at the values that are done."""

    attractors: list[dict[int, Attractor]] = field(default_factory=list)
    counts: list[dict[int, int]] = field(default_factory=list)
    inaccurate: list[int] = field(default_factory=list)
    audited: list[tuple[int, int]] = field(default_factory=list)
    steps: int = 0
    seconds: float = 0.0

    def add(self, value: _Value) -> None:
        self.attractors.append(value.attractors)
        self.counts.append(value.counts)
        self.inaccurate.append(value.inaccurate)
        self.audited.append(value.audited)
        self.steps += value.steps

    def memory(self) -> dict[int, Attractor]:
        """Return each attractor as it was seen last."""
        return {label: a for found in self.attractors for label, a in found.items()}

    def result(
        self,
        point_map: PointMap,
        name: str,
        axis: Floats,
        initial_conditions: CellGrid | Floats,
        settings: Mapping[str, Any],
        seconds: float,
    ) -> BasinContinuation:
        codes = [code for code in LABEL_NAMES if any(code in counts for counts in self.counts)]
        labels = (*sorted(self.memory()), *codes)
        return BasinContinuation(
            system=point_map.name,
            parameter=name,
            values=axis[: len(self.attractors)].copy(),
            labels=labels,
            counts=np.array([[c.get(k, 0) for k in labels] for c in self.counts], np.int64).reshape(
                len(self.counts), len(labels)
            ),
            attractors=tuple(Keyed(found, "attractors") for found in self.attractors),
            inaccurate=np.array(self.inaccurate, np.int64),
            initial_conditions=initial_conditions,
            coordinates=point_map.coordinates,
            params=Keyed({key: v for key, v in point_map.params.items() if key != name}, "params"),
            settings=settings,
            cost=Cost(seconds=self.seconds + seconds, steps=self.steps),
            audited=np.array(self.audited, np.int64).reshape(-1, 2),
            parameter_units=point_map.parameter_units,
        )


class _Value(NamedTuple):
    """Results at one value: attractors and counts by label, and what :class:`BasinContinuation` has of labels."""

    attractors: dict[int, Attractor]
    counts: dict[int, int]
    inaccurate: int
    audited: tuple[int, int]
    steps: int


def _step(
    point_map: PointMap,
    over_values: LabelsOverValues,
    initial_conditions: CellGrid | Floats,
    settings: Mapping[str, Any],
    done: _Done,
    extent: Floats,
) -> _Value:
    """Return the attractors and fractions at the next value."""
    limits = settings["max_periods"], settings["longest_period"]
    memory = done.memory()
    known: tuple[Attractor, ...] = ()
    if memory:
        known = continue_attractors(point_map, tuple(done.attractors[-1].values()), extent)
        seeds = np.concatenate([_seeds(memory, extent), _outermost(initial_conditions)])
        known = find_attractors(point_map, seeds, *limits, attractors=known)
    quick = over_values.at(len(done.attractors), point_map, known, lambda k: [*done.attractors[k].values()], limits[0])
    audited = (0, 0) if quick is None else (quick.audited, quick.differing)
    if quick is None or quick.differing:
        basins = find_basins(point_map, initial_conditions, *limits, attractors=known)
        found = [*basins.attractors, *(a for a in known if not any(is_same(a, b) for b in basins.attractors))]
        numbers, inaccurate = {k: f.count for k, f in basins.fractions.items()}, basins.inaccurate
        steps = basins.cost.steps
    else:
        found, inaccurate, steps = list(known), 0, quick.tally.steps
        numbers = dict(enumerate(np.bincount(quick.labels, minlength=len(known)).tolist()))
    before = done.attractors[-1] if done.attractors else {}
    labels = persistent_labels(found, before, memory, extent, settings["threshold"])
    counts = {labels[k] if k >= 0 else k: count for k, count in numbers.items()}
    return _Value({labels[k]: _light(a) for k, a in enumerate(found)}, counts, inaccurate, audited, steps)


def _seeds(memory: Mapping[int, Attractor], extent: Floats) -> Floats:
    """Return points on and beside attractors as they were seen last."""
    rng = np.random.default_rng(0)
    on = np.concatenate([thinned(a.points, _SEEDS) for a in memory.values()])
    beside = on + _ASIDE * extent * rng.standard_normal(on.shape)
    return np.concatenate([on, wrap(beside, next(iter(memory.values())).coordinates)])


def _light(attractor: Attractor) -> Attractor:
    """Return an attractor with no more points than are needed to find it again."""
    if attractor.kind not in (Kind.CHAOTIC, Kind.QUASIPERIODIC):
        return attractor
    return replace(attractor, points=thinned(attractor.points, _KEPT), cover=None)


def _corners(initial_conditions: CellGrid | Floats) -> Floats:
    if isinstance(initial_conditions, CellGrid):
        return np.array([initial_conditions.lower, initial_conditions.upper])
    return initial_conditions.reshape(-1, initial_conditions.shape[-1])


def _outermost(initial_conditions: CellGrid | Floats) -> Floats:
    """Return some initial conditions of the same extent as all: from points the search takes the size of its region."""
    if isinstance(initial_conditions, CellGrid):
        return initial_conditions.places(
            np.array([np.full(initial_conditions.dimension, 0.5), np.array(initial_conditions.shape) - 0.5])
        )
    flat = _corners(initial_conditions)
    return flat[np.unique([flat.argmin(axis=0), flat.argmax(axis=0)])]


def _resumed(
    resume: BasinContinuation,
    point_map: PointMap,
    name: str,
    axis: Floats,
    initial_conditions: CellGrid | Floats,
    settings: Mapping[str, Any],
) -> _Done:
    """Take up a former result, after a look at whether it fits."""
    if not isinstance(resume, BasinContinuation):
        raise TypeError(f"resume={resume!r}: give a BasinContinuation, such as the `partial` of an interrupt")
    others = {key: value for key, value in point_map.params.items() if key != name}
    same_initial_conditions = type(initial_conditions) is type(resume.initial_conditions) and (
        initial_conditions == resume.initial_conditions
        if isinstance(initial_conditions, CellGrid)
        else np.array_equal(initial_conditions, np.asarray(resume.initial_conditions))
    )
    for what, fits in (
        ("system", (resume.system, resume.coordinates) == (point_map.name, point_map.coordinates)),
        ("parameters", resume.parameter == name and resume.params == others),
        ("initial_conditions", same_initial_conditions),
        ("settings", resume.settings == settings),
        ("values", np.array_equal(resume.values, axis[: len(resume.values)])),
    ):
        if not fits:
            raise ValueError(f"resume={resume!r} has other {what}: resume with those that it was made with")
    counts = [
        {k: int(c) for k, c, there in zip(resume.labels, row, now, strict=True) if there}
        for row, now in zip(resume.counts, resume.present, strict=True)
    ]
    attractors = [dict(found) for found in resume.attractors]
    audited = [(0, 0)] * len(attractors) if resume.audited is None else list(map(tuple, resume.audited.tolist()))
    return _Done(attractors, counts, resume.inaccurate.tolist(), audited, resume.cost.steps, resume.cost.seconds)
