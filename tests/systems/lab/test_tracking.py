"""Tracks of markers against the truth of synthetic films."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from cellmap import ForcedSystem, angle
from cellmap.maps import Trajectory
from systems.lab import (
    Bar,
    Camera,
    Film,
    Look,
    MarkerStatus,
    Rail,
    Recording,
    Rod,
    Spot,
    film_at_rate,
    pivot_on_rail,
    place_hidden,
    render_film,
    select_frames,
    track_markers,
)
from systems.lab.films.assignment import match
from systems.lab.films.blobs import otsu_threshold, smeared_area
from systems.lab.films.pixel_noise import pixel_noise

SEEN, PARTIAL, MERGED, LOST = MarkerStatus.SEEN, MarkerStatus.PARTIAL, MarkerStatus.MERGED, MarkerStatus.LOST
CAMERA = Camera(scale=1000.0, origin=(80.0, 80.0), shape=(160, 160))
CENTRE = (80.0, 80.0)


def turning(lengths: tuple[float, ...], starts: tuple[float, ...], rates: tuple[float, ...], swing: float = 0.0) -> Any:
    """Rods (m) that turn evenly (rad, rad/s), the pivot at the height swing cos(2 pi 9 t), for 1 s."""

    def positions(t: float, x: Any, p: Any) -> tuple[float, ...]:
        places = [0.0, p.swing * np.cos(2.0 * pi * 9.0 * t)]
        for k, length in enumerate(lengths):
            places += [places[-2] + length * np.sin(x[k]), places[-1] - length * np.cos(x[k])]
        return tuple(places)

    coordinates = tuple(angle(f"theta{k}") for k in range(len(lengths)))
    outputs = {"positions": positions}
    system = ForcedSystem(lambda t, x, p: rates, {"swing": swing}, 1.0, coordinates, outputs=outputs)
    times = np.linspace(0.0, 1.0, 2001)
    return Trajectory(system, times, np.array(starts) + np.outer(times, rates), np.zeros((), np.uint8), 2000)


def times_at(rate: float, count: int) -> Any:
    return 0.01 + np.arange(count) / rate


def errors(recording: Recording, found: Any) -> Any:
    return np.linalg.norm(found.positions - recording.truth, axis=-1)


def test_weighted_centres_are_better_than_plain_ones() -> None:
    """The centre of a disc over many places on the pixels: the plain centroid of the report errs several times more."""
    recording = render_film(turning((0.055,), (0.5,), (6.0,)), CAMERA, times_at(200.0, 160), Look(rod_width=0.0), rng=2)
    rms = {}
    for weighted in (True, False):
        found = track_markers(recording.film, recording.truth[0], weighted=weighted)
        assert (found.status == SEEN).all()
        rms[weighted] = np.sqrt((errors(recording, found) ** 2).mean())
    assert rms[True] < 0.02
    assert rms[False] > 3.0 * rms[True]


@pytest.mark.parametrize(("radius", "blur", "read_noise"), [(5.0, 0.8, 1.0), (5.0, 0.8, 5.0), (3.0, 1.0, 2.0)])
def test_standard_errors_cover_the_truth(radius: float, blur: float, read_noise: float) -> None:
    """Errors over standard errors have a standard deviation of about 1: noise and place on the pixels are all there is.

    (320 numbers give the standard deviation to 4 %; the part of the pixels is a rule of thumb, good to 30 %.)
    """
    look = Look(marker_radius=radius, blur=blur, read_noise=read_noise, rod_width=0.0)
    recording = render_film(turning((0.055,), (0.5,), (6.0,)), CAMERA, times_at(200.0, 160), look, rng=4)
    found = track_markers(recording.film, recording.truth[0])
    ratio = ((found.positions - recording.truth) / found.errors)[found.status[..., 0:1].repeat(2, axis=1)[:, None] == 0]
    assert 0.7 < ratio.std() < 1.3


def test_rods_do_not_pull() -> None:
    """Rods that meet a marker, one or two at an angle, shift its centre by less than a fiftieth of a pixel."""
    for lengths, starts, rates in (((0.055,), (0.5,), (6.0,)), ((0.035, 0.034), (0.5, 1.8), (4.0, 4.0))):
        look = Look(marker_radius=4.5)
        recording = render_film(turning(lengths, starts, rates), CAMERA, times_at(200.0, 160), look, rng=2)
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
    recording = render_film(turning((0.055,), (0.5,), (6.0,)), CAMERA, times_at(200.0, 20), look, rng=2)
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

    threshold, share = otsu_threshold(grey)
    best = max(between(k + 0.5) for k in range(255))
    assert between(threshold) == pytest.approx(best, rel=1e-12)
    assert share == pytest.approx(best / grey.size**2 / grey.var(), rel=1e-9)
    noise = otsu_threshold(rng.normal(size=200_000))[1]
    assert noise == pytest.approx(2.0 / pi, abs=0.01)
    with pytest.raises(ValueError, match="constant image"):
        otsu_threshold(np.full((3, 3), 5.0))
    with pytest.raises(ValueError, match="not all finite"):
        otsu_threshold([1.0, np.nan])


@pytest.mark.parametrize("travel", [0.0, 3.0, 9.0, 14.0])
def test_the_area_of_a_smear(travel: float) -> None:
    """Against a disc of 40 pixels' radius drawn and shifted: its area above half the brightest value."""
    rows, columns = np.mgrid[-90:91, -240:241]
    shifts = np.linspace(-0.5, 0.5, 401) * travel * 10.0
    smear = np.mean([np.hypot(columns - s, rows) < 40.0 for s in shifts], axis=0)
    assert smeared_area(4.0, travel) * 100.0 == pytest.approx((smear > 0.5 * smear.max()).sum(), rel=0.015)


def test_matching_keeps_to_the_rods() -> None:
    costs = np.array([[0.1, 0.3], [0.1, 0.4]])
    assert match(costs, lambda choice: None) == [1, 0]
    assert match(costs, lambda choice: (0, 1) if choice == [1, 0] else None) == [0, 1]
    assert match(costs, lambda choice: (0, 1) if min(choice) >= 0 else None) in ([0, -1], [-1, 0])
    assert match(np.full((2, 0), np.inf), lambda choice: None) == [-1, -1]


def test_fast_markers_are_foreseen() -> None:
    """20 pixels a frame, with a window of 16; without knowing the velocity they are found in the doubled one."""
    recording = render_film(turning((0.06,), (0.5,), (33.0,)), CAMERA, times_at(100.0, 90), Look(marker_radius=4.0))
    assert np.linalg.norm(np.diff(recording.truth[:, 0], axis=0), axis=1).min() > 19.0
    found = track_markers(recording.film, recording.truth[0])
    assert (found.status == SEEN).all()
    assert errors(recording, found).max() < 0.2


def test_a_bar_a_bright_object_and_dropped_frames() -> None:
    """What is not seen whole is flagged; the marker is found again, and the bright object never taken for it."""
    rod = Rod(0, CENTRE, 55.0)
    for seed, rods in ((0, ()), (1, (rod,))):
        recording = render_film(
            turning((0.055,), (0.5,), (9.0,)),
            CAMERA,
            times_at(150.0, 140),
            exposure=0.001,
            bars=[Bar(40.0, 58.0, 0.0, 160.0)],
            spots=[Spot(68.0, 46.0, 5.0)],
            dropped=[7, 30, 31, 32, 90],
            rng=seed,
        )
        found = track_markers(recording.film, recording.truth[0], rods)
        seen = found.status[:, 0] == SEEN
        assert errors(recording, found)[seen].max() < 0.25
        assert (recording.visible[seen] > 0.95).all()
        assert (found.status[[7, 30, 31, 32, 90], 0] == MarkerStatus.NO_FRAME).all()
        assert seen.mean() > 0.6
        hidden = recording.visible[:, 0] < 0.9
        assert hidden.any()
        assert not seen[hidden].any()
        assert np.isnan(found.positions[~seen]).all()
        assert np.isfinite(found.positions[seen]).all()


def test_a_long_absence() -> None:
    """Three quarters of a second behind a bar, more than a full rotation, with a bright object in the image."""
    bars = [Bar(0.0, 159.0, 0.0, 159.0, start=0.1, end=0.85)]
    recording = render_film(
        turning((0.055,), (0.5,), (9.0,)), CAMERA, times_at(150.0, 145), bars=bars, spots=[Spot(30.0, 20.0, 5.0)]
    )
    found = track_markers(recording.film, recording.truth[0], [Rod(0, CENTRE, 55.0)])
    after = recording.film.times > 0.86
    assert (found.status[after, 0] == SEEN).all()
    assert errors(recording, found)[after].max() < 0.2
    gap = found.gaps[0]
    assert gap.seconds == pytest.approx(0.75, abs=0.03)
    assert repr(found) == f"Tracks(145 frames, 1 markers seen whole in {(found.status == SEEN).sum()} of them)"


@pytest.mark.parametrize("stays", [True, False])
def test_what_is_found_again_and_stands_is_no_marker(stays: bool) -> None:
    """A disc put on the circle of the rod while the marker is hidden: for good, or until after that comes back."""
    motion = turning((0.055,), (0.5,), (9.0,))
    hidden = [Bar(0.0, 159.0, 0.0, 159.0, grey=40.0, start=0.2, end=0.6)]
    plain = render_film(motion, CAMERA, times_at(150.0, 145), bars=hidden, rng=1)
    other = CENTRE[0] + 55.0 * np.sin(2.4), CENTRE[1] + 55.0 * np.cos(2.4)
    there = (plain.film.times > 0.4) & (stays | (plain.film.times < 0.65))
    disc = picture(other, shape=(160, 160)).astype(np.uint8)
    frames = np.where(there[:, None, None], np.maximum(plain.film.frames, disc), plain.film.frames)
    found = track_markers(film_at_rate(frames, 150.0), plain.truth[0], [Rod(0, CENTRE, 55.0)])
    seen = found.status[:, 0] == SEEN
    assert errors(plain, found)[seen].max() < 0.2
    assert seen[plain.film.times < 0.19].all()
    assert seen[plain.film.times > 0.75].all() == (not stays)
    assert (found.status[there & (plain.film.times > 0.45) & (plain.film.times < 0.6), 0] == LOST).all()


def test_a_free_marker_is_found_after_a_long_time() -> None:
    """Without a rod, straight on it would be far outside of the image by then."""
    bars = [Bar(0.0, 159.0, 0.0, 159.0, start=0.2, end=0.7)]
    recording = render_film(turning((0.055,), (0.5,), (9.0,)), CAMERA, times_at(150.0, 145), bars=bars)
    found = track_markers(recording.film, recording.truth[0])
    after = recording.film.times > 0.71
    assert (found.status[after, 0] == SEEN).all()
    assert errors(recording, found)[after].max() < 0.2


def test_markers_that_cross() -> None:
    """Two links folded over each other: merged, flagged, and distinguished again."""
    rods = (Rod(0, CENTRE, 35.0), Rod(1, 0, 34.0))
    look = Look(pivot_marker=False, marker_radius=4.0)
    recording = render_film(turning((0.035, 0.034), (0.3, 0.9), (2.0, 11.0)), CAMERA, times_at(200.0, 190), look)
    apart = np.linalg.norm(recording.truth[:, 0] - recording.truth[:, 1], axis=1)
    assert apart.min() > 30.0
    pivoted = Look(pivot_marker=True, marker_radius=4.0)
    motion = turning((0.035, 0.034), (0.3, 0.3), (2.0, 11.0))
    crossing = render_film(motion, CAMERA, times_at(200.0, 190), pivoted, rng=1)
    close = np.linalg.norm(crossing.truth[:, 0] - crossing.truth[:, 2], axis=1)
    assert close.min() < 4.0
    held = (Rod(1, 0, 35.0), Rod(2, 1, 34.0))
    found = track_markers(crossing.film, crossing.truth[0], held)
    seen = found.status == SEEN
    assert np.nanmax(errors(crossing, found)) < 0.4
    assert not seen[close < 6.0][:, [0, 2]].any()
    assert seen[close > 12.0].mean() > 0.97
    chain = track_markers(recording.film, recording.truth[0], rods)
    assert (chain.status == SEEN).mean() > 0.97
    assert np.nanmax(errors(recording, chain)) < 0.4


def test_a_marker_that_leaves_the_picture() -> None:
    camera = Camera(1000.0, (80.0, 120.0), (160, 160))
    recording = render_film(turning((0.055,), (2.0,), (6.0,)), camera, times_at(150.0, 145))
    found = track_markers(recording.film, recording.truth[0], [Rod(0, (80.0, 120.0), 55.0)])
    seen = found.status[:, 0] == SEEN
    assert (recording.visible[seen, 0] == 1.0).all()
    assert (~seen).sum() > 20
    assert seen[recording.visible[:, 0] == 1.0].mean() > 0.9
    assert errors(recording, found)[seen].max() < 0.2


def test_uneven_times() -> None:
    """Frames that are absent: the marker is looked for where its velocity has taken it meanwhile."""
    recording = render_film(turning((0.055,), (0.5,), (12.0,)), CAMERA, times_at(200.0, 180), Look(marker_radius=4.0))
    kept = np.random.default_rng(1).random(180) < 0.6
    kept[:2] = True
    film = select_frames(recording.film, kept)
    found = track_markers(film, recording.truth[0], [Rod(0, CENTRE, 55.0)])
    assert (found.status == SEEN).all()
    assert np.linalg.norm(found.positions - recording.truth[kept], axis=-1).max() < 0.2


def test_a_hidden_pivot_that_moves_vertically() -> None:
    """The report's scheme: the pivot from the end of the rod; with the error that follows from that of the end."""
    motion = turning((0.055,), (0.4,), (0.5,), swing=0.006)
    look = Look(pivot_marker=True, rod_width=0.0)
    bars = [Bar(60.0, 100.0, 60.0, 100.0, start=0.3, end=0.7)]
    recording = render_film(motion, CAMERA, times_at(200.0, 190), look, bars=bars, rng=2)
    rods, rails = (Rod(1, 0, 55.0),), (Rail(0, 80.0),)
    found = track_markers(recording.film, recording.truth[0], rods, rails)
    hidden = found.status[:, 0] == LOST
    assert hidden.sum() > 70
    filled = place_hidden(found, rods, rails, near=80.0)
    assert (filled.status[hidden, 0] == MarkerStatus.CONSTRAINED).all()
    apart = filled.positions[hidden, 0] - recording.truth[hidden, 0]
    assert np.abs(apart).max() < 0.1
    assert 0.6 < (apart[:, 1] / filled.errors[hidden, 0, 1]).std() < 1.5
    np.testing.assert_array_equal(filled.positions[~hidden], found.positions[~hidden])


def test_a_shaken_pivot_of_a_rod_that_goes_round() -> None:
    """Fifty shakes a second at 1000 frames, twice a rotation flat: known points within rounding, or none at all."""
    times = np.arange(1000) / 1000.0
    rows, angles = 40.0 + 4.0 * np.cos(2.0 * pi * 50.0 * times + 1.0), 25.0 * times
    ends = np.stack([60.0 + 50.0 * np.sin(angles), rows + 50.0 * np.cos(angles)], axis=-1)
    ends[300:330] = np.nan
    for near in (38.0, 40.0, 43.0):
        pivots, slopes = pivot_on_rail(ends, 50.0, 60.0, near)
        known = np.isfinite(pivots[:, 1])
        assert known.mean() > 0.9
        assert (known == np.isfinite(slopes)).all()
        assert np.abs(pivots[known, 1] - rows[known]).max() < 1e-9
        assert slopes[known] == pytest.approx(np.tan(angles[known]), abs=1e-9)
    flat = np.abs(np.cos(angles)) < 0.08
    pivots = pivot_on_rail(np.where(flat[:, None], ends, np.nan), 50.0, 60.0, 40.0)[0]
    known = np.isfinite(pivots[:, 1])
    assert known.sum() < 0.5 * flat.sum()
    assert np.abs(pivots[known, 1] - rows[known]).max(initial=0.0) < 1e-9


def test_solutions_that_are_not_sure_are_left_out() -> None:
    ends = [[149.0, 80.0], [135.0, 80.0], [np.nan, 1.0], [112.0, 106.0], [48.0, 122.0]]
    pivots, slopes = pivot_on_rail(ends, length=55.0, column=80.0, near=70.0)
    assert np.isnan(pivots[:3]).all()
    assert pivots[3:, 1] == pytest.approx([106.0 - np.sqrt(55.0**2 - 32.0**2), 122.0 - np.sqrt(55.0**2 - 32.0**2)])
    assert slopes[3] == pytest.approx(32.0 / np.sqrt(55.0**2 - 32.0**2))


def picture(*places: tuple[float, float], radius: float = 5.0, shape: tuple[int, int] = (80, 100)) -> Any:
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    frame = np.full(shape, 40.0)
    for column, row in places:
        frame += 160.0 * np.clip(radius + 0.5 - np.hypot(columns - column, rows - row), 0.0, 1.0)
    return gaussian_filter(frame, 0.8)


def filmed(*frames: Any) -> Film:
    return film_at_rate(np.rint(np.array(frames)).astype(np.uint8), 100.0)


@pytest.mark.parametrize(
    ("starts", "options", "error"),
    [
        ([(70, 60)], {}, "nothing bright stands out"),
        ([(70, 60)], {"threshold": 35.0}, "all pixels at the initial positions exceed it"),
        ([(30, 30)], {"threshold": 250.0}, "no pixel at the initial positions exceeds it"),
        ([(41, 30)], {}, "no marker is above the grey value"),
        (
            [(30, 300)],
            {},
            r"positions\[0\]=\(30, 300\): give a pixel \(column, row\) in the image of 100 x 80",
        ),
        ([(np.nan, 30)], {}, "give a pixel"),
        ([30, 30], {}, "give a pixel .* for each marker"),
        ([(30, 30), (31, 30)], {}, "are at the same marker"),
        ([(30, 30)], {"search_radius": 4.0}, "cut off 4 pixels away"),
        ([(98, 30)], {}, "touches the border of the image"),
        ([(30, 30)], {"search_radius": np.inf}, "search_radius=inf: give a finite number"),
        ([(30, 30)], {"rods": [Rod(1, CENTRE, 5.0)]}, "rod.marker=1: give a whole number of at most 0"),
        ([(30, 30)], {"rods": [Rod(0, CENTRE, 5.0), Rod(0, CENTRE, 6.0)]}, "hangs on two of them"),
        ([(30, 30)], {"rods": [Rod(0, (30.0, 10.0), 25.0)]}, "begins 20.0 pixels from its pivot, and its rod has 25"),
        ([(30, 30)], {"rails": [Rail(0, 36.0)]}, "begins at the column 30.0, and its rail is at 36"),
        ([(30, 30)], {"rails": [Rail(0, 30.0), Rail(0, 31.0)]}, "moves on two of them"),
        ([(60, 30)], {}, "times as long as wide"),
    ],
)
def test_what_cannot_be_tracked(starts: Any, options: Any, error: str) -> None:
    frame = picture((30.0, 30.0), (97.0, 30.0), (57.0, 30.0), (66.0, 30.0))
    frame += np.random.default_rng(1).normal(0.0, 1.0, frame.shape)
    with pytest.raises((TypeError, ValueError), match=error):
        track_markers(filmed(frame, frame), starts, **options)


def test_films_without_light_or_frames() -> None:
    flat = np.full((80, 100), 40.0)
    with pytest.raises(ValueError, match="all pixels of the first windows are 40"):
        track_markers(filmed(flat, flat), [(30, 30)])
    noise = np.random.default_rng(0).normal(100.0, 5.0, (2, 80, 100))
    with pytest.raises(ValueError, match="nothing bright stands out"):
        track_markers(filmed(*noise), [(30, 30)])
    dark = 255.0 - picture((50.0, 40.0), radius=8.0)
    for frame, message in ((dark, "no marker is above"), (dark + 0.4 * (noise[0] - 100.0), "it is dark there")):
        with pytest.raises(ValueError, match=rf"{message}.*of dark markers,? the negative of the film"):
            track_markers(filmed(frame), [(50, 40)], search_radius=25.0)
    faint = np.where(picture((50.0, 40.0)) > 120.0, 86.0, 85.0)
    with pytest.raises(ValueError, match=r"nothing bright stands out there \(by 3.5 deviations"):
        track_markers(filmed(faint), [(50, 40)])
    with pytest.raises(ValueError, match="for markers filling the surroundings, a larger search_radius="):
        track_markers(filmed(picture((50.0, 40.0), radius=14.0)), [(50, 40)])
    with pytest.raises(ValueError, match="all frames are missing"):
        track_markers(film_at_rate(np.full((2, 80, 100), np.nan), 10.0), [(30, 30)])
    with pytest.raises(ValueError, match="count markers from the pivot outwards"):
        Rod(0, 0, 5.0)
    with pytest.raises(TypeError, match="give Rod"):
        track_markers(filmed(picture((30.0, 30.0))), [(30, 30)], rods=[3])  # type: ignore[list-item]


def test_frames_that_repeat_the_one_before_are_missing() -> None:
    """A recorder that fills in for lost frames: the truth is elsewhere, by 6 pixels at most, and nothing else tells."""
    rng = np.random.default_rng(3)
    times = np.arange(120) / 100.0
    truth = np.stack([50.0 + 30.0 * np.sin(6.0 * times), 40.0 + 10.0 * np.cos(6.0 * times)], axis=-1)
    frames = [picture(tuple(place)) + rng.normal(0.0, 2.0, (80, 100)) for place in truth.tolist()]
    repeated = [7, 20, 21, 60, 90]
    for k in repeated:
        frames[k] = frames[k - 1]
    found = track_markers(filmed(*frames), truth[:1])
    assert np.flatnonzero(found.status[:, 0] == MarkerStatus.NO_FRAME).tolist() == repeated
    assert np.nanmax(np.abs(found.positions[:, 0] - truth)) < 0.1
    assert np.nanmax(found.errors) < 0.02


def test_a_marker_that_stands_is_seen_in_equal_frames() -> None:
    """Without noise, frames repeat as long as nothing moves; before and after it moves by 3 pixels a frame."""
    frames = [picture((30.0 + 3.0 * min(k, 5) + 3.0 * max(k - 8, 0), 30.0)) for k in range(14)]
    found = track_markers(filmed(*frames[:9]), [(30, 30)])
    assert (found.status == SEEN).all()


def test_missing_and_constant_frames_are_gaps() -> None:
    """NaN frames and flagged ones have no frame; in a constant one the marker is lost."""
    frames = np.array([picture((30.0 + k, 30.0)) for k in range(8)])
    frames[0], frames[3], frames[5] = np.nan, np.nan, 100.0
    found = track_markers(film_at_rate(frames, 100.0), [(31, 30)])
    none = MarkerStatus.NO_FRAME
    assert found.status[:, 0].tolist() == [none, SEEN, SEEN, none, SEEN, LOST, SEEN, SEEN]
    assert found.positions[[1, 7], 0, 0] == pytest.approx([31.0, 37.0], abs=0.01)
    assert [(g.first, g.last, g.seconds) for g in found.gaps] == [
        (0, 0, np.inf),
        (3, 3, pytest.approx(0.02)),
        (5, 5, pytest.approx(0.02)),
    ]
