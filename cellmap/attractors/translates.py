"""Attractors that are the same one full rotation further on: of a coordinate that was not declared as an angle."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import pi

import numpy as np

from .._lib.arrays import Floats
from ..maps.coordinates import difference
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor

_MOST = 64  # attractors that are compared
_APART = 1e-4  # between points that are the same, and more than errors of attractors
_SAME = 1e-5  # between images that are the same, relative to their size
_PLACES = 6  # at which the map is tried
_AROUND = 0.7  # an attractor, these are


def warning_of_translates(attractors: Sequence[Attractor], point_map: PointMap) -> str:
    """Return what is said of attractors that are others, moved by the period 2 pi of the map in a coordinate; or ""."""
    periodic: dict[int, bool] = {}
    again: dict[int, int] = {}
    cycles = [(k, a) for k, a in enumerate(attractors) if a.period]
    for (i, one), (k, other) in combinations(cycles[:_MOST], 2):
        moved = _moved(one, other)
        for j in moved:
            if j not in periodic:
                periodic[j] = _is_periodic(point_map, one.points[0], j)
        if moved and all(periodic[j] for j in moved):
            again.setdefault(k, i)
    if not again:
        return ""
    names = [point_map.coordinates[j].name for j in sorted(periodic) if periodic[j]]
    repeated, first = next(iter(again.items()))
    least = "at least " if len(cycles) > _MOST else ""
    return (
        f"{least}{len(again)} of {len(attractors)} attractors, such as {repeated}, are others, such as {first}, moved "
        f"by multiples of 2 pi in {' or '.join(names)}, in which the equations have that period: unless these are "
        f"places on a line, give {', '.join(f'angle({name!r})' for name in names)} among the coordinates"
    )


def _moved(a: Attractor, b: Attractor) -> list[int]:
    """Return the coordinates in which a cycle is another one moved by multiples of 2 pi; none if they differ else."""
    if (a.kind, a.period, a.points.shape) != (b.kind, b.period, b.points.shape):
        return []
    line = np.array([c.period is None for c in a.coordinates])
    shift = np.where(line, 2 * pi * np.round((b.points.mean(axis=0) - a.points.mean(axis=0)) / (2 * pi)), 0.0)
    if not shift.any():
        return []
    apart = np.abs(difference((a.points + shift)[:, None], b.points[None], a.coordinates)).max(axis=-1)
    return [int(j) for j in np.flatnonzero(shift)] if (apart.min(axis=1) <= _APART).all() else []


def _is_periodic(point_map: PointMap, point: Floats, j: int) -> bool:
    """Tell whether images of states around a point are moved by 2 pi in a coordinate where the states are."""
    exact, shift = point_map.without_table, 2 * pi * np.eye(len(point))[j]
    places = point + _AROUND * np.random.default_rng(0).normal(size=(_PLACES, len(point)))
    images, further = exact(places), exact(places + shift)
    apart = np.abs(difference(further - shift, images, exact.coordinates)).max(axis=1)
    known = np.isfinite(apart)
    return bool(known.any() and (apart[known] <= _SAME * (1.0 + np.abs(images[known]).max(axis=1))).all())
