"""Zeros and extrema of many functions at once, against closed forms."""

import numpy as np
import pytest
from scipy.optimize import brentq

from cellmap._lib.roots import extrema, zeros

RNG = np.random.default_rng(8)


def solved(f, low, high, calls=None):
    low, high = np.broadcast_arrays(np.asarray(low, float), np.asarray(high, float))
    rows = np.arange(len(low))

    def counted(rows, x):
        if calls is not None:
            np.add.at(calls, rows, 1)
        return f(rows, x)

    return zeros(counted, low.copy(), high.copy(), f(rows, low), f(rows, high))


def test_zeros_of_cubics_to_rounding():
    """(x - r)(x^2 + 1) for many r, in brackets of all kinds, rising and falling; a dozen calls are enough."""
    r = RNG.uniform(-5, 5, 200)
    sign = np.where(np.arange(200) % 2 == 0, 1.0, -1.0)
    calls = np.zeros(200, int)
    low, high = r - RNG.uniform(0.01, 9, 200), r + RNG.uniform(0.01, 9, 200)
    found = solved(lambda k, x: sign[k] * (x - r[k]) * (x * x + 1), low, high, calls)
    np.testing.assert_allclose(found, r, rtol=5e-15, atol=1e-14)
    assert np.median(calls) <= 12 and calls.max() <= 40


@pytest.mark.parametrize(
    ("f", "low", "high", "root"),
    [
        (lambda x: np.exp(x) - 2, -3.0, 4.0, np.log(2.0)),
        (lambda x: np.cos(x) - x, 0.0, 1.0, brentq(lambda x: np.cos(x) - x, 0.0, 1.0, xtol=1e-15)),
        (lambda x: x**9, -1.0, 4.0, 0.0),
        (lambda x: np.tanh(50 * (x - 0.3)), 0.0, 100.0, 0.3),
        (lambda x: np.sign(x - 0.7) * 1e-3, 0.0, 1.0, 0.7),
    ],
)
def test_zeros_of_flat_and_steep_functions(f, low, high, root):
    (found,) = solved(lambda k, x: f(x), [low], [high])
    assert found == pytest.approx(root, abs=1e-14)
    assert low <= found <= high


def test_a_zero_at_an_end_and_values_that_are_not_finite():
    assert solved(lambda k, x: x, [0.0], [1.0])[0] == 0.0
    assert solved(lambda k, x: x - 1.0, [0.0], [1.0])[0] == 1.0
    found = solved(lambda k, x: np.where(np.abs(x - 0.5) < 0.1, np.nan, x - 0.3 - 0.3 * k), [0.0, 0.0], [1.0, 1.0])
    assert found.shape == (2,) and ((found >= 0.0) & (found <= 1.0)).all()


def test_extrema_between_three_points():
    """(x - m)^2 + h has its minimum h at m, and its mirror image a maximum; looked for towards zero, by sections."""
    m, h = RNG.uniform(-1, 1, 50), RNG.uniform(0.1, 2, 50)
    sign = np.where(np.arange(50) % 2 == 0, 1.0, -1.0)

    def f(rows, x):
        return sign[rows] * ((x - m[rows]) ** 2 + h[rows])

    rows = np.arange(50)
    sides = m - RNG.uniform(0.5, 2, 50), m + RNG.uniform(-0.3, 0.3, 50), m + RNG.uniform(0.5, 2, 50)
    place, value = extrema(f, sides, [f(rows, s) for s in sides])
    np.testing.assert_allclose(place, m, atol=2e-7)
    np.testing.assert_allclose(value, sign * h, rtol=1e-12)


def test_a_search_ends_beyond_zero():
    """(x - m)^2 - 1/4 is negative from the first place near m on, which is returned with its value."""
    seen = []

    def f(rows, x):
        seen.append(x.copy())
        return (x - 0.4) ** 2 - 0.25

    sides = np.array([-3.0]), np.array([1.5]), np.array([4.0])
    place, value = extrema(f, sides, [f(None, s) for s in sides])
    assert value[0] < 0.0 and value[0] == (place[0] - 0.4) ** 2 - 0.25
    assert place[0] == seen[-1][0] and (np.array([(s[0] - 0.4) ** 2 for s in seen[3:-1]]) > 0.25).all()
    below, there = extrema(f, [np.array([s]) for s in (0.0, 0.3, 1.0)], [np.array([v]) for v in (-0.1, -0.24, 0.1)])
    assert below[0] == 0.3 or there[0] > 0.0
