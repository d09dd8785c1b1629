"""Studies of pendulums with several links and of the report's swings: the numbers that their docstrings promise."""

from math import nan, pi, sqrt

import numpy as np
import pytest

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
