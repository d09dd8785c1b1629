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
    tangent_step: Callable[[Orbits], None], points: Floats, dimension: int, directions: int | None = None
) -> tuple[Floats, Floats]:
    """Return images (..., d) and derivatives (..., d, k) from a step of (x, v): a lane for each direction v.

    The directions are those of the first k coordinates, by default of all d.
    """
    d, k = dimension, dimension if directions is None else directions
    flat = points.reshape(-1, d)
    states = np.zeros((len(flat), k, 2 * d))
    states[:, :, :d] = flat[:, None, :]
    states[:, :, d:] = np.eye(k, d)
    orbits = Orbits.starting(states.reshape(-1, 2 * d))
    advance_on_threads(lambda some, _: tangent_step(some), orbits, 1)
    result = orbits.points.reshape(len(flat), k, 2 * d)
    images = result[:, 0, :d].reshape(points.shape)
    return images, result[:, :, d:].transpose(0, 2, 1).reshape(*points.shape, k)


def tangent(
    point_map: PointMap, points: Floats, periods: int | Ints = 1, states: int | None = None
) -> tuple[Floats, Floats]:
    """Return unwrapped images (..., d) after some periods and their derivatives (..., k, k) by the points.

    ``periods`` is one number for all points or one for each.  Derivatives are by all coordinates, or by the first k
    that are ``states``, where the others are parameters.  Images come from the same integration as the derivatives,
    whose tolerance is 1e-12 or better.
    """
    exact = point_map.without_table
    d = exact.dimension
    k = d if states is None else states
    step = None if k == d else _tangent_step(exact)
    place = np.array(points, dtype=float).reshape(-1, d)
    total = np.broadcast_to(np.eye(k), (len(place), k, k)).copy()
    rounds = np.broadcast_to(periods, points.shape[:-1]).ravel()
    alike = np.ndim(periods) == 0
    for q in range(int(rounds.max(initial=0))):
        check_stop()
        rows = slice(None) if alike else np.flatnonzero(rounds > q)
        wrapped = wrap(place[rows], exact.coordinates)
        images, matrices = _one_step(exact, wrapped) if step is None else tangent_by_lanes(step, wrapped, d, k)
        place[rows] += images - wrapped
        total[rows] = matrices[..., :k, :k] @ total[rows]
    return place.reshape(points.shape), total.reshape(*points.shape[:-1], k, k)


@functools.lru_cache(maxsize=8)
def _tangent_step(exact: PointMap) -> Callable[[Orbits], None] | None:
    """Return a step of states with one tangent vector each; None where the formulas are unknown."""
    return None if exact.spec is None else exact.spec.curve_step(1)


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
    return tangent(exact, initial_conditions, whole_number("periods", periods))[1]


def _one_step(exact: PointMap, points: Floats) -> tuple[Floats, Floats]:
    if exact.tangent is not None:
        try:
            images, matrices = exact.tangent(points)
        except NotDifferentiableError:
            pass
        else:
            lost = ~np.isfinite(matrices).all(axis=(-2, -1)) & np.isfinite(points).all(axis=-1)
            if lost.any():  # the derivative of the right-hand side has a pole, as at the border of a root
                images[lost] = follow(exact, points[lost], 1).unwrapped
                matrices[lost] = _central_differences(exact, points[lost])
            return images, matrices
    return follow(exact, points, 1).unwrapped, _central_differences(exact, points)


def _central_differences(exact: PointMap, points: Floats) -> Floats:
    """Derivative by symmetric differences at three distances."""
    columns = []
    centre = follow(exact, points, 1).unwrapped
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
