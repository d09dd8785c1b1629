"""Josephson junctions in series with a load."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin
from typing import Any

from cellmap import Coordinate, ForcedSystem, angle
from cellmap.utils import finite_number, whole_number

from .networks import forcing_period
from .quantities import sized_number


def josephson_chain(
    n_junctions: int = 2,
    capacitance: float = 1.0,
    load: float = 1.0,
    current: float = 1.2,
    forcing: float = 0.5,
    frequency: float = 1.0,
) -> ForcedSystem:
    """Return equal Josephson junctions in series, with a resistor in parallel to all of them.

    With the phase difference phi_k at junction k,

    capacitance phi_k'' + phi_k' + sin phi_k + load / n_junctions sum_j phi_j' = current + forcing cos(frequency t)

    The equations do not change when junctions are exchanged.

    Parameters
    ----------
    n_junctions : int, optional
        Number of junctions, at least 1.
    capacitance : float, optional
        Capacitance of each, McCumber's parameter, above 0.
    load : float, optional
        Conductance of the load for each junction, in that of a junction, at least 0; 1 is the matched load.
    current : float, optional
        Constant bias current, in critical currents.
    forcing : float, optional
        Amplitude of the alternating current.
    frequency : float, optional
        Its angular frequency, above 0.

    Returns
    -------
    ForcedSystem
        System of the phases, then the voltages phi_k', and of period 2 pi / `frequency`.  All quantities are
        dimensionless.

    Raises
    ------
    TypeError, ValueError
        For parameters that are not finite numbers within their bounds.

    References
    ----------
    Hadley, Beasley, Wiesenfeld, Physical Review B 38 (1988) 8712.

    Examples
    --------
    >>> josephson_chain(load=2.0, forcing=0.0, current=4.0).derivative(0.0, (0.0, 0.0, 1.0, 0.0))
    (1.0, 0.0, 2.0, 3.0)
    """
    n_junctions = whole_number("n_junctions", n_junctions, at_least=1)
    params = {
        "capacitance": sized_number("capacitance", capacitance, above=0.0),
        "load": finite_number("load", load, at_least=0.0),
        "current": finite_number("current", current),
        "forcing": finite_number("forcing", forcing),
        "frequency": sized_number("frequency", frequency, above=0.0),
    }
    junctions = range(1, n_junctions + 1)
    axes = (*(angle(f"phi_{k}") for k in junctions), *(Coordinate(f"v_{k}") for k in junctions))
    name = f"chain of {n_junctions} Josephson junctions"
    return ForcedSystem(_junctions, params, period=forcing_period, coordinates=axes, name=name)


def _junctions(t: float, x: Sequence[float], p: Any) -> tuple[float, ...]:
    n = len(x) // 2
    phases, voltages = x[:n], x[n:]
    driven = p.current + p.forcing * cos(p.frequency * t) - p.load / n * sum(voltages)
    return (*voltages, *((driven - sin(a) - v) / p.capacitance for a, v in zip(phases, voltages, strict=True)))
