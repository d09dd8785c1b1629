"""Runge-Kutta methods as data.  The coefficients are SciPy's; its integrators load only when a method is used."""

from __future__ import annotations

import functools
from typing import Any

from .runge_kutta import Tableau


def _rows(matrix: Any) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(a) for a in row) for row in matrix)


@functools.cache
def dop853() -> Tableau:
    """Dormand and Prince's method of order 8 with embedded orders 5 and 3 (Hairer, Norsett, Wanner 1993, II.10)."""
    from scipy.integrate import DOP853

    stages = DOP853.n_stages
    return Tableau(
        name="DOP853",
        order=8,
        estimate_order=7,
        nodes=tuple(map(float, DOP853.C[:stages])),
        stages=_rows(DOP853.A[:stages, :stages]),
        weights=tuple(map(float, DOP853.B[:stages])),
        errors=_rows((DOP853.E5[:stages], DOP853.E3[:stages])),
    )


@functools.cache
def rk45() -> Tableau:
    """Dormand and Prince's method of order 5 with embedded order 4 (1980); the estimate needs the seventh stage."""
    from scipy.integrate import RK45

    return Tableau(
        name="RK45",
        order=5,
        estimate_order=4,
        nodes=(*map(float, RK45.C), 1.0),
        stages=(*_rows(RK45.A), tuple(map(float, RK45.B))),
        weights=tuple(map(float, RK45.B)),
        errors=_rows((RK45.E,)),
    )
