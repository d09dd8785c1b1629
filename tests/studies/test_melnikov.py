"""The study of Melnikov's criterion: its formula, the manifolds, and the rules for two wells."""

import re
from collections.abc import Callable
from math import cosh, pi

import numpy as np
import pytest

from cellmap import CellGrid, find_basins, stroboscopic_map
from studies import melnikov
from systems import moon_li_duffing


@pytest.mark.parametrize(("damping", "frequency"), [(0.15, 0.8333), (0.1, 0.5), (0.3, 1.7)])
def test_the_closed_form_is_that_of_the_integrals(damping: float, frequency: float) -> None:
    exact = melnikov.critical_forcing(damping, frequency)
    assert melnikov.critical_forcing_by_quadrature(damping, frequency) == pytest.approx(exact, rel=1e-9)


@pytest.mark.thorough
def test_the_manifolds_cross_above_a_force_close_to_melnikovs() -> None:
    """The criterion is of first order in damping and force, and here off by less than one part in a hundred."""
    assert melnikov.wrong_side(0.99 * melnikov.critical_forcing(), 2000) == 0
    assert melnikov.wrong_side(1.01 * melnikov.critical_forcing(), 2000) > 20
    low, high = melnikov.tangency(1000, 4)
    assert low < high
    assert 0.5 * (low + high) == pytest.approx(melnikov.critical_forcing(), rel=0.01)


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


@pytest.mark.slow
def test_what_must_come_out_is_printed(quick_run: Callable[..., str]) -> None:
    said = quick_run(melnikov, "melnikov.png")
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
