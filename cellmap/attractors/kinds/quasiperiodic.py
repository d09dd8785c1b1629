"""Quasi-periodic attractors: invariant circles and tori of maps, and limit cycles of autonomous systems."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import isqrt

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints, evenly
from ...maps.orbit_batch import Orbits
from ...maps.paths import moved_on
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, Kind, aperiodic
from ...orbits.invariant_circle import InvariantCircle, curve_size, fitted_circle
from ...orbits.invariant_torus import fitted_torus
from ..regions.boxes import inside_cover
from ..regions.lyapunov_regions import Afford, always
from ..regions.tube import (
    DENSE,
    FIRST_FACTOR,
    MOST_STEPS,
    SAMPLED,
    Curves,
    DenseTorus,
    cover_of_tube,
    floor_of,
    lengths_beside,
    verified_tube,
)
from .continua import closed_orbits, new_continua
from .creeping import creeping
from .cycles import verified_cycles
from .ends import Ends
from .exponents import Growing
from .limit_cycles import AHEAD, autonomous, limit_cycles
from .recurrence import recurrent_attractors

_EXPONENT_PERIODS = 500
_SEEN = 128  # periods in which it is seen how displacements from an orbit grow
_SAMPLE = 512  # points of an attractor that are kept


@dataclass(frozen=True, eq=False)
class Found:
    """Quasi-periodic attractors, and cycles that orbits turned out to be on or near: a point and a period of each."""

    attractors: list[Attractor]
    cycles: list[tuple[Floats, int]]


def look(ends: Ends) -> list[Attractor]:
    """Return invariant circles to which orbits come, and the long cycles that they turned out to be on instead."""
    if not ends.mature or ends.wandering:
        return []
    point_map, extent, examined = ends.point_map, ends.extent, ends.examined
    states = examined.looked_along(ends.points, ends.age, len(ends.known), ends.last)
    if not len(states):
        return []
    found = quasiperiodic_attractors(point_map, states, extent, ends.age, ends.known, ends.last, examined.afford)
    fresh = found.attractors + verified_cycles(ends, found.cycles, found.attractors)
    if fresh or not found.cycles:
        return fresh
    # Orbits that rest have closed after any number of periods, the least of which counts.
    points, longest = np.array([point for point, _ in found.cycles]), max(period for _, period in found.cycles)
    return new_continua(ends, closed_orbits(point_map, points, extent, longest))


def quasiperiodic_attractors(
    point_map: PointMap,
    states: Floats,
    extent: Floats,
    age: int,
    known: Sequence[Attractor] = (),
    slow: bool = True,
    afford: Afford = always,
) -> Found:
    """Return the invariant circles to which orbits of some age come, verified to attract.

    A few of the orbits are followed, first for as long again as they have lasted.  An orbit is quasi-periodic if a
    Fourier series of its points satisfies the equation of invariance, its rotation number is no rational number within
    ten times its error, of a denominator that this error allows, its largest Lyapunov exponent is zero within 0.01, and
    a tube around the curve is seen to contract.  The boxes of this tube are the trapping region.

    Orbits with two zero exponents are tried as tori of two frequencies, in the same way.

    Orbits that drift slowly along a curve are followed for much longer than they have lasted, if `slow`.

    In more than four dimensions they are found by recurrence, and not verified, see :func:`recurrent_attractors`.

    Limit cycles of autonomous systems are found as periodic orbits of the flow, see :func:`limit_cycles`.
    """
    exact, most = point_map.without_table, max(MOST_STEPS, age)
    spec = autonomous(exact)
    by_recurrence = partial(recurrent_attractors, exact, states, extent, age, known, slow, afford)
    if spec is None and exact.dimension > SAMPLED:
        return Found(*by_recurrence())
    later = Orbits.starting(states[evenly(len(states), AHEAD)])
    moved_on(exact, later, age)
    later = later[np.flatnonzero(later.alive)]
    signs, shrinking = _signs(exact, later.points, extent, most)
    if spec is not None:
        cycles = limit_cycles(exact, spec, later.points[signs == 0], extent, age, known, afford)
        if cycles:
            return Found(cycles, [])
    if exact.dimension > SAMPLED:
        return Found(*by_recurrence())
    found = Found([], [])
    for before in (later[np.array([k])] for k in np.flatnonzero((signs <= 0) & shrinking)):
        attractors = [*known, *found.attractors]
        if not len(_outside(before.points, attractors, exact)) or creeping(exact, before.points, extent).found[0]:
            continue
        attractor, fitted = None, None
        if spec is None:
            fitted, period = fitted_circle(exact, before.points[0], extent, age, slow)
            if period:
                found.cycles.append((before.points[0], period))
        if fitted is not None:
            curves = _curves(fitted.circle, exact, extent)
            if not _is_new(curves.points[:, :: DENSE // _SAMPLE], attractors, exact):
                continue
            attractor = _on_curves(fitted.circle, curves, extent, most)
        if attractor is None and exact.dimension > 2 and not len(found.cycles):
            attractor = _on_torus(exact, before.points[0], extent, most)
        if attractor is not None and _is_new(attractor.points, attractors, exact):
            found.attractors.append(attractor)
    return found


def _signs(exact: PointMap, points: Floats, extent: Floats, most: int) -> tuple[Ints, Bools]:
    """Return signs of the largest exponents of orbits (n, d), and beside which a tube may contract in `most` steps.

    Lengths along an invariant circle are kept in the mean, so that the slowest contraction across it is at most that of
    volumes, to the power 1/(dimension - 1); what an orbit does in few periods may be twice as fast as in the mean.
    """
    d = exact.dimension
    growth = Growing.along(exact, points, _SEEN, extent, None if d <= SAMPLED else 1)
    with np.errstate(invalid="ignore"):  # a vanishing derivative has an infinite logarithm
        shrinking = -2.0 * most * growth.exponents.sum(axis=1) >= -np.log(FIRST_FACTOR) * (d - 1)
    return growth.signs, shrinking | (d == 1)


def _curves(circle: InvariantCircle, exact: PointMap, extent: Floats) -> Curves:
    points = circle.points(np.arange(DENSE) / DENSE, exact.coordinates)
    return Curves(exact, points, _size(points, exact, extent))


def _on_curves(circle: InvariantCircle, curves: Curves, extent: Floats, most: int) -> Attractor | None:
    """Return the circle to which an orbit has come, verified to attract."""
    exact, points = curves.exact, curves.points
    tube = verified_tube(curves, extent, 10.0 * max(circle.invariance_error, floor_of(curves)), most)
    cover = None if tube is None else cover_of_tube(curves, tube)
    if cover is None:
        return None
    growth = Growing.along(exact, points[0, :1], _EXPONENT_PERIODS)
    order = np.argsort(-growth.exponents[0])
    exponents, zero = growth.exponents[0, order], growth.zero[0, order]
    if not zero[0]:
        return None
    kept = points[:, :: max(1, DENSE * len(points) // _SAMPLE)].reshape(-1, exact.dimension)
    return aperiodic(Kind.QUASIPERIODIC, kept, exponents, exact.coordinates, cover=cover, circle=circle)


def _on_torus(exact: PointMap, state: Floats, extent: Floats, most: int) -> Attractor | None:
    """Return the torus of two frequencies to which an orbit has come, verified to attract."""
    growth = Growing.along(exact.without_table, state[None], _EXPONENT_PERIODS)
    order = np.argsort(-growth.exponents[0])
    exponents, zero = growth.exponents[0, order], growth.zero[0, order]
    if not zero[:2].all() or zero[2] or exponents[2] > 0.0:
        return None
    torus = fitted_torus(exact, state)
    if torus is None:
        return None
    phases = np.stack(np.meshgrid(*2 * [np.linspace(0.0, 1.0, isqrt(_SAMPLE), endpoint=False)]), axis=-1).reshape(-1, 2)
    points = torus.points(phases, exact.coordinates)
    dense = DenseTorus(exact, torus, _size(points[None], exact, extent))
    tube = verified_tube(dense, np.maximum(extent, dense.size), 10.0 * torus.invariance_error, most)
    cover = None if tube is None else cover_of_tube(dense, tube)
    if cover is None:
        return None
    return aperiodic(Kind.QUASIPERIODIC, points, exponents, exact.coordinates, cover=cover, torus=torus)


def _size(points: Floats, exact: PointMap, extent: Floats) -> Floats:
    """Return lengths along each axis in which a tube around curves is about as wide in all directions."""
    d = exact.dimension
    span = np.max([curve_size(curve, exact.coordinates) for curve in points.reshape(len(points), -1, d)], axis=0)
    return lengths_beside(span, extent)


def _is_new(points: Floats, known: Sequence[Attractor], point_map: PointMap) -> bool:
    """Tell whether points of an attractor are on none of those known: the boxes of a tube need not cover all of it."""
    verified, points = [a for a in known if a.verified], points.reshape(-1, point_map.dimension)
    every = len(_outside(points, verified, point_map)) == len(points)
    return every and len(_outside(points[:1], known, point_map)) == 1


def _outside(states: Floats, known: Sequence[Attractor], point_map: PointMap) -> Floats:
    """Return the states that are in no box of a known attractor."""
    for other in known:
        if other.cover is not None and len(states):
            states = states[~inside_cover(other.cover, states, point_map)]
    return states
