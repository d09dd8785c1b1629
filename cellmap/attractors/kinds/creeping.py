"""Orbits that come to rest so slowly that they are seen to move: where they creep to, and how fast."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints, evenly
from ..._lib.stopping import check_stop
from ...maps.coordinates import difference, turns_of, wrap
from ...maps.orbit_batch import Orbits, Status, Tally
from ...maps.point_map import PointMap
from ...maps.side_by_side import advance_on_threads
from ...orbits.attractor import Attractor, Kind
from ..settling.settle import Catalogue, Settled, settle, without_escaped
from .continua import closed_orbits, new_continua
from .ends import ORBITS, Ends
from .equilibria import sticking_sets
from .invariant_subspaces import owners_in_subspaces
from .recurrence import averaged_owners

_PERIODS = 16  # the ways of as many are compared with those of as many that follow
_SEEN = 1e-12  # least way that is no rounding, in units of the region
_STRAIGHT = 0.9  # least cosine of the angle between them
_SLOW = 1e-4  # largest move in a period, in units of the region, and
_NEAR = 0.02  # of all moves that are still ahead
_POWERS = (1.0, 1.5, 2.0, 3.0)  # the way ahead, in units of what it is where moves shrink by the same factor
_RELAXING = 64  # periods in which an orbit from where it would rest comes to the curve along which it creeps
_LAP, _APART = 48, 208  # periods of which moves are compared, and periods between them
_LESS = 1.01  # times as long as the last is the first of five, if it is seen how they fall
_ORDERS = np.linspace(1.01, 2.2, 120)  # by which they may: 2 beside a fold, less beside points of higher order
_ALIKE = 0.1  # difference of the order in the first half of the time from that in the second
_STILL = 0.1  # largest move of the place where an orbit would rest, in units of the move of the orbit
_BEYOND = (3.0, 6.0, 1.5)  # ways to places in a continuum beyond that, in the same units,
_COMING = 256  # periods in which they come to it,
_HALVINGS = 5  # of the part of such a way in which they come to it, by places
_SOON = 64, 192  # that come to the curve in as many periods, or in as many more


@dataclass(frozen=True, eq=False)
class Creeping:
    """Which orbits creep, and where they would come to rest.

    ``found`` (n,): whether orbits creep; ``moves`` (n,): how far they move in a period, the largest coordinate;
    ``ends`` (n, d): the places where they would come to rest, NaN for the others.
    """

    found: Bools
    moves: Floats
    ends: Floats


def look(ends: Ends) -> list[Attractor]:
    """Return the continua to which some orbits creep that do not go on, found from where they would come to rest."""
    if not ends.last:
        return []
    point_map, extent = ends.point_map, ends.extent
    some = ends.points[evenly(len(ends.points), ORBITS)]
    some = some[drawn_to(point_map, some, ends.known) < 0]
    slow = creeping(point_map.without_table, some, extent)
    places = slow.ends[slow.found]
    if not len(places):
        return []
    return sticking_sets(point_map, places, extent, ends.known) or new_continua(
        ends, closed_orbits(point_map, places, extent, 1)
    )


def creeping(point_map: PointMap, states: Floats, extent: Floats) -> Creeping:
    """Tell which orbits creep from some states (n, d) on, in a region of some size (d,).

    An orbit creeps if it moves slowly, straight on and ever less, towards a place ahead that moves much less than it
    does.  Such orbits come to the edge of a sticking set, or to a neutral point, from which they are as far after n
    periods as a power of 1/n; others come to a node whose multiplier is nearly 1.
    """
    coordinates, size = point_map.coordinates, np.asarray(extent, dtype=float)
    ways = _ways(point_map, states, size)
    found, move = ways.slow, np.abs(ways.moves)
    ends, least = np.full(states.shape, np.nan), _STILL * move.max(axis=1)
    for power in _POWERS:
        rows = np.flatnonzero(found)
        far = power * ways.ahead[rows]
        places = states[rows] + (far / ways.lengths[rows])[:, None] * ways.shifts[rows] * size
        places = wrap(places, coordinates)
        # The way is straight only almost: what is beside it comes to it first.
        there = _moved(point_map, places, _RELAXING)
        moved = np.abs(difference(_moved(point_map, there, 1), there, coordinates) / size).max(axis=1)
        aside = np.linalg.norm(difference(there, places, coordinates) / size, axis=1)
        better = (moved <= least[rows]) & (aside <= far)
        ends[rows[better]], least[rows[better]] = there[better], moved[better]
    return Creeping(np.isfinite(ends).all(axis=1), (move * size).max(axis=1), ends)


class _Ways(NamedTuple):
    """How orbits move, in units of the region.

    ``moves`` (n, d): in a period; ``shifts`` (n, d), ``lengths`` (n,): in some periods; ``ahead`` (n,): the way that
    is left where moves shrink by the same factor; ``slow`` (n,): which move slowly, straight on and ever less.
    """

    moves: Floats
    shifts: Floats
    lengths: Floats
    ahead: Floats
    slow: Bools


def _ways(point_map: PointMap, states: Floats, size: Floats) -> _Ways:
    """Follow orbits for some periods, and as many again."""
    coordinates = point_map.coordinates
    before, middle = _moved(point_map, states, 1), _moved(point_map, states, _PERIODS)
    after = _moved(point_map, middle, _PERIODS)
    first, second = (difference(b, a, coordinates) / size for a, b in ((states, middle), (middle, after)))
    moves = difference(before, states, coordinates) / size
    lengths, lasting = np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        straight = (first * second).sum(axis=1) >= _STRAIGHT * lengths * lasting
        ahead = lengths / (1.0 - lasting / lengths)
        slow = (np.abs(moves).max(axis=1) <= _SLOW) & (ahead <= _NEAR)
        slow &= (lasting > _SEEN) & (lasting < lengths) & straight
    return _Ways(moves, first, lengths, ahead, slow)


def orders_of(point_map: PointMap, states: Floats, extent: Floats) -> Floats:
    """Return the powers of 1/n by which orbits from some states (n, d) approach a cycle, NaN for those that do not.

    Beside a cycle with a multiplier of 1 or -1 they move less and less in some periods, by a power of the time that has
    passed since some beginning: 1.5 where the distance falls like its square root.  It is the same power in the first
    half of the time that is looked at as in the second.
    """
    here, ways = states, []
    for _ in range(5):
        after = _moved(point_map, here, _LAP)
        ways.append(np.linalg.norm(difference(after, here, point_map.coordinates) / extent, axis=1))
        here = _moved(point_map, after, _APART)
    moves = np.array(ways)
    with np.errstate(invalid="ignore", divide="ignore"):
        falls = (moves[1:] < moves[:-1]).all(axis=0) & (moves[4] > _SEEN) & (moves[0] > _LESS * moves[4])
        way = moves ** (-1.0 / _ORDERS[:, None, None])
        bends = way[:, :3:2] + way[:, 2::2] - 2.0 * way[:, 1::2]
    falls &= (bends[0] > 0.0).all(axis=0) & (bends[-1] < 0.0).all(axis=0)
    early, late = _ORDERS[(bends < 0.0).argmax(axis=0)]
    return np.where(falls & (np.abs(early - late) < _ALIKE), 0.5 * (early + late) - 1.0, np.nan)


def drawn_to(point_map: PointMap, states: Floats, attractors: Sequence[Attractor]) -> Ints:
    """Return the number of the continuum to whose fixed points each orbit creeps from its state (n, d), -1 for none.

    A place ahead of such an orbit, beyond the one where it would come to rest, comes to the continuum.  On the way to
    this place orbits move ahead, the less the nearer they are to it, until they come to the same continuum; where they
    begin to do so is found by halving.  As no orbit passes a place that rests on the curve along which it creeps, it
    comes to one of these.
    """
    owners = np.full(len(states), -1)
    sets = [k for k, a in enumerate(attractors) if a.kind in (Kind.EQUILIBRIA, Kind.CONTINUUM) and a.period == 1]
    if not sets or not len(states):
        return owners
    exact, coordinates = point_map.without_table, point_map.coordinates
    catalogue = Catalogue.of([attractors[k] for k in sets], exact)
    size = _size_of(attractors, exact)
    ways = _ways(exact, states, size)
    for times in _BEYOND:
        rows = np.flatnonzero(ways.slow & (owners < 0))
        way = times * (ways.ahead / ways.lengths)[rows, None] * ways.shifts[rows]
        ends = _come(exact, wrap(states[rows] + way * size, coordinates), catalogue, _COMING)
        rows, way, ends = rows[ends >= 0], way[ends >= 0], ends[ends >= 0]
        good = _straight_on(exact, states[rows], way, size, ends, catalogue, np.linalg.norm(ways.moves[rows], axis=1))
        owners[rows[good]] = np.array(sets)[ends[good]]
    return owners


def _straight_on(
    exact: PointMap, states: Floats, way: Floats, size: Floats, ends: Ints, catalogue: Catalogue, moves: Floats
) -> Bools:
    """Tell on which ways (n, d), in units of the region, orbits move ahead and ever less until they come to their end.

    ``ends`` (n,): the attractors at the end of each; ``moves`` (n,): how far the orbits at their beginning move.
    """
    good, least, low, high = np.ones(len(states), bool), moves, np.zeros(len(states)), np.ones(len(states))
    for _ in range(_HALVINGS):
        part = 0.5 * (low + high)
        places = wrap(states + part[:, None] * way * size, exact.coordinates)
        there, now, length, ahead = places, np.full(len(states), -1), np.full(len(states), np.inf), np.zeros_like(good)
        for periods in _SOON:
            rows = np.flatnonzero(good & (now < 0) & ~(ahead & (length < least)))
            there[rows] = _moved(exact, there[rows], periods)
            move = difference(_moved(exact, there[rows], 1), there[rows], exact.coordinates) / size
            now[rows], length[rows] = _come(exact, there[rows], catalogue, 1), np.linalg.norm(move, axis=1)
            ahead[rows] = (move * way[rows]).sum(axis=1) > 0.0
        come, moving = now == ends, (now < 0) & ahead & (length < least)
        good &= come | moving
        low, high, least = np.where(come, low, part), np.where(come, part, high), np.where(come, least, length)
    return good


def owners_at_last(point_map: PointMap, orbits: Orbits, attractors: Sequence[Attractor]) -> Ints:
    """Return the attractors that orbits have not been captured by, but come to as far as one can see, -1 for none."""
    owners = drawn_to(point_map, orbits.points, attractors)
    for rule in (averaged_owners, owners_in_subspaces):
        left = np.flatnonzero((owners < 0) & orbits.alive)
        owners[left] = rule(point_map, orbits.points[left], attractors)
    return owners


def settled_at_last(
    point_map: PointMap, attractors: Sequence[Attractor], age: int, settled: Settled, bound: Floats | None = None
) -> Settled:
    """Return what has become of orbits that are `age` periods old: those that creep to a continuum settle there.

    So do those that have the averages of an attractor that was found by recurrence, and those so near to an invariant
    subspace with an attractor that hardly any comes out again.  Those that escape beyond a bound have diverged.
    """
    if bound is not None:
        settled = without_escaped(point_map, settled, bound, age)
    rows, owners = settled.undecided, owners_at_last(point_map, settled.orbits, attractors)
    labels, times = settled.labels.copy(), settled.times.copy()
    labels[rows] = np.where(owners >= 0, owners, labels[rows])
    times[rows] = np.where(owners >= 0, age, times[rows])
    missed = int(np.count_nonzero((owners >= 0) & (settled.orbits.status == Status.INACCURATE)))
    tally = settled.tally.plus(Tally(inaccurate=missed))
    return replace(settled, labels=labels, times=times, tally=tally, orbits=settled.orbits[np.flatnonzero(owners < 0)])


def _come(exact: PointMap, states: Floats, catalogue: Catalogue, periods: int) -> Ints:
    """Return to which attractors orbits come within some periods, negative numbers for none."""
    return np.asarray(settle(exact, Orbits.starting(states.copy()), catalogue, periods).labels, np.int64)


def _size_of(attractors: Sequence[Attractor], point_map: PointMap) -> Floats:
    """Return the size of the region that attractors show, of each coordinate."""
    points = np.concatenate([a.points for a in attractors])
    largest, turn = np.maximum(np.ptp(points, axis=0), np.abs(points).max(axis=0)), turns_of(point_map.coordinates)[1]
    return np.where(turn > 0, turn, np.where(largest > 0.0, largest, 1.0))


def _moved(point_map: PointMap, states: Floats, periods: int) -> Floats:
    """Return images of states, NaN where there is none."""
    check_stop()
    orbits = Orbits.starting(states.copy())
    advance_on_threads(point_map.advance, orbits, periods)
    return np.where(orbits.alive[:, None], orbits.points, np.nan)
