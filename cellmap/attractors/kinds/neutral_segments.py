"""Segments of periodic points with one multiplier 1, followed along their neutral direction."""

from __future__ import annotations

from contextvars import copy_context

import numpy as np

from ..._lib.arrays import Floats
from ..._lib.stopping import check_stop
from ..._lib.threads import results_of
from ...maps.coordinates import difference, wrap
from ...maps.orbit_batch import Orbits
from ...maps.paths import path_of
from ...maps.point_map import PointMap
from ...maps.tangent import tangent
from ...orbits.multipliers import multipliers_of
from ...orbits.newton import resolution

DENSE = 1024
"""Points along a segment."""

_PRECISE = 1e-10  # distance from its image at which a periodic point is found, relative to the resolution
_QUADRATIC = 3  # steps of Newton's method, after which the residual has to fall by a factor of 10 in each
_NEUTRAL = 1e-6  # distance of the one multiplier from 1
_CONTRACTING = 1.0 - 1e-3  # largest other multiplier
_STEPS = 64  # along the extent of the region
_FARTHEST = 2.0  # from where an orbit has come to rest, in extents of the region
_MOST_POINTS = 512  # of a segment
_TURNING = 6  # points after which a curve may have come back to the first of them
_SHORTEST = 0.5**20  # step, in extents of the region
_BEYOND = (1.0, 1.5, 2.0)  # distances from the middle, in units of that of an end, at which orbits move
_ROUNDING = 1e-14  # largest move, in extents of the region, that says nothing
_RELAXING = 64  # periods of the cycle in which they come to the line along which they do
_AS_FORESEEN = 0.1  # least part of the move at an end that a power of the distance foresees
_END = 0.5**12  # of the length of a segment to which its ends are found


def _periodic(exact: PointMap, guess: Floats, period: int, extent: Floats) -> tuple[Floats, Floats] | None:
    """Return the periodic point nearest to a guess, by Gauss and Newton's method, and its derivative; None if none."""
    point, before = guess, np.inf
    for attempt in range(8):
        image, matrix = tangent(exact, point, period)
        residual = difference(image, point, exact.coordinates) / extent
        scaled = matrix * (extent / extent[:, None])
        if not (np.isfinite(residual).all() and np.isfinite(scaled).all()):
            return None
        if (np.abs(residual) * extent <= _PRECISE * resolution(point, extent)).all():
            multipliers = multipliers_of(scaled)
            neutral = abs(multipliers[0] - 1.0) <= _NEUTRAL and (np.abs(multipliers[1:]) < _CONTRACTING).all()
            return (point, scaled) if neutral else None
        left = float(np.abs(residual).max())
        if attempt >= _QUADRATIC and left > 0.1 * before:
            return None
        before = left
        # All but the neutral direction, however much smaller the next singular value is than the largest.
        u, sizes, v = np.linalg.svd(np.eye(len(point)) - scaled)
        steps = v[:-1].T @ ((u.T @ residual)[:-1] / np.maximum(sizes[:-1], 1e-12))
        point = wrap(point + steps * extent, exact.coordinates)
    return None


def traced(exact: PointMap, place: Floats, period: int, extent: Floats) -> tuple[Floats, Floats, bool] | None:
    """Return the periodic points beside one of them, in their order, its derivative, and whether they close a curve.

    None if it is alone.
    """
    first = _periodic(exact, place, period, extent)
    if first is None:
        return None
    ahead = np.linalg.svd(np.eye(len(place)) - first[1])[2][-1]

    def work(sign: float) -> tuple[list[Floats], bool]:
        return contexts[sign].run(_half, exact, first[0], sign * ahead, period, extent)

    # The thread of each half looks for a request to stop where this one does.
    contexts = {sign: copy_context() for sign in (-1.0, 1.0)}
    halves = dict(results_of(tuple(contexts), work))
    (behind, _), (before, closed) = halves[-1.0], halves[1.0]
    points = np.array([first[0], *before] if closed else [*behind[::-1], first[0], *before])
    return (points, first[1], closed) if len(points) > 8 else None


def _half(exact: PointMap, first: Floats, ahead: Floats, period: int, extent: Floats) -> tuple[list[Floats], bool]:
    """Return the periodic points on one side of the first, in their order, and whether they come back to it."""
    direction, point, length = ahead, first, 1.0 / _STEPS
    half: list[Floats] = []
    travelled, begun = 0.0, False
    while length >= max(_SHORTEST, travelled * _END) and len(half) < _MOST_POINTS:
        check_stop()
        guess = wrap(point + length * direction * extent, exact.coordinates)
        found = _periodic(exact, guess, period, extent)
        shift = np.zeros_like(point) if found is None else difference(found[0], point, exact.coordinates) / extent
        away = difference(guess if found is None else found[0], first, exact.coordinates) / extent
        if np.abs(away).max() > _FARTHEST:
            break
        if found is None or not 0.5 * length <= np.linalg.norm(shift) <= 2.0 * length:
            length *= 0.5
            continue
        if not begun and length < 1.0 / _STEPS:
            begun, length = True, length / 16.0  # a segment, or what is left of it, that is shorter than a step
            continue
        point, direction, begun = found[0], shift / np.linalg.norm(shift), True
        back = np.linalg.norm(difference(point, first, exact.coordinates) / extent)
        if len(half) > _TURNING and back < length:
            return half, True
        half.append(point)
        travelled += length
        length = min(max(length, travelled / 8.0), 1.0 / _STEPS)
    return half, False


def densely(points: Floats, exact: PointMap, extent: Floats, closed: bool = False) -> Floats:
    """Return many points along straight lines between some, at equal distances; of a closed curve without its end."""
    points = np.concatenate([points, points[: int(closed)]])
    steps = difference(points[1:], points[:-1], exact.coordinates)
    path = np.concatenate([points[:1], points[0] + np.cumsum(steps, axis=0)])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps / extent, axis=1))])
    where = np.linspace(0.0, length[-1], DENSE, endpoint=not closed)
    return wrap(np.stack([np.interp(where, length, column) for column in path.T], axis=-1), exact.coordinates)


def fades(exact: PointMap, points: Floats, period: int, extent: Floats) -> bool:
    """Tell whether some periodic points are no continuum, but places around one at which orbits hardly move.

    Beside a point whose multiplier is exactly 1 orbits move by a power of their distance from it, which is rounding up
    to where the points seem to end.  A continuum ends by a jump or a fold, or orbits move beyond its end by much more
    than that power says.
    """
    away = difference(points, points[len(points) // 2], exact.coordinates) / extent
    axis = np.linalg.svd(away, full_matrices=False)[2][0]
    middle = 0.5 * (away[(away @ axis).argmin()] + away[(away @ axis).argmax()])
    for end in (away[(away @ axis).argmin()], away[(away @ axis).argmax()]):
        far = np.outer(_BEYOND, end - middle) + middle
        places = wrap(points[len(points) // 2] + far * extent, exact.coordinates)
        path = path_of(exact, Orbits.starting(places), (_RELAXING + 1) * period)
        moves = difference(path[-1], path[-1 - period], exact.coordinates) / extent
        length, (at_end, near, beyond) = np.linalg.norm(end - middle), np.linalg.norm(moves, axis=1)
        if not _ROUNDING < near < beyond <= (1.0 - _CONTRACTING) * length:
            continue
        power = np.log(beyond / near) / np.log(_BEYOND[2] / _BEYOND[1])
        if at_end >= _AS_FORESEEN * beyond * _BEYOND[2] ** -power:
            return True
    return False
