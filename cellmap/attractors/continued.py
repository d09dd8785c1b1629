"""Attractors followed from one map to a map with other parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from .._lib.arrays import Floats
from .._lib.checks import real_array, shown
from .._lib.signatures import checked
from .._lib.threads import results_of
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor, Kind, Neighbourhood, sort_key
from ..orbits.ellipsoids import half_widths
from ..orbits.newton import newton, stable_orbit
from .given import check_coordinates
from .kinds.cycles import neighbourhood_of
from .kinds.quasiperiodic import quasiperiodic_attractors
from .matching import attractor_distance
from .regions.extents import extent_of_motion, region_extent, ways_of
from .settling.settle import Catalogue

_FOLLOWED = 256  # periods in which an orbit comes to the invariant curve in the place of another
_BESIDE = 64  # orbits that begin around each of others, in a box of the extent, and show how far orbits go
_REACH = 0.1  # of the extent: an orbit that is found farther away is another one


@checked
def continue_attractors(
    point_map: PointMap, attractors: Sequence[Attractor], extent: Floats | None = None
) -> tuple[Attractor, ...]:
    """Return the periodic and quasi-periodic attractors of a map near those of one with slightly different parameters.

    Newton's method starts from where each periodic attractor was.  The orbits that it finds count if their multipliers
    lie inside the unit circle, and get trapping regions of their own.  From a point of each quasi-periodic attractor an
    orbit is followed to an invariant curve nearby.  Attractors that have vanished or lost their stability, and those
    that are chaotic or sticking sets, are left out: a search for attractors with the others as known ones finds what
    has taken their place.

    Parameters
    ----------
    point_map : PointMap
        The map with its new parameters.
    attractors : sequence of Attractor
        Attractors of the map with other parameters.
    extent : ndarray, shape (dimension,), optional
        Size of the region of interest, of which an attractor may move a tenth.  By default the window of an
        interpolated map, or what the attractors and their trapping regions span.

    Returns
    -------
    tuple of Attractor
        In the order in which :func:`find_attractors` returns them.

    Examples
    --------
    >>> from math import tanh
    >>> from cellmap import discrete_map, find_attractors
    >>> wells = discrete_map(lambda x, p: (tanh(p.a * x[0]),), {"a": 1.5}, ("x",))
    >>> before = find_attractors(wells, [[-1.0], [1.0]])
    >>> [round(float(a.points[0, 0]), 4) for a in continue_attractors(wells.with_params(a=1.6), before)]
    [0.8906, -0.8906]
    """
    check_coordinates(attractors, point_map, "attractors")
    orbits = [a for a in attractors if is_followed(a)]
    circles = [a for a in attractors if a.kind is Kind.QUASIPERIODIC]
    if not orbits and not circles:
        return ()
    if extent is None:
        extent = region_extent(point_map, _region_spanned(attractors))
    else:
        lengths = real_array("extent", extent)
        if lengths.shape != (point_map.dimension,) or not ((lengths > 0.0) & np.isfinite(lengths)).all():
            raise ValueError(f"extent={shown(extent)}: give {point_map.dimension} positive lengths")
        extent = lengths
    found = list(with_regions(point_map, orbits_followed(point_map, orbits, extent), extent).values())
    found += circles_followed(point_map, circles, extent, found).values()
    return tuple(sorted(found, key=sort_key))


def is_followed(attractor: Attractor) -> bool:
    """Tell whether an attractor is an orbit that Newton's method follows from map to map, with its trapping region."""
    return attractor.neighbourhood is not None and attractor.period > 0


def _region_spanned(attractors: Sequence[Attractor]) -> Floats:
    """Return the points of attractors and the ends of their trapping regions along the axes.

    The points alone may differ little in a coordinate and yet move in it.
    """
    around = [a.neighbourhood for a in attractors if a.neighbourhood is not None and a.symmetry is None]
    ends = [n.centres + sign * half_widths(n.metrics) for n in around for sign in (-1.0, 1.0)]
    return np.concatenate([*(a.points for a in attractors), *ends])


def orbits_followed(point_map: PointMap, attractors: Sequence[Attractor], extent: Floats) -> dict[int, Attractor]:
    """Return the orbits to which Newton's method comes from periodic attractors, by the numbers of these.

    Their regions are those that the attractors had around their points, which nothing verifies for this map.
    """
    periods = np.array([a.period for a in attractors], np.int64)
    guesses = np.array([a.points[0] for a in attractors]).reshape(-1, point_map.dimension)
    points, settled = newton(point_map, guesses, periods, extent, _REACH, attracting=True)
    found: dict[int, Attractor] = {}
    for k in np.flatnonzero(settled).tolist():
        orbit, before = stable_orbit(point_map, points[k], int(periods[k]), extent), attractors[k].neighbourhood
        if orbit is None:
            continue
        same = before is not None and len(before.centres) == len(orbit.points)
        region = replace(before, centres=orbit.points) if before is not None and same else None
        found[k] = replace(orbit, neighbourhood=region)
    return found


def with_regions(point_map: PointMap, orbits: Mapping[int, Attractor], extent: Floats) -> dict[int, Attractor]:
    """Return those orbits that have a verified region, with it, by the numbers that they have.

    It is like the one that an orbit has, as :func:`orbits_followed` returns it, where that is verified here.
    """
    if not orbits:
        return {}
    beside = extent * np.random.default_rng(0).uniform(-0.5, 0.5, (_BESIDE, point_map.dimension))
    around = np.concatenate([orbit.points[0] + beside for orbit in orbits.values()])
    motion = extent_of_motion(extent, ways_of(point_map, around)[0])

    def region_of(k: int) -> Neighbourhood | None:
        return neighbourhood_of(point_map, orbits[k], motion, orbits[k].neighbourhood)

    regions = dict(results_of(list(orbits), region_of))
    found: dict[int, Attractor] = {}
    for k, orbit in orbits.items():
        region = regions[k]
        # A periodic point inside the region of another orbit is on that orbit.
        others = Catalogue.of(list(found.values()), point_map)
        if region is not None and others.owners_of(orbit.points[:1])[0] < 0:
            found[k] = replace(orbit, neighbourhood=region)
    return found


def circles_followed(
    point_map: PointMap, attractors: Sequence[Attractor], extent: Floats, known: Sequence[Attractor]
) -> dict[int, Attractor]:
    """Return the invariant curves near those of quasi-periodic attractors, by the numbers of these."""
    found: dict[int, Attractor] = {}
    for k, before in enumerate(attractors):
        others = [*known, *found.values()]
        near = quasiperiodic_attractors(point_map, before.points[:1], extent, _FOLLOWED, others).attractors
        close = [now for now in near if attractor_distance(before, now, extent) <= _REACH]
        if close:
            found[k] = close[0]
    return found
