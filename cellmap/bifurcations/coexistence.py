"""Attractors at many parameter points: orbits, periodic points and regions of attraction, all in SIMD lanes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.stopping import check_stop
from .._lib.threads import progress_bar, run_over, slices
from ..maps.coordinates import turns_of, wrap
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..orbits.ellipsoids import Regions, monodromy_of, regions_around
from ..orbits.lyapunov_qr import exponents_along
from ..orbits.newton import followed, least_periods, newton, return_distances
from .atlas_families import AtlasKind, Attractors, Directory

_PILOTS = 8  # one of so many orbits goes ahead, so that regions are known in which the others converge,
_AHEAD = 48  # by so many periods
_FIRST_LOOKS = (16, 32)  # periods before attractors are searched for, by those ahead and by the others,
_RARER = 1.25  # and factor of age between searches, at least
_STRIDES = (4, 3, 4)  # periods in turn between tests of convergence, so that cycles are met at all of their phases
_SAME_MEAN = 1e-4  # distance of means over orbits, in extents or radians, within which two attractors are one

_NEAR = 0.05  # distance from its image, in extents, from which a point is refined,
_REACH = 0.25  # and to which, at most
_ALIKE = 0.1  # part by which a longer period has to close an orbit better to be tried in place of a shorter one
_SAME = 1e-6  # distance, in extents, within which points are equal
_STABLE = 1.0 - 1e-6
_LED = 0.3  # distance of means over orbits within which an attractor leads to its neighbour
_EXPONENT_PERIODS = 200
_ZERO = 0.01  # size of an exponent per period that counts as zero
_SLICE = 256
_KNOWN = 0.1  # distance of means over orbits, in extents or radians, within which a neighbour needs no search
_WEAK = -0.02  # exponent per step from which orbits that approach a periodic attractor look quasi-periodic


@dataclass(frozen=True, eq=False)
class Explorer:
    """Search for the attractors of parameter points: a pure function of these."""

    swept: PointMap
    initial_conditions: Floats
    extent: Floats
    max_periods: int
    longest_period: int

    def __call__(self, values: Floats) -> tuple[Attractors, Ints, Ints]:
        """Return attractors at parameter points (n, 2), and the numbers (n,) of escaped and undecided orbits."""
        return _Search(self, values).run()

    def continued(self, attractors: Attractors, values: Floats, place: Ints) -> tuple[Attractors, Ints]:
        """Return the periodic attractors to which others lead at parameter points, and the rows of these."""
        states = np.column_stack([attractors.point, values[place]])
        found, rows = periodic_attractors(self, states, place, attractors.period)[:2]
        source = attractors[rows]
        same = (found.period == source.period) & (found.rotations == source.rotations).all(axis=-1)
        near = np.abs(found.centre - source.centre).max(axis=-1, initial=0.0) <= _LED
        kept = np.flatnonzero(same & near)
        return found[kept], rows[kept]


@dataclass(eq=False)
class _Search:
    """State of a search: orbits that have not converged, attractors with their regions, and counts."""

    job: Explorer
    values: Floats
    orbits: Orbits = field(init=False)
    place: Ints = field(init=False)
    found: Attractors = field(init=False)
    regions: Regions = field(init=False)
    looks: int = 0

    def __post_init__(self) -> None:
        n, d = self.job.initial_conditions.shape
        self.place = np.repeat(np.arange(len(self.values)), n)
        states = np.column_stack([np.tile(self.job.initial_conditions, (len(self.values), 1)), self.values[self.place]])
        self.orbits = Orbits.starting(wrap(states, self.job.swept.coordinates))
        self.found, self.regions = Attractors.empty(d), Regions.empty(d)
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

    def _attractors(self, states: Floats, place: Ints) -> tuple[Attractors, Regions]:
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
            return Attractors.empty(d), Regions.empty(d)
        fresh = fresh[rows]
        regions = regions_around(job.swept, orbit[rows], matrices[rows], fresh.period, fresh.place, job.extent)
        held = np.flatnonzero(regions.has_any(len(rows)))
        return fresh[held], regions.renumbered(held, len(rows))

    def _known(self, fresh: Attractors) -> Bools:
        """Return which attractors have been found before, perhaps from another of their points."""
        species = np.concatenate([self.found.period, fresh.period])
        known = Directory.of(self.found, species[: len(self.found)], int(species.max(initial=0)) + 1)
        return known.nearest(fresh.period, fresh.centre, fresh.place, _SAME_MEAN) >= 0

    def _rest(self) -> Ints:
        """Classify the orbits that never converged, by the largest exponent of one at each parameter point."""
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
        return undecided


def periodic_attractors(
    job: Explorer, states: Floats, place: Ints, period: Ints
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


def _centres(job: Explorer, orbit: Floats, period: Ints) -> Floats:
    """Return means (n, 2 d) over orbits, which do not depend on their phase: of states, or of cosines and sines."""
    d = len(job.extent)
    states, turn = orbit[..., :d], turns_of(job.swept.coordinates)[1][:d]
    phase = 2.0 * np.pi * states / np.where(turn > 0.0, turn, 1.0)
    first = np.where(turn > 0.0, np.cos(phase), states / job.extent)
    both = np.concatenate([first, np.where(turn > 0.0, np.sin(phase), 0.0)], axis=-1)
    members = (np.arange(orbit.shape[1]) < period[:, None])[..., None]
    return np.asarray(np.where(members, both, 0.0).sum(axis=1) / period[:, None])


def spread(
    job: Explorer, values: Floats, shape: tuple[int, int], found: Attractors, progress: str | None
) -> Attractors:
    """Return the attractors with those, counted 0 times, to which periodic ones of neighbouring points lead.

    ``values`` (ny * nx, 2) are the parameters.  From where an attractor is known, Newton's method looks for it at the
    neighbours where nothing like it is known; what it finds there leads further.
    """
    front, kinds = np.flatnonzero(found.period > 0), Directory.of(found).species
    with progress_bar(sum(shape), progress) as tick:
        while len(front):
            check_stop()
            directory = Directory.of(found, kinds)
            source, there = _neighbours(found, directory, front, shape)
            parts: dict[int, tuple[Attractors, Ints]] = {}

            def work(part: slice) -> None:
                parts[part.start] = job.continued(found[source[part]], values, there[part])  # noqa: B023

            run_over(slices(len(there), _SLICE), work)
            new = [(attractors, source[begin + rows]) for begin, (attractors, rows) in sorted(parts.items())]
            front = np.empty(0, np.int64)
            if new:
                fresh = Attractors.joined(*(attractors for attractors, _ in new))
                species = directory.species[np.concatenate([rows for _, rows in new])]
                columns = np.column_stack([fresh.place, species, np.round(fresh.centre / _SAME_MEAN)])
                once = np.unique(columns, axis=0, return_index=True)[1]
                fresh, species = fresh[once], species[once]
                kept = np.flatnonzero(directory.nearest(species, fresh.centre, fresh.place, _SAME_MEAN) < 0)
                fresh, kinds = fresh[kept], np.concatenate([kinds, species[kept]])
                front = np.arange(len(found), len(found) + len(fresh))
                found = Attractors.joined(found, fresh)
            tick(1)
    return found


def _neighbours(found: Attractors, directory: Directory, front: Ints, shape: tuple[int, int]) -> tuple[Ints, Ints]:
    """Return attractors of a front, and neighbours of their parameter points where none like them is known."""
    ny, nx = shape
    row, column = found.place[front] // nx, found.place[front] % nx
    sources, places = [], []
    for down, right in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        inside = (row + down >= 0) & (row + down < ny) & (column + right >= 0) & (column + right < nx)
        sources.append(front[inside])
        places.append(found.place[front[inside]] + down * nx + right)
    source, there = np.concatenate(sources), np.concatenate(places)
    new = directory.nearest(directory.species[source], found.centre[source], there, _KNOWN) < 0
    return source[new], there[new]


def slow_ones(found: Attractors) -> Bools:
    """Return the rows counted as quasi-periodic whose orbits may approach a periodic attractor slowly."""
    with np.errstate(divide="ignore"):
        exponent = np.log(found.modulus) / np.maximum(found.period, 1)
    weak = (found.period > 0) & (exponent > _WEAK)
    return (found.kind == AtlasKind.QUASIPERIODIC) & np.isin(found.place, found.place[weak])
