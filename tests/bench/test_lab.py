"""The laboratory: drives from long records, and markers through films."""

from __future__ import annotations

import numpy as np
import pytest
from peers import best_times

import systems
from cellmap import trajectory
from systems import VerticalDrive
from systems.lab import Camera, film_at_rate, record_acceleration, recover_drive, render_film, track_markers


@pytest.mark.usefixtures("one_thread")
def test_drive_from_a_million_samples(say):
    """Against one fast Fourier transform of the record, which gives a peak to the width of a bin and no error."""
    times = np.arange(1_000_000) / 20_000.0
    record = record_acceleration(VerticalDrive(0.003, 47.37, 3.1), times, 30.0, offset=9.8)
    ours, transform = best_times([lambda: recover_drive(times, record), lambda: np.fft.rfft(record)], rounds=3)
    say(f"drive from a million samples: {ours:.2f} s, {ours / transform:.0f} times one transform")


@pytest.mark.usefixtures("one_thread")
def test_markers_through_a_film(say):
    """Against one threshold of all pixels, the least that any tracker of whole frames must do."""
    exact = systems.double_pendulum(amplitude=0.002)
    motion = trajectory(exact, [1.0, 2.0, 0.0, 0.0], periods=60, samples_per_period=60)
    camera = Camera(scale=1500.0, origin=(128.0, 128.0), shape=(256, 256))
    film = render_film(motion, camera, np.linspace(0.0, 0.98 * motion.times[-1], 500)).film
    film = film_at_rate(film.frames, 500.0)
    initial_conditions = render_film(motion, camera, [0.0]).truth[0]
    ours, threshold = best_times([lambda: track_markers(film, initial_conditions), lambda: film.frames > 128], rounds=3)
    say(f"two markers through 500 frames of 256 x 256: {ours:.2f} s, {ours / threshold:.0f} times one threshold of all")
