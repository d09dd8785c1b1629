"""Films that cannot be tracked, and frames that are missing, constant or repeated."""

from typing import Any

import numpy as np
import pytest
from filmed_markers import CENTRE, LOST, SEEN, frame_with

from systems.lab import Film, MarkerStatus, Rail, Rod, film_at_rate, track_markers


def filmed(*frames: Any) -> Film:
    return film_at_rate(np.rint(np.array(frames)).astype(np.uint8), 100.0)


@pytest.mark.parametrize(
    ("initial_angles", "options", "error"),
    [
        ([(70, 60)], {}, "nothing bright stands out"),
        ([(70, 60)], {"threshold": 35.0}, "all pixels at the initial positions exceed it"),
        ([(30, 30)], {"threshold": 250.0}, "no pixel at the initial positions exceeds it"),
        ([(41, 30)], {}, "no marker is above the grey value"),
        ([(30, 300)], {}, r"positions\[0\]=\(30, 300\): give a pixel \(column, row\) in the image of 100 x 80"),
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
def test_what_cannot_be_tracked(initial_angles: Any, options: Any, error: str) -> None:
    frame = frame_with((30.0, 30.0), (97.0, 30.0), (57.0, 30.0), (66.0, 30.0))
    frame += np.random.default_rng(1).normal(0.0, 1.0, frame.shape)
    with pytest.raises((TypeError, ValueError), match=error):
        track_markers(filmed(frame, frame), initial_angles, **options)


def test_films_without_light_or_frames() -> None:
    flat = np.full((80, 100), 40.0)
    with pytest.raises(ValueError, match="all pixels of the first windows are 40"):
        track_markers(filmed(flat, flat), [(30, 30)])
    noise = np.random.default_rng(0).normal(100.0, 5.0, (2, 80, 100))
    with pytest.raises(ValueError, match="nothing bright stands out"):
        track_markers(filmed(*noise), [(30, 30)])
    dark = 255.0 - frame_with((50.0, 40.0), radius=8.0)
    for frame, message in ((dark, "no marker is above"), (dark + 0.4 * (noise[0] - 100.0), "it is dark there")):
        with pytest.raises(ValueError, match=rf"{message}.*of dark markers,? the negative of the film"):
            track_markers(filmed(frame), [(50, 40)], search_radius=25.0)
    faint = np.where(frame_with((50.0, 40.0)) > 120.0, 86.0, 85.0)
    with pytest.raises(ValueError, match=r"nothing bright stands out there \(by 3.5 deviations"):
        track_markers(filmed(faint), [(50, 40)])
    with pytest.raises(ValueError, match="for markers filling the surroundings, a larger search_radius="):
        track_markers(filmed(frame_with((50.0, 40.0), radius=14.0)), [(50, 40)])
    with pytest.raises(ValueError, match="all frames are missing"):
        track_markers(film_at_rate(np.full((2, 80, 100), np.nan), 10.0), [(30, 30)])
    with pytest.raises(TypeError, match="give Rod"):
        track_markers(filmed(frame_with((30.0, 30.0))), [(30, 30)], rods=[3])  # type: ignore[list-item]


def test_frames_that_repeat_the_one_before_are_missing() -> None:
    """A recorder that fills in for lost frames: the truth is elsewhere, by 6 pixels at most, and nothing else tells."""
    rng = np.random.default_rng(3)
    times = np.arange(120) / 100.0
    truth = np.stack([50.0 + 30.0 * np.sin(6.0 * times), 40.0 + 10.0 * np.cos(6.0 * times)], axis=-1)
    frames = [frame_with(tuple(place)) + rng.normal(0.0, 2.0, (80, 100)) for place in truth.tolist()]
    repeated = [7, 20, 21, 60, 90]
    for k in repeated:
        frames[k] = frames[k - 1]
    found = track_markers(filmed(*frames), truth[:1])
    assert np.flatnonzero(found.status[:, 0] == MarkerStatus.NO_FRAME).tolist() == repeated
    assert np.nanmax(np.abs(found.positions[:, 0] - truth)) < 0.1
    assert np.nanmax(found.errors) < 0.02


def test_a_marker_that_stands_is_seen_in_equal_frames() -> None:
    """Without noise, frames repeat as long as nothing moves; before and after it moves by 3 pixels a frame."""
    frames = [frame_with((30.0 + 3.0 * min(k, 5) + 3.0 * max(k - 8, 0), 30.0)) for k in range(14)]
    found = track_markers(filmed(*frames[:9]), [(30, 30)])
    assert (found.status == SEEN).all()


def test_missing_and_constant_frames_are_gaps() -> None:
    """NaN frames and flagged ones have no frame; in a constant one the marker is lost."""
    frames = np.array([frame_with((30.0 + k, 30.0)) for k in range(8)])
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
