"""Wells of effective potentials: slow equilibria, their frequencies and barriers."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eigh
from scipy.optimize import brentq

from cellmap.utils import finite_number, one_point

from .averaging import EffectivePotential

_NODES = 4096  # places over 2 pi where a barrier is sought, closest beside the well


@dataclass(frozen=True, eq=False)
class SlowEquilibrium:
    """Equilibrium of an effective potential.

    Parameters
    ----------
    angles : ndarray, shape (joints,)
        Angles (rad).
    energy : float
        Potential there, in the unit of the energy.
    squares : ndarray, shape (joints,)
        Squares of the angular frequencies of slow small oscillations about it (rad^2/s^2), in increasing order;
        negative for a direction in which the potential decreases.
    """

    angles: NDArray[np.float64]
    energy: float
    squares: NDArray[np.float64]

    def __repr__(self) -> str:
        place = ", ".join(f"{round(a, 12):g}" for a in self.angles)
        return f"SlowEquilibrium(({place}) rad, {'stable' if self.stable else 'unstable'})"

    @property
    def stable(self) -> bool:
        """Whether the potential has a minimum there."""
        return bool((self.squares > 0.0).all())

    @property
    def frequencies(self) -> NDArray[np.float64]:
        """Frequencies of slow small oscillations (Hz), in increasing order.

        Raises
        ------
        ValueError
            For an unstable equilibrium, which does not oscillate in some direction.
        """
        if not self.stable:
            raise ValueError(f"{self!r} does not swing in every direction: see its squares")
        return np.asarray(np.sqrt(self.squares) / (2.0 * pi))


@dataclass(frozen=True)
class Well:
    """Well of the effective potential of one joint, between two barriers.

    Parameters
    ----------
    angle : float
        Angle of its bottom (rad).
    lower, upper : float
        Angles of the maxima on both sides (rad), infinite where there is none within one full rotation.
    depths : tuple of float
        Heights of these maxima above the bottom, in the unit of the energy.
    frequency : float
        Frequency of slow small oscillations (Hz).
    """

    angle: float
    lower: float
    upper: float
    depths: tuple[float, float]
    frequency: float

    @property
    def critical_angle(self) -> float:
        """Distance of the nearer barrier (rad): the largest angle of release from rest, on both sides."""
        return min(self.angle - self.lower, self.upper - self.angle)


def slow_equilibrium(potential: EffectivePotential, near: ArrayLike) -> SlowEquilibrium:
    """Find an equilibrium of an effective potential by Newton's method.

    Parameters
    ----------
    potential : EffectivePotential
        The potential.
    near : array_like, shape (joints,) or a number
        Initial angles (rad).

    Returns
    -------
    SlowEquilibrium
        Angles to about 1e-13, energy and slow frequencies.

    Raises
    ------
    TypeError, ValueError
        For angles that are not finite numbers, or of another number than the joints, and if no equilibrium is found.

    References
    ----------
    Kapitza, Soviet Physics JETP 21 (1951) 588.

    Examples
    --------
    Kapitza's frequency of the inverted pendulum, sqrt((A w)^2 / (2 l^2) - g / l) / (2 pi):

    >>> from systems import effective_potential
    >>> from systems import driven_pendulum
    >>> float(slow_equilibrium(effective_potential(driven_pendulum()), pi).frequencies[0])
    2.465691357
    """
    _check_potential(potential)
    angles = one_point("near", near, potential.joints)
    for _ in range(50):
        try:
            step = np.linalg.solve(potential.hessian(*angles), potential.gradient(*angles))
        except np.linalg.LinAlgError:
            break
        longest = float(np.abs(step).max())
        angles = angles - step * min(1.0, 0.5 / max(longest, 0.5))
        if longest < 1e-10:
            squares = eigh(potential.hessian(*angles), potential.inertia(*angles), eigvals_only=True)
            return SlowEquilibrium(angles, float(potential(*angles)), squares)
    raise ValueError(f"near={near!r}: Newton's method finds no equilibrium from there; begin nearer to one")


def find_well(potential: EffectivePotential, near: float = pi) -> Well:
    """Find a well of the effective potential of one joint, with the barriers on both sides.

    Parameters
    ----------
    potential : EffectivePotential
        Potential of one joint.
    near : float, optional
        Angle near its bottom (rad); by default the inverted state.

    Returns
    -------
    Well
        Bottom and barriers to about 1e-13 rad.

    Raises
    ------
    TypeError, ValueError
        For several joints, and if there is no minimum.

    References
    ----------
    Kapitza, Soviet Physics JETP 21 (1951) 588.

    Examples
    --------
    The critical angle of release, arc cos of 2 g l / (A w)^2:

    >>> from systems import effective_potential
    >>> from systems import driven_pendulum
    >>> find_well(effective_potential(driven_pendulum(amplitude=0.004))).critical_angle
    1.226427972
    """
    _check_potential(potential)
    if potential.joints != 1:
        raise ValueError(f"potential={potential!r}: give one of a single joint; barriers of several are no points")
    rest = slow_equilibrium(potential, finite_number("near", near))
    bottom = float(rest.angles[0])
    offsets = 2.0 * pi * (np.arange(1, _NODES + 1) / _NODES) ** 2
    sides = [_barrier(potential, bottom, side * offsets) for side in (-1.0, 1.0)] if rest.stable else [bottom]
    if bottom in sides:
        raise ValueError(f"near={near!r}: no well, for the potential is not lowest at {bottom:g} rad")
    heights = [float(potential(b)) - rest.energy if np.isfinite(b) else inf for b in sides]
    return Well(bottom, sides[0], sides[1], (heights[0], heights[1]), float(rest.frequencies[0]))


def _barrier(potential: EffectivePotential, bottom: float, offsets: NDArray[np.float64]) -> float:
    """Return the first maximum on one side: infinite for none within the offsets, the bottom for one at once."""
    side = 1.0 if offsets[0] > 0.0 else -1.0
    falls = np.flatnonzero(side * potential.gradient(bottom + offsets)[:, 0] < 0.0)
    if not len(falls):
        return side * inf
    if falls[0] == 0:
        return bottom
    ends = bottom + offsets[falls[0] - 1], bottom + offsets[falls[0]]
    root: float = brentq(lambda a: float(potential.gradient(a)[0]), *ends, xtol=1e-15, rtol=1e-15)
    return root


def _check_potential(potential: EffectivePotential) -> None:
    if not isinstance(potential, EffectivePotential):
        raise TypeError(f"potential={potential!r}: give an EffectivePotential, as effective_potential returns it")
