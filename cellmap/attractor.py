"""Attractors: what orbits end on."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .coordinates import Coordinate


class Kind(StrEnum):
    """Kinds of attractors of a point map."""

    FIXED_POINT = "fixed point"
    PERIODIC = "periodic"
    ROTATING = "rotating"
    """Periodic up to whole turns of an angle, which grows or falls for ever."""
    CHAOTIC = "chaotic"


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """Ellipsoids around the points of a periodic attractor in which every orbit converges to it.

    Parameters
    ----------
    centres : ndarray, shape (period, dimension)
        Points of the attractor.
    metrics : ndarray, shape (period, dimension, dimension)
        The ellipsoid of point c is ``(x - c) @ metric @ (x - c) <= 1``.
    contraction : float
        Largest measured factor by which one round of the attractor shortens the distance in that metric; below 1.
    """

    centres: NDArray[np.float64]
    metrics: NDArray[np.float64]
    contraction: float


@dataclass(frozen=True, eq=False)
class Cover:
    """Boxes that a chaotic attractor visits.

    Parameters
    ----------
    lower, widths : ndarray, shape (dimension,)
        Corner of the first box and sides of a box.
    boxes : ndarray of int, shape (number, dimension)
        Whole-number places of the boxes, sorted.
    """

    lower: NDArray[np.float64]
    widths: NDArray[np.float64]
    boxes: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Attractor:
    """An attractor of a point map.

    Parameters
    ----------
    kind : Kind
        Fixed point, periodic, rotating or chaotic.
    period : int
        Steps of the map after which it repeats itself; 0 for a chaotic attractor.
    points : ndarray, shape (period, dimension)
        Its points in the order of the orbit, angles in their turn; for a chaotic attractor a sample of an orbit.
    turns : tuple of int
        Whole turns of each coordinate in one round of `period` steps.
    multipliers : ndarray of complex, shape (dimension,)
        Eigenvalues of the derivative of one round, the largest first; for a chaotic attractor empty.
    exponents : ndarray, shape (dimension,) or (1,)
        Lyapunov exponents per step of the map.
    neighbourhood : Neighbourhood or None
        Region around a periodic attractor that is verified to belong to its basin.
    cover : Cover or None
        Boxes that hold a chaotic attractor.
    coordinates : tuple of Coordinate
        Names and units.
    """

    kind: Kind
    period: int
    points: NDArray[np.float64]
    turns: tuple[int, ...]
    multipliers: NDArray[np.complex128]
    exponents: NDArray[np.float64]
    coordinates: tuple[Coordinate, ...]
    neighbourhood: Neighbourhood | None = None
    cover: Cover | None = None

    @property
    def rotation_number(self) -> tuple[float, ...]:
        """Mean turns of each coordinate in one step of the map; for a chaotic attractor NaN on angles."""
        if not self.period:
            return tuple(np.nan if c.is_angle else 0.0 for c in self.coordinates)
        return tuple(t / self.period for t in self.turns)

    @property
    def name(self) -> str:
        """Short description, such as ``"rotating, period 1, +1 turn"``."""
        if self.kind is Kind.CHAOTIC:
            return "chaotic"
        if self.kind is Kind.FIXED_POINT:
            place = ", ".join(f"{v + 0.0:.3g}" for v in np.where(np.abs(self.points[0]) < 1e-9, 0.0, self.points[0]))
            return f"fixed point ({place})"
        text = f"{self.kind}, period {self.period}"
        for t in self.turns:
            if t:
                text += f", {t:+d} turn{'s' if abs(t) > 1 else ''}"
        return text

    def __repr__(self) -> str:
        if self.kind is Kind.CHAOTIC:
            return f"Attractor(chaotic, largest exponent {self.exponents[0]:.4g})"
        place = ", ".join(f"{v:.6g}" for v in self.points[0])
        return f"Attractor({self.name} at ({place}), |multiplier| {np.abs(self.multipliers[0]):.4g})"


def sort_key(attractor: Attractor) -> tuple[Any, ...]:
    """Key of the order of attractors: simple ones first, mirror images side by side."""
    point = attractor.points[0]
    rounded = np.round(point, 6) + 0.0
    return (
        list(Kind).index(attractor.kind),
        attractor.period,
        sum(map(abs, attractor.turns)),
        round(float(np.linalg.norm(point)), 6),
        tuple(-t for t in attractor.turns),
        tuple(-rounded),
    )
