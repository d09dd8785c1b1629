"""Labels and the evidence for them, found in several ways one after the other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._compiled.kernels.certainty import NONE, Window, carry_rows, judging, keep_rows, sort_out, widening
from ..._lib.arrays import Bools, Floats, Ints
from ..._lib.randomness import random_numbers
from ..._lib.threads import run_over, slices
from ...attractors.kinds.creeping import settled_at_last
from ...attractors.regions.boxes import inside_cover
from ...attractors.settling.escape import far_bound
from ...attractors.settling.labels import Label
from ...attractors.settling.settle import Settled, classify, settle
from ...maps.coordinates import wrap
from ...maps.grid import Locator
from ...maps.orbit_batch import CHUNK, NOTHING, Orbits, Tally
from ...maps.point_map import PointMap
from ..initial_conditions import InitialConditions
from ..record import Basins
from ..verification import Verification
from .budget import Budget, some_of
from .cell_owners import SMALLEST, Setting, owners_of_cells
from .certificate import Evidence
from .table_errors import TableErrors, slopes_of, tolerance_in_cells
from .undecided import MissedAttractors

_ROWS = 8192  # initial conditions that are followed together: they stay in the cache
_INTEGRATED = 1024  # initial conditions that are integrated together
_WIDEST = 1.0  # widths of a cell that an error may reach, lest derivatives say nothing of it
_SOON = 4  # periods within which errors at an equilibrium have to come to rest
_ESCAPED = int(Label.ESCAPED)  # loops know plain numbers at once, and others by a look at all arguments
OPEN = (Label.UNDECIDED, Label.UNLABELLED)
_GRACE = 16  # periods beyond twice the settling time of the interpolated map for which orbits are followed


def _slow(basins: Basins) -> Bools:
    """Return which initial conditions take more than half of the allowed periods: another map may need too many."""
    late = basins.settling_time.ravel() > basins.settings["max_periods"] // 2
    return np.asarray(late | np.isin(basins.labels.ravel(), OPEN))


@dataclass(frozen=True, eq=False)
class _Left:
    """Initial conditions without certain label, and their states at an age in periods."""

    rows: Ints
    orbits: Orbits
    age: int


class CertifiedLabels:
    """Labels and the evidence for them, found in several ways one after the other."""

    def __init__(
        self, search: MissedAttractors, bounds: TableErrors | None, budget: Budget, tally: Tally, proved: Bools
    ) -> None:
        basins, self.progress = search.basins, search.progress
        point_map = basins.point_map
        assert point_map is not None
        self.name, self.told, self.point_map = basins.name, search.told.copy(), point_map
        self.initial_conditions = InitialConditions(basins.grid, basins.initial_conditions)
        self.setting = Setting.of(basins, point_map)
        self.periods = int(basins.settings["max_periods"])
        self.slow = _slow(basins)
        times = basins.settling_time.ravel()
        self.patience = np.where(times < 0, self.periods, np.minimum(2 * times + _GRACE, self.periods))
        self.bounds, self.budget = bounds, budget
        if bounds is not None:
            self.owners = owners_of_cells(self.setting, bounds, self._late())
        self.labels, self.times = basins.labels.flatten(), basins.settling_time.flatten()
        self.evidence = np.where(proved, Evidence.PROVED, Evidence.OPEN).astype(np.uint8)
        self.redone = 0
        self.undecided = np.zeros(0, np.int64)
        self.tally = tally

    def certify(self, audit: int, seed: int) -> Verification:
        """Find labels and the evidence for them; return the audit of those that were not recomputed.

        Initial conditions that the exact map leaves undecided, also in the audit, are then in `undecided`.
        """
        if self.bounds is not None:
            run_over(slices(self.labels.size, CHUNK), self._by_cells)
            left = np.flatnonzero(self.evidence == Evidence.OPEN)
            first, before = some_of(left), self.tally
            self._by_orbits(first, self.bounds)
            rest = np.setdiff1d(left, first, assume_unique=True)
            spent = Tally(*np.subtract(self.tally, before).tolist())
            if self.budget.holds(spent, len(first), len(rest)):
                self._by_orbits(rest, self.bounds)
            else:
                self._integrate(rest)
        else:
            self._integrate(np.flatnonzero(self.evidence == Evidence.OPEN))
        self.redone = int(np.count_nonzero((self.evidence >= Evidence.EXACT) & (self.evidence < Evidence.PROVED)))
        kept = np.flatnonzero(self.evidence <= Evidence.ORBIT)
        drawn = random_numbers(seed).choice(kept, audit) if len(kept) else kept
        direct = self._direct_labels(drawn)
        undecided = self.labels == Label.UNDECIDED
        undecided[drawn[direct == Label.UNDECIDED]] = True
        self.undecided = np.flatnonzero(undecided)
        return Verification.of(int(np.count_nonzero(direct != self.labels[drawn])), len(drawn))

    def _late(self) -> Iterator[Floats]:
        """Yield the initial conditions that settle late or never, in batches."""
        for part in slices(len(self.slow), CHUNK):
            rows = np.flatnonzero(self.slow[part]) + part.start
            yield self.initial_conditions.wrapped(rows, self.setting.direct)

    def _by_cells(self, part: slice) -> None:
        """Label initial conditions in cells all of whose orbits converge to one attractor."""
        setting = self.setting
        cells = Locator.of(setting.grid, setting.direct.coordinates)(self.initial_conditions.points(part))
        owners = np.where((cells >= 0) & ~self.slow[part], self.owners[cells], NONE)
        held = (owners >= _ESCAPED) & (self.evidence[part] == Evidence.OPEN)
        labels, times = self.labels[part], self.times[part]
        changed = held & (owners != labels)
        labels[changed], times[changed] = owners[changed], 0
        self.evidence[part][held] = Evidence.CELL

    def _by_orbits(self, rows: Ints, bounds: TableErrors) -> None:
        """Label initial conditions by their orbits with bounds of the errors, by the exact map where it has to be."""
        self.follow(self.point_map, rows, bounds.of_orbits, Evidence.ORBIT)
        redone = rows[self.evidence[rows] == Evidence.OPEN]
        self.follow(self.setting.exact, redone, bounds.tolerances, Evidence.EXACT)

    def _integrate(self, rows: Ints) -> None:
        """Label initial conditions by the exact map alone."""
        parts = slices(len(rows), _INTEGRATED)
        tallies = np.zeros((len(parts), len(NOTHING)), np.int64)

        def work(number: int) -> None:
            mine = rows[parts[number]]
            orbits = Orbits.starting(self.initial_conditions.wrapped(mine, self.setting.exact))
            tallies[number] = self._settle(_Left(mine, orbits, 0))

        run_over(range(len(parts)), work, f"integrating {self.name}" if self.progress else None)
        self.tally = self.tally.plus(tallies.sum(axis=0))
        self.evidence[rows] = Evidence.DIRECT

    def follow(self, point_map: PointMap, rows: Ints, errors: Floats, mark: Evidence) -> None:
        """Follow orbits with bounds of their errors, and label those that are inside a region within these bounds.

        The others keep their label if this is the interpolated map; the exact map labels them too.
        """
        parts = slices(len(rows), _ROWS)
        tallies = np.zeros((len(parts), len(NOTHING)), np.int64)

        def work(number: int) -> None:
            mine = rows[parts[number]]
            left, tally = self._follow(point_map, mine, errors, mark)
            for part in left if mark is Evidence.EXACT else ():
                tally = tally.plus(self._settle(part))
            tallies[number] = tally

        run_over(range(len(parts)), work, f"certifying {self.name}" if self.progress else None)
        self.tally = self.tally.plus(tallies.sum(axis=0))

    def _settle(self, left: _Left) -> Tally:
        """Label orbits with the exact map, from the beginning where they may have converged before."""
        new = ~self.told[left.rows]
        rows, orbits, age = left.rows[new], left.orbits[new], left.age
        if self.setting.catalogue.covers or len(self.setting.overhangs):
            orbits, age = Orbits.starting(self.initial_conditions.wrapped(rows, self.setting.exact)), 0
        settled = self._at_last(settle(self.setting.exact, orbits, self.setting.catalogue, self.periods - age, age))
        changed = settled.labels != self.labels[rows]
        self.labels[rows[changed]], self.times[rows[changed]] = settled.labels[changed], settled.times[changed]
        return settled.tally

    def _at_last(self, settled: Settled) -> Settled:
        exact = self.setting.exact
        bound = far_bound(exact, self.initial_conditions.region)
        return settled_at_last(exact, self.setting.catalogue.attractors, self.periods, settled, bound)

    @np.errstate(invalid="ignore", over="ignore")  # errors that have grown too large may grow beyond all bounds
    def _follow(self, point_map: PointMap, rows: Ints, errors: Floats, mark: Evidence) -> tuple[list[_Left], Tally]:
        """Follow orbits until their label is certain; return those without certain label, and the work."""
        setting, d = self.setting, point_map.dimension
        left: list[_Left] = []
        slow, rows = rows[self.slow[rows]], rows[~self.slow[rows]]
        if len(slow) and mark is Evidence.EXACT:
            left.append(_Left(slow, Orbits.starting(self.initial_conditions.wrapped(slow, point_map)), 0))
        orbits = Orbits.starting(self.initial_conditions.wrapped(rows, point_map))
        spread, found = np.zeros((len(rows), d, d)), np.empty(len(rows), np.int64)
        kept, lost, gone = np.empty(len(rows), np.int64), np.empty(len(rows), np.int64), np.zeros(1, np.int64)
        judge, steps = judging(d), 0
        window = Window(self.owners, *setting.place, int(setting.escapes), _ESCAPED, setting.overhangs)
        outcome = self.patience, self.labels, self.times, self.evidence
        for k in range(self.periods + 1):
            judge(orbits.points, spread, window, setting.neighbourhoods, setting.reaches, setting.catalogue.turn, found)
            self._stopped(orbits, spread, found)
            rule = k, _WIDEST, int(mark), _ESCAPED
            going = sort_out(found, spread, orbits.status, rows, rule, outcome, (kept, lost, gone))
            if gone[0] and mark is Evidence.EXACT:
                some = lost[: gone[0]]
                left.append(_Left(rows[some], orbits[some], k))
            if going == 0:
                break
            if going < len(rows):
                keep_rows(kept, going, orbits.points, orbits.rotations, orbits.status, spread, rows)
                rows, orbits, spread, found = rows[:going], orbits[:going], spread[:going], found[:going]
            self._widen(orbits.points, spread, errors)
            point_map.advance(orbits, 1)
            steps += going
        return left, Tally(steps, 0, orbits.work.evaluations, orbits.work.look_ups)

    def _stopped(self, orbits: Orbits, spread: Floats, found: Ints) -> None:
        """Find orbits that rest at equilibria, and write those with all of whose errors they would soon rest there too.

        Errors at an equilibrium of dry friction are tried at the ends of the axes of their ellipsoids' boxes.
        """
        for number, cover, keys in self.setting.catalogue.covers:
            rows = np.flatnonzero((found == NONE) & orbits.alive) if cover.certain is not None else ()
            rows = rows[inside_cover(cover, orbits.points[rows], self.setting.direct, keys)] if len(rows) else ()
            if len(rows):
                reach = np.sqrt(np.einsum("nii->ni", spread[rows])) * self.setting.grid.widths
                sides = np.concatenate([np.eye(reach.shape[1]), -np.eye(reach.shape[1])])
                tried = orbits.points[rows][:, None, :] + reach[:, None, :] * sides
                tried = wrap(tried.reshape(-1, reach.shape[1]), self.setting.direct.coordinates)
                labels = settle(self.setting.direct, Orbits.starting(tried), self.setting.catalogue, _SOON).labels
                found[rows[(labels.reshape(len(rows), -1) == number).all(axis=1)]] = number

    def _widen(self, points: Floats, spread: Floats, errors: Floats) -> None:
        """Carry errors over a period; where the table has no derivatives, with differences of the exact map."""
        assert self.bounds is not None
        unknown = np.empty(len(points), bool)
        widening(points.shape[1])(
            points, spread, self.setting.place, self.bounds.slopes, self.bounds.bends, errors, unknown
        )
        rest = np.flatnonzero(unknown)
        if not len(rest):
            return
        reach = np.sqrt(np.einsum("nii->n", spread[rest]))
        steps = np.clip(reach, SMALLEST, _WIDEST)
        slopes, bends = slopes_of(self.setting.direct, points[rest], self.setting.grid.widths, steps)
        tolerances = tolerance_in_cells(self.setting.direct, points[rest], self.setting.grid)
        wider = spread[rest]
        carry_rows(wider, slopes, tolerances + bends * reach)
        spread[rest] = wider

    def _direct_labels(self, rows: Ints) -> NDArray[np.int16]:
        setting, bar = self.setting, f"integrating {self.name}" if self.progress else None
        initial_conditions = self.initial_conditions.points(rows)
        found = classify(
            setting.exact,
            setting.catalogue,
            initial_conditions,
            self.periods,
            size=CHUNK // 64,
            progress=bar,
            at_last=self._at_last,
        )
        self.tally = self.tally.plus(found.tally)
        return found.labels
