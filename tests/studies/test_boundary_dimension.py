"""The study of the pendulum's boundary: smooth, fractal, and measured by boxes on lines and in images."""

import pytest

from cellmap import CellGrid, find_basins, stroboscopic_map
from studies._boundary import box_counts
from systems import two_well_duffing


@pytest.mark.thorough
def test_a_smooth_boundary_is_counted_in_an_image() -> None:
    """The unforced, damped double well: a separatrix, which lines cross a few times."""
    basins = find_basins(
        stroboscopic_map(two_well_duffing(damping=0.3, forcing=0.0)), CellGrid((-1.5, -1.0), (1.5, 1.0), (20, 20))
    )
    boxes = box_counts(basins, lines=4, cells=2**10, side=400)
    assert not boxes.by_lines
    assert boxes.dimension == pytest.approx(1.0, abs=0.03)


def test_a_fractal_boundary_is_counted_on_lines() -> None:
    """Two-well Duffing: 1.90 +- 0.03 (references)."""
    basins = find_basins(stroboscopic_map(two_well_duffing()), CellGrid((-2.2, -2.2), (2.2, 2.2), (20, 20)))
    boxes = box_counts(basins, lines=4, cells=2**14, side=10)
    assert boxes.by_lines
    assert boxes.image is None
    assert boxes.dimension == pytest.approx(1.90, abs=0.03 + 2.0 * boxes.standard_error)
