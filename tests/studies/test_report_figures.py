"""Small runs of the studies of the report's figures: the numbers that their docstrings promise."""

import re
from collections.abc import Callable
from math import asin, pi
from pathlib import Path

import numpy as np
import pytest

from cellmap import stroboscopic_map
from cellmap.bifurcations import critical_values
from cellmap.maps import swept_map
from studies import figure_2, figure_3, figure_5, figure_11, figure_13, figure_17, figure_18, figure_19, set_oriented
from studies._dry_friction import resting_bound, turning_angles
from systems import SHORT_ROD, driven_pendulum
from systems.lab import StabilityPoints


def test_limits_of_the_rod(monkeypatch: pytest.MonkeyPatch) -> None:
    """To all digits of tests/REFERENCES.md."""
    monkeypatch.setattr(figure_2, "DAMPINGS", (0.0,))
    result = figure_2.compute(3)
    changes = {state: [(c.value, bool(c.loses)) for c in found] for state, found in result.rod.items()}
    assert changes["hanging"][0] == (pytest.approx(12.210173235e-3, abs=5e-13), True)
    assert changes["inverted"][:2] == [
        (pytest.approx(2.329021135978e-3, abs=5e-16), False),
        (pytest.approx(12.542910208e-3, abs=5e-13), True),
    ]
    assert changes["inverted"][2] == (pytest.approx(0.103, abs=1e-3), False)
    assert len(figure_2.draw(result).axes) >= 3


def test_basins_at_one_amplitude(monkeypatch: pytest.MonkeyPatch) -> None:
    """At 3 mm the inverted state has 7104 of 40,000 cells (tests/REFERENCES.md)."""
    monkeypatch.setattr(figure_19, "AMPLITUDES", (3e-3,))
    monkeypatch.setattr(figure_19, "WINDOWS", (100.0,))
    (panel,) = figure_19.compute(24, 64)
    assert panel.wrong == 0.0
    assert [a.points[0, 0] for a in panel.kept.attractors] == pytest.approx([0.0, -pi])
    assert panel.kept.fractions[1].fraction == pytest.approx(7104 / 40000, abs=0.02)
    assert len(figure_19.draw([panel], 100.0).axes) == 2


def test_a_release_that_matches_the_report() -> None:
    """Without friction, from the amplitude and the angle that the study finds: 0.12 rad at 35 Hz, 0.05 rad at 45 Hz."""
    found = figure_18.Release(3.678185941502e-3, 1.857876614935e-2, 0.0, 0.0)
    assert [found.swing(f) for f in (35.0, 45.0)] == pytest.approx([0.12, 0.05], abs=1e-5)


@pytest.mark.thorough
def test_sets_of_boxes() -> None:
    """Six sets that follow one another give the sixth roots of unity; the resonances of the pendulum attract."""
    eigenvalues = set_oriented.cycle_operator(4).cycle(6).eigenvalues
    assert np.abs(eigenvalues - np.exp(2j * pi * np.arange(6) / 6)).max() < 1e-4
    graph = set_oriented.pendulum_graph(2)
    holders = [[k for k, boxes in enumerate(graph.sets) if boxes.contains(p)] for p in set_oriented.FIXED_POINTS]
    assert sorted(map(tuple, holders)) == [(k,) for k in sorted(graph.sinks)]


def test_models_after_one_period():
    """Two independent programs agree on these states (tests/REFERENCES.md)."""
    result = figure_5.compute(1)
    for name, found in result.items():
        assert found.after == pytest.approx(figure_5.AFTER[name], abs=5e-12)
        assert len(figure_5.draw(found, name).axes) == 6
    assert result["double"].lengths == pytest.approx(0.032)


def test_halts_of_a_harmonic_swing_are_those_of_coulomb_friction():
    """Small swings lose 2 friction l/g from one halt to the next, and end within friction l/g."""
    loss = 2e-6
    friction = loss * 9.8 / (2 * SHORT_ROD)
    found = turning_angles(10.5e-6, friction, SHORT_ROD)
    assert found == pytest.approx(np.array([10.5, -8.5, 6.5, -4.5, 2.5, -0.5]) * 1e-6, rel=1e-6)


def test_bounds_of_rest():
    """Of the rod of figure 19 at 3 mm, with 10 rad/s^2 (tests/REFERENCES.md)."""
    assert resting_bound(10.0, 0.0272, 0.003 * (100 * pi) ** 2) == pytest.approx(0.000889214, abs=5e-10)
    assert resting_bound(2.5, SHORT_ROD) == asin(2.5 * SHORT_ROD / 9.8)


@pytest.mark.thorough
def test_rods_settle_beside_the_vertical():
    result = figure_11.compute(12, 250)
    np.testing.assert_allclose(result.rest, result.by_energy, atol=1e-9)
    assert result.known.bound == pytest.approx(figure_11.KNOWN[0], abs=5e-10)
    assert result.known.cycle == pytest.approx(figure_11.KNOWN[1], abs=5e-9)
    assert np.abs(result.known.ends[~result.known.moving]).max(initial=0.0) <= result.known.bound
    assert len(figure_11.draw(result).axes) == 2


def test_the_short_rod_halts_where_its_energy_says():
    result = figure_13.compute(14.0)
    *dry, viscous = result.values()
    for found in dry:
        np.testing.assert_allclose(found.halts, found.by_energy, atol=2e-6)
        assert (np.diff(found.times) > 0).all()
    assert viscous.motion.states[-1, 1] != 0
    assert len(figure_13.draw(result).axes) == 3


@pytest.mark.thorough
def test_what_figure_3_computes(capsys: pytest.CaptureFixture[str]) -> None:
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
def test_what_figure_17_prints(quick_run: Callable[..., str]) -> None:
    said = quick_run(figure_17, "figure_17.png", "figure_17_map.png")
    (chance,) = re.findall(r"chi-square [\d.]+ of \d+, p = ([\d.]+)", said)
    assert float(chance) > 1e-3
    (more,) = re.findall(r"by averaging: \+([\d.]+) %", said)
    assert float(more) == pytest.approx(100 * 0.05**2 / 4, rel=1e-3)  # to second order in the angle
    for ratio in re.findall(r"long over short rod at 40 Hz ([\d.]+)", said):
        assert float(ratio) == pytest.approx((6.9 / 3.1) ** 0.5, rel=2e-3)
