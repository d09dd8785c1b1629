"""Hill's equation, a spring of periodic stiffness, and Mathieu's, where the stiffness has one harmonic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, pi
from typing import Any

from cellmap import ForcedSystem
from cellmap.maps import RightHandSide
from cellmap.utils import finite_number


def mathieu_equation(damping: float = 0.1, delta: float = -0.1, epsilon: float = 1.0) -> ForcedSystem:
    """Return Mathieu's equation with damping: x'' + damping x' + (delta + epsilon cos 2t) x = 0.

    In the usual notation, x'' + (a - 2 q cos 2t) x = 0, it has a = delta and q = -epsilon/2.  With the defaults, the
    mean stiffness is negative and the modulation stabilises the equilibrium x = 0.

    Parameters
    ----------
    damping : float, optional
        Viscous damping, at least 0.
    delta : float, optional
        Mean of the stiffness.
    epsilon : float, optional
        Amplitude of its modulation.

    Returns
    -------
    ForcedSystem
        System of the state (x, v) and of period pi.  All quantities are dimensionless.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Mathieu, Journal de Mathématiques Pures et Appliquées 13 (1868) 137; McLachlan, *Theory and Application of Mathieu
    Functions* (1947).

    Examples
    --------
    >>> mathieu_equation(damping=0.1, delta=1.0, epsilon=0.5).derivative(0.0, (1.0, 1.0))
    (1.0, -1.6)
    """
    params = {
        "damping": finite_number("damping", damping, at_least=0.0),
        "delta": finite_number("delta", delta),
        "epsilon": finite_number("epsilon", epsilon),
    }
    return ForcedSystem(_MATHIEU, params, period=pi, coordinates=("x", "v"), name="Mathieu")


def hill_equation(
    damping: float = 0.0,
    delta: float = 1.1588439396,
    epsilon1: float = -0.1140880375,
    epsilon2: float = 0.000766476,
    epsilon3: float = -0.0000183466,
) -> ForcedSystem:
    """Return Hill's equation: x'' + damping x' + (delta + sum over k of epsilon_k cos 2kt) x = 0, k = 1, 2, 3.

    Parameters
    ----------
    damping : float, optional
        Viscous damping, at least 0.
    delta : float, optional
        Mean of the stiffness.
    epsilon1, epsilon2, epsilon3 : float, optional
        Amplitudes of its harmonics.

    Returns
    -------
    ForcedSystem
        System of the state (x, v) and of period pi.  All quantities are dimensionless.  The defaults are the
        coefficients of the lunar perigee.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Hill, Acta Mathematica 8 (1886) 1; Magnus, Winkler, *Hill's Equation* (1966).

    Examples
    --------
    >>> hill_equation(delta=1.0, epsilon1=0.3, epsilon2=0.2, epsilon3=0.1).derivative(0.0, (1.0, 0.0))
    (0.0, -1.6)
    """
    params = {
        "damping": finite_number("damping", damping, at_least=0.0),
        "delta": finite_number("delta", delta),
        "epsilon1": finite_number("epsilon1", epsilon1),
        "epsilon2": finite_number("epsilon2", epsilon2),
        "epsilon3": finite_number("epsilon3", epsilon3),
    }
    return ForcedSystem(_HILL, params, period=pi, coordinates=("x", "v"), name="Hill")


def _spring(stiffness: Callable[[float, Any], float]) -> RightHandSide:
    def motion(t: float, x: Sequence[float], p: Any) -> tuple[float, float]:
        q, v = x
        return v, -stiffness(t, p) * q - p.damping * v

    return motion


def _one_harmonic(t: float, p: Any) -> float:
    return p.delta + p.epsilon * cos(2.0 * t)


def _three_harmonics(t: float, p: Any) -> float:
    return p.delta + p.epsilon1 * cos(2.0 * t) + p.epsilon2 * cos(4.0 * t) + p.epsilon3 * cos(6.0 * t)


_MATHIEU, _HILL = _spring(_one_harmonic), _spring(_three_harmonics)
