"""Centres of markers: their errors, thresholds, and smears of fast markers."""

from math import pi

import numpy as np
import pytest
from filmed_markers import CAMERA, CENTRE, SEEN, errors, rotating_rods, times_at

from systems.lab import Look, render_film, select_frames, track_markers
from systems.lab.films.blobs import otsu_threshold, smeared_area
from systems.lab.films.pixel_noise import pixel_noise


@pytest.mark.thorough
def test_weighted_centres_are_better_than_plain_ones() -> None:
    """The centre of a disc over many places on the pixels: the plain centroid of the report errs several times more."""
    recording = render_film(
        rotating_rods((0.055,), (0.5,), (6.0,)), CAMERA, times_at(200.0, 160), Look(rod_width=0.0), rng=2
    )
    rms = {}
    for weighted in (True, False):
        found = track_markers(recording.film, recording.truth[0], weighted=weighted)
        assert (found.status == SEEN).all()
        rms[weighted] = np.sqrt((errors(recording, found) ** 2).mean())
    assert rms[True] < 0.02
    assert rms[False] > 3.0 * rms[True]


@pytest.mark.parametrize(
    ("radius", "blur", "read_noise"), [(5.0, 0.8, 1.0), pytest.param(3.0, 1.0, 2.0, marks=pytest.mark.thorough)]
)
def test_standard_errors_cover_the_truth(radius: float, blur: float, read_noise: float) -> None:
    """Errors over standard errors have a standard deviation of about 1: noise and place on the pixels are all there is.

    (320 numbers give the standard deviation to 4 %; the part of the pixels is a rule of thumb, good to 30 %.)
    """
    look = Look(marker_radius=radius, blur=blur, read_noise=read_noise, rod_width=0.0)
    recording = render_film(rotating_rods((0.055,), (0.5,), (6.0,)), CAMERA, times_at(200.0, 160), look, rng=4)
    found = track_markers(recording.film, recording.truth[0])
    ratio = ((found.positions - recording.truth) / found.errors)[found.status[..., 0:1].repeat(2, axis=1)[:, None] == 0]
    assert 0.7 < ratio.std() < 1.3


@pytest.mark.thorough
def test_rods_do_not_pull() -> None:
    """Rods that meet a marker, one or two at an angle, shift its centre by less than a fiftieth of a pixel."""
    for lengths, initial_angles, rates in (((0.055,), (0.5,), (6.0,)), ((0.035, 0.034), (0.5, 1.8), (4.0, 4.0))):
        look = Look(marker_radius=4.5)
        recording = render_film(
            rotating_rods(lengths, initial_angles, rates), CAMERA, times_at(200.0, 160), look, rng=2
        )
        found = track_markers(recording.film, recording.truth[0])
        apart = found.positions[:, 0] - recording.truth[:, 0]
        out = (recording.truth[:, 0] - CENTRE) / (1000.0 * lengths[0])
        along, across = (apart * out).sum(axis=1), apart[:, 0] * out[:, 1] - apart[:, 1] * out[:, 0]
        assert abs(np.nanmean(along)) < 0.02
        assert abs(np.nanmean(across)) < 0.02
        assert np.nanstd(across) < 0.02


def test_noise_of_the_pixels() -> None:
    """On films of known noise: 100 000 pixels give the variance to half a per cent, classes and moving things less."""
    look = Look(read_noise=3.0, full_well=4000.0)
    recording = render_film(rotating_rods((0.055,), (0.5,), (6.0,)), CAMERA, times_at(200.0, 20), look, rng=2)
    noise = pixel_noise(recording.film)
    for grey in (30.0, 100.0, 200.0):
        expected = 9.0 + 1.0 / 12.0 + grey * 255.0 / 4000.0
        assert noise.variance(np.array(grey)) == pytest.approx(expected, rel=0.1)
    assert pixel_noise(select_frames(recording.film, [0])).variance(np.array(50.0)) == pytest.approx(1.0 / 12.0)


def test_otsu() -> None:
    """The best of all limits, by trying each; in the middle between two values."""
    rng = np.random.default_rng(3)
    grey = np.clip(np.concatenate([rng.normal(60, 12, 900), rng.normal(180, 9, 150)]), 0, 255).astype(np.uint8)

    def between(limit: float) -> float:
        dark, bright = grey[grey <= limit].astype(float), grey[grey > limit].astype(float)
        return dark.size * bright.size * (dark.mean() - bright.mean()) ** 2 if dark.size and bright.size else 0.0

    threshold, fraction = otsu_threshold(grey)
    best = max(between(k + 0.5) for k in range(255))
    assert between(threshold) == pytest.approx(best, rel=1e-12)
    assert fraction == pytest.approx(best / grey.size**2 / grey.var(), rel=1e-9)
    noise = otsu_threshold(rng.normal(size=200_000))[1]
    assert noise == pytest.approx(2.0 / pi, abs=0.01)
    with pytest.raises(ValueError, match="constant image"):
        otsu_threshold(np.full((3, 3), 5.0))
    with pytest.raises(ValueError, match="not all finite"):
        otsu_threshold([1.0, np.nan])


@pytest.mark.parametrize("travel", [9.0, *(pytest.param(t, marks=pytest.mark.thorough) for t in (0.0, 3.0, 14.0))])
def test_the_area_of_a_smear(travel: float) -> None:
    """Against a disc of 40 pixels' radius drawn and shifted: its area above half the brightest value."""
    rows, columns = np.mgrid[-90:91, -240:241]
    shifts = np.linspace(-0.5, 0.5, 401) * travel * 10.0
    smear = np.mean([np.hypot(columns - s, rows) < 40.0 for s in shifts], axis=0)
    assert smeared_area(4.0, travel) * 100.0 == pytest.approx((smear > 0.5 * smear.max()).sum(), rel=0.015)
