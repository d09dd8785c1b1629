"""Continuous symmetries: directions along which nothing changes, and the map of what is left without them."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..._compiled.codegen.trace import parameter_record
from ..._lib.arrays import Floats, Ints
from ...maps.coordinates import turns_of, wrap
from ...maps.discrete import Discrete
from ...maps.orbit_batch import Orbits
from ...maps.point_map import PointMap
from ...maps.stroboscopic import Stroboscopic
from ...orbits.attractor import PARTS, Attractor
from ..regions.tube import SAMPLED

_PLACES = 8  # at which derivatives and shifts are tried
_DIFFERENCE = 1e-4  # for derivatives, whose errors leave
_ZERO = 1e-6  # of singular values that vanish, and of components of directions
_SAME = 1e-9  # relative difference of values that are equal
_SHIFTS = (-17.3, 0.37, 2.9)

Motion = Callable[[float, Floats], Floats]


@dataclass(frozen=True, eq=False)
class Quotient:
    """A map of orbits of a group of shifts: one coordinate is left out for each direction (k, d) of the group.

    Row i of ``directions`` is 1 at the coordinate ``pivots[i]``, and 0 at the other pivots.  A state is shifted until
    its pivots are 0; what it is then at the ``kept`` coordinates is its place in the quotient, in which ``point_map``
    moves it.
    """

    directions: Floats
    pivots: Ints
    kept: Ints
    point_map: PointMap

    def projected(self, points: Floats) -> Floats:
        """Return the places (n, d - k) of states (n, d) in the quotient."""
        shifted = points[:, self.kept] - points[:, self.pivots] @ self.directions[:, self.kept]
        return wrap(shifted, self.point_map.coordinates)

    def of_orbits(self, orbits: Orbits) -> Orbits:
        """Return the orbits of the places of others, which may have ended."""
        found = Orbits.starting(self.projected(orbits.points))
        return replace(found, status=orbits.status.copy(), work=orbits.work)

    def back(self, orbits: Orbits) -> Orbits:
        """Return orbits in the quotient as orbits of states whose pivots are 0."""
        points, rotations = (self._widened(a, (-1,), 0) for a in (orbits.points, orbits.rotations))
        return Orbits(points, rotations, orbits.status, orbits.work)

    def lowered(self, attractor: Attractor) -> Attractor:
        """Return an attractor of the map as one in the quotient."""
        return self._changed(attractor, lambda a, axes, _: self._narrowed(a, axes), None)

    def lifted(self, attractor: Attractor, point_map: PointMap) -> Attractor:
        """Return an attractor in the quotient as a group orbit of attractors of the map, by those with pivots 0."""
        # The boxes of a cover are cut along no pivot.
        cut, turn = (part[self.pivots] for part in turns_of(point_map.coordinates))
        fills = {"lower": np.where(turn > 0, cut, -0.5), "widths": np.where(turn > 0, turn, 1.0)}
        found = self._changed(attractor, lambda a, axes, name: self._widened(a, axes, fills.get(name, 0)), point_map)
        return replace(found, symmetry=self.directions)

    def _changed(
        self, attractor: Attractor, change: Callable[[Any, tuple[int, ...], str], Any], point_map: PointMap | None
    ) -> Attractor:
        """Change all arrays of an attractor along those of their axes that belong to coordinates."""
        coordinates = (self.point_map if point_map is None else point_map).coordinates
        parts = {part: getattr(attractor, part) for part in PARTS}
        for part, (_, shapes) in PARTS.items():
            if parts[part] is not None:
                axes = {name: tuple(k for k, s in enumerate(dims.split()) if s == "d") for name, dims in shapes.items()}
                changes = {name: change(getattr(parts[part], name), a, name) for name, a in axes.items() if a}
                parts[part] = replace(parts[part], **changes)
        resolution = attractor.resolution
        return replace(
            attractor,
            points=change(attractor.points, (1,), "points"),
            rotations=tuple(change(np.array(attractor.rotations, np.int64), (0,), "rotations").tolist()),
            coordinates=coordinates,
            resolution=None if resolution is None else change(resolution, (0,), "resolution"),
            symmetry=None,
            **parts,
        )

    def _narrowed(self, array: Any, axes: Sequence[int]) -> Any:
        for axis in axes:
            array = np.take(array, self.kept, axis=axis)
        return array

    def _widened(self, array: Any, axes: Sequence[int], fill: Any) -> Any:
        d = len(self.kept) + len(self.pivots)
        for axis in axes:
            wide = np.zeros((*np.moveaxis(array, axis, -1).shape[:-1], d), array.dtype)
            wide[..., self.kept], wide[..., self.pivots] = np.moveaxis(array, axis, -1), fill
            array = np.moveaxis(wide, -1, axis)
        return np.ascontiguousarray(array)


def quotient_of(point_map: PointMap, states: Floats) -> Quotient | None:
    """Return the quotient of a map by the shifts that it commutes with, None where there are none.

    Such a shift moves all of some angles together, for instance, or a coordinate that does not occur.  Directions are
    the common null space of derivatives of the right-hand side at some places among the states (n, d), and count where
    shifts along them leave the right-hand side as it is.  Stroboscopic maps of smooth right-hand sides without impacts
    are looked at, and discrete maps, in more than four dimensions.
    """
    if point_map.dimension <= SAMPLED or point_map.table is not None:
        return None
    found = _motion_of(point_map)
    if found is None:
        return None
    rng = np.random.default_rng(0)
    finite = states[np.isfinite(states).all(axis=1)]
    if not len(finite):
        return None
    places = finite[rng.integers(0, len(finite), _PLACES)] + 0.01 * rng.standard_normal((_PLACES, point_map.dimension))
    try:
        directions = _directions(*found, point_map, places, rng)
    except Exception:  # places outside of the domain of the right-hand side
        return None
    return _quotient(point_map, directions) if len(directions) else None


def quotient_by(point_map: PointMap, attractors: Sequence[Attractor]) -> Quotient | None:
    """Return the quotient in which attractors were found, None where they have no symmetry.

    Raises
    ------
    ValueError
        Where some have one and others none, or another one, or the map is none that can be divided by it.
    """
    found = [a.symmetry for a in attractors]
    if all(s is None for s in found):
        return None
    first = next(s for s in found if s is not None)
    if any(s is None or not np.array_equal(s, first) for s in found) or _motion_of(point_map.without_table) is None:
        raise ValueError("attractors have different symmetries: give those of one map, found together")
    return _quotient(point_map.without_table, first)


def _motion_of(point_map: PointMap) -> tuple[Motion, float, float] | None:
    """Return the right-hand side of a map, its period in time, and what it moves a state by itself; None if unknown."""
    spec = point_map.spec
    if isinstance(spec, Stroboscopic) and spec.system.functions[1:] == (None, None):
        system = spec.system
        return lambda t, x: np.array(system.derivative(t, x.tolist()), dtype=float), system.length, 0.0
    if isinstance(spec, Discrete):
        record = parameter_record(tuple(spec.params))(*spec.params.values())
        return lambda t, x: np.array(spec.function(tuple(x.tolist()), record), dtype=float), 1.0, 1.0
    return None


def _directions(
    motion: Motion, period: float, own: float, point_map: PointMap, places: Floats, rng: np.random.Generator
) -> Floats:
    """Return independent directions (k, d) in which all shifts commute with a map, each 1 at its own pivot."""
    d, times = point_map.dimension, period * rng.random(len(places))
    steps = _DIFFERENCE * (1.0 + np.abs(places))
    rows = []
    for t, x, h in zip(times, places, steps, strict=True):
        columns = [(motion(t, x + e) - motion(t, x - e)) / (2.0 * e.max()) for e in np.diag(h)]
        rows.append(np.stack(columns, axis=-1) - own * np.eye(d))
    matrix = np.concatenate(rows)
    if not np.isfinite(matrix).all():
        return np.empty((0, d))
    _, sizes, axes = np.linalg.svd(matrix, full_matrices=False)
    candidates = _reduced(axes[sizes <= _ZERO * sizes.max(initial=0.0)], turns_of(point_map.coordinates)[1])
    kept = []
    for v in candidates:
        moved = [
            np.abs(motion(t, x + s * v) - own * s * v - motion(t, x)) <= _SAME * (1.0 + np.abs(motion(t, x)))
            for t, x in zip(times, places, strict=True)
            for s in _SHIFTS
        ]
        if np.all(moved):
            kept.append(v)
    return np.array(kept).reshape(-1, d)


def _reduced(axes: Floats, turn: Floats) -> Floats:
    """Return the reduced echelon form of some directions, without those that no coordinate can be left out for.

    A coordinate is left out that is no angle, or the angle along which a direction is shortest: others are known up to
    full rotations of it, which have to be full rotations of theirs.
    """
    rows, kept = axes.copy(), []
    for k in range(len(rows)):
        sizes = np.abs(rows[k])
        sizes[sizes < _ZERO] = np.inf
        pivot = int(np.argmin(np.where(turn > 0, 1.0, 0.0) * 1e6 + sizes / sizes[np.isfinite(sizes)].max()))
        rows[k] /= rows[k, pivot]
        others = np.arange(len(rows)) != k
        rows[others] -= rows[others, pivot, None] * rows[k]
    for v, pivot in zip(np.round(rows, 6) + 0.0, _pivots(np.round(rows, 6)), strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
            turns = np.where(v == 0.0, 0.0, np.where(turn > 0, v * turn[pivot] / turn, np.inf))
        if turn[pivot] == 0.0 or (np.isfinite(turns).all() and np.array_equal(turns, np.round(turns))):
            kept.append(v)
    return np.array(kept).reshape(-1, len(turn))


def _pivots(directions: Floats) -> Ints:
    """Return for each direction the first coordinate at which it is 1 and all others are 0."""
    alone = (directions == 1.0) & (np.count_nonzero(directions, axis=0) == 1)
    return np.asarray(np.argmax(alone, axis=1))


def _quotient(point_map: PointMap, directions: Floats) -> Quotient:
    """Return a quotient; a map and its quotient are compiled once."""
    return _known_quotient(point_map.specified, np.ascontiguousarray(directions).tobytes(), point_map.dimension)


@functools.lru_cache(maxsize=16)
def _known_quotient(spec: Any, key: bytes, d: int) -> Quotient:
    directions = np.frombuffer(key).reshape(-1, d)
    pivots = _pivots(directions)
    kept = np.setdiff1d(np.arange(d), pivots)
    if isinstance(spec, Discrete):
        function = _without_pivots(spec.function, key, d, timed=False)
        reduced: Any = replace(spec, function=function, coordinates=tuple(spec.coordinates[i] for i in kept))
    else:
        rhs, atol = _without_pivots(spec.system.rhs, key, d, timed=True), spec.atol
        system = replace(spec.system, rhs=rhs, coordinates=tuple(spec.system.axes[i] for i in kept), outputs={})
        reduced = replace(spec, system=system, atol=tuple(atol[i] for i in kept) if isinstance(atol, tuple) else atol)
    return Quotient(directions, pivots, kept, reduced.build())


@functools.lru_cache(maxsize=256)
def _without_pivots(function: Callable[..., Any], key: bytes, d: int, timed: bool) -> Callable[..., tuple[Any, ...]]:
    """Return the right-hand side of a quotient, or the function of its map; the same one every time."""
    directions = np.frombuffer(key).reshape(-1, d)
    pivots = _pivots(directions).tolist()
    place = {i: n for n, i in enumerate(i for i in range(d) if i not in pivots)}
    terms = [(i, [(float(v[i]), j) for v, j in zip(directions, pivots, strict=True) if v[i]]) for i in place]

    def motion(*arguments: Any) -> tuple[Any, ...]:
        *time, y, p = arguments
        found = function(*time, tuple(y[place[i]] if i in place else 0.0 for i in range(d)), p)
        moved = []
        for i, pulls in terms:
            value = found[i]
            for factor, j in pulls:
                value = value - (found[j] if factor == 1.0 else factor * found[j])
            moved.append(value)
        return tuple(moved)

    return (lambda t, x, p: motion(t, x, p)) if timed else lambda x, p: motion(x, p)
