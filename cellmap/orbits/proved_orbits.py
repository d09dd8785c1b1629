"""Periodic orbits whose existence, uniqueness and stability are proved by interval arithmetic."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Complexes, Floats
from .._lib.checks import finite_points, parameter_intervals
from .._lib.computed import computed_once
from .._lib.midpoint_radius import ROUNDING, Intervals, inverse
from .._lib.records import ShownAsHtml
from .._lib.signatures import checked
from ..maps.coordinates import Coordinate, turns_of
from ..maps.enclosures import enclosed_images
from ..maps.point_map import PointMap
from .attractor import Attractor
from .contraction import check_periods, circle_gaps, contraction_balls, point_width
from .orbit_kinds import PeriodicOrbit

_HALVINGS = 50  # halvings of the box in which an orbit is sought, from the size of its coordinates on
_NARROWER = 20  # largest number of times that the box around the orbit is made smaller


class NotProvedError(ArithmeticError):
    """No box around the points was found in which an orbit is proved."""


@dataclass(frozen=True, eq=False)
class ProvedOrbit(ShownAsHtml):
    """A periodic orbit that is proved to exist.

    Parameters
    ----------
    points : ndarray, shape (period, dimension)
        Approximate points of the orbit, as they were given.
    radii : ndarray, shape (period, dimension)
        The true points are not farther from these, along any coordinate.
    unique_within : ndarray, shape (period, dimension)
        There is no other orbit of this period whose points are within these distances of the approximate ones.
    is_least : bool
        Whether `period` is proved to be its least period.
    stable : bool or None
        Whether it attracts its neighbours: proved to, proved not to, or not decided.
    unstable_directions : int or None
        Multipliers that are proved to lie outside the unit circle, the others inside; None if not decided.
    multipliers : ndarray of complex, shape (dimension,)
        Centres of discs whose union holds all Floquet multipliers.
    multiplier_radii : ndarray, shape (dimension,)
        Radii of these discs; NaN where there is no bound.
    parameters : mapping of str to tuple of float
        Intervals of parameters for all of whose values there is such an orbit.
    coordinates : tuple of Coordinate
        State variables.
    """

    points: Floats
    radii: Floats
    unique_within: Floats
    is_least: bool
    stable: bool | None
    unstable_directions: int | None
    multipliers: Complexes
    multiplier_radii: Floats
    parameters: Mapping[str, tuple[float, float]]
    coordinates: tuple[Coordinate, ...]

    @property
    def period(self) -> int:
        """Period in steps of the map, up to full rotations of angles."""
        return len(self.points)

    def __repr__(self) -> str:
        place = ", ".join(f"{v:.6g}" for v in self.points[0])
        kind = {True: "stable", False: "unstable", None: "stability not decided"}[self.stable]
        if self.unstable_directions and self.unstable_directions < len(self.coordinates):
            kind = "saddle"
        return (
            f"ProvedOrbit({kind}, period {self.period}, within {self.radii.max():.1e} of ({place}), alone within "
            f"{self.unique_within.min():.1e})"
        )


@checked
def prove_orbit(
    point_map: PointMap,
    orbit: PeriodicOrbit | Attractor | ArrayLike,
    parameters: Mapping[str, Any] | None = None,
) -> ProvedOrbit:
    """Prove that there is a periodic orbit near given points, stable or not, and no other one.

    The operator of Krawczyk (1969) for the equations that each point is the image of the one before is shown to take a
    box around the points into its interior.  The largest box that is found holds no other orbit of this period, and the
    smallest one holds the orbit.  Discs of Gershgorin for the monodromy matrix hold the multipliers; where they do not
    decide whether the orbit is stable, a contraction may.

    Parameters
    ----------
    point_map : PointMap
        A discrete map, or a stroboscopic map of a smooth flow, whose function can be traced; for an interpolated map,
        the exact map behind it is used.
    orbit : PeriodicOrbit, Attractor, or array_like, shape (period, dimension)
        Approximate points of the orbit, as :func:`periodic_orbit` finds them.
    parameters : mapping of str to tuple of float, optional
        Intervals (lowest, highest) of some parameters: the orbit is then proved for all of their values.

    Returns
    -------
    ProvedOrbit
        How far it is at most from the given points, where it is alone, and whether it is stable.

    Raises
    ------
    NotProvedError
        If no box is found: the points are not accurate enough, intervals of parameters too wide, or the orbit is close
        to a bifurcation.
    TypeError, ValueError
        For arguments out of range, or a map without known formulas.

    References
    ----------
    Krawczyk, Computing 4 (1969) 187; Galias, International Journal of Bifurcation and Chaos 11 (2001) 2427; Tucker,
    *Validated Numerics* (2011).

    Examples
    --------
    >>> from cellmap import discrete_map, periodic_orbit
    >>> henon = discrete_map(lambda x, p: (1 - p.a * x[0]**2 + x[1], p.b * x[0]), {"a": 1.4, "b": 0.3}, ("x", "y"))
    >>> saddle = prove_orbit(henon, periodic_orbit(henon, [0.6, 0.2]))
    >>> saddle.unstable_directions, bool(saddle.radii.max() < 1e-12), bool(saddle.unique_within.min() > 0.09)
    (1, True, True)
    """
    exact = point_map.without_table
    if isinstance(orbit, Attractor):
        if not orbit.period:
            raise ValueError(f"orbit={orbit!r}: give a periodic one")
        orbit = orbit.points[: orbit.period]
    given = orbit.points if isinstance(orbit, PeriodicOrbit) else orbit
    points = np.atleast_2d(finite_points("orbit", given, exact.dimension))
    if points.ndim != 2 or not len(points):
        raise ValueError(f"orbit has the shape {points.shape}: give rows of points, one for each step of the period")
    intervals = parameter_intervals(parameters, exact.params)
    scale = np.abs(points).max(axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    turn = turns_of(exact.coordinates)[1]
    scale = np.broadcast_to(np.where(turn > 0.0, turn / 8.0, scale), points.shape)
    check_periods(exact, points, point_width(intervals) * scale, intervals)
    shooting = _Shooting(exact, points, point_width(intervals) * scale, intervals)
    for halving in range(1, _HALVINGS):
        unique = scale * 2.0**-halving
        radii = shooting.image(unique)
        if radii is not None and bool((radii < unique).all()):
            break
    else:
        raise NotProvedError(
            f"no orbit of period {len(points)} is proved near {points[0].tolist()}: refine it with periodic_orbit, "
            "take narrower intervals of parameters, or stay away from bifurcations"
        )
    for _ in range(_NARROWER):
        smaller = shooting.image(radii)
        if smaller is None or not (smaller < 0.9 * radii).any():
            break
        radii = np.minimum(radii, smaller)
    centres, discs = shooting.multipliers(radii)
    outside = (np.abs(centres) / ROUNDING.wider - discs) / ROUNDING.wider > 1.0
    inside = (np.abs(centres) + discs) * ROUNDING.wider < 1.0
    decided = bool((inside | outside).all())
    stable = not outside.any() if decided else None
    if stable is None and contraction_balls(exact, points, 1.99 * unique.min(axis=0), intervals) is not None:
        stable = True
    return ProvedOrbit(
        points=points,
        radii=radii,
        unique_within=unique,
        is_least=_is_least(points, radii, exact.coordinates),
        stable=stable,
        unstable_directions=int(outside.sum()) if decided else 0 if stable else None,
        multipliers=centres,
        multiplier_radii=discs,
        parameters=intervals,
        coordinates=exact.coordinates,
    )


@dataclass(frozen=True, eq=False)
class _Shooting:
    """Equations of a periodic orbit, in as many segments as it has points."""

    exact: PointMap
    points: Floats
    small: Floats
    parameters: Mapping[str, tuple[float, float]]

    def _steps(self, half: Floats) -> tuple[Intervals, Intervals] | None:
        """Return images of the points and derivatives in boxes around them; None where they are not enclosed."""
        forms = enclosed_images(self.exact, self.points, half, parameters=self.parameters)
        if not forms.proved.all():
            return None
        return (
            Intervals(forms.images, forms.image_radii),
            Intervals(forms.derivatives, forms.derivative_radii),
        )

    @computed_once
    def _middle(self) -> tuple[Intervals, Intervals] | None:
        """Images of the points themselves, and derivatives there."""
        return self._steps(self.small)

    def image(self, half: Floats) -> Floats | None:
        """Return the half-widths of the image of a box under Krawczyk's operator; None where it is not enclosed."""
        period, d = self.points.shape
        around, here = self._steps(half), self._middle
        if around is None or here is None:
            return None
        gaps = circle_gaps(here[0], np.roll(self.points, -1, axis=0), self.exact.coordinates)
        slopes, middle = self._jacobian(around[1]), self._jacobian(here[1]).mid
        if not np.linalg.cond(middle) < 1e15:
            return None
        solver = Intervals.exact(np.linalg.inv(middle))
        moved = (solver @ Intervals(gaps.mid.reshape(-1, 1), gaps.rad.reshape(-1, 1))).above
        rest = (Intervals.exact(np.eye(period * d)) - solver @ slopes).above
        found = (moved[:, 0] + rest @ half.ravel() * ROUNDING.wider) * ROUNDING.wider
        return np.asarray(found.reshape(period, d)) if np.isfinite(found).all() else None

    def _jacobian(self, steps: Intervals) -> Intervals:
        """Return the derivative of all images less the points that follow, by all points."""
        period, d = self.points.shape
        mid, rad = np.zeros((period, d, period, d)), np.zeros((period, d, period, d))
        ahead = np.zeros((period, d, period, d))
        for k in range(period):
            mid[k, :, k], rad[k, :, k] = steps.mid[k], steps.rad[k]
            ahead[k, :, (k + 1) % period] = np.eye(d)
        shape = period * d, period * d
        return Intervals(mid.reshape(shape), rad.reshape(shape)) - Intervals.exact(ahead.reshape(shape))

    def multipliers(self, half: Floats) -> tuple[Complexes, Floats]:
        """Return discs whose union holds the multipliers of all orbits in boxes around the points."""
        d = self.points.shape[1]
        steps = self._steps(half)
        unknown = np.full(d, complex(np.nan)), np.full(d, np.nan)
        if steps is None:
            return unknown
        matrix = Intervals.exact(np.eye(d))
        for k in range(len(self.points)):
            matrix = steps[1][k] @ matrix
        if not np.isfinite(matrix.mid).all():
            return unknown
        axes = np.linalg.eig(matrix.mid)[1].astype(np.complex128)
        if not np.linalg.cond(axes) < 1e12:
            return unknown
        nearly = inverse(axes) @ matrix @ Intervals.exact(axes)
        centres = np.diagonal(nearly.mid).copy()
        away = nearly.above
        np.fill_diagonal(away, np.diagonal(nearly.rad))
        order = np.argsort(-np.abs(centres), kind="stable")
        return centres[order], (away.sum(axis=1) * ROUNDING.wider)[order]


def _is_least(points: Floats, radii: Floats, coordinates: tuple[Coordinate, ...]) -> bool:
    """Tell whether no smaller period divides the one of an orbit: points that it would join are apart."""
    period = len(points)
    for q in range(1, period):
        if period % q == 0:
            gaps = circle_gaps(Intervals(points[[q]], radii[[q]]), points[[0]], coordinates)
            if not (gaps.below > radii[0]).any():
                return False
    return True
