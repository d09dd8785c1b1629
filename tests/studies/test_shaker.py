"""The study of recovered drives: its truths, what is carried over to stability, and a quick run."""

from __future__ import annotations

import re
from math import pi
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from studies import shaker
from systems.lab import pivot_acceleration, record_acceleration, recover_drive

mpl.use("Agg")


@pytest.mark.parametrize("drive", [shaker.SINE, shaker.TWO, shaker.TRIANGLE])
def test_true_harmonics_are_those_of_the_drive(drive: shaker.Effect) -> None:
    """By Fourier sums over one period; 4,096 samples of a triangle alias its far harmonics at 1e-6 of the first."""
    frequency, n = drive.parameters["frequency"], 4096
    factors = np.fft.rfft(pivot_acceleration(drive, np.arange(n) / (n * frequency)))[1:8] * 2.0 / n
    order = np.arange(1, 8)
    amplitudes, phases = shaker.true_harmonics(drive, 7)
    there = np.isfinite(phases)
    expected = -amplitudes * (2.0 * pi * frequency * order) ** 2 * np.exp(1j * np.where(there, phases, 0.0))
    np.testing.assert_allclose(factors, expected, atol=1e-5 * np.abs(factors).max())


def test_an_error_is_carried_over_to_the_critical_amplitude() -> None:
    found = recover_drive(shaker.EVEN, record_acceleration(shaker.TWO, shaker.EVEN, 5.0, rng=1))
    true = shaker.critical_amplitude(np.array(shaker.TWO.amplitudes), np.array(shaker.TWO.phases), shaker.TWO.frequency)
    value, error = shaker.carried_over(found)
    assert abs(value - true) < 3.5 * error
    # Averaging has the mean square of the velocity: A1^2 + (2 A2)^2 = 2 g l/w^2; damping and the drive's size matter.
    w = 2.0 * pi * shaker.TWO.frequency
    averaged = np.sqrt(2.0 * shaker.GRAVITY * shaker.ROD / w**2 - (2.0 * shaker.TWO.amplitudes[1]) ** 2)
    assert true == pytest.approx(averaged, rel=0.02)


@pytest.mark.slow
def test_what_must_come_out_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shaker.main(quick=True, output=tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["shaker.png"]
    said = capsys.readouterr().out
    rows = re.findall(
        r"^  (white|uneven times|coloured|coloured, taken for white) +([\d., ]+) % of 60", said, re.MULTILINE
    )
    covered = {name: [float(v) for v in values.split(",")] for name, values in rows}
    for name in ("white", "uneven times", "coloured"):  # of 60 at 95 %, 50 or fewer have a chance of 0.0003
        assert min(covered[name]) > 100 * 50 / 60
    assert min(covered["coloured, taken for white"]) < 100 * 50 / 60
    off = [float(v) for v in re.findall(r"off by ([-+\d.]+) errors", said)]
    assert len(off) >= 2
    assert max(map(abs, off)) < 3.0
