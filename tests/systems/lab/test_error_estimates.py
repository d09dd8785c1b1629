"""Errors of places that are widened by their own scatter."""

from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from systems.lab import Film, MarkerStatus, film_at_rate, track_markers
from systems.lab.films.blobs import slope_inside
from systems.lab.films.outliers import widen_errors
from systems.lab.films.pixel_noise import PixelNoise

RATE = 200.0
TIMES = np.arange(200) / RATE
SHAPE = (160, 160)


def swinging(rate: float = 9.0) -> Any:
    directions = 1.2 * np.cos(rate * TIMES)
    return 80.0 + 55.0 * np.stack([np.sin(directions), np.cos(directions)], axis=-1)


def disc(column: float, row: float) -> Any:
    """Image of a bright disc, from 64 points of each pixel."""
    fine = np.arange(24 * 8) / 8.0 - 7.0 / 16.0
    left, top = int(column) - 12, int(row) - 12
    inside = np.hypot(fine + left - column, (fine + top - row)[:, None]) < 5.0
    image = np.zeros(SHAPE)
    image[top : top + 24, left : left + 24] = inside.reshape(24, 8, 24, 8).mean(axis=(1, 3))
    return image


def filmed(draw: Any, places: Any, blur: float) -> Film:
    rng = np.random.default_rng(0)
    frames = [40.0 + 180.0 * gaussian_filter(draw(*p), blur) + rng.normal(0.0, 1.0, SHAPE) for p in places]
    return film_at_rate(np.clip(np.rint(frames), 0, 255).astype(np.uint8), RATE)


def ratio(found: Any, truth: Any) -> Any:
    """Root mean square of the true errors over the standard errors, across and down."""
    return np.sqrt(np.nanmean(((found.positions[:, 0] - truth) / found.errors[:, 0]) ** 2, axis=0))


@pytest.mark.parametrize("blur", [0.4, *(pytest.param(b, marks=pytest.mark.thorough) for b in (0.2, 0.6))])
def test_a_sharp_disc_that_hardly_moves(blur: float) -> None:
    """Over a tenth of a pixel in ten frames its error does not scatter; the width of its edge tells of it."""
    truth = np.array([80.3, 80.2]) + np.arange(200)[:, None] * np.array([0.013, 0.0087])
    found = track_markers(filmed(disc, truth, blur), truth[:1])
    assert (ratio(found, truth) > 0.6).all()
    assert (ratio(found, truth) < 1.4).all()


def lit(slope: float) -> Any:
    """Disc that is brighter at its right end than in its middle, by this fraction."""
    columns = np.arange(SHAPE[1])
    return lambda column, row: 0.8 * disc(column, row) * (1.0 + slope * (columns - column) / 5.0)


@pytest.mark.parametrize("slope", [0.1, *(pytest.param(s, marks=pytest.mark.thorough) for s in (0.03, 0.3))])
def test_a_marker_that_is_brighter_on_one_side(slope: float) -> None:
    """One plateau for all of it would put its centre 0.03, 0.1 and 0.34 pixels off, 3 to 34 standard errors."""
    truth = swinging()
    found = track_markers(filmed(lit(slope), truth, 0.8), truth[:1])
    assert (found.status == MarkerStatus.SEEN).all()
    assert np.abs((found.positions[:, 0] - truth).mean(axis=0)).max() < 0.015
    assert (ratio(found, truth) < 1.2).all()


@pytest.mark.parametrize("radius", [5.0, *(pytest.param(r, marks=pytest.mark.thorough) for r in (4.0, 9.0))])
def test_slopes_inside_a_blob(radius: float) -> None:
    """A slope of about ten standard errors is found within these; of noise alone, hardly ever any."""
    rng = np.random.default_rng(0)
    noise, made_up, apart, fine = PixelNoise(4.0, 0.0), 0, [], (np.arange(26 * 8) + 0.5) / 8.0 - 0.5
    inner = np.pi * (radius - 1.0) ** 2
    slope = 10.0 * 2.0 / np.sqrt(inner * (radius - 1.0) ** 2 / 4.0)
    for _ in range(200):
        row, column = 12.5 + rng.uniform(-0.5, 0.5, 2)
        discs = np.hypot(fine - column, (fine - row)[:, None]) < radius
        fraction = gaussian_filter(discs.reshape(26, 8, 26, 8).mean(axis=(1, 3)), 0.6)
        even = 40.0 + 150.0 * fraction + rng.normal(0.0, 2.0, fraction.shape)
        made_up += slope_inside(even, fraction > 0.5, (row, column), radius, noise)[0].any()
        tilted = even + fraction * slope * (np.arange(26) - column)
        found, errors = slope_inside(tilted, fraction > 0.5, (row, column), radius, noise)
        apart.append((found - [0.0, slope]) / errors)
    assert made_up <= 6
    assert np.sqrt(np.mean(np.square(apart))) < 1.5


def test_scatter_as_it_is() -> None:
    """Noise three times the errors widens them by three, half of it does not narrow them, few places tell nothing."""
    rng = np.random.default_rng(0)
    truth = swinging()[:, None]
    gaps = rng.random(200) < 0.2
    for level, factor in ((0.03, 3.0), (0.005, 1.0)):
        places = truth + rng.normal(0.0, level, truth.shape)
        places[gaps] = np.nan
        errors = np.where(np.isnan(places), np.nan, 0.01)
        widen_errors(TIMES, places, errors)
        assert errors[~gaps] / 0.01 == pytest.approx(factor, rel=0.25)
        assert np.isnan(errors[gaps]).all()
        few = np.full((30, 1, 2), 0.01)
        widen_errors(TIMES[:30], places[:30], few)
        assert (few == 0.01).all()
