"""The study of least amplitudes: by multipliers, by release, and as measured."""

from __future__ import annotations

import re
from math import pi
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import stroboscopic_map
from cellmap.bifurcations import critical_values
from cellmap.maps import swept_map
from studies import figure_17
from systems import SHORT_ROD, driven_pendulum
from systems.lab import StabilityPoints

mpl.use("Agg")


@pytest.mark.slow
def test_a_release_needs_what_averaging_says_beyond_the_multipliers() -> None:
    """At A/l = 0.13 and given 2,000 cycles; averaging and damping leave a tenth of the 0.0625 % open."""
    system = driven_pendulum(length=SHORT_ROD, damping=2.5)
    strobe = swept_map(stroboscopic_map(system), "amplitude", "frequency")
    frequency, scale = np.array([30.0]), np.array([0.004135307])
    (released,) = figure_17.least_kept(strobe, frequency, scale, 2000)
    found = critical_values(system.with_params(frequency=30.0), (pi, 0.0), "amplitude", 0.003, 0.006)
    assert released / found[0].value - 1.0 == pytest.approx(figure_17.FINITE_ANGLE, rel=0.1)
    edges = np.array([[0.999999], [1.000001]]) * released
    assert figure_17.stays_up(strobe, edges, frequency, 2000).ravel().tolist() == [False, True]


def test_full_rotations_are_falls_and_the_branch_cut_is_none() -> None:
    """At 3 Hz and 73 mm the state at rest on the branch cut is stable; without much drive the rod falls."""
    strobe = swept_map(stroboscopic_map(driven_pendulum(length=0.069, damping=2.5)), "amplitude", "frequency")
    amplitudes = np.linspace(0.0721, 0.0748, 20)[:, None]
    assert figure_17.stays_up(strobe, amplitudes, np.array([3.0]), 400).all()
    assert not figure_17.stays_up(strobe, 0.5 * amplitudes, np.array([3.0]), 400).any()


def test_measured_points(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    assert figure_17.measured(path) is None
    path.write_text("frequency_hz,amplitude_mm\n15,12.5\n35,5.25\n", encoding="utf-8")
    points = figure_17.measured(path)
    assert points is not None
    assert points.table == pytest.approx(np.array([[15.0, 12.5e-3], [35.0, 5.25e-3]]), rel=1e-15)
    assert (points.rod, points.amplitude_errors) == ("3.1 cm", None)
    path.write_text("frequency_hz,amplitude_mm\n15,\n", encoding="utf-8")
    with pytest.raises(ValueError, match="give positive numbers alone"):
        figure_17.measured(path)
    path.write_text("f,A\n15,3\n", encoding="utf-8")
    with pytest.raises(ValueError, match="its heading must be frequency_hz,amplitude_mm"):
        figure_17.measured(path)


def curve(rod: str, friction: str) -> figure_17.Curve:
    """A curve from 20 to 30 Hz; a comparison works out its own amplitudes within it."""
    frequencies = np.array([20.0, 30.0])
    return figure_17.Curve(
        rod, friction, frequencies, np.array([6e-3, 4e-3]), dict.fromkeys((50, 200), np.array([6e-3, 4e-3]))
    )


def test_measured_points_are_compared_where_the_curve_reaches(capsys: pytest.CaptureFixture[str]) -> None:
    """At 25 Hz against the limit by multipliers; 35 Hz is beyond the curve."""
    system = driven_pendulum(length=SHORT_ROD, damping=2.5, frequency=25.0)
    (limit, *_) = critical_values(system, (pi, 0.0), "amplitude", 0.004, 0.006)
    points = StabilityPoints(np.array([25.0, 35.0]), np.array([1.01 * limit.value, 3e-3]), np.full(2, 5e-5), "3.1 cm")
    found = figure_17.compare([curve("6.9 cm", "viscous"), curve("3.1 cm", "viscous")], points, "made")
    assert found is not None
    assert found.ratios == pytest.approx([1.01, np.nan], rel=1e-11, nan_ok=True)
    assert found.chi_square == pytest.approx((0.01 * limit.value / 5e-5) ** 2, rel=1e-9)
    assert "made points against multipliers" in capsys.readouterr().out
    far = StabilityPoints(np.array([35.0]), np.array([3e-3]), None, "3.1 cm")
    assert figure_17.compare([curve("3.1 cm", "viscous")], far, "made") is None


def test_dots_lie_over_the_curve_of_their_rod() -> None:
    curves = [curve(rod, friction) for rod in figure_17.RODS for friction in figure_17.FRICTIONS]
    points = StabilityPoints(np.array([25.0]), np.array([5e-3]), np.array([5e-5]), "3.1 cm")
    figure = figure_17.draw(curves, {"made": points}, {"made": None})
    long, short = figure.axes[:2]
    assert not long.containers
    (dots,) = short.containers
    assert dots[0].get_xydata().tolist() == [[25.0, 5.0]]
    assert dots[0].get_markerfacecolor() == "white"
    np.testing.assert_allclose(dots[2][0].get_segments(), [[[25.0, 4.95], [25.0, 5.05]]])


@pytest.mark.slow
def test_what_must_come_out_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figure_17.main(quick=True, output=tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["figure_17.png", "figure_17_map.png"]
    said = capsys.readouterr().out
    (chance,) = re.findall(r"chi-square [\d.]+ of \d+, p = ([\d.]+)", said)
    assert float(chance) > 1e-3
    (more,) = re.findall(r"by averaging: \+([\d.]+) %", said)
    assert float(more) == pytest.approx(100 * 0.05**2 / 4, rel=1e-3)  # to second order in the angle
    for ratio in re.findall(r"long over short rod at 40 Hz ([\d.]+)", said):
        assert float(ratio) == pytest.approx((6.9 / 3.1) ** 0.5, rel=2e-3)
