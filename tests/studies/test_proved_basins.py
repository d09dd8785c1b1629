"""The study of proved basins: a small case, and the numbers that it prints."""

from __future__ import annotations

import re
from math import pi
from pathlib import Path

import matplotlib as mpl
import pytest

from studies import proved_basins

mpl.use("Agg")


def test_what_must_come_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    compute = proved_basins.compute
    monkeypatch.setattr(proved_basins, "compute", lambda amplitudes, cells, table: compute(amplitudes, 100, 128))
    proved_basins.main(quick=True, output=tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["proved_basins.png"]
    said = capsys.readouterr().out
    assert float(re.findall(r"([\d.]+) % of the window proved", said)[0]) > 70.0
    areas = [float(a) for a in re.findall(r"at least ([\d.]+) rad", said)]
    assert len(areas) == 2 and 0.7 * 400 * pi < sum(areas) <= 400 * pi
    assert "0 proved labels differ" in said
    assert float(re.findall(r"from 3 to 3.1 mm: stable, within (\S+) of", said)[0]) < 1e-5
