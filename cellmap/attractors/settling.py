"""Iteration of initial conditions until each orbit has converged to an attractor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._compiled.kernels.capture import capture
from ..maps.coordinates import turns_of
from ..maps.orbit_batch import Orbits, Status, Tally, Work
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor, Cover

RESIDENCE = 64
"""Consecutive periods inside the cover of a chaotic attractor after which a start counts as captured."""

AT_REST = 1e-13
"""Largest move in a period, relative to 1 or to the point, of an orbit that rests."""

_UNSEEN = 64  # most periods at a time where nothing can capture an orbit

ESCAPED, DIVERGED, UNDECIDED, NO_RETURN = -1, -2, -3, -4
"""Labels of starts without an attractor: left the table, grew beyond all bounds, not settled, not back."""

_LABELS = np.full(max(Status) + 1, UNDECIDED)
_LABELS[[Status.ESCAPED, Status.DIVERGED, Status.NO_RETURN]] = ESCAPED, DIVERGED, NO_RETURN


def label_of(status: ArrayLike) -> NDArray[np.int64]:
    """Return the labels of orbits that have come to no attractor, by how each stands: a :class:`Status`."""
    return np.asarray(_LABELS[np.asarray(status)])


@dataclass(frozen=True, eq=False)
class Catalogue:
    """Known attractors, in the form in which starts are tested against them."""

    attractors: tuple[Attractor, ...]
    centres: NDArray[np.float64]
    metrics: NDArray[np.float64]
    owners: NDArray[np.int64]
    covers: tuple[tuple[int, Cover, NDArray[np.int64]], ...]
    turn: NDArray[np.float64]

    @classmethod
    def of(cls, attractors: Sequence[Attractor], point_map: PointMap) -> Catalogue:
        """Collect the neighbourhoods and covers of attractors."""
        d = point_map.dimension
        regions = [(k, a.neighbourhood) for k, a in enumerate(attractors) if a.neighbourhood is not None]
        return cls(
            tuple(attractors),
            np.concatenate([np.empty((0, d)), *(n.centres for _, n in regions)]),
            np.concatenate([np.empty((0, d, d)), *(n.metrics for _, n in regions)]),
            np.array([k for k, n in regions for _ in n.centres], np.int64),
            tuple(
                (k, a.cover, box_keys(a.cover.boxes, a.cover.corners))
                for k, a in enumerate(attractors)
                if a.cover is not None
            ),
            turns_of(point_map.coordinates)[1],
        )

    def owners_of(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the number of the attractor in whose neighbourhood each point is, -1 for none."""
        found, when = np.full(len(points), -1, np.int64), np.empty(len(points), np.int64)
        capture(points, found, when, 0, self.centres, self.metrics, self.owners, self.turn)
        return found

    def distances_of(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance to the nearest attractor, in radii of its neighbourhood; inf where there is none."""
        if not len(self.owners):
            return np.full(len(points), np.inf)
        shift = points[:, None, :] - self.centres
        around = np.where(self.turn > 0, self.turn, 1.0)
        shift -= np.where(self.turn > 0, self.turn * np.round(shift / around), 0.0)
        return np.asarray(np.sqrt(np.einsum("nmi,mij,nmj->nm", shift, self.metrics, shift)).min(axis=1))

    def shrunk(self, factor: float) -> Catalogue:
        """Return the catalogue with smaller neighbourhoods."""
        return replace(self, metrics=self.metrics / factor**2)


@dataclass(frozen=True, eq=False)
class Settled:
    """What became of a batch of starts.

    ``labels`` (n,): number of the attractor, or ESCAPED, DIVERGED, UNDECIDED, NO_RETURN; ``times`` (n,): period in
    which the start was first inside a region that belongs to its attractor, -1 without one; ``orbits``: last states of
    the undecided; ``tally``: what it took.
    """

    labels: NDArray[np.int16]
    times: NDArray[np.int32]
    orbits: Orbits
    tally: Tally

    @property
    def undecided(self) -> NDArray[np.int64]:
        """Rows of the starts that are undecided."""
        return np.flatnonzero(self.labels == UNDECIDED)


def settle(point_map: PointMap, orbits: Orbits, catalogue: Catalogue, periods: int, age: int = 0) -> Settled:
    """Iterate orbits that are `age` periods old until each is captured, has ended, or `periods` more have passed."""
    leap = point_map.leap
    if leap == 1 and not len(catalogue.owners) and not catalogue.covers:
        return _settle_nowhere(point_map, orbits, periods)
    # A cover is entered and left again; only what stays in a neighbourhood can be looked at once in several periods.
    if leap == 1 or leap > periods or catalogue.covers:
        return _settle_singly(point_map, orbits, catalogue, periods, age)
    return _settle_leaping(point_map, orbits, catalogue, periods, age, leap)


def _settle_nowhere(point_map: PointMap, orbits: Orbits, periods: int) -> Settled:
    """Iterate orbits where nothing captures them: all that can happen to one is to end, and ended ones stay so."""
    n, done = len(orbits), 0
    work, past = orbits.work, replace(orbits.work)
    labels = np.full(n, UNDECIDED, np.int16)
    members, now = np.arange(n), orbits
    steps = 0
    while True:
        over = ~now.alive
        if over.any():
            labels[members[over]] = label_of(now.status[over])
            members, now = members[~over], now[~over]
        stride = min(periods - done, max(done, 1), _UNSEEN)
        if not stride or not len(members):
            break
        point_map.advance(now, stride)
        steps += stride * len(members)
        done += stride
    inaccurate = int(np.count_nonzero(now.status == Status.INACCURATE))
    return Settled(labels, np.full(n, -1, np.int32), now, Tally(steps, inaccurate, *_since(past, work)))


def _settle_leaping(
    point_map: PointMap, orbits: Orbits, catalogue: Catalogue, periods: int, age: int, leap: int
) -> Settled:
    """Settle orbits by leaps: their neighbourhoods hold them, so that those captured within a leap show at its end."""
    n, end = len(orbits), age + periods
    work, past = orbits.work, replace(orbits.work)
    labels = np.full(n, UNDECIDED, np.int16)
    times = np.full(n, -1, np.int32)
    members, now = np.arange(n), orbits
    entered, since = np.empty_like(orbits.points), np.full(n, -1)
    inaccurate = steps = 0
    for k in range(age, end, leap):
        stride = min(leap, end - k)
        before = now.points.copy()
        point_map.advance(now, stride)
        steps += stride * len(now)
        found = catalogue.owners_of(now.points)
        over = (found >= 0) | ~now.alive
        if not over.any():
            continue
        done, keep = np.flatnonzero(over), np.flatnonzero(~over)
        rows, status, owners = members[done], now.status[done], found[done]
        labels[rows] = np.where(owners >= 0, owners, label_of(status))
        times[rows] = np.where(owners >= 0, k + stride, -1)
        entered[rows], since[rows] = before[done], k
        inaccurate += int(np.count_nonzero(status == Status.INACCURATE))
        members, now = members[keep], now[keep]
        if not len(members):
            break
    # The last leap of all starts together once more, by single periods, for the period in which it happened.
    rows = np.flatnonzero(since >= 0)
    again = _settle_singly(point_map, Orbits.starting(entered[rows]), catalogue, leap, 0)
    told = again.labels != UNDECIDED
    rows = rows[told]
    labels[rows] = again.labels[told]
    times[rows] = np.where(again.times[told] >= 0, since[rows] + again.times[told], -1)
    inaccurate += int(np.count_nonzero(now.status == Status.INACCURATE))
    tally = Tally(steps, inaccurate, *_since(past, work)).plus(again.tally._replace(inaccurate=0))
    return Settled(labels, times, now, tally)


def _settle_singly(point_map: PointMap, orbits: Orbits, catalogue: Catalogue, periods: int, age: int) -> Settled:
    n = len(orbits)
    work, past = orbits.work, replace(orbits.work)
    labels = np.full(n, UNDECIDED, np.int16)
    times = np.full(n, -1, np.int32)
    members = np.arange(n)
    now = orbits
    found, when = np.full(n, -1, np.int64), np.full(n, -1, np.int64)
    residence = np.zeros((len(catalogue.covers), n), np.int64)
    before = np.full(now.points.shape, np.nan)
    inaccurate = steps = 0
    for k in range(age, age + periods + 1):
        capture(now.points, found, when, k, catalogue.centres, catalogue.metrics, catalogue.owners, catalogue.turn)
        for row, (owner, cover, keys) in enumerate(catalogue.covers):
            if cover.certain is None:
                residence[row] = np.where(inside_cover(cover, now.points, point_map, keys), residence[row] + 1, 0)
                resident, since = residence[row] >= RESIDENCE, max(k - RESIDENCE + 1, 0)
            else:
                resident, since = _held(cover, cover.certain, now.points, before, point_map, keys), k
            resident &= found < 0
            found[resident], when[resident] = owner, since
        last = k == age + periods
        over = (found >= 0) | ~now.alive
        if last or np.count_nonzero(over) * 4 > len(over):
            done, keep = np.flatnonzero(over), np.flatnonzero(~over)  # numpy gathers by numbers faster than by marks
            rows, status, owners = members[done], now.status[done], found[done]
            inaccurate += int(np.count_nonzero(status == Status.INACCURATE))
            labels[rows] = np.where(owners >= 0, owners, label_of(status))
            times[rows] = np.where(owners >= 0, when[done], -1)
            members, now, found, when = members[keep], now[keep], found[keep], when[keep]
            residence = residence[:, keep]
        if last or not len(members):
            break
        steps += len(members)
        before = now.points.copy() if catalogue.covers else before
        point_map.advance(now, 1)
    inaccurate += int(np.count_nonzero(now.status == Status.INACCURATE))
    return Settled(labels, times, now, Tally(steps, inaccurate, *_since(past, work)))


def _since(past: Work, now: Work) -> tuple[int, int]:
    """Return what was counted in between."""
    return now.evaluations - past.evaluations, now.look_ups - past.look_ups


def inside_cover(
    cover: Cover, points: NDArray[np.float64], point_map: PointMap, keys: NDArray[np.int64] | None = None
) -> NDArray[np.bool_]:
    """Tell which points lie in the boxes of a cover; its sorted keys may be given."""
    known = box_keys(cover.boxes, cover.corners) if keys is None else keys
    places = box_keys(boxes_of(points, cover.lower, cover.widths, point_map), cover.corners)
    place = np.minimum(np.searchsorted(known, places), len(known) - 1)
    return np.asarray(known[place] == places)


def _held(
    cover: Cover,
    certain: NDArray[np.bool_],
    points: NDArray[np.float64],
    before: NDArray[np.float64],
    point_map: PointMap,
    keys: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Tell which points are in boxes of equilibria for certain, or rest in one of the others."""
    places = box_keys(boxes_of(points, cover.lower, cover.widths, point_map), cover.corners)
    place = np.minimum(np.searchsorted(keys, places), len(keys) - 1)
    with np.errstate(invalid="ignore"):
        rests = (np.abs(points - before) <= AT_REST * (1.0 + np.abs(points))).all(axis=-1)
    return np.asarray((keys[place] == places) & (rests | certain[place]))


def boxes_of(
    points: NDArray[np.float64], lower: NDArray[np.float64], widths: NDArray[np.float64], point_map: PointMap
) -> NDArray[np.int64]:
    """Return whole-number places of boxes; along an angle they wrap."""
    turn = turns_of(point_map.coordinates)[1]
    with np.errstate(invalid="ignore"):
        places = np.floor((points - lower) / widths)
    places = np.where(np.isfinite(places), np.clip(places, -(2.0**40), 2.0**40), -(2.0**40)).astype(np.int64)
    return wrapped_boxes(places, boxes_around(widths, turn))


def boxes_around(widths: NDArray[np.float64], turn: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return how many boxes make the turn of each angle; 0 for other coordinates."""
    return np.where(turn > 0, np.maximum(np.round(turn / widths), 1.0), 0.0).astype(np.int64)


def wrapped_boxes(places: NDArray[np.int64], around: NDArray[np.int64]) -> NDArray[np.int64]:
    """Bring places of boxes along an angle into its turn."""
    return np.where(around > 0, places % np.maximum(around, 1), places)


def moved_boxes(boxes: NDArray[np.int64], steps: NDArray[np.int64], around: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return all boxes that lie some steps away from others, each once, sorted."""
    moved = (boxes[:, None, :] + steps).reshape(-1, boxes.shape[1])
    return np.unique(wrapped_boxes(moved, around), axis=0)


def box_keys(boxes: NDArray[np.int64], reference: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number boxes row-major in the bounding box of the reference; -1 outside of it."""
    low, high = reference.min(axis=0), reference.max(axis=0)
    shape = high - low + 1
    inside = ((boxes >= low) & (boxes <= high)).all(axis=-1)
    keys = np.zeros(len(boxes), np.int64)
    for j in range(boxes.shape[1]):
        keys = keys * shape[j] + np.where(inside, boxes[:, j] - low[j], 0)
    return np.where(inside, keys, -1)
