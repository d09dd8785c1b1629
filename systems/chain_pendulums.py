"""Double, triple and longer pendulums on a vertically driven pivot, in SI units."""

from __future__ import annotations

from collections.abc import Sequence

from cellmap import ForcedSystem
from cellmap.utils import text

from .chain import Chain
from .drives import VerticalDrive
from .effects import DryFriction, Gravity, ViscousDamping
from .scenes import scene


def chain_pendulum(
    lengths: Sequence[float],
    masses: Sequence[float],
    amplitude: float = 0.003,
    frequency: float = 50.0,
    damping: float | Sequence[float] = 10.0,
    gravity: float = 9.8,
    phase: float = 0.0,
    friction: float | Sequence[float] = 0.0,
    name: str = "",
) -> ForcedSystem:
    """Return the chain of pendulums whose pivot is at the height y(t) = A cos(w t + phase), in SI units.

    The state is the absolute angles from the downward vertical, then their angular velocities, inner link first; see
    :class:`Chain` for the equation, M q'' = F.  All chains of the same number of links share one right-hand side.

    Parameters
    ----------
    lengths : sequence of float
        Lengths of the rods (m), above 0, inner link first.
    masses : sequence of float
        Masses at their ends (kg), above 0.
    amplitude : float, optional
        Amplitude A of the pivot's height (m), at least 0.
    frequency : float, optional
        Frequency of the drive (Hz), above 0.
    damping : float or sequence of float, optional
        Viscous damping of every joint (1/s), or of each, at least 0: its torque is `damping` m_1 l_1^2 times the
        relative angular velocity.
    gravity : float, optional
        Acceleration g of free fall (m/s^2).
    phase : float, optional
        Phase of the drive (rad).
    friction : float or sequence of float, optional
        Dry friction of every joint (rad/s^2), or of each, at least 0: its torque is `friction` m_1 l_1^2 against the
        relative angular velocity.
    name : str, optional
        Name for files and plots.

    Returns
    -------
    ForcedSystem
        System of period 1/`frequency` (s).

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds, or for different numbers of masses and lengths.

    References
    ----------
    Acheson, Proceedings of the Royal Society A 443 (1993) 239.

    Examples
    --------
    >>> chain_pendulum(lengths=(0.1, 0.1, 0.1, 0.1), masses=(1.0, 1.0, 1.0, 1.0), name="four links").dimension
    8
    """
    effects = (
        Gravity(gravity),
        VerticalDrive(amplitude, frequency, phase),
        ViscousDamping(damping),
        DryFriction(friction),
    )
    body = Chain(lengths, masses)
    return scene(body, *effects, name=text("name", name) or f"chain of {body.joints} pendulums")


def double_pendulum(
    length_1: float = 0.032,
    length_2: float = 0.032,
    mass_1: float = 1.0,
    mass_2: float = 0.25,
    amplitude: float = 0.006,
    frequency: float = 50.0,
    damping: float | Sequence[float] = 10.0,
    gravity: float = 9.8,
    phase: float = 0.0,
    friction: float | Sequence[float] = 0.0,
) -> ForcedSystem:
    """Return the double pendulum whose pivot is at the height y(t) = A cos(w t + phase), in SI units.

    With D = theta_1 - theta_2, G = g + y'' and free joints

    theta_1'' = -[m_2 (l_1 theta_1'^2 sin 2D + 2 l_2 theta_2'^2 sin D) + G ((2 m_1 + m_2) sin theta_1
    + m_2 sin(theta_1 - 2 theta_2))] / [2 l_1 (m_1 + m_2 sin^2 D)],

    theta_2'' = [m_2 l_2 theta_2'^2 sin 2D + (m_1 + m_2) (2 l_1 theta_1'^2 sin D + G (sin(2 theta_1 - theta_2)
    - sin theta_2))] / [2 l_2 (m_1 + m_2 sin^2 D)].

    The state is (theta_1, theta_2, theta_1', theta_2'), absolute angles from the downward vertical, counter-clockwise.

    Parameters
    ----------
    length_1, length_2 : float, optional
        Lengths of the inner and of the outer rod (m), above 0.
    mass_1, mass_2 : float, optional
        Masses at their ends (kg), above 0.
    amplitude, frequency, phase, gravity : float, optional
        Drive (m, Hz, rad) and acceleration of free fall (m/s^2), as of :func:`chain_pendulum`.
    damping, friction : float or sequence of float, optional
        Viscous damping (1/s) and dry friction (rad/s^2) of every joint, or of each, as of :func:`chain_pendulum`.

    Returns
    -------
    ForcedSystem
        System of period 1/`frequency` (s).  With the defaults all four equilibria are stable.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Acheson, Proceedings of the Royal Society A 443 (1993) 239; Acheson, Mullin, Nature 366 (1993) 215.

    Examples
    --------
    >>> double_pendulum(amplitude=0.0, damping=0.0).derivative(0.0, (0.0, 0.0, 1.0, 2.0))
    (1.0, 2.0, 0.0, 0.0)
    """
    return chain_pendulum(
        (length_1, length_2),
        (mass_1, mass_2),
        amplitude,
        frequency,
        damping,
        gravity,
        phase,
        friction,
        "double pendulum",
    )


def triple_pendulum(
    length_1: float = 0.032,
    length_2: float = 0.032,
    length_3: float = 0.032,
    mass_1: float = 1.0,
    mass_2: float = 1.0,
    mass_3: float = 1.0,
    amplitude: float = 0.0021,
    frequency: float = 100.0,
    damping: float | Sequence[float] = 10.0,
    gravity: float = 9.8,
    phase: float = 0.0,
    friction: float | Sequence[float] = 0.0,
) -> ForcedSystem:
    """Return the triple pendulum whose pivot is at the height y(t) = A cos(w t + phase), in SI units.

    M q'' = F as in :class:`Chain`.  The state is (theta_1, theta_2, theta_3) and their angular velocities, absolute
    angles from the downward vertical, counter-clockwise, inner link first.

    Parameters
    ----------
    length_1, length_2, length_3 : float, optional
        Lengths of the rods (m), above 0, from the pivot outwards.
    mass_1, mass_2, mass_3 : float, optional
        Masses at their ends (kg), above 0.
    amplitude, frequency, phase, gravity : float, optional
        Drive (m, Hz, rad) and acceleration of free fall (m/s^2), as of :func:`chain_pendulum`.
    damping, friction : float or sequence of float, optional
        Viscous damping (1/s) and dry friction (rad/s^2) of every joint, or of each, as of :func:`chain_pendulum`.

    Returns
    -------
    ForcedSystem
        System of period 1/`frequency` (s).  With the defaults all eight equilibria are stable.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Acheson, Proceedings of the Royal Society A 443 (1993) 239.

    Examples
    --------
    >>> triple_pendulum().dimension
    6
    """
    return chain_pendulum(
        (length_1, length_2, length_3),
        (mass_1, mass_2, mass_3),
        amplitude,
        frequency,
        damping,
        gravity,
        phase,
        friction,
        "triple pendulum",
    )
