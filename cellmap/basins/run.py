"""Sweeps over initial conditions, after each of which the active orbits are searched for further attractors."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Bools, Floats, Ints
from .._lib.checks import claim_memory, warn_caller
from .._lib.records import Keyed
from .._lib.stopping import Stop, Stopped, heeding
from .._lib.threads import linear_algebra_on_one_thread, slices
from .._lib.tiles import completed
from ..attractors.kinds.continua import joined_continua
from ..attractors.kinds.ends import ORBITS
from ..attractors.kinds.examined import Examined
from ..attractors.kinds.transients import ENDURANCE, MORE, REMEDIES, Late, Reason, regular
from ..attractors.search import MAX_PERIODS, Search, SearchResult
from ..attractors.settling.labels import LABEL_NAMES, Label, label_type
from ..attractors.settling.residence import OBSERVED, unobserved, with_full_residence, with_residence
from ..attractors.settling.settle import Settled
from ..maps.orbit_batch import CHUNK, NOTHING, Cost, Orbits, Status, Tally
from ..maps.point_map import PointMap, ToleranceWarning, remedy_for_missed
from ..orbits.attractor import Attractor, sort_key
from .doubts import cycles_of
from .initial_conditions import InitialConditions, Rows
from .label_store import HELD, InMemory, LabelStore, basins_memory
from .record import Basins
from .strides import StridedTile
from .sweeps import Batch, LabellingTask, Progress

_SAMPLE = 1024  # initial conditions of the first search for attractors
_IN_A_TILE = 8192, 65536  # least and most, where a tile has neither to travel nor to be sealed
_INTEGRATED = 128, 1024  # where orbits are integrated, which takes long: a part of 1/16 keeps all threads at work
_TILES = 128  # enough to keep all threads busy to the end
_PATIENCE = 256  # periods before active orbits are searched for further attractors
_REPEATS = 32  # sweeps over the same periods with ever more attractors, at most
_FURTHER = 0.5  # of the periods that all orbits have taken, that those which are left may take beyond the limit
_LOOKED_AT = 2**16  # active orbits, evenly spread, that are searched where more than HELD are active


@dataclass(eq=False)
class Run:
    """Labelling of all initial conditions in sweeps, each with the active orbits of the one before or more attractors.

    All that a sweep depends on is in its :class:`Progress`, so that a run may be resumed at any of them.

    ``order``: the tiles of the first sweep, in groups of which the ``first`` ones are labelled before
    the search for attractors, where some are known; ``now``: the present sweep, or the last; ``reasons``: why some of
    those that it leaves are undecided; ``complete``: whether nothing is left to do; ``spent``: seconds of iteration;
    ``searching``: whether attractors are searched for that are not known; ``searched``: attractors, labels and times
    of the sample where the call ended in the search.
    """

    point_map: PointMap
    initial_conditions: InitialConditions
    store: LabelStore
    max_periods: int | None
    longest_period: int
    client: Any = None
    progress: bool = False
    stop: Stop = field(default_factory=Stop)
    order: Sequence[Sequence[StridedTile]] = ()
    first: int = 1
    now: Progress | None = None
    reasons: tuple[Reason, ...] = ()
    complete: bool = False
    spent: list[float] = field(default_factory=list)
    search: Search | None = None
    searching: bool = True
    searched: SearchResult | None = None

    @property
    def limit(self) -> int:
        """Periods for which all orbits are followed that have not settled."""
        return MAX_PERIODS if self.max_periods is None else self.max_periods

    def to_the_end(self, known: Sequence[Attractor]) -> None:
        """Label all initial conditions."""
        with linear_algebra_on_one_thread(self.point_map.dimension):
            for _ in self.tiles(known):
                pass

    def tiles(self, known: Sequence[Attractor]) -> Iterator[int]:
        """Find attractors from a sample, label all initial conditions, and search the active orbits again.

        Yield the number of each tile as it is completed.  The number of sweeps is finite: each one with the same time
        limit as the one before has more attractors and labels more initial conditions, and there are no more of these
        in a row than a fixed number; the others double the time limit, up to the periods that are allowed.
        """
        try:
            yield from self._sweeps(list(known))
        except Stopped:
            return
        self.complete = True

    def result(self, settings: Mapping[str, Any], seconds: float) -> Basins:
        """Return what has come out, with warnings of what is missing in it."""
        tally, total = NOTHING if self.now is None else self.now.tally, len(self.initial_conditions)
        if tally.inaccurate:
            diverge = bool((self.store.labels == Label.DIVERGED).any())
            warn_caller(
                f"the integrator missed its tolerance along {tally.inaccurate} of {total} orbits"
                f" ({tally.inaccurate / total:.1%}){_why_inaccurate(self.point_map)}; "
                f"{remedy_for_missed(diverge, self.point_map)}{cycles_of(self.point_map)}",
                ToleranceWarning,
            )
        store = self.store if self.complete else self.store.cut_short(self.now)
        found: Sequence[Attractor] = () if self.now is None else self.now.attractors
        stage = "while initial conditions were labelled"
        if self.searched is not None:
            found, labels, times, _ = self.searched
            rows = _sample_of(total)
            store.labels[rows], store.times[rows] = np.where(labels == Label.UNDECIDED, Label.UNLABELLED, labels), times
            stage = f"in the search for attractors, with {len(found)} found"
        attractors, joined = joined_continua(self.point_map, found)
        # Attractors in their order, without those that no initial condition ends on, once labels are complete for a
        # sample at least; labels get their new numbers.
        ended = store.used(len(found)) if self.searched is None else np.arange(len(found))
        used = sorted(set(joined[ended].tolist()), key=lambda k: sort_key(attractors[k]))
        if not self.complete:
            left = int(np.count_nonzero(store.labels == Label.UNLABELLED))
            warn_caller(
                f"{left:,} of {total:,} initial conditions are unlabelled: the call ended {stage}; allow more time "
                "with max_seconds, or give a checkpoint, from which the same call goes on"
            )
        basins = replace(self.described(settings, seconds), attractors=tuple(attractors[k] for k in used))
        return replace(store.finish(basins, new_numbers(used, joined)), point_map=self.point_map)

    def described(self, settings: Mapping[str, Any], seconds: float) -> Basins:
        """Return basins with everything but labels, settling times and attractors."""
        tally, point_map = NOTHING if self.now is None else self.now.tally, self.point_map
        if self.max_periods is None:
            reached = self.limit if self.now is None else max(self.limit, self.now.time_limit)
            settings = {**settings, "max_periods": reached, "goes_on": True}
        return Basins(
            labels=np.zeros(0, np.int16),
            attractors=(),
            settling_time=np.zeros(0, np.int32),
            grid=self.initial_conditions.grid,
            initial_conditions=self.initial_conditions.given,
            name=point_map.name,
            params=Keyed(point_map.params, "params"),
            coordinates=point_map.coordinates,
            settings=settings,
            inaccurate=tally.inaccurate,
            undecided=Counter(map(str, self.reasons)),
            cost=Cost(
                seconds=seconds,
                steps=tally.steps,
                tabulation=point_map.cost.tabulation,
                iteration=sum(self.spent),
                evaluations=tally.evaluations,
                look_ups=tally.look_ups,
            ),
            point_map=point_map,
        )

    def _sweeps(self, given: list[Attractor]) -> Iterator[int]:
        self.stop.check()
        if not self.searching:
            yield from self._only_sweep(given)
            return
        known = list(with_full_residence(given))  # what other orbits have shown says nothing of these
        total = len(self.initial_conditions)
        chosen = self.initial_conditions.wrapped(_sample_of(total), self.point_map)
        region = chosen if self.initial_conditions.grid is None else self.initial_conditions.region
        self.search = search = Search.begun(self.point_map, region, chosen, self.longest_period)
        now = self.store.resume(search.examined)
        if now is None:
            small = self.client is None and isinstance(self.store, InMemory)
            size, time_limit = _tile_size(total, self.point_map) if small else CHUNK, min(_PATIENCE, self.limit)
            now = Progress(tuple(known), search.examined, Rows(total), (), time_limit, size=size)
            if self.order and known and all(a.verified for a in known):
                # What these attractors attract is attracted by them whatever else is found.
                yield from self._first_look(now, self.order[: self.first])
            tiles = _joined_tiles(self.order) or None
            found = self._sampled(chosen, known, total > _SAMPLE)
            now = replace(now, attractors=self._observed(found, len(found)), tiles=tiles)
            self.store.begin(now)
        search.examined = now.examined
        states: Orbits | None = None
        while True:
            self.now = now
            began = time.perf_counter()
            states = yield from self._label(now, states)
            self.spent.append(time.perf_counter() - began)
            self.now = now = replace(now, tally=now.tally.plus(self.store.tallies.sum(axis=0)))
            left = self.store.where(lambda labels: labels == Label.UNDECIDED)
            if not len(left):
                self.reasons = ()
                return
            if states is None:
                states = self._states(left, now)
            # Exactly, but where there are more than are held, of which a part stands for all.
            missed = round(len(left) * float(np.mean(states.status == Status.INACCURATE)))
            with heeding(self.stop):
                attractors, reasons = self._find_more(now, left, states)
            self.reasons = tuple(reasons)
            following = self._following(now, left, self._observed(attractors, len(now.attractors)))
            if following is None:
                self.now = replace(now, tally=now.tally.plus(Tally(inaccurate=missed)))
                return
            self.store.begin(following)
            if following.time_limit == now.time_limit or len(states) < len(left):
                states = None
            now = following

    def _only_sweep(self, known: Sequence[Attractor]) -> Iterator[int]:
        """Label all initial conditions by what is known."""
        examined = Examined.nothing_yet(self.point_map, np.ones(self.point_map.dimension))
        now = self.store.resume(examined)
        if now is None:
            now = Progress(tuple(known), examined, Rows(len(self.initial_conditions)), (), self.limit)
            self.store.begin(now)
        self.now = now
        yield from self._label(now, None)

    def _first_look(self, now: Progress, groups: Sequence[Sequence[StridedTile]]) -> Iterator[int]:
        """Label some starts by what is known, a group at a time: whoever is content with the first wants no more."""
        self.now = now = replace(now, tiles=_joined_tiles(groups))
        self.store.begin(now)
        ends = np.cumsum([len(group) for group in groups]).tolist()
        yield from self._label(now, None, ends)

    def _sampled(self, chosen: Floats, known: Sequence[Attractor], to_the_end: bool) -> tuple[Attractor, ...]:
        """Find attractors from a sample; where that is complete, slow orbits are left to labelling."""
        assert self.search is not None
        periods = self.limit if to_the_end else min(_PATIENCE, self.limit)
        try:
            with heeding(self.stop):
                found = self.search.by_sample(chosen, known, periods, self.stop, self.limit, to_the_end)
                return tuple(found.attractors)
        except Stopped:
            self.searched = self.search.so_far(known)
            raise

    def _observed(self, attractors: tuple[Attractor, ...], before: int) -> tuple[Attractor, ...]:
        """Return attractors, the chaotic ones with the periods that make a resident, where many are to be labelled.

        Where there are more attractors than before, what was observed holds no longer.
        """
        total = len(self.initial_conditions)
        if len(attractors) > before:
            attractors = with_full_residence(attractors)
        number = min(total, OBSERVED)
        if not unobserved(attractors):
            return attractors
        rows = np.sort(np.random.default_rng(1).choice(total, number, replace=False))
        sample = self.initial_conditions.wrapped(rows, self.point_map)
        # Each sweep counts stays from its beginning.
        ends = [0, *(_PATIENCE << k for k in range(_REPEATS) if _PATIENCE << k < self.limit), self.limit]
        longest = max(b - a for a, b in pairwise(ends))
        with heeding(self.stop):
            return with_residence(self.point_map, attractors, sample, self.limit, total, longest)

    def _label(
        self, now: Progress, states: Orbits | None, ends: Sequence[int] = ()
    ) -> Generator[int, None, Orbits | None]:
        """Label initial conditions; return the states of those that are left, None where these are too many.

        Tiles are labelled together, or those before each of the ``ends`` before the others.
        """
        left: dict[int, Orbits] = {}
        rows: dict[int, Ints] = {}
        count = 0

        def batch(number: int) -> Batch:
            return Batch(now.rows_of(number), None if states is None else states[now.parts[number]])

        todo = self.store.unfinished(now)
        groups = [[n for n in todo if a <= n < b] for a, b in pairwise([0, *ends])] or [todo]
        for number, settled in chain.from_iterable(self._settled(group, batch, now) for group in groups):
            places = now.rows_of(number)
            self.store.put(number, places, settled)
            count += len(settled.orbits)
            if count <= HELD:
                left[number] = settled.orbits
                if isinstance(places, np.ndarray) and now.tiles is not None:
                    rows[number] = places[settled.undecided]
            else:
                left.clear()
            yield number
            self.stop.check()
        found = _joined(left, len(now.parts))
        if found is None or now.tiles is None:
            return found
        return found[np.argsort(np.concatenate([rows[number] for number in range(len(rows))]))]

    def _settled(
        self, tiles: Sequence[int], batch: Callable[[int], Batch], now: Progress
    ) -> Iterator[tuple[int, Settled]]:
        """Yield what becomes of tiles as they are completed."""
        stop = self.stop if self.client is None else None
        until = now.restart_times, now.time_limit, now.time_limit >= self.limit
        bound = None if self.search is not None and self.search.quotient is not None else now.examined.bound
        work = LabellingTask(self.point_map, self.initial_conditions, now.attractors, *until, stop, bound)
        bar = f"basins of {self.point_map.name}" if self.progress else None
        return completed(tiles, batch, work, self.client, bar)

    def _following(self, now: Progress, left: Rows, attractors: tuple[Attractor, ...]) -> Progress | None:
        """Return the sweep after one that is over, from the active orbits and all attractors; None at the end."""
        decided = now.undecided is None or len(left) < now.undecided
        if len(attractors) > len(now.attractors) and decided and now.repeats < _REPEATS:
            # From the beginning, so that settling times are those of the whole catalogue.
            rows, repeats = self._unsettled(attractors), now.repeats + 1
            again = replace(now, attractors=attractors, rows=rows, restart_times=(), tiles=None)
            if rows.bits is None:  # whose orbits are counted again
                again = replace(again, tally=now.tally._replace(inaccurate=0))
            return replace(again, repeats=repeats, undecided=len(left))
        if now.time_limit >= self.limit and not self._affordable(now, len(left)):
            return None
        time_limit = 2 * now.time_limit
        if now.time_limit < self.limit:
            time_limit = min(time_limit, self.limit)
        restart_times = (*now.restart_times, now.time_limit)
        after = replace(now, rows=left, restart_times=restart_times, time_limit=time_limit, tiles=None)
        return replace(after, repeats=0, undecided=None)

    def _affordable(self, now: Progress, left: int) -> bool:
        """Tell whether the orbits that are left are followed on, beyond the limit, for twice as many periods.

        Few of them take no longer than the orbits that are examined after that.
        """
        more = any(REMEDIES[reason].startswith(MORE) for reason in self.reasons)
        if self.max_periods is not None or not more:
            return False
        return max(left, ENDURANCE * ORBITS) * now.time_limit <= _FURTHER * now.tally.steps

    def _find_more(self, now: Progress, left: Rows, states: Orbits) -> tuple[tuple[Attractor, ...], Sequence[Reason]]:
        """Search the active orbits for further attractors; return all, and why the last sweep leaves orbits."""
        assert self.search is not None

        def late(came: Bools) -> Late:
            return self._late(now, np.concatenate(list(left.spread(len(came))))[came])

        return self.search.among(states, now.attractors, now.time_limit, now.time_limit >= self.limit, late)

    def _late(self, now: Progress, rows: Ints) -> Late:
        """Return the initial conditions that came last to attractors that are not chaotic; rows are those come now."""
        settled = self.store.where(lambda labels: regular(labels, now.attractors))
        rows = np.concatenate([rows, *settled.spread(_LOOKED_AT)])
        times = np.where(self.store.times[rows] < 0, now.time_limit, self.store.times[rows])
        chosen = Late.latest(times)
        return Late(self.initial_conditions.wrapped(rows[chosen], self.point_map), times[chosen].astype(np.int64))

    def _unsettled(self, attractors: Sequence[Attractor]) -> Rows:
        """Rows that further attractors may concern: no orbit from a verified neighbourhood enters another one."""
        if any(not a.verified for a in attractors):
            return Rows(len(self.initial_conditions))
        return self.store.where(lambda labels: labels < 0)

    def _states(self, left: Rows, now: Progress) -> Orbits:
        """Compute the states of the active orbits of a sweep again, of a part of them where they are very many."""
        count = len(left) if len(left) <= HELD else _LOOKED_AT
        batches = [Batch(rows[part]) for rows in left.spread(count) for part in slices(len(rows), CHUNK)]
        found = {k: settled.orbits for k, settled in self._settled(range(len(batches)), batches.__getitem__, now)}
        return Orbits.joined([found[number] for number in range(len(batches))])


def label_store(
    point_map: PointMap,
    places: InitialConditions,
    settings: Mapping[str, Any],
    known: Sequence[Attractor] = (),
    path: Path | None = None,
    copies: int = 1,
) -> LabelStore:
    """Return where labels are to be kept, once there is room for them: in memory, or in a checkpoint.

    ``settings``: those of the basins; ``known``: attractors that were given; ``copies``: how many arrays of labels and
    settling times there will be in memory.

    Raises
    ------
    MemoryError, OSError
        If the labels do not fit into memory, or a checkpoint not on the disk.
    StoreError
        For a file of another kind, or basins of another run.
    """
    if path is None:
        total = len(places)
        remedy = "take fewer initial conditions" + (
            ", or give a checkpoint, which keeps them on the disk" * (copies == 1)
        )
        claim_memory(f"labels of {total:,} initial conditions", copies * basins_memory(total), remedy)
        return InMemory(places.shape)
    from .label_file import OnDisk

    return OnDisk.of(point_map, places, settings, known, path)


def _tile_size(total: int, point_map: PointMap) -> int:
    """Return how many initial conditions are labelled together where labels are in memory."""
    least, most = _IN_A_TILE
    if point_map.is_flow and point_map.table is None:
        least = min(max(_INTEGRATED[0], total // 16), _INTEGRATED[1])
    return min(max(least, total // _TILES), most)


def new_numbers(used: Sequence[int], joined: Ints) -> NDArray[np.int16]:
    """Return the new label of each old one, from the lowest label on, where only some attractors are kept, in order.

    ``joined`` are the numbers, before those are chosen, of attractors some of which have been found in pieces.
    """
    places = {k: place for place, k in enumerate(used)}
    numbers = [places.get(k, min(LABEL_NAMES)) for k in joined.tolist()]
    return np.array([*range(min(LABEL_NAMES), 0), *numbers], label_type(len(used)))


def _joined_tiles(groups: Sequence[Sequence[StridedTile]]) -> tuple[StridedTile, ...]:
    return tuple(tile for group in groups for tile in group)


def _joined(left: Mapping[int, Orbits], tiles: int) -> Orbits | None:
    """Return the states that tiles have left in their order, None where some are missing."""
    return Orbits.joined([left[number] for number in range(tiles)]) if len(left) == tiles else None


def _why_inaccurate(point_map: PointMap) -> str:
    """Return the reason that the map knows, if it does."""
    unknown = point_map.without_table.unknown_formulas
    return f", for kinks are not located where formulas are unknown ({unknown})" if unknown else ""


def _sample_of(total: int) -> Ints:
    """Return which initial conditions the first search begins with."""
    few = np.arange(total) if total <= _SAMPLE else np.random.default_rng(0).choice(total, _SAMPLE, replace=False)
    return np.sort(few)
