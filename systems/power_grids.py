"""Synchronous machines on a power grid."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from math import cos, sin
from typing import Any

from cellmap import Coordinate, ForcedSystem, angle
from cellmap.maps import RightHandSide
from cellmap.utils import finite_number

from .networks import Lines, forcing_period, lines_between, numbers_of_nodes
from .quantities import sized_number


def power_grid(
    powers: Sequence[float] = (1.0, -1.0),
    lines: Sequence[tuple[int, int]] = ((0, 1), (1, 2)),
    coupling: float = 8.0,
    damping: float = 0.1,
    forcing: float = 0.0,
    frequency: float = 6.0,
) -> ForcedSystem:
    """Return the swing equations of machines on a grid, the first of which is forced.

    In the frame that rotates with the rated frequency, machine k has the phase theta_k, and

    theta_k'' = P_k - damping theta_k' + coupling sum_l sin(theta_l - theta_k) + forcing cos(frequency t) if k = 1,

    with a sum over the lines that end at k.  Node 0 is an infinite bus, where theta = 0.  Without a line to it, all
    phases may turn together.  All machines on the same lines share one right-hand side.

    Parameters
    ----------
    powers : sequence of float, optional
        Net power P_k of each machine, divided by its moment of inertia: above 0 for generators, below for consumers.
    lines : sequence of pairs of int, optional
        The two nodes of each line; machines are counted from 1, and 0 is the bus.
    coupling : float, optional
        Capacity of each line.
    damping : float, optional
        Viscous damping, at least 0.
    forcing : float, optional
        Amplitude of an oscillation of the first machine's power.
    frequency : float, optional
        Angular frequency of the oscillation, above 0.

    Returns
    -------
    ForcedSystem
        System of the phases, then their angular velocities, and of period 2 pi / `frequency`, which without `forcing`
        is that of sampling.  All quantities are dimensionless.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds, and lines that are no pairs of nodes.

    References
    ----------
    Filatrella, Nielsen, Pedersen, European Physical Journal B 61 (2008) 485; Menck, Heitzig, Marwan, Kurths, Nature
    Physics 9 (2013) 89; Menck, Heitzig, Kurths, Schellnhuber, Nature Communications 5 (2014) 3969, for the defaults.

    Examples
    --------
    >>> power_grid(damping=0.5).derivative(0.0, (0.0, 0.0, 1.0, 2.0))
    (1.0, 2.0, 0.5, -2.0)
    """
    given = numbers_of_nodes("powers", powers)
    nodes = range(1, len(given) + 1)
    params = {f"power_{k}": power for k, power in zip(nodes, given, strict=True)}
    params["coupling"] = finite_number("coupling", coupling)
    params["damping"] = finite_number("damping", damping, at_least=0.0)
    params["forcing"] = finite_number("forcing", forcing)
    params["frequency"] = sized_number("frequency", frequency, above=0.0)
    motion = _swinging(lines_between(lines, len(given)), len(given))
    axes = (*(angle(f"theta_{k}") for k in nodes), *(Coordinate(f"omega_{k}") for k in nodes))
    return ForcedSystem(motion, params, period=forcing_period, coordinates=axes, name=f"grid of {len(given)} machines")


@functools.cache
def _swinging(lines: Lines, nodes: int) -> RightHandSide:
    """Compose once for each network: kernels are kept by the identity of their right-hand side."""

    def motion(t: float, x: Sequence[float], p: Any) -> tuple[float, ...]:
        torques = [getattr(p, f"power_{k + 1}") - p.damping * x[nodes + k] for k in range(nodes)]
        torques[0] = torques[0] + p.forcing * cos(p.frequency * t)
        for a, b in lines:
            if a == 0:
                torques[b - 1] = torques[b - 1] - p.coupling * sin(x[b - 1])
            else:
                flow = p.coupling * sin(x[b - 1] - x[a - 1])
                torques[a - 1], torques[b - 1] = torques[a - 1] + flow, torques[b - 1] - flow
        return (*x[nodes:], *torques)

    return motion
