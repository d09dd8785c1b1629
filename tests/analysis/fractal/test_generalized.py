"""Dimensions of measures: exact cascades, published values of Henon's attractor, exponents."""

from math import inf, log, pi

import numpy as np
import pytest

import systems
from cellmap import angle, lyapunov_spectrum
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


# --- correlation


def test_pairs_across_the_branch_cut_of_an_angle():
    """Golden rotation: equally spread over a circle."""
    points = np.mod(np.arange(8000)[:, None] * 0.5 * (5.0**0.5 - 1.0) * 2.0 * pi, 2.0 * pi) - pi
    found = correlation_dimension(points, coordinates=(angle("theta"),), theiler=0)
    assert found.dimension == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(found.fractions[:5], 2.0 * found.radii[:5], rtol=0.02)


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


# --- pairs near in time on a circle


@pytest.mark.parametrize("norm", [2.0, np.inf])
@pytest.mark.parametrize("theiler", [1, 9])
def test_pairs_of_a_circle_are_counted_exactly(theiler, norm):
    """All distances one by one, those of the angle along the shorter arc; neighbours in time often cross the cut."""
    n, radii = 1100, np.array([0.5, 0.25, 0.12])
    time = np.arange(n)
    points = np.column_stack([np.mod(0.07 * time + 0.3 * np.sin(time) + pi, 2 * pi) - pi, 0.2 * np.cos(0.4 * time)])
    found = correlation_dimension(
        points,
        radii,
        theiler=theiler,
        norm=norm,
        coordinates=(angle("a"), "x"),
        scale=(1.0, 1.0),
        fit_range=(0.12, 0.5),
    )
    between = np.abs(points[:, None] - points[None])
    between[..., 0] = np.minimum(between[..., 0], 2 * pi - between[..., 0])
    distance = np.linalg.norm(between, ord=norm, axis=-1)
    apart = np.abs(time[:, None] - time) > theiler
    np.testing.assert_allclose(found.fractions, [(distance[apart] <= r).mean() for r in radii], rtol=1e-12)
