"""Systems of linear equations with a band matrix."""

from __future__ import annotations

from ..loops import loop


@loop(vectors=True)
def solve_banded(band, reach, right):
    """Solve a system for each column of `right`, by elimination with row exchanges; both arrays are overwritten.

    Row i of ``band`` (n, 3 reach + 1) holds the columns from i - reach to i + reach of the matrix, and behind them
    zeros, which rows that change places need.  ``right`` is (n, m) and receives the solutions.
    """
    n, m = right.shape
    for k in range(n):
        below, end = min(k + reach + 1, n), min(k + 2 * reach + 1, n)
        pivot = k
        for i in range(k + 1, below):
            if abs(band[i, k - i + reach]) > abs(band[pivot, k - pivot + reach]):
                pivot = i
        if pivot != k:
            for c in range(k, end):
                here, there = c - k + reach, c - pivot + reach
                band[k, here], band[pivot, there] = band[pivot, there], band[k, here]
            for c in range(m):
                right[k, c], right[pivot, c] = right[pivot, c], right[k, c]
        for i in range(k + 1, below):
            factor = band[i, k - i + reach] / band[k, reach]
            if factor != 0.0:
                for c in range(k + 1, end):
                    band[i, c - i + reach] -= factor * band[k, c - k + reach]
                for c in range(m):
                    right[i, c] -= factor * right[k, c]
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, min(k + 2 * reach + 1, n)):
            factor = band[k, i - k + reach]
            if factor != 0.0:
                for c in range(m):
                    right[k, c] -= factor * right[i, c]
        scale = 1.0 / band[k, reach]
        for c in range(m):
            right[k, c] *= scale
