"""Balls around attracting periodic orbits that the map is proved to contract into one another."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._lib.arrays import Floats
from .._lib.midpoint_radius import ROUNDING, Intervals, inverse, length_above, stretch_above
from ..maps.coordinates import Coordinate, shortest, turns_of
from ..maps.enclosures import enclosed_images
from ..maps.point_map import PointMap
from .ellipsoids import lyapunov_forms

_LARGEST, _FIRST = 0.5, 2.0**-6  # half-widths of balls, in extents: the largest, and the first that is tried
_HALVINGS, _BETWEEN = 32, 3  # halvings of the radius until a ball contracts, and steps back from there
_PARTS = {1: 256, 2: 32, 3: 10}  # boxes along each axis that cover a ball
_PARTS_BEYOND = 4
_CONDITION = 1e4  # condition of eigenvectors above which they make no frame
_SMALLEST = 1e-3  # multiplier, below which an orbit has no frame of eigenvectors that is carried along


@dataclass(frozen=True, eq=False)
class ContractionBalls:
    """Balls around the points of an attracting periodic orbit, each of which the map contracts into the next one.

    So there is one periodic orbit in them, and every orbit that enters one of them converges to it.  Points of larger
    balls may be proved to come to these.

    Parameters
    ----------
    centres : ndarray, shape (period, dimension)
        Centres of the balls.
    frames : ndarray, shape (period, dimension, dimension)
        Ball k is the set of points x with ``|frames[k] @ (x - centres[k])| <= radius``, a Euclidean length.
    radius : float
        Radius of all balls, in their frames.
    rate : float
        Factor below 1 by which a step of the map shortens at least all distances within a ball, measured in the frames.
    reach : float
        Radius, not below the other one, of balls all of whose points are proved to converge to the orbit.
    """

    centres: Floats
    frames: Floats
    radius: float
    rate: float
    reach: float


def point_width(parameters: Mapping[str, Any] | None) -> float:
    """Return the half-width of boxes that stand for points, in extents: the scale to which images are computed."""
    return 2.0**-16 if parameters else 2.0**-44


def circle_gaps(images: Intervals, targets: Floats, coordinates: tuple[Coordinate, ...]) -> Intervals:
    """Return images less targets, on circles the shorter way round; periods are known to a unit in the last place."""
    turn = turns_of(coordinates)[1]
    gaps = images - Intervals.exact(targets)
    around = gaps.mid - shortest(gaps.mid, turn)
    away = Intervals(-around, 8.0 * ROUNDING.unit * np.abs(around))
    return gaps + away


def check_periods(
    point_map: PointMap, points: Floats, half_widths: Floats, parameters: Mapping[str, Any] | None = None
) -> None:
    """Hold a map to the periods of its angles, at boxes around points (n, d).

    Raises
    ------
    ValueError
        Where images of boxes one period apart are proved not to be whole periods apart.
    """
    exact, turn = point_map.without_table, turns_of(point_map.coordinates)[1]
    angles = np.flatnonzero(turn > 0.0)
    if not len(angles):
        return

    def hulls(centres: Floats) -> tuple[Floats, Floats]:
        forms = enclosed_images(exact, centres, half_widths, parameters=parameters)
        return forms.images, forms.spreads + (np.abs(forms.derivatives) @ half_widths[..., None])[..., 0]

    image, radius = hulls(points)
    for j in angles:
        later, its_radius = hulls(points + turn * (np.arange(len(turn)) == j))
        apart = np.abs(shortest(later - image, turn))
        known = 2.0 * (radius + its_radius) + 16.0 * ROUNDING.unit * (np.abs(image) + np.abs(later) + turn)
        if (apart > known).any():
            c = point_map.coordinates[j]
            raise ValueError(
                f"the formulas of {point_map.name} do not repeat after the period {c.period!r} of {c.name}, and "
                "nothing can be proved on its circle: give the period in full, such as 2 * pi"
            )


def contraction_balls(
    point_map: PointMap, points: Floats, extent: Floats, parameters: Mapping[str, Any] | None = None
) -> ContractionBalls | None:
    """Return the largest balls around the points (period, d) of an orbit that are proved to contract; None for none.

    No ball is wider than the extent (d,) of the region that matters.
    """
    exact = point_map.without_table
    linear = enclosed_images(exact, points, point_width(parameters) * extent, parameters=parameters)
    if not linear.proved.all():
        return None
    frames = _frames(linear.derivatives, extent)
    if frames is None:
        return None
    gaps = circle_gaps(Intervals(linear.images, linear.image_radii), np.roll(points, -1, axis=0), exact.coordinates)
    ahead = Intervals.exact(np.roll(frames, -1, axis=0))
    moved = float(length_above((ahead @ Intervals(gaps.mid[..., None], gaps.rad[..., None]))[..., 0].above).max())
    balls = _Balls(exact, points, frames, inverse(frames), parameters)
    rate_of = functools.cache(balls.rate)
    radius, failed, found = _FIRST, np.inf, None
    while radius < _LARGEST and rate_of(radius) < 1.0:  # balls that are much too large are dear
        radius = 2.0 * radius
    for _ in range(_HALVINGS):
        rate = rate_of(radius)
        if _holds(rate, moved, radius):
            found = ContractionBalls(points, frames, radius, rate, radius)
            break
        failed, radius = radius, 0.5 * radius
        if not radius > moved:
            return None
    for _ in range(_BETWEEN if found is not None and failed < np.inf else 0):
        assert found is not None
        radius = float(np.sqrt(found.radius * failed))
        rate = balls.rate(radius)
        if _holds(rate, moved, radius):
            found = ContractionBalls(points, frames, radius, rate, radius)
        else:
            failed = radius
    return found


def _holds(rate: float, moved: float, radius: float) -> bool:
    """Tell whether all of a ball comes into the interior of the next one: False for what is not known."""
    return bool(rate < 1.0 and moved * ROUNDING.wider < (1.0 - rate) * radius)


@dataclass(frozen=True, eq=False)
class _Balls:
    """Balls of any radius in given frames."""

    exact: PointMap
    points: Floats
    frames: Floats
    inverses: Intervals
    parameters: Mapping[str, Any] | None

    def rate(self, radius: float) -> float:
        """Return a bound of the factor by which distances change in balls of some radius; NaN or inf where unknown."""
        period, d = self.points.shape
        parts = _PARTS.get(d, _PARTS_BEYOND)
        worst = 0.0
        for k in range(period):
            centres, half = cover_of_ball(self.points[k], self.frames[k], self.inverses[k], radius, parts)
            forms = enclosed_images(
                self.exact, centres, np.broadcast_to(half, centres.shape), parameters=self.parameters
            )
            if not (forms.proved.all() and len(centres)):
                return np.inf
            derivatives = Intervals(forms.derivatives, forms.derivative_radii)
            ahead = Intervals.exact(self.frames[(k + 1) % period])
            found = stretch_above(ahead @ derivatives @ self.inverses[k])
            if not (found < 1.0).all():  # also where it is not known: max(0.0, nan) is 0.0
                return np.inf
            worst = max(worst, float(found.max()))
        return worst


def cover_of_ball(
    point: Floats, frame: Floats, inverse: Intervals, radius: float, parts: int, inner: float = 0.0
) -> tuple[Floats, Floats]:
    """Return centres (n, d) and half-widths (d,) of boxes that hold a ball in a frame, less an inner ball."""
    d = len(point)
    steps = (2.0 * np.arange(parts) + 1.0) / parts - 1.0
    unit = np.stack(np.meshgrid(*d * (steps,), indexing="ij"), axis=-1).reshape(-1, d)
    widths = radius * length_above(inverse.above) * ROUNDING.wider
    offsets = unit * widths
    # Boxes around rounded centres that are as wide as leaves no gap.
    half = (widths / parts + 8.0 * ROUNDING.unit * (np.abs(point) + widths)) * ROUNDING.wider
    boxes = Intervals(offsets[..., None], np.broadcast_to(half, offsets.shape)[..., None])
    found = (Intervals.exact(frame) @ boxes)[..., 0]
    meets = (np.maximum(found.below, 0.0) ** 2).sum(axis=-1) <= radius**2 * ROUNDING.wider
    inside = (found.above**2).sum(axis=-1) * ROUNDING.wider < inner**2
    return point + offsets[meets & ~inside], half


def _frames(steps: Floats, extent: Floats) -> Floats | None:
    """Return frames (period, d, d) in which the steps (period, d, d) along a stable orbit contract; None for none.

    Those of eigenvectors are carried along where they are well-conditioned.  Otherwise sums of squared lengths under
    all steps to come make a metric.  The widest unit ball fills one extent.
    """
    steps = steps * extent / extent[:, None]
    matrix = np.eye(steps.shape[-1])
    for step in steps:
        matrix = step @ matrix
    values, vectors = np.linalg.eig(matrix)
    size = float(np.abs(values).max())
    if not size < 1.0:
        return None
    frames = _eigenframes(steps, values, vectors) if size > _SMALLEST else None
    if frames is None:
        rate = (0.5 * (1.0 + size)) ** (1.0 / len(steps))
        forms = lyapunov_forms(steps, rate)
        if not np.isfinite(forms).all():
            return None
        frames = np.swapaxes(np.linalg.cholesky(forms), -1, -2)
    widths = np.sqrt((np.linalg.inv(frames) ** 2).sum(axis=-1)).max()
    return np.asarray(frames * widths / extent)


def _eigenframes(steps: Floats, values: Floats, vectors: Floats) -> Floats | None:
    """Return the inverses of eigenvectors at each point of an orbit, conjugate ones as a real pair; None if skew."""
    columns, k = [], 0
    while k < len(values):
        if abs(values[k].imag) > 1e-12 and k + 1 < len(values):
            columns += [vectors[:, k].real, vectors[:, k].imag]
            k += 2
        else:
            columns.append(vectors[:, k].real)
            k += 1
    at = np.stack(columns, axis=-1)
    factor = float(np.abs(values).max()) ** (1.0 / len(steps))
    frames = []
    for step in steps:
        if not np.linalg.cond(at) < _CONDITION:
            return None
        frames.append(np.linalg.inv(at))
        at = step @ at / factor
    return np.array(frames)
