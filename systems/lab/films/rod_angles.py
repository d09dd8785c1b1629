"""Angles and angular rates of rods, from tracks of their ends; the circle about a pivot that carries no marker."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import uniform_filter1d
from scipy.optimize import least_squares

from cellmap.utils import finite_number, whole_number

from ..arrays import Bools, Floats, Ints
from ..time_series import real_numbers, undetermined, warn_of_undetermined
from .tracks import Tracks

Pivot = int | tuple[float, float] | None

_LOOSE = 0.005  # fraction by which the length of a rigid rod may vary, and
_LOOSE_ERRORS = 5.0  # standard errors
_STANDS_OUT = 2.0  # standard deviations by which a polynomial misses more than errors make of it


@dataclass(frozen=True, eq=False)
class JointAngles:
    """Angles of rods and their rates.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Times (s).
    angles : ndarray, shape (n, joints)
        Angles from the downward vertical, counter-clockwise, absolute and unwrapped (rad); NaN in gaps.
    errors : ndarray, shape (n, joints)
        Their standard errors (rad), from those of the positions.
    rates : ndarray, shape (n, joints)
        Angular rates (rad/s); NaN in gaps, and as near to them as no whole window fits.
    rate_errors : ndarray, shape (n, joints)
        Their standard errors (rad/s): from those of the angles, and from what a polynomial cannot follow, where two
        degrees more, in a window of `degree` + 3 frames or more, change the rates by more than these errors do.
    stretches : ndarray of int, shape (n, joints)
        Number of the stretch, from 0, over which full rotations are counted; -1 in gaps.  A new one begins where a gap
        is so long that rotations may have been missed: between stretches, angles are known up to full rotations.
    """

    times: Floats
    angles: Floats
    errors: Floats
    rates: Floats
    rate_errors: Floats
    stretches: Ints
    lengths: Floats

    def __repr__(self) -> str:
        known = ", ".join(f"{int(k):,}" for k in np.isfinite(self.angles).sum(axis=0))
        parts = ", ".join(str(int(k) + 1) for k in self.stretches.max(axis=0))
        loose = "".join(
            f"; joint {k} is not rigid, {low:.4g} to {high:.4g} pixels: its pivot?"
            for k, (low, high) in enumerate(zip(*self._lengths(), strict=True))
            if high > low
        )
        return f"JointAngles({len(self.times):,} frames, angles in {known}, stretches: {parts}{loose})"

    def _lengths(self) -> tuple[Floats, Floats]:
        """Return between what nine tenths of the lengths are; twice the median where no more than noise parts them."""
        low, middle, high = np.nanpercentile(self.lengths, [5.0, 50.0, 95.0], axis=0)
        noise = np.nan_to_num(np.nanmedian(np.nan_to_num(self.errors), axis=0))
        varies = 0.5 * (high - low) / middle > np.maximum(_LOOSE, _LOOSE_ERRORS * noise)
        return np.where(varies, low, middle), np.where(varies, high, middle)


def joint_angles(
    tracks: Tracks,
    pivots: Sequence[Pivot],
    window_length: int = 7,
    degree: int = 3,
    turn_limit: float = 0.5,
    one_sided: bool = False,
) -> JointAngles:
    """Return the angles of rods from the tracks of their ends.

    Rates are the slopes of polynomials fitted by least squares to the window around each frame: where frames are evenly
    spaced, the filter of Savitzky and Golay.  A frame that is absent or in which the
    marker was not seen ends what a window may hold.

    Parameters
    ----------
    tracks : Tracks
        Tracks of the markers.
    pivots : sequence, as many as markers
        For each marker the pivot of its rod: the pixel (column, row), the number of another marker, or None where the
        marker is itself only a pivot.
    window_length : int, optional
        Frames of a window, odd, at least `degree` + 2.
    degree : int, optional
        Degree of the polynomials, at least 1.
    turn_limit : float, optional
        Turns that the rod may make in a gap before turns are no longer counted across it, by its fastest step between
        two frames elsewhere; at most 0.5.  A rod that is pushed in a gap, or fast in gaps alone, it cannot foresee.
    one_sided : bool, optional
        Give rates near gaps and ends too, from windows that do not reach equally far to both sides.

    Returns
    -------
    JointAngles
        Angles, rates and their standard errors; one joint for each marker with a pivot, in their order.  Where the
        distance of marker and pivot varies by more than noise, its text says so.

    Raises
    ------
    TypeError, ValueError
        For arguments that do not fit, and a marker that is never known.

    References
    ----------
    Savitzky, Golay, Analytical Chemistry 36 (1964) 1627.

    Examples
    --------
    >>> from systems.lab import Tracks
    >>> times = np.arange(20) / 100.0
    >>> places = np.stack([30 + 20 * np.sin(9 * times), 10 + 20 * np.cos(9 * times)], axis=-1)[:, None]
    >>> errors, flat = np.full(places.shape, 0.01), np.zeros((20, 1))
    >>> found = joint_angles(Tracks(times, places, errors, flat.astype(np.uint8), places, flat, 100.0), [(30.0, 10.0)])
    >>> found.angles[-1].round(9), found.rates[10].round(9), found.errors[0]
    (array([1.71]), array([9.]), array([0.0005]))
    """
    degree = whole_number("degree", degree, at_least=1)
    if whole_number("window_length", window_length, at_least=degree + 2) % 2 == 0:
        raise ValueError(f"window_length={window_length}: give an odd number of frames")
    turn_limit = finite_number("turn_limit", turn_limit, above=0.0, at_most=0.5)
    markers = tracks.positions.shape[1]
    if len(pivots) != markers:
        raise ValueError(f"pivots are {len(pivots)}: give one, or None, for each of the {markers} markers")
    rods = [(marker, pivot) for marker, pivot in enumerate(pivots) if pivot is not None]
    if not rods:
        raise ValueError("pivots are all None: give the pivot of at least one marker")
    shape = len(tracks.times), len(rods)
    angles, errors, rates, rate_errors, lengths = np.full((5, *shape), np.nan)
    stretches = np.full(shape, -1)
    for joint, (marker, pivot) in enumerate(rods):
        angle, error, lengths[:, joint] = _directions(tracks, marker, pivot)
        known = np.flatnonzero(np.isfinite(angle))
        if known.size < 2:
            raise ValueError(f"tracks: marker {marker} and its pivot are known in {known.size} frames; 2 are needed")
        angles[known, joint], stretches[known, joint] = _unwrapped(angle[known], tracks.times[known], turn_limit)
        errors[known, joint] = error[known]
        for part in _runs(tracks.times, np.isfinite(angle), stretches[:, joint]):
            slopes = _slopes(
                tracks.times[part], angles[part, joint], errors[part, joint], window_length, degree, one_sided
            )
            rates[part, joint], rate_errors[part, joint] = slopes
    return JointAngles(tracks.times, angles, errors, rates, rate_errors, stretches, lengths)


def _directions(tracks: Tracks, marker: int, pivot: Pivot) -> tuple[Floats, Floats, Floats]:
    """Return the wrapped angles of a rod, their standard errors, and its lengths (pixels)."""
    end, spread = tracks.positions[:, marker], tracks.errors[:, marker] ** 2
    if isinstance(pivot, tuple):
        base = np.array([finite_number(f"pivots[{marker}][{k}]", v) for k, v in enumerate(pivot)])
        if base.size != 2:
            raise ValueError(f"pivots[{marker}]={pivot!r}: give the pixel (column, row)")
    else:
        number = whole_number(f"pivots[{marker}]", pivot, 0, tracks.positions.shape[1] - 1)
        if number == marker:
            raise ValueError(f"pivots[{marker}]={pivot}: a marker is not its own pivot")
        base, spread = tracks.positions[:, number], spread + tracks.errors[:, number] ** 2
    across, down = (end - base).T
    squared = across**2 + down**2
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.sqrt(down**2 * spread[:, 0] + across**2 * spread[:, 1]) / squared
    return np.arctan2(across, down), error, np.sqrt(squared)


def _unwrapped(angle: Floats, times: Floats, turn_limit: float) -> tuple[Floats, Ints]:
    """Return angles that go on across turns, and the number of the stretch over which turns are sure."""
    steps = np.diff(angle)
    steps -= 2.0 * np.pi * np.round(steps / (2.0 * np.pi))
    passed = np.diff(times)
    usual = 1.5 * np.median(passed)
    near = passed <= usual
    fastest = float(np.max(np.abs(steps[near]) / passed[near])) if near.any() else 0.0
    unsure = ~near & (fastest * passed > 2.0 * np.pi * turn_limit)
    return angle[0] + np.concatenate([[0.0], np.cumsum(steps)]), np.concatenate([[0], np.cumsum(unsure)])


def _runs(times: Floats, known: Bools, stretches: Ints) -> list[slice]:
    """Return the runs of known frames without one absent between them, at twice the usual time, or a new stretch."""
    usual = float(np.median(np.diff(times)))
    breaks = (np.diff(times) > 1.75 * usual) | (np.diff(known.astype(int)) != 0) | (np.diff(stretches) != 0)
    edges = np.concatenate([[0], np.flatnonzero(breaks) + 1, [len(times)]])
    return [slice(int(a), int(b)) for a, b in pairwise(edges) if known[a]]


def _slopes(
    times: Floats, values: Floats, errors: Floats, window: int, degree: int, one_sided: bool
) -> tuple[Floats, Floats]:
    """Return slopes of a run, and their standard errors; NaN where no window fits."""
    count, half = len(times), window // 2
    if count < window:
        return np.full(count, np.nan), np.full(count, np.nan)
    wanted = np.arange(count) - half
    first = np.clip(wanted, 0, count - window)
    part = first[:, None] + np.arange(window)
    offsets, rises, squares = times[part] - times[:, None], values[part] - values[:, None], errors[part] ** 2
    weights = _weights(offsets, degree)
    # Two degrees more, where a window has so many values, change a slope by what the polynomial misses.
    change = _weights(offsets, min(degree + 2, window - 1)) - weights
    inside = one_sided | (first == wanted)
    slopes = np.where(inside, (weights * rises).sum(axis=1), np.nan)
    missed = np.where(inside, (change * rises).sum(axis=1) ** 2, np.nan)
    followed = (weights**2 * squares).sum(axis=1) + _not_followed(missed, (change**2 * squares).sum(axis=1), window)
    return slopes, np.where(inside, np.sqrt(followed), np.nan)


def _not_followed(missed: Floats, chance: Floats, window: int) -> Floats:
    """Return the squares of what a polynomial misses of the slopes, from what one of a higher degree changes them by.

    Of the squares of these changes, those that the errors of the values cause are taken off; nothing is left where the
    others do not stand out from them.
    """
    known = np.flatnonzero(np.isfinite(missed))
    nothing = np.zeros(len(missed))
    if not known.size:
        return nothing
    excess = missed[known] - chance[known]
    if excess.sum() <= _STANDS_OUT * np.sqrt(2.0 * window * (chance[known] ** 2).sum()):
        return nothing
    nothing[known] = np.maximum(uniform_filter1d(excess, min(2 * window + 1, known.size), mode="nearest"), 0.0)
    return nothing


def _weights(offsets: Floats, degree: int) -> Floats:
    """Return in each row the weights of values whose sum is the slope at 0 of the polynomial fitted to them."""
    scale = np.abs(offsets).max(axis=1)[:, None]
    return np.linalg.pinv((offsets / scale)[..., None] ** np.arange(degree + 1))[:, 1] / scale


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
            f"{errors[2]:.2g}{', undetermined' if self.undetermined else ''})"
        )

    @property
    def undetermined(self) -> tuple[str, ...]:
        """``("radius",)`` where its standard error exceeds it, else nothing; a centre is nowhere in particular."""
        return undetermined({"radius": self.radius}, {"radius": float(self.errors[2])})

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

    Warns
    -----
    UserWarning
        For a radius that is undetermined.

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
    given = real_numbers("points", points, " in an array of shape (n, 2)")
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
    circle = Circle(centre, float(size * radius), covariance, size * sqrt(variance), arc)
    spread = {"radius": float(circle.errors[2])}
    warn_of_undetermined({"radius": circle.radius}, spread, circle.undetermined, "give points from a wider swing")
    return circle


def _spread(angles: Floats) -> float:
    """Return the angle that spans all, 2 pi less the widest gap."""
    rotations = np.sort(np.mod(angles, 2.0 * pi))
    gaps = np.diff(rotations, append=rotations[0] + 2.0 * pi)
    return float(2.0 * pi - gaps.max())
