"""The circle through noisy points: where a rod's pivot is that carries no marker."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from ..arrays import Floats


@dataclass(frozen=True, eq=False)
class Circle:
    """A circle fitted to points.

    Parameters
    ----------
    centre : tuple of float
        Column and row, in the unit of the points.
    radius : float
        Radius.
    covariance : ndarray, shape (3, 3)
        Covariance of column, row and radius.
    scatter : float
        Standard deviation of the points across the circle.
    arc : float
        Angle over which the points are spread (rad).
    """

    centre: tuple[float, float]
    radius: float
    covariance: Floats
    scatter: float
    arc: float

    def __repr__(self) -> str:
        (column, row), errors = self.centre, self.errors
        return (
            f"Circle(({column:.6g} +- {errors[0]:.2g}, {row:.6g} +- {errors[1]:.2g}), radius {self.radius:.6g} +- "
            f"{errors[2]:.2g})"
        )

    @property
    def errors(self) -> Floats:
        """Standard errors of column, row and radius."""
        return np.sqrt(np.diag(self.covariance))


def fit_circle(points: ArrayLike, least_arc: float = 0.2) -> Circle:
    """Return the circle with the least sum of squared distances from points.

    Parameters
    ----------
    points : array_like, shape (n, 2)
        Points, at least 4; those that are not finite, such as gaps of a track, are left out.
    least_arc : float, optional
        Angle over which they must be spread, at least (rad).

    Returns
    -------
    Circle
        The circle, with standard errors by linear propagation of the scatter of the points, taken to be independent.

    Raises
    ------
    ValueError
        For fewer than 4 points, points on a line, at one place or on too short an arc.

    References
    ----------
    Gander, Golub, Strebel, BIT 34 (1994) 558; Kasa, IEEE Transactions on Instrumentation and Measurement 25 (1976) 8.

    Examples
    --------
    >>> turn = np.linspace(0.0, 1.0, 20)
    >>> circle = fit_circle(np.stack([3.0 + 5.0 * np.cos(turn), 4.0 + 5.0 * np.sin(turn)], axis=-1))
    >>> round(circle.centre[0], 9), round(circle.centre[1], 9), round(circle.radius, 9), round(circle.arc, 9)
    (3.0, 4.0, 5.0, 1.0)
    """
    given = np.asarray(points, np.float64)
    if given.ndim != 2 or given.shape[1] != 2:
        raise ValueError(f"points have the shape {given.shape}: give places, as (n, 2)")
    places = given[np.isfinite(given).all(axis=1)]
    if len(places) < 4:
        raise ValueError(f"points: {len(places)} are finite; give at least 4")
    middle = places.mean(axis=0)
    size = float(np.sqrt(((places - middle) ** 2).sum(axis=1).mean()))
    if size == 0.0:
        raise ValueError("points are all at one place; give some from an arc")
    x, y = ((places - middle) / size).T
    design = np.column_stack([x, y, np.ones_like(x)])
    if np.linalg.svd(np.column_stack([x, y]), compute_uv=False)[1] < 1e-9 * sqrt(len(x)):
        raise ValueError("points lie on a line; give some from an arc")
    a, b, c = np.linalg.lstsq(design, x**2 + y**2, rcond=None)[0]
    start = [0.5 * a, 0.5 * b, sqrt(max(c + 0.25 * (a * a + b * b), 1e-12))]

    def away(guess: Floats) -> Floats:
        return np.hypot(x - guess[0], y - guess[1]) - guess[2]

    found = least_squares(away, start, x_scale=1.0, xtol=1e-14, ftol=1e-14, gtol=1e-14, method="lm")
    column, row, radius = found.x
    arc = _spread(np.arctan2(y - row, x - column))
    if not found.success or not radius > 0.0 or arc < least_arc:
        raise ValueError(
            f"points span {arc:.2g} rad of the circle of radius {size * abs(radius):.4g} that fits best, and at least "
            f"{least_arc:g} are needed; give points from a wider swing"
        )
    variance = 2.0 * found.cost / max(len(x) - 3, 1)
    covariance = np.linalg.inv(found.jac.T @ found.jac) * variance * size**2
    centre = float(middle[0] + size * column), float(middle[1] + size * row)
    return Circle(centre, float(size * radius), covariance, size * sqrt(variance), arc)


def _spread(angles: Floats) -> float:
    """Return the angle that spans all, 2 pi less the widest gap."""
    rotations = np.sort(np.mod(angles, 2.0 * pi))
    gaps = np.diff(rotations, append=rotations[0] + 2.0 * pi)
    return float(2.0 * pi - gaps.max())
