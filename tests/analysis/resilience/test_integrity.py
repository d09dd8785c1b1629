"""Integrity measures: largest balls in basins."""

from __future__ import annotations

from math import sqrt
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import (
    Basins,
    CellGrid,
    find_basins,
)
from cellmap.analysis.resilience import (
    largest_ball,
    local_integrity,
)
from systems import logistic_map

mpl.use("Agg")


def test_integrity_of_a_disc(disc: Basins) -> None:
    rough, fine = (local_integrity(disc, 0, scale=1.0, refine=r) for r in (False, True))
    assert abs(rough.radius - 1.0) < rough.resolution
    assert fine.radius == pytest.approx(1.0, abs=1e-9)
    assert not fine.meets_window
    assert rough.shock is None
    assert fine.centre == pytest.approx([0.0, 0.0], abs=1e-12)


def test_integrity_of_a_cycle_is_that_of_its_weakest_point() -> None:
    """Logistic map, r = 3.2: both points of the 2-cycle lie in (0, 1), outside of which orbits diverge.

    Single points of the boundary within, such as the preimages of the unstable fixed point, have no room and no weight.
    """
    r = 3.2
    basins = find_basins(logistic_map(r), CellGrid((-0.5,), (1.5,), (200,)))
    high = (r + 1 + sqrt((r - 3) * (r + 1))) / (2 * r)
    ball = local_integrity(basins, 0, scale=1.0)
    assert ball.radius == pytest.approx(1.0 - high, abs=1e-9)
    assert ball.centre == pytest.approx([high])


def test_largest_ball_about_any_centre(disc: Basins) -> None:
    ball = largest_ball(disc, 0, scale=1.0)
    assert abs(ball.radius - 1.0) < ball.resolution
    assert np.linalg.norm(ball.centre) < ball.resolution
    refined = largest_ball(disc, 0, scale=1.0, refine=True)
    assert refined.radius == pytest.approx(1.0 - np.linalg.norm(refined.centre), abs=1e-7)


def test_largest_ball_wraps_and_stops_at_a_window() -> None:
    labels = np.zeros((20, 11), int)
    labels[:4], labels[-5:] = 1, 1
    closed = largest_ball(labels, 1, wraps=(True, False))
    assert closed.radius == 5.0  # nine rows across the branch cut: from the middle one to the first beyond
    assert closed.centre[0] in (19.5, 0.5 - 0.0)
    opened = largest_ball(labels, 1)
    assert opened.radius == 3.0
    assert opened.meets_window
    narrow = largest_ball(labels, 0, scale=(1.0, 0.1))
    assert narrow.radius == 6.0
    assert not narrow.meets_window


def test_undecided_cells_end_a_ball() -> None:
    labels = np.ones((9, 9), int)
    labels[4, 4] = -3
    # About cell (2, 2): the undecided one is nearer than the third row away, beyond the window.
    ball = largest_ball(labels, 1)
    assert ball.radius == pytest.approx(2.0 * sqrt(2.0))
    assert not ball.meets_window
    labels[4, 4] = 1
    assert largest_ball(labels, 1).radius == 5.0


@pytest.mark.parametrize(
    ("labels", "label", "change", "match"),
    [
        (np.zeros((0, 3), int), 0, {}, "shape"),
        (np.zeros((3, 3), int), 1, {}, "no cell has it"),
        (np.zeros(4, int), 0, {"wraps": [True]}, "has no boundary"),
        (np.zeros(4, int), 0, {"refine": True}, "has no map"),
        (np.zeros(4, int), -1, {}, "label=-1"),
    ],
)
def test_what_a_ball_refuses(labels: Any, label: int, change: Any, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        largest_ball(labels, label, **change)


def test_one_cell_is_a_ball_that_meets_the_window() -> None:
    ball = largest_ball(np.zeros((1, 1), int), 0)
    assert (ball.radius, ball.meets_window) == (1.0, True)
