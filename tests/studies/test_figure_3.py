"""The study of effective potentials prints what it must reproduce."""

from __future__ import annotations

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
def test_it_runs_quickly(tmp_path: Path) -> None:
    figure_3.main(quick=True, output=tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["figure_3.png"]
