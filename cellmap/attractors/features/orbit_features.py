"""Features of orbits: numbers that are alike on orbits of one attractor, such as means and winding numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._lib.arrays import Bools, Floats
from ..._lib.checks import of_the_user, real_array
from ..._lib.threads import slices
from ...maps.coordinates import Coordinate, turns_of
from ...maps.orbit_batch import CHUNK, Status
from ...maps.point_map import Iterate, PointMap, follow

Features = Callable[[Iterate], ArrayLike]
"""Returns an array (n, features) for the images (periods + 1, n, dimension) of n orbits."""

_HELD = 2**28  # bytes of the orbits whose points are held at a time
_SMALL = 1e-4  # of the range of a coordinate before the transient, within which settled orbits are not distinguished


def settled(point_map: PointMap, points: Floats, transient: int) -> tuple[Iterate, Floats, Floats]:
    """Return orbits after a transient, and the bounds (dimension,) of those that live before it and one period later.

    One period is enough for coordinates to differ that are the same in all initial conditions.
    """
    first = follow(point_map, points, min(1, transient))
    last = follow(point_map, np.where(np.isnan(first.points), points, first.points), max(0, transient - 1))
    status = np.maximum(first.status, last.status)
    alive = status < Status.ESCAPED
    both = np.concatenate([points[alive], first.points[alive]])
    low, high = both.min(axis=0, initial=np.inf), both.max(axis=0, initial=-np.inf)
    return Iterate(last.points, last.rotations, status, last.coordinates), low, high


def features_of(
    point_map: PointMap, settled: Iterate, periods: int, features: Features | None, windows: tuple[slice, ...]
) -> tuple[Floats, NDArray[np.uint8]]:
    """Return features of orbits (windows, n, features), NaN for terminated ones, and their status (n,).

    Orbits begin at ``settled.points`` (n, dimension).  Each window is a part of their periods, of whose images features
    are taken.
    """
    status = settled.status.copy()
    alive = np.flatnonzero(status < Status.ESCAPED)
    each = (periods + 1) * 24 * point_map.dimension
    found = np.full((len(windows), len(status), 1), np.nan)
    for part in slices(len(alive), min(4 * CHUNK, max(1, _HELD // each))):
        rows = alive[part]
        orbit = point_map.orbit(settled.points[rows], periods)
        status[rows] = np.maximum(status[rows], orbit.status[-1])
        for k, window in enumerate(windows):
            values = _taken(_part(orbit, window), features)
            if part.start == k == 0:
                found = np.full((len(windows), len(status), values.shape[1]), np.nan)
                _check_independence(_part(orbit, window), features, values)
            if values.shape[1] != found.shape[2]:
                shape = f"({len(rows)}, {found.shape[2]})"
                raise ValueError(f"features returned the shape {values.shape} after others: always return {shape}")
            found[k, rows] = values
    found[:, status >= Status.ESCAPED] = np.nan
    return found, status


def _part(orbit: Iterate, window: slice) -> Iterate:
    return Iterate(orbit.points[window], orbit.rotations[window], orbit.status[window], orbit.coordinates)


def _taken(orbit: Iterate, features: Features | None) -> Floats:
    n = orbit.points.shape[1]
    values = real_array("features", _means(orbit) if features is None else of_the_user("features", features, orbit))
    if values.ndim != 2 or len(values) != n or not values.shape[1]:
        raise ValueError(f"features returned the shape {values.shape}: return one of ({n}, features)")
    return values


def _check_independence(orbit: Iterate, features: Features | None, values: Floats) -> None:
    """Compare the features of the first orbit with those that it has among others."""
    alone = _taken(
        Iterate(orbit.points[:, :1], orbit.rotations[:, :1], orbit.status[:, :1], orbit.coordinates), features
    )
    if alone.shape[1] != values.shape[1] or not np.allclose(alone[0], values[0], 1e-6, 1e-9, equal_nan=True):
        raise ValueError(
            f"features returned {values[0]} for an orbit among others and {alone[0]} for it alone: make the features "
            "of an orbit depend on its own points only"
        )


def _means(orbit: Iterate) -> Floats:
    """Return the features of orbits that are taken by default, two or three of each coordinate."""
    columns = []
    for j, turn in enumerate(turns_of(orbit.coordinates)[1]):
        x = orbit.points[..., j]
        if turn:
            phase = np.exp(2j * np.pi * x / turn).mean(axis=0)
            rotations = (x[-1] - x[0]) / turn + orbit.rotations[-1, :, j] - orbit.rotations[0, :, j]
            columns += [phase.real, phase.imag, rotations / max(1, len(x) - 1)]
        else:
            columns += [x.mean(axis=0), x.std(axis=0)]
    return np.stack(columns, axis=-1)


def extents(values: Floats, alive: Bools, coordinates: tuple[Coordinate, ...], ranges: Floats) -> Floats:
    """Return the units (features,) of the default features: for lengths the range of their coordinate.

    Where that is rounding beside the `ranges` (dimension,) before the transient, orbits have settled on the same value.
    """
    units, column = np.ones(values.shape[1]), 0
    for turn, before in zip(turns_of(coordinates)[1], ranges, strict=True):
        if not turn and alive.any():
            mean, spread = values[alive, column], values[alive, column + 1]
            extent = max(float((mean + spread).max() - (mean - spread).min()), _SMALL * float(before))
            largest = float(np.abs(mean).max())
            units[column : column + 2] = extent if extent > 1e-9 * largest else largest or 1.0
        column += 3 if turn else 2
    return units
