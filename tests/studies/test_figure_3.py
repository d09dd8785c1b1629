"""The study of effective potentials prints what it must reproduce."""

from __future__ import annotations

import re
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from studies import figure_3

mpl.use("Agg")


def test_what_it_computes(capsys: pytest.CaptureFixture[str]) -> None:
    result = figure_3.compute(np.array([0.003, 0.004]), np.array([0.0, 0.5]))
    printed = capsys.readouterr().out
    assert "theta_c at 3 mm: 0.927068123 rad, and published 0.927068123" in printed
    assert "theta_c at 4 mm: 1.226427972 rad, and published 1.226427972" in printed
    angles = np.linspace(-3.0, 3.0, 50)
    for potential in result.potentials.values():
        expected = figure_3.kapitza_potential(potential.system, angles)
        assert potential(angles) == pytest.approx(expected, abs=1e-13)
    for release in result.releases:
        assert release.formula == pytest.approx(release.well.critical_angle, abs=1e-12)
        # The pendulum and its drive are their own mirror images.
        assert release.limits.lower == pytest.approx(release.limits.upper, abs=1e-8)


@pytest.mark.slow
def test_what_must_come_out_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figure_3.main(quick=True, output=tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["figure_3.png"]
    said = capsys.readouterr().out
    angles = re.findall(r"theta_c at . mm: ([\d.]+) rad", said)
    assert [float(a) for a in angles] == pytest.approx([0.927068123, 1.226427972], abs=1e-9)
    (difference,) = re.findall(r"Kapitza's formula: ([-+\d.e]+) m", said)
    assert float(difference) < 1e-12
