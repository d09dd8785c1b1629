"""The angles from which a release at rest really comes back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import floor, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cellmap import Attractor, ForcedSystem, find_basins, stroboscopic_map
from cellmap.checks import finite_number
from cellmap.flow import flow
from cellmap.orbit_batch import Orbits

_PARTS = 16  # parts into which a bracket is cut in one batch


@dataclass(frozen=True, eq=False)
class ReleaseLimits:
    """Angles up to which releases from rest come back, by exact integration; arrays of shape (phases,).

    Parameters
    ----------
    phases : ndarray
        Moments of release, in turns of the forcing.
    lower, upper : ndarray
        Largest distances on both sides, lower and higher angles (rad): a release from any smaller one that was tried
        ends on the same attractor.  0 where even a release in the middle does not, and pi where all do.
    attractor : Attractor
        Where these releases end.
    """

    phases: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
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
    """Return how far from a state at rest a pendulum may be released, at rest, and still settle where that state does.

    Releases at all phases and at equally spaced angles up to half a turn away are integrated and labelled together.
    The first that ends elsewhere gives a bracket for each phase and side; all brackets are then cut together.  Islands
    of other basins narrower than the spacing may be missed.

    Parameters
    ----------
    system : ForcedSystem
        Damped system of one joint: its state is an angle and its rate.
    near : float, optional
        Angle in the middle (rad); by default the inverted state.
    phases : array_like, shape (phases,), optional
        Moments of release, in turns of the forcing: ``t = phase * period``.
    angles : int, optional
        Angles on each side.
    tolerance : float, optional
        Width of the final brackets (rad), and tolerance of a period.
    max_periods : int, optional
        Periods after which a release that has not settled counts as one that does not come back.

    Returns
    -------
    ReleaseLimits
        Distances on both sides.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, and where a release in the middle ends on no attractor.

    Examples
    --------
    >>> from systems.pendulum import driven_pendulum
    >>> limits = release_limits(driven_pendulum(), phases=[0.0, 0.5], angles=32, tolerance=1e-6)
    >>> limits.upper.round(4)
    array([0.9713, 0.8666])
    """
    if not isinstance(system, ForcedSystem):
        raise TypeError(f"system={system!r}: give a ForcedSystem")
    if system.dimension != 2:
        raise ValueError(f"system={system!r}: give a pendulum of one joint, with two state variables")
    middle = finite_number("near", near)
    fine = finite_number("tolerance", tolerance, at_least=1e-12, at_most=1e-2)
    moments = np.atleast_1d(np.asarray(phases, dtype=float))
    if moments.ndim != 1 or not moments.size or not np.isfinite(moments).all():
        raise ValueError(f"phases={phases!r}: give finite numbers")
    strobe = stroboscopic_map(system, rtol=fine, atol=fine)
    to_section = [_to_section(system, moment - floor(moment), fine) for moment in moments.tolist()]
    known: tuple[Attractor, ...] = ()

    def ends(offsets: NDArray[np.float64]) -> tuple[NDArray[np.int16], tuple[Attractor, ...]]:
        """Label releases at offsets (any, sides, phases)."""
        states = np.stack([middle + offsets, np.zeros_like(offsets)], axis=-1)
        for k, carry in enumerate(to_section):
            rows = np.ascontiguousarray(states[..., k, :].reshape(-1, 2))
            states[..., k, :] = carry(rows).reshape(states[..., k, :].shape)
        basins = find_basins(strobe, states, max_periods, attractors=known)
        return basins.labels, basins.attractors

    sides = np.array([-1.0, 1.0])[:, None]
    scan = np.linspace(0.0, pi, angles + 1)[:, None, None]
    labels, known = ends(np.broadcast_to(scan * sides, (angles + 1, 2, moments.size)).copy())
    home = int(labels[0, 0, 0])
    if home < 0:
        raise ValueError(f"near={near!r}: a release from there ends on no attractor; give damping, or a stronger drive")
    target = known[home]
    low, high = _bracket(np.broadcast_to(scan, labels.shape), labels == home)
    while (high - low).max() > fine:
        shares = (np.arange(_PARTS + 1) / _PARTS)[:, None, None]
        cuts = low + shares * (high - low)
        labels, present = ends(cuts[1:-1] * sides)
        homes = [k for k, a in enumerate(present) if a is target]
        stays = np.concatenate([[low >= 0.0], np.isin(labels, homes), [np.zeros(low.shape, bool)]])
        low, high = _bracket(cuts, stays | (low == high))
    return ReleaseLimits(moments, low[0], low[1], target)


def _bracket(values: NDArray[np.float64], stays: NDArray[np.bool_]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the last value, along the first axis, before the first that does not stay, and that one."""
    first = np.where(stays.all(axis=0), len(values), np.argmin(stays, axis=0))
    last, next_one = np.maximum(first - 1, 0), np.minimum(first, len(values) - 1)
    low = np.take_along_axis(values, last[None], axis=0)[0]
    high = np.take_along_axis(values, next_one[None], axis=0)[0]
    return low, high


def _to_section(
    system: ForcedSystem, phase: float, tolerance: float
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Return the motion from a phase to the end of the period."""
    if phase == 0.0:
        return lambda points: points
    length = (1.0 - phase) * system.length
    motion = flow(system, phase * system.length, length, tolerance, tolerance, "auto", 16384)

    def carry(points: NDArray[np.float64]) -> NDArray[np.float64]:
        orbits = Orbits.starting(points)
        motion(orbits)
        return orbits.points

    return carry
