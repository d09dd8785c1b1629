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
    """Time that the starts of a picture take: ``fixed`` seconds, and ``per_start`` seconds of one thread."""

    fixed: float
    per_start: float


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
        The same, were no cell left to the exact map.
    surplus : float
        Seconds of one thread for each tabulated image, besides those of the exact map.
    labelling : Labelling
        By the largest size, without what the exact map takes in its place.
    fallback : tuple of (int, float)
        Cells, and the images of a start that are left to the exact map with so many.
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
        Starts of the picture.
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
        Of starts without a table.
    tables : tuple of TableProbe
        One for each order.
    free : int or None
        Bytes of memory that are free.
    outside : float
        Share of the points of orbits that lie outside of the window.
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
