"""Tracks of markers against the truth of synthetic films."""

from math import pi

import numpy as np
import pytest
from filmed_markers import CAMERA, CENTRE, LOST, SEEN, errors, frame_with, rotating_rods, times_at

from systems import lab
from systems.lab.films.marker_search import match


def test_matching_keeps_to_the_rods() -> None:
    costs = np.array([[0.1, 0.3], [0.1, 0.4]])
    assert match(costs, lambda choice: None) == [1, 0]
    assert match(costs, lambda choice: (0, 1) if choice == [1, 0] else None) == [0, 1]
    assert match(costs, lambda choice: (0, 1) if min(choice) >= 0 else None) in ([0, -1], [-1, 0])
    assert match(np.full((2, 0), np.inf), lambda choice: None) == [-1, -1]


def test_fast_markers_are_foreseen() -> None:
    """20 pixels a frame, with a window of 16; without knowing the velocity they are found in the doubled one."""
    recording = lab.render_film(
        rotating_rods((0.06,), (0.5,), (33.0,)), CAMERA, times_at(100.0, 90), lab.Look(marker_radius=4.0)
    )
    assert np.linalg.norm(np.diff(recording.truth[:, 0], axis=0), axis=1).min() > 19.0
    found = lab.track_markers(recording.film, recording.truth[0])
    assert (found.status == SEEN).all()
    assert errors(recording, found).max() < 0.2


@pytest.mark.thorough
def test_a_bar_a_bright_object_and_dropped_frames() -> None:
    """What is not seen whole is flagged; the marker is found again, and the bright object never taken for it."""
    rod = lab.Rod(0, CENTRE, 55.0)
    for seed, rods in ((0, ()), (1, (rod,))):
        recording = lab.render_film(
            rotating_rods((0.055,), (0.5,), (9.0,)),
            CAMERA,
            times_at(150.0, 140),
            exposure=0.001,
            bars=[lab.Bar(40.0, 58.0, 0.0, 160.0)],
            spots=[lab.Spot(68.0, 46.0, 5.0)],
            dropped=[7, 30, 31, 32, 90],
            rng=seed,
        )
        found = lab.track_markers(recording.film, recording.truth[0], rods)
        seen = found.status[:, 0] == SEEN
        assert errors(recording, found)[seen].max() < 0.25
        assert (recording.visible[seen] > 0.95).all()
        assert (found.status[[7, 30, 31, 32, 90], 0] == lab.MarkerStatus.NO_FRAME).all()
        assert seen.mean() > 0.6
        hidden = recording.visible[:, 0] < 0.9
        assert hidden.any()
        assert not seen[hidden].any()
        assert np.isnan(found.positions[~seen]).all()
        assert np.isfinite(found.positions[seen]).all()


def test_a_long_absence() -> None:
    """Three quarters of a second behind a bar, more than a full rotation, with a bright object in the image."""
    bars = [lab.Bar(0.0, 159.0, 0.0, 159.0, start=0.1, end=0.85)]
    recording = lab.render_film(
        rotating_rods((0.055,), (0.5,), (9.0,)),
        CAMERA,
        times_at(150.0, 145),
        bars=bars,
        spots=[lab.Spot(30.0, 20.0, 5.0)],
    )
    found = lab.track_markers(recording.film, recording.truth[0], [lab.Rod(0, CENTRE, 55.0)])
    after = recording.film.times > 0.86
    assert (found.status[after, 0] == SEEN).all()
    assert errors(recording, found)[after].max() < 0.2
    gap = found.gaps[0]
    assert gap.seconds == pytest.approx(0.75, abs=0.03)
    assert repr(found) == f"Tracks(145 frames, 1 markers seen whole in {(found.status == SEEN).sum()} of them)"


@pytest.mark.parametrize("stays", [True, pytest.param(False, marks=pytest.mark.thorough)])
def test_what_is_found_again_and_stands_is_no_marker(stays: bool) -> None:
    """A disc put on the circle of the rod while the marker is hidden: for good, or until after that comes back."""
    motion = rotating_rods((0.055,), (0.5,), (9.0,))
    hidden = [lab.Bar(0.0, 159.0, 0.0, 159.0, grey=40.0, start=0.2, end=0.6)]
    plain = lab.render_film(motion, CAMERA, times_at(150.0, 145), bars=hidden, rng=1)
    other = CENTRE[0] + 55.0 * np.sin(2.4), CENTRE[1] + 55.0 * np.cos(2.4)
    there = (plain.film.times > 0.4) & (stays | (plain.film.times < 0.65))
    disc = frame_with(other, shape=(160, 160)).astype(np.uint8)
    frames = np.where(there[:, None, None], np.maximum(plain.film.frames, disc), plain.film.frames)
    found = lab.track_markers(lab.film_at_rate(frames, 150.0), plain.truth[0], [lab.Rod(0, CENTRE, 55.0)])
    seen = found.status[:, 0] == SEEN
    assert errors(plain, found)[seen].max() < 0.2
    assert seen[plain.film.times < 0.19].all()
    assert seen[plain.film.times > 0.75].all() == (not stays)
    assert (found.status[there & (plain.film.times > 0.45) & (plain.film.times < 0.6), 0] == LOST).all()


def test_markers_that_cross() -> None:
    """Two links folded over each other: merged, flagged, and distinguished again."""
    motion, look = (
        rotating_rods((0.035, 0.034), (0.3, 0.3), (2.0, 11.0)),
        lab.Look(pivot_marker=True, marker_radius=4.0),
    )
    crossing = lab.render_film(motion, CAMERA, times_at(200.0, 190), look, rng=1)
    close = np.linalg.norm(crossing.truth[:, 0] - crossing.truth[:, 2], axis=1)
    assert close.min() < 4.0
    found = lab.track_markers(crossing.film, crossing.truth[0], (lab.Rod(1, 0, 35.0), lab.Rod(2, 1, 34.0)))
    seen = found.status == SEEN
    assert np.nanmax(errors(crossing, found)) < 0.4
    assert not seen[close < 6.0][:, [0, 2]].any()
    assert seen[close > 12.0].mean() > 0.97


def test_a_marker_that_leaves_the_image() -> None:
    camera = lab.Camera(1000.0, (80.0, 120.0), (160, 160))
    recording = lab.render_film(rotating_rods((0.055,), (2.0,), (6.0,)), camera, times_at(150.0, 145))
    found = lab.track_markers(recording.film, recording.truth[0], [lab.Rod(0, (80.0, 120.0), 55.0)])
    seen = found.status[:, 0] == SEEN
    assert (recording.visible[seen, 0] == 1.0).all()
    assert (~seen).sum() > 20
    assert seen[recording.visible[:, 0] == 1.0].mean() > 0.9
    assert errors(recording, found)[seen].max() < 0.2


def test_a_hidden_pivot_that_moves_vertically() -> None:
    """The report's scheme: the pivot from the end of the rod; with the error that follows from that of the end."""
    motion = rotating_rods((0.055,), (0.4,), (0.5,), swing=0.006)
    look = lab.Look(pivot_marker=True, rod_width=0.0)
    bars = [lab.Bar(60.0, 100.0, 60.0, 100.0, start=0.3, end=0.7)]
    recording = lab.render_film(motion, CAMERA, times_at(200.0, 190), look, bars=bars, rng=2)
    rods, rails = (lab.Rod(1, 0, 55.0),), (lab.Rail(0, 80.0),)
    found = lab.track_markers(recording.film, recording.truth[0], rods, rails)
    hidden = found.status[:, 0] == LOST
    assert hidden.sum() > 70
    filled = lab.place_hidden(found, rods, rails, near=80.0)
    assert (filled.status[hidden, 0] == lab.MarkerStatus.CONSTRAINED).all()
    apart = filled.positions[hidden, 0] - recording.truth[hidden, 0]
    assert np.abs(apart).max() < 0.1
    assert 0.6 < (apart[:, 1] / filled.errors[hidden, 0, 1]).std() < 1.5
    np.testing.assert_array_equal(filled.positions[~hidden], found.positions[~hidden])


def test_a_shaken_pivot_of_a_rod_that_rotates() -> None:
    """Fifty shakes a second at 1000 frames, twice a rotation flat: known points within rounding, or none at all."""
    times = np.arange(1000) / 1000.0
    rows, angles = 40.0 + 4.0 * np.cos(2.0 * pi * 50.0 * times + 1.0), 25.0 * times
    ends = np.stack([60.0 + 50.0 * np.sin(angles), rows + 50.0 * np.cos(angles)], axis=-1)
    ends[300:330] = np.nan
    for near in (38.0, 40.0, 43.0):
        pivots, slopes = lab.pivot_on_rail(ends, 50.0, 60.0, near)
        known = np.isfinite(pivots[:, 1])
        assert known.mean() > 0.9
        assert (known == np.isfinite(slopes)).all()
        assert np.abs(pivots[known, 1] - rows[known]).max() < 1e-9
        assert slopes[known] == pytest.approx(np.tan(angles[known]), abs=1e-9)
    flat = np.abs(np.cos(angles)) < 0.08
    pivots = lab.pivot_on_rail(np.where(flat[:, None], ends, np.nan), 50.0, 60.0, 40.0)[0]
    known = np.isfinite(pivots[:, 1])
    assert known.sum() < 0.5 * flat.sum()
    assert np.abs(pivots[known, 1] - rows[known]).max(initial=0.0) < 1e-9


def test_solutions_that_are_not_sure_are_left_out() -> None:
    ends = [[149.0, 80.0], [135.0, 80.0], [np.nan, 1.0], [112.0, 106.0], [48.0, 122.0]]
    pivots, slopes = lab.pivot_on_rail(ends, length=55.0, column=80.0, near=70.0)
    assert np.isnan(pivots[:3]).all()
    assert pivots[3:, 1] == pytest.approx([106.0 - np.sqrt(55.0**2 - 32.0**2), 122.0 - np.sqrt(55.0**2 - 32.0**2)])
    assert slopes[3] == pytest.approx(32.0 / np.sqrt(55.0**2 - 32.0**2))
