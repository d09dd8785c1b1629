"""Periodic orbits of point maps, stable and unstable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from math import inf

import numpy as np

from .._lib.arrays import Complexes, Floats
from .._lib.checks import real_array, shown
from ..maps.coordinates import Coordinate
from ..maps.grazing import GRAZING
from .multipliers import MARGIN, unstable_count


class OrbitKind(StrEnum):
    """Kinds of periodic orbits, by their Floquet multipliers."""

    NODE = "node"
    """All multipliers inside or all outside the unit circle, the one nearest to it real."""
    FOCUS = "focus"
    """All multipliers inside or all outside the unit circle, the pair nearest to it complex."""
    SADDLE = "saddle"
    """Multipliers inside and outside the unit circle; the unstable manifold is orientable."""
    FLIP_SADDLE = "flip saddle"
    """Flip saddle: an odd number of real multipliers below -1, so that the unstable manifold is not orientable."""
    CENTRE = "centre"
    """All multipliers on the unit circle, none of them real."""
    DEGENERATE = "degenerate"
    """Some multiplier on the unit circle: linearisation does not determine the stability."""


@dataclass(frozen=True, eq=False)
class PeriodicOrbit:
    """A periodic orbit of a point map.

    Parameters
    ----------
    period : int
        Least period in steps of the map, up to full rotations of angles.
    points : ndarray, shape (period, dimension)
        Its points in the order of the orbit, angles wrapped, beginning with the one nearest the origin.
    rotations : tuple of int
        Full rotations of each coordinate in one period of the orbit; 0 for coordinates that are not angles.
    matrix : ndarray, shape (dimension, dimension)
        Monodromy matrix at the first point.
    multipliers : ndarray of complex, shape (dimension,)
        Floquet multipliers, the eigenvalues of `matrix`, the largest modulus first.
    coordinates : tuple of Coordinate
        State variables.
    params : mapping of str to float
        Parameters of the map.
    grazing_distance : float
        How near the orbit comes to grazing a surface of impacts or of a discontinuity, see
        :func:`cellmap.maps.grazing_distance`.
    """

    period: int
    points: Floats
    rotations: tuple[int, ...]
    matrix: Floats
    multipliers: Complexes
    coordinates: tuple[Coordinate, ...]
    params: Mapping[str, float]
    grazing_distance: float = inf

    def __repr__(self) -> str:
        place = ", ".join(f"{v:.6g}" for v in self.points[0])
        size = f"{self._moduli[0]:.4g}" + ", grazes" * self.grazes
        return f"PeriodicOrbit({self.name}, period {self.period}, at ({place}), |multiplier| {size})"

    @property
    def grazes(self) -> bool:
        """Whether the orbit touches a surface to a part of 1e-6, so that `matrix` and `multipliers` mean nothing."""
        return self.grazing_distance <= GRAZING

    @property
    def _moduli(self) -> Floats:
        return np.abs(self.multipliers)

    @property
    def unstable(self) -> int:
        """Number of Floquet multipliers outside the unit circle."""
        return int(unstable_count(self.multipliers))

    @property
    def is_stable(self) -> bool:
        """Whether all Floquet multipliers are inside the unit circle."""
        return bool((self._moduli < 1.0 - MARGIN).all())

    @property
    def kind(self) -> OrbitKind:
        """Node, focus, saddle or flip saddle; centre or degenerate if linearisation does not determine stability."""
        inside, outside = self._moduli < 1.0 - MARGIN, self._moduli > 1.0 + MARGIN
        real = np.abs(self.multipliers.imag) <= MARGIN * self._moduli
        if inside.any() and outside.any():
            flips = np.count_nonzero(outside & real & (self.multipliers.real < 0.0))
            return OrbitKind.FLIP_SADDLE if flips % 2 else OrbitKind.SADDLE
        if inside.all() or outside.all():
            nearest = 0 if inside.all() else -1
            return OrbitKind.NODE if real[nearest] else OrbitKind.FOCUS
        return OrbitKind.DEGENERATE if inside.any() or outside.any() or real.any() else OrbitKind.CENTRE

    @property
    def name(self) -> str:
        """Kind, with "stable" or "unstable" if it can be either."""
        kind = self.kind
        if kind in {OrbitKind.NODE, OrbitKind.FOCUS}:
            return f"{'stable' if self.is_stable else 'unstable'} {kind}"
        return str(kind)

    @property
    def rotation_number(self) -> tuple[float, ...]:
        """Rotation number, full rotations of each coordinate per step of the map."""
        return tuple(t / self.period for t in self.rotations)

    @property
    def jury(self) -> Floats:
        """Jury's margins of `matrix`, shape (dimension + 1,): the orbit is stable if all are above zero."""
        return jury_margins(self.matrix)


def with_values(orbit: PeriodicOrbit, names: Sequence[str], values: Floats) -> PeriodicOrbit:
    """Return an orbit whose parameters have exactly some values (m,)."""
    return replace(orbit, params={**orbit.params, **dict(zip(names, values.tolist(), strict=True))})


def jury_margins(matrix: Floats) -> Floats:
    """Return the margins of Jury's criterion: all eigenvalues lie inside the unit circle if and only if all exceed 0.

    Parameters
    ----------
    matrix : ndarray, shape (d, d)
        Derivative of a map.

    Returns
    -------
    ndarray, shape (d + 1,)
        With the characteristic polynomial p: p(1), zero for an eigenvalue +1; (-1)^d p(-1), zero for an eigenvalue -1;
        then 1 - abs(k) for the coefficients k of Jury's scheme from the highest order down to 2, of which the first is
        the determinant.

    References
    ----------
    Jury, *Theory and Application of the z-Transform Method* (1964).

    Examples
    --------
    >>> jury_margins(np.array([[0.5, 0.2], [0.0, -0.4]]))
    array([0.7, 0.9, 0.8])
    """
    square = real_array("matrix", matrix)
    if square.ndim != 2 or square.shape[0] != square.shape[1] or not square.size or not np.isfinite(square).all():
        raise ValueError(f"matrix={shown(matrix)}: give finite numbers in an array of shape (d, d)")
    polynomial = np.real(np.poly(square))
    order = len(polynomial) - 1
    ends = [np.polyval(polynomial, 1.0), (-1.0) ** order * np.polyval(polynomial, -1.0)]
    table = []
    with np.errstate(all="ignore"):
        for _ in range(order, 1, -1):
            last = polynomial[-1] / polynomial[0]
            table.append(1.0 - abs(last))
            polynomial = (polynomial - last * polynomial[::-1])[:-1]
    return np.array([*ends, *table])
