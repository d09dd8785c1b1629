"""Lines, their windows and errors against elementary formulas; seeds and generators."""

import numpy as np
import pytest
from scipy.stats import linregress, t

from cellmap._lib.checks import shown
from cellmap._lib.fit import fit_line, scaling_window, scaling_windows, window_spread
from cellmap._lib.randomness import random_seed
from cellmap.utils import random_numbers

X = np.arange(12.0)
NOISE = np.random.default_rng(0).normal(size=12)


def test_a_line_is_that_of_least_squares():
    """Slope, intercept and standard error are SciPy's; the interval is Student's with two degrees of freedom less."""
    y = 2.0 * X - 1.0 + NOISE
    fit, expected = fit_line(X, y, (1, 10)), linregress(X[1:11], y[1:11])
    assert (fit.slope, fit.intercept) == pytest.approx((expected.slope, expected.intercept))
    assert fit.standard_error == pytest.approx(expected.stderr)
    low, high = fit.interval(0.9)
    assert high - low == pytest.approx(2 * t.ppf(0.95, 8) * expected.stderr)
    assert 0.5 * (low + high) == pytest.approx(fit.slope)
    assert fit([0.0, 2.0]) == pytest.approx([expected.intercept, expected.intercept + 2 * expected.slope])


def test_the_window_is_where_the_points_are_straight():
    """Slope 1 for seven points, saturated at both ends, among points that are not finite."""
    y = np.array([3.0, 3.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 8.0, 8.0, np.nan, np.inf])
    assert scaling_window(X, y) == (2, 7)
    assert fit_line(X, y).slope == pytest.approx(1.0)
    assert scaling_windows(X, y)[0][:2] == (2, 7)
    for windows in (scaling_window, scaling_windows):
        with pytest.raises(ValueError, match="2 points are finite"):
            windows(X, np.where(X < 2, X, np.nan))


def test_windows_that_end_at_the_last_finite_point():
    """Of a steep line and a longer flat one behind it the flat one is the last."""
    y = np.where(X < 8, 3.0 * X, 24.0 + (X - 8))
    y[-1] = np.nan
    assert scaling_windows(X, y)[0][:2] == (0, 8)
    assert scaling_windows(X, y, to_the_end=True)[0][1] == 10


def test_a_slope_that_no_window_changes_has_no_spread():
    """A wide range of x, on an exact line; on a bent one the spread is the larger."""
    x = np.linspace(0.0, 10.0, 12)
    assert window_spread(scaling_windows(x, 0.5 * x), 0.5) == pytest.approx(0.0, abs=1e-12)
    assert window_spread(scaling_windows(x, 0.5 * x), 0.7) == pytest.approx(0.2)
    assert window_spread(scaling_windows(x, 0.5 * x + 0.02 * x**2), 0.7) > 0.02


def test_seeds_and_generators():
    """The same number draws the same; a generator goes on; None draws other numbers each time."""
    assert random_seed(5) == 5
    assert np.array_equal(random_numbers(5).random(3), np.random.default_rng(5).random(3))
    generator = np.random.default_rng(1)
    assert random_numbers(generator) is generator
    first, second = random_seed(generator), random_seed(generator)
    assert [first, second] == np.random.default_rng(1).integers(2**62, size=2).tolist()
    assert random_seed(None) != random_seed(None)
    assert random_numbers(None).random() != random_numbers(None).random()
    for bad in (1.5, "1", [1]):
        with pytest.raises(TypeError, match="give a whole number as seed"):
            random_numbers(bad)


def test_values_in_messages_are_short():
    """Long strings and containers are cut, and what has no representation has a name."""

    class Mute:
        def __repr__(self):
            raise RuntimeError

    assert shown("a" * 60) == repr("a" * 60)
    assert len(shown("a" * 500)) <= 80
    assert shown(list(range(8))) == str(list(range(8)))
    assert shown(list(range(20))) == "[0, 1, 2, 3, 4, 5, 6, 7, ...]"
    assert shown("two\nlines\n") == repr("two\nlines\n")
    assert "Mute" in shown(Mute())


def test_errors_weigh_the_points_of_a_line():
    """Slope and intercept are NumPy's with weights 1/error; the error is that of the scatter or, if larger, theirs."""
    errors = np.linspace(0.5, 3.0, 12)
    for scatter in (0.01, 30.0):
        y = 2.0 * X - 1.0 + scatter * NOISE
        fit = fit_line(X, y, (0, 11), errors)
        (slope, intercept), known = np.polyfit(X, y, 1, w=1 / errors, cov="unscaled")
        (_, _), seen = np.polyfit(X, y, 1, w=1 / errors, cov=True)
        assert (fit.slope, fit.intercept) == pytest.approx((slope, intercept))
        assert fit.standard_error == pytest.approx(np.sqrt(max(known[0, 0], seen[0, 0])))
        assert (known[0, 0] > seen[0, 0]) == (scatter < 1.0)
