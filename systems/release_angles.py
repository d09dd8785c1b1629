"""Limits of the angles from which a release at rest settles on an attractor."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import floor, pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cellmap import Attractor, ForcedSystem, find_basins, stroboscopic_map
from cellmap.maps import integrate
from cellmap.utils import check_length, finite_number, shown, whole_number

_PARTS = 16  # parts into which a bracket is cut in one batch
_PEAKS = 8  # places on a line at which islands are looked for
_PROMINENT = 4  # periods by which releases there settle later than on either side
_DOUBLINGS = 3  # of the angles, while islands are found


class IslandWarning(UserWarning):
    """Islands of other basins were found between the angles of a scan, and there may be more."""


@dataclass(frozen=True, eq=False)
class ReleaseLimits:
    """Limits of the angle of release from rest for settling on an attractor; arrays of shape (phases,).

    Parameters
    ----------
    phases : ndarray
        Phases of release, as fractions of the forcing period.
    lower, upper : ndarray
        Largest distances on both sides, towards lower and higher angles (rad): a release from any smaller one that was
        tried converges to the same attractor.  0 where even a release in the middle does not, and pi where all do.
    error : ndarray
        Error by which the limits may be too large (rad): the tolerance, and where islands of other basins were found
        between the angles of a scan, twice the reduction by them.
    attractor : Attractor
        Attractor of these releases.
    """

    phases: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    error: NDArray[np.float64]
    attractor: Attractor

    def __repr__(self) -> str:
        least, most = np.minimum(self.lower, self.upper).min(), np.maximum(self.lower, self.upper).max()
        return f"ReleaseLimits({len(self.phases)} phases, from {least:g} to {most:g} rad)"


def release_limits(
    system: ForcedSystem,
    near: float = pi,
    phases: ArrayLike = 0.0,
    angles: int = 256,
    tolerance: float = 1e-9,
    max_periods: int = 2000,
) -> ReleaseLimits:
    """Compute the largest distances from an angle at which releases from rest settle on the same attractor.

    Releases at all phases and at equally spaced angles, up to a distance of pi, are integrated and labelled together.
    The first one that converges to another attractor gives a bracket for each phase and side; all brackets are then
    bisected together.  Islands of other basins between the angles are searched for where releases settle later than
    neighbouring ones, and by up to three scans of twice as many angles each, until one finds no more.  Where a scan has
    found some, the basin boundary may be fractal, and narrower islands may lie nearer: `error` estimates how far.

    Parameters
    ----------
    system : ForcedSystem
        Damped system of one joint, with an angle and its angular velocity as state.
    near : float, optional
        Angle in the middle (rad); by default the inverted state.
    phases : array_like, shape (phases,), optional
        Phases of release, as fractions of the forcing period: ``t = phase * period``.
    angles : int, optional
        Number of angles on each side.
    tolerance : float, optional
        Width of the final brackets (rad), and tolerance of the integrator for one period.
    max_periods : int, optional
        Number of periods after which a release that has not settled counts as one that does not.

    Returns
    -------
    ReleaseLimits
        Distances on both sides.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, and if a release in the middle converges to no attractor.

    Warns
    -----
    IslandWarning
        If islands were found between the angles.

    Examples
    --------
    >>> from systems import driven_pendulum
    >>> limits = release_limits(driven_pendulum(), phases=[0.0, 0.5], angles=32, tolerance=1e-6)
    >>> limits.upper.round(4)
    array([0.9713, 0.8666])
    """
    if not isinstance(system, ForcedSystem):
        raise TypeError(f"system={system!r}: give a ForcedSystem")
    if system.dimension != 2:
        raise ValueError(f"system={system!r}: give a pendulum of one joint, with two state variables")
    middle = finite_number("near", near, at_least=-1e6, at_most=1e6)
    fine = finite_number("tolerance", tolerance, at_least=1e-12, at_most=1e-2)
    check_length("phases", phases)
    given = np.atleast_1d(np.asarray(phases, dtype=object))
    if given.ndim != 1 or not given.size:
        raise ValueError(f"phases={shown(phases)}: give a sequence of finite numbers")
    moments = np.array([finite_number("phases", phase) for phase in given])
    releases = _Releases(system, middle, moments, fine, max_periods)
    angles = whole_number("angles", angles, at_least=2)
    scan = [_equally_spaced(angles)] * (2 * moments.size)
    releases.add(scan)
    if releases.target is None:
        raise ValueError(f"near={near!r}: a release from there ends on no attractor; give damping, or a stronger drive")
    plain = np.array([line.bracket()[0] for line in releases.lines])
    reach = _settled(releases, scan, fine)
    moved = np.where(plain > reach, plain - reach, 0.0)
    for doubling in range(1, _DOUBLINGS + 1):
        places = _equally_spaced(angles * 2**doubling)
        scan = [places[places < limit] for limit in reach]
        releases.add([np.setdiff1d(new, old.x) for new, old in zip(scan, releases.lines, strict=True)])
        nearer = _settled(releases, scan, fine)
        drop, reach = reach - nearer, nearer
        moved += drop
        if drop.max() <= fine:
            break
    error = np.where(moved > fine, 2.0 * moved, 0.0).reshape(2, -1).max(axis=0) + fine
    if moved.max() > fine:
        warnings.warn(
            f"angles={angles}: islands of other basins between the angles cut off up to {moved.max():.2g} rad of the "
            "limits, and narrower ones may lie nearer, as the errors say; give more angles",
            IslandWarning,
            stacklevel=2,
        )
    lower, upper = reach.reshape(2, -1)
    return ReleaseLimits(moments, lower, upper, error, releases.target)


def _equally_spaced(angles: int) -> NDArray[np.float64]:
    return np.asarray(np.arange(angles + 1) * (pi / angles), dtype=float)


@dataclass(eq=False)
class _Line:
    """Releases on one side at one phase: distances in rising order, whether each comes back, and settling times."""

    x: NDArray[np.float64]
    stays: NDArray[np.bool_]
    times: NDArray[np.integer]

    def bracket(self) -> tuple[float, float]:
        """Return the last distance before the first from which a release does not come back, and that one."""
        first = len(self.x) if self.stays.all() else int(np.argmin(self.stays))
        return float(self.x[max(first - 1, 0)]), float(self.x[min(first, len(self.x) - 1)])


class _Releases:
    """Releases that have been followed, on lines of both sides, all phases of one side before those of the other."""

    def __init__(
        self, system: ForcedSystem, middle: float, moments: NDArray[np.float64], fine: float, max_periods: int
    ) -> None:
        self.target: Attractor | None = None
        self.lines = [_Line(np.empty(0), np.empty(0, bool), np.empty(0, np.int64)) for _ in range(2 * moments.size)]
        self._strobe = stroboscopic_map(system, rtol=fine, atol=fine)
        self._carry = [_to_section(system, moment - floor(moment), fine) for moment in moments.tolist()]
        self._middle, self._max_periods = middle, max_periods
        self._known: tuple[Attractor, ...] = ()

    def add(self, distances: Sequence[NDArray[np.float64]]) -> None:
        """Follow releases from further distances on each line, in one batch."""
        counts = [len(new) for new in distances]
        if not sum(counts):
            return
        half, states = len(self.lines) // 2, []
        for k, new in enumerate(distances):
            offsets = new if k >= half else -new
            states.append(self._carry[k % half](np.stack([self._middle + offsets, np.zeros(len(new))], axis=-1)))
        basins = find_basins(self._strobe, np.concatenate(states), self._max_periods, attractors=self._known)
        if not self._known and basins.labels[0] >= 0:
            self._known, self.target = basins.attractors, basins.attractors[int(basins.labels[0])]
        back = np.isin(basins.labels, [k for k, a in enumerate(basins.attractors) if a is self.target])
        ends = np.cumsum(counts)[:-1]
        found = zip(distances, np.split(back, ends), np.split(basins.settling_time, ends), strict=True)
        for k, (x, stay, time) in enumerate(found):
            line = self.lines[k]
            places = np.concatenate([line.x, x])
            order = np.argsort(places, kind="stable")
            stays, times = np.concatenate([line.stays, stay]), np.concatenate([line.times, time])
            self.lines[k] = _Line(places[order], stays[order], times[order])


def _settled(releases: _Releases, scan: Sequence[NDArray[np.float64]], fine: float) -> NDArray[np.float64]:
    """Look for islands where releases settle late, cut the brackets, and return the limits of all lines.

    An orbit stays the longer near a saddle on the boundary the nearer it begins to the boundary, so that an island that
    lies between two angles of a scan lengthens the times around it.
    """
    windows = [_late(line, places) for line, places in zip(releases.lines, scan, strict=True)]
    while any(windows):
        cuts = [[np.linspace(a, b, _PARTS + 1)[1:-1] for a, b in found] for found in windows]
        releases.add([np.setdiff1d(np.concatenate([np.empty(0), *c]), old.x) for c, old in _pairs(cuts, releases)])
        windows = [
            [w for a, b in found for w in _narrower(line, a, b, fine)] for found, line in _pairs(windows, releases)
        ]
    while True:
        brackets = [line.bracket() for line in releases.lines]
        if max(b - a for a, b in brackets) <= fine:
            return np.array([a for a, _ in brackets])
        releases.add([np.linspace(a, b, _PARTS + 1)[1:-1] if b - a > fine else np.empty(0) for a, b in brackets])


def _pairs(values: Sequence[Any], releases: _Releases) -> list[tuple[Any, _Line]]:
    return list(zip(values, releases.lines, strict=True))


def _late(line: _Line, scan: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Return windows about the angles of a scan, below the limit, from which releases settle latest of those around."""
    from scipy.signal import find_peaks

    places = scan[scan <= line.bracket()[0]]
    times = line.times[np.searchsorted(line.x, places)]
    peaks, shape = find_peaks(times, prominence=_PROMINENT)
    highest = np.sort(peaks[np.argsort(-shape["prominences"], kind="stable")[:_PEAKS]])
    return [(float(places[k - 1]), float(places[k + 1])) for k in highest]


def _narrower(line: _Line, low: float, high: float, fine: float) -> list[tuple[float, float]]:
    """Return the part of a window about the latest release, none where it holds an island or is narrow enough."""
    inside = slice(*np.searchsorted(line.x, [low, high * (1.0 + 1e-15)]))
    if not line.stays[inside].all() or high - low <= fine:
        return []
    x = line.x[inside]
    k = int(np.clip(np.argmax(line.times[inside]), 1, len(x) - 2))
    return [(float(x[k - 1]), float(x[k + 1]))]


def _to_section(
    system: ForcedSystem, phase: float, tolerance: float
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Return the motion from a phase to the end of the period."""
    if phase == 0.0:
        return lambda points: points
    begin, duration = phase * system.length, (1.0 - phase) * system.length
    return lambda points: integrate(system, points, begin, duration, tolerance, tolerance).points
