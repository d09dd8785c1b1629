"""Iteration of initial conditions until each orbit has converged to an attractor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._compiled.kernels import labelling
from ..._compiled.kernels.capture import LOOKED_AT, Covers, Regions, Sieve, ellipsoids_of
from ..._compiled.kernels.labelling import POOL, LabelledOrbits, Limits, PoolRows, Scratch
from ..._lib.arrays import Floats, Ints
from ..._lib.computed import computed_once
from ..._lib.stopping import Stop
from ..._lib.threads import results_of, run_over, slices
from ...maps.compiled_advance import UNKNOWN_STEP, CompiledAdvance
from ...maps.coordinates import shortest, turns_of, wrap
from ...maps.orbit_batch import CHUNK, NOTHING, PERIODS_AT_ONCE, Orbits, Status, Tally, Work
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, Cover
from ..regions.boxes import RESIDENCE, box_keys, boxes_around, full_residence
from ..regions.sieves import sieve_of
from .escape import beyond, escape
from .labels import LABELS_OF, Label, label_type
from .quotients import Quotient, quotient_by

_PART = 128  # orbits of a thread at a time, where few are followed
_OLDER = 1.25  # times as old orbits are when it is looked again which of them have escaped
_UNSEEN = 64  # most periods at a time where nothing can capture an orbit

Rule = Callable[[Floats], Ints]
"""Tells of points (n, d) the number of the final state in which each is, -1 while it is in none."""


@dataclass(frozen=True, eq=False)
class Catalogue:
    """Known attractors, in the form in which orbits are tested against them.

    Attractors with a continuous symmetry are tested in the ``quotient``, to which regions and boxes belong then.
    """

    attractors: tuple[Attractor, ...]
    regions: Regions
    covers: tuple[tuple[int, Cover, Ints], ...]
    boxes: Covers
    turn: Floats
    quotient: Quotient | None = None

    @classmethod
    def of(cls, attractors: Sequence[Attractor], point_map: PointMap) -> Catalogue:
        """Collect the neighbourhoods and covers of attractors."""
        if (quotient := quotient_by(point_map, attractors)) is not None:
            inner = cls.of([quotient.lowered(a) for a in attractors], quotient.point_map)
            return replace(inner, attractors=tuple(attractors), quotient=quotient)
        d, turn = point_map.dimension, turns_of(point_map.coordinates)[1]
        regions = [(k, a.neighbourhood) for k, a in enumerate(attractors) if a.neighbourhood is not None]
        covers = tuple(
            (k, a.cover, box_keys(a.cover.boxes, a.cover.corners))
            for k, a in enumerate(attractors)
            if a.cover is not None
        )
        return cls(
            tuple(attractors),
            Regions(
                np.concatenate([np.empty((0, d)), *(n.centres for _, n in regions)]),
                np.concatenate([np.empty((0, d, d)), *(n.metrics for _, n in regions)]),
                np.array([k for k, n in regions for _ in n.centres], np.int64),
                np.array([0 if a.neighbourhood is None or a.verified else RESIDENCE for a in attractors], np.int64),
            ),
            covers,
            _boxes(covers, [full_residence(a) for a in attractors], turn),
            turn,
        )

    def owners_of(self, points: Floats) -> Ints:
        """Return the number of the attractor in whose neighbourhood each point is, -1 for none."""
        points = points if self.quotient is None else self.quotient.projected(points)
        found, scratch = np.empty(len(points), np.int64), _scratch(points.shape[1])
        for part in slices(len(points), LOOKED_AT):
            some = found[part]
            ellipsoids_of(points, part.start, len(some), self.regions, self.turn, *scratch[:2], some)
        return found

    def distances_of(self, points: Floats) -> Floats:
        """Return the distance to the nearest attractor, in radii of its neighbourhood; inf where there is none."""
        if not len(self.regions.owners):
            return np.full(len(points), np.inf)
        points = points if self.quotient is None else self.quotient.projected(points)
        shift = shortest(points[:, None, :] - self.regions.centres, self.turn)
        return np.asarray(np.sqrt(np.einsum("nmi,mij,nmj->nm", shift, self.regions.metrics, shift)).min(axis=1))

    @computed_once
    def sieve(self) -> Sieve:
        """Which ellipsoids may hold a point, by its coordinates; without words where they are few."""
        return sieve_of(self.regions, self.turn)

    @computed_once
    def within(self) -> Catalogue:
        """The catalogue in the quotient."""
        return replace(self, quotient=None)

    def shrunk(self, factor: float) -> Catalogue:
        """Return the catalogue with smaller trapping regions; those that are not verified hold the attractors."""
        fixed = (self.regions.residence > 0)[self.regions.owners]
        metrics = np.where(fixed[:, None, None], 1.0, factor**-2) * self.regions.metrics
        return replace(self, regions=self.regions._replace(metrics=metrics))


def _boxes(covers: Sequence[tuple[int, Cover, Ints]], residence: Sequence[int], turn: Floats) -> Covers:
    """Return covers one behind the other in arrays."""
    d = len(turn)
    corners = np.array([cover.corners for _, cover, _ in covers], np.int64).reshape(-1, 2, d)
    sure = [c.certain if c.trapped is None else c.trapped for _, c, _ in covers]
    certain = [np.zeros(len(keys), bool) if s is None else s for s, (*_, keys) in zip(sure, covers, strict=True)]
    return Covers(
        owners=np.array([k for k, _, _ in covers], np.int64),
        corner=np.array([cover.lower for _, cover, _ in covers], float).reshape(-1, d),
        widths=np.array([cover.widths for _, cover, _ in covers], float).reshape(-1, d),
        around=np.array([boxes_around(cover.widths, turn) for _, cover, _ in covers], np.int64).reshape(-1, d),
        low=corners[:, 0].copy(),
        shape=corners[:, 1] - corners[:, 0] + 1,
        begin=np.cumsum([0, *(len(keys) for _, _, keys in covers)], dtype=np.int64),
        keys=np.concatenate([np.empty(0, np.int64), *(keys for _, _, keys in covers)]),
        resting=np.array([cover.certain is not None for _, cover, _ in covers], bool),
        certain=np.concatenate([np.empty(0, bool), *certain]),
        residence=np.array([cover.residence or residence[k] for k, cover, _ in covers], np.int64),
    )


@dataclass(frozen=True, eq=False)
class Classified:
    """Labels and settling times of a batch of initial conditions.

    ``labels`` (n,): number of the attractor, or a :class:`Label`; ``times`` (n,): period in which the orbit was first
    inside a trapping region of its attractor, -1 without one; ``tally``: the work done.
    """

    labels: NDArray[Any]
    times: NDArray[np.int32]
    tally: Tally


@dataclass(frozen=True, eq=False)
class Settled(Classified):
    """The same with the last states of the undecided, ``orbits``."""

    orbits: Orbits

    @property
    def undecided(self) -> Ints:
        """Rows of the undecided initial conditions."""
        return np.flatnonzero(self.labels == Label.UNDECIDED)


def settle(
    point_map: PointMap,
    orbits: Orbits,
    catalogue: Catalogue,
    periods: int,
    age: int = 0,
    stop: Stop | None = None,
    bound: Floats | None = None,
) -> Settled:
    """Iterate orbits that are `age` periods old until each is captured, has ended, or `periods` more have passed.

    Where some are known to escape beyond a `bound`, those that do have diverged; that is seen when they are older by
    a quarter than when they were looked at before, or where they go so fast there that they are out of steps.

    Raises
    ------
    Stopped
        Soon after that was requested.
    """
    if bound is not None:
        return _settled_within(bound, point_map, orbits, catalogue, periods, age, stop)
    if (quotient := catalogue.quotient) is not None:
        settled = settle(quotient.point_map, quotient.of_orbits(orbits), catalogue.within, periods, age, stop)
        return replace(settled, orbits=quotient.back(settled.orbits))
    max_step = point_map.max_step
    if not len(catalogue.regions.owners) and not catalogue.covers:
        return _labelled(point_map, orbits, catalogue, periods, age, _UNSEEN, stop=stop)[0]
    # A cover is entered and left again; only trapping neighbourhoods can be tested once in several periods.
    if max_step == 1 or max_step > periods or catalogue.covers:
        return _labelled(point_map, orbits, catalogue, periods, age, 1, stop=stop)[0]
    found, since, before = _labelled(point_map, orbits, catalogue, periods, age, max_step, stop=stop)
    # The last multi-period step again, by single periods, for the period in which the orbit converged.
    rows = np.flatnonzero((since >= 0) & (found.labels != Label.UNDECIDED))
    again = _labelled(point_map, Orbits.starting(before[rows]), catalogue, max_step, 0, 1, stop=stop)[0]
    told = again.labels != Label.UNDECIDED
    rows = rows[told]
    found.labels[rows] = again.labels[told]
    found.times[rows] = np.where(again.times[told] >= 0, since[rows] + again.times[told], -1)
    return replace(found, tally=found.tally.plus(again.tally._replace(inaccurate=0)))


def _settled_within(
    bound: Floats,
    point_map: PointMap,
    orbits: Orbits,
    catalogue: Catalogue,
    periods: int,
    age: int,
    stop: Stop | None,
) -> Settled:
    # Where orbits have to stay, they do for longer than from look to look.
    parts = list[Settled]()
    if catalogue.covers or catalogue.regions.residence.any():
        if age == 0:
            ahead = replace(orbits, points=orbits.points.copy(), rotations=orbits.rotations.copy(), work=Work())
            nothing = Catalogue.of((), point_map)
            parts.append(_settled_within(bound, point_map, ahead, nothing, min(periods, _UNSEEN), 0, stop))
            orbits = orbits[parts[0].labels == Label.UNDECIDED]
        found, _, before = _labelled(point_map, orbits, catalogue, periods, age, 1, stop=stop)
        found.labels[(found.labels == Label.OUT_OF_STEPS) & beyond(before, bound)] = Label.DIVERGED
        parts.append(found)
    else:
        end, now = age + periods, age
        while not parts or (len(orbits) and now < end):
            until = min(max(now + 1, int(_OLDER * now)), end)
            settled = settle(point_map, orbits, catalogue, until - now, now, stop)
            parts.append(without_escaped(point_map, settled, bound, until))
            orbits, now = parts[-1].orbits, until
    labels, times = parts[0].labels.astype(parts[-1].labels.dtype), parts[0].times.copy()
    for later in parts[1:]:
        rows = np.flatnonzero(labels == Label.UNDECIDED)
        labels[rows], times[rows] = later.labels, later.times
    tally = Tally(*np.sum([p.tally for p in parts], axis=0).tolist())
    return Settled(labels, times, tally, parts[-1].orbits)


def without_escaped(point_map: PointMap, settled: Settled, bound: Floats, age: int) -> Settled:
    """Return what has become of orbits of an age where those that escape beyond a bound have diverged."""
    gone = beyond(settled.orbits.points, bound)
    if not gone.any() or not escape(point_map, settled.orbits.points[gone], bound, age):
        return settled
    labels, left = settled.labels.copy(), settled.orbits
    labels[settled.undecided[gone]] = Label.DIVERGED
    tally = settled.tally.plus(Tally(inaccurate=int(np.count_nonzero(left.status[gone] == Status.INACCURATE))))
    return replace(settled, labels=labels, orbits=left[np.flatnonzero(~gone)], tally=tally)


def settle_on_threads(
    point_map: PointMap,
    orbits: Orbits,
    catalogue: Catalogue,
    periods: int,
    age: int = 0,
    stop: Stop | None = None,
    bound: Floats | None = None,
) -> Settled:
    """Settle orbits as :func:`settle` does, on all threads where they are integrated."""
    parts = slices(len(orbits), _PART)
    if not point_map.is_flow or point_map.table is not None or len(parts) < 2:
        return settle(point_map, orbits, catalogue, periods, age, stop, bound)

    def work(number: int) -> Settled:
        part = replace(orbits[parts[number]], work=Work())
        return settle(point_map, part, catalogue, periods, age, stop, bound)

    found = dict(results_of(range(len(parts)), work))
    settled = [found[number] for number in range(len(parts))]
    return Settled(
        np.concatenate([s.labels for s in settled]),
        np.concatenate([s.times for s in settled]),
        Tally(*np.sum([s.tally for s in settled], axis=0).tolist()),
        Orbits.joined([s.orbits for s in settled]),
    )


def classify(
    point_map: PointMap,
    catalogue: Catalogue,
    points: Floats,
    periods: int,
    rule: Rule | None = None,
    size: int = CHUNK,
    progress: str | None = None,
    at_last: Callable[[Settled], Settled] | None = None,
) -> Classified:
    """Label points (n, d) on all threads, as many as `size` at a time; angles need not be wrapped.

    With a rule an orbit is in a final state as soon as the rule says so, and no attractors are needed.  ``at_last`` may
    decide orbits that are left in another way.
    """
    parts = slices(len(points), size)
    labels: NDArray[Any] = np.empty(len(points), label_type(len(catalogue.attractors)) if rule is None else np.int64)
    times = np.empty(len(points), np.int32)
    tallies = np.zeros((len(parts), len(NOTHING)), np.int64)

    def work(number: int) -> None:
        part = parts[number]
        orbits = Orbits.starting(wrap(points[part], point_map.coordinates))
        if rule is None:
            settled = settle(point_map, orbits, catalogue, periods)
            settled = settled if at_last is None else at_last(settled)
        else:
            settled, *_ = _labelled(point_map, orbits, catalogue, periods, 0, 1, rule)
        labels[part], times[part], tallies[number] = settled.labels, settled.times, settled.tally

    run_over(range(len(parts)), work, progress)
    return Classified(labels, times, Tally(*tallies.sum(axis=0).tolist()))


def _labelled(
    point_map: PointMap,
    orbits: Orbits,
    catalogue: Catalogue,
    periods: int,
    age: int,
    stride: int,
    rule: Rule | None = None,
    stop: Stop | None = None,
) -> tuple[Settled, Ints, Floats]:
    """Label orbits, looking at them after every `stride` periods; also return the last look before, and points there.

    What the compiled loop cannot call it asks for.
    """
    advance = point_map.advance
    compiled = advance if isinstance(advance, CompiledAdvance) and rule is None else None
    step = UNKNOWN_STEP._replace(turn=catalogue.turn) if compiled is None else compiled.step
    n, d = orbits.points.shape
    work, past = orbits.work, replace(orbits.work)
    outcome = LabelledOrbits(
        orbits.points,
        orbits.rotations,
        orbits.status,
        labels=np.full(n, Label.UNDECIDED, np.int64),
        times=np.full(n, -1, np.int32),
        since=np.full(n, -1),
        before=np.full((n, d), np.nan),
        residence=np.zeros((len(catalogue.covers), n), np.int64),
        visits=np.full((3, n if catalogue.regions.residence.any() else 0), -1),
        told=np.full(0 if rule is None else n, -1),
        labels_of=LABELS_OF,
    )
    size = min(n, POOL) if step.table.function else n
    pool, waiting, scratch = _rows(size, d), _rows(size if step.table.function else 0, d), _scratch(d, size)
    counts = np.zeros(labelling.COUNTS, np.int64)
    limits = Limits(age, age + periods, stride, PERIODS_AT_ONCE)
    if rule is not None:
        _tell(rule, outcome, np.arange(n), orbits)
    places = labelling.LabellingWorkspace(pool, waiting, scratch, counts)
    while True:
        reason = labelling.label(step, catalogue.regions, catalogue.sieve, catalogue.boxes, limits, outcome, places)
        if reason == labelling.FINISHED:
            break
        if stop is not None:
            stop.check()
        if reason == labelling.ASKS_FOR_POOL:
            now = _orbits(pool, counts[labelling.ACTIVE], orbits)
            advance(now, int(scratch.made[0]))
            if rule is not None:
                _tell(rule, outcome, pool.member[: len(now)], now)
        elif reason == labelling.ASKS_FOR_WAITING:
            assert point_map.exact is not None
            point_map.exact.advance(_orbits(waiting, counts[labelling.WAITING], orbits), 1)
    if compiled is not None:
        work.evaluations += int(counts[labelling.APPLIED]) * compiled.stages
    work.look_ups += int(counts[labelling.LOOK_UPS])
    made = work.evaluations - past.evaluations, work.look_ups - past.look_ups
    undecided = outcome.labels == Label.UNDECIDED
    missed = int(np.count_nonzero((outcome.status == Status.INACCURATE) & ~undecided))
    tally = Tally(int(counts[labelling.PERIODS]), missed, *made)
    left = np.flatnonzero(undecided)
    labels: NDArray[Any] = outcome.labels
    if rule is None:
        labels = labels.astype(label_type(len(catalogue.attractors)))
    return Settled(labels, outcome.times, tally, orbits[left]), outcome.since, outcome.before


def _rows(size: int, dimension: int) -> PoolRows:
    whole = [np.empty(size, np.int64) for _ in range(3)]
    state = np.empty((size, dimension)), np.empty((size, dimension), np.int64), np.empty(size, np.uint8)
    return PoolRows(*state, *whole)


def _scratch(dimension: int, rows: int = 0) -> Scratch:
    whole = [np.zeros(size, np.int64) for size in (LOOKED_AT, rows, 1)]
    return Scratch(np.empty((2 * dimension, LOOKED_AT)), np.empty(LOOKED_AT), *whole)


def _orbits(rows: PoolRows, count: int, like: Orbits) -> Orbits:
    """Return rows as a batch of orbits, whose work counts as that of others."""
    return Orbits(rows.points[:count], rows.rotations[:count], rows.status[:count], like.work)


def _tell(rule: Rule, outcome: LabelledOrbits, members: Ints, orbits: Orbits) -> None:
    """Write which orbits are in a final state by a rule, which sees those that have a point."""
    alive = np.flatnonzero(orbits.alive)
    outcome.told[members[alive]] = rule(orbits.points[alive])
