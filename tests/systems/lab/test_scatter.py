"""Errors of places that are widened by their own scatter."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from systems.lab.filming.film import Film, film_at_rate
from systems.lab.filming.film_files import read_film, write_film
from systems.lab.filming.scatter import widen_errors
from systems.lab.filming.tracking import track_markers

RATE = 200.0
TIMES = np.arange(200) / RATE
SHAPE = (160, 160)


def swinging(rate: float = 9.0) -> Any:
    directions = 1.2 * np.cos(rate * TIMES)
    return 80.0 + 55.0 * np.stack([np.sin(directions), np.cos(directions)], axis=-1)


def square(column: float, row: float) -> Any:
    """Picture of a bright square along the pixels, by the share of each pixel that it covers."""

    def covered(n: int, middle: float) -> Any:
        k = np.arange(n)
        return np.clip(np.minimum(k + 0.5, middle + 5.0) - np.maximum(k - 0.5, middle - 5.0), 0.0, 1.0)

    return np.outer(covered(SHAPE[0], row), covered(SHAPE[1], column))


def disc(column: float, row: float) -> Any:
    """Picture of a bright disc, from 64 points of each pixel."""
    fine = np.arange(24 * 8) / 8.0 - 7.0 / 16.0
    left, top = int(column) - 12, int(row) - 12
    inside = np.hypot(fine + left - column, (fine + top - row)[:, None]) < 5.0
    picture = np.zeros(SHAPE)
    picture[top : top + 24, left : left + 24] = inside.reshape(24, 8, 24, 8).mean(axis=(1, 3))
    return picture


def filmed(draw: Any, places: Any, blur: float) -> Film:
    rng = np.random.default_rng(0)
    frames = [40.0 + 180.0 * gaussian_filter(draw(*p), blur) + rng.normal(0.0, 1.0, SHAPE) for p in places]
    return film_at_rate(np.clip(np.rint(frames), 0, 255).astype(np.uint8), RATE)


def ratio(found: Any, truth: Any) -> Any:
    """Root mean square of the true errors over the standard errors, across and down."""
    return np.sqrt(np.nanmean(((found.positions[:, 0] - truth) / found.errors[:, 0]) ** 2, axis=0))


@pytest.mark.parametrize(
    ("draw", "blur", "least"),
    [(disc, 0.4, 0.018), (square, 0.8, 0.012), (square, 0.4, 0.07)],
    ids=["sharp disc", "square", "sharp square"],
)
def test_markers_that_suit_the_pixels_less(draw: Any, blur: float, least: float) -> None:
    """True errors are 3, 2.5 and 14 times what noise and a soft disc would give; the scatter tells."""
    truth = swinging()
    found = track_markers(filmed(draw, truth, blur), truth[:1])
    assert np.std(found.positions[:, 0] - truth) > least
    assert (ratio(found, truth) > 0.6).all()
    assert (ratio(found, truth) < 1.3).all()


@pytest.mark.parametrize("blur", [0.2, 0.4, 0.6])
def test_a_sharp_disc_that_hardly_moves(blur: float) -> None:
    """Over a tenth of a pixel in ten frames its error does not scatter; the width of its edge tells of it."""
    truth = np.array([80.3, 80.2]) + np.arange(200)[:, None] * np.array([0.013, 0.0087])
    found = track_markers(filmed(disc, truth, blur), truth[:1])
    assert (ratio(found, truth) > 0.6).all()
    assert (ratio(found, truth) < 1.4).all()


def test_compressed_frames(tmp_path: Path) -> None:
    pytest.importorskip("imageio")
    pytest.importorskip("av")
    truth = swinging()
    write_film(filmed(disc, truth, 0.8), tmp_path / "film.mp4")
    found = track_markers(read_film(tmp_path / "film.mp4"), truth[:1])
    assert (ratio(found, truth) > 0.6).all()
    assert (ratio(found, truth) < 1.4).all()


def test_a_motion_that_frames_hardly_show_is_no_noise() -> None:
    """Fourteen frames a swing, with harmonics: differences of thirteen neighbours still hold the motion."""
    truth = swinging(90.0)
    found = track_markers(filmed(disc, truth, 0.8), truth[:1], window=40.0)
    assert (found.errors < 0.01).all()
    assert (ratio(found, truth) < 1.3).all()


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
