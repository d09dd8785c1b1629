"""Quasi-periodic attractors in many dimensions, by recurrence: time averages of orbits and of others beside them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints, evenly
from ..._lib.threads import slices, thread_count
from ...maps.coordinates import difference, turns_of, wrap
from ...maps.orbit_batch import Orbits
from ...maps.paths import history_of, moved_on
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, Kind, Neighbourhood, aperiodic
from ...orbits.invariant_circle import circle_through, closed_after
from ..regions.boxes import in_units, tree_of
from ..regions.lyapunov_regions import Afford, always
from ..settling.quotients import quotient_by
from ..settling.settle import Catalogue
from .exponents import FRAME, GROWING, Growing
from .time_averages import LONGEST, PERIODS, Averages, paths_of, spread_of

_SAME = 0.02  # difference of averages of orbits on one attractor, in units of an orbit's size
_CENTRES = 256  # balls of a region
_WIDER = 1.5  # factor by which balls are wider than it takes to hold the points seen
_AS_WIDE = 0.7  # part of their width that balls keep where an orbit comes no closer to its attractor
_INSIDE = 0.9  # least part of later points that lie in the balls, which seldom hold all of a torus
_BESIDE = 4  # orbits that begin beside a region
_FARTHER = 3.0  # distance along each coordinate of their beginnings from centres, in radii of the balls,
_FARTHEST = 0.1  # or in sizes of the attractor, where balls are wide
_NEARER = (1.0, 0.1, 0.01)  # parts of this distance, one after the other
_AVERAGED = 128  # periods over which their averages are taken, twice
_CLOSER = 0.5  # factor by which averages have to come closer meanwhile where an attractor attracts slowly
_BALL = 1e-4  # radius around a cycle that nothing verifies, in units of the region

CLOSED = 1e-6
"""Part of the region within which an orbit has closed by itself."""


def recurrent_attractors(
    exact: PointMap,
    states: Floats,
    extent: Floats,
    age: int,
    known: Sequence[Attractor],
    slow: bool = True,
    afford: Afford = always,
) -> tuple[list[Attractor], list[tuple[Floats, int]]]:
    """Return the quasi-periodic attractors on which orbits of some age are, and cycles that they are on instead.

    They are followed for as long again, and for 512 periods more.  One whose time averages over both halves of these
    are the same is regular, and if `slow` ones are looked for, so is one for which this holds in up to 4,096 periods;
    those with the same averages are on one attractor.  It is quasi-periodic where its largest Lyapunov exponent is zero
    within its error and one of the next is negative, as seen from orbits beside it (Benettin, Galgani, Strelcyn 1976),
    four of them, or twice as many again as long as all exponents are zero.  Its region are balls around its points, so
    wide that no point that was seen is outside.  Four orbits that begin beside it must have the same averages in the
    end, or come closer to them, unless one cannot `afford` to see that.

    The region is not a trapping region: nothing verifies that no orbit leaves it, and its `contraction` is 1; an orbit
    has to stay in it for 64 periods to count as converged.  All this takes some thousand images for each attractor, in
    any number of dimensions.
    """
    if not len(states) or not afford(len(states) * age):
        return [], []
    orbits = Orbits.starting(states.copy())
    moved_on(exact, orbits, age)
    outside = orbits.alive.copy()
    outside[outside] = Catalogue.of(known, exact).owners_of(orbits.points[outside]) < 0
    orbits = orbits[np.flatnonzero(outside)]
    if not len(orbits) or not afford(len(orbits) * PERIODS):
        return [], []
    paths = paths_of(exact, orbits, extent, LONGEST if slow else PERIODS, afford)
    before = [Averages.of(a.points[:, None], exact, extent) for a in known if _is_recurrent(a)]
    chosen, cycles = list[int](), list[tuple[Floats, int]]()
    seen = np.zeros(len(orbits), bool)
    averages = paths.averages
    for k in np.flatnonzero(averages.regular).tolist():
        path = paths.points[k]
        others = [averages.apart(averages, k)[seen], *(averages.apart(other, k) for other in before)]
        if (np.concatenate(others) <= _SAME).any():
            continue
        period = closed_after(path, exact, extent)
        if period:
            cycles.append((path[-1], period))
        elif afford((FRAME + 1) * GROWING):
            chosen.append(k)
        seen[k] = True
    exponents, attracts = _exponents(exact, orbits.points[chosen], extent, afford)
    regular = [
        _attractor(exact, paths.points[k], paths.rotations[k], largest, extent)
        for k, largest in zip(np.array(chosen, np.int64)[attracts].tolist(), exponents[attracts], strict=True)
    ]
    found = _attracting(exact, _at_rest(exact, regular, extent, afford), age, extent, afford)
    return found, cycles


def _exponents(exact: PointMap, states: Floats, extent: Floats, afford: Afford) -> tuple[Floats, Bools]:
    """Return the largest exponents (n, 1) of orbits, and which (n,) are zero while one of the next is negative.

    There are as many directions as it takes to see one in which lengths shrink: a torus has a zero for each frequency.
    """
    found, attracts = np.full((len(states), 1), np.nan), np.zeros(len(states), bool)
    left, directions = np.arange(len(states)), FRAME
    while len(left):
        growth = Growing.along(exact, states[left], GROWING, extent, directions)
        # Chaos whose exponent is not known yet has a growth that exceeds its errors.
        while (
            (growth.zero & (growth.exponents > growth.errors))[:, 0].any()
            and growth.periods < LONGEST
            and afford(growth.images)
        ):
            growth = growth.carried_on()
        zero, shrinking = growth.zero, (~growth.zero & (growth.exponents < 0.0)).any(axis=1)
        found[left, 0], attracts[left] = growth.exponents[:, 0], zero[:, 0] & shrinking
        left, directions = left[zero.all(axis=1)], 2 * directions
        if directions >= 2 * exact.dimension or not afford(len(left) * (directions + 1) * GROWING):
            break
    return found, attracts


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
        history, rotations = history_of(exact, orbits, period)
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

    Orbits from states (n, d) are followed for 512 periods; their averages may differ from those of an attractor by what
    averages over as many of its own points do.  In this way orbits are decided that are in no region of an attractor:
    these are narrow where nothing verifies them.
    """
    numbers = [k for k, a in enumerate(known) if _is_recurrent(a)]
    owners = np.full(len(states), -1)
    if not numbers or not len(states):
        return owners
    if (quotient := quotient_by(exact, known)) is not None:
        known = [quotient.lowered(a) for a in known]
        return averaged_owners(quotient.point_map, quotient.projected(states), known)
    size = np.ptp(np.concatenate([known[k].points for k in numbers]), axis=0)
    extent = np.where(size > 0.0, size, 1.0)
    orbits = Orbits.starting(states.copy())
    mine, points = paths_of(exact, orbits, extent).averages, [known[k].points for k in numbers]
    apart = np.array([Averages.of(p[:, None], exact, extent).apart(mine, 0) for p in points])
    nearest = np.argmin(np.where(np.isnan(apart), np.inf, apart), axis=0)
    limits = np.array([max(_SAME, spread_of(p, exact, extent, PERIODS)) for p in points])
    same = apart[nearest, np.arange(len(states))] <= limits[nearest]
    return np.where(same & orbits.alive, np.array(numbers)[nearest], owners)


def _is_recurrent(attractor: Attractor) -> bool:
    return attractor.kind is Kind.QUASIPERIODIC and attractor.neighbourhood is not None and not attractor.verified


def _attractor(exact: PointMap, path: Floats, rotations: Ints, exponents: Floats, extent: Floats) -> Attractor:
    """Return the attractor of a regular orbit (periods, d)."""
    return aperiodic(
        Kind.QUASIPERIODIC,
        path,
        exponents,
        exact.coordinates,
        neighbourhood=_region(exact, path, extent),
        circle=circle_through(exact, path[-PERIODS:], rotations[-PERIODS:]),
    )


def _at_rest(exact: PointMap, regular: Sequence[Attractor], extent: Floats, afford: Afford) -> list[Attractor]:
    """Return attractors of regular orbits once these come no closer to them, without orbits that go elsewhere.

    The next points of an orbit lie in the balls around those before, and need balls as wide themselves.
    """
    found = dict(enumerate(regular))
    left = list(found)
    while left and afford(sum(len(found[k].points) for k in left)):
        ends = Orbits.starting(np.array([found[k].points[-1] for k in left]))
        history, turned = history_of(exact, ends, max(len(found[k].points) for k in left))
        for j, k in enumerate(tuple(left)):
            points, rotations = history[: len(found[k].points), j], turned[: len(found[k].points), j]
            later = _attractor(exact, points, rotations, found[k].exponents, extent)
            if (Catalogue.of([found[k]], exact).owners_of(points) == 0).mean() < _INSIDE:
                del found[k]
            elif (_radii(later) < _AS_WIDE * _radii(found[k])).any():
                found[k] = later
                continue
            left.remove(k)
    return [found[k] for k in sorted(found)]


def _radii(attractor: Attractor) -> Floats:
    """Return the half-width of the balls around an attractor along each coordinate."""
    assert attractor.neighbourhood is not None
    return np.asarray(1.0 / np.sqrt(np.diag(attractor.neighbourhood.metrics[0])))


def _region(exact: PointMap, path: Floats, extent: Floats) -> Neighbourhood:
    """Return balls around some points of an orbit (periods, d), so wide that they hold the others.

    Lengths are in units of the size of the orbit along each coordinate, at least of a small part of the region.
    """
    turn, rows = turns_of(exact.coordinates)[1], evenly(len(path), _CENTRES)
    size = np.where(turn > 0, turn, _span(exact, path, extent))
    others = path[1:][evenly(len(path) - 1, len(rows))]
    apart = tree_of(path[rows], size, exact).query(in_units(others, size, exact), workers=thread_count())[0]
    radius = _WIDER * max(float(apart.max()), CLOSED)
    return Neighbourhood(path[rows], np.tile(np.diag((radius * size) ** -2.0), (len(rows), 1, 1)), 1.0)


def _span(exact: PointMap, path: Floats, extent: Floats) -> Floats:
    """Return the size of an orbit (periods, d) along each coordinate, at least a small part of that of the region."""
    return np.asarray(np.maximum(np.ptp(difference(path, path[0], exact.coordinates), axis=0), CLOSED * extent))


def _attracting(
    exact: PointMap, found: Sequence[Attractor], age: int, extent: Floats, afford: Afford
) -> list[Attractor]:
    """Return the attractors in whose region orbits from beside them are in the end, with their averages, or nearly so.

    Orbits have as long for it as those had that came to the attractors; all count where this cannot be afforded.
    """
    between, good, left = max(age, _AVERAGED), set[int](), list(range(len(found)))
    rng = np.random.default_rng(0)
    for nearer in _NEARER:
        if not afford(_BESIDE * len(left) * (2 * _AVERAGED + between)):
            good |= set(left)
        if not left or good.issuperset(left):
            break
        begin = [
            _beside(exact, found[k], nearer * rng.choice([-1.0, 1.0], (_BESIDE, exact.dimension)), extent) for k in left
        ]
        orbits = Orbits.starting(wrap(np.concatenate(begin), exact.coordinates))
        early, _ = history_of(exact, orbits, _AVERAGED)
        moved_on(exact, orbits, between)
        late, _ = history_of(exact, orbits, _AVERAGED)
        for k, mine in zip(left, slices(len(orbits), _BESIDE), strict=True):
            if orbits.alive[mine].all() and _come(exact, found[k], early[:, mine], late[:, mine], extent):
                good.add(k)
        left = [k for k in left if k not in good]
    return [found[k] for k in sorted(good)]


def _beside(exact: PointMap, attractor: Attractor, away: Floats, extent: Floats) -> Floats:
    """Return states beside some points of an attractor, as far away (n, d) from them as wanted, 1 for the farthest."""
    farthest = np.minimum(_FARTHER * _radii(attractor), _FARTHEST * _span(exact, attractor.points, extent))
    return np.asarray(attractor.points[evenly(len(attractor.points), len(away))] + away * farthest)


def _come(exact: PointMap, attractor: Attractor, early: Floats, late: Floats, extent: Floats) -> bool:
    """Tell whether orbits (periods, n, d) are in the region of an attractor late, and nearly have its averages."""
    owners = Catalogue.of([attractor], exact).owners_of(late.reshape(-1, exact.dimension)).reshape(late.shape[:2])
    mine = Averages.of(attractor.points[:, None], exact, extent)
    spread = spread_of(attractor.points, exact, extent, _AVERAGED)
    first, last = (mine.apart(Averages.of(h, exact, extent), 0) for h in (early, late))
    return bool((owners == 0).mean(axis=0).min() >= _INSIDE and (last <= np.maximum(spread, _CLOSER * first)).all())
