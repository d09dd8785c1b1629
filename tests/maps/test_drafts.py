"""Drafts of tables: the coefficients of the table itself, and no cell that is trusted less once it is examined."""

from __future__ import annotations

from math import cos, pi

import numpy as np
import pytest

from cellmap import CellGrid, ForcedSystem, PointMap, interpolated_map, stroboscopic_map
from cellmap.maps.interpolation.drafts import draft_of, examined
from cellmap.maps.interpolation.interpolated import Interpolated


def forced(t, x, p):
    return x[1], x[0] - x[0] ** 3 - 0.2 * x[1] + 0.1 * cos(t)


def kinked(t, x, p):
    return x[1], -x[0] - 0.2 * x[1] - (3.0 * x[0] if x[0] > 0.0 else 0.0) + 0.1 * cos(t)


def table(rhs, max_step: int = 1) -> PointMap:
    exact = stroboscopic_map(ForcedSystem(rhs, {}, 2 * pi, ("q", "v")), rtol=1e-7, atol=1e-7)
    return interpolated_map(exact, CellGrid((-2, -2), (2, 2), (80, 80)), tolerance=1e-3, max_step=max_step)


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells")
@pytest.mark.parametrize(
    ("rhs", "max_step"), [(forced, 1), (kinked, 1), (forced, 4)], ids=["smooth", "kink", "multi-period steps"]
)
def test_an_examined_draft_is_the_map_itself(rhs, max_step: int) -> None:
    whole = table(rhs, max_step)
    assert isinstance(whole.spec, Interpolated)
    draft = draft_of(whole.spec)
    made = examined(draft)
    assert whole.table is not None
    for one in (draft, made):
        assert one.table is not None
        assert one.table.coefficients.tobytes() == whole.table.coefficients.tobytes()
    assert draft.cost.evaluations < made.cost.evaluations == whole.cost.evaluations
    assert made.table.indicator.tobytes() == whole.table.indicator.tobytes()
    assert np.array_equal(made.table.fallback, whole.table.fallback)
    assert not (draft.table.fallback & ~whole.table.fallback).any()
    points = np.random.default_rng(0).uniform(-1.9, 1.9, (500, 2))
    assert made.iterate(points, 9).points.tobytes() == whole.iterate(points, 9).points.tobytes()
