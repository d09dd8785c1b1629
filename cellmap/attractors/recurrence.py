"""Quasi-periodic attractors in many dimensions, by recurrence: time averages of orbits and of others beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.stopping import check_stop
from ..maps.compiled_advance import recorded
from ..maps.coordinates import difference, turns_of, wrap
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..maps.side_by_side import advance_on_threads
from ..orbits.attractor import Attractor, Kind, Neighbourhood
from ..orbits.invariant_circle import bump, circle_through, closed_after, signals_of
from ..orbits.lyapunov_qr import BLOCKS
from .lyapunov_regions import Afford, always
from .quotients import quotient_by
from .settling import Catalogue

_ORBITS = 32  # followed in one look
_PERIODS = 512  # that are recorded
_AT_ONCE = 64  # periods between looks whether the end was asked for
_REGULAR = 1e-2  # difference of the averages of both halves, in units of an orbit's size, of one that is regular
_SMALL = 0.01  # least size of an orbit, in units of the region
_SAME = 0.02  # difference of averages of orbits on one attractor, in these units
_WIDTHS = (0.02, 0.0025, 0.0003)  # of regions where an attractor has none, in units of the region, one after the other
_MOST_PIECES = 8  # of an attractor, which the map permutes,
_SECTORS = 12  # of an angle that makes full rotations
_SPREAD = 0.5  # length of the mean of points on the unit circle below which they are spread all over it
_TIGHT = 1.2  # and how much larger they may be than those of other numbers of pieces
_LOOSE = 1.1  # factor by which a region is larger than the points seen
_BESIDE = 4  # orbits that begin in a region
_AVERAGED, _RETURNING = 256, 128  # periods over which their averages are taken, twice, and those between
_CLOSER = 0.5  # factor by which averages have to come closer meanwhile where an attractor attracts slowly
_FRAME = 4  # directions in which growth is seen
_APART = 1e-5  # distance of orbits beside one another, in units of the region
_GROWING = 256  # periods of growth
_ZERO = 0.01  # largest size of an exponent that may be zero
_KEPT = 512  # points of an attractor
_BALL = 1e-4  # radius around a cycle that nothing verifies, in units of the region

CLOSED = 1e-6
"""Part of the region within which an orbit has closed by itself."""


@dataclass(frozen=True, eq=False)
class _Averages:
    """Time averages (n, k) of orbits, by the weights of Das and others (2017), the error of each, and sizes (n, k)."""

    values: Floats
    errors: Floats
    sizes: Floats

    @classmethod
    def of(cls, history: Floats, point_map: PointMap, extent: Floats) -> _Averages:
        """Average the coordinates of orbits (periods, n, d), and their squares about the mean."""
        turn = turns_of(point_map.coordinates)[1]
        unit = np.where(turn > 0, 1.0, extent)
        periods, d = len(history), history.shape[-1]
        signals = signals_of(history.reshape(-1, d), point_map.coordinates).reshape(history.shape) / unit
        signals = np.concatenate([signals.real, signals.imag[..., turn > 0]], axis=-1)
        sizes = np.maximum(np.ptp(signals, axis=0), _SMALL)
        centred = (signals - signals.mean(axis=0)) / sizes
        half = periods // 2
        early, late = (
            np.concatenate([np.tensordot(bump(half), part, 1), np.tensordot(bump(half), part**2, 1)], axis=-1)
            for part in (centred[:half], centred[half : 2 * half])
        )
        mean = signals.mean(axis=0) / sizes
        whole = np.tensordot(bump(periods), centred, 1) + mean
        return cls(whole * sizes, np.abs(early - late), sizes)

    @property
    def regular(self) -> Bools:
        """Which orbits are regular: the averages of both halves are the same."""
        return np.asarray((self.errors <= _REGULAR).all(axis=1))

    def apart(self, other: _Averages, k: int) -> Floats:
        """Return the differences (n,) of the averages of other orbits from those of orbit k."""
        return np.asarray((np.abs(other.values - self.values[k]) / self.sizes[k]).max(axis=1))


def recurrent_attractors(
    exact: PointMap,
    states: Floats,
    extent: Floats,
    age: int,
    known: Sequence[Attractor],
    afford: Afford = always,
) -> tuple[list[Attractor], list[tuple[Floats, int]]]:
    """Return the quasi-periodic attractors on which orbits of some age are, and cycles that they are on instead.

    Up to 32 orbits are followed for as long again, and for 512 periods more.  One whose time averages over both halves
    of these are the same is regular; those with the same averages are on one attractor.  It is quasi-periodic where its
    largest Lyapunov exponent is zero within 0.01 and one of the next ones is negative, as seen from orbits beside it
    (Benettin, Galgani, Strelcyn 1976).  Its region are ellipsoids of its pieces, or of sectors of an angle that makes
    full rotations.  Four orbits that begin at the surface of the region must have the same averages in the end, or
    come closer to them; else it becomes narrower.  Where one cannot `afford` these, the region is the narrowest.

    The region is not a trapping region: nothing verifies that no orbit leaves it, and its `contraction` is 1.  All this
    takes some thousand images for each attractor, in any number of dimensions.
    """
    rows = np.unique(np.linspace(0, len(states) - 1, _ORBITS).round().astype(int))
    if not afford(len(rows) * age):
        return [], []
    orbits = Orbits.starting(states[rows])
    _move(exact, orbits, age)
    outside = orbits.alive.copy()
    outside[outside] = Catalogue.of(known, exact).owners_of(orbits.points[outside]) < 0
    orbits = orbits[np.flatnonzero(outside)]
    places = _places_of(known, exact.dimension)
    if not len(orbits) or not afford((len(orbits) + len(places)) * _PERIODS):
        return [], []
    number, orbits = len(orbits), Orbits.joined([orbits, Orbits.starting(places.copy())])
    history, rotations = _history(exact, orbits, _PERIODS)
    alive = orbits.alive
    history, rotations, new = history[:, alive], rotations[:, alive], (np.arange(len(alive)) < number)[alive]
    averages = _Averages.of(history, exact, extent)
    chosen, cycles = list[int](), list[tuple[Floats, int]]()
    seen = ~new
    for k in np.flatnonzero(averages.regular & new):
        path = history[:, k]
        if (averages.apart(averages, int(k))[seen] <= _SAME).any():
            continue
        period = closed_after(path, exact, extent)
        if period:
            cycles.append((path[-1], period))
        elif afford((_FRAME + 1) * _GROWING):
            chosen.append(int(k))
        seen[k] = True
    exponents, _ = leading_exponents(exact, history[-1, chosen], extent)
    good = (np.abs(exponents[:, 0]) <= _ZERO) & (exponents.min(axis=1) < -_ZERO)
    chosen, exponents = [k for k, g in zip(chosen, good, strict=True) if g], exponents[good]
    hulls = [_Hulls.of(exact, history[:, k], rotations[:, k], extent) for k in chosen]
    regions = _regions(exact, hulls, averages, chosen, extent, afford)
    found = [
        _attractor(exact, history[:, k], rotations[:, k], largest, region)
        for k, largest, region in zip(chosen, exponents[:, :1], regions, strict=True)
        if region is not None
    ]
    return found, cycles


def closed_attractors(
    exact: PointMap, points: Floats, periods: Ints, known: Sequence[Attractor], extent: Floats
) -> list[Attractor]:
    """Return the cycles on which orbits have closed, where Newton's method cannot be afforded any more.

    Nothing but that an orbit came back to its point (n, d) after a period (n,) says that they attract: their
    multipliers are NaN, and their regions small balls.
    """
    found, d = list[Attractor](), exact.dimension
    for point, period in zip(points, periods.tolist(), strict=True):
        orbits = Orbits.starting(point[None].copy())
        history, rotations = _history(exact, orbits, period)
        path = np.concatenate([point[None], history[:-1, 0]])
        apart = np.abs(difference(orbits.points[0], point, exact.coordinates)) / extent
        mine = Catalogue.of([*known, *found], exact).owners_of(path)
        if not apart.max() <= CLOSED or (mine >= 0).any():
            continue
        turned = tuple(rotations[-1, 0].tolist())
        kind = Kind.ROTATING if any(turned) else Kind.FIXED_POINT if period == 1 else Kind.PERIODIC
        path = np.roll(path, -int(np.argmin(np.linalg.norm(path / extent, axis=1))), axis=0)
        region = Neighbourhood(path, np.tile(np.diag((_BALL * extent) ** -2.0), (period, 1, 1)), 1.0)
        found.append(
            Attractor(
                kind, period, path, turned, np.full(d, np.nan + 0j), np.full(d, np.nan), exact.coordinates, region
            )
        )
    return found


def averaged_owners(exact: PointMap, states: Floats, known: Sequence[Attractor]) -> Ints:
    """Return the number of the attractor found by recurrence whose time averages orbits have, -1 for none.

    Orbits from states (n, d) are followed for 512 periods, and so are those of the attractors.  In this way orbits are
    decided that are in no region of an attractor: these are narrow where nothing verifies them.
    """
    numbers = [k for k, a in enumerate(known) if _is_recurrent(a)]
    owners = np.full(len(states), -1)
    if not numbers or not len(states):
        return owners
    if (quotient := quotient_by(exact, known)) is not None:
        known = [quotient.lowered(a) for a in known]
        return averaged_owners(quotient.point_map, quotient.projected(states), known)
    orbits = Orbits.starting(np.concatenate([_places_of(known, exact.dimension), states]))
    history, _ = _history(exact, orbits, _PERIODS)
    size = np.ptp(np.concatenate([known[k].points for k in numbers]), axis=0)
    averages = _Averages.of(history, exact, np.where(size > 0.0, size, 1.0))
    apart = np.array([averages.apart(averages, j)[len(numbers) :] for j in range(len(numbers))])
    nearest = np.argmin(np.where(np.isnan(apart), np.inf, apart), axis=0)
    same = apart[nearest, np.arange(len(states))] <= _SAME
    return np.where(same & orbits.alive[len(numbers) :], np.array(numbers)[nearest], owners)


def _is_recurrent(attractor: Attractor) -> bool:
    return attractor.kind is Kind.QUASIPERIODIC and attractor.neighbourhood is not None


def _places_of(known: Sequence[Attractor], dimension: int) -> Floats:
    """Return a point of each attractor that was found by recurrence."""
    return np.array([a.points[-1] for a in known if _is_recurrent(a)]).reshape(-1, dimension)


def _attractor(exact: PointMap, path: Floats, rotations: Ints, exponents: Floats, region: Neighbourhood) -> Attractor:
    """Return the attractor of a regular orbit (periods, d)."""
    return Attractor(
        Kind.QUASIPERIODIC,
        0,
        path[-_KEPT:],
        (0,) * exact.dimension,
        np.empty(0, complex),
        exponents,
        exact.coordinates,
        neighbourhood=region,
        circle=circle_through(exact, path, rotations),
    )


@dataclass(frozen=True, eq=False)
class _Hulls:
    """Ellipsoids around the pieces of a regular orbit (periods, d), as many of them as wanted."""

    exact: PointMap
    path: Floats
    pieces: Sequence[Ints]
    extent: Floats

    @classmethod
    def of(cls, exact: PointMap, path: Floats, rotations: Ints, extent: Floats) -> _Hulls:
        """Cut the orbit into pieces."""
        return cls(exact, path, _pieces(exact, path, np.abs(np.ptp(rotations, axis=0)) > 0, extent), extent)

    def of_width(self, width: float) -> Neighbourhood:
        """Return the ellipsoids of a width."""
        return _hull(self.exact, self.path, self.pieces, self.extent, width)


def _regions(
    exact: PointMap, hulls: Sequence[_Hulls], averages: _Averages, chosen: Sequence[int], extent: Floats, afford: Afford
) -> list[Neighbourhood | None]:
    """Return the widest region of each orbit to which others come back, None where there is none."""
    found: list[Neighbourhood | None] = [None] * len(hulls)
    left = list(range(len(hulls)))
    for width in _WIDTHS:
        tried = [j for j in left if afford(_BESIDE * (2 * _AVERAGED + _RETURNING))]
        for j in set(left) - set(tried):
            found[j] = hulls[j].of_width(_WIDTHS[-1])
        regions = [hulls[j].of_width(width) for j in tried]
        back = _all_return(exact, regions, averages, [chosen[j] for j in tried], extent)
        for j, region, good in zip(tried, regions, back, strict=True):
            found[j] = region if good else None
        left = [j for j, good in zip(tried, back, strict=True) if not good]
    return found


def _pieces(exact: PointMap, path: Floats, turning: Bools, extent: Floats) -> list[Ints]:
    """Return rows of the parts of an attractor that get an ellipsoid each.

    They are sectors of an angle that makes full rotations, the one that leaves the least spread, or pieces that the map
    permutes.
    """
    lower, turn = turns_of(exact.coordinates)
    candidates = [[np.arange(k, len(path), number) for k in range(number)] for number in range(1, _MOST_PIECES + 1)]
    if turning.any():
        sector = np.floor((path - lower) / np.where(turn > 0, turn, 1.0) * _SECTORS)
        candidates = [[np.flatnonzero(s == k) for k in np.unique(s)] for s in sector.T[turning]]
    spread = [
        sum(len(rows) * float((_about_mean(exact, path[rows])[1] / extent).var(axis=0).sum()) for rows in parts)
        for parts in candidates
    ]
    return candidates[int(np.argmax(np.array(spread) <= _TIGHT * min(spread)))]


def _about_mean(exact: PointMap, points: Floats) -> tuple[Floats, Floats]:
    """Return the mean of points, that on the circle for angles, and the points as seen from there."""
    turn = turns_of(exact.coordinates)[1]
    mean = signals_of(points, exact.coordinates).mean(axis=0)
    centre = np.where(turn > 0, np.angle(mean) * turn / (2 * np.pi), mean.real)
    return wrap(centre, exact.coordinates), difference(points, centre, exact.coordinates)


def _hull(exact: PointMap, path: Floats, pieces: Sequence[Ints], extent: Floats, width: float) -> Neighbourhood:
    """Return ellipsoids that hold the pieces of an orbit, across angles all over which a piece is spread."""
    turn = turns_of(exact.coordinates)[1]
    centres, metrics = [], []
    for rows in pieces:
        centre, shift = _about_mean(exact, path[rows])
        kept = ~((turn > 0) & (np.abs(signals_of(path[rows], exact.coordinates).mean(axis=0)) < _SPREAD))
        shift, unit = shift[:, kept] / extent[kept], extent[kept]
        form = np.linalg.inv(shift.T @ shift / len(shift) + width**2 * np.eye(len(unit)))
        size = _LOOSE * max(1.0, float(np.sqrt(np.einsum("ni,ij,nj->n", shift, form, shift).max())))
        metric = np.zeros((len(turn), len(turn)))
        metric[np.ix_(kept, kept)] = 0.5 * (form + form.T) / size**2 / np.outer(unit, unit)
        centres.append(centre)
        metrics.append(metric)
    return Neighbourhood(np.array(centres), np.array(metrics), 1.0)


def _all_return(
    exact: PointMap,
    regions: Sequence[Neighbourhood],
    averages: _Averages,
    chosen: Sequence[int],
    extent: Floats,
) -> Bools:
    """Tell of which regions (n,) orbits from the surface come to the averages of the `chosen` orbits, or closer."""
    if not regions:
        return np.zeros(0, bool)
    begin = np.concatenate([_surface(region, extent) for region in regions])
    orbits = Orbits.starting(wrap(begin, exact.coordinates))
    early, _ = _history(exact, orbits, _AVERAGED)
    _move(exact, orbits, _RETURNING)
    late, _ = _history(exact, orbits, _AVERAGED)
    before, after = (_Averages.of(np.nan_to_num(h), exact, extent) for h in (early, late))
    good = np.zeros(len(regions), bool)
    for j, k in enumerate(chosen):
        mine = slice(j * _BESIDE, (j + 1) * _BESIDE)
        first, last = (averages.apart(a, k)[mine] for a in (before, after))
        good[j] = orbits.alive[mine].all() and (last <= np.maximum(_SAME, _CLOSER * first)).all()
    return good


def _surface(region: Neighbourhood, extent: Floats) -> Floats:
    """Return points (n, d) at the surfaces of the ellipsoids of a region."""
    rng, begin = np.random.default_rng(0), []
    for number, (centre, metric) in enumerate(zip(region.centres, region.metrics, strict=True)):
        values, axes = np.linalg.eigh(metric * np.outer(extent, extent))
        across = values > 1e-12 * values.max()
        sphere = rng.standard_normal((len(range(number, _BESIDE, len(region.centres))), len(values)))
        sphere /= np.linalg.norm(sphere[:, across], axis=1, keepdims=True)
        # Along angles that turn orbits begin anywhere.
        lengths = np.where(across, 1.0 / np.sqrt(np.where(across, values, 1.0)), 1.0)
        begin.append(centre + (sphere * lengths) @ axes.T * extent)
    return np.concatenate(begin)


def leading_exponents(
    exact: PointMap, states: Floats, extent: Floats, periods: int = _GROWING
) -> tuple[Floats, Floats]:
    """Return the largest Lyapunov exponents (n, k) per step of states (n, d), from orbits that begin beside theirs.

    And standard errors (n,) of the largest, from the means over ten stretches; NaN where an orbit ends.
    """
    n, d = states.shape
    number = min(_FRAME, d)
    if not n:
        return np.empty((0, number)), np.empty(0)
    frames = np.tile(np.linalg.qr(np.random.default_rng(0).standard_normal((d, number)))[0], (n, 1, 1))
    here, growth, lost = states.copy(), np.zeros((periods, n, number)), np.zeros(n, bool)
    for step in range(periods):
        if step % _AT_ONCE == 0:
            check_stop()
        beside = here[:, None] + _APART * frames.transpose(0, 2, 1) * extent
        places = np.concatenate([here[:, None], beside], axis=1).reshape(-1, d)
        orbits = Orbits.starting(wrap(places, exact.coordinates))
        advance_on_threads(exact.advance, orbits, 1)
        lost |= ~orbits.alive.reshape(n, -1).all(axis=1)
        images = np.where(lost[:, None, None], states[:, None], orbits.points.reshape(n, 1 + number, d))
        here = images[:, 0].copy()
        moved = difference(images[:, 1:], here[:, None], exact.coordinates) / extent / _APART
        moved[lost] = np.eye(number, d)
        frames, upper = np.linalg.qr(moved.transpose(0, 2, 1))
        with np.errstate(divide="ignore"):
            growth[step] = np.log(np.abs(np.diagonal(upper, axis1=1, axis2=2)))
    growth[:, lost] = np.nan
    used = growth[periods // 8 :]
    length = max(len(used) // BLOCKS, 1)
    means = used[: BLOCKS * length].reshape(-1, length, n, number).mean(axis=1)
    exponents = used.mean(axis=0)
    largest = np.argmax(np.nan_to_num(exponents), axis=1)
    return exponents, means.std(axis=0, ddof=1)[np.arange(n), largest] / np.sqrt(BLOCKS)


def _move(exact: PointMap, orbits: Orbits, periods: int) -> None:
    """Move orbits on."""
    for begin in range(0, periods, _AT_ONCE):
        check_stop()
        advance_on_threads(exact.advance, orbits, min(_AT_ONCE, periods - begin))


def _history(exact: PointMap, orbits: Orbits, periods: int) -> tuple[Floats, Ints]:
    """Move orbits on; return where they have been (periods, n, d), and their full rotations."""
    parts = [(points.copy(), rotations.copy()) for points, rotations, _ in recorded(exact.advance, orbits, periods)]
    return np.concatenate([p for p, _ in parts]), np.concatenate([r for _, r in parts])
