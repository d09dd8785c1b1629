"""Basins of attraction of a grid or an array of initial conditions, in sweeps over them."""

from __future__ import annotations

import os
import threading
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.checks import claim_disk, claim_memory, warn_caller, whole_number
from .._lib.files import as_target, locked
from .._lib.signatures import checked
from .._lib.threads import slices
from .._lib.tiles import check_client, run_tiles
from ..attractors.chaos import chaotic_attractors, examine
from ..attractors.labels import Label
from ..attractors.search import Examined, check_attractors, longest_period, region_extent, search, sort_out
from ..attractors.settling import Settled
from ..attractors.transients import Reason
from ..maps.fingerprint import PROBES, fingerprint
from ..maps.grid import CellGrid
from ..maps.orbit_batch import CHUNK, Cost, Orbits
from ..maps.point_map import PointMap, ToleranceWarning
from ..orbits.attractor import Attractor
from .initial_conditions import Rows, Starts
from .label_tiles import Batch, Labelling
from .passes import Kept, Pass, in_use
from .record import HELD, Basins, basins_disk, basins_memory

_SAMPLE = 1024  # starts from which attractors are sought first
_PATIENCE = 256  # periods before starts that are left are searched for further attractors
_REPEATS = 32  # passes over the same periods with ever more attractors, at most
_LOOKED_AT = 2**16  # starts of those that are left, evenly spread, that are searched where more than HELD are left


@checked
def find_basins(
    point_map: PointMap,
    starts: CellGrid | ArrayLike,
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
    starts : CellGrid or array_like, shape (..., dimension)
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
    places = Starts.of(starts, point_map)
    settings = {"max_periods": max_periods, "max_period": max_period, "map": dict(point_map.recipe)}
    path = None if checkpoint is None else as_target("checkpoint", checkpoint)
    with locked(path):
        kept = _kept(point_map, places, settings, tuple(attractors), path)
        if isinstance(kept, Basins):
            return replace(kept, point_map=point_map)
        run = _Run(point_map, places, kept, max_periods, max_period, client, progress)
        found, reasons = run.find(list(attractors))
        tally = found.tally
        if tally.inaccurate:
            warn_caller(
                f"the integrator missed its tolerance along {tally.inaccurate} of {len(places)} orbits; loosen "
                "rtol and atol, or allow more steps with max_steps",
                ToleranceWarning,
            )
        used, renumber = in_use(found.attractors, kept)

        def picture(labels: NDArray[np.int16], times: NDArray[np.int32]) -> Basins:
            return Basins(
                labels=labels,
                attractors=used,
                settling_time=times,
                grid=places.grid,
                starts=places.given,
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

        return kept.finish(renumber, picture)


def _kept(
    point_map: PointMap,
    places: Starts,
    settings: Mapping[str, Any],
    known: tuple[Attractor, ...],
    path: Path | None,
) -> Kept | Basins:
    """Return where labels are to be kept, once there is room for them; or the basins that a checkpoint has come to."""
    total = len(places)
    if path is None:
        remedy = "take fewer initial conditions, or give a checkpoint, which keeps them on the disk"
        claim_memory(f"labels of {total:,} initial conditions", basins_memory(total), remedy)
        return Kept(places.shape)
    from .passes_in_file import KeptInFile, describe_attractors

    probes = places.points(np.unique(np.linspace(0, total - 1, PROBES).astype(np.int64)))
    limits = {name: settings[name] for name in ("max_periods", "max_period")}
    belongs = {
        "what": "basins",
        "starts": places.description(),
        **limits,
        "attractors": describe_attractors(known),
        **fingerprint(point_map, probes),
    }
    kept = KeptInFile(places.shape, path, belongs)
    finished = kept.finished()
    if finished is not None:
        return finished
    claim_memory(f"labelling {total:,} initial conditions", basins_memory(total, checkpoint=True), "free some")
    claim_disk(f"checkpoint={str(path)!r}", basins_disk(total), path, "take fewer initial conditions, or another disk")
    return kept


@dataclass(frozen=True, eq=False)
class _Run:
    """Labelling of all starts in passes: each begins with what is left by the one before, or with what is known more.

    All that a pass depends on is in its :class:`Pass`, so that a run may be taken up at any of them.
    """

    point_map: PointMap
    starts: Starts
    kept: Kept
    max_periods: int
    max_period: int
    client: Any
    progress: bool
    spent: list[float] = field(default_factory=list)  # seconds of iteration, pass by pass

    def find(self, known: list[Attractor]) -> tuple[Pass, tuple[Reason, ...]]:
        """Find attractors from a sample, label all starts, and look again at those that are left.

        Return the last pass, and why some of those that it leaves are undecided.  The passes come to an end: each one
        that has the same horizon as the one before has more attractors and labels more starts, and there are no more
        of these in a row than a fixed number; the others double the horizon, up to the periods that are allowed.
        """
        total = len(self.starts)
        few = np.arange(total) if total <= _SAMPLE else np.random.default_rng(0).choice(total, _SAMPLE, replace=False)
        chosen = self.starts.wrapped(np.sort(few), self.point_map)
        grid = self.starts.grid
        corners = chosen if grid is None else np.array([grid.lower, grid.upper])
        extent = region_extent(self.point_map, corners)
        examined = Examined.nothing_yet(self.point_map, extent)
        now = self.kept.resume(examined)
        if now is None:
            attractors = self._search(chosen, known, total > _SAMPLE, examined)
            now = Pass(attractors, examined, Rows(total), (), min(_PATIENCE, self.max_periods))
            self.kept.begin(now)
        states: Orbits | None = None
        while True:
            began = time.perf_counter()
            states = self._label(now, states)
            self.spent.append(time.perf_counter() - began)
            now = replace(now, tally=now.tally.plus(self.kept.tallies.sum(axis=0)))
            left = self.kept.where(lambda labels: labels == Label.UNDECIDED)
            if not len(left):
                return now, ()
            if states is None:
                states = self._states(left, now)
            attractors, reasons = self._find_more(now, states)
            following = self._following(now, left, attractors)
            if following is None:
                return now, reasons
            self.kept.begin(following)
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

    def _label(self, now: Pass, states: Orbits | None) -> Orbits | None:
        """Label the starts of a pass; return the states of those that are left, None where these were not kept."""
        parts = now.parts
        tiles = self.kept.unfinished(now)
        left = _Left(len(parts))

        def batch(number: int) -> Batch:
            return Batch(now.rows_of(number), None if states is None else states[parts[number]])

        def deliver(number: int, settled: Settled) -> None:
            self.kept.put(number, now.rows_of(number), settled)
            left.add(number, settled.orbits)

        run_tiles(tiles, batch, self._work(now), deliver, self.client, self._bar)
        return left.joined()

    def _following(self, now: Pass, left: Rows, attractors: tuple[Attractor, ...]) -> Pass | None:
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

    def _find_more(self, now: Pass, states: Orbits) -> tuple[tuple[Attractor, ...], tuple[Reason, ...]]:
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
            return Rows(len(self.starts))
        return self.kept.where(lambda labels: labels < 0)

    def _states(self, left: Rows, now: Pass) -> Orbits:
        """Compute the states of starts that a pass has left again, of a part of them where they are very many."""
        count = len(left) if len(left) <= HELD else _LOOKED_AT
        batches = [Batch(rows[part]) for rows in left.spread(count) for part in slices(len(rows), CHUNK)]
        found: dict[int, Orbits] = {}

        def keep(number: int, settled: Settled) -> None:
            found[number] = settled.orbits

        run_tiles(range(len(batches)), batches.__getitem__, self._work(now), keep, self.client, self._bar)
        return Orbits.joined([found[number] for number in range(len(batches))])

    def _work(self, now: Pass) -> Labelling:
        return Labelling(self.point_map, self.starts, now.attractors, now.legs, now.horizon)

    @property
    def _bar(self) -> str | None:
        return f"basins of {self.point_map.name}" if self.progress else None


class _Left:
    """States that are left by the tiles of a pass, as long as they are few."""

    def __init__(self, tiles: int) -> None:
        self._tiles, self._lock = tiles, threading.Lock()
        self._parts: dict[int, Orbits] = {}
        self._count = 0

    def add(self, number: int, orbits: Orbits) -> None:
        """Keep the states of a tile."""
        with self._lock:
            self._count += len(orbits)
            if self._count <= HELD:
                self._parts[number] = orbits
            else:
                self._parts.clear()

    def joined(self) -> Orbits | None:
        """Return all states in the order of the tiles, None where some are missing."""
        if len(self._parts) < self._tiles:
            return None
        return Orbits.joined([self._parts[number] for number in range(self._tiles)])
