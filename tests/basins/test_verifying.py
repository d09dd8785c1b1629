"""Verification of labels by random initial conditions."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from known_basins import LINE, circle_grid

import systems
from cellmap import (
    CellGrid,
    Label,
    discrete_map,
    find_attractors,
    find_basins,
    interpolated_map,
    stroboscopic_map,
)
from cellmap.basins.record import Verification


def test_verify_finds_wrong_labels():
    """10 % of the labels are changed, at random; n draws see that fraction, within its interval."""
    basins = find_basins(stroboscopic_map(systems.driven_pendulum()), circle_grid(500.0, 50))
    labels = basins.labels.copy()
    labels.ravel()[np.random.default_rng(3).choice(np.flatnonzero(labels.ravel() != 1), 250, replace=False)] = 1
    spoilt = replace(basins, labels=labels)
    check = spoilt.verify(1000)
    assert check.wrong == round(check.fraction * check.compared)
    assert check.low < 0.1 < check.high
    assert check.fraction == pytest.approx(0.1, abs=0.03)
    assert basins.verify(1000).wrong == 0
    assert spoilt.verify(100) == spoilt.verify(100) != spoilt.verify(100, rng=1)


def test_verify_counts_exactly_what_is_planted():
    """One label in two: the draws are known from the seed."""
    basins = find_basins(LINE, CellGrid((-1.0,), (1.0,), (50,)))
    spoilt = replace(basins, labels=np.zeros_like(basins.labels))
    drawn = np.random.default_rng(5).integers(0, 50, 400)
    assert spoilt.verify(400, rng=5).wrong == np.count_nonzero(basins.labels[drawn] != 0)


@pytest.mark.parametrize(("n", "wrong"), [(10, 0), (10, 10), (200, 3), (400, 200), (1, 0)])
def test_interval_of_the_fraction(n, wrong):
    """Wilson's interval is where abs(share - p) = 1.96 sqrt(p (1 - p) / n)."""
    found = Verification.of(wrong, n)
    low, high = found.low, found.high
    assert 0 <= low <= wrong / n <= high <= 1
    for p in (low, high):
        if 0 < p < 1:
            assert abs(wrong / n - p) == pytest.approx(1.959964 * sqrt(p * (1 - p) / n), rel=1e-6)
    assert (low == 0) == (wrong == 0)
    assert (high == 1) == (wrong == n)
    # Those that are undecided reach from right to wrong.
    doubtful = Verification.of(wrong, n, undecided=45)
    assert doubtful.fraction == found.fraction
    assert (doubtful.low, doubtful.high) == (
        Verification.of(wrong, n + 45).low,
        Verification.of(wrong + 45, n + 45).high,
    )


def test_undecided_initial_conditions_are_never_right():
    """A rotation has no attractor: by both maps all orbits are undecided, and nothing says that this is right."""
    rotating = discrete_map(lambda x, p: (0.6 * x[0] - 0.8 * x[1], 0.8 * x[0] + 0.6 * x[1]), {}, ("x", "y"))
    basins = find_basins(rotating, CellGrid((-1.0, -1.0), (1.0, 1.0), (10, 10)), max_periods=50)
    assert (basins.labels == Label.UNDECIDED).all()
    check = basins.verify(80)
    assert (check.compared, check.wrong, check.undecided) == (0, 0, 80)
    assert (check.low, check.high) == (0.0, 1.0)


def test_verify_leaves_out_what_has_no_answer():
    exact = stroboscopic_map(systems.driven_pendulum())
    icm = interpolated_map(exact, circle_grid(100.0, 64), outside="escape")
    basins = find_basins(icm, circle_grid(100.0, 40))
    check = basins.verify(500)
    assert check.compared + check.excluded == 500
    assert check.excluded / 500 == pytest.approx(basins.fractions[Label.ESCAPED].fraction, abs=0.05)
    assert check.wrong == 0


def test_verify_sees_what_a_coarse_table_spoils():
    """Straight lines on 24 x 24 cells mislabel some per cent; the interval holds the true share."""
    exact = stroboscopic_map(systems.driven_pendulum())
    icm = interpolated_map(exact, circle_grid(550.0, 24), order=1, outside="integrate", tolerance=1e3)
    basins = find_basins(icm, circle_grid(500.0, 60))
    truth = find_basins(exact, basins.grid, attractors=basins.attractors)
    fraction = float((truth.labels != basins.labels).mean())
    check = basins.verify(2000)
    assert fraction > 0.005
    assert check.low <= fraction <= check.high


def test_verify_does_not_trust_the_neighbourhoods():
    """An ellipsoid that is far too large, planted from outside, spoils labels; exact integration to the end sees it."""
    exact = LINE
    attractors = find_attractors(exact, [[0.5], [-0.5]])
    big = tuple(
        replace(a, neighbourhood=replace(a.neighbourhood, metrics=np.full((1, 1, 1), 0.25))) for a in attractors
    )
    basins = find_basins(exact, CellGrid((-1.0,), (1.0,), (100,)), attractors=big)
    assert len(set(basins.labels.tolist())) == 1
    assert basins.verify(200).fraction == pytest.approx(0.5, abs=0.1)


def test_verify_with_a_search_of_its_own_sees_attractors_that_are_taken_for_one():
    """Two wells whose basins got one label: by the same attractors nothing is wrong, by new ones half is."""
    basins = find_basins(LINE, CellGrid((-1.0,), (1.0,), (50,)))
    assert len(basins.attractors) == 2
    alike = basins.verify(100, search=True)
    assert (alike.wrong, alike.searched, alike.shared) == (0, 2, ("the formulas of the map", "the rules of the search"))
    assert basins.verify(100).shared == ("the attractors", "the formulas of the map")
    one = replace(basins, labels=np.zeros_like(basins.labels))
    found = one.verify(400, search=True)
    assert found.searched == 2
    there = basins.labels[np.random.default_rng(0).integers(0, 50, 400)]
    assert found.wrong == np.bincount(there).min()
    # The order of the attractors is no difference.
    turned = replace(basins, labels=(1 - basins.labels).astype(np.int16))
    assert turned.verify(100, search=True).wrong == 0
