"""Forced oscillators with two wells on a ring."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from math import cos
from typing import Any

from cellmap import ForcedSystem
from cellmap.maps import RightHandSide
from cellmap.utils import finite_number, whole_number

from .networks import forcing_period
from .quantities import sized_number


def ring_of_wells(
    n_oscillators: int = 3,
    coupling: float = 0.1,
    damping: float = 0.2,
    forcing: float = 0.1,
    frequency: float = 1.0,
) -> ForcedSystem:
    """Return a ring of forced two-well oscillators, each coupled to the next one on both sides.

    x_k'' = x_k - x_k^3 - damping x_k' + coupling (x_{k+1} - 2 x_k + x_{k-1}) + forcing cos(frequency t)

    Indices are modulo `n_oscillators`.  The equations do not change when the ring is turned or reflected, nor when all
    x_k become -x_k half a period later.

    Parameters
    ----------
    n_oscillators : int, optional
        Number of oscillators, at least 2.
    coupling : float, optional
        Stiffness of the springs between neighbours.
    damping : float, optional
        Viscous damping, at least 0.
    forcing : float, optional
        Amplitude of the force on each oscillator.
    frequency : float, optional
        Angular frequency of the force, above 0.

    Returns
    -------
    ForcedSystem
        System of the positions, then the velocities, and of period 2 pi / `frequency`.  All quantities are
        dimensionless.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Umberger, Grebogi, Ott, Afeyan, Physical Review A 39 (1989) 4835.

    Examples
    --------
    >>> ring_of_wells(3, coupling=1.0, forcing=0.0).derivative(0.0, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    (0.0, 0.0, 0.0, -2.0, 1.0, 1.0)
    """
    n_oscillators = whole_number("n_oscillators", n_oscillators, at_least=2)
    params = {
        "coupling": finite_number("coupling", coupling),
        "damping": finite_number("damping", damping, at_least=0.0),
        "forcing": finite_number("forcing", forcing),
        "frequency": sized_number("frequency", frequency, above=0.0),
    }
    axes = (*(f"x_{k + 1}" for k in range(n_oscillators)), *(f"v_{k + 1}" for k in range(n_oscillators)))
    name = f"ring of {n_oscillators} two-well oscillators"
    return ForcedSystem(_coupled(n_oscillators), params, period=forcing_period, coordinates=axes, name=name)


@functools.cache
def _coupled(n_oscillators: int) -> RightHandSide:
    def motion(t: float, x: Sequence[float], p: Any) -> tuple[float, ...]:
        q, v = x[:n_oscillators], x[n_oscillators:]
        force = p.forcing * cos(p.frequency * t)
        pulls = [p.coupling * (q[(k + 1) % n_oscillators] - q[k]) for k in range(n_oscillators)]
        return (
            *v,
            *(q[k] - q[k] ** 3 - p.damping * v[k] + pulls[k] - pulls[k - 1] + force for k in range(n_oscillators)),
        )

    return motion
