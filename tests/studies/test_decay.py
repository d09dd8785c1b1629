"""The study of decays: rods with the parabola of the report."""

from __future__ import annotations

import re
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import trajectory
from studies import decay
from systems import LONG_ROD
from systems.lab import free_pendulum, quadratic_decay, swing_envelope

mpl.use("Agg")


@pytest.mark.parametrize("film", [4.0, 8.0])
def test_a_simulated_rod_has_the_parabola_of_the_report(film: float) -> None:
    """Averaging and extremes are two ways; they agree to a small part of the report's own intervals."""
    rod = decay.with_parabola(film)
    system = free_pendulum(LONG_ROD, rod.coefficients)
    motion = trajectory(system, [rod.amplitude, 0.0], round(film / system.length), 105)
    found = quadratic_decay(swing_envelope(motion.times, motion.states[:, 0]), start_time=0.0)
    assert (np.abs(found.coefficients - decay.REPORT) < 0.5 * decay.INTERVALS).all()


@pytest.mark.slow
def test_fits_hold_the_truth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    decay.main(quick=True, output=tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["decay.png"]
    said = capsys.readouterr().out
    (true,) = re.findall(r"true: damping ([\d.]+), friction ([\d.]+), length ([\d.]+)", said)
    fits = re.findall(
        r"viscous and dry: MotionFit\(length ([\d.]+) \+- ([\d.e-]+), damping ([\d.]+) \+- ([\d.]+), "
        r"friction ([\d.]+) \+- ([\d.]+)",
        said,
    )
    assert fits
    for length, d_length, damping, d_damping, friction, d_friction in (map(float, fit) for fit in fits):
        assert abs(damping - float(true[0])) < 4.0 * d_damping
        assert abs(friction - float(true[1])) < 4.0 * d_friction
        assert abs(length - float(true[2])) < 4.0 * d_length
