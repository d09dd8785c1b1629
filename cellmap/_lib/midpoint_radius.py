"""Arithmetic of arrays of intervals, given by midpoints and radii that bound every error of rounding.

A result is computed in the usual double precision, to nearest, and its radius covers whatever the exact operation can
give for all numbers of its arguments.  Three terms keep it so: half a unit in the last place of each midpoint that is
computed (``unit``), what is lost below the smallest normal number (``tiny``), and the rounding of the radii themselves,
which are sums of a few dozen terms that are not negative (``wider``).  NaN stands for "not known"; what has to hold is
asked as ``bound < limit``, which is false for NaN, and never by its opposite.

Rump, BIT Numerical Mathematics 39 (1999) 534.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Bools, Complexes, Floats


class Rounding(NamedTuple):
    """What keeps radii large enough: see above.  Kernels are handed it, so that tests can leave a term out."""

    unit: float = 2.0**-53
    wider: float = 1.0 + 2.0**-42
    tiny: float = 2.0**-1000


ROUNDING = Rounding()


@dataclass(frozen=True, eq=False)
class Intervals:
    """Arrays of real or complex intervals: all numbers not farther from the midpoints than the radii."""

    mid: Any
    rad: Floats

    @classmethod
    def exact(cls, numbers: ArrayLike) -> Intervals:
        """Return numbers that are known exactly."""
        mid = np.asarray(numbers)
        return cls(mid, np.zeros(mid.shape))

    def __add__(self, other: Intervals) -> Intervals:
        mid = self.mid + other.mid
        return Intervals(mid, _radii(self.rad + other.rad, np.abs(mid)))

    def __neg__(self) -> Intervals:
        return Intervals(-self.mid, self.rad)

    def __sub__(self, other: Intervals) -> Intervals:
        return self + -other

    def __matmul__(self, other: Intervals) -> Intervals:
        """Multiply matrices (..., n, k) and (..., k, m), in whatever order and with fused operations or without."""
        mid = self.mid @ other.mid
        sizes, others = np.abs(self.mid), np.abs(other.mid)
        # A complex product takes four real ones and two sums.
        terms = (4.0 if np.iscomplexobj(mid) else 1.0) * (sizes.shape[-1] + 2.0)
        spread = sizes @ other.rad + self.rad @ (others + other.rad)
        return Intervals(mid, _radii(spread, terms * (sizes @ others), terms))

    def __getitem__(self, key: Any) -> Intervals:
        return Intervals(self.mid[key], self.rad[key])

    @property
    def transposed(self) -> Intervals:
        """Matrices transposed."""
        return Intervals(np.swapaxes(self.mid, -1, -2), np.swapaxes(self.rad, -1, -2))

    @property
    def above(self) -> Floats:
        """Upper bounds of all sizes."""
        return np.asarray((np.abs(self.mid) + self.rad) * ROUNDING.wider)

    @property
    def below(self) -> Floats:
        """Lower bounds of all sizes."""
        return np.asarray((np.abs(self.mid) / ROUNDING.wider - self.rad * ROUNDING.wider) / ROUNDING.wider)


def _radii(spread: Floats, sizes: Floats, terms: float = 1.0) -> Floats:
    return np.asarray((spread + ROUNDING.unit * sizes + terms * ROUNDING.tiny) * ROUNDING.wider)


def length_above(vectors: Floats) -> Floats:
    """Return upper bounds of the lengths of vectors (..., d) whose entries have these upper bounds."""
    squares = (vectors**2).sum(axis=-1) * ROUNDING.wider + vectors.shape[-1] * ROUNDING.tiny
    return np.asarray(np.sqrt(squares) * ROUNDING.wider)


def stretch_above(matrices: Intervals) -> Floats:
    """Return upper bounds of how much matrices (..., d, d) lengthen any vector.

    The columns of A V are nearly orthogonal where V are the right singular vectors that were computed: the largest sum
    of a row of ``(A V)' A V`` is hardly more than the largest square of a singular value, and V itself is orthogonal up
    to rounding.
    """
    known = np.isfinite(matrices.mid).all(axis=(-1, -2)) & np.isfinite(matrices.rad).all(axis=(-1, -2))
    safe = np.where(known[..., None, None], matrices.mid, 0.0)
    axes = Intervals.exact(np.swapaxes(np.linalg.svd(safe)[2], -1, -2))
    turned = Intervals(safe, matrices.rad) @ axes
    squared = (turned.transposed @ turned).above.sum(axis=-1).max(axis=-1) * ROUNDING.wider
    astray = (Intervals.exact(np.eye(safe.shape[-1])) - axes.transposed @ axes).above.sum(axis=-1).max(axis=-1)
    left = 1.0 - astray * ROUNDING.wider
    bound = np.sqrt(squared / np.where(left > 0.5, left, np.nan) * ROUNDING.wider) * ROUNDING.wider
    return np.asarray(np.where(known, bound, np.nan))


def inverse(matrices: Floats | Complexes) -> Intervals:
    """Return the inverses of matrices (..., d, d) that are known exactly; NaN where that cannot be shown.

    With Y what was computed and E = 1 - Y A, the inverse is Y + E Y + E E Y + ...
    """
    found = np.linalg.inv(matrices)
    rest = (Intervals.exact(np.eye(matrices.shape[-1])) - Intervals.exact(found) @ Intervals.exact(matrices)).above
    factor = rest.sum(axis=-1).max(axis=-1) * ROUNDING.wider
    share = factor / np.where(factor < 0.5, 1.0 - factor, np.nan) * ROUNDING.wider
    largest = np.abs(found).max(axis=-2, keepdims=True)  # of each column
    return Intervals(found, np.broadcast_to(share[..., None, None] * largest * ROUNDING.wider, found.shape))


def contains(outer: Intervals, inner: Intervals) -> Bools:
    """Return where all numbers of the one are among those of the other, each entry by itself."""
    return np.asarray((inner - Intervals.exact(outer.mid)).above <= outer.rad)
