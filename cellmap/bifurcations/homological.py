"""Normal forms of any order on the centre manifold of a fixed point, from the homological equation."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import factorial, prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..maps.multilinear import directions_for

Exponents = tuple[int, ...]
Term = tuple[int, Exponents]
"""Component of the normal form, and exponents of a monomial in its variables."""

_SINGULAR = 1e-9  # ratio of singular values of a homological equation without a unique solution


@dataclass(frozen=True, eq=False)
class Centre:
    """Critical eigenspace of a matrix A: columns Q (d, m) with A Q = Q J, and rows P (m, d) with P Q = 1.

    A complex pair of variables is w and its conjugate, which formally are independent.  `resonant` returns the terms of
    the normal form that have a degree.
    """

    right: NDArray[np.complex128]
    left: NDArray[np.complex128]
    linear: NDArray[np.complex128]
    resonant: Callable[[int], Sequence[Term]]

    @property
    def dimension(self) -> int:
        """Number of variables."""
        return len(self.linear)

    @property
    def is_diagonal(self) -> bool:
        """Whether there is no Jordan block."""
        return not np.triu(self.linear, 1).any()

    def off(self, matrix: NDArray[np.float64]) -> float:
        """Return by how much the eigenspace of a matrix differs from this one."""
        return float(np.abs(matrix @ self.right - self.right @ self.linear).max())


def normal_form_terms(tensors: tuple[NDArray[np.float64], ...], centre: Centre, order: int) -> dict[Term, complex]:
    """Return the coefficients of the normal form up to an order, of a map with derivatives A, B, C, ....

    The centre manifold H(w) and the normal form G(w) satisfy F(H(w)) = H(G(w)), which is solved degree by degree; of
    the normal form only resonant terms are not zero.  Without a Jordan block the resonant part of H is zero beyond its
    linear one.  NaN where the equation of a degree is singular.

    References
    ----------
    Kuznetsov, Meijer, SIAM Journal on Scientific Computing 26 (2005) 1932; *Numerical Bifurcation Analysis of Maps*
    (2019), section 4.1.
    """
    m = centre.dimension
    places = directions_for(m, order)
    manifold = {1: centre.right.T.astype(complex)}
    form = {1: centre.linear.T.astype(complex)}
    found = dict[Term, complex]()
    for degree in range(2, order + 1):
        powers = exponents(m, degree)
        values = _monomials(places, powers)
        curves = {k: _monomials(places, exponents(m, k)) @ part for k, part in manifold.items()}
        images = {k: _monomials(places, exponents(m, k)) @ part for k, part in form.items()}
        known = _composed(tensors, curves, degree) - _followed(manifold, images, degree)
        rest = np.linalg.lstsq(values, known)[0]
        shifted = np.linalg.lstsq(values, _monomials(places @ centre.linear.T, powers))[0]
        terms = list(centre.resonant(degree))
        part, numbers = _solved(tensors[0], centre, powers, rest, shifted, terms)
        manifold[degree], form[degree] = part, np.zeros((len(powers), m), complex)
        for (component, exponent), number in zip(terms, numbers, strict=True):
            form[degree][powers.index(exponent), component] = number
            found[component, exponent] = complex(number)
    return found


@functools.cache
def exponents(variables: int, degree: int) -> list[Exponents]:
    """Return the exponents of all monomials of a degree."""
    indices = combinations_with_replacement(range(variables), degree)
    return [tuple(index.count(i) for i in range(variables)) for index in indices]


def _monomials(places: NDArray[Any], powers: list[Exponents]) -> NDArray[Any]:
    """Return monomials (n, c) at places (n, m)."""
    return np.asarray(np.prod(places[:, None, :] ** np.array(powers), axis=-1))


def _partitions(total: int, largest: int) -> Iterator[tuple[int, ...]]:
    """Yield the ways to write a number as a sum of positive ones, each not above the one before."""
    if total == 0:
        yield ()
    for first in range(min(total, largest), 0, -1):
        for others in _partitions(total - first, first):
            yield (first, *others)


def _composed(tensors: tuple[NDArray[np.float64], ...], curves: dict[int, NDArray[Any]], degree: int) -> NDArray[Any]:
    """Return the part of F(H) of a degree, but for A times that of H, from the parts (n, d) of H on lines."""
    total = np.zeros_like(curves[1])
    for parts in _partitions(degree, degree - 1):
        value = np.asarray(tensors[len(parts) - 1])[None]
        for part in parts:
            value = np.einsum("n...j,nj->n...", value, curves[part])
        total += value / prod(factorial(parts.count(k)) for k in set(parts))
    return total


def _followed(manifold: dict[int, NDArray[Any]], images: dict[int, NDArray[Any]], degree: int) -> NDArray[Any]:
    """Return the part of H(G) of a degree that parts of H of lower degrees make, but for the linear one."""
    n, m = images[1].shape
    series = np.zeros((m, n, degree + 1), complex)
    for k, part in images.items():
        series[:, :, k] = part.T
    total = np.zeros((n, manifold[1].shape[1]), complex)
    for k in range(2, degree):
        for exponent, vector in zip(exponents(m, k), manifold[k], strict=True):
            product = np.zeros((n, degree + 1), complex)
            product[:, 0] = 1.0
            for variable, power in zip(series, exponent, strict=True):
                for _ in range(power):
                    product = _product(product, variable)
            total += product[:, -1:] * vector
    return total


def _product(first: NDArray[Any], second: NDArray[Any]) -> NDArray[Any]:
    """Return the product of power series (n, k), truncated."""
    total = np.zeros_like(first)
    for k in range(first.shape[1]):
        total[:, k:] += second[:, k : k + 1] * first[:, : first.shape[1] - k]
    return total


def _solved(
    matrix: NDArray[np.float64],
    centre: Centre,
    powers: list[Exponents],
    rest: NDArray[Any],
    shifted: NDArray[Any],
    terms: list[Term],
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Solve A h(w) + rest(w) = h(J w) + Q g(w) for h (c, d) and the coefficients g of some terms."""
    d, c, r = len(matrix), len(powers), len(terms)
    equations = np.zeros((c * d + r * centre.is_diagonal, c * d + r), complex)
    equations[: c * d, : c * d] = np.kron(np.eye(c), matrix) - np.kron(shifted, np.eye(d))
    for k, (component, exponent) in enumerate(terms, c * d):
        block = slice(d * powers.index(exponent), d * powers.index(exponent) + d)
        equations[block, k] = -centre.right[:, component]
        if centre.is_diagonal:
            equations[k, block] = centre.left[component]
    sides = np.zeros(len(equations), complex)
    sides[: c * d] = -rest.ravel()
    solution, _, _, sizes = np.linalg.lstsq(equations, sides, rcond=0.0)
    if sizes[-1] < _SINGULAR * sizes[0]:
        solution = np.full_like(solution, np.nan)
    return solution[: c * d].reshape(c, d), solution[c * d :]
