"""Quasi-periodic attractors in many dimensions, by recurrence: time averages of orbits and of others beside them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints
from ...maps.coordinates import difference, wrap
from ...maps.orbit_batch import Orbits
from ...maps.paths import history_of, moved_on
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, Kind, Neighbourhood
from ...orbits.invariant_circle import circle_through, closed_after
from ..regions.hulls import Hulls, surface_points
from ..regions.lyapunov_regions import Afford, always
from ..settling.quotients import quotient_by
from ..settling.settle import Catalogue
from .exponents import FRAME, GROWING, Growing
from .time_averages import LONGEST, PERIODS, Averages, Paths, paths_of, spread_of

_SAME = 0.02  # difference of averages of orbits on one attractor, in units of an orbit's size
_WIDTHS = (0.02, 0.0025, 0.0003)  # of regions where an attractor has none, in units of the region, one after the other
_BESIDE = 4  # orbits that begin in a region
_AVERAGED, _RETURNING = 128, 128  # periods over which their averages are taken, twice, and those between
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
    within its error and one of the next ones is negative, as seen from orbits beside it (Benettin, Galgani, Strelcyn
    1976), four of them, or twice as many again as long as all exponents are zero.  Its region are ellipsoids of its
    pieces, or of sectors of an angle that makes full rotations.  Four orbits that begin at the surface of the region
    must have the same averages in the end, or come closer to them; else it becomes narrower.  Where one cannot `afford`
    these, the region is the narrowest.

    The region is not a trapping region: nothing verifies that no orbit leaves it, and its `contraction` is 1.  All this
    takes some thousand images for each attractor, in any number of dimensions.
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
    chosen, exponents = [k for k, good in zip(chosen, attracts, strict=True) if good], exponents[attracts]
    regions = _regions(exact, paths, chosen, extent, afford)
    found = [
        _attractor(exact, paths.points[k], paths.rotations[k], largest, region)
        for k, largest, region in zip(chosen, exponents, regions, strict=True)
        if region is not None
    ]
    return found, cycles


def _exponents(exact: PointMap, states: Floats, extent: Floats, afford: Afford) -> tuple[Floats, Bools]:
    """Return the largest exponents (n, 1) of orbits, and which (n,) are zero while one of the next is negative.

    There are as many directions as it takes to see one in which lengths shrink: a torus has a zero for each frequency.
    """
    found, attracts = np.full((len(states), 1), np.nan), np.zeros(len(states), bool)
    left, directions = np.arange(len(states)), FRAME
    while len(left):
        growth = Growing.along(exact, states[left], GROWING, extent, directions)
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


def _attractor(exact: PointMap, path: Floats, rotations: Ints, exponents: Floats, region: Neighbourhood) -> Attractor:
    """Return the attractor of a regular orbit (periods, d)."""
    return Attractor(
        Kind.QUASIPERIODIC,
        0,
        path,
        (0,) * exact.dimension,
        np.empty(0, complex),
        exponents,
        exact.coordinates,
        neighbourhood=region,
        circle=circle_through(exact, path[-PERIODS:], rotations[-PERIODS:]),
    )


def _regions(
    exact: PointMap, paths: Paths, chosen: Sequence[int], extent: Floats, afford: Afford
) -> list[Neighbourhood | None]:
    """Return the widest region of each of the `chosen` orbits to which others come back, None where there is none."""
    hulls = [Hulls.of(exact, paths.points[k], paths.rotations[k], extent) for k in chosen]
    found: list[Neighbourhood | None] = [None] * len(chosen)
    left = list(range(len(chosen)))
    for width in _WIDTHS:
        tried = [j for j in left if afford(_BESIDE * (2 * _AVERAGED + _RETURNING))]
        for j in set(left) - set(tried):
            found[j] = hulls[j].of_width(_WIDTHS[-1])
        regions = [hulls[j].of_width(width) for j in tried]
        back = _all_return(exact, regions, paths, [chosen[j] for j in tried], extent)
        for j, region, good in zip(tried, regions, back, strict=True):
            found[j] = region if good else None
        left = [j for j, good in zip(tried, back, strict=True) if not good]
    return found


def _all_return(
    exact: PointMap, regions: Sequence[Neighbourhood], paths: Paths, chosen: Sequence[int], extent: Floats
) -> Bools:
    """Tell of which regions (n,) orbits from the surface come to the averages of the `chosen` orbits, or closer."""
    if not regions:
        return np.zeros(0, bool)
    begin = np.concatenate([surface_points(region, extent, _BESIDE) for region in regions])
    orbits = Orbits.starting(wrap(begin, exact.coordinates))
    early, _ = history_of(exact, orbits, _AVERAGED)
    moved_on(exact, orbits, _RETURNING)
    late, _ = history_of(exact, orbits, _AVERAGED)
    before, after = (Averages.of(np.nan_to_num(h), exact, extent) for h in (early, late))
    good = np.zeros(len(regions), bool)
    for j, k in enumerate(chosen):
        mine = slice(j * _BESIDE, (j + 1) * _BESIDE)
        first, last = (paths.averages.apart(a, k)[mine] for a in (before, after))
        same = max(_SAME, spread_of(paths.points[k], exact, extent, _AVERAGED))
        good[j] = orbits.alive[mine].all() and (last <= np.maximum(same, _CLOSER * first)).all()
    return good
