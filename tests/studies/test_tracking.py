"""The study of tracking: nothing is mistaken, and centres are as good as it says."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import trajectory
from studies import tracking
from systems.lab import Bar, Camera, Look, Rod, free_pendulum

mpl.use("Agg")


def test_a_short_film_of_a_rod(capsys: pytest.CaptureFixture[str]) -> None:
    """Past the bar, beside a bright object, with dropped frames; true centres are known."""
    system = free_pendulum(0.069, {"damping": 0.4})
    motion = trajectory(system, [2.4, 0.0], 1, samples_per_period=120)
    camera = Camera(scale=450.0, origin=(43.0, 37.0), shape=(86, 86))
    rods, bars = [Rod(0, camera.origin, 0.069 * camera.scale)], [Bar(30.0, 36.0, 0.0, 85.0)]
    case = tracking.film_and_track(motion, camera, 200.0, 0.002, 0.4, Look(), bars, rods, 1, 1)
    tracking.report(case)
    assert "taken for another: 0 (expected 0); hidden in part and not flagged: 0" in capsys.readouterr().out
    assert (case.recording.visible < 0.5).any()
    assert tracking.rms(case.errors) < 0.1
    assert tracking.rms(tracking.angle_errors(case) / case.angles.errors) == pytest.approx(1.0, abs=0.4)
    assert len(tracking.draw([case, case]).axes) == 6


@pytest.mark.slow
def test_it_runs_quickly(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tracking.main(quick=True, output=tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["tracking.png"]
    assert "taken for another: 0 (expected 0); hidden in part and not flagged: 0" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3])
def test_nothing_is_mistaken(seed: int) -> None:
    for case in tracking.compute(quick=True, seed=seed):
        assert case.wrong == 0
        assert case.overlooked == 0
        plain = np.linalg.norm(case.plain.positions - case.recording.truth, axis=-1)
        assert tracking.rms(case.errors) < 0.1
        assert tracking.rms(plain) > 1.3 * tracking.rms(case.errors)
