"""Ellipsoids around orbits that are regular, of which nothing is known but where they were."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints
from ...maps.coordinates import difference, turns_of, wrap
from ...maps.point_map import PointMap
from ...orbits.attractor import Neighbourhood
from ...orbits.invariant_circle import signals_of

_MOST_PIECES = 8  # of an attractor, which the map permutes,
_SECTORS = 12  # of an angle that makes full rotations
_SPREAD = 0.5  # length of the mean of points on the unit circle below which they are spread all over it
_TIGHT = 1.2  # and how much larger they may be than those of other numbers of pieces
_LOOSE = 1.1  # factor by which a region is larger than the points seen


@dataclass(frozen=True, eq=False)
class Hulls:
    """Ellipsoids around the pieces of a regular orbit (periods, d), as many of them as wanted."""

    exact: PointMap
    path: Floats
    pieces: Sequence[Ints]
    extent: Floats

    @classmethod
    def of(cls, exact: PointMap, path: Floats, rotations: Ints, extent: Floats) -> Hulls:
        """Cut the orbit into pieces."""
        return cls(exact, path, _pieces(exact, path, np.abs(np.ptp(rotations, axis=0)) > 0, extent), extent)

    def of_width(self, width: float) -> Neighbourhood:
        """Return ellipsoids of a width that hold the pieces, across angles all over which a piece is spread."""
        exact, path, extent = self.exact, self.path, self.extent
        turn = turns_of(exact.coordinates)[1]
        centres, metrics = [], []
        for rows in self.pieces:
            centre, shift = _about_mean(exact, path[rows])
            kept = ~((turn > 0) & (np.abs(signals_of(path[rows], exact.coordinates).mean(axis=0)) < _SPREAD))
            shift, unit = shift[:, kept] / extent[kept], extent[kept]
            form = np.linalg.inv(shift.T @ shift / len(shift) + width**2 * np.eye(len(unit)))
            size = _LOOSE * max(1.0, float(np.sqrt(np.einsum("ni,ij,nj->n", shift, form, shift).max())))
            metric = np.zeros((len(turn), len(turn)))
            metric[np.ix_(kept, kept)] = 0.5 * (form + form.T) / size**2 / np.outer(unit, unit)
            centres.append(centre)
            metrics.append(metric)
        return Neighbourhood(np.array(centres), np.array(metrics), 1.0)


def _pieces(exact: PointMap, path: Floats, turning: Bools, extent: Floats) -> list[Ints]:
    """Return rows of the parts of an attractor that get an ellipsoid each.

    They are sectors of an angle that makes full rotations, the one that leaves the least spread, or pieces that the map
    permutes.
    """
    lower, turn = turns_of(exact.coordinates)
    candidates = [[np.arange(k, len(path), number) for k in range(number)] for number in range(1, _MOST_PIECES + 1)]
    if turning.any():
        sector = np.floor((path - lower) / np.where(turn > 0, turn, 1.0) * _SECTORS)
        candidates = [[np.flatnonzero(s == k) for k in np.unique(s)] for s in sector.T[turning]]
    spread = [
        sum(len(rows) * float((_about_mean(exact, path[rows])[1] / extent).var(axis=0).sum()) for rows in parts)
        for parts in candidates
    ]
    return candidates[int(np.argmax(np.array(spread) <= _TIGHT * min(spread)))]


def _about_mean(exact: PointMap, points: Floats) -> tuple[Floats, Floats]:
    """Return the mean of points, that on the circle for angles, and the points as seen from there."""
    turn = turns_of(exact.coordinates)[1]
    mean = signals_of(points, exact.coordinates).mean(axis=0)
    centre = np.where(turn > 0, np.angle(mean) * turn / (2 * np.pi), mean.real)
    return wrap(centre, exact.coordinates), difference(points, centre, exact.coordinates)


def surface_points(region: Neighbourhood, extent: Floats, number: int) -> Floats:
    """Return as many points (number, d), one after the other at the surfaces of the ellipsoids of a region."""
    rng, begin = np.random.default_rng(0), []
    for k, (centre, metric) in enumerate(zip(region.centres[:number], region.metrics[:number], strict=True)):
        values, axes = np.linalg.eigh(metric * np.outer(extent, extent))
        across = values > 1e-12 * values.max()
        sphere = rng.standard_normal((len(range(k, number, len(region.centres))), len(values)))
        sphere /= np.linalg.norm(sphere[:, across], axis=1, keepdims=True)
        # Along angles that turn orbits begin anywhere.
        lengths = np.where(across, 1.0 / np.sqrt(np.where(across, values, 1.0)), 1.0)
        begin.append(centre + (sphere * lengths) @ axes.T * extent)
    return np.concatenate(begin)
