"""Tipping probabilities between basins before and after a change."""

from dataclasses import replace
from math import atan2, cos, pi, sin, sqrt, tan
from typing import Any

import numpy as np
import pytest

from cellmap import Basins, CellGrid, PointMap, discrete_map, find_basins, plot
from cellmap.analysis.resilience import local_integrity, tipping_probabilities


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


def test_labels_alone_and_codes() -> None:
    found = tipping_probabilities([[0, 0, -2], [1, 1, -3]], [[0, -3, -2], [0, 1, 1]])
    assert (found.before, found.after) == ((0, 1, -2, -3), (0, 1, -2, -3))
    assert found.counts.tolist() == [[1, 0, 0, 1], [1, 1, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0]]
    assert found.landing is None
    assert found.probability(0, 5) == 0.0
    with pytest.raises(ValueError, match="before=9"):
        found.probability(9, 0)


CUBIC = discrete_map(lambda x, p: (1.5 * x[0] - p.c * x[0] ** 3,), {"c": 0.5}, ("x",))


def test_a_ball_that_the_map_has_confirmed_ends_at_the_boundary_and_not_at_the_window():
    """From 1 to the edge of the window it is 0.6, to the boundary at sqrt(3) 0.732, and to that at 0 it is 1."""
    basins = find_basins(CUBIC, CellGrid((-1.5,), (1.6,), (62,)))
    upper = next(k for k, a in enumerate(basins.attractors) if a.points[0, 0] > 0)
    image, refined = (local_integrity(basins, upper, scale=1.0, refine=r) for r in (False, True))
    assert image.meets_window and image.shock is None
    assert image.radius == image.image_radius == pytest.approx(1.0, abs=0.05)
    assert refined.shock is not None and not refined.meets_window
    assert refined.radius == pytest.approx(sqrt(3) - 1, abs=1e-6)


def test_arrays_of_labels_are_matched_by_their_numbers():
    """Distances of attractors need basins on both sides."""
    grid = CellGrid((-1.5,), (1.5,), (30,))
    before, after = find_basins(CUBIC, grid), find_basins(CUBIC.with_params(c=0.49), grid)
    assert tipping_probabilities(before, after).match == "distance"
    for pair in ((before.labels, after), (before, after.labels), (before.labels, after.labels)):
        assert tipping_probabilities(*pair).match == "labels"
        with pytest.raises(ValueError, match="match='distance'"):
            tipping_probabilities(*pair, match="distance")
    assert np.array_equal(tipping_probabilities(before, after).counts, 15 * np.eye(2))
