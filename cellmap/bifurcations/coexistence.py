"""Attractors at many parameter points: orbits, periodic points and regions of attraction, all in SIMD lanes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.stopping import check_stop
from ..maps.compiled_advance import recorded
from ..maps.coordinates import difference, turns_of, wrap
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..orbits.ellipsoids import ParameterRegions, monodromy_of, regions_around
from ..orbits.invariant_circle import bump, signals_of
from ..orbits.lyapunov_qr import exponents_along
from ..orbits.newton import followed, least_periods, newton, return_distances
from .atlas_families import AtlasKind, Attractors, Directory

_PILOTS = 8  # one of so many orbits goes ahead, so that regions are known in which the others converge,
_AHEAD = 48  # by so many periods
_FIRST_LOOKS = (16, 32)  # periods before attractors are searched for, by those ahead and by the others,
_RARER = 1.25  # and factor of age between searches, at least
_STRIDES = (4, 3, 4)  # periods in turn between tests of convergence, so that cycles are met at all of their phases
SAME_MEAN = 1e-4  # distance of means over orbits, in extents or radians, within which two attractors are one

_NEAR = 0.05  # distance from its image, in extents, from which a point is refined,
_REACH = 0.25  # and to which, at most
_ALIKE = 0.1  # part by which a longer period has to close an orbit better to be tried in place of a shorter one
_SAME = 1e-6  # distance, in extents, within which points are equal
_STABLE = 1.0 - 1e-6
_PARTS = 8  # of the way to a neighbouring parameter point, in which an attractor is followed
_EXPONENT_PERIODS = 200
_ZERO = 0.01  # size of an exponent per period that counts as zero
_RETURNS = 64  # steps up to which orbits are compared with themselves later on
# Part by which a mean square distance may change from one stretch of an orbit on a torus to the next: that of an orbit
# beside a degenerate pitchfork, which shrinks with the fourth root of its age, changes by 0.18.
_STEADY = 0.1


@dataclass(frozen=True, eq=False)
class AttractorSearch:
    """Search for the attractors of parameter points: a pure function of these."""

    swept: PointMap
    initial_conditions: Floats
    extent: Floats
    max_periods: int
    longest_period: int

    def __call__(self, values: Floats) -> tuple[Attractors, Ints, Ints]:
        """Return attractors at parameter points (n, 2), and the numbers (n,) of escaped and undecided orbits."""
        return _SearchState(self, values).run()

    def continued(self, attractors: Attractors, start: Floats, end: Floats, place: Ints) -> tuple[Attractors, Ints]:
        """Return the periodic attractors at parameter points (n, 2) to which others lead, and the rows of these.

        They are followed in parts of the way from where they are, so that one that moves far is not lost.
        """
        d, rows = len(self.extent), np.arange(len(attractors))
        points, moved = attractors.point, np.zeros((len(attractors), d))
        for part in np.arange(1, _PARTS) / _PARTS:
            states = np.column_stack([points + moved, start[rows] + part * (end - start)[rows]])
            solved, good = newton(self.swept, states, attractors.period[rows], self.extent, _REACH, attracting=True)
            moved = difference(solved[good, :d], points[good], self.swept.coordinates[:d])
            points, rows = solved[good, :d], rows[good]
        states = np.column_stack([points + moved, end[rows]])
        found, kept = periodic_attractors(self, states, place[rows], attractors.period[rows])[:2]
        rows = rows[kept]
        same = (found.period == attractors.period[rows]) & (found.rotations == attractors.rotations[rows]).all(axis=-1)
        return found[np.flatnonzero(same)], rows[same]


@dataclass(eq=False)
class _SearchState:
    """State of a search: orbits that have not converged, attractors with their regions, and counts."""

    job: AttractorSearch
    values: Floats
    orbits: Orbits = field(init=False)
    place: Ints = field(init=False)
    found: Attractors = field(init=False)
    regions: ParameterRegions = field(init=False)
    looks: int = 0

    def __post_init__(self) -> None:
        n, d = self.job.initial_conditions.shape
        self.place = np.repeat(np.arange(len(self.values)), n)
        states = np.column_stack([np.tile(self.job.initial_conditions, (len(self.values), 1)), self.values[self.place]])
        self.orbits = Orbits.starting(wrap(states, self.job.swept.coordinates))
        self.found, self.regions = Attractors.empty(d), ParameterRegions.empty(d)
        self.escaped = np.zeros(len(self.values), np.int64)

    @property
    def dimension(self) -> int:
        return self.job.initial_conditions.shape[1]

    def run(self) -> tuple[Attractors, Ints, Ints]:
        """Iterate the orbits until they have converged, some of each parameter point ahead of the others."""
        number = np.arange(len(self.place)) % len(self.job.initial_conditions)
        ahead = (number + number // _PILOTS) % _PILOTS == 0  # across the rows and columns of a grid
        others = self.orbits[~ahead], self.place[~ahead]
        self._keep(ahead)
        middle, end = min(_AHEAD, self.job.max_periods), self.job.max_periods
        self._iterate(0, middle, _FIRST_LOOKS[0])
        pilots, (self.orbits, self.place) = (self.orbits, self.place), others
        self._iterate(0, middle, _FIRST_LOOKS[1])
        self._join(*pilots)
        self._iterate(middle, end, middle)
        undecided = self._rest() if len(self.place) else np.zeros(len(self.values), np.int64)
        return self.found, self.escaped, undecided

    def _iterate(self, age: int, end: int, due: float) -> None:
        """Iterate orbits from one age to another one, unless all converge, and look for attractors from an age on."""
        tests = 0
        while len(self.place) and age < end:
            check_stop()
            step = min(_STRIDES[tests % len(_STRIDES)], end - age)
            self.job.swept.advance(self.orbits, step)
            age, tests = age + step, tests + 1
            self._end_escaped()
            self._capture()
            if age >= due and len(self.place):
                if self._look():
                    self._capture()
                due = _RARER * age

    def _join(self, orbits: Orbits, place: Ints) -> None:
        """Put orbits to the others, sorted by parameter point."""
        both = Orbits.joined([self.orbits, orbits])
        place = np.concatenate([self.place, place])
        order = np.argsort(place, kind="stable")
        self.orbits, self.place = both[order], place[order]

    def _keep(self, rows: Bools) -> None:
        self.orbits, self.place = self.orbits[rows], self.place[rows]

    def _end_escaped(self) -> None:
        alive = self.orbits.alive
        if not alive.all():
            np.add.at(self.escaped, self.place[~alive], 1)
            self._keep(alive)

    def _capture(self) -> None:
        """Count the orbits that are in the region of an attractor of their parameter point, and end them."""
        owner = self.regions.owners(self.orbits.points[:, : self.dimension], self.place, self.job.swept.coordinates)
        np.add.at(self.found.count, owner[owner >= 0], 1)
        self._keep(owner < 0)

    def _look(self) -> bool:
        """Refine one orbit of each parameter point that has any; tell whether that has led to attractors."""
        first = np.flatnonzero(np.diff(self.place, prepend=-1))
        number = np.diff(np.append(first, len(self.place)))
        chosen = first + self.looks * 7 % number
        self.looks += 1
        fresh, regions = self._attractors(self.orbits.points[chosen], self.place[chosen])
        if not len(fresh):
            return False
        self.regions = self.regions.with_more(regions, len(self.found), len(self.values))
        self.found = Attractors.joined(self.found, fresh)
        return True

    def _attractors(self, states: Floats, place: Ints) -> tuple[Attractors, ParameterRegions]:
        """Return the attracting periodic orbits beside states (n, d + 2) that are not known, with their regions."""
        job, d = self.job, self.dimension
        apart = return_distances(job.swept, states, job.longest_period, job.extent)
        best = np.argmax(apart * _ALIKE <= apart.min(axis=0), axis=0)
        near = np.flatnonzero(np.take_along_axis(apart, best[None], axis=0)[0] <= _NEAR)
        fresh, _, orbit, matrices = periodic_attractors(job, states[near], place[near], best[near] + 1)
        unknown = self.regions.owners(fresh.point, fresh.place, job.swept.coordinates) < 0
        rows = np.flatnonzero(unknown)
        rows = rows[~self._known(fresh[rows])]
        if not len(rows):
            return Attractors.empty(d), ParameterRegions.empty(d)
        fresh = fresh[rows]
        regions = regions_around(job.swept, orbit[rows], matrices[rows], fresh.period, fresh.place, job.extent)
        held = np.flatnonzero(regions.has_any(len(rows)))
        return fresh[held], regions.renumbered(held, len(rows))

    def _known(self, fresh: Attractors) -> Bools:
        """Return which attractors have been found before, perhaps from another of their points."""
        species = np.concatenate([self.found.period, fresh.period])
        known = Directory.of(self.found, species[: len(self.found)], int(species.max(initial=0)) + 1)
        return known.nearest(fresh.period, fresh.centre, fresh.place, SAME_MEAN) >= 0

    def _rest(self) -> Ints:
        """Classify the orbits that never converged, by the largest exponent of one at each parameter point.

        One whose exponent is zero is quasi-periodic only if it is seen to stay on a torus.  Those that return to where
        they are, on unstable periodic orbits such as there are on symmetry lines, are on no attractor.
        """
        apart = return_distances(self.job.swept, self.orbits.points, self.job.longest_period, self.job.extent)
        wandering = apart.min(axis=0) > _SAME
        closed = np.bincount(self.place[~wandering], minlength=len(self.values))
        self._keep(wandering)
        if not wandering.any():
            return closed
        undecided = np.bincount(self.place, minlength=len(self.values))
        first = np.flatnonzero(np.diff(self.place, prepend=-1))
        places, d = self.place[first], self.dimension
        periods = np.full(len(first), _EXPONENT_PERIODS)
        orbit, matrices, _ = followed(self.job.swept, self.orbits.points[first], periods, d)
        exponents, errors = exponents_along(matrices)
        largest, error = exponents[:, 0], errors[:, 0]
        with np.errstate(invalid="ignore"):
            chaotic = largest > np.maximum(_ZERO, 5.0 * error)
            neutral = np.abs(largest) <= _ZERO
        neutral[neutral] = self._stays_on_torus(orbit[neutral, -1])
        rows = np.flatnonzero(chaotic | neutral)
        kind = np.where(chaotic, AtlasKind.CHAOTIC, AtlasKind.QUASIPERIODIC).astype(np.int8)
        no_rotations = np.zeros((len(rows), d), np.int64)
        rest = Attractors(
            places[rows],
            kind[rows],
            np.zeros(len(rows), np.int64),
            no_rotations,
            orbit[rows, -1, :d],
            np.zeros((len(rows), 2 * d)),
            np.exp(largest[rows]),
            undecided[places[rows]],
        )
        undecided[places[rows]] = 0
        self.found = Attractors.joined(self.found, rest)
        return undecided + closed

    def _stays_on_torus(self, states: Floats) -> Bools:
        """Tell which orbits from states (n, d + 2), whose exponent is zero, move on a torus, and not towards an orbit.

        On a torus the mean square distance between an orbit and itself some steps later, by weighted averages over as
        many periods as orbits have lasted, is the same in the next as many (Das, Saiki, Sander, Yorke 2017).  Beside an
        orbit to which it comes slowly, that after its period shrinks.  A line has no torus.
        """
        swept, d, n = self.job.swept, self.dimension, self.job.max_periods
        angles = turns_of(swept.coordinates)[1][:d] > 0.0
        if not len(states) or (d == 1 and not angles.any()):
            return np.zeros(len(states), bool)
        orbits = Orbits.starting(states.copy())
        history = np.concatenate([points for points, *_ in recorded(swept.advance, orbits, 2 * n + _RETURNS)])
        signals = signals_of(history[..., :d], swept.coordinates[:d]) / np.where(angles, 1.0, self.job.extent)
        weights, steady = bump(n), orbits.alive.copy()
        for q in range(1, _RETURNS + 1):
            apart = (np.abs(signals[q : 2 * n + q] - signals[: 2 * n]) ** 2).sum(axis=-1).reshape(2, n, -1)
            first, second = np.einsum("k,skr->sr", weights, apart)
            steady &= (np.abs(second - first) <= _STEADY * np.maximum(first, second)) & (second > _SAME**2)
        return steady


def periodic_attractors(
    job: AttractorSearch, states: Floats, place: Ints, period: Ints
) -> tuple[Attractors, Ints, Floats, Floats]:
    """Return the stable periodic orbits beside states (n, d + 2), the rows of their states, orbits and derivatives."""
    d = len(job.extent)
    points, good = newton(job.swept, states, period, job.extent, _REACH, attracting=True)
    rows = np.flatnonzero(good)
    orbit, matrices, rotations = followed(job.swept, points[rows], period[rows], d)
    least = least_periods(job.swept, orbit, period[rows], _SAME * job.extent)
    modulus = np.abs(np.linalg.eigvals(monodromy_of(matrices, least, np.arange(len(rows))))).max(axis=-1, initial=0.0)
    stable = np.flatnonzero(modulus < _STABLE)
    rows, orbit, matrices, least = rows[stable], orbit[stable], matrices[stable], least[stable]
    wound = rotations[stable, least - 1]
    kind = np.where(wound.any(axis=-1), AtlasKind.ROTATING, AtlasKind.PERIODIC).astype(np.int8)
    centre = _centres(job, orbit, least)
    counts = np.zeros(len(rows), np.int64)
    found = Attractors(place[rows], kind, least, wound, orbit[:, 0, :d], centre, modulus[stable], counts)
    return found, rows, orbit, matrices


def _centres(job: AttractorSearch, orbit: Floats, period: Ints) -> Floats:
    """Return means (n, 2 d) over orbits, which do not depend on their phase: of states, or of cosines and sines."""
    d = len(job.extent)
    states, turn = orbit[..., :d], turns_of(job.swept.coordinates)[1][:d]
    phase = 2.0 * np.pi * states / np.where(turn > 0.0, turn, 1.0)
    first = np.where(turn > 0.0, np.cos(phase), states / job.extent)
    both = np.concatenate([first, np.where(turn > 0.0, np.sin(phase), 0.0)], axis=-1)
    members = (np.arange(orbit.shape[1]) < period[:, None])[..., None]
    return np.asarray(np.where(members, both, 0.0).sum(axis=1) / period[:, None])
