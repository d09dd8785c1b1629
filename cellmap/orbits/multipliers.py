"""Floquet multipliers: the eigenvalues of the monodromy matrix."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .._lib.arrays import Complexes, Floats, Ints

MARGIN = 1e-8
"""A multiplier nearer to the unit circle than this counts as on it."""


_APART = 1e2  # ratio of growth factors from which multipliers are computed one by one
_SWEEPS = 12


def unstable_count(multipliers: Complexes, margin: float = MARGIN) -> Ints:
    """Return how many multipliers (..., d) are outside the unit circle; -1 where they are not known."""
    modulus = np.abs(multipliers)
    return np.where(np.isnan(modulus).any(axis=-1), -1, np.count_nonzero(modulus > 1.0 + margin, axis=-1))


def multipliers_of(matrices: Floats, determinants: Floats | None = None) -> Complexes:
    """Return the eigenvalues (..., d) of matrices (..., d, d), the largest modulus first; NaN where not finite.

    Of a pair the one above the real axis comes first.  Determinants (...) that are known better than the matrices tell
    make the smaller of two eigenvalues more accurate.
    """
    d = matrices.shape[-1]
    finite = np.asarray(np.isfinite(matrices).all(axis=(-2, -1)))
    known = matrices if finite.all() else np.where(finite[..., None, None], matrices, np.eye(d))
    if d == 2 and determinants is not None:
        found = _of_two(known, determinants)
    else:
        found = np.linalg.eigvals(known).astype(np.complex128)
    order = np.lexsort((-found.imag, -found.real, -np.round(np.abs(found), 12)), axis=-1)
    found = found[order] if found.ndim == 1 else np.take_along_axis(found, order, axis=-1)
    found[~finite] = complex(np.nan, np.nan)
    return found


def multipliers_of_product(factors: Floats) -> Complexes:
    """Return the eigenvalues (d,) of the product of matrices (n, d, d), the last one on the left, largest first.

    Each has nearly all of its digits, whatever the others are: an orthogonal frame is carried around until it is
    invariant, and eigenvalues of very different size are products of numbers of their own (Bojanczyk, Golub, Van
    Dooren, Proceedings of SPIE 1770 (1992) 31).  NaN where the matrices are not finite.
    """
    n, d = factors.shape[:2]
    if not np.isfinite(factors).all():
        return np.full(d, complex(np.nan, np.nan))
    frame, triangles = np.eye(d), np.empty((n, d, d))
    for _ in range(_SWEEPS):
        first = frame
        for k, factor in enumerate(factors):
            frame, triangles[k] = np.linalg.qr(factor @ frame)
    with np.errstate(divide="ignore"):
        growth = np.log(np.abs(triangles[:, range(d), range(d)])).sum(axis=0)
    edges = [0, *(np.flatnonzero(growth[:-1] - growth[1:] > np.log(_APART)) + 1).tolist(), d]
    turned, found = first.T @ frame, list[complex]()
    for low, high in pairwise(edges):
        block, logarithm = turned[low:high, low:high], 0.0
        product = np.eye(high - low)
        for triangle in triangles:
            product = triangle[low:high, low:high] @ product
            size = float(np.abs(product).max())
            if size > 0.0:
                product, logarithm = product / size, logarithm + np.log(size)
        with np.errstate(over="ignore"):
            found += list(np.linalg.eigvals(block @ product).astype(complex) * np.exp(logarithm))
    values = np.array(found)
    return values[np.lexsort((-values.imag, -values.real, -np.abs(values)))]


def multipliers_along(factors: Floats) -> Complexes:
    """Return the eigenvalues (d,) of the product of one matrix or several (n, d, d), largest first."""
    return multipliers_of(factors[0]) if len(factors) == 1 else multipliers_of_product(factors)


def pairs_beside_one(multipliers: Complexes) -> Floats:
    """Return the products (...) of mu_i mu_j - 1 over all pairs of multipliers (..., d); 1 where there are no pairs.

    They change their sign where a complex pair passes the unit circle, and where two real ones have the product 1.
    """
    i, j = np.triu_indices(multipliers.shape[-1], 1)
    return np.asarray(np.prod(multipliers[..., i] * multipliers[..., j] - 1.0, axis=-1).real)


def factors_beside(values: Complexes, one: float) -> Complexes:
    """Return the scaled differences (n,) of numbers from one that they may pass, 1 or -1."""
    return np.asarray((values - one) / (1.0 + np.abs(values)))


def products_of_pairs(multipliers: Complexes) -> Complexes:
    """Return the products mu_i mu_j (d (d - 1) / 2,) of all pairs of multipliers (d,)."""
    i, j = np.triu_indices(len(multipliers), 1)
    return np.asarray(multipliers[i] * multipliers[j])


def pair_on_circle(multipliers: Complexes) -> tuple[int, int]:
    """Return the numbers of the two of some multipliers (d,), d > 1, whose product is nearest to 1."""
    i, j = np.triu_indices(len(multipliers), 1)
    nearest = int(np.argmin(np.abs(multipliers[i] * multipliers[j] - 1.0)))
    return int(i[nearest]), int(j[nearest])


def _of_two(matrices: Floats, determinant: Floats) -> Complexes:
    """Eigenvalues of 2 x 2 matrices: the smaller from the determinant, without a difference of nearly equal numbers."""
    (a, b), (c, e) = np.moveaxis(matrices, 0, -1)
    half = 0.5 * (a + e)
    square = (0.5 * (a - e)) ** 2 + b * c
    root = np.sqrt(np.abs(square))
    with np.errstate(all="ignore"):
        first = half + np.copysign(root, half)
        second = np.where(first == 0.0, 0.0, determinant / first)
        pair = half + 1j * root
        pair = pair * (np.sqrt(np.abs(determinant)) / np.abs(pair))
    real = (square >= 0.0) | (determinant <= 0.0)
    return np.stack([np.where(real, first, pair), np.where(real, second, pair.conj())], axis=-1)
