"""The study of basin stability: the published fraction, the published onset, and both ends."""

from __future__ import annotations

from math import pi
from pathlib import Path

import matplotlib as mpl
import pytest

from studies import basin_stability

mpl.use("Agg")


def test_it_reproduces_what_is_published(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """0.152 (Stender, Hoffmann 2022); a running solution from 4/pi damping on (Levi, Hoppensteadt, Miranker 1978)."""
    basin_stability.main(True, tmp_path)
    assert (tmp_path / "basin_stability.png").exists()
    told = capsys.readouterr().out.splitlines()
    rows = {line.split()[0]: line.split() for line in told[1:6]}
    assert float(rows["0.50"][1]) == pytest.approx(0.152, abs=3 * float(rows["0.50"][3]))
    assert rows["0.10"][1] == "1.0000"
    assert {row[4] for row in rows.values()} == {"-0.0500"}


def test_the_running_solution_appears_at_the_published_power() -> None:
    low, high = basin_stability.onset_of_running(6, periods=500)
    assert low < high
    assert 0.5 * (low + high) == pytest.approx(4.0 * 0.1 / pi, rel=0.02)
