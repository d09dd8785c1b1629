"""Chaotic attractors: recognised by their exponents, held by boxes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .attractor import Attractor, Cover, Kind
from .coordinates import difference, turns_of
from .exponents import BLOCKS, stretching
from .jacobian import tangent
from .orbit_batch import Orbits
from .periodic import resolution
from .pointmap import PointMap
from .settling import Catalogue, box_keys, boxes_around, boxes_of, moved_boxes

_EXPONENT_PERIODS = 300
_SAMPLE_PERIODS = 1000
_ORBITS = 32
_BOXES = 64
_LONGEST_RETURN = 128
_ENDURANCE = 5  # times its age that a chaotic orbit has to last on
_LOOK_EVERY = 50


def chaotic_attractors(
    point_map: PointMap,
    states: NDArray[np.float64],
    extent: NDArray[np.float64] | None = None,
    known: Sequence[Attractor] = (),
    age: int = 0,
) -> list[Attractor]:
    """Return the chaotic attractors on which long-lived orbits move.

    An orbit counts as chaotic where its largest Lyapunov exponent is positive, by five standard errors and more than
    1e-3 for each step, and as one on an attractor where volumes are not preserved along it.  An orbit that returns to
    where it was sits on an unstable periodic point.  If any of the orbits ends on a known attractor within five times
    the periods that they have lasted, all of them are transients.  Orbits that share boxes are on one attractor.

    Parameters
    ----------
    point_map : PointMap
        The map; exponents come from its exact map.
    states : ndarray, shape (n, dimension)
        States that have outlived all transients.
    extent : ndarray, shape (dimension,), optional
        Size of the region of interest, 1 by default.
    known : sequence of Attractor, optional
        Attractors that the orbits might still end on.
    age : int, optional
        Periods that the orbits have lasted.

    Returns
    -------
    list of Attractor
        With a sample of their points and a cover.
    """
    chosen = states[np.unique(np.linspace(0, len(states) - 1, _ORBITS).round().astype(int))]
    exponents, errors = lyapunov_exponents(point_map, chosen, _EXPONENT_PERIODS)
    with np.errstate(invalid="ignore"):
        chaotic = (exponents.max(axis=-1) > np.maximum(5.0 * errors, 1e-3)) & (np.abs(exponents.sum(axis=-1)) > 1e-6)
    chaotic &= ~_returns(point_map, chosen, np.ones(point_map.dimension) if extent is None else extent)
    if not chaotic.any():
        return []
    orbit = Orbits.starting(chosen[chaotic].copy())
    catalogue = Catalogue.of(known, point_map)
    for _ in range(0, _ENDURANCE * age, _LOOK_EVERY):
        point_map.advance(orbit, _LOOK_EVERY)
        if not orbit.alive.all() or (catalogue.owners_of(orbit.points) >= 0).any():
            return []
    history = np.empty((_SAMPLE_PERIODS, *orbit.points.shape))
    for k in range(_SAMPLE_PERIODS):
        point_map.advance(orbit, 1)
        history[k] = orbit.points
    bound = orbit.alive
    if not bound.any():
        return []
    history, spectra = history[:, bound], -np.sort(-exponents[chaotic][bound], axis=-1)
    lower, widths = _lattice(history.reshape(-1, point_map.dimension), point_map)
    groups = _groups(history, lower, widths, point_map)
    return [
        Attractor(
            Kind.CHAOTIC,
            0,
            history[:, group].reshape(-1, point_map.dimension),
            (0,) * point_map.dimension,
            np.empty(0, complex),
            spectra[group].mean(axis=0),
            point_map.coordinates,
            cover=_cover(history[:, group].reshape(-1, point_map.dimension), lower, widths, point_map),
        )
        for group in groups
    ]


def _returns(point_map: PointMap, states: NDArray[np.float64], extent: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which orbits come back to within rounding of where they were."""
    orbit = Orbits.starting(states.copy())
    back = np.zeros(len(states), bool)
    for _ in range(_LONGEST_RETURN):
        point_map.advance(orbit, 1)
        apart = np.abs(difference(orbit.points, states, point_map.coordinates))
        with np.errstate(invalid="ignore"):
            back |= (apart <= 1e-7 * resolution(states, extent)).all(axis=-1)
    return back


def lyapunov_exponents(
    point_map: PointMap, starts: NDArray[np.float64], periods: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the exponents per step (n, d) along orbits and the standard error (n,) of the largest; NaN where one ends.

    Their order is that of the axes of the frame that is carried along: the largest comes first unless an orbit sits
    where the map keeps the axes.
    """
    exact = point_map.exact or point_map
    place = np.array(starts, dtype=float)
    matrices = np.full((len(place), periods, exact.dimension, exact.dimension), np.nan)
    alive = np.arange(len(place))
    for k in range(periods):
        images, derivatives = tangent(exact, place[alive])
        lasting = np.isfinite(images).all(axis=-1)
        alive, images = alive[lasting], images[lasting]
        matrices[alive, k], place[alive] = derivatives[lasting], images
    logs = stretching(matrices)
    with np.errstate(invalid="ignore"):  # a vanishing derivative has an infinite logarithm
        blocks = logs[: periods - periods % BLOCKS].reshape(BLOCKS, -1, *place.shape).mean(axis=1)
        errors = blocks.std(axis=0, ddof=1) / np.sqrt(BLOCKS)
    exponents = logs.mean(axis=0)
    largest = np.argmax(np.where(np.isnan(exponents), -np.inf, exponents), axis=-1)
    return exponents, np.take_along_axis(errors, largest[:, None], axis=-1)[:, 0]


def _lattice(points: NDArray[np.float64], point_map: PointMap) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Boxes that cut the bounding box of the points, or the circle, into equal parts."""
    cut, turn = turns_of(point_map.coordinates)
    lower = np.where(turn > 0, cut, points.min(axis=0))
    span = np.where(turn > 0, turn, np.maximum(np.ptp(points, axis=0), 1e-12))
    return lower, span / _BOXES


def _groups(
    history: NDArray[np.float64], lower: NDArray[np.float64], widths: NDArray[np.float64], point_map: PointMap
) -> list[NDArray[np.int64]]:
    """Sort orbits into groups that visit common boxes."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    steps, orbits, d = history.shape
    boxes = boxes_of(history.reshape(-1, d), lower, widths, point_map)
    _, keys = np.unique(box_keys(boxes, boxes), return_inverse=True)
    who = np.tile(np.arange(orbits), steps)
    size = orbits + keys.max() + 1
    graph = coo_array((np.ones(len(keys)), (who, orbits + keys)), shape=(size, size))
    _, group = connected_components(graph, directed=False)
    return [np.flatnonzero(group[:orbits] == g) for g in np.unique(group[:orbits])]


def _cover(
    points: NDArray[np.float64], lower: NDArray[np.float64], widths: NDArray[np.float64], point_map: PointMap
) -> Cover:
    """Boxes of the points and all their neighbours."""
    visited = np.unique(boxes_of(points, lower, widths, point_map), axis=0)
    shifts = np.array(list(itertools.product((-1, 0, 1), repeat=visited.shape[1])))
    around = boxes_around(widths, turns_of(point_map.coordinates)[1])
    return Cover(lower, widths, moved_boxes(visited, shifts, around))
