"""Basins of attraction of a grid or an array of initial conditions, in sweeps over them."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.checks import claim_disk, claim_memory, warn_caller, whole_number
from .._lib.files import as_target, locked
from .._lib.signatures import checked
from .._lib.threads import slices
from .._lib.tiles import check_client, completed
from ..attractors.chaos import chaotic_attractors, examine
from ..attractors.labels import LABEL_NAMES, Label
from ..attractors.search import Examined, check_attractors, longest_period, region_extent, search, sort_out
from ..attractors.settling import Settled
from ..attractors.transients import Reason
from ..maps.fingerprint import PROBES, fingerprint
from ..maps.grid import CellGrid
from ..maps.orbit_batch import CHUNK, Cost, Orbits
from ..maps.point_map import PointMap, ToleranceWarning
from ..orbits.attractor import Attractor, sort_key
from .initial_conditions import Rows, Starts
from .label_store import InMemory, LabelStore
from .label_tiles import Batch, Labelling
from .progress import Progress
from .record import HELD, Basins, basins_disk, basins_memory

_SAMPLE = 1024  # starts from which attractors are sought first
_PATIENCE = 256  # periods before starts that are left are searched for further attractors
_REPEATS = 32  # passes over the same periods with ever more attractors, at most
_LOOKED_AT = 2**16  # starts of those that are left, evenly spread, that are searched where more than HELD are left


@checked
def find_basins(
    point_map: PointMap,
    initial_conditions: CellGrid | ArrayLike,
    max_periods: int = 2000,
    max_period: int = 32,
    attractors: Sequence[Attractor] = (),
    progress: bool = False,
    client: Any = None,
    checkpoint: str | os.PathLike[str] | None = None,
) -> Basins:
    """Find the attractors of a map and label each initial condition by the attractor to which its orbit converges.

    Every initial condition is iterated until its orbit enters a verified trapping region of an attractor; see
    :func:`find_attractors` for the search for attractors.  Initial conditions that have not converged after many
    periods are searched for further attractors, so that small basins are found too.  Those that never converge are
    undecided: chaotic transients, for instance, and orbits that did not stay among the boxes of a chaotic attractor for
    64 periods.

    Parameters
    ----------
    point_map : PointMap
        Exact, interpolated or discrete map.
    initial_conditions : CellGrid or array_like, shape (..., dimension)
        Grid of cells whose centres are the initial conditions, or the initial conditions themselves.
    max_periods : int, optional
        Periods after which an initial condition whose orbit has not settled is undecided.
    max_period : int, optional
        Longest period of a periodic attractor.
    attractors : sequence of Attractor, optional
        Attractors that are known already, with their trapping regions.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.
    client : distributed.Client, optional
        Dask cluster that labels the initial conditions; by default the threads of this process do.
    checkpoint : path-like, optional
        File in which labels are stored as they are computed.  Repeating a call that was interrupted or killed resumes
        it, with the same result.  At the end the file is one of basins, for :func:`load_basins`, and repeating the call
        reads it.  Labels are kept in the file, so that they need not fit into memory.

    Returns
    -------
    Basins
        Labels, attractors, fractions and settling times.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, or a checkpoint of another run.
    MemoryError
        If the labels do not fit into memory.
    OSError
        If a checkpoint does not fit on the disk.
    StoreError
        For a checkpoint that is damaged or in use by another run, or a file of another kind.

    Warns
    -----
    ToleranceWarning
        If the integrator missed its tolerance along some orbits.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> def newton(x, p):
    ...     return x[0] / 2 + 1 / (2 * x[0]),
    >>> signs = find_basins(discrete_map(newton, {}, ("x",)), CellGrid((-3,), (3,), (100,)))
    >>> signs.attractors[0].points.round(12), signs.fractions[0].share
    (array([[1.]]), 0.5)
    """
    max_periods = whole_number("max_periods", max_periods, at_least=1)
    max_period = longest_period(max_period)
    check_attractors(attractors, point_map, "attractors")
    check_client(client)
    began = time.perf_counter()
    places = Starts.of(initial_conditions, point_map)
    settings = {"max_periods": max_periods, "max_period": max_period, "map": dict(point_map.recipe)}
    path = None if checkpoint is None else as_target("checkpoint", checkpoint)
    with locked(path):
        store = _store(point_map, places, settings, tuple(attractors), path)
        if (finished := store.finished()) is not None:
            return replace(finished, point_map=point_map)
        if path is not None:
            _claim_room(len(places), path)
        run = _Run(point_map, places, store, max_periods, max_period, client, progress)
        found, reasons = run.find(list(attractors))
        tally = found.tally
        if tally.inaccurate:
            warn_caller(
                f"the integrator missed its tolerance along {tally.inaccurate} of {len(places)} orbits; loosen "
                "rtol and atol, or allow more steps with max_steps",
                ToleranceWarning,
            )
        # Attractors in their order, without those that no initial condition ends on; labels get their new numbers.
        used = sorted(store.used(len(found.attractors)).tolist(), key=lambda k: sort_key(found.attractors[k]))
        numbers = np.arange(min(LABEL_NAMES), len(found.attractors), dtype=np.int16)
        numbers[np.array(used, np.int64) - min(LABEL_NAMES)] = np.arange(len(used))
        basins = Basins(
            labels=store.labels,
            attractors=tuple(found.attractors[k] for k in used),
            settling_time=store.times,
            grid=places.grid,
            initial_conditions=places.given,
            name=point_map.name,
            params=dict(point_map.params),
            coordinates=point_map.coordinates,
            settings=settings,
            inaccurate=tally.inaccurate,
            undecided=Counter(map(str, reasons)),
            cost=Cost(
                seconds=time.perf_counter() - began,
                steps=tally.steps,
                tabulation=point_map.cost.tabulation,
                iteration=sum(run.spent),
                evaluations=tally.evaluations,
                look_ups=tally.look_ups,
            ),
            point_map=point_map,
        )
        return replace(store.finish(basins, numbers), point_map=point_map)


def _store(
    point_map: PointMap,
    places: Starts,
    settings: Mapping[str, Any],
    known: tuple[Attractor, ...],
    path: Path | None,
) -> LabelStore:
    """Return where labels are to be kept; in memory, once there is room for them."""
    total = len(places)
    if path is None:
        remedy = "take fewer initial conditions, or give a checkpoint, which keeps them on the disk"
        claim_memory(f"labels of {total:,} initial conditions", basins_memory(total), remedy)
        return InMemory(places.shape)
    from .label_file import OnDisk, describe_attractors

    probes = places.points(np.unique(np.linspace(0, total - 1, PROBES).astype(np.int64)))
    limits = {name: settings[name] for name in ("max_periods", "max_period")}
    belongs = {
        "what": "basins",
        "initial_conditions": places.description(),
        **limits,
        "attractors": describe_attractors(known),
        **fingerprint(point_map, probes),
    }
    return OnDisk(places.shape, path, belongs)


def _claim_room(total: int, path: Path) -> None:
    """Make sure that labels of some number of initial conditions fit into a checkpoint, and what else they need."""
    claim_memory(f"labelling {total:,} initial conditions", basins_memory(total, checkpoint=True), "free some")
    claim_disk(f"checkpoint={str(path)!r}", basins_disk(total), path, "take fewer initial conditions, or another disk")


@dataclass(frozen=True, eq=False)
class _Run:
    """Labelling of all starts in passes: each begins with what is left by the one before, or with what is known more.

    All that a pass depends on is in its :class:`Progress`, so that a run may be taken up at any of them.
    """

    point_map: PointMap
    initial_conditions: Starts
    store: LabelStore
    max_periods: int
    max_period: int
    client: Any
    progress: bool
    spent: list[float] = field(default_factory=list)  # seconds of iteration, pass by pass

    def find(self, known: list[Attractor]) -> tuple[Progress, tuple[Reason, ...]]:
        """Find attractors from a sample, label all starts, and look again at those that are left.

        Return the last pass, and why some of those that it leaves are undecided.  The passes come to an end: each one
        that has the same horizon as the one before has more attractors and labels more starts, and there are no more
        of these in a row than a fixed number; the others double the horizon, up to the periods that are allowed.
        """
        total = len(self.initial_conditions)
        few = np.arange(total) if total <= _SAMPLE else np.random.default_rng(0).choice(total, _SAMPLE, replace=False)
        chosen = self.initial_conditions.wrapped(np.sort(few), self.point_map)
        grid = self.initial_conditions.grid
        corners = chosen if grid is None else np.array([grid.lower, grid.upper])
        extent = region_extent(self.point_map, corners)
        examined = Examined.nothing_yet(self.point_map, extent)
        now = self.store.resume(examined)
        if now is None:
            attractors = self._search(chosen, known, total > _SAMPLE, examined)
            now = Progress(attractors, examined, Rows(total), (), min(_PATIENCE, self.max_periods))
            self.store.begin(now)
        states: Orbits | None = None
        while True:
            began = time.perf_counter()
            states = self._label(now, states)
            self.spent.append(time.perf_counter() - began)
            now = replace(now, tally=now.tally.plus(self.store.tallies.sum(axis=0)))
            left = self.store.where(lambda labels: labels == Label.UNDECIDED)
            if not len(left):
                return now, ()
            if states is None:
                states = self._states(left, now)
            attractors, reasons = self._find_more(now, states)
            following = self._following(now, left, attractors)
            if following is None:
                return now, reasons
            self.store.begin(following)
            if following.horizon == now.horizon or len(states) < len(left):
                states = None
            now = following

    def _search(
        self, chosen: NDArray[np.float64], known: list[Attractor], to_the_end: bool, examined: Examined
    ) -> tuple[Attractor, ...]:
        """Find attractors from a sample; where this is all starts, those that take long are left to their labelling."""
        own = region_extent(self.point_map, chosen)
        if not np.array_equal(own, examined.extent):
            examined = Examined.nothing_yet(self.point_map, own)
        periods = self.max_periods if to_the_end else min(_PATIENCE, self.max_periods)
        left, attractors, age = search(self.point_map, chosen, known, periods, self.max_period, own, examined)
        if to_the_end and len(left):
            attractors += chaotic_attractors(self.point_map, left.points, own, attractors, age)
        return tuple(attractors)

    def _label(self, now: Progress, states: Orbits | None) -> Orbits | None:
        """Label initial conditions; return the states of those that are left, None where these are too many."""
        left: dict[int, Orbits] = {}
        count = 0

        def batch(number: int) -> Batch:
            return Batch(now.rows_of(number), None if states is None else states[now.parts[number]])

        for number, settled in self._settled(self.store.unfinished(now), batch, now):
            self.store.put(number, now.rows_of(number), settled)
            count += len(settled.orbits)
            if count <= HELD:
                left[number] = settled.orbits
            else:
                left.clear()
        return _joined(left, len(now.parts))

    def _settled(
        self, tiles: Sequence[int], batch: Callable[[int], Batch], now: Progress
    ) -> Iterator[tuple[int, Settled]]:
        """Yield what becomes of tiles as they are completed."""
        work = Labelling(self.point_map, self.initial_conditions, now.attractors, now.legs, now.horizon)
        bar = f"basins of {self.point_map.name}" if self.progress else None
        return completed(tiles, batch, work, self.client, bar)

    def _following(self, now: Progress, left: Rows, attractors: tuple[Attractor, ...]) -> Progress | None:
        """Return the pass after one that is over, from the starts that are left and all attractors; None at the end."""
        decided = now.undecided is None or len(left) < now.undecided
        if len(attractors) > len(now.attractors) and decided and now.repeats < _REPEATS:
            # From the beginning, so that settling times are those of the whole catalogue.
            rows, repeats = self._unsettled(attractors), now.repeats + 1
            return replace(now, attractors=attractors, rows=rows, legs=(), repeats=repeats, undecided=len(left))
        if now.horizon == self.max_periods:
            return None
        horizon = min(2 * now.horizon, self.max_periods)
        return replace(now, rows=left, legs=(*now.legs, now.horizon), horizon=horizon, repeats=0, undecided=None)

    def _find_more(self, now: Progress, states: Orbits) -> tuple[tuple[Attractor, ...], tuple[Reason, ...]]:
        """Search the orbits that are left for further attractors; return all, and why the last pass leaves orbits."""
        extent, age = now.examined.extent, now.horizon
        left, attractors = sort_out(
            self.point_map, states, list(now.attractors), self.max_period, extent, age, now.examined
        )
        if age < self.max_periods or not len(left):
            return tuple(attractors), ()
        examination = examine(self.point_map, left.points, extent, attractors, age)
        return (*attractors, *examination.attractors), examination.reasons

    def _unsettled(self, attractors: Sequence[Attractor]) -> Rows:
        """Rows that further attractors may concern: no orbit from a verified neighbourhood enters another one."""
        if any(a.neighbourhood is None for a in attractors):
            return Rows(len(self.initial_conditions))
        return self.store.where(lambda labels: labels < 0)

    def _states(self, left: Rows, now: Progress) -> Orbits:
        """Compute the states of starts that a pass has left again, of a part of them where they are very many."""
        count = len(left) if len(left) <= HELD else _LOOKED_AT
        batches = [Batch(rows[part]) for rows in left.spread(count) for part in slices(len(rows), CHUNK)]
        found = {k: settled.orbits for k, settled in self._settled(range(len(batches)), batches.__getitem__, now)}
        return Orbits.joined([found[number] for number in range(len(batches))])


def _joined(left: Mapping[int, Orbits], tiles: int) -> Orbits | None:
    """Return the states that tiles have left in their order, None where some are missing."""
    return Orbits.joined([left[number] for number in range(tiles)]) if len(left) == tiles else None
