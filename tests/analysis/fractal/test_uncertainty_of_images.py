"""Uncertainty exponents of label images."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from scipy.optimize import brentq

import systems
from cellmap import CellGrid, find_basins
from cellmap.analysis.fractal import fractal_boundary_test, image_uncertainty_exponent
from cellmap.analysis.fractal.uncertainty_fits import SMOOTH


def disc(cells):
    x = (np.arange(cells) + 0.5) / cells - 0.5
    return np.hypot(*np.meshgrid(x, x)) < 0.3


def stripes(width, basins=2):
    return np.arange(400)[:, None] // width % basins + np.zeros((400, 300), int)


@pytest.mark.parametrize(
    "labels",
    [disc(400), np.add.outer(np.arange(200), np.arange(300)) > 250, stripes(50, 3), stripes(20), stripes(12, 3)],
)
def test_smooth_images(labels):
    found = image_uncertainty_exponent(labels)
    assert found.exponent == pytest.approx(1.0, abs=0.03)
    assert found.verdict == SMOOTH


def cantor_labels(slopes, width, height, centre=0.5):
    """Labels of a piecewise linear map with branches of these slopes at the ends of [0, 1], times a contraction.

    An orbit ends where it leaves: in one of the two parts of the gap, which belong to two attractors.
    """
    left, right = (1.0 / s for s in slopes)
    x = (np.arange(width) + 0.5) / width
    labels = np.full(width, -1)
    for _ in range(40):
        inside = labels < 0
        gap = inside & (x > left) & (x < 1.0 - right)
        labels[gap] = x[gap] > left + centre * (1.0 - left - right)
        x = np.where(x <= left, x / left, 1.0 - (1.0 - x) / right)
    return np.repeat(np.maximum(labels, 0)[:, None], height, axis=1)


SLOPES = [(10.0, 10.0), (20.0, 20.0), (8.0, 6.0)]


@pytest.mark.parametrize("slopes", SLOPES)
@pytest.mark.parametrize(("width", "height"), [(300, 100), (1000, 100), (1000, 300), (2000, 300)])
def test_cantor_boundaries_are_not_called_smooth(slopes, width, height):
    """1 - D with left**D + right**D = 1 (Moran 1946); the scales of one gap look like those of a smooth boundary."""
    exact = 1.0 - brentq(lambda d: sum(s**-d for s in slopes) - 1.0, 0.0, 1.0)
    labels = cantor_labels(slopes, width, height)
    found = image_uncertainty_exponent(labels)
    assert found.verdict != SMOOTH
    assert abs(found.exponent - exact) < 2.0 * found.standard_error
    assert fractal_boundary_test(labels, n_discs=200).verdict != SMOOTH


def test_less_than_a_decade_has_no_verdict():
    """A straight boundary in 60 cells, and the part of a Cantor boundary that looks like one."""
    for labels in (np.add.outer(np.arange(60), np.arange(80)) > 70, cantor_labels((10.0, 10.0), 1000, 300)):
        found = image_uncertainty_exponent(labels)
        part = image_uncertainty_exponent(labels, fit_range=(len(found.distances) - 7, len(found.distances) - 1))
        assert part.decades < 1.0
        assert part.verdict == "undetermined"
        assert part.standard_error > 12.0**-0.5 * (1.0 - part.decades)


@pytest.mark.slow
def test_intervals_hold_the_exponents_of_random_cantor_boundaries():
    """Two standard errors for at least 95 of 100 in 100 random slopes, and no smooth verdict."""
    rng, held = np.random.default_rng(5), []
    for _ in range(100):
        slopes = np.exp(rng.uniform(np.log(2.5), np.log(20.0), 2))
        exact = 1.0 - brentq(lambda d, s=slopes: (s**-d).sum() - 1.0, 0.0, 1.0)
        labels = cantor_labels(slopes, int(rng.integers(300, 2000)), int(rng.integers(100, 300)), rng.uniform(0.2, 0.8))
        found = image_uncertainty_exponent(labels)
        held.append(abs(found.exponent - exact) <= 2.0 * found.standard_error)
        assert found.verdict != SMOOTH
    assert np.mean(held) >= 0.95


@pytest.mark.parametrize("width", [1, 2, 3, 5])
def test_narrow_stripes_in_an_image_are_not_fractal(width):
    assert image_uncertainty_exponent(stripes(width, 3)).verdict != "fractal"


def test_a_mixed_image_has_exponent_zero():
    found = image_uncertainty_exponent(np.random.default_rng(0).integers(0, 2, (300, 200)))
    assert found.exponent == pytest.approx(0.0, abs=0.01)
    assert found.fractions == pytest.approx(0.5, abs=0.01)


def test_image_of_grebogi_ott_and_yorke():
    region = CellGrid((0.0, -0.5), (2 * pi, 0.5), (450, 300))
    basins = find_basins(systems.grebogi_ott_yorke_map(), region)
    found = image_uncertainty_exponent(basins)
    assert found.exponent == pytest.approx(0.205, abs=max(0.02, 2 * found.standard_error))
    assert found.verdict == "fractal"
    assert found.dimension == 2


def test_pairs_reach_round_circles():
    """On a circle of 12 cells a half has two ends, on a line one."""
    labels = np.arange(12) // 6
    line = image_uncertainty_exponent(labels, distances=[1])
    circle = image_uncertainty_exponent(labels, distances=[1], wraps=(True,))
    assert (line.uncertain.tolist(), line.pairs.tolist()) == ([1], [11])
    assert (circle.uncertain.tolist(), circle.pairs.tolist()) == ([2], [12])


def test_labels_without_a_basin_are_left_out():
    labels = np.array([[0, 0, -1, 1], [0, -2, 1, 1]])
    found = image_uncertainty_exponent(labels, distances=[1])
    # Along columns 0 1 | -1 1, ...: pairs 0-0, 0|-1, -1|1; 0|-2, -2|1, 1-1; and 0-0, 0|-2, -1|1, 1-1 across.
    assert (found.pairs.sum(), found.uncertain.sum(), found.left_out.sum()) == (4, 0, 6)
    both = image_uncertainty_exponent(labels, distances=[1], include=(-2,))
    assert (both.pairs.sum(), both.uncertain.sum()) == (7, 3)
    missing = image_uncertainty_exponent(np.where(labels < 0, np.nan, labels), distances=[1])
    assert missing.pairs.sum() == 4
    masked = image_uncertainty_exponent(np.ma.masked_less(labels, 0), distances=[1])
    assert masked.pairs.sum() == 4


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        ([[1]], "1 cells"),
        ([], "0 cells"),
        ([[-1, -2]], "no cell belongs to a basin"),
        ([[0.5, 1.0]], "holds 0.5"),
        ("ab", "give Basins, or an array"),
        ([[0, 1], [0]], "different lengths|inhomogeneous"),
    ],
)
def test_errors_of_images(labels, message):
    with pytest.raises((TypeError, ValueError), match=message):
        image_uncertainty_exponent(labels)
