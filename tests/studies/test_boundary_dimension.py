"""The study of the pendulum's boundary: smooth, fractal, and measured by boxes on lines and in images."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest

from cellmap import CellGrid, find_basins, stroboscopic_map
from studies import boundary_dimension
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


@pytest.mark.slow
def test_what_must_come_out_is_printed(quick_run: Callable[..., str]) -> None:
    said = quick_run(boundary_dimension, "boundary_dimension.png")
    assert "A =  0.00 mm, 1 attractors: no boundary" in said
    rows = re.findall(r"A = +([\d.]+) mm, .*?: ([\d.]+) \+- ([\d.]+) by.*?\((.*?)\); ([\d.]+) \+- ([\d.]+) by", said)
    found = {float(a): (float(d), float(e), verdict, float(box), float(f)) for a, d, e, verdict, box, f in rows}
    smooth, error, verdict, box, _ = found[4.0]
    assert verdict == "consistent with smooth"
    assert abs(smooth - 1.0) < 3.0 * error
    assert box == pytest.approx(1.0, abs=0.03)
    fractal, error, verdict, box, box_error = found[10.0]
    assert verdict == "fractal"
    assert 1.75 - 3.0 * error < fractal < 1.83 + 3.0 * error
    assert 1.75 - 2.0 * box_error < box < 1.83 + 2.0 * box_error
    assert re.findall(r"stability at ([\d., ]+) mm", said) == ["12.210173", "2.329021, 12.542910"]
