"""Attractors that are handed to a function: whether they are of its map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._lib.arrays import Floats
from ..maps.coordinates import difference
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor, Kind
from .regions.boxes import inside_cover
from .settling.settle import Catalogue

_OFF = 0.1  # radii of a trapping region between an image and the next point, from which on another map has made them
_INSIDE = 0.99  # of the images of a sample are in the boxes of their attractor, which reach beyond where orbits went


def check_coordinates(attractors: Sequence[Attractor], point_map: PointMap, name: str) -> None:
    """Refuse what is not a sequence of attractors of this map's coordinates."""
    if isinstance(attractors, Attractor | str) or not all(isinstance(a, Attractor) for a in attractors):
        raise TypeError(f"{name}={attractors!r}: give a sequence of Attractor, such as other basins' attractors")
    for a in attractors:
        if a.coordinates != point_map.coordinates:
            theirs, ours = (", ".join(map(str, c)) for c in (a.coordinates, point_map.coordinates))
            raise ValueError(f"{name} holds an attractor in ({theirs}), and the map is one of ({ours})")


def check_attractors(attractors: Sequence[Attractor], point_map: PointMap, name: str) -> None:
    """Refuse what is not a sequence of attractors of this map, by one image of each of their points.

    Raises
    ------
    TypeError
        If one is no attractor.
    ValueError
        If one is in other coordinates, or the map takes its points elsewhere.
    """
    check_coordinates(attractors, point_map, name)
    if not len(attractors):
        return
    orbits = Orbits.starting(np.concatenate([a.points for a in attractors]))
    point_map.without_table.advance(orbits, 1)
    ends = np.cumsum([len(a.points) for a in attractors])
    for a, end in zip(attractors, ends.tolist(), strict=True):
        images = orbits[np.arange(end - len(a.points), end)]
        if not (images.alive.all() and _is_of(a, images.points, point_map)):
            raise ValueError(
                f"{name} holds {a!r}, which is no attractor of this map: it takes its points elsewhere; give "
                "attractors found for the same parameters, or follow these with continue_attractors"
            )


def _is_of(attractor: Attractor, images: Floats, point_map: PointMap) -> bool:
    """Tell whether the images of an attractor's points are its next points, or in its boxes."""
    region = attractor.neighbourhood
    if attractor.symmetry is None and region is not None and len(region.centres) == attractor.period > 0:
        off = difference(images, np.roll(attractor.points, -1, axis=0), attractor.coordinates)
        metrics = np.roll(region.metrics, -1, axis=0)
        return bool(np.einsum("mi,mij,mj->m", off, metrics, off).max() <= _OFF**2)
    if attractor.kind is Kind.QUASIPERIODIC and region is not None and attractor.verified:
        return bool((Catalogue.of([attractor], point_map).owners_of(images) == 0).mean() >= _INSIDE)
    return attractor.cover is None or bool(inside_cover(attractor.cover, images, point_map).mean() >= _INSIDE)
