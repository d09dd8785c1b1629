"""Grazing: orbits that touch a surface of impacts, or of a discontinuity, without passing through it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._compiled.codegen.filippov import SwitchingTrace
from .._compiled.codegen.kernel import traced_switching
from .._compiled.kernels.grazing import DEPTH, EXTENT, IMPACTS, RECORDS
from .._compiled.kernels.lane import COUNT, WATCHED
from .._lib.arrays import Floats
from .._lib.checks import whole_number
from .._lib.signatures import checked
from .coordinates import state_points, wrap
from .discrete import Discrete
from .integration import Flow, in_lanes, out_of_lanes
from .parameters_as_states import Swept
from .point_map import PointMap
from .stroboscopic import Stroboscopic

GRAZING = 1e-6
"""Distance from grazing, as :func:`grazing_distance` measures it, up to which an orbit counts as one that grazes."""

_STEPS = 64, 1024


@checked
def grazing_distance(point_map: PointMap, points: ArrayLike, periods: int = 1) -> Floats:
    """Return how near orbits come to grazing: to touching a surface of impacts or of a discontinuity tangentially.

    At grazing the saltation matrix is infinite on one side and the identity on the other, so that a Jacobian matrix and
    its multipliers have no meaning there; near grazing they hold in a neighbourhood as small as this distance.

    Parameters
    ----------
    point_map : PointMap
        A stroboscopic map; for an interpolated map, the exact map behind it is used.
    points : array_like, shape (..., dimension)
        Initial conditions.
    periods : int, optional
        Steps of the map.

    Returns
    -------
    ndarray, shape (...)
        The least distance from a surface at which an orbit turns round, before it or, where it passes through with a
        small velocity, behind it (the depth that it would reach if there were no surface).  In units of the largest
        distance from the surface that is seen on the orbit.  Infinite for orbits that turn round at no surface, for
        smooth systems, and for discrete maps; NaN where surfaces are not known (other maps, right-hand sides without
        formulas), or where the orbit ends.

    References
    ----------
    Nordmark, Journal of Sound and Vibration 145 (1991) 279.

    Examples
    --------
    >>> from math import cos, pi
    >>> from cellmap import ForcedSystem, stroboscopic_map
    >>> from cellmap.maps import Impact
    >>> wall = Impact(lambda t, x, p: p.gap - x[0], lambda t, x, p: (x[0], -0.8 * x[1]))
    >>> mass = ForcedSystem(lambda t, x, p: (x[1], -x[0]), {"gap": 1.0}, 2 * pi, ("q", "v"), impacts=[wall])
    >>> grazing_distance(stroboscopic_map(mass), [[0.5, 0.0], [0.999, 0.0]]).round(4)
    array([0.3333, 0.0005])
    """
    exact = point_map.without_table
    places = state_points("points", points, exact.coordinates)
    return np.abs(contacts(exact, places, whole_number("periods", periods))[0])


def contacts(exact: PointMap, points: Floats, periods: int) -> tuple[Floats, Floats]:
    """Return how near orbits come to grazing (...), and their impacts (...), minus infinity where they rest.

    The distance is that of :func:`grazing_distance`, below 0 where the surface is passed.
    """
    spec = exact.spec.vectorised if isinstance(exact.spec, Swept) else exact.spec
    flat = points.reshape(-1, exact.dimension)
    nearest, impacts = np.full(len(flat), np.inf), np.zeros(len(flat))
    if isinstance(spec, Stroboscopic):
        traced = _surfaces(spec)
        matters = [] if traced is None else _where_flows_differ(traced)
        if traced is None and spec.motion.unknown_formulas:
            nearest[:] = np.nan
        for _ in range(periods if any(matters) else 0):
            flat, distances, struck = _watched(spec.motion, wrap(flat, exact.coordinates))
            own = distances[:, matters]
            least = np.take_along_axis(own, np.abs(own).argmin(axis=1)[:, None], axis=1)[:, 0]
            nearest = np.where(np.abs(nearest) < np.abs(least), nearest, least)
            impacts += struck.sum(axis=1)
    elif not isinstance(spec, Discrete):
        nearest[:] = np.nan
    return nearest.reshape(points.shape[:-1]), impacts.reshape(points.shape[:-1])


def _surfaces(spec: Stroboscopic) -> SwitchingTrace | None:
    """Return the formulas of a map whose period is integrated from event to event."""
    if spec.motion.kernel.advance.context.size <= WATCHED or spec.motion.kernel.own_steps:
        return None
    system = spec.system
    found = traced_switching(system.functions, system.dimension, tuple(system.params))
    return None if isinstance(found, str) else found


def _where_flows_differ(traced: SwitchingTrace) -> list[bool]:
    """Tell at which surfaces there are impacts, or vector fields that differ on both sides."""
    struck = traced.impacts or (None,) * len(traced.surfaces)
    return [i is not None or not all(e.vanishes for e in jump) for i, jump in zip(struck, traced.jumps, strict=True)]


def _watched(motion: Flow, points: Floats) -> tuple[Floats, Floats, Floats]:
    """Return images (n, d) of points, and how near they come to each surface and strike it, shape (n, surfaces)."""
    n = len(points)
    context = motion.kernel.advance.context.copy()
    kept = np.zeros((n, int(context[COUNT]), RECORDS))
    kept[..., DEPTH] = np.inf
    context[WATCHED] = kept.ctypes.data
    x = in_lanes(points)
    expected = 4.0 * motion.steps_at(points, _STEPS[0])
    steps = max(motion.fewest_steps, int(np.clip(np.nan_to_num(expected, posinf=_STEPS[1]), *_STEPS)))
    errors = np.zeros_like(x)
    advance = type(motion.kernel.advance)(motion.kernel.advance.address, motion.kernel.advance.code, context)
    advance(x, np.full(len(x), steps), motion.begin, motion.length, motion.parameters, errors, n)
    images = out_of_lanes(x, n)
    ended = ~(out_of_lanes(errors, n) < 1e300).all(axis=1)
    distances = kept[..., DEPTH] / np.maximum(kept[..., EXTENT], 1e-300)
    distances[ended | ~np.isfinite(images).all(axis=1)] = np.nan
    return images, distances, kept[..., IMPACTS]
