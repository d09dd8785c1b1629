"""Transfer operators: densities, roots of unity, almost invariant sets."""

from math import log, pi

import numpy as np
import pytest
from maps_of_cells import AWAY, CUBIC, line

from cellmap import discrete_map
from cellmap.sets import transfer_operator


def test_density_of_the_logistic_map():
    """1 / (pi sqrt(x (1 - x))): the error in L1 falls as the root of the width."""
    logistic = discrete_map(lambda x, p: (4 * x[0] * (1 - x[0]),), {}, ("x",))
    errors = []
    for n in (256, 1024, 4096):
        operator = transfer_operator(line(n), logistic, samples=100)
        exact = np.diff(2 / pi * np.arcsin(np.sqrt(operator.boxes.grid.edges(0))))
        errors.append(np.abs(operator.invariant_measure - exact).sum())
    assert errors[0] < 0.08 and errors[1] < 0.045 and errors[2] < 0.03
    assert operator.escape_rate == 0.0
    assert (operator.density * operator.boxes.grid.widths[0]).sum() == pytest.approx(1.0, abs=1e-12)


def test_cycle_of_a_permutation():
    """A rotation of five boxes."""
    shift = discrete_map(lambda x, p: ((x[0] + 0.4) % 1.0,), {}, ("x",))
    operator = transfer_operator(line(5), shift, samples=3)
    cycle = operator.cycle(5)
    assert np.abs(cycle.eigenvalues - np.exp(2j * pi * np.arange(5) / 5)).max() < 1e-12
    order = [s.keys.item() for s in cycle.sets]
    assert [(b - a) % 5 for a, b in zip(order, order[1:] + order[:1], strict=True)] == [2] * 5
    with pytest.raises(ValueError, match=r"order=3.*roots"):
        operator.cycle(3)


def test_halves_that_exchange_little_are_found():
    """A doubling map on each half, but for a twentieth of each that crosses over."""

    def leaky(x, p):
        local = x[0] * 2 % 1.0
        half = 0.0 if x[0] < 0.5 else 1.0
        image = local * 3 % 1.0
        side = half if local < 0.95 else 1.0 - half
        return (0.5 * side + 0.5 * image,)

    operator = transfer_operator(line(200), discrete_map(leaky, {}, ("x",)), samples=20)
    found = operator.almost_invariant_sets(2)
    halves = sorted(found.sets, key=lambda boxes: boxes.keys.min())
    assert np.isin(np.arange(95), halves[0].keys).all() and np.isin(np.arange(100, 195), halves[1].keys).all()
    assert sum(map(len, halves)) == 200 and min(found.kept) > 0.945
    assert found.eigenvalues[0] == pytest.approx(1.0, abs=1e-12) and 0.9 < found.eigenvalues[1] < 0.99


def test_two_attractors_have_two_measures():
    operator = transfer_operator(line(101, -1.3, 1.3), CUBIC, samples=11)
    assert len(operator.invariant_measures) == 2
    means = sorted(float(m @ operator.boxes.centres()[:, 0]) for m in operator.invariant_measures)
    assert means == pytest.approx([-1.0, 1.0], abs=0.03)
    with pytest.raises(ValueError, match="2 invariant measures"):
        _ = operator.invariant_measure


def test_escape_rate_of_an_open_tent_map():
    """Slope 3: a third of what is there leaves in each step, and the density is uniform."""
    tent = discrete_map(lambda x, p: (1.5 - 3 * abs(x[0] - 0.5),), {}, ("x",))
    operator = transfer_operator(line(81), tent, samples=27)
    assert operator.escape_rate == pytest.approx(log(1.5), abs=1e-9)
    assert operator.density == pytest.approx(1.0, abs=1e-9)


def test_nothing_lasts_where_all_boxes_empty_at_once():
    """A shift by more than the window: no mass is left after a step."""
    away = transfer_operator(line(4), AWAY)
    assert away.escape_rate == np.inf
    np.testing.assert_array_equal(away.eigenvalues(), np.zeros(4))
    with pytest.raises(ValueError, match="all mass leaks out"):
        _ = away.invariant_measure
