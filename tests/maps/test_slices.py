"""Grids of one cell along an axis with equal corners, and messages of the first mistakes with grids and systems."""

from __future__ import annotations

import numpy as np
import pytest

from cellmap import (
    CellGrid,
    ForcedSystem,
    discrete_map,
    find_basins,
    find_periodic_orbits,
    interpolated_map,
    load_basins,
    plot,
    save_basins,
    stroboscopic_map,
)
from cellmap.analysis.fractal import image_uncertainty_exponent, uncertainty_exponent


def wells(t, x, p):
    return x[1], x[0] - x[0] ** 3 - 0.3 * x[1], x[0] - x[2]


MAP = stroboscopic_map(ForcedSystem(wells, {}, 1.0, ("x", "v", "z")))
SLICE = CellGrid((-2, -2, 0.5), (2, 2, 0.5), (20, 20, 1))


def test_a_slice_is_where_it_is_said_to_be(tmp_path):
    """Its labels are those of initial conditions with the value of the slice; it survives a file."""
    basins = find_basins(MAP, SLICE)
    centres = SLICE.centres()
    assert (centres[..., 2] == 0.5).all()
    listed = find_basins(MAP, centres.reshape(-1, 3))
    assert np.array_equal(basins.labels.ravel(), listed.labels)
    assert basins.verify(50).wrong == 0
    save_basins(basins, tmp_path / "slice.h5")
    assert load_basins(tmp_path / "slice.h5").grid == SLICE
    ax = plot.basins(basins)
    assert (ax.get_ylabel(), ax.get_title()) == ("$v$", "wells, $z$ = 0.5")
    assert uncertainty_exponent(basins, max_pairs=5000).dimension == 2
    assert image_uncertainty_exponent(basins).dimension == 2


@pytest.mark.parametrize(
    "call",
    [
        lambda: interpolated_map(MAP, SLICE),
        lambda: SLICE.locate([[0, 0, 0.5]]),
        lambda: find_periodic_orbits(MAP, SLICE),
    ],
)
def test_cells_without_a_volume_are_refused_where_they_need_one(call):
    with pytest.raises(ValueError, match=r"both 0\.5 along axis 2, which is a slice.*different corners"):
        call()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: CellGrid((-2, 2), (2, -2), (5, 5)),
            r"lower=2.0, upper=-2.0 along axis 1.*empty or inverted; exchange",
        ),
        (lambda: CellGrid((-2, 2), (2, 2), (5, 5)), r"lower=2.0, upper=2.0 along axis 1.*for a slice give one cell"),
        (lambda: CellGrid((-2, -2), (2, 2), 40), r"such as shape=\(40, 40\)"),
        (lambda: ForcedSystem(lambda t, x, p: -x[0], {}, 1.0, ("x",)), r"not iterable; return .*`return \(value,\)`"),
        (lambda: discrete_map(lambda x, p: -x[0], {}, ("x",)), r"returns -0\.1: .*`return \(value,\)`"),
        (lambda: ForcedSystem(lambda t, x, p: (-x[0],), {}, 1.0), "missing .* argument: 'coordinates'"),
    ],
)
def test_first_mistakes(call, message):
    with pytest.raises((TypeError, ValueError), match=message):
        call()


@pytest.mark.filterwarnings("ignore:.*fallback cells")
def test_error_of_a_table_is_that_of_its_interpolated_cells():
    """A step in every cell leaves nothing to measure; one at 0 leaves the other cells, whose map is linear."""
    for jumps, fallback in ((True, True), (False, False)):
        exact = discrete_map(
            lambda x, p, jumps=jumps: (0.5 * x[0] + (np.floor(737.3 * x[0]) if jumps else 0.0), 0.5 * x[1]),
            {},
            ("x", "y"),
        )
        error = interpolated_map(exact, CellGrid((-1, -1), (1, 1), (20, 20))).error(1000)
        assert (error.fallback == 1000, error.points == 0, np.isnan(error.largest)) == (fallback,) * 3
        assert error.fallback + error.points == 1000
        assert fallback or error.largest < 1e-12
