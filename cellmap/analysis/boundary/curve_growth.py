"""Growth of manifolds: images of a fundamental segment, refined where they bend or stretch (Hobson 1993)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..._lib.arrays import Bools, Complexes, Floats
from ...maps.coordinates import turns_of
from ...maps.grid import CellGrid
from ...maps.inverse import LiftedMap, extra_turns, preimages, preimages_along
from ...maps.point_map import PointMap, follow
from ...orbits.orbit_kinds import PeriodicOrbit

_BEGINNING = 1e-6  # scaled length of the fundamental segment's distance from the saddle
_STRAIGHT = 0.2  # largest angle between neighbouring pieces of a curve, in radians
_SHORTEST = 1e-3  # fraction of the spacing: pieces shorter than this may meet at any angle
_LEVELS = 400
_ROUNDS = 40

Images = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class ManifoldBranch:
    """Branch of a manifold: one of the two halves at one point of a saddle.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        The curve from the saddle outwards, with unwrapped angles; a row of NaN marks an interruption, where the curve
        leaves the window or has no image.
    arclength : ndarray, shape (n,)
        Arc length along the curve from the saddle, in units of `scale` of the manifold.
    ended : str
        Reason why it ends: "length" (the requested length is reached), "window" (the rest lies outside), "no image"
        (the map or its inverse has none), "point" (images come to a fixed point or cycle, as those of a separatrix
        that returns to its saddle), or "resolution" (the spacing of floating-point numbers on the first segment
        is too coarse).
    """

    points: Floats
    arclength: Floats
    ended: str

    def __repr__(self) -> str:
        return f"ManifoldBranch({len(self.points)} points, length {self.length:.4g}, ended by {self.ended})"

    @property
    def length(self) -> float:
        """Arc length of the curve."""
        return float(np.nanmax(self.arclength, initial=0.0))


@dataclass(frozen=True, eq=False)
class Growth:
    """How a piece of a curve grows: by one map, or by several searches for preimages, one for each step.

    ``forward``: the map, with unwrapped angles, or None for a search on `step`; ``shifts``: turns that are added after
    each map or search, so that the saddle comes back to its place; ``places``: where it is after each of them.
    """

    forward: Images | None
    step: LiftedMap
    shifts: list[Floats]
    places: list[Floats]


def growth_of(
    point_map: PointMap, orbit: PeriodicOrbit, row: int, kind: str, rounds: int, inverse: PointMap | None
) -> Growth:
    """Return how a manifold grows at one point of a saddle, over a number of rounds of its orbit at a time."""
    turn = turns_of(point_map.coordinates)[1]
    exact = point_map.without_table
    count = orbit.period * rounds
    once = np.array(orbit.rotations) * turn
    saddle = orbit.points[row]
    if inverse is not None and inverse.coordinates != point_map.coordinates:
        raise ValueError(f"inverse={inverse!r} has other coordinates than the map")
    step = LiftedMap(exact, extra_turns(exact, saddle))
    mapping = point_map if kind == "unstable" else inverse
    if mapping is not None:
        onward = LiftedMap(mapping, extra_turns(mapping, saddle))

        def forward(points: Floats) -> Floats:
            for _ in range(count):
                points = onward(points)
            return points

        moved = forward(saddle[None])[0] - saddle
        back = np.where(turn > 0.0, -turn * np.round(moved / np.where(turn > 0.0, turn, 1.0)), 0.0)
        return Growth(forward, step, [back], [saddle])
    if step.extra.any() and (orbit.period > 1 or once.any()):
        raise ValueError(
            f"point_map={point_map!r} couples its angles, so that the full rotations of this orbit cannot be taken "
            "back: give the inverse map"
        )
    # Preimages are searched for step by step, since those of several steps bend too much.
    orbits = [saddle, *(follow(exact, saddle, j).unwrapped for j in range(1, orbit.period))]
    places = [orbits[-j % orbit.period] + once * (j // -orbit.period) for j in range(1, count + 1)]
    places[-1] = saddle
    return Growth(None, step, [np.zeros(2)] * (count - 1) + [once * rounds], places)


class GrowingCurve:
    """A branch that grows: the images of a fundamental segment, with the history of each of its points."""

    def __init__(
        self,
        growth: Growth,
        saddle: Floats,
        direction: Floats,
        factor: float,
        unit: Floats,
        grid: CellGrid,
        spacing: float,
        reach: float,
    ) -> None:
        self.growth, self.saddle, self.direction, self.factor = growth, saddle, direction, factor
        self.unit, self.spacing = unit, spacing
        margin = np.where(grid.wraps, np.inf, reach * unit)
        self.lower, self.upper = np.array(grid.lower) - margin, np.array(grid.upper) + margin
        self.wraps = np.array(grid.wraps)
        self.places = np.linspace(0.0, 1.0, 9)
        self.history = [self._begin(self.places)]

    def _begin(self, places: Floats) -> Floats:
        return np.asarray(self.saddle + _BEGINNING * np.power(self.factor, places)[:, None] * self.direction)

    def grow(self, longest: float) -> ManifoldBranch:
        """Iterate the segment until the curve is as long as asked for, or ends."""
        pieces = [self.saddle[None], self.history[0][:-1]]
        total, ended = _BEGINNING, "length"
        first = self._length(self.history[0], np.ones(len(self.history[0]), bool))
        for _ in range(_LEVELS):
            for _ in self.growth.shifts:
                self.history.append(self._next())
            resolved = self._refine(longest - total)
            newest = self.history[-1]
            if not np.isfinite(newest).any():
                ended = "no image"
                break
            pieces.append(newest[:-1])
            near = self._near(newest)
            if not near.any():
                ended = "window"
                break
            total += self._length(newest, near)
            if total >= longest:
                break
            if self._length(newest, np.asarray(np.isfinite(newest).all(axis=1))) < first:
                ended = "point"
                break
            if not resolved:
                ended = "resolution"
                break
        points, arclength = self._joined(np.concatenate([*pieces, self.history[-1][-1:]]), longest)
        return ManifoldBranch(points, arclength, ended)

    def _next(self) -> Floats:
        """Images of the newest points; where these have to be searched for, only of a piece near the window."""
        way, newest = self.growth, self.history[-1]
        round_, done = len(way.shifts), len(self.history)
        shift = way.shifts[(done - 1) % round_]
        if way.forward is not None:
            return way.forward(newest) + shift
        if (done - 1) % round_ == 0:
            near = self._near(newest)
            newest = np.where(
                (near | np.append(near[1:], False) | np.append(False, near[:-1]))[:, None], newest, np.nan
            )
        # The first point follows where the last one of the piece before came to.
        first = way.places[done - 1] if done < round_ else self.history[done - round_][-1]
        if not np.isfinite(first).all():
            first = way.places[(done - 1) % round_]
        before = np.concatenate([self.saddle[None], *self.history[:-1]])
        after = [self.history[k] - way.shifts[(k - 1) % round_] for k in range(1, done)]
        known = np.concatenate([(way.places[0] - way.shifts[0] * (round_ == 1))[None], *after])
        both = np.isfinite(before).all(axis=1) & np.isfinite(known).all(axis=1)
        return preimages_along(way.step, newest, first - shift, (before[both], known[both])) + shift

    def _again(self, number: int, points: Floats, guesses: Floats) -> Floats:
        """Images of points put in, at one step of the history."""
        way = self.growth
        shift = way.shifts[number % len(way.shifts)]
        if way.forward is not None:
            return way.forward(points) + shift
        found, _, settled = preimages(way.step, points, guesses - shift)
        found[~settled] = np.nan
        return found + shift

    def _near(self, points: Floats) -> Bools:
        return np.asarray(
            np.isfinite(points).all(axis=1) & ((points >= self.lower) & (points <= self.upper)).all(axis=1)
        )

    def _length(self, points: Floats, near: Bools) -> float:
        pieces = np.linalg.norm(np.diff(points, axis=0) / self.unit, axis=1)
        return float(pieces[near[1:] & near[:-1]].sum())

    def _refine(self, rest: float) -> bool:
        """Put in points until neighbours are close and the curve is straight between them; tell whether it is.

        The newest piece may be as much longer than the one before as the saddle stretches: what lies behind the
        ``rest`` of the length is left as it is.
        """
        resolved = True
        for _ in range(_ROUNDS):
            coarse = self._coarse(self.history[-1], rest)
            middle = 0.5 * (self.places[:-1] + self.places[1:])
            possible = coarse & (middle > self.places[:-1]) & (middle < self.places[1:])
            resolved = bool((possible == coarse).all())
            if not possible.any():
                break
            gaps = np.flatnonzero(possible)
            fresh = [self._begin(middle[gaps])]
            for number, known in enumerate(self.history[1:]):
                fresh.append(self._again(number, fresh[-1], 0.5 * (known[gaps] + known[gaps + 1])))
            self.places = np.insert(self.places, gaps + 1, middle[gaps])
            self.history = [np.insert(a, gaps + 1, b, axis=0) for a, b in zip(self.history, fresh, strict=True)]
        return resolved

    def _coarse(self, points: Floats, rest: float) -> Bools:
        """Return which pieces between neighbours are too long or too bent, where the curve is near the window.

        Of those within the first ``rest`` of its length: chords are no longer than the curve, so that none is left out.
        """
        near = self._near(points)
        piece = np.diff(points, axis=0) / self.unit
        with np.errstate(invalid="ignore", divide="ignore"):
            size = np.linalg.norm(piece, axis=1)
            turned = np.abs(np.angle(_complex(piece[1:]) / _complex(piece[:-1])))
            bent = np.zeros(len(piece), bool)
            sharp = (turned > _STRAIGHT) | ~np.isfinite(turned)
            bent[1:] |= sharp
            bent[:-1] |= sharp
            coarse = (size > self.spacing) | (bent & (size > _SHORTEST * self.spacing))
        lengths = np.where(near[1:] & near[:-1], size, 0.0)
        coarse &= np.cumsum(lengths) - lengths < rest
        return np.asarray(coarse & (near[:-1] | near[1:]) & np.isfinite(size))

    def _joined(self, points: Floats, longest: float) -> tuple[Floats, Floats]:
        """Return the curve near the window with its length, interrupted by NaN, cut where it is long enough."""
        near = self._near(points)
        kept = near | np.append(near[1:], False) | np.append(False, near[:-1])
        kept &= np.isfinite(points).all(axis=1)
        linked = kept[1:] & kept[:-1]
        pieces = np.where(
            linked, np.linalg.norm(np.diff(np.where(kept[:, None], points, 0.0), axis=0) / self.unit, axis=1), 0.0
        )
        inner = near[1:] & near[:-1]
        arclength = np.concatenate([[0.0], np.cumsum(np.where(inner, pieces, 0.0))])
        rows = np.flatnonzero(kept & (arclength <= longest))
        gaps = np.flatnonzero(np.diff(rows) > 1) + 1
        return (
            np.insert(points[rows], gaps, np.nan, axis=0),
            np.insert(arclength[rows], gaps, np.nan),
        )


def _complex(vectors: Floats) -> Complexes:
    return np.asarray(vectors[:, 0] + 1j * vectors[:, 1])
