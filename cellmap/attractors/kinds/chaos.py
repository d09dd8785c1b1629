"""Chaotic attractors, identified by their Lyapunov exponents and covered by boxes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._lib.arrays import Bools, Floats, Ints, evenly, thinned
from ...maps.coordinates import difference
from ...maps.orbit_batch import Orbits
from ...maps.paths import path_of
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, Cover, InvariantSubspace, Kind, aperiodic
from ...orbits.invariant_circle import drift
from ...orbits.newton import resolution
from ..regions.boxes import BOXES
from ..regions.covers import covers_apart, lattice
from ..regions.trapping_boxes import is_trapped, with_trapped_boxes
from ..regions.tube import SAMPLED
from .clouds import Clouds, pieces_of, recurrent_groups
from .creeping import creeping, orders_of
from .ends import ORBITS, Ends
from .exponents import AT_LEAST, growth_along, mean_exponents, pooled
from .invariant_subspaces import attractors_in_subspaces, hold, invariant_planes, neutral_family
from .transients import HALF, Late, Reason, follow_on

EXPONENT_PERIODS = 300
"""Periods in which an orbit shows whether it is chaotic."""

_SAMPLE_PERIODS = 1000
_LONGEST_RETURN = 128
_REPEATED = 16  # periods at least for which an orbit repeats itself: where errors double in each, 1e-16 stays small
_KNOWN = 8192  # points of a known attractor that are compared
MATURE = (
    256  # periods from which orbits may have come to a chaotic attractor, if a neighbourhood of it shows them there
)
_TOO_MANY = 3  # exponents that are zero on tori for which there is no trapping region
_UNKNOWN = Reason.REGULAR, Reason.TORUS  # of orbits of which the sign of the largest exponent is not known


class Examination(NamedTuple):
    """What became of orbits that had not settled.

    ``attractors``: chaotic attractors that were not known; ``reasons``: for each orbit that is on none of these, why it
    is undecided.
    """

    attractors: tuple[Attractor, ...]
    reasons: tuple[Reason, ...]


def examine(ends: Ends, late: Late | None = None, trapped: bool = True) -> Examination:
    """Find the chaotic attractors on which long-lived orbits move, and say why the other orbits are undecided.

    An orbit counts as chaotic where its largest Lyapunov exponent is positive, by five standard errors and more than
    regular motion may have, and as one on an attractor where volumes are not preserved along it.  Orbits of which some
    periods do not tell the sign are followed for twice as long again and again, until it is known, or too small to show
    at their age, or exponents have taken as many images of the map as all of the orbits have, and at least 200,000.

    An orbit that returns to where it was is on an unstable periodic orbit.  Orbits whose points are nearest neighbours
    of one another are on one attractor, and so are those that go to and fro between two such sets.

    At most 32 of the orbits, evenly spread, are followed, for five times the periods that they have made,
    unless all of them are in a neighbourhood of one attractor that no orbit leaves, see :func:`trapped_boxes`, which is
    looked for if there may be `trapped` boxes.  If any of them leaves, or ends on a known attractor that is not
    chaotic, all of them are transients.  Orbits that stay among the boxes of a known chaotic attractor are on that
    attractor.  No orbit is on a new one if it is among the points of a known chaotic attractor, if orbits go from there
    to another attractor, or if any of those that came `late` to attractors that are not chaotic was in chaos there,
    halfway.
    """
    point_map, known, age, reach = ends.point_map, ends.known, ends.age, ends.extent
    chosen = ends.points[evenly(len(ends.points), ORBITS)]
    images = float(max(age * len(ends.points), AT_LEAST))
    exponents, reasons = tested(point_map, chosen, reach, EXPONENT_PERIODS)
    chaotic, unknown = reasons == Reason.TRANSIENT, np.isin(reasons, _UNKNOWN)
    if not chaotic.any():
        rows = np.flatnonzero(unknown | (reasons == Reason.LATE))
        reasons[rows[np.isfinite(orders_of(point_map.without_table, chosen[rows], reach))]] = Reason.FADING
        unknown &= reasons != Reason.FADING
        rows = np.flatnonzero(unknown)
        few = point_map.dimension <= SAMPLED
        resonant = few and len(rows) and drift(point_map, chosen[rows[0]], reach) is not None
        if resonant:
            reasons[rows] = Reason.RESONANT
        if resonant or not len(rows):
            return Examination((), tuple(map(Reason, reasons)))
    if trapped and chaotic.all() and age >= MATURE and point_map.is_flow and point_map.dimension <= SAMPLED:
        found_early = _trapped(point_map, chosen, reach, known, late)
        if found_early is not None:
            return Examination((found_early,), ())
    inside, subspaces = list[Attractor](), list[InvariantSubspace]()
    if chaotic.any() and point_map.dimension <= SAMPLED:
        rows = np.flatnonzero(chaotic)
        inside, owners, coming, subspaces = attractors_in_subspaces(
            point_map, chosen[rows], exponents[rows], reach, known, images, age
        )
        reasons[rows[coming]] = Reason.RIDDLED
        reasons[rows[owners >= 0]] = None
        chaotic[rows[coming]] = False
    rows = np.flatnonzero(chaotic | unknown | (reasons == Reason.LATE))
    followed = follow_on(point_map, chosen[rows], chaotic[rows], known, age)
    reasons[rows] = followed.reasons
    rows, orbit = rows[followed.lasting], followed.orbits
    if not len(rows):
        return _examined(inside, reasons)
    # The exponents of an attractor are those of orbits that have come to it; transients have others.
    exponents, doubts = tested(point_map, orbit.points, reach, _SAMPLE_PERIODS)
    for mine, known_exponents, sign in _sets(
        point_map, orbit, np.flatnonzero(np.isin(doubts, _UNKNOWN)), reach, images, age
    ):
        exponents[mine], doubts[mine] = known_exponents, (Reason.LATE if sign < 0 else Reason.TRANSIENT)
    lasting = doubts == Reason.TRANSIENT
    reasons[rows[~lasting]] = doubts[~lasting]
    rows, orbit, exponents = rows[lasting], orbit[lasting], exponents[lasting]
    history = path_of(point_map, orbit, _SAMPLE_PERIODS)
    alive = orbit.alive
    rows, history, exponents = rows[alive], history[:, alive], exponents[alive]
    if not len(rows):
        return _examined(inside, reasons)
    paths = followed.path[:, lasting][:, alive], followed.transients
    found, reasons[rows] = _distinguished(point_map, history, exponents, *paths, reach, known, late, images, subspaces)
    return _examined([*inside, *found], reasons)


def _examined(attractors: Sequence[Attractor], reasons: NDArray[Any]) -> Examination:
    return Examination(tuple(attractors), tuple(Reason(r) for r in reasons if r is not None))


def _sets(
    point_map: PointMap, orbits: Orbits, rows: Ints, extent: Floats, images: float, age: int
) -> Iterator[tuple[Ints, Floats, int]]:
    """Yield the orbits on one set, its exponents, and the sign of the largest, where all of these orbits tell it.

    ``rows``: orbits that do not tell it one by one; those whose points are nearest neighbours are on one set.
    """
    orbits = orbits[rows]
    history = path_of(point_map, orbits, _SAMPLE_PERIODS)
    alive = np.flatnonzero(orbits.alive)
    if not len(alive):
        return
    widths = lattice(history[:, alive].reshape(-1, point_map.dimension), point_map, extent)[1]
    group = Clouds(point_map, list(history[:, alive].swapaxes(0, 1)), BOXES * widths).group
    for g in np.unique(group):
        mine = alive[group == g]
        growth = growth_along(point_map, orbits.points[mine], extent, _SAMPLE_PERIODS)
        exponents, sign = pooled(growth, images * len(mine) / len(alive), age)
        if sign:
            yield rows[mine], exponents, sign


def _trapped(
    point_map: PointMap, states: Floats, extent: Floats, known: Sequence[Attractor], late: Late | None
) -> Attractor | None:
    """Return the chaotic attractor of all orbits, if it is one, and in a neighbourhood that no orbit leaves."""
    attractor, ends = one_attractor(point_map, states, extent, known, late)
    if attractor is None:
        return None
    (attractor,) = with_trapped_boxes(point_map, [attractor], known)
    return with_exponents(point_map, attractor, ends, extent) if is_trapped(attractor) else None


def one_attractor(
    point_map: PointMap, states: Floats, extent: Floats, known: Sequence[Attractor], late: Late | None
) -> tuple[Attractor | None, Floats]:
    """Return the attractor of all of some chaotic orbits, None if it is not one, and where they are in the end.

    The exponents of the attractor are not known yet.
    """
    orbits = Orbits.starting(states.copy())
    history = path_of(point_map, orbits, _SAMPLE_PERIODS)
    if not orbits.alive.all():
        return None, orbits.points
    paths = states[None], np.empty((0, *history.shape[::2]))
    found, reasons = _distinguished(point_map, history, np.zeros(states.shape), *paths, extent, known, late)
    one = len(found) == 1 and all(reason is None for reason in reasons)
    return (found[0] if one else None), orbits.points


def with_exponents(point_map: PointMap, attractor: Attractor, ends: Floats, extent: Floats) -> Attractor | None:
    """Return an attractor with the exponents of 32 of the orbits that have come to it; None if one is not chaotic."""
    exponents, doubts = tested(point_map, ends[evenly(len(ends), ORBITS)], extent, _SAMPLE_PERIODS)
    if (doubts != Reason.TRANSIENT).any():
        return None
    return replace(attractor, exponents=mean_exponents(point_map, exponents, ends, _SAMPLE_PERIODS, extent, AT_LEAST))


def _distinguished(
    point_map: PointMap,
    history: Floats,
    exponents: Floats,
    path: Floats,
    transients: Floats,
    extent: Floats,
    known: Sequence[Attractor],
    late: Late | None,
    images: float = 0.0,
    subspaces: Sequence[InvariantSubspace] = (),
) -> tuple[list[Attractor], NDArray[Any]]:
    """Return the new attractors of chaotic orbits (periods, n, d), and for each orbit (n,) why it is on none, or None.

    ``path`` is where the orbits were before, ``transients`` are pieces of others, see :func:`recurrent_groups`.
    """
    planes = invariant_planes(point_map, history.reshape(-1, point_map.dimension), extent)
    lower, widths = lattice(history.reshape(-1, point_map.dimension), point_map, extent)
    lower[planes] = 0.0  # no rounding moves a point to the other side of the edge of a box there
    met = [thinned(a.points, _KNOWN) for a in known if a.kind is Kind.CHAOTIC and a.cover is not None]
    clouds = Clouds(point_map, [*history.swapaxes(0, 1), *met], BOXES * widths, planes)
    group, leaves = recurrent_groups(clouds, path, widths, transients)
    fading = None if late is None else _fading(point_map, clouds, group, late, known)
    reasons, groups, found = np.full(history.shape[1], None, object), [], []
    new = np.arange(len(group)) < len(reasons)
    for g in np.unique(group[new]):
        mine = np.flatnonzero(new & (group == g))
        if (group[~new] == g).any():
            reasons[mine] = Reason.VISITING
        elif leaves[mine].any() or (fading is not None and g in fading):
            reasons[mine] = Reason.TRANSIENT
        elif hold(subspaces, history[:, mine], point_map):
            reasons[mine] = Reason.RIDDLED
        else:
            groups.append(mine)
    family, neutral = np.zeros(history.shape[1], bool), None
    if groups and point_map.dimension <= SAMPLED:
        family, neutral = neutral_family(point_map, history, extent)
        beside = [g for g in groups if family[g].all()]
        if len(beside) > 1:
            groups = [g for g in groups if not family[g].all()] + [np.sort(np.concatenate(beside))]
    for mine, cover in zip(*covers_apart(history, groups, lower, widths, point_map, extent, planes), strict=True):
        points = history[:, mine].reshape(-1, point_map.dimension)
        spectrum = mean_exponents(point_map, exponents[mine], history[-1, mine], _SAMPLE_PERIODS, extent, images)
        resolved = _resolution(clouds, mine, cover)
        within = neutral if family[mine].all() else None
        known_by = {"cover": cover, "resolution": resolved, "subspace": within}
        found.append(aperiodic(Kind.CHAOTIC, points, spectrum, point_map.coordinates, **known_by))
    return found, reasons


def _resolution(clouds: Clouds, members: Ints, cover: Cover) -> Floats:
    """Return the distance below which sets are not distinguished; of joined ones it is the width of a box."""
    resolved = clouds.resolution(members)
    return resolved if len(np.unique(clouds.group[members])) == 1 else np.maximum(resolved, cover.widths)


def _fading(point_map: PointMap, clouds: Clouds, group: Ints, late: Late, known: Sequence[Attractor]) -> Ints:
    """Return the groups of samples on which orbits were that came to an attractor that is not chaotic later."""
    halfway = late.halfway(point_map, known)
    if not halfway.size:
        return group[:0]
    *before, place = clouds.place_of(pieces_of(point_map, halfway), group)
    rows = np.flatnonzero((place >= 0) & (np.array(before) == place).all(axis=0))
    if len(rows):
        growth = growth_along(point_map, halfway[-1, rows], np.ones(point_map.dimension), HALF)
        rows = rows[growth.largest[0] > 0.0]  # others are on their way to an attractor beside the sample
    return np.unique(place[rows])


def tested(
    point_map: PointMap, points: Floats, extent: Floats, periods: int, unanimous: bool = False
) -> tuple[Floats, NDArray[Any]]:
    """Return the exponents of orbits (n, d), and what these say of each (n,): TRANSIENT where it is chaotic.

    Those whose largest exponent is negative are LATE.  Exponents that are not surely of one sign count as zero.

    Those of an orbit that comes back to where it was are not computed: it is on a cycle whatever they are.  Neither are
    those of one that creeps to rest.  If nothing but `unanimous` chaos counts, none are where there is such an orbit:
    the others are ENDING.
    """
    back, creeps = returns(point_map, points, extent), creeping(point_map, points, extent).found
    exponents = np.full((len(points), min(points.shape[1], SAMPLED)), np.nan)
    errors, rates, signs = np.full(exponents.shape, np.nan), np.full(len(points), np.nan), np.zeros(len(points))
    moving = np.flatnonzero(~back & ~creeps)
    if len(moving) == len(points) or (len(moving) and not unanimous):
        growth = growth_along(point_map, points[moving], extent, periods)
        rates[moving] = growth.volumes(points[moving])
        exponents[moving], errors[moving], signs[moving] = growth.exponents, growth.errors, growth.signs
    with np.errstate(invalid="ignore"):
        shrinking = np.abs(rates) > 1e-6
        zeros = (np.abs(exponents) <= 5.0 * errors).sum(axis=-1)
    reasons = np.full(len(points), Reason.REGULAR, object)
    reasons[zeros >= _TOO_MANY] = Reason.TORUS
    reasons[signs < 0] = Reason.LATE
    reasons[~shrinking] = Reason.PRESERVED
    reasons[signs > 0] = Reason.TRANSIENT
    reasons[(signs > 0) & ~shrinking] = Reason.CONSERVATIVE
    reasons[np.isnan(exponents).any(axis=-1)] = Reason.ENDING
    reasons[back] = Reason.PERIODIC
    reasons[creeps] = Reason.CREEPING  # so slowly that some of them seem to have come back
    return exponents, reasons


def returns(point_map: PointMap, states: Floats, extent: Floats) -> Bools:
    """Tell which orbits come back to within rounding of where they were, and then take the same way again.

    A chaotic orbit comes back as close now and then, by chance, and soon leaves the way that it took before.
    """
    path = path_of(point_map, Orbits.starting(states.copy()), _LONGEST_RETURN)
    near = 1e-7 * resolution(states, extent)
    back = np.asarray((np.abs(difference(path, states, point_map.coordinates)) <= near).all(axis=-1))
    found = np.asarray(back.any(axis=0))
    rows = np.flatnonzero(found)
    on = path_of(point_map, Orbits.starting(path[-1, rows]), _LONGEST_RETURN)
    path = np.concatenate([states[None, rows], path[:, rows], on])
    for k, period in enumerate(back[:, rows].argmax(axis=0) + 1):
        apart = difference(path[period:, k], path[:-period, k], point_map.coordinates)
        found[rows[k]] = (np.abs(apart[: max(period, _REPEATED)]) <= near[rows[k]]).all()
    return found
