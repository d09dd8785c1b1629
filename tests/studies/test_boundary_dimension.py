"""The study of the pendulum's boundary: smooth, fractal, and measured by boxes on lines and in images."""

from __future__ import annotations

import re
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import CellGrid, find_basins, stroboscopic_map
from cellmap.analysis.fractal.uncertainty_fits import SMOOTH
from studies import boundary_dimension
from studies._boundary import box_counts
from systems import two_well_duffing

mpl.use("Agg")


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


def test_one_basin_has_no_boundary(capsys: pytest.CaptureFixture[str]) -> None:
    """Below 2.329 mm only the hanging state is stable."""
    result = boundary_dimension.compute(
        (1.0, 2.0), pairs=10_000, uncertain=50, cells=30, lines=2, line_cells=256, side=30
    )
    for row in result.rows:
        assert row.pairs.fit is None
        assert row.pairs.verdict == "no boundary"
        assert np.isnan(row.boxes.dimension)
        assert repr(row.boxes) == "none by boxes"
    # Two independent methods of the study of figure 2.
    assert result.changes["hanging"] == pytest.approx([12.210173235], abs=1e-6)
    assert result.changes["inverted"] == pytest.approx([2.329021135978, 12.542910208], abs=1e-6)
    assert "no boundary" in capsys.readouterr().out


@pytest.mark.slow
def test_smooth_at_4_mm_and_fractal_at_10_mm() -> None:
    result = boundary_dimension.compute(
        (4.0, 10.0), pairs=200_000, uncertain=500, cells=100, lines=8, line_cells=2**15, side=1000
    )
    smooth, fractal = result.rows
    assert smooth.pairs.verdict == SMOOTH
    assert smooth.boxes.dimension == pytest.approx(1.0, abs=0.02)
    assert fractal.pairs.verdict == "fractal"
    assert 1.75 - 2.0 * fractal.pairs.standard_error < fractal.pairs.boundary_dimension < 1.83
    assert abs(fractal.pairs.boundary_dimension - fractal.boxes.dimension) < 3.0 * np.hypot(
        fractal.pairs.standard_error, fractal.boxes.standard_error
    )


@pytest.mark.slow
def test_what_must_come_out_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    boundary_dimension.main(quick=True, output=tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["boundary_dimension.png"]
    said = capsys.readouterr().out
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
