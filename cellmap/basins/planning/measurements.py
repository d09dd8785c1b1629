"""Measurements behind a plan: integration methods, interpolation grids, and the labelling of initial conditions."""

from __future__ import annotations

from dataclasses import dataclass

from ...maps.grid import CellGrid


@dataclass(frozen=True)
class ExactProbe:
    """One way to integrate, measured.

    ``seconds`` of one thread for an image; ``error`` as :attr:`Option.error`.
    """

    method: str
    tolerance: float
    error: float
    seconds: float


@dataclass(frozen=True)
class Labelling:
    """Time of labelling: ``fixed`` seconds, and ``per_point`` seconds of one thread for each initial condition."""

    fixed: float
    per_point: float


@dataclass(frozen=True)
class TableProbe:
    """Tables of one order, measured at some sizes.

    Parameters
    ----------
    order : int
        Degree of the splines.
    cells : tuple of int
        Cells along the longest axis, ascending.
    errors : tuple of float
        Error of one period at those sizes.
    raw : tuple of float
        The same without fallback cells.
    surplus : float
        Seconds of one thread for each node, besides those of the exact map.
    labelling : Labelling
        By the largest size, without evaluations of the exact map.
    fallback : tuple of (int, float)
        Cells, and the images of an orbit that are evaluated with the exact map at that size.
    lookups : tuple of (int, float)
        Bytes of a table, and the seconds of a look-up at a random place in it.
    """

    order: int
    cells: tuple[int, ...]
    errors: tuple[float, ...]
    raw: tuple[float, ...]
    surplus: float
    labelling: Labelling
    fallback: tuple[tuple[int, float], ...] = ()
    lookups: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True)
class Measurements:
    """All that a plan rests on.

    Parameters
    ----------
    initial_conditions : int
        Number of initial conditions.
    periods : float
        Periods that one of them takes, on average.
    window : CellGrid
        Window of the tables; its shape tells how many cells along each axis go with how many along the longest.
    threads : int
        Threads in use.
    exact : tuple of ExactProbe
        Ways to integrate.
    base : ExactProbe
        The one by which `direct` was measured.
    direct : Labelling
        With the exact map alone.
    tables : tuple of TableProbe
        One for each order.
    free : int or None
        Bytes of memory that are free.
    outside : float
        Fraction of the points of orbits that lie outside of the window.
    """

    initial_conditions: int
    periods: float
    window: CellGrid
    threads: int
    exact: tuple[ExactProbe, ...]
    base: ExactProbe
    direct: Labelling
    tables: tuple[TableProbe, ...] = ()
    free: int | None = None
    outside: float = 0.0
