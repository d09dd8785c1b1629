"""Generalized cell mapping: chains by hand, in closed form, against brute force."""

from itertools import product
from math import gcd

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import block_array, csr_array, diags_array, eye_array, kron, linalg
from scipy.sparse.csgraph import connected_components

from cellmap.sets import markov
from cellmap.sets.box_images import tallied
from cellmap.sets.markov import components_of, invariant_measure, periods_of, solve_transient


def random_chain(n, seed, degree=3):
    """A chain of few ways, so that it has several classes."""
    rng = np.random.default_rng(seed)
    dense = np.zeros((n, n))
    for i in range(n):
        dense[i, rng.integers(0, n, rng.integers(1, degree))] = rng.uniform(0.2, 1.0)
    dense /= dense.sum(axis=1, keepdims=True)
    matrix = csr_array(dense)
    return dense, matrix, components_of(matrix)


def reaches(dense):
    """Which states lead to which, by squaring."""
    n = len(dense)
    known = np.eye(n, dtype=bool) | (dense > 0)
    for _ in range(n.bit_length()):
        known = known @ known
    return known


class TestChains:
    @settings(max_examples=60)
    @given(st.integers(1, 40), st.integers(0, 2**32 - 1))
    def test_classes_of_random_chains_against_brute_force(self, n, seed):
        dense, matrix, components = random_chain(n, seed)
        known = reaches(dense)
        same = known & known.T
        np.testing.assert_array_equal(components.of[:, None] == components.of[None, :], same)
        count, _ = connected_components(matrix, connection="strong")
        assert count == len(components.closed)
        for c in range(count):
            states = components.states(c)
            assert components.closed[c] == (not known[states[0]][~same[states[0]]].any())
            assert components.recurs[c] == (dense[np.ix_(states, states)] > 0).any()
        rows, columns = np.nonzero(dense)
        assert (components.of[rows] >= components.of[columns]).all()  # those that it leads to are before it

    @settings(max_examples=60)
    @given(st.integers(1, 30), st.integers(0, 2**32 - 1))
    def test_absorption_and_times_of_random_chains_against_dense_solution(self, n, seed):
        dense, matrix, components = random_chain(n, seed)
        closed = np.flatnonzero(components.closed)
        values = np.zeros((n, len(closed) + 1))
        for k, c in enumerate(closed):
            values[components.states(c), k] = 1.0
        gain = np.zeros(len(closed) + 1)
        gain[-1] = 1.0
        transient = ~components.closed[components.of]
        inner = np.eye(transient.sum()) - dense[np.ix_(transient, transient)]
        right = dense[np.ix_(transient, ~transient)] @ values[~transient] + gain
        solve_transient(matrix, components, values, gain)
        np.testing.assert_allclose(values[transient], np.linalg.solve(inner, right), atol=1e-9, rtol=1e-9)
        assert values[:, :-1].sum(axis=1) == pytest.approx(1.0)

    @settings(max_examples=60)
    @given(st.integers(1, 25), st.integers(0, 2**32 - 1))
    def test_periods_of_random_chains_against_lengths_of_closed_ways(self, n, seed):
        dense, matrix, components = random_chain(n, seed, degree=2)
        numbers = np.flatnonzero(components.recurs)
        for c, period in zip(numbers, periods_of(matrix, components, numbers), strict=True):
            state = components.states(c)[0]
            ways, expected = np.eye(n, dtype=bool), 0
            for length in range(1, 3 * n + 1):
                ways = ways @ (dense > 0)
                if ways[state, state]:
                    expected = gcd(expected, length)
            assert period == expected

    @pytest.mark.parametrize(("n", "p"), [*product((1, 500), (0.5, 0.4, 0.51)), (100_000, 0.5)])
    def test_gambler_is_ruined_as_in_closed_form(self, n, p):
        """Feller, An Introduction to Probability Theory and Its Applications 1 (1968), XIV.2 and 3.

        Of 100,000 coins sweeps would need 10^10 rounds.
        """
        chain = gambler(n, p)
        z, q = np.arange(n + 2.0), 1.0 - p
        if p == 0.5:
            ruin, duration = 1.0 - z / (n + 1), z * (n + 1 - z)
        else:
            r = q / p
            won = (1.0 - r**z) / (1.0 - r ** (n + 1))
            ruin, duration = 1.0 - won, z / (q - p) - (n + 1) / (q - p) * won
        values = absorbed(chain)
        np.testing.assert_allclose(values[:, 0], ruin, atol=1e-10)
        np.testing.assert_allclose(values[:, 1], duration, rtol=1e-9, atol=1e-9)

    @pytest.mark.parametrize("leak", [1e-12, 1e-40, 1e-200])
    def test_a_class_that_is_all_but_closed(self, leak):
        """Left with a chance far below rounding; where to, is known nevertheless."""
        rng = np.random.default_rng(1)
        inner = rng.uniform(size=(50, 50)) * (rng.uniform(size=(50, 50)) < 0.2) + np.eye(50, k=1) + np.eye(50, k=-49)
        inner /= inner.sum(axis=1, keepdims=True)
        first, last = np.zeros(50), np.zeros(50)
        first[7], last[30] = leak, 3.0 * leak
        values = absorbed(with_sinks(csr_array(inner), first, last))
        measure = invariant_measure(csr_array(inner), np.arange(50))
        expected = measure[7] / (measure[7] + 3.0 * measure[30])
        np.testing.assert_allclose(values[1:-1, 0], expected, rtol=1e-10)
        np.testing.assert_allclose(values[1:-1, 1] * leak, 1.0 / (measure[7] + 3.0 * measure[30]), rtol=1e-9)

    def test_many_states_that_lead_everywhere_and_leave_late(self, monkeypatch):
        """A hundred states, each to 20 at random, and out with 1e-7: the time is 1e7 from each of them."""
        monkeypatch.setattr(markov, "_DIRECT", 0.0)
        n, leak = 100, 1e-7
        columns = np.random.default_rng(0).integers(0, n, 20 * n)
        inner = csr_array((np.full(20 * n, (1.0 - leak) / 20), (np.repeat(np.arange(n), 20), columns)), shape=(n, n))
        values = absorbed(with_sinks(inner, np.full(n, 0.3 * leak), np.full(n, 0.7 * leak)))
        assert values[1:-1, 0] == pytest.approx(0.3, abs=1e-6)
        assert values[1:-1, 1] == pytest.approx(1e7, rel=1e-6)

    def test_a_walk_in_the_plane_by_either_solver(self, monkeypatch):
        """From the middle of a square all four sides are as likely."""
        n = 41
        walk = diags_array([np.full(n - 1, 0.25), np.full(n - 1, 0.25)], offsets=[-1, 1])
        inner = csr_array(kron(walk, eye_array(n)) + kron(eye_array(n), walk))
        edge = np.zeros((n, n))
        edge[0] = 0.25
        left = edge.ravel()
        rest = 1.0 - inner.sum(axis=1) - left
        for direct in (1e10, 0.0):
            monkeypatch.setattr(markov, "_DIRECT", direct)
            values = absorbed(with_sinks(inner, left, rest))
            assert values[1:-1, 0].reshape(n, n)[n // 2, n // 2] == pytest.approx(0.25, abs=1e-9)

    @settings(max_examples=40)
    @given(st.integers(2, 30), st.integers(0, 2**32 - 1))
    def test_invariant_measure_against_eigenvectors(self, n, seed):
        dense, matrix, components = random_chain(n, seed, degree=4)
        for c in np.flatnonzero(components.closed):
            states = components.states(c)
            measure = invariant_measure(matrix, states)
            assert measure.sum() == pytest.approx(1.0)
            np.testing.assert_allclose(measure @ dense[np.ix_(states, states)], measure, atol=1e-10)

    def test_an_invariant_measure_that_no_solver_finds_is_told(self, monkeypatch):
        """A walk between two walls that tends to the left is geometric: by elimination, by an eigensolver, by neither.

        A step to the right is r times as likely as one to the left.
        """
        n, r, eigs = 400, 0.99, linalg.eigs
        up, down, stay = r / (1.0 + r), 1.0 / (1.0 + r), np.zeros(n)
        stay[0], stay[-1] = down, up
        matrix = csr_array(diags_array([np.full(n - 1, down), stay, np.full(n - 1, up)], offsets=[-1, 0, 1]))
        expected = r ** np.arange(n)
        for direct in (markov._DIRECT, 0.0):
            monkeypatch.setattr(markov, "_DIRECT", direct)
            np.testing.assert_allclose(invariant_measure(matrix, np.arange(n)), expected / expected.sum(), atol=1e-9)
        monkeypatch.setattr(markov, "_POWERS", 20)
        monkeypatch.setattr(linalg, "eigs", lambda *given, **options: eigs(*given, **options, maxiter=2))
        with pytest.warns(RuntimeWarning, match="class of 400 states has a residual of .*mixes too slowly"):
            measure = invariant_measure(matrix, np.arange(n))
        assert np.abs(measure @ matrix - measure).sum() > 1e-5


def with_sinks(inner, first, last):
    """A chain with a sink before its states and one behind."""
    one = csr_array(np.ones((1, 1)))
    return csr_array(
        block_array([[one, None, None], [first[:, None], inner, last[:, None]], [None, None, one]], format="csr")
    )


def gambler(n, p):
    """Fortunes 0 to n + 1; a game is won with p."""
    inner = diags_array([np.full(n - 1, 1 - p), np.full(n - 1, p)], offsets=[-1, 1], shape=(n, n))
    first, last = np.zeros(n), np.zeros(n)
    first[0], last[-1] = 1 - p, p
    return with_sinks(csr_array(inner), first, last)


def absorbed(matrix):
    """Probability to end in state 0, and time until the end."""
    values = np.zeros((matrix.shape[0], 2))
    values[0, 0] = 1.0
    solve_transient(matrix, components_of(matrix), values, np.array([0.0, 1.0]))
    return values


def test_rows_are_tallied_with_sinks_last():
    cells = np.sort([[4, 0, 4, -1], [-2, -2, -1, 3]], axis=1)
    hits = tallied(np.where(cells < 0, 8 + cells, cells).ravel(), np.arange(2), 4)
    assert hits.rows.tolist() == [0, 0, 0, 1, 1, 1]
    assert hits.targets.tolist() == [0, 4, 7, 3, 6, 7]
    assert hits.counts.tolist() == [1, 2, 1, 1, 2, 1]
