"""Multipliers and exponents of products of matrices, against their closed forms and other decompositions."""

import numpy as np
import pytest

from cellmap.orbits import lyapunov_qr, multipliers

PAIR = np.array([0.9 * np.exp(1j), 0.9 * np.exp(-1j), 0.5, 2.1])


def test_products_keep_the_digits_of_small_multipliers():
    """Triangular factors of 1e5, 2 and 1e-5, in turned frames: 1e50 and 1e-50 are multipliers of ten of them."""
    frames = np.linalg.qr(np.random.default_rng(0).normal(size=(10, 3, 3)))[0]
    triangle = np.array([[1e5, 1.0, 1.0], [0.0, 2.0, 1.0], [0.0, 0.0, 1e-5]])
    factors = np.array([frames[(k + 1) % 10] @ triangle @ frames[k].T for k in range(10)])
    found = multipliers.multipliers_along(factors)
    assert found.real == pytest.approx([1e50, 2.0**10, 1e-50], rel=1e-4)
    turned = np.array([[[0.0, -2.0], [2.0, 0.0]], [[0.5, 0.0], [0.0, 0.5]]])
    assert multipliers.multipliers_along(turned) == pytest.approx([1j, -1j])
    assert multipliers.multipliers_along(turned[:1]) == pytest.approx([2j, -2j])
    assert np.isnan(multipliers.multipliers_of_product(turned * np.nan)).all()


def test_functions_of_multipliers():
    assert multipliers.pairs_beside_one(np.array([0.9 + 0.1j, 0.9 - 0.1j])) == pytest.approx(0.82 - 1.0)
    products = [0.81, *(0.5 * PAIR[:2]), *(2.1 * PAIR[:2]), 1.05]
    assert multipliers.pairs_beside_one(PAIR) == pytest.approx(np.prod(np.array(products) - 1.0).real)
    assert sorted(np.abs(multipliers.products_of_pairs(PAIR))) == pytest.approx(sorted(np.abs(products)))
    assert multipliers.pair_on_circle(PAIR) == (2, 3)
    assert multipliers.factors_beside(np.array([3.0, -1.0]), 1.0) == pytest.approx([0.5, -1.0])
    assert multipliers.unstable_count(np.array([[2.0, 0.5], [1.0, 1j], [np.nan, 0.0]])).tolist() == [1, 0, -1]


def test_exponents_of_products_of_triangles():
    """Logarithms of the diagonals: in turned frames the mean of them, and of a cycle the same with all its digits."""
    rng = np.random.default_rng(1)
    diagonals = np.array([3.0, 0.8, 0.01]) * rng.uniform(0.9, 1.1, (200, 3))
    steps = np.triu(rng.normal(size=(200, 3, 3)), 1) + np.einsum("kj,ji->kji", diagonals, np.eye(3))
    matrices = np.stack([steps, steps * np.nan])
    found, errors = lyapunov_qr.exponents_along(matrices)
    means = np.log(diagonals[20:]).mean(axis=0)
    assert found[0] == pytest.approx(means, abs=1e-12)
    blocks = np.log(diagonals[20:]).reshape(9, 20, 3).mean(axis=1)
    assert errors[0] == pytest.approx(blocks.std(axis=0, ddof=1) / 3.0, rel=1e-9)
    cycles = lyapunov_qr.exponents_of_cycles(matrices[:, :5])
    assert cycles[0] == pytest.approx(np.log(diagonals[:5]).mean(axis=0), abs=1e-12)
    assert np.isnan([found[1], cycles[1]]).all()
    assert lyapunov_qr.exponents_of_cycles(np.diag([2.0, 0.0])[None, None])[0].tolist() == [np.log(2.0), -np.inf]
