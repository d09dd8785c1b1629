"""Duffing oscillators: damping, a linear and a cubic spring, and a harmonic force."""

from __future__ import annotations

from typing import Any

from cellmap import ForcedSystem
from cellmap.utils import finite_number

from .oscillator import forced_oscillator


def duffing_oscillator(
    damping: float = 0.1, linear: float = 1.0, cubic: float = 1.0, forcing: float = 0.3, frequency: float = 1.4
) -> ForcedSystem:
    """Return Duffing's oscillator: x'' + damping x' + linear x + cubic x^3 = forcing cos(frequency t).

    A positive cubic term, as by default, is a hardening spring with coexisting small and large oscillations
    (bistability).  With a negative one strong oscillations escape to infinity; a negative linear term makes a double
    well.

    Parameters
    ----------
    damping : float, optional
        Viscous damping, at least 0.
    linear, cubic : float, optional
        Coefficients of the restoring force.
    forcing : float, optional
        Amplitude of the force.
    frequency : float, optional
        Angular frequency of the force, above 0.

    Returns
    -------
    ForcedSystem
        System of the state (x, v) and of period 2 pi / `frequency`.  All quantities are dimensionless.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Duffing, *Erzwungene Schwingungen bei veränderlicher Eigenfrequenz und ihre technische Bedeutung* (1918); Kovacic,
    Brennan (editors), *The Duffing Equation: Nonlinear Oscillators and their Behaviour* (2011).

    Examples
    --------
    >>> duffing_oscillator(linear=1.0, cubic=0.5, forcing=0.3).derivative(0.0, (2.0, 0.0))
    (0.0, -5.7)
    """
    return forced_oscillator(
        "Duffing",
        _duffing,
        damping=finite_number("damping", damping, at_least=0.0),
        linear=finite_number("linear", linear),
        cubic=finite_number("cubic", cubic),
        forcing=forcing,
        frequency=frequency,
    )


def two_well_duffing(damping: float = 0.15, forcing: float = 0.2, frequency: float = 1.0) -> ForcedSystem:
    """Return the forced oscillator in a double well: x'' + damping x' - x + x^3 = forcing cos(frequency t).

    Parameters
    ----------
    damping : float, optional
        Viscous damping, at least 0.
    forcing : float, optional
        Amplitude of the force.
    frequency : float, optional
        Angular frequency of the force, above 0.

    Returns
    -------
    ForcedSystem
        System of the state (x, v) and of period 2 pi / `frequency`.  All quantities are dimensionless.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Guckenheimer, Holmes, *Nonlinear Oscillations, Dynamical Systems, and Bifurcations of Vector Fields* (1983), 2.2;
    Holmes, Philosophical Transactions A 292 (1979) 419.

    Examples
    --------
    >>> two_well_duffing().derivative(0.0, (1.0, 0.0))
    (0.0, 0.2)
    """
    damping = finite_number("damping", damping, at_least=0.0)
    return forced_oscillator("two-well Duffing", _two_well, damping=damping, forcing=forcing, frequency=frequency)


def moon_li_duffing(damping: float = 0.15, forcing: float = 0.1, frequency: float = 0.8333) -> ForcedSystem:
    """Return the buckled beam of Moon and Li: x'' + damping x' - x (1 - x^2)/2 = forcing cos(frequency t).

    By Melnikov's criterion the boundaries of its basins become fractal where the forcing exceeds
    sqrt(2)/(3 pi) damping cosh(pi frequency / sqrt(2)) / frequency, which is 0.0881 for the other defaults.

    Parameters
    ----------
    damping : float, optional
        Viscous damping, at least 0.
    forcing : float, optional
        Amplitude of the force.
    frequency : float, optional
        Angular frequency of the force, above 0.

    Returns
    -------
    ForcedSystem
        System of the state (x, v) and of period 2 pi / `frequency`.  All quantities are dimensionless.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Moon, Li, Physical Review Letters 55 (1985) 1439.

    Examples
    --------
    >>> moon_li_duffing().derivative(0.0, (2.0, 0.0))
    (0.0, -2.9)
    """
    damping = finite_number("damping", damping, at_least=0.0)
    return forced_oscillator("Moon and Li's Duffing", _moon_li, damping=damping, forcing=forcing, frequency=frequency)


def ueda_oscillator(damping: float = 0.05, forcing: float = 7.5, frequency: float = 1.0) -> ForcedSystem:
    """Return Ueda's oscillator, a spring without a linear term: x'' + damping x' + x^3 = forcing cos(frequency t).

    Parameters
    ----------
    damping : float, optional
        Viscous damping, at least 0.
    forcing : float, optional
        Amplitude of the force.
    frequency : float, optional
        Angular frequency of the force, above 0; Ueda's is 1.

    Returns
    -------
    ForcedSystem
        System of the state (x, v) and of period 2 pi / `frequency`.  All quantities are dimensionless.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Ueda, Journal of Statistical Physics 20 (1979) 181.

    Examples
    --------
    >>> ueda_oscillator().derivative(0.0, (2.0, 0.0))
    (0.0, -0.5)
    """
    damping = finite_number("damping", damping, at_least=0.0)
    return forced_oscillator("Ueda", _cubic, damping=damping, forcing=forcing, frequency=frequency)


def _duffing(x: float, v: float, p: Any) -> float:
    return -p.linear * x - p.cubic * x**3 - p.damping * v


def _two_well(x: float, v: float, p: Any) -> float:
    return x - x**3 - p.damping * v


def _moon_li(x: float, v: float, p: Any) -> float:
    return 0.5 * x * (1.0 - x * x) - p.damping * v


def _cubic(x: float, v: float, p: Any) -> float:
    return -(x**3) - p.damping * v
