"""Derivative matrices of point maps."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Floats, Ints
from .._lib.checks import whole_number
from .._lib.signatures import checked
from .._lib.stopping import check_stop
from .coordinates import difference, state_points, wrap
from .orbit_batch import Orbits
from .point_map import PointMap, follow
from .side_by_side import advance_on_threads

R = TypeVar("R")


class NotDifferentiableError(TypeError):
    """The map's function is not traceable, so its exact derivatives are not known."""


def derivatives_of(name: str, compiled: R | None) -> R:
    """Return the compiled derivatives of a map, which are None where they are not known."""
    if compiled is None:
        raise NotDifferentiableError(f"no derivatives of the right-hand side of {name} are known")
    return compiled


def tangent_by_lanes(
    tangent_step: Callable[[Orbits], None],
    points: Floats,
    dimension: int,
    directions: int | None = None,
    together: int = 1,
) -> tuple[Floats, Floats]:
    """Return images (..., d) and derivatives (..., d, k) from a step of (x, v, w, ...) with some vectors in a lane.

    The directions are those of the first k coordinates, by default of all d; a lane has so many of them `together`.
    """
    d, k = dimension, dimension if directions is None else directions
    flat, lanes = points.reshape(-1, d), -(-k // together)
    states = np.empty((len(flat), lanes, 1 + together, d))
    states[:] = _directions(d, lanes, together)
    states[:, :, 0] = flat[:, None, :]
    orbits = Orbits.starting(states.reshape(-1, (1 + together) * d))
    advance_on_threads(lambda some, _: tangent_step(some), orbits, 1)
    result = orbits.points.reshape(states.shape)
    images = result[:, 0, 0].reshape(points.shape)
    vectors = result[:, :, 1:].reshape(len(flat), lanes * together, d)[:, :k]
    return images, vectors.transpose(0, 2, 1).reshape(*points.shape, k)


@functools.lru_cache(maxsize=64)
def _directions(d: int, lanes: int, together: int) -> Floats:
    """Return the vectors that lanes begin with behind their state; those in a lane do not depend on how many are asked.

    Shape (lanes, 1 + together, d).
    """
    found = np.zeros((lanes, 1 + together, d))
    for j in range(min(d, lanes * together)):
        found[j // together, 1 + j % together, j] = 1.0
    return found


def tangent(
    point_map: PointMap, points: Floats, periods: int | Ints = 1, states: int | None = None, coarse: bool = False
) -> tuple[Floats, Floats]:
    """Return unwrapped images (..., d) after some periods and their derivatives (..., k, k) by the points.

    ``periods`` is one number for all points or one for each.  Derivatives are by all coordinates, or by the first k
    that are ``states``, where the others are parameters.  Images come from the same integration as the derivatives,
    whose tolerance is 1e-12 or better, as Newton's method needs it; if `coarse`, it is that of the map, or 1e-8 if that
    is smaller.
    """
    exact = point_map.without_table
    d = exact.dimension
    k = d if states is None else states
    derivative = exact.coarse_tangent if coarse and exact.coarse_tangent is not None else exact.tangent
    of_states = None if k == d else _derivative_by_states(exact)
    if of_states is not None:
        derivative = functools.partial(of_states, directions=k)
    place = np.array(points, dtype=float).reshape(-1, d)
    total = np.empty((len(place), k, k))
    total[:] = np.eye(k)
    rounds = None if np.ndim(periods) == 0 else np.broadcast_to(periods, points.shape[:-1]).ravel()
    for q in range(int(periods if rounds is None else rounds.max(initial=0))):
        check_stop()
        rows = slice(None) if rounds is None else np.flatnonzero(rounds > q)
        wrapped = wrap(place[rows], exact.coordinates)
        images, matrices = _one_step(exact, wrapped, derivative)
        place[rows] += images - wrapped
        with np.errstate(over="ignore", invalid="ignore"):  # derivatives beyond 1e308 are known to be infinite, or NaN
            total[rows] = matrices[..., :k, :k] @ total[rows]
    return place.reshape(points.shape), total.reshape(*points.shape[:-1], k, k)


@functools.lru_cache(maxsize=8)
def _derivative_by_states(exact: PointMap) -> Callable[..., tuple[Floats, Floats]] | None:
    """Return images and derivatives of a step by the first `directions` coordinates; None where there are none."""
    found = None if exact.spec is None else exact.spec.parts(1)
    return None if found is None else found[0]


@checked
def jacobian(point_map: PointMap, points: ArrayLike, periods: int = 1) -> Floats:
    """Return the Jacobian matrix of a map after some periods, with respect to the initial condition.

    Parameters
    ----------
    point_map : PointMap
        An exact map; for an interpolated map, the exact map behind it is used.
    points : array_like, shape (..., dimension)
        Initial conditions.
    periods : int, optional
        Steps of the map.

    Returns
    -------
    ndarray, shape (..., dimension, dimension)
        Entry (i, j) is the derivative of component i of the image with respect to component j of the initial condition.
        It is computed from the variational equation, or by central differences of order 6 if the right-hand side cannot
        be traced or its derivative has a pole on the orbit.  Where the orbit grazes a surface, see
        :func:`grazing_distance`, there is no derivative.

    Notes
    -----
    The columns of a stroboscopic map are as accurate as its images: by the integrator's estimate the error of each, by
    sums of absolute values, is at most ten times `rtol` (1e-8 where that is larger) times its length, for one period.
    With a map of ``rtol=1e-12`` multipliers of strongly contracting directions have more digits.  Derivatives of flows
    with events or stiff right-hand sides, and of Poincare maps, always have a tolerance of 1e-12.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> henon = discrete_map(lambda x, p: (1 - p.a * x[0]**2 + x[1], p.b * x[0]), {"a": 1.4, "b": 0.3}, ("x", "y"))
    >>> jacobian(henon, [0.5, 0.0])
    array([[-1.4,  1. ],
           [ 0.3,  0. ]])
    """
    exact = point_map.without_table
    initial_conditions = state_points("points", points, exact.coordinates)
    return tangent(exact, initial_conditions, whole_number("periods", periods), coarse=True)[1]


def _one_step(
    exact: PointMap, points: Floats, derivative: Callable[[Floats], tuple[Floats, Floats]] | None
) -> tuple[Floats, Floats]:
    if derivative is not None:
        try:
            images, matrices = derivative(points)
        except NotDifferentiableError:
            pass
        else:
            if np.isfinite(matrices).all():
                return images, matrices
            lost = ~np.isfinite(matrices).all(axis=(-2, -1)) & np.isfinite(points).all(axis=-1)
            if lost.any():  # the derivative of the right-hand side has a pole, as at the border of a root
                images[lost], differences = _differences(exact, points[lost])
                matrices[lost] = differences[..., : matrices.shape[-1]]
            return images, matrices
    return _differences(exact, points)


def _differences(exact: PointMap, points: Floats) -> tuple[Floats, Floats]:
    """Return images and derivatives by central differences; NaN where there is no image, which is tried once."""
    images = follow(exact, points, 1).unwrapped
    matrices, there = np.full((*points.shape, exact.dimension), np.nan), np.isfinite(images).all(axis=-1)
    matrices[there] = _central_differences(exact, points[there], images[there])
    return images, matrices


def _central_differences(exact: PointMap, points: Floats, centre: Floats) -> Floats:
    """Derivative by symmetric differences at three distances, around points and their images."""
    columns = []
    for j in range(exact.dimension):
        h = 1e-2 * np.maximum(np.abs(points[..., j]), 1e-1)
        column = np.zeros(points.shape)
        for k, weight in ((1, 45.0), (2, -9.0), (3, 1.0)):
            for sign in (1, -1):
                moved = points.copy()
                moved[..., j] += sign * k * h
                image = follow(exact, moved, 1)
                shift = difference(image.points, centre, exact.coordinates)
                column = column + sign * weight * shift / (60.0 * h[..., None])
        columns.append(column)
    return np.stack(columns, axis=-1)
