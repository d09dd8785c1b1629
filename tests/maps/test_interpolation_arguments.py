"""Arguments of interpolated maps that are refused, and what the errors say."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

import systems
from cellmap import (
    CellGrid,
    interpolated_map,
)

GRID = CellGrid((-pi, -100.0), (pi, 100.0), (16, 16))
ONE_AND_A_HALF_PERIODS = CellGrid((-pi, -100.0), (2 * pi, 100.0), (16, 16))


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((GRID, 2), ValueError, "order=2: choose one of 1, 3, 5"),
        ((GRID, 4), ValueError, "order=4: choose one of 1, 3, 5"),
        ((GRID, 0), ValueError, "order=0"),
        ((GRID, "cubic"), TypeError, "order='cubic': give a whole number"),
        ((GRID, 5, "reflect"), ValueError, "outside='reflect': choose one of 'escape', 'integrate'"),
        ((GRID, 5, "escape", 0.0), ValueError, "tolerance=0.0: give a number above 0"),
        ((GRID, 5, "escape", -1e-3), ValueError, "tolerance=-0.001"),
        ((GRID, 5, "escape", np.nan), ValueError, "tolerance=nan: give a finite number"),
        ((GRID, 5, "escape", np.inf), ValueError, "tolerance=inf"),
        ((GRID, 5, "escape", "small"), TypeError, "tolerance='small'"),
        ((CellGrid((0.0,), (1.0,), (8,)),), ValueError, "grid has 1 axis and the system 2 coordinates"),
        ((CellGrid((0.0,) * 3, (1.0,) * 3, (8,) * 3),), ValueError, "grid has 3 axes and the system 2 coordinates"),
        ((ONE_AND_A_HALF_PERIODS,), ValueError, "more than one period"),
        (((16, 16),), TypeError, "give a CellGrid"),
        ((None,), TypeError, "give a CellGrid"),
    ],
    ids=repr,
)
def test_bad_arguments(pendulum, arguments, error, message):
    with pytest.raises(error, match=message.replace("(", r"\(")):
        interpolated_map(pendulum, *arguments)


@pytest.mark.parametrize("exact", [None, systems.driven_pendulum(), np.zeros(2), len], ids=repr)
def test_something_that_is_no_map(exact):
    with pytest.raises(TypeError, match=r"exact=.*: give a PointMap, made by stroboscopic_map or discrete_map"):
        interpolated_map(exact, GRID)


def test_interpolated_map_of_an_interpolated_map(interpolated_pendulum):
    with pytest.raises(TypeError, match="give an exact map"):
        interpolated_map(interpolated_pendulum, GRID)


@pytest.mark.parametrize(
    ("lower", "upper", "shape", "message"),
    [
        ((1.0, 0.0), (0.0, 1.0), (4, 4), "empty or inverted"),
        ((0.0, 0.0), (0.0, 1.0), (4, 4), "empty or inverted"),
        ((0.0, np.nan), (1.0, 1.0), (4, 4), "finite corners"),
        ((0.0, 0.0), (np.inf, 1.0), (4, 4), "finite corners"),
        ((0.0, 0.0), (1.0, 1.0), (4, 0), "at least 1"),
        ((0.0, 0.0), (1.0, 1.0), (4, -3), "at least 1"),
        ((0.0, 0.0), (1.0,), (4, 4), "one entry for each coordinate"),
    ],
)
def test_windows_that_are_none(lower, upper, shape, message):
    with pytest.raises(ValueError, match=message):
        CellGrid(lower, upper, shape)


@pytest.mark.parametrize("points", [[np.nan, 0.0], [0.0, np.inf], [1.0], [[1.0, 2.0, 3.0]], "ab"], ids=repr)
def test_initial_conditions_that_are_none(interpolated_pendulum, points):
    with pytest.raises((ValueError, TypeError), match="points"):
        interpolated_pendulum(points)
