"""The study of tracking: nothing is mistaken, and centres are as good as it says."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from studies import tracking

mpl.use("Agg")


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
