"""The study of decays: rods with the parabola of the report."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import trajectory
from studies import decay
from systems import LONG_ROD
from systems.lab import free_pendulum, quadratic_decay, swing_envelope

mpl.use("Agg")


@pytest.mark.slow
@pytest.mark.parametrize("film", [4.0, 8.0])
def test_a_simulated_rod_has_the_parabola_of_the_report(film: float) -> None:
    """Averaging and extremes are two ways; they agree to a small part of the report's own intervals."""
    rod = decay.with_parabola(film)
    system = free_pendulum(LONG_ROD, rod.coefficients)
    motion = trajectory(system, [rod.amplitude, 0.0], round(film / system.length), 105)
    found = quadratic_decay(swing_envelope(motion.times, motion.states[:, 0]), start_time=0.0)
    assert (np.abs(found.coefficients - decay.REPORT) < 0.5 * decay.INTERVALS).all()


@pytest.mark.slow
def test_it_runs_quickly(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    decay.main(quick=True, output=tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["decay.png"]
    assert "length 2 of 2, damping 2 of 2, friction 2 of 2" in capsys.readouterr().out
