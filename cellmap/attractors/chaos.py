"""Chaotic attractors, identified by their Lyapunov exponents and covered by boxes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.stopping import check_stop
from ..maps.coordinates import difference, turns_of, wrap
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor, Cover, Kind
from ..orbits.lyapunov import stretched
from ..orbits.lyapunov_qr import BLOCKS, is_positive
from ..orbits.newton import resolution
from .boxes import boxes_around, boxes_of, moved_boxes
from .creeping import creeping
from .transients import Reason, follow_on

_EXPONENT_PERIODS = 300
_SAMPLE_PERIODS = 1000
_ORBITS = 32
_BOXES = 64
_FLAT = 1e-3  # least width of all boxes together, in units of the extent: rounding must not tell orbits apart,
_ASIDE = 0.382  # nor on which side of an edge they are, where the map has its ends or its middle there
_LONGEST_RETURN = 128
_ZERO = 0.01  # largest size of an exponent that may be zero
_TOO_MANY = 3  # exponents that are zero on tori for which there is no trapping region


@dataclass(frozen=True, eq=False)
class Examination:
    """What became of orbits that had not settled.

    ``attractors``: chaotic attractors that were not known; ``reasons``: for each orbit that is on none of these, why it
    is undecided.
    """

    attractors: tuple[Attractor, ...]
    reasons: tuple[Reason, ...]


def chaotic_attractors(
    point_map: PointMap,
    states: NDArray[np.float64],
    extent: NDArray[np.float64] | None = None,
    known: Sequence[Attractor] = (),
    age: int = 0,
) -> list[Attractor]:
    """Return the chaotic attractors that :func:`examine` finds."""
    return list(examine(point_map, states, extent, known, age).attractors)


def examine(
    point_map: PointMap,
    states: NDArray[np.float64],
    extent: NDArray[np.float64] | None = None,
    known: Sequence[Attractor] = (),
    age: int = 0,
) -> Examination:
    """Find the chaotic attractors on which long-lived orbits move, and say why the other orbits are undecided.

    An orbit counts as chaotic where its largest Lyapunov exponent is positive, by five standard errors and more than
    1e-3 for each step, and as one on an attractor where volumes are not preserved along it.  An orbit that returns to
    where it was is on an unstable periodic orbit.  Orbits that share boxes are on one attractor.

    At most 32 of the states (n, d), evenly spread, are followed, for five times the `age` in periods that they have.
    If any of them leaves, or ends on a known attractor that is not chaotic, all of them are transients.  Orbits that
    stay among the boxes of a known chaotic attractor are on that attractor.  No orbit is on a new one if it shares
    boxes with a known chaotic attractor, or with the transient of another orbit to one.  The size of the region of
    interest is 1 by default.
    """
    chosen = states[np.unique(np.linspace(0, len(states) - 1, _ORBITS).round().astype(int))]
    reach = np.ones(point_map.dimension) if extent is None else extent
    _, reasons = _tested(point_map, chosen, reach, _EXPONENT_PERIODS)
    chaotic = reasons == Reason.TRANSIENT
    if not chaotic.any():
        return Examination((), tuple(map(Reason, reasons)))
    rows = np.flatnonzero(chaotic | (reasons == Reason.REGULAR))
    followed = follow_on(point_map, chosen[rows], chaotic[rows], known, age)
    reasons[rows] = followed.reasons
    rows, orbit = rows[followed.lasting], followed.orbits
    if not len(rows):
        return Examination((), tuple(map(Reason, reasons)))
    # The exponents of an attractor are those of orbits that have come to it; transients have others.
    exponents, doubts = _tested(point_map, orbit.points, reach, _SAMPLE_PERIODS)
    lasting = doubts == Reason.TRANSIENT
    reasons[rows[~lasting]] = doubts[~lasting]
    rows, orbit, exponents = rows[lasting], orbit[lasting], exponents[lasting]
    history = np.empty((_SAMPLE_PERIODS, *orbit.points.shape))
    for points in history:
        check_stop()
        point_map.advance(orbit, 1)
        points[:] = orbit.points
    rows, history, exponents = rows[orbit.alive], history[:, orbit.alive], exponents[orbit.alive]
    if not len(rows):
        return Examination((), tuple(map(Reason, reasons)))
    lower, widths = _lattice(history.reshape(-1, point_map.dimension), point_map, reach)
    met = [a.points for a in known if a.kind is Kind.CHAOTIC]
    clouds = [*history.swapaxes(0, 1), *met, *followed.transients]
    found = []
    for group in _groups(clouds, lower - _ASIDE * widths, widths, point_map):
        mine = group[group < len(rows)]
        if len(mine) < len(group):
            among = (group >= len(rows)) & (group < len(rows) + len(met))
            reasons[rows[mine]] = Reason.VISITING if among.any() else Reason.TRANSIENT
            continue
        points = history[:, mine].reshape(-1, point_map.dimension)
        spectrum = -np.sort(-exponents[mine], axis=-1)
        found.append(
            Attractor(
                Kind.CHAOTIC,
                0,
                points,
                (0,) * point_map.dimension,
                np.empty(0, complex),
                spectrum.mean(axis=0),
                point_map.coordinates,
                cover=_cover(points, lower, widths, point_map),
            )
        )
        reasons[rows[mine]] = None
    return Examination(tuple(found), tuple(Reason(r) for r in reasons if r is not None))


def _tested(
    point_map: PointMap, points: NDArray[np.float64], extent: NDArray[np.float64], periods: int
) -> tuple[NDArray[np.float64], NDArray[Any]]:
    """Return the exponents of orbits (n, d), and what these say of each (n,): TRANSIENT where it is chaotic.

    Exponents of at most 0.01 that are not surely positive count as zero, as they are on a torus.

    Those of an orbit that comes back to where it was are not computed: it is on a cycle whatever they are.  Neither are
    those of one that creeps to rest.
    """
    back, creeps = _returns(point_map, points, extent), creeping(point_map, points, extent).found
    exponents, errors = np.full(points.shape, np.nan), np.full(len(points), np.nan)
    moving = ~back & ~creeps
    if moving.any():
        exponents[moving], errors[moving] = lyapunov_exponents(point_map, points[moving], periods)
    with np.errstate(invalid="ignore"):
        chaotic = is_positive(exponents.max(axis=-1), errors)
        shrinking = np.abs(exponents.sum(axis=-1)) > 1e-6
        zeros = (np.abs(exponents) <= _ZERO).sum(axis=-1)
    reasons = np.full(len(points), Reason.REGULAR, object)
    reasons[zeros >= _TOO_MANY] = Reason.TORUS
    reasons[~shrinking] = Reason.PRESERVED
    reasons[chaotic] = Reason.TRANSIENT
    reasons[chaotic & ~shrinking] = Reason.CONSERVATIVE
    reasons[np.isnan(exponents).any(axis=-1)] = Reason.ENDING
    reasons[back] = Reason.PERIODIC
    reasons[creeps] = Reason.CREEPING  # so slowly that some of them seem to have come back
    return exponents, reasons


def _returns(point_map: PointMap, states: NDArray[np.float64], extent: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which orbits come back to within rounding of where they were."""
    orbit = Orbits.starting(states.copy())
    back = np.zeros(len(states), bool)
    for _ in range(_LONGEST_RETURN):
        check_stop()
        point_map.advance(orbit, 1)
        apart = np.abs(difference(orbit.points, states, point_map.coordinates))
        with np.errstate(invalid="ignore"):
            back |= (apart <= 1e-7 * resolution(states, extent)).all(axis=-1)
    return back


def lyapunov_exponents(
    point_map: PointMap, initial_conditions: NDArray[np.float64], periods: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the exponents per step (n, d) along orbits and the standard error (n,) of the largest; NaN where one ends.

    Their order is that of the axes of the frame that is carried along: the largest comes first unless an orbit sits
    where the map keeps the axes.
    """
    exact = point_map.without_table
    orbits = Orbits.starting(wrap(initial_conditions, exact.coordinates))
    frames = np.broadcast_to(np.eye(exact.dimension), (*initial_conditions.shape, exact.dimension)).copy()
    length = periods // BLOCKS
    growth = np.array([stretched(exact, orbits, frames, length) for _ in range(BLOCKS)])
    total = growth.sum(axis=0) + stretched(exact, orbits, frames, periods - BLOCKS * length)
    with np.errstate(invalid="ignore"):  # a vanishing derivative has an infinite logarithm
        errors = (growth / length).std(axis=0, ddof=1) / np.sqrt(BLOCKS)
    total[~orbits.alive] = errors[~orbits.alive] = np.nan
    exponents = total / periods
    largest = np.argmax(np.where(np.isnan(exponents), -np.inf, exponents), axis=-1)
    return exponents, np.take_along_axis(errors, largest[:, None], axis=-1)[:, 0]


def _lattice(
    points: NDArray[np.float64], point_map: PointMap, extent: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Boxes that cut the bounding box of the points, or the circle, into equal parts."""
    cut, turn = turns_of(point_map.coordinates)
    lower = np.where(turn > 0, cut, points.min(axis=0))
    span = np.where(turn > 0, turn, np.maximum(np.ptp(points, axis=0), _FLAT * extent))
    return lower, span / _BOXES


def _groups(
    clouds: Sequence[NDArray[np.float64]],
    lower: NDArray[np.float64],
    widths: NDArray[np.float64],
    point_map: PointMap,
) -> list[NDArray[np.int64]]:
    """Sort orbits, each given by its points, into groups that visit common boxes."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    boxes = boxes_of(np.concatenate(clouds), lower, widths, point_map)
    _, keys = np.unique(boxes, axis=0, return_inverse=True)
    who = np.repeat(np.arange(len(clouds)), [len(cloud) for cloud in clouds])
    size = len(clouds) + keys.max() + 1
    graph = coo_array((np.ones(len(keys)), (who, len(clouds) + keys)), shape=(size, size))
    _, group = connected_components(graph, directed=False)
    return [np.flatnonzero(group[: len(clouds)] == g) for g in np.unique(group[: len(clouds)])]


def _cover(
    points: NDArray[np.float64], lower: NDArray[np.float64], widths: NDArray[np.float64], point_map: PointMap
) -> Cover:
    """Boxes of the points and all their neighbours."""
    visited = np.unique(boxes_of(points, lower, widths, point_map), axis=0)
    shifts = np.array(list(itertools.product((-1, 0, 1), repeat=visited.shape[1])))
    around = boxes_around(widths, turns_of(point_map.coordinates)[1])
    return Cover(lower, widths, moved_boxes(visited, shifts, around))
