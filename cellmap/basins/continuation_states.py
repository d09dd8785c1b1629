"""Labels from states after some periods that are interpolated over a parameter, and their audit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Bools, Floats, Ints
from .._lib.checks import claim_memory
from .._lib.threads import run_over, slices
from ..attractors.settling.settle import Catalogue, settle
from ..maps.coordinates import turns_of
from ..maps.interpolation.over_parameter import CHECKED, Chebyshev, ParameterTable, combined, errors_over_parameter
from ..maps.orbit_batch import NOTHING, Orbits, Status, Tally
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor
from .continuation_maps import MapsOverValues, TabulatedRange
from .initial_conditions import InitialConditions

AUDITED = 64
"""One of so many initial conditions is labelled from its beginning at each value, all of them in so many values."""

PERIODS = (2, 4, 8, 12, 16)
"""Periods after which states are interpolated, at most."""

_NODES = 9  # Chebyshev nodes
_IN_A_TILE = 8192  # initial conditions in a tile
_SAMPLE = 1024  # orbits sampled to choose the number of periods ahead, and the length of the interval of the parameter
_OVERHEAD = 3.0  # look-ups that take as long as interpolating a state
_WORTH_IT = 0.7  # part of the look-ups from the beginning to which interpolation has to reduce them
_PATIENCE = 256  # periods after which a label is left to a search for further attractors


@dataclass(frozen=True, eq=False)
class StatesOverParameter:
    """States of initial conditions after some periods, for values of a parameter in an interval.

    For a fixed number of periods the state is a smooth function of the parameter, whatever becomes of the attractors.
    Each initial condition has as many periods as leave the error, which is measured between the nodes, below the one
    that the map's table is allowed over the parameter; 0 periods where none do.

    ``states`` (nodes, n, d) unwrapped, ``periods`` (n,), ``tally``: the work.
    """

    nodes: Chebyshev
    states: Floats
    periods: NDArray[np.int16]
    tally: Tally

    def at(self, value: float, part: slice) -> Floats:
        """Return some states at a value, unwrapped."""
        return combined(self.nodes.factors(value), self.states[:, part], np.empty(self.states[0, part].shape))


@dataclass(frozen=True, eq=False)
class _Nodes:
    """Maps at the nodes and where errors are measured."""

    nodes: Chebyshev
    maps: list[PointMap]
    values: Floats
    allowed: Floats

    @classmethod
    def of(cls, table: ParameterTable, interval: tuple[float, float]) -> _Nodes:
        nodes = Chebyshev(*interval, _NODES)
        values = nodes.placed(CHECKED)
        maps = [table.at(value) for value in (*nodes.nodes.tolist(), *values.tolist())]
        return cls(nodes, maps, values, errors_over_parameter(table.spec))

    def ahead(self, batches: Sequence[Orbits], steps: Sequence[int]) -> Iterator[tuple[int, Floats, Bools]]:
        """Move orbits on that begin together, a batch for each map.

        Yield the states (nodes, n, d) after each number of periods, and which of them may be interpolated.
        """
        turn, scales = turns_of(self.maps[0].coordinates)[1], self.nodes.scales(self.values)
        for begin, end in pairwise((0, *steps)):
            for orbits, point_map in zip(batches, self.maps, strict=True):
                point_map.advance(orbits, end - begin)
            states = np.array([orbits.points + orbits.rotations * turn for orbits in batches])
            sure = np.all([orbits.status == Status.OK for orbits in batches], axis=0)
            for value, scale, exact in zip(self.values.tolist(), scales, states[_NODES:], strict=True):
                missed = combined(self.nodes.factors(value), states[:_NODES], np.empty_like(exact)) - exact
                with np.errstate(invalid="ignore"):
                    sure &= (scale * np.abs(missed) <= self.allowed).all(axis=-1)
            yield end, states[:_NODES], sure


@dataclass(frozen=True, eq=False)
class InterpolationPlan:
    """How states are interpolated for values of a parameter: for so many at a time, so many periods ahead."""

    values: int
    steps: tuple[int, ...]
    nodes: _Nodes  # of the first of them


def plan_of(
    table: ParameterTable, values: Floats, initial_conditions: InitialConditions, attractors: Sequence[Attractor]
) -> InterpolationPlan | None:
    """Choose how states are interpolated from what a sample costs, None where it is not worthwhile.

    ``attractors`` are those at the first of the values.
    """
    total, few = len(initial_conditions), np.random.default_rng(0)
    first = table.at(float(values[0]))
    rows = np.arange(total) if total <= _SAMPLE else np.sort(few.choice(total, _SAMPLE, replace=False))
    points = initial_conditions.wrapped(rows, first)
    settled = settle(first, Orbits.starting(points.copy()), Catalogue.of(attractors, first), _PATIENCE)
    if (settled.labels < 0).any():
        return None
    lasts = np.where(settled.times >= 0, settled.times, _PATIENCE)
    best, least, number = None, _WORTH_IT * float(lasts.mean()), len(values)
    while best is None and number > 2 * _NODES:
        ends = float(values[[0, number - 1]].min()), float(values[[0, number - 1]].max())
        ahead = np.zeros(len(rows), int)
        nodes = _Nodes.of(table, ends)
        batches = [Orbits.starting(points.copy()) for _ in nodes.maps]
        for end, _, sure in nodes.ahead(batches, PERIODS):
            ahead[sure] = end
            made = (_NODES + len(CHECKED)) * end / number
            looked_up = float(np.maximum(lasts - ahead, 0).mean()) + _OVERHEAD + made
            if looked_up < least:
                best, least = InterpolationPlan(number, tuple(p for p in PERIODS if p <= end), nodes), looked_up
        number = -(-number // 2)
    return best


def states_over(
    table: ParameterTable, interval: tuple[float, float], initial_conditions: InitialConditions, plan: InterpolationPlan
) -> StatesOverParameter:
    """Return states of all initial conditions over an interval of the parameter."""
    known = (plan.nodes.nodes.low, plan.nodes.nodes.high) == interval
    nodes, total = plan.nodes if known else _Nodes.of(table, interval), len(initial_conditions)
    d = nodes.maps[0].dimension
    claim_memory(f"states of {total:,} initial conditions", states_memory(total, d), "take fewer initial conditions")
    states, periods = np.empty((_NODES, total, d)), np.zeros(total, np.int16)
    parts = slices(total, _IN_A_TILE)
    tallies = np.zeros((len(parts), len(NOTHING)), np.int64)

    def work(number: int) -> None:
        part = parts[number]
        points = initial_conditions.wrapped(part, nodes.maps[0])
        mine, reached = states[:, part], periods[part]
        mine[:] = points
        batches = [Orbits.starting(points.copy()) for _ in nodes.maps]
        for end, now, sure in nodes.ahead(batches, plan.steps):
            mine[:, sure], reached[sure] = now[:, sure], end
        looked_up, evaluations = (sum(getattr(b.work, name) for b in batches) for name in ("look_ups", "evaluations"))
        tallies[number] = Tally(len(points) * len(batches) * plan.steps[-1], 0, evaluations, looked_up)

    run_over(range(len(parts)), work)
    return StatesOverParameter(nodes.nodes, states, periods, Tally(*tallies.sum(axis=0).tolist()))


def states_memory(total: int, dimension: int) -> int:
    """Return the bytes that states over a parameter take."""
    return (8 * _NODES * dimension + 2) * total


@dataclass(frozen=True, eq=False)
class Labels:
    """Labels (n,) of initial conditions; how many were audited and of these differ; the work."""

    labels: NDArray[np.int16]
    audited: int
    differing: int
    tally: Tally


class LabelsOverValues:
    """Labels of initial conditions at values of a parameter, from states over it where these serve."""

    def __init__(self, maps: MapsOverValues, values: Floats, initial_conditions: InitialConditions) -> None:
        self._maps, self._values, self._places = maps, values, initial_conditions
        self._plans: dict[int, InterpolationPlan | None] = {}
        self._states: tuple[int, StatesOverParameter | None] = -1, None

    def at(
        self,
        number: int,
        point_map: PointMap,
        attractors: Sequence[Attractor],
        before: Callable[[int], Sequence[Attractor]],
        max_periods: int,
    ) -> Labels | None:
        """Return the labels at a value that is not the first of its tables, from those attractors that are known there.

        None where labels are to be found from the beginning.  ``before(number)`` returns the attractors of a value.
        """
        verified = len(attractors) > 0 and all(a.verified and a.neighbourhood is not None for a in attractors)
        window = self._maps.window(number)
        if window is None or number == window.low or not verified or max_periods < 2 * max(PERIODS):
            return None
        if window.low not in self._plans:
            values = self._values[window.low : window.high]
            self._plans[window.low] = plan_of(window.table, values, self._places, before(window.low))
        states = self._states_at(number, window)
        value = float(self._values[number])
        limit = min(_PATIENCE, max_periods - max(PERIODS))
        return (
            None if states is None else labels_from(states, value, number, point_map, self._places, attractors, limit)
        )

    def _states_at(self, number: int, window: TabulatedRange) -> StatesOverParameter | None:
        plan = self._plans[window.low]
        if plan is None:
            return None
        low = number - (number - window.low) % plan.values
        if self._states[0] != low:
            ends = self._maps.interval(low, min(low + plan.values, window.high))
            self._states = low, None  # so that the former ones need no memory
            with suppress(MemoryError):
                self._states = low, states_over(window.table, ends, self._places, plan)
        return self._states[1]


def labels_from(
    states: StatesOverParameter,
    value: float,
    number: int,
    point_map: PointMap,
    initial_conditions: InitialConditions,
    attractors: Sequence[Attractor],
    limit: int,
) -> Labels | None:
    """Label initial conditions from their states, in at most `limit` periods more, and some from the beginning.

    None where some come to none of the attractors, which are all verified: then all labels are to be found from the
    beginning, with a search for further attractors.  ``number`` says which are audited.
    """
    catalogue, total = Catalogue.of(attractors, point_map), len(initial_conditions)
    tiles: list[slice | Ints] = [*slices(total, _IN_A_TILE)]
    rows = np.arange(number % AUDITED, total, AUDITED)
    tiles += [rows[part] for part in slices(len(rows), _IN_A_TILE)]
    labels, again = np.empty(total, np.int16), np.empty(total, np.int16)
    tallies = np.zeros((len(tiles), len(NOTHING)), np.int64)

    def work(number: int) -> None:
        tile = tiles[number]
        if isinstance(tile, slice):
            orbits = Orbits.starting(states.at(value, tile))
            orbits.wrap(*turns_of(point_map.coordinates))
        else:
            orbits = Orbits.starting(initial_conditions.wrapped(tile, point_map))
        settled = settle(point_map, orbits, catalogue, limit)
        (labels if isinstance(tile, slice) else again)[tile] = settled.labels
        tallies[number] = settled.tally

    run_over(range(len(tiles)), work)
    tally = Tally(*tallies.sum(axis=0).tolist())
    if (labels < 0).any() or tally.inaccurate:
        return None
    return Labels(labels, len(rows), int(np.count_nonzero(labels[rows] != again[rows])), tally)
