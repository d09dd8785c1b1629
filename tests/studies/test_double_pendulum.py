"""Studies of pendulums with several links and of the report's swings: the numbers that their docstrings promise."""

from __future__ import annotations

import re
from math import nan, pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cellmap import load_basins, stroboscopic_map
from studies import _chains, double_stability, figure_20, flipping_basins, triple_stability


@pytest.mark.parametrize("ratio", [0.25, 1.0, 4.0])
def test_modes_of_equal_links(ratio: float) -> None:
    """Two links of length l, r = 1 + m2/m1: (r +- sqrt(r^2 - r))/l where both hang, +- sqrt(r)/l where one does."""
    length, r = 0.032, 1.0 + ratio
    expected = {
        "(0, 0)": [(r - sqrt(r * r - r)) / length, (r + sqrt(r * r - r)) / length],
        "(0, π)": [-sqrt(r) / length, sqrt(r) / length],
        "(π, 0)": [-sqrt(r) / length, sqrt(r) / length],
        "(π, π)": [-(r + sqrt(r * r - r)) / length, -(r - sqrt(r * r - r)) / length],
    }
    for name, state in _chains.equilibria(2).items():
        values, shapes = _chains.normal_modes((length, length), (1.0, ratio), state)
        assert values == pytest.approx(expected[name], rel=1e-12)
        # Both links move in every mode: the states do not separate.
        assert np.abs(shapes).min() > 0.1 * np.abs(shapes).max()


def test_intervals() -> None:
    assert _chains.intervals([], True, 1.0) == ((0.0, 1.0),)
    assert _chains.intervals([], False, 1.0) == ()
    changes = [(0.7, 0), (0.2, 2), (0.5, 0), (0.6, 1)]
    assert _chains.intervals(changes, True, 1.0) == ((0.0, 0.2), (0.5, 0.6), (0.7, 1.0))
    assert _chains.overlap([(0.0, 2.0), (1.0, 3.0)]) == (1.0, 2.0)
    assert _chains.text_of((nan, nan)) == _chains.text_of((2.0, 1.0)) == "none"


def test_the_hanging_double_pendulum() -> None:
    """Its limit at 24 Hz to all digits of tests/REFERENCES.md, and the axes on which it is drawn."""
    system, state = double_stability.pendulum(1.0, 24.0), double_stability.STATES["(0, 0)"]
    ((window, lost),) = double_stability.stable_windows(system, state, 0.004)
    assert window == (0.0, pytest.approx(3.523140841e-3, abs=5e-13))
    assert lost == "MINUS_ONE"
    amplitude = ("amplitude", np.linspace(1e-4, 0.006, 3))
    maps = {
        name: _chains.stability_maps(system, {"(0, 0)": state}, (name, np.array(x)), amplitude)
        for name, x in (
            ("frequency", [20.0, 24.0, 28.0]),
            ("mass_2", [0.1, 0.5, 1.0]),
            ("length_2", [0.01, 0.02, 0.03]),
        )
    }
    found = maps["frequency"]["(0, 0)"]
    assert (found.unstable[:, 1] == 0).tolist() == [True, True, False]
    titles = dict(zip("abcdef", [*maps.values(), *maps.values()], strict=True))
    figure = double_stability.draw(double_stability.Result({}, {}, {}, {}, {}, titles))
    assert [ax.get_title() for ax in figure.axes[:6]] == ["a", "c", "e", "b", "d", "f"]
    assert [ax.get_xscale() for ax in figure.axes[:6]] == ["linear", "linear", "log", "log", "linear", "linear"]


def test_pushes_and_distances() -> None:
    initial_conditions = figure_20.pushed("outer", np.array([0.0, 3.0]))
    assert initial_conditions.tolist() == [[pi, 0.0, 0.0, 0.0], [pi, 0.0, 0.0, 3.0]]
    rotated = initial_conditions + np.array([2.0 * pi, -4.0 * pi, 7.0, 0.0])
    assert figure_20.distance(rotated, figure_20.UP_DOWN) == pytest.approx([0.0, 0.0], abs=1e-14)
    assert figure_20.distance(rotated, figure_20.DOWN_UP) == pytest.approx([pi, pi])


@pytest.mark.thorough
def test_pushes_that_return_and_that_flip() -> None:
    """SciPy flips the pendulum by the push that the scan calls the quickest, and keeps it there from then on.

    A push is followed by a chaotic transient: errors of 1e-13 are 1e-6 after 32 periods, by DOP853 and by series, so
    that it depends on rounding which of the flipped pendulums are not at rest yet.
    """
    point_map = stroboscopic_map(figure_20.SYSTEM)
    found = figure_20.scan(point_map, "inner", 7)
    assert found.ends[0] == 0
    assert np.isin(found.ends[1:], (1, -1)).all()
    assert (found.ends[1:] == 1).sum() >= 3
    low, high = found.least
    assert 0.0 < high - low < 1e-6
    assert (figure_20.ends_of(point_map, "inner", np.array([low, high])) == 0).tolist() == [True, False]
    periods = np.arange(found.periods, found.periods + 10)
    (ic,) = figure_20.pushed("inner", np.array([found.quickest]))
    times = periods * figure_20.SYSTEM.length
    states = solve_ivp(
        figure_20.SYSTEM.fun, (0.0, times[-1]), ic, method="DOP853", t_eval=times, rtol=1e-10, atol=1e-10
    ).y.T
    assert (figure_20.distance(states, figure_20.DOWN_UP) < 0.1).all()


@pytest.mark.parametrize(("name", "end", "amplitude"), [("(0, 0, 0)", 1, 2.268102e-3), ("(π, π, π)", 0, 1.955039e-3)])
def test_the_triple_pendulum_that_hangs_and_that_stands(
    name: str, end: int, amplitude: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The two states whose windows bound the one that all eight have in common (REFERENCES.md)."""
    monkeypatch.setattr(triple_stability, "STATES", {name: triple_stability.STATES[name]})
    monkeypatch.setattr(triple_stability, "DAMPINGS", (0.0,))
    result = triple_stability.compute(3)
    assert result.windows[0.0][name][end] == pytest.approx(amplitude, abs=5e-10)
    assert result.decoupled[name] == pytest.approx(result.windows[0.0][name], abs=1e-13)


@pytest.mark.thorough
def test_near_the_four_states_of_the_reference_set(capsys: pytest.CaptureFixture[str]) -> None:
    """All four are stable at 6 mm (REFERENCES.md): the cell beside each of them returns to it, and all others end."""
    found = flipping_basins.measured(0.006, flipping_basins.angle_slice(8, 0.0))
    states = [tuple(np.sign(np.cos(a.points[0, :2])).tolist()) for a in found.basins.attractors]
    assert states == [(1, 1), (1, -1), (-1, 1), (-1, -1)]
    labels = found.basins.labels.squeeze()
    assert (labels >= 0).all()
    assert labels[[3, 3, 0, 0], [3, 0, 3, 0]].tolist() == [0, 1, 2, 3]
    flipping_basins.report("at rest", found)
    assert capsys.readouterr().out.count("Attractor(fixed point") == 4
    figure = flipping_basins.draw(dict.fromkeys(("at rest, 60 x 60", "at rest", "rates"), found))
    assert [ax.get_title() for ax in figure.axes] == ["at rest", "rates"]


@pytest.mark.slow
def test_stability_of_the_double_pendulum() -> None:
    """To all digits of tests/REFERENCES.md."""
    result = double_stability.compute(12)
    found = result.windows["24 Hz, equal masses, undamped"]
    assert found["(0, 0)"][0][0] == (0.0, pytest.approx(3.523140841e-3, abs=5e-13))
    for name in ("(0, π)", "(π, 0)"):
        assert found[name][0][0] == pytest.approx((4.452842149e-3, 9.546244854e-3), abs=5e-13)
    assert [len(windows) for windows in found.values()] == [1, 1, 1, 0]
    (window, lost), *_ = result.windows["50 Hz, m2 = m1/4, 10 /s (reference set)"]["(0, π)"]
    assert window[1] == pytest.approx(12.532158062e-3, abs=5e-13)
    assert lost == "NEIMARK_SACKER"
    assert result.thresholds == {1.0: pytest.approx(41.136433, abs=5e-7), 0.25: pytest.approx(21.418270, abs=5e-7)}
    assert max(result.decoupled.values()) < 1e-13


@pytest.mark.slow
def test_rotations_and_swings_of_twice_the_period(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flipping_basins.main(quick=True, output=tmp_path)
    stored = [load_basins(tmp_path / "flipping_basins.h5", name).attractors for name in ("box, 6 mm", "box, 9.5 mm")]
    assert {a.rotations[:2] for a in stored[0]} == {(0, 0), (1, 1), (-1, -1)}
    doubled = [a for a in stored[1] if a.period == 2]
    assert {tuple(np.sign(np.cos(a.points[0, :2])).tolist()) for a in doubled} == {(1, 1), (-1, -1)}
    said = capsys.readouterr().out.partition("at rest:")[2]
    rows = re.findall(r"([\d.]+) \+- [\d.]+ %  Attractor\(fixed point", said)
    expected = 100.0 * np.array([1286, 596, 976, 742]) / 3600  # those of the test above, on a grid of other cells
    assert [float(r) for r in rows] == pytest.approx(expected, abs=0.6)
