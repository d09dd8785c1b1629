"""Limit cycles of autonomous systems: periodic orbits of the flow, whatever the period at which a map samples them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._lib.arrays import Bools, Complexes, Floats, evenly
from ..._lib.stopping import check_stop
from ...maps.coordinates import difference, turns_of, wrap
from ...maps.orbit_batch import Orbits
from ...maps.paths import history_of, path_of
from ...maps.poincare import check_unforced
from ...maps.point_map import PointMap
from ...maps.side_by_side import advance_on_threads
from ...maps.stroboscopic import Stroboscopic
from ...maps.tangent import tangent
from ...orbits.attractor import Attractor, Kind, Neighbourhood
from ...orbits.invariant_circle import InvariantCircle, curve_size, measured, signals_of
from ...orbits.lyapunov import stretched
from ..regions.lyapunov_regions import Afford
from ..regions.tube import (
    LEAST,
    NARROW,
    Curves,
    Tube,
    ellipsoids_of_tube,
    floor_of,
    images_of_surface,
    lengths_beside,
    verified_tube,
)
from ..settling.settle import Catalogue

AHEAD = 4
"""Orbits that are tried in one look, and before all are followed."""

_SAMPLES = 16  # for each period of its age, in a record of an orbit in which its returns are sought,
_RECORDS = 1024, 16384  # which has so many at least and at most
_PACE = 0.01  # way from one sample to the next, in units of the motion: some hundred samples in a cycle
_PACED, _PACINGS = 256, 32  # samples with which the interval between them is chosen, and attempts
_ALIKE = 4.0  # factor by which it may be too long; where it is too short, an orbit has not turned round,
_FASTER, _SLOWER = 8.0, 64.0  # and the most by which it grows or shrinks from one attempt to the next
_AT_REST = 1e-6  # way in the last quarter, in units of all of it, of an orbit that comes to rest
_FALLING, _LESS = 8, 0.9  # parts of a record in each of which such an orbit goes as much less far than before
_NEAR = 0.05  # way between an orbit and where it was before, from which Newton's method closes it
_MOSTLY, _ALONG = 0.9, 0.1  # part of a cycle on which it is as near as this to the one before
_TRIED = 4  # returns of one record
_CARRIED = 16  # parts of a cycle, after each of which derivatives are multiplied
_PARTS = 8  # of a cycle, after some of which distances are seen to have shrunk
_STRETCHES = 1024  # parts of a cycle in which contraction is a number
_ROUNDED = 1e-8  # size of a multiplier that may be rounding
_ITERATIONS, _HOPELESS = 16, 10.0  # steps of Newton's method; multiplier from which no stable cycle is beside
_FARTHEST = 0.2  # longest step of Newton's method, in units of the cycle and of its period
_CLOSED, _LAST = 1e-8, 1e-11  # residual of a closed cycle; last step that need not be followed by another
_TURNS = (2, 3, 5, 7)  # in which an orbit may have been closed
_NEUTRAL = 1e-3  # error of the multiplier 1: without one it is an equilibrium
_STABLE = 1.0 - 1e-6  # largest of the other multipliers
_BEGUN = 256  # points of a cycle from which on it is refined where it bends
_BISECTIONS = 40  # after which the two sides of a corner are one number
_MOST = 2**15  # points of a cycle
_HARMONICS = 1024  # of the Fourier series, at most
_SMOOTH = 1e-12  # part of the last harmonics in the largest, with which more of them show rounding
_KEPT = 512  # points of an attractor


@dataclass(frozen=True, eq=False)
class _Cycle:
    """A point of a periodic orbit, its period in time and its multipliers."""

    point: Floats
    period: float
    multipliers: Complexes


def autonomous(exact: PointMap) -> Stroboscopic | None:
    """Return what a stroboscopic map is built from if its right-hand side does not depend on time."""
    if not isinstance(exact.spec, Stroboscopic):
        return None
    try:
        check_unforced(exact.spec.system)
    except ValueError:
        return None
    return exact.spec


def limit_cycles(
    exact: PointMap,
    spec: Stroboscopic,
    states: Floats,
    extent: Floats,
    age: int,
    known: Sequence[Attractor],
    afford: Afford,
) -> list[Attractor]:
    """Return the limit cycles to which some orbits of an age come, verified to attract.

    They are orbits that the flow closes after some time, found by Newton's method with this time as a further unknown,
    from where orbits come back to where they were; all multipliers but the one along the orbit lie inside the unit
    circle.  Points beside the cycle are seen to come closer to it in whole periods of the cycle, and ellipsoids along
    it are the trapping region: neither depends on the period of the map.  A few orbits are tried, for the longer the
    older they are; in more than four dimensions one has to `afford` that, and as many images as a surface has points.
    """
    found, left, number = list[Attractor](), states, min(max(_RECORDS[0], _SAMPLES * age), _RECORDS[1])
    for _ in range(AHEAD):
        left = left[Catalogue.of([*known, *found], exact).owners_of(left) < 0]
        if not len(left) or not afford(number):
            break
        state, left = left[len(left) // 2], np.delete(left, len(left) // 2, axis=0)
        cycle = _cycle_of(exact, spec, state, extent, number)
        if cycle is None or Catalogue.of([*known, *found], exact).owners_of(cycle.point[None])[0] >= 0:
            continue
        attractor = (
            _verified(exact, spec, cycle, extent) if afford(images_of_surface(exact) * exact.dimension) else None
        )
        if attractor is not None:
            found.append(attractor)
    return found


def cycles_ahead(
    point_map: PointMap, states: Floats, extent: Floats, known: Sequence[Attractor], afford: Afford
) -> list[Attractor]:
    """Return the limit cycles of an autonomous system to which a few of some orbits come, before these are followed."""
    exact = point_map.without_table
    spec = autonomous(exact)
    if spec is None:
        return []
    some = wrap(states[evenly(len(states), AHEAD)], exact.coordinates)
    # In a short period of the map orbits are young for long: whatever it is, the first look is long.
    return limit_cycles(exact, spec, some, extent, _RECORDS[1] // _SAMPLES, known, afford)


def _cycle_of(exact: PointMap, spec: Stroboscopic, state: Floats, extent: Floats, number: int) -> _Cycle | None:
    """Return the stable cycle to which an orbit comes, None where some samples of it show none."""
    speed = np.linalg.norm(_speed(exact, spec, state, exact.period) / extent)
    longest = number * exact.period / (_SAMPLES * _PACED)
    paced = _paced(exact, spec, state, extent, _PACE / float(speed), longest) if 0.0 < speed < np.inf else None
    if paced is None:
        return None
    path, step = _followed(spec, paced[0][-1], paced[1], number), paced[1]
    size = _sizes(path, exact, extent)
    ways = np.linalg.norm(difference(path[1:], path[:-1], exact.coordinates) / size, axis=1)
    parts = np.array([part.sum() for part in np.array_split(ways, _FALLING)])
    if not np.isfinite(path).all() or (parts[1:] < _LESS * parts[:-1]).all():
        return None  # it comes to rest, or is far from its cycle
    closed = (_closed(exact, spec, path[k], steps * step, size) for k, steps in _returns(path, exact, size))
    cycle = next((c for c in closed if c is not None), None)
    return None if cycle is None else _shortest(exact, spec, cycle, size)


def _followed(spec: Stroboscopic, state: Floats, step: float, number: int) -> Floats:
    """Return where the flow takes a state, in steps of some length, that state first."""
    path = path_of(spec.over(step), Orbits.starting(state[None].copy()), number)
    return np.concatenate([state[None], path[:, 0]])


def _paced(
    exact: PointMap, spec: Stroboscopic, state: Floats, extent: Floats, step: float, longest: float
) -> tuple[Floats, float] | None:
    """Follow an orbit in steps so long that it moves by about a hundredth of its size in each; None where it rests.

    The interval grows from a short one: in long ones a cycle would seem to move slowly that all but closes in each.  It
    has a longest one, in which an orbit that comes to rest, or away from it, has not moved far.
    """
    for _ in range(_PACINGS):
        check_stop()
        path = _followed(spec, state, step, _PACED)
        if not np.isfinite(path).all():
            return None
        ways = np.linalg.norm(difference(path[1:], path[:-1], exact.coordinates) / _sizes(path, exact, extent), axis=1)
        if not ways.sum() > 0.0 or ways[-_PACED // 4 :].sum() <= _AT_REST * ways.sum():
            return None
        factor = _PACE / float(ways.mean())
        if 1.0 / _ALIKE <= factor <= 1.0:
            return path, step
        step *= float(np.clip(2.0 * factor, 1.0 / _SLOWER, _FASTER))
        if factor > 1.0 and step > longest:
            return None
        state = path[-1] if factor > 1.0 else state
    return None


def _sizes(points: Floats, exact: PointMap, extent: Floats) -> Floats:
    """Return lengths along each axis in which distances from an orbit are about the same in all directions."""
    return lengths_beside(curve_size(points, exact.coordinates), extent)


def _returns(path: Floats, exact: PointMap, size: Floats) -> Iterator[tuple[int, float]]:
    """Yield the places of an orbit near which it is again at the same point of its late part, and after how many steps.

    They are where it crosses the plane across its motion there, in the same sense, if most of the way between is like
    the one before: the nearest first, of those that are as near within a power of ten the latest.
    """
    number, coordinates = len(path), exact.coordinates
    ways = np.linalg.norm(difference(path[1:], path[:-1], coordinates) / size, axis=1)
    late = number - 2 - np.arange(number // 4)
    here = int(late[np.argsort(ways[late], kind="stable")[len(late) // 2]])
    shift = difference(path, path[here], coordinates) / size
    height = shift @ (shift[here + 1] - shift[here - 1])
    j = np.flatnonzero((height[:here] < 0.0) & (height[1 : here + 1] >= 0.0))
    part = height[j] / (height[j] - height[j + 1])
    apart = np.linalg.norm(shift[j] + part[:, None] * (shift[j + 1] - shift[j]), axis=1)
    near = np.flatnonzero((apart <= _NEAR) & (j + part < here - 1.0))
    rank = np.floor(np.log10(np.maximum(apart[near], 0.1 * _PACE)))
    tried = 0
    for k in near[np.lexsort((-j[near], rank))]:
        before = min(here - int(j[k]), int(j[k]))
        rows = np.arange(before) if before else np.zeros(1, int)
        there = path[j[k] - rows] + part[k] * difference(path[j[k] - rows + 1], path[j[k] - rows], coordinates)
        turn = np.linalg.norm(difference(path[here - rows], there, coordinates) / size, axis=1)
        if np.quantile(turn, _MOSTLY) <= _ALONG:
            yield here, float(here - j[k] - part[k])
            tried += 1
        if tried == _TRIED:
            return


def _closed(exact: PointMap, spec: Stroboscopic, point: Floats, period: float, size: Floats) -> _Cycle | None:
    """Return the stable cycle beside a point after some time, by Newton's method for both."""
    d, begun, last = exact.dimension, period, np.inf
    for tried in range(_ITERATIONS):
        check_stop()
        images, matrices = tangent(spec.over(period / _CARRIED), point[None], _CARRIED)
        speed = _speed(exact, spec, point, period) * period / size
        matrix, residual = matrices[0] * size / size[:, None], difference(images[0], point, exact.coordinates) / size
        if not (np.isfinite(matrix).all() and np.isfinite(residual).all() and np.isfinite(speed).all()):
            return None
        if np.abs(np.linalg.eigvals(matrix)).max() > _HOPELESS or (tried > 2 and last > _NEAR):
            return None
        bordered = np.block([[matrix - np.eye(d), speed[:, None]], [speed[None], np.zeros((1, 1))]])
        change = np.linalg.lstsq(bordered, -np.append(residual, 0.0), rcond=1e-14)[0]
        length = float(np.abs(change).max())
        change *= min(1.0, _FARTHEST / max(length, 1e-300))
        point = wrap((point + change[:d] * size)[None], exact.coordinates)[0]
        period *= 1.0 + float(change[d])
        if not 0.5 * begun < period < 2.0 * begun:
            return None
        if length <= _LAST or (np.abs(residual).max() <= _CLOSED and length >= 0.5 * last):
            break
        last = length
    else:
        return None
    multipliers = np.linalg.eigvals(matrix).astype(complex)
    multipliers = multipliers[np.argsort(np.abs(multipliers - 1.0))]
    if abs(multipliers[0] - 1.0) > _NEUTRAL or (np.abs(multipliers[1:]) > _STABLE).any():
        return None
    return _Cycle(point, period, multipliers[np.argsort(-np.abs(multipliers), kind="stable")])


def _shortest(exact: PointMap, spec: Stroboscopic, cycle: _Cycle, size: Floats) -> _Cycle:
    """Return a cycle that is closed once: near a doubling orbits come closest to themselves after twice its period."""
    for turns in _TURNS:
        image = spec.over(cycle.period / (turns * _CARRIED)).iterate(cycle.point, _CARRIED).points
        if np.abs(difference(image, cycle.point, exact.coordinates) / size).max() <= _CLOSED**0.5:
            once = _closed(exact, spec, cycle.point, cycle.period / turns, size)
            if once is not None:
                return _shortest(exact, spec, once, size)
    return cycle


def _speed(exact: PointMap, spec: Stroboscopic, point: Floats, period: float) -> Floats:
    """Return the speed at a point; where it may slide along a discontinuity, that of its motion in a short time."""
    if spec.system.functions[1:] == (None, None):
        return np.array(spec.system.derivative(0.0, tuple(point.tolist())), dtype=float)
    time = 1e-6 * period
    orbits = Orbits.starting(point[None].copy())
    spec.over(time).advance(orbits, 1)
    return difference(orbits.points[0], point, exact.coordinates) / time


def _verified(exact: PointMap, spec: Stroboscopic, cycle: _Cycle, extent: Floats) -> Attractor | None:
    """Return a cycle with a trapping region along it, None where points beside it are not seen to come closer."""
    begin, rotations = _path(exact, spec, cycle, _BEGUN)
    if not np.isfinite(begin).all():
        return None
    # The same point of a cycle comes first from wherever it was found.
    cycle = replace(cycle, point=begin[np.argmax(begin[:, 0])])
    begin, rotations = _path(exact, spec, cycle, _BEGUN)
    kept = np.broadcast_to(spec.motion.keeps_zero, exact.dimension) & (turns_of(exact.coordinates)[1] == 0.0)
    signs = np.sign(begin[0])
    kept = kept & (begin * signs > 0.0).all(axis=0)
    logs = _Logarithms(kept, signs)
    points = _bent(exact, spec, cycle.period, begin, logs, logs.sizes(begin, exact, extent))
    size = logs.sizes(points, exact, extent)
    curves = Curves(_in_logarithms(spec, cycle.period / _PARTS, logs), logs.of(points)[None], size)
    tube = verified_tube(curves, size, 10.0 * floor_of(curves, _PARTS, _BEGUN), _PARTS * _periods_for(cycle), _PARTS)
    region = None if tube is None else _region(curves, tube, logs)
    if region is None:
        return None
    turns = exact.period / cycle.period
    return Attractor(
        Kind.QUASIPERIODIC,
        0,
        points[evenly(len(points), _KEPT)],
        (0,) * exact.dimension,
        cycle.multipliers,
        _exponents(exact, spec, cycle) * turns,
        exact.coordinates,
        neighbourhood=region,
        circle=_circle(exact, spec, cycle, rotations * turns, turns),
    )


def _exponents(exact: PointMap, spec: Stroboscopic, cycle: _Cycle) -> Floats:
    """Return the exponents in a period, of multipliers that are rounding those that are seen in the second of two."""
    d = exact.dimension
    orbits = Orbits.starting(cycle.point[None].copy())
    along = _speed(exact, spec, cycle.point, cycle.period)[:, None]
    frames = np.linalg.qr(np.concatenate([along, np.eye(d)], axis=1))[0][None]
    part = spec.over(cycle.period / _STRETCHES)
    stretched(part, orbits, frames, _STRETCHES)
    growth = np.sort(stretched(part, orbits, frames, _STRETCHES)[0])[::-1]
    sizes = np.abs(cycle.multipliers)
    exponents = np.where(sizes > _ROUNDED, np.log(np.maximum(sizes, _ROUNDED)), growth)
    exponents[np.argmin(np.abs(cycle.multipliers - 1.0))] = 0.0
    return np.asarray(np.sort(exponents)[::-1])


def _path(exact: PointMap, spec: Stroboscopic, cycle: _Cycle, number: int) -> tuple[Floats, Floats]:
    """Return points of a cycle at equal intervals of time (number, d), and its full rotations."""
    orbits = Orbits.starting(cycle.point[None].copy())
    history, rotations = history_of(spec.over(cycle.period / number), orbits, number)
    return np.concatenate([cycle.point[None], history[:-1, 0]]), rotations[-1, 0].astype(float)


@dataclass(frozen=True, eq=False)
class _Logarithms:
    """Coordinates of which those that stay zero where they are zero are logarithms, so that no tube reaches across."""

    kept: Bools
    signs: Floats

    def of(self, points: Floats) -> Floats:
        """Return points in these coordinates; NaN on the other side."""
        with np.errstate(all="ignore"):
            return np.asarray(np.where(self.kept, np.log(points * self.signs), points))

    def sizes(self, points: Floats, exact: PointMap, extent: Floats) -> Floats:
        """Return lengths along each of them, as :func:`_sizes` does."""
        size, span = _sizes(points, exact, extent), np.ptp(self.of(points), axis=0)
        return np.asarray(np.where(self.kept, np.maximum(span, LEAST * size / np.abs(points).max(axis=0)), size))

    def back(self, places: Floats) -> Floats:
        """Return the points."""
        with np.errstate(all="ignore"):
            return np.asarray(np.where(self.kept, self.signs * np.exp(places), places))


def _in_logarithms(spec: Stroboscopic, time: float, logs: _Logarithms) -> PointMap:
    """Return the map of the flow over some time, in coordinates with logarithms."""
    part = spec.over(time)

    def advance(orbits: Orbits, periods: int) -> None:
        orbits.points[:] = logs.back(orbits.points)
        part.advance(orbits, periods)
        orbits.points[:] = logs.of(orbits.points)

    return replace(part, advance=advance, tangent=None, coarse_tangent=None, stretch=None)


def _bent(exact: PointMap, spec: Stroboscopic, period: float, begin: Floats, logs: _Logarithms, size: Floats) -> Floats:
    """Return points of a cycle so close to each other, where it bends, that it is straight between them.

    Intervals of time are halved until the point in their middle is within a hundredth of the narrowest tube of the line
    between their ends.
    """
    times, points = np.arange(len(begin)) / len(begin), begin
    open_, length = np.arange(len(begin)), 1.0 / len(begin)
    for _ in range(_BISECTIONS):
        check_stop()
        length *= 0.5
        after = np.searchsorted(times, times[open_], side="right") % len(times)
        middle = Orbits.starting(points[open_].copy())
        advance_on_threads(spec.over(period * length).advance, middle, 1)
        here, there, between = (logs.of(p) for p in (points[open_], points[after], middle.points))
        along = difference(there, here, exact.coordinates) / size
        shift = difference(between, here, exact.coordinates) / size
        part = np.clip((shift * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-300), 0.0, 1.0)
        off = np.linalg.norm(shift - part[:, None] * along, axis=1) > 0.01 * NARROW
        new = times[open_] + length
        again = np.concatenate([times[open_][off], new[off]])
        order = np.argsort(np.concatenate([times, new]), kind="stable")
        times, points = np.concatenate([times, new])[order], np.concatenate([points, middle.points])[order]
        open_ = np.searchsorted(times, again)
        if not len(open_) or len(times) > _MOST:
            break
    return points


def _periods_for(cycle: _Cycle) -> int:
    """Return after how many periods the slowest contraction must have been seen, if it is that of the multipliers."""
    others = np.sort(np.abs(cycle.multipliers - 1.0))
    slowest = np.abs(cycle.multipliers[np.abs(cycle.multipliers - 1.0) > others[0]]).max(initial=0.0)
    return int(2.0 ** np.ceil(np.log2(max(8.0, 4.0 / -np.log(max(slowest, 1e-300))))))


def _region(curves: Curves, tube: Tube, logs: _Logarithms) -> Neighbourhood | None:
    """Return ellipsoids along a cycle that lie in a tube around it."""

    def bent(centres: Floats, shift: Floats) -> Floats:
        """Return where ends of an ellipsoid are that is one in the coordinates of the map."""
        with np.errstate(all="ignore"):
            return np.asarray(centres + np.where(logs.kept, np.log1p(shift), shift))

    found = ellipsoids_of_tube(curves, tube, bent)
    if found is None:
        return None
    places, metrics = found
    centres = logs.back(places)
    scale = np.where(logs.kept, 1.0 / np.abs(centres), 1.0)
    return Neighbourhood(centres, metrics * scale[:, :, None] * scale[:, None, :], tube.contraction)


def _circle(
    exact: PointMap, spec: Stroboscopic, cycle: _Cycle, rotation_numbers: Floats, turns: float
) -> InvariantCircle:
    """Return the Fourier series of a cycle in time, as an invariant circle of the map."""
    points, _ = _path(exact, spec, cycle, 4 * _HARMONICS)
    waves = np.fft.fft(signals_of(points, exact.coordinates), axis=0) / len(points)
    powers = np.abs(waves).max(axis=1)
    seen = np.maximum(powers[1:_HARMONICS], powers[:-_HARMONICS:-1])
    harmonics = int(np.flatnonzero(seen > _SMOOTH * seen.max()).max(initial=0)) + 1
    coefficients = waves[np.arange(-harmonics, harmonics + 1)].T[None]
    error = 1e-15 * turns
    circle = InvariantCircle(
        turns % 1.0,
        error,
        rotation_numbers,
        np.where(turns_of(exact.coordinates)[1] > 0, error, 0.0),
        coefficients,
        np.inf,
        cycle.period,
    )
    return measured(exact, circle)
