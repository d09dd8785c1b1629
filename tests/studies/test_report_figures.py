"""Small runs of studies: what must come out of them does, and they draw what they say."""

from __future__ import annotations

from math import pi

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

from studies import figure_2, figure_18, figure_19, set_oriented

mpl.use("Agg")


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
    plt.close("all")


def test_basins_at_one_amplitude(monkeypatch: pytest.MonkeyPatch) -> None:
    """At 3 mm the inverted state has 7104 of 40,000 cells (tests/REFERENCES.md)."""
    monkeypatch.setattr(figure_19, "AMPLITUDES", (3e-3,))
    monkeypatch.setattr(figure_19, "WINDOWS", (100.0,))
    (panel,) = figure_19.compute(24, 64)
    assert panel.wrong == 0.0
    assert [a.points[0, 0] for a in panel.kept.attractors] == pytest.approx([0.0, -pi])
    assert panel.kept.fractions[1].fraction == pytest.approx(7104 / 40000, abs=0.02)
    assert len(figure_19.draw([panel], 100.0).axes) == 2
    plt.close("all")


def test_a_release_that_matches_the_report() -> None:
    """Without friction, from the amplitude and the angle that the study finds: 0.12 rad at 35 Hz, 0.05 rad at 45 Hz."""
    found = figure_18.Release(3.678185941502e-3, 1.857876614935e-2, 0.0, 0.0)
    assert [found.swing(f) for f in (35.0, 45.0)] == pytest.approx([0.12, 0.05], abs=1e-5)


def test_sets_of_boxes() -> None:
    """Six sets that follow one another give the sixth roots of unity; the resonances of the pendulum attract."""
    eigenvalues = set_oriented.cycle_operator(4).cycle(6).eigenvalues
    assert np.abs(eigenvalues - np.exp(2j * pi * np.arange(6) / 6)).max() < 1e-4
    graph = set_oriented.pendulum_graph(2)
    holders = [[k for k, boxes in enumerate(graph.sets) if boxes.contains(p)] for p in set_oriented.FIXED_POINTS]
    assert sorted(map(tuple, holders)) == [(k,) for k in sorted(graph.sinks)]
