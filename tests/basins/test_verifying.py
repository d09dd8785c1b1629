"""Verification of labels by random initial conditions."""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from known_basins import LINE

from cellmap import (
    Basins,
    CellGrid,
    Label,
    discrete_map,
    find_attractors,
    find_basins,
)
from cellmap.attractors.kinds.mixing import unmixed
from cellmap.basins import verification
from cellmap.basins.record import Verification


def test_verify_counts_exactly_what_is_planted():
    """One label in two, or one in ten: the draws are known from the seed."""
    basins = find_basins(LINE, CellGrid((-1.0,), (1.0,), (50,)))
    drawn = np.random.default_rng(5).integers(0, 50, 400)
    for wrong in (basins.labels != 0, np.arange(50) % 10 == 3):
        spoilt = replace(basins, labels=np.where(wrong, 1 - basins.labels, basins.labels))
        check = spoilt.verify(400, rng=5)
        assert check.wrong == round(check.fraction * check.compared) == np.count_nonzero(wrong[drawn])
        assert check.low < wrong.mean() < check.high
        assert spoilt.verify(100) == spoilt.verify(100) != spoilt.verify(100, rng=2)


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


# --- orbits that share a label and never mix, whatever the search takes for one attractor

ODD = discrete_map(lambda x, p: (p.a * x[0] - x[0] ** 3,), {"a": 2.595}, ("x",))
LOGISTIC = discrete_map(lambda x, p: (p.a * x[0] * (1 - x[0]),), {"a": 4.0}, ("x",))
TURNING = discrete_map(
    lambda x, p: (
        (x[0] * p.c - x[1] * p.s) * (1 - 0.2 * (x[0] ** 2 + x[1] ** 2 - 1) * (x[0] ** 2 + x[1] ** 2 - 4)
        * (x[0] ** 2 + x[1] ** 2 - 2)),
        (x[0] * p.s + x[1] * p.c) * (1 - 0.2 * (x[0] ** 2 + x[1] ** 2 - 1) * (x[0] ** 2 + x[1] ** 2 - 4)
        * (x[0] ** 2 + x[1] ** 2 - 2)),
    ),
    {"c": 1.0, "s": 0.0}, ("x", "y"),
)  # fmt: skip
"""Attracting circles of radius 1 and 2, between them a repelling one of radius sqrt(2); turns by a given angle."""


def merged(basins: Basins) -> Basins:
    """Make one attractor of all, and one label."""
    first = basins.attractors[0]
    assert first.cover is not None
    boxes = np.unique(np.concatenate([a.cover.boxes for a in basins.attractors if a.cover]), axis=0)
    points = np.concatenate([a.points for a in basins.attractors])
    one = replace(first, points=points, cover=replace(first.cover, boxes=boxes))
    return replace(basins, attractors=(one,), labels=np.zeros_like(basins.labels))


def test_two_chaotic_attractors_given_as_one_are_seen(monkeypatch) -> None:
    """[g, m] and [-m, -g] are invariant: m = 2 (a/3)^1.5 is the maximum, and g = m (a - m^2) > 0 its image."""
    m = 2.0 * (2.595 / 3.0) ** 1.5
    assert m * (2.595 - m * m) > 0.0
    basins = find_basins(ODD, CellGrid((-1.6,), (1.6,), (200,)), max_periods=300)
    assert len(basins.attractors) == 2
    right = basins.verify(100, search=True)
    assert (right.wrong, right.separate) == (0, 0)
    drawn = np.random.default_rng(0).integers(0, 200, 100)
    fewer = np.bincount(basins.labels[drawn]).min()
    wrong = merged(basins)
    found = wrong.verify(100, search=True)
    assert (found.wrong, found.separate) == (fewer, fewer) and f"separate={fewer}" in repr(found)
    # A search that takes them for one as well changes nothing: averages are no rule of the search.
    monkeypatch.setattr(verification, "find_attractors", lambda *_: wrong.attractors)
    found = wrong.verify(100, search=True)
    assert (found.searched, found.wrong, found.separate) == (1, fewer, fewer)
    assert wrong.verify(100).separate is None


@pytest.mark.parametrize("a", [3.6, 4.0])
@pytest.mark.thorough
def test_one_attractor_of_one_or_two_bands_is_not_accused(a: float) -> None:
    """The two bands at 3.6 are visited in turn (Grossmann and Thomae 1977); at 4 the density is that of Ulam (1947)."""
    basins = find_basins(LOGISTIC.with_params(a=a), CellGrid((0.01,), (0.99,), (100,)), max_periods=500)
    assert len(basins.attractors) == 1
    found = basins.verify(64, search=True)
    assert (found.wrong, found.separate) == (0, 0)


@pytest.mark.parametrize(("a", "number"), [(2.5981, 1), (2.7, 1), (2.598, 2)])
def test_orbits_that_change_sides_now_and_then_mix(a: float, number: int) -> None:
    """Sides are changed from a = 3 sqrt(3)/2 = 2.5980762 on; at 2.5981 once in some 540 steps."""
    assert (a < 1.5 * sqrt(3.0)) == (number == 2)
    begin = np.linspace(-1.55, 1.57, 40)[:, None]
    apart = unmixed(ODD.with_params(a=a), begin, np.arange(40) > 18, 500)
    assert apart.any() == (number == 2)
    if number == 2:
        side = np.sign(ODD.with_params(a=a).iterate(begin, 50).points[:, 0])
        assert (apart == (side != side[-1])).all() or (apart == (side != -side[-1])).all()


def _turned(angle: float):
    return TURNING.with_params(c=np.cos(angle), s=np.sin(angle))


def test_circles_are_distinguished_and_slow_turns_are_not() -> None:
    """Orbits of rotation number near 1/4 pass along their circle in 1e7 steps: averages tell where they began."""
    angles = np.linspace(0.0, 6.0, 12)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    both = np.concatenate([1.1 * ring, 1.9 * ring])
    inner = np.arange(24) < 12
    assert (unmixed(_turned(np.pi * (sqrt(5.0) - 1.0)), both, inner, 200) == ~inner).all()
    for angle in (np.pi / 2 + 1e-3, np.pi / 2 + 1e-4, np.pi / 2 + 1e-7):
        assert not unmixed(_turned(angle), both[inner], inner[inner], 200).any()


def test_orbits_that_end_are_elsewhere() -> None:
    begin = np.array([[0.3], [0.4], [0.7], [1.5]])
    assert unmixed(LOGISTIC, begin, np.ones(4, bool), 200).tolist() == [False, False, False, True]
    assert unmixed(LOGISTIC, begin[3:], np.ones(1, bool), 200).all()
