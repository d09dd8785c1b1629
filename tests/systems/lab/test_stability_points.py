"""Measured points of a stability curve: files, volts, comparison with known curves, and the experiment on a model."""

from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from cellmap import stroboscopic_map
from cellmap.bifurcations import critical_values
from cellmap.maps import swept_map
from systems import SHORT_ROD, driven_pendulum, lab
from systems.synthetic.stability_experiment import stays_up

POINTS = lab.StabilityPoints(
    np.array([15.0, 25.0, 35.0]), np.array([8.25e-3, 4.95e-3, 3.5e-3]), np.full(3, 5e-5), "short"
)


def limits(frequencies: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least amplitudes of the short rod with viscous damping 2.5 /s, by multipliers (m)."""
    system = driven_pendulum(length=SHORT_ROD, damping=2.5)
    scale = np.sqrt(2.0 * 9.8 * SHORT_ROD) / (2.0 * pi * frequencies)
    found = [
        critical_values(system.with_params(frequency=f), (pi, 0.0), "amplitude", 0.9 * a, 1.5 * a, n_points=64)
        for f, a in zip(frequencies, scale, strict=True)
    ]
    return np.array([next(c.value for c in each if c.gains) for each in found])


@pytest.mark.parametrize("errors", [None, np.array([5e-5, 1 / 3e5, 1e-7])])
def test_points_come_back_from_a_file(tmp_path: Path, errors: Any) -> None:
    written = lab.StabilityPoints(np.array([15.0, 35.0, 20.123456]), np.array([8.25e-3, 1 / 300, 6e-3]), errors)
    lab.write_stability_points(written, tmp_path / "points.csv")
    read = lab.read_stability_points(tmp_path / "points.csv", rod="short")
    np.testing.assert_allclose(read.table, written.table, rtol=1e-9)
    assert (read.rod, read.table.shape) == ("short", (3, 2 if errors is None else 3))


def test_a_table_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("\ufefffrequency_hz, amplitude_mm\r\n15, 12.5\r\n\r\n35,5.25\r\n", encoding="utf-8")
    assert lab.read_stability_points(path).table == pytest.approx(
        np.array([[15.0, 12.5e-3], [35.0, 5.25e-3]]), rel=1e-15
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("f,A\n15,3\n", "its heading must be frequency_hz,amplitude_mm"),
        ("", "its heading must be"),
        ("frequency_hz,amplitude_mm\n", "give positive numbers alone"),
        ("frequency_hz,amplitude_mm\n15,\n", "give positive numbers alone"),
        ("frequency_hz,amplitude_mm\n15,-3\n", "give positive numbers alone"),
        ("frequency_hz,amplitude_mm\n15,nan\n", "give positive numbers alone"),
        ("frequency_hz,amplitude_mm\n15,3,0.1\n", "in rows of 2"),
        ("frequency_hz,amplitude_mm,amplitude_error_mm\n15,3\n", "in rows of 3"),
        ("frequency_hz,amplitude_mm\n15,3\n16\n", "in rows of 2"),
        ("frequency_hz,amplitude_mm,amplitude_error_mm\n15,3,0\n", "give positive numbers alone"),
    ],
)
def test_bad_tables_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "points.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        lab.read_stability_points(path)


def test_a_table_of_another_encoding_is_named(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("frequency_hz,amplitude_mm\n15,3\n", encoding="utf-16")
    with pytest.raises(ValueError, match=r"points\.csv: it is no text in UTF-8"):
        lab.read_stability_points(path)


def test_points_from_volts_are_those_of_the_report() -> None:
    points = lab.stability_points_from_volts([15.0, 35.0], [1.5, 3.5], volts_error=[0.03, 0.07], rod="short")
    expected = [9.8 * v / 2 * 10 / (2 * pi * f) ** 2 for f, v in ((15.0, 1.5), (35.0, 3.5))]
    assert points.amplitudes == pytest.approx(expected, rel=1e-14)
    assert points.amplitude_errors == pytest.approx(0.02 * np.array(expected), rel=1e-14)
    assert lab.stability_points_from_volts([15.0], [1.5]).amplitude_errors is None


def test_a_power_law_is_met_between_its_nodes() -> None:
    """A curve in proportion to 1/f, which is exact from node to node."""
    found = lab.compare_with_boundary(POINTS, [40.0, 20.0, 10.0], np.array([3.0, 6.0, 12.0]) * 1e-3)
    expected = 0.12 / POINTS.frequencies
    assert found.expected == pytest.approx(expected, rel=1e-13)
    assert found.residuals == pytest.approx(POINTS.amplitudes - expected, rel=1e-9)
    assert found.ratios == pytest.approx(POINTS.amplitudes / expected, rel=1e-12)
    assert found.rms == pytest.approx(np.sqrt(np.mean((POINTS.amplitudes - expected) ** 2)), rel=1e-9)
    assert found.chi_square == pytest.approx(np.sum(((POINTS.amplitudes - expected) / 5e-5) ** 2), rel=1e-9)
    assert found.p_value == pytest.approx(stats.chi2.sf(found.chi_square, 3), rel=1e-12)


def test_points_without_a_curve_are_left_out() -> None:
    """Beyond its ends, and beside a gap."""
    curve = np.array([np.nan, 6.0, 3.0]) * 1e-3
    found = lab.compare_with_boundary(POINTS, [10.0, 20.0, 30.0], curve)
    assert np.isfinite(found.expected).tolist() == [False, True, False]
    assert found.compared == 1
    assert found.chi_square == pytest.approx((found.residuals[1] / 5e-5) ** 2)
    nowhere = lab.compare_with_boundary(POINTS, [1.0, 2.0], [1.0, 1.0])
    assert nowhere.compared == 0
    assert np.isnan([nowhere.rms, nowhere.chi_square, nowhere.p_value]).all()
    bare = lab.compare_with_boundary(
        lab.StabilityPoints(POINTS.frequencies, POINTS.amplitudes), [10.0, 40.0], [0.012, 0.003]
    )
    assert np.isnan(bare.chi_square) and np.isfinite(bare.rms)


@pytest.mark.thorough
def test_measured_points_lie_on_the_curve() -> None:
    """Steps of 2 %; a release from 0.05 rad needs 0.0625 % more, a ninth of an error."""
    frequencies = np.array([15.0, 22.0, 28.0, 35.0])
    scale = np.sqrt(2.0 * 9.8 * SHORT_ROD) / (2.0 * pi * frequencies)
    system = driven_pendulum(length=SHORT_ROD, damping=2.5)
    points = lab.measure_least_amplitudes(
        system, frequencies, 0.9 * scale, 1.3 * scale, step=0.02, cycles=400, noise=1.0, rng=3, rod="short"
    )
    found = lab.compare_with_boundary(points, frequencies, limits(frequencies))
    assert points.amplitude_errors is not None
    # Half of a step to either side, if nothing else.
    assert np.abs(found.ratios - 1.0).max() < 0.0115
    np.testing.assert_allclose(points.amplitude_errors / points.amplitudes, 0.02 / np.sqrt(12.0), rtol=0.05)
    assert found.p_value > 0.01
    again = lab.measure_least_amplitudes(
        system, frequencies, 0.9 * scale, 1.3 * scale, step=0.02, cycles=400, noise=1.0, rng=3, rod="short"
    )
    assert (again.table == points.table).all()


def test_releases_stay_or_fall() -> None:
    strobe = swept_map(stroboscopic_map(driven_pendulum(length=SHORT_ROD, damping=2.5)), "amplitude", "frequency")
    (limit,) = limits(np.array([25.0]))
    held = stays_up(strobe, np.array([0.95, 1.05]) * limit, 25.0, 400)
    assert held.tolist() == [False, True]
    # From a wider angle more is needed: cos(0.5)^-0.5 is 1.067 by averaging.
    assert stays_up(strobe, np.array([1.05, 1.1]) * limit, 25.0, 400, release=0.5).tolist() == [False, True]


@pytest.mark.parametrize(
    ("lower", "upper", "more", "message"),
    [
        (0.006, 0.007, {}, "lower=0.006: at 25 Hz this amplitude holds the rod already"),
        (0.002, 0.003, {}, "upper=0.003: at 25 Hz no amplitude up to this one holds the rod"),
        (0.006, 0.005, {}, "upper above lower"),
        (0.004, 0.006, {"step": 0.0}, "step=0.0: give a number above 0"),
        (0.004, 0.006, {"step": 1e-6}, "steps from lower to upper; give a larger one"),
        (0.004, 0.006, {"cycles": 0}, "cycles=0"),
    ],
)
def test_bad_experiments_are_refused(lower: float, upper: float, more: dict[str, Any], message: str) -> None:
    system = driven_pendulum(length=SHORT_ROD, damping=2.5)
    with pytest.raises(ValueError, match=message):
        lab.measure_least_amplitudes(system, [25.0], lower, upper, **{"step": 0.05, "cycles": 200, **more})
