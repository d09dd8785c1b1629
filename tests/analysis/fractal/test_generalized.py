"""Dimensions of measures: exact cascades, published values of Henon's attractor, exponents."""

from __future__ import annotations

from math import inf, log, pi

import numpy as np
import pytest
from scipy.stats import chi2

import systems
from cellmap import angle, lyapunov_spectrum, set_threads
from cellmap.analysis.fractal import correlation_dimension, generalized_dimensions, kaplan_yorke_dimension
from studies.known_fractals import CANTOR, cascade, cascade_dimension

# --- D_q


def test_cascade_on_its_own_grid_is_exact():
    """D_q = ln(p**q + (1 - p)**q) / ((1 - q) ln 3), Halsey et al. 1986, also for negative q."""
    places, weights = cascade(12)
    orders = (-3.0, -1.0, 0.0, 0.5, 1.0, 2.0, 5.0)
    sizes = 3.0 ** -np.arange(0, 12)
    found = generalized_dimensions(places, orders, sizes, weights=weights, origin=0.0, fit_range=(sizes[10], sizes[1]))
    np.testing.assert_allclose(found.dimensions, [cascade_dimension(q) for q in orders], rtol=1e-9)


def test_cascade_on_grids_at_random_places():
    places, weights = cascade(16)
    found = generalized_dimensions(places, (0.0, 1.0, 2.0, 3.0), weights=weights)
    for q, fit in found:
        assert fit.slope == pytest.approx(cascade_dimension(q), abs=0.01)
        assert abs(fit.slope - cascade_dimension(q)) < 3.0 * fit.standard_error
    assert (np.diff(found.dimensions) < 0.0).all()
    assert found[0.0].slope == pytest.approx(CANTOR, abs=0.01)


@pytest.mark.slow
def test_uniform_measure_has_one_dimension():
    points = np.random.default_rng(0).random((300_000, 2))
    torus = (angle("a", period=1.0, lower=0.0), angle("b", period=1.0, lower=0.0))
    found = generalized_dimensions(points, (0, 1, 2, 4), coordinates=torus)
    np.testing.assert_allclose(found.dimensions, 2.0, atol=0.01)
    # A square has edges, which the boxes at them count in full.
    open_square = generalized_dimensions(points, (0, 1, 2, 4))
    assert (open_square.dimensions < found.dimensions).all()


def test_errors_of_orders_and_weights():
    points = np.random.default_rng(0).random((1000, 1))
    for arguments, message in (
        ({"orders": []}, "orders"),
        ({"orders": [inf]}, "orders"),
        ({"weights": np.ones(3)}, "weights: give 1000"),
        ({"weights": -np.ones(1000)}, "at least 0"),
    ):
        with pytest.raises(ValueError, match=message):
            generalized_dimensions(points, **arguments)
    with pytest.raises(KeyError, match="q=7"):
        generalized_dimensions(np.random.default_rng(0).random((20_000, 1)))[7]


# --- correlation


@pytest.fixture(scope="module")
def henon() -> np.ndarray:
    """Thirty thousand points of the attractor, one of each orbit after the other."""
    initial_conditions = 0.1 + 0.01 * np.random.default_rng(0).random((100, 2))
    return systems.henon_map().orbit(initial_conditions, 400).points[101:].reshape(-1, 2)


def test_correlation_dimension_of_henon(henon):
    """1.220 +- 0.036 (Sprott, Rowlands, International Journal of Bifurcation and Chaos 11 (2001) 1865)."""
    found = correlation_dimension(henon)
    assert found.dimension == pytest.approx(1.22, abs=0.02)
    low, high = found.fit.interval()
    assert low < 1.22 < high


def test_pairs_are_counted_exactly(henon):
    """All distances one by one, with pairs near in time left out."""
    points = henon[:1200]
    found = correlation_dimension(points, [0.3, 0.1, 0.03], theiler=7, fit_range=(0.03, 0.3))
    distance = np.linalg.norm(points[:, None] - points[None], axis=-1)
    apart = np.abs(np.subtract.outer(np.arange(1200), np.arange(1200))) > 7
    expected = [(distance[apart] <= r).mean() for r in (0.3, 0.1, 0.03)]
    np.testing.assert_allclose(found.fractions, expected, rtol=1e-12)
    assert found.pairs == apart.sum() // 2


def test_neighbours_in_time_lower_the_dimension():
    """Autocorrelated noise (Theiler 1986): both slopes follow from the distribution of distances after each lag."""
    memory, count = 0.99, 6000
    rng = np.random.default_rng(0)
    series = [rng.normal(size=3)]
    for kick in rng.normal(size=(count - 1, 3)):
        series.append(memory * series[-1] + np.sqrt(1.0 - memory**2) * kick)
    radii = np.array([0.7, 0.45, 0.3, 0.2])
    biased, freed = (correlation_dimension(np.array(series), radii, theiler=w, fit_range=(0.2, 0.7)) for w in (0, 1000))
    lags = np.arange(1, count)
    spread = 2.0 * (1.0 - memory**lags)  # variance of a difference, along each of three axes
    near = chi2.cdf(radii[:, None] ** 2 / spread, 3) @ (count - lags)
    slopes = [np.polyfit(np.log(radii), np.log(c), 1)[0] for c in (near, chi2.cdf(radii**2 / 2.0, 3))]
    assert slopes == pytest.approx([2.707, 2.947], abs=1e-3)
    assert biased.dimension == pytest.approx(slopes[0], abs=0.03)
    assert freed.dimension == pytest.approx(slopes[1], abs=0.05)


def test_pairs_across_the_branch_cut_of_an_angle():
    """Golden rotation: equally spread over a circle."""
    points = np.mod(np.arange(8000)[:, None] * 0.5 * (5.0**0.5 - 1.0) * 2.0 * pi, 2.0 * pi) - pi
    found = correlation_dimension(points, coordinates=(angle("theta"),), theiler=0)
    assert found.dimension == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(found.fractions[:5], 2.0 * found.radii[:5], rtol=0.02)


def test_norms_and_threads(henon):
    points = henon[:4000]
    results = []
    for threads in (1, 3):
        set_threads(threads)
        results.append(correlation_dimension(points, norm=inf))
    assert np.array_equal(results[0].fractions, results[1].fractions)
    assert (results[0].fractions >= correlation_dimension(points, norm=2.0).fractions).all()


def test_correlation_errors():
    points = np.random.default_rng(0).random((2000, 2))
    for arguments, message in (
        ({"points": points[:10]}, "too few"),
        ({"points": points, "theiler": 1999}, "theiler"),
        ({"points": points, "norm": 3}, "norm"),
        ({"points": points, "fit_range": (0.1, 0.1001)}, "fit_range"),
    ):
        with pytest.raises(ValueError, match=message):
            correlation_dimension(**arguments)


# --- Kaplan and Yorke


def test_kaplan_yorke_of_henon():
    """1.25827 (Sprott, Chaos and Time-Series Analysis, 2003, appendix A), from 0.41922 and -1.62319."""
    assert kaplan_yorke_dimension([0.41922, -1.62319]).dimension == pytest.approx(1.25827, abs=1e-5)
    spectrum = lyapunov_spectrum(systems.henon_map(), [[0.1, 0.1]], periods=20_000)
    found = kaplan_yorke_dimension(spectrum)
    assert found.dimension == pytest.approx(1.25827, abs=max(4.0 * found.standard_error, 1e-3))
    assert 0.0 < found.standard_error < 0.01


def test_kaplan_yorke_of_the_baker():
    """Exactly 1 + ln 2 / ln 3 for stretching by 2 and contraction by 3."""
    assert kaplan_yorke_dimension([log(2.0), -log(3.0)]).dimension == pytest.approx(1.0 + CANTOR)


def test_errors_of_exponents_are_propagated():
    """Against a sample of exponents with these errors."""
    exponents, errors = np.array([0.9, 0.02, -14.5]), np.array([0.01, 0.005, 0.1])
    found = kaplan_yorke_dimension(exponents, errors)
    drawn = np.random.default_rng(0).normal(exponents, errors, (20_000, 3))
    sample = 2.0 + (drawn[:, 0] + drawn[:, 1]) / -drawn[:, 2]
    assert found.standard_error == pytest.approx(sample.std(), rel=0.03)
    assert found.whole == 2


def test_kaplan_yorke_at_its_ends():
    point = kaplan_yorke_dimension([-1.0, -0.5])
    assert (point.dimension, point.bounded) == (0.0, True)
    cycle = kaplan_yorke_dimension([0.0, -1.0])
    assert cycle.dimension == 1.0
    assert kaplan_yorke_dimension([0.3, -inf]).dimension == 1.0
    conservative = kaplan_yorke_dimension([0.5, -0.5])
    assert conservative.dimension == 2.0
    assert not conservative.bounded
    assert np.isnan(kaplan_yorke_dimension([0.4, -1.6]).standard_error)


@pytest.mark.parametrize("exponents", [[], [np.nan, 1.0], [inf]])
def test_kaplan_yorke_needs_numbers(exponents):
    with pytest.raises(ValueError, match="exponents="):
        kaplan_yorke_dimension(exponents)


def test_kaplan_yorke_needs_one_orbit():
    with pytest.raises(ValueError, match="those of one orbit"):
        kaplan_yorke_dimension([[1.0, -2.0], [1.0, -2.0]])
    with pytest.raises(ValueError, match="one error"):
        kaplan_yorke_dimension([1.0, -2.0], [0.1])
