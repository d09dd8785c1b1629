"""The study of Melnikov's criterion: its formula, the manifolds, and the rules for two wells."""

from __future__ import annotations

import re
from math import cosh, pi, sqrt
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cellmap import CellGrid, find_basins, stroboscopic_map
from cellmap.analysis.fractal.uncertainty_fits import SMOOTH
from studies import melnikov
from systems import moon_li_duffing

mpl.use("Agg")


@pytest.mark.parametrize(("damping", "frequency"), [(0.15, 0.8333), (0.1, 0.5), (0.3, 1.7)])
def test_the_closed_form_is_that_of_the_integrals(damping: float, frequency: float) -> None:
    exact = melnikov.critical_forcing(damping, frequency)
    assert melnikov.critical_forcing_by_quadrature(damping, frequency) == pytest.approx(exact, rel=1e-9)


def test_the_published_criterion() -> None:
    """0.0881 (Moon, Li 1985)."""
    assert melnikov.critical_forcing() == pytest.approx(0.0881, abs=5e-5)


def test_the_loop_is_an_orbit_of_the_oscillator_without_damping_and_force() -> None:
    """x = sqrt(2) sech(t/sqrt 2): from its tip (sqrt 2, 0) back to near the hilltop, by SciPy's integrator."""
    loop = solve_ivp(
        lambda t, x: (x[1], 0.5 * x[0] * (1.0 - x[0] ** 2)), (0.0, 6.0), (sqrt(2.0), 0.0), rtol=1e-11, atol=1e-13
    )
    t = loop.t[-1] / sqrt(2.0)
    assert loop.y[:, -1] == pytest.approx([sqrt(2.0) / np.cosh(t), -np.tanh(t) / np.cosh(t)], abs=1e-6)


def test_the_manifolds_cross_above_a_force_close_to_melnikovs() -> None:
    """The criterion is of first order in damping and force, and here off by less than one part in a hundred."""
    assert melnikov.wrong_side(0.99 * melnikov.critical_forcing(), 2000) == 0
    assert melnikov.wrong_side(1.01 * melnikov.critical_forcing(), 2000) > 20
    low, high = melnikov.tangency(1000, 4)
    assert low < high
    assert 0.5 * (low + high) == pytest.approx(melnikov.critical_forcing(), rel=0.01)


def test_for_weak_damping_the_criterion_becomes_exact(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a fifth of the damping the force at which manifolds touch is within a tenth of a percent."""
    monkeypatch.setattr(melnikov, "DAMPING", 0.03)
    critical = melnikov.critical_forcing(0.03)
    assert melnikov.wrong_side(0.999 * critical, 2000) == 0
    assert melnikov.wrong_side(1.001 * critical, 2000) > 0


def test_attractors_of_a_well_count_as_one() -> None:
    """At f = 0.06 each well has two attractors; the two wells are mirror images half a period apart."""
    strobe = stroboscopic_map(moon_li_duffing(forcing=0.06))
    basins = find_basins(strobe, CellGrid((-2.0, -2.0), (2.0, 2.0), (40, 40)))
    assert len(basins.attractors) == 4
    merged = melnikov.merged(basins)
    assert set(np.unique(merged)) == {0, 1}
    well = melnikov.wells(basins)
    assert well is not None
    places = np.array([a.points[0] for a in basins.attractors])
    assert well(places).tolist() == [int(x > 0) for x in places[:, 0]]
    assert well(np.array([[0.0, 1.0]])).tolist() == [-1]
    for k, a in enumerate(basins.attractors):
        assert (merged[basins.labels == k] == int(a.points[0, 0] > 0)).all()


def test_two_attractors_need_no_rule() -> None:
    strobe = stroboscopic_map(moon_li_duffing(forcing=0.08))
    basins = find_basins(strobe, CellGrid((-2.0, -2.0), (2.0, 2.0), (20, 20)))
    assert melnikov.wells(basins) is None


@pytest.mark.slow
def test_the_dimension_at_a_tenth() -> None:
    """1.776 +- 0.01 (references)."""
    result = melnikov.compute(
        (0.08, 0.10), pairs=300_000, cells=100, lines=8, line_cells=2**16, side=1000, points=500, halvings=3
    )
    smooth, fractal = result.rows
    assert smooth.pairs.verdict == SMOOTH
    assert smooth.pairs.boundary_dimension == pytest.approx(1.0, abs=3.0 * smooth.pairs.standard_error)
    assert fractal.pairs.verdict == "fractal"
    assert fractal.pairs.boundary_dimension == pytest.approx(1.776, abs=0.01 + 2.0 * fractal.pairs.standard_error)
    assert fractal.boxes.dimension == pytest.approx(1.776, abs=0.01 + 2.0 * fractal.boxes.standard_error)


@pytest.mark.slow
def test_what_must_come_out_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    melnikov.main(quick=True, output=tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["melnikov.png"]
    said = capsys.readouterr().out
    s, d, w = 2**0.5, 0.15, 0.8333
    critical = s / (3.0 * pi) * d * cosh(pi * w / s) / w
    ((formula, quadrature),) = re.findall(r"critical force: ([\d.]+) by formula, ([\d.]+) by quadrature", said)
    assert [float(formula), float(quadrature)] == pytest.approx([critical] * 2, abs=1e-6)
    for force, dimension, error, verdict in re.findall(
        r"f = ([\d.]+), .*?: ([\d.]+) \+- ([\d.]+) by.*?\((.*?)\)", said
    ):
        if float(force) < critical:
            assert verdict == "consistent with smooth"
            assert abs(float(dimension) - 1.0) < 3.0 * float(error)
        elif float(force) == 0.1:
            assert verdict == "fractal"
            assert abs(float(dimension) - 1.776) < 0.01 + 2.0 * float(error)
    (cross,) = re.findall(r"cross from f = ([\d.]+) on", said)
    assert float(cross) == pytest.approx(critical, rel=0.01)  # first order in damping and force
