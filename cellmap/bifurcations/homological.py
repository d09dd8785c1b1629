"""Normal forms of any order on the centre manifold of a cycle of points, from the homological equation."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import factorial, prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Complexes, Floats
from .._lib.computed import computed_once

Exponents = tuple[int, ...]
Term = tuple[int, Exponents]
"""Component of the normal form, and exponents of a monomial in its variables."""

_EQUAL = 1e-3  # relative difference of components of an eigenvector that count as equal: the first sets its phase
_SINGULAR = 1e-9  # ratio of singular values of a homological equation without a unique solution


@dataclass(frozen=True, eq=False)
class Centre:
    """Critical eigenspace of the derivatives A_1, ..., A_n (n, d, d) along a cycle of n points.

    Columns Q_k (n, d, m) with A_k Q_k = Q_(k+1), at the end A_n Q_n = Q_1 J, and rows P (m, d) with P Q_1 = 1.  A
    complex pair of variables is w and its conjugate, which formally are independent.  `resonant` returns the terms of
    the normal form that have a degree.
    """

    right: Complexes
    left: Complexes
    linear: Complexes
    resonant: Callable[[int], Sequence[Term]]

    @classmethod
    def of(cls, matrices: Floats, values: Sequence[complex], close: float) -> Centre | None:
        """Return the eigenspace of multipliers, complex ones with their conjugates; None where one is not simple.

        Terms are resonant whose multipliers differ by less than `close`, a multiplier is not simple if its unit
        eigenvectors have a smaller product.
        """
        right, left, found = list[NDArray[Any]](), list[NDArray[Any]](), list[complex]()
        for value in values:
            q, p = eigenvectors(matrices, value)
            if abs(p @ q[0]) < close:
                return None
            p = p / (p @ q[0])
            both = value.imag != 0.0
            right += [q, q.conj()][: 1 + both]
            left += [p, p.conj()][: 1 + both]
            found += [value, value.conjugate()][: 1 + both]

        def resonant(degree: int) -> list[Term]:
            powers = [(e, np.prod(np.array(found) ** e)) for e in exponents(len(found), degree)]
            return [(i, e) for i, v in enumerate(found) for e, power in powers if abs(power - v) < close]

        return cls(np.stack(right, axis=-1).astype(complex), np.array(left, complex), np.diag(found), resonant)

    @classmethod
    def real(cls, q: Floats, p: Floats, value: float) -> Centre:
        """Return the eigenspace of a multiplier 1 or -1 with its eigenvectors along a cycle (n, d) and (d,)."""

        def resonant(degree: int) -> list[Term]:
            return [(0, (degree,))] if value**degree == value else []

        return cls(q[..., None].astype(complex), p[None].astype(complex), np.full((1, 1), complex(value)), resonant)

    @classmethod
    def of_block(cls, matrices: Floats, value: float, terms: tuple[Term, ...]) -> Centre | None:
        """Return the eigenspace of a double multiplier with one eigenvector; None where there is none."""
        (n, d), (q, p) = matrices.shape[:2], eigenvectors(matrices, value)
        if d < 2:
            return None
        singular, edge = cycle_matrix(matrices, value), np.zeros(n * d)
        edge[-d:] = p.real
        bordered = np.block([[singular, edge[:, None]], [q.real.reshape(1, -1), np.zeros((1, 1))]])
        try:
            second = np.linalg.solve(bordered, np.concatenate([np.zeros((n - 1) * d), q.real[0], [0.0]]))[:-1]
            first = np.linalg.solve(bordered.T, np.concatenate([p.real, np.zeros((n - 1) * d), [0.0]]))[:-1]
        except np.linalg.LinAlgError:
            return None
        across = p.real @ second[:d]
        p, before = p.real / across, first[-d:] / across
        left = np.array([before - (before @ second[:d]) * p, p], complex)
        linear = np.array([[value, 1.0], [0.0, value]], complex)
        right = np.stack([q, second.reshape(n, d)], axis=-1).astype(complex)
        return cls(right, left, linear, lambda degree: [term for term in terms if sum(term[1]) == degree])

    @property
    def dimension(self) -> int:
        """Number of variables."""
        return len(self.linear)

    @computed_once
    def is_diagonal(self) -> bool:
        """Whether there is no Jordan block."""
        return not np.triu(self.linear, 1).any()

    def off(self, matrices: Floats) -> float:
        """Return by how much the eigenspace of matrices (n, d, d) differs from this one."""
        following = np.roll(self.right, -1, axis=0)
        following[-1] = self.right[0] @ self.linear
        return float(np.abs(matrices @ self.right - following).max())


def cycle_matrix(matrices: Floats, value: complex) -> NDArray[Any]:
    """Return the matrix (n d, n d) of A_k x_k - x_(k+1), and A_n x_n - value x_1, of the derivatives A_k (n, d, d)."""
    n, d = matrices.shape[:2]
    whole = np.zeros((n, d, n, d), complex if isinstance(value, complex) and value.imag else float)
    for k, matrix in enumerate(matrices):
        whole[k, :, k] = matrix
        whole[k, :, (k + 1) % n] -= (value if k == n - 1 else 1.0) * np.eye(d)
    return whole.reshape(n * d, n * d)


def eigenvectors(matrices: Floats, value: complex) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the right eigenvector along a cycle (n, d) and the left one (d,) at its first point.

    Both have length 1 there, and the first of the largest components of the former is positive.
    """
    n, d = matrices.shape[:2]
    left, _, right = np.linalg.svd(cycle_matrix(matrices, value if complex(value).imag else complex(value).real))
    q, p = right[-1].conj().reshape(n, d), left[-d:, -1].conj()
    sizes = np.abs(q[0])
    largest = q[0, np.argmax(sizes > (1.0 - _EQUAL) * sizes.max())]
    return q * abs(largest) / largest / np.linalg.norm(q[0]), p / np.linalg.norm(p)


def normal_form_terms(tensors: tuple[Floats, ...], centre: Centre, order: int) -> dict[Term, complex]:
    """Return the coefficients of the normal form up to an order, from derivatives A, B, ... (n, d, ...) along a cycle.

    The centre manifolds H_k(w) at the points of the cycle and the normal form G(w) satisfy F_k(H_k(w)) = H_(k+1)(w), at
    the end F_n(H_n(w)) = H_1(G(w)), which is solved degree by degree; of the normal form only resonant terms are not
    zero.  Without a Jordan block the resonant part of H_1 is zero beyond its linear one.  NaN where the equation of a
    degree is singular.

    References
    ----------
    Kuznetsov, Meijer, SIAM Journal on Scientific Computing 26 (2005) 1932; *Numerical Bifurcation Analysis of Maps*
    (2019), section 4.1.
    """
    m, cycle = centre.dimension, cycle_matrix(tensors[0], 0.0)
    manifold = {e: centre.right[..., k] for k, e in enumerate(exponents(m, 1))}
    form = [{e: complex(number) for e, number in zip(manifold, row, strict=True) if number} for row in centre.linear]
    found = dict[Term, complex]()
    for degree in range(2, order + 1):
        powers, resonant = exponents(m, degree), centre.resonant(degree)
        # Those of the last degree that are not resonant are not needed, unless they are solved together with others.
        together = [[e] for e in powers if degree < order or any(e == term[1] for term in resonant)]
        together = together if centre.is_diagonal else [powers]
        rest = {e: np.zeros(manifold[exponents(m, 1)[0]].shape, complex) for some in together for e in some}
        for factors, power, weight in _products(m, degree):
            if power in rest:
                value = np.asarray(tensors[len(factors) - 1])
                for factor in factors:
                    value = np.einsum("n...j,nj->n...", value, manifold[factor])
                rest[power] += weight * value
        for e, part in manifold.items() if found else ():
            for power, number in _substituted(form, e, degree).items() if sum(e) > 1 else ():
                if power in rest:
                    rest[power][-1] -= number * part[0]
        for some in together:
            images = [_substituted(form, e, degree) for e in some]
            shifted = np.array([[image.get(e, 0.0) for image in images] for e in some])
            mine = [(i, some.index(e)) for i, e in resonant if e in some]
            part, numbers = _solved(cycle, centre, np.stack([rest[e] for e in some], axis=1), shifted, mine)
            manifold |= {e: part[:, j] for j, e in enumerate(some)}
            found |= {(i, some[j]): complex(x) for (i, j), x in zip(mine, numbers, strict=True)}
        for i, e in resonant:
            form[i][e] = found[i, e]
    return found


@functools.cache
def exponents(variables: int, degree: int) -> list[Exponents]:
    """Return the exponents of all monomials of a degree."""
    indices = combinations_with_replacement(range(variables), degree)
    return [tuple(index.count(i) for i in range(variables)) for index in indices]


@functools.cache
def _products(variables: int, degree: int) -> list[tuple[tuple[Exponents, ...], Exponents, float]]:
    """Return all products of two or more monomials that have a degree: factors, exponents, and 1 over permutations."""
    lower = [e for k in range(1, degree) for e in exponents(variables, k)]
    several = (some for k in range(2, degree + 1) for some in combinations_with_replacement(lower, k))
    found = [some for some in several if sum(map(sum, some)) == degree]
    return [
        (some, tuple(map(sum, zip(*some, strict=True))), 1.0 / prod(factorial(some.count(e)) for e in set(some)))
        for some in found
    ]


def _substituted(form: list[dict[Exponents, complex]], exponent: Exponents, degree: int) -> dict[Exponents, complex]:
    """Return the part of a degree of a monomial of the normal form."""
    found = {(0,) * len(exponent): 1.0 + 0.0j}
    for factor in (form[i] for i, power in enumerate(exponent) for _ in range(power)):
        product = dict[Exponents, complex]()
        for (e, x), (f, y) in itertools.product(found.items(), factor.items()):
            both = tuple(map(sum, zip(e, f, strict=True)))
            if sum(both) <= degree:
                product[both] = product.get(both, 0.0) + x * y
        found = product
    return {e: x for e, x in found.items() if sum(e) == degree}


def _solved(
    cycle: NDArray[Any], centre: Centre, rest: NDArray[Any], shifted: NDArray[Any], terms: list[tuple[int, int]]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Solve A_k h_k(w) + rest_k(w) = h_(k+1)(w), at the end = h_1(J w) + Q_1 g(w), for some monomials (c,) together.

    Return h (n, c, d) and the coefficients g of terms, each given by its component and its monomial.
    """
    (n, c, d), size, unit = rest.shape, len(cycle), np.eye(rest.shape[-1])
    equations = np.zeros((c * size + len(terms) * centre.is_diagonal, c * size + len(terms)), complex)
    blocks = np.zeros((c, size, c, size), complex)
    blocks[range(c), :, range(c)] = cycle
    blocks[:, -d:, :, :d] -= shifted[:, None, :, None] * unit[:, None]
    equations[: c * size, : c * size] = blocks.reshape(c * size, c * size)
    for k, (component, power) in enumerate(terms, c * size):
        equations[(power + 1) * size - d : (power + 1) * size, k] = -centre.right[0, :, component]
        if centre.is_diagonal:
            equations[k, power * size : power * size + d] = centre.left[component]
    sides = np.zeros(len(equations), complex)
    sides[: c * size] = -rest.swapaxes(0, 1).ravel()
    sizes = np.linalg.svd(equations, compute_uv=False) if np.isfinite(equations).all() else np.zeros(1)
    if not sizes[-1] > _SINGULAR * sizes[0]:
        solution = np.full(equations.shape[1], complex(np.nan))
    elif centre.is_diagonal:
        solution = np.linalg.solve(equations, sides)
    else:
        solution = np.linalg.lstsq(equations, sides, rcond=0.0)[0]
    return solution[: c * size].reshape(c, n, d).swapaxes(0, 1), solution[c * size :]
