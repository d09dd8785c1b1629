"""Tipping probabilities between basins before and after a change."""

from __future__ import annotations

from dataclasses import replace
from math import atan2, cos, pi, sin, sqrt, tan
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import (
    Basins,
    CellGrid,
    PointMap,
    discrete_map,
    find_basins,
    plot,
)
from cellmap.analysis import binomial_interval
from cellmap.analysis.resilience import (
    tipping_probabilities,
)

mpl.use("Agg")


def test_overlap_of_shifted_basins(cubic: PointMap, line: Basins) -> None:
    """The boundary moves from 0 to 0.3: of 150 cells on the right, 30 tip to the left; none tips to the right.

    The other ends, at 0.3 -+ sqrt 3, leave the window to the right and enter it at -1.432 from the left: 7 of the left
    cells are then thrown to the right.
    """
    moved = find_basins(cubic.with_params(c=0.3), line.grid)
    found = tipping_probabilities(line, moved)
    right = [int(np.argmax([a.points[0, 0] for a in b.attractors])) for b in (line, moved)]
    left = [1 - k for k in right]
    assert found.probability(right[0], left[1]) == pytest.approx(30 / 150)
    assert found.probability(right[0], right[1]) == pytest.approx(120 / 150)
    assert found.probability(left[0], right[1]) == pytest.approx(7 / 150)
    assert found.probabilities.sum(axis=1) == pytest.approx([1.0, 1.0])
    assert (found.low <= found.probabilities).all()
    assert (found.probabilities <= found.high).all()
    assert found.landing is not None
    assert found.landing[right[0], right[1]] == 1.0  # 1 lies between 0.3 and 2.03


def _rotated(x: Any, p: Any) -> tuple[float, ...]:
    r, t = sqrt(x[0] ** 2 + x[1] ** 2), atan2(x[1], x[0])
    rotated, nearer = t - 0.3 * sin(2.0 * (t - p.phi)), r + 0.3 * (1.0 - r)
    return nearer * cos(rotated), nearer * sin(rotated)


@pytest.mark.parametrize("match", ["distance", "overlap"])
def test_attractors_are_matched_between_rotated_bases(match: str) -> None:
    """Attractors at phi and phi + pi, half-planes as basins: turned by 0.4, tan(0.2)/2 of each half of a square tips.

    Labels are in the order of x, so that attractors exchange theirs as one passes the y axis.
    """
    window = CellGrid((-2.0, -2.0), (2.0, 2.0), (400, 400))
    point_map = discrete_map(_rotated, {"phi": pi / 2 - 0.2}, ("x", "y"))
    before, after = (find_basins(point_map.with_params(phi=phi), window) for phi in (pi / 2 - 0.2, pi / 2 + 0.2))
    upper = [int(np.argmax([a.points[0, 1] for a in b.attractors])) for b in (before, after)]
    assert upper[0] != upper[1]
    found = tipping_probabilities(before, after, match=match)
    assert found.continuation == (1, 0)
    assert found.tipping[:, 0] == pytest.approx(np.full(2, tan(0.2) / 2.0), abs=2e-3)
    assert (found.tipping[:, 1] <= found.tipping[:, 0]).all()
    assert (found.tipping[:, 0] <= found.tipping[:, 2]).all()
    same = tipping_probabilities(before, after, match="labels")
    assert same.continuation == (0, 1)
    assert same.tipping[:, 0] == pytest.approx(1.0 - found.tipping[:, 0])
    assert len(plot.tipping(found).patches) == 2


def test_attractors_far_away_or_without_overlap_do_not_continue(cubic: PointMap, line: Basins) -> None:
    moved = find_basins(cubic.with_params(c=1.2), line.grid)
    assert tipping_probabilities(line, moved, threshold=0.1).continuation == (None, None)
    lost = tipping_probabilities(line, replace(moved, attractors=moved.attractors[:1], labels=0 * moved.labels))
    assert sorted(k is None for k in lost.continuation) == [False, True]
    assert lost.tipping[lost.continuation.index(None), 0] == 1.0
    assert tipping_probabilities([0, 0, 1, 1], [0, 1, 0, 1], match="overlap").continuation == (None, None)
    assert tipping_probabilities([0, 0, 1, 1], [5, 5, 5, 3], match="overlap").continuation == (5, 3)
    assert tipping_probabilities([0, 0, 0, 1], [5, 5, 5, 5], match="overlap").continuation == (5, None)


def test_attractor_that_lands_elsewhere(cubic: PointMap, line: Basins) -> None:
    """Moved by 1.2, the boundary has passed the attractor at 1."""
    moved = find_basins(cubic.with_params(c=1.2), line.grid)
    found = tipping_probabilities(line, moved)
    right = int(np.argmax([a.points[0, 0] for a in line.attractors]))
    left_after = int(np.argmin([a.points[0, 0] for a in moved.attractors]))
    assert found.landing is not None
    assert found.landing[right, found.after.index(left_after)] == 1.0


def test_labels_that_only_attractors_land_on_have_the_interval_asked_for(cubic: PointMap, line: Basins) -> None:
    """Moved by -3, the boundary leaves the attractors so far away that they diverge; no cell is said to."""
    moved = find_basins(cubic.with_params(c=-3.0), CellGrid((-4.5,), (-1.5,), (300,)))
    after = replace(moved, labels=0 * moved.labels, grid=line.grid)
    found = tipping_probabilities(line, after, confidence=0.5)
    assert found.after[-1] == -2
    assert found.high[:, -1] == pytest.approx(np.full(2, binomial_interval(0, 150, 0.5)[1]))
    assert found.landing is not None
    assert found.landing[:, -1].max() == 1.0


def test_what_matching_refuses(line: Basins) -> None:
    with pytest.raises(ValueError, match="have no attractors"):
        tipping_probabilities([0, 1], [0, 1], match="distance")
    with pytest.raises(ValueError, match="match='name'"):
        tipping_probabilities(line, line, match="name")
    with pytest.raises(ValueError, match="threshold=0"):
        tipping_probabilities(line, line, threshold=0.0)


def test_labels_alone_and_codes() -> None:
    found = tipping_probabilities([[0, 0, -2], [1, 1, -3]], [[0, -3, -2], [0, 1, 1]])
    assert (found.before, found.after) == ((0, 1, -2, -3), (0, 1, -2, -3))
    assert found.counts.tolist() == [[1, 0, 0, 1], [1, 1, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0]]
    assert found.landing is None
    assert found.probability(0, 5) == 0.0
    with pytest.raises(ValueError, match="before=9"):
        found.probability(9, 0)


@pytest.mark.parametrize(
    ("before", "after", "error", "match"),
    [
        ([0, 1], [0], ValueError, "shapes"),
        (np.zeros(0, int), np.zeros(0, int), ValueError, "empty"),
        ([0.5], [0], TypeError, "whole numbers"),
    ],
)
def test_what_tipping_refuses(before: Any, after: Any, error: type[Exception], match: str) -> None:
    with pytest.raises(error, match=match):
        tipping_probabilities(before, after)


def test_tipping_refuses_other_windows(cubic: PointMap, line: Basins) -> None:
    with pytest.raises(ValueError, match="one window"):
        tipping_probabilities(line, find_basins(cubic, CellGrid((-1.4,), (1.5,), (300,))))
