"""Error ellipsoids of certificates, and the cells that they reach."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, shortest_path

from cellmap._compiled.kernels.certainty import carry_rows, reach_ends


def test_error_ellipsoids_hold_all_errors():
    rng = np.random.default_rng(3)
    for d in (1, 2, 3):
        for _ in range(50):
            root, slope, radius = rng.normal(size=(d, d)), rng.normal(size=(d, d)), abs(rng.normal())
            spread = root @ root.T
            errors = _directions(rng, 200, d) @ np.linalg.cholesky(spread).T @ slope.T
            errors += radius * _directions(rng, 200, d)
            carry_rows(spread[None], slope[None], np.array([radius]))
            sizes = np.einsum("ni,ij,nj->n", errors, np.linalg.inv(spread), errors)
            assert sizes.max() <= 1.0 + 1e-9


def _directions(rng, number, d):
    vectors = rng.normal(size=(number, d))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def test_first_error_is_a_ball():
    spread = np.zeros((2, 2))
    carry_rows(spread[None], np.eye(2)[None], np.array([0.5]))
    np.testing.assert_allclose(spread, 0.25 * np.eye(2))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("wraps", [(False, False), (True, False), (True, True)])
def test_reach_of_cells_by_a_graph(seed, wraps):
    rng = np.random.default_rng(seed)
    cells = np.array([7, 9])
    n = int(cells.prod())
    circle = np.where(wraps, cells * 1.0, 0.0)
    first = rng.integers(-2, 9, (n, 2))
    last = first + rng.integers(0, 3, (n, 2))
    ends = np.zeros(n, np.int64)
    fixed = np.zeros(n, bool)
    for bit, cell in ((1, 5), (2, 40)):
        ends[cell], fixed[cell] = bit, True
    expected = _reach_by_graph(ends, fixed, first, last, cells, wraps, 4)
    reach_ends(ends, fixed, first, last, cells, circle, 4)
    several = np.array([bin(e).count("1") > 1 for e in expected])
    np.testing.assert_array_equal(several, ends & (ends - 1) != 0)
    np.testing.assert_array_equal(ends[~several], expected[~several])


def _reach_by_graph(ends, fixed, first, last, cells, wraps, beyond):
    n = len(ends)
    links = np.zeros((n + 1, n + 1), bool)  # the last node is the outside
    for c in np.flatnonzero(~fixed):
        for i in range(first[c, 0], last[c, 0] + 1):
            for j in range(first[c, 1], last[c, 1] + 1):
                place = [k % m if w else k for k, m, w in zip((i, j), cells, wraps, strict=True)]
                inside = all(0 <= k < m for k, m in zip(place, cells, strict=True))
                links[c, place[0] * cells[1] + place[1] if inside else n] = True
    reached = np.isfinite(shortest_path(csr_matrix(links), unweighted=True))
    own = np.append(ends, beyond)
    assert connected_components(csr_matrix(links))[0] >= 1
    return np.array([np.bitwise_or.reduce(own[reached[c]]) for c in range(n)])
