"""Memory and room on disk of runs with a checkpoint."""

from __future__ import annotations

import shutil
import subprocess
import sys

import numpy as np
import pytest
from checkpointed_runs import CASES, WINDOW, assert_same

from cellmap.basins.initial_conditions import Rows
from cellmap.basins.label_store import basins_disk, basins_memory

# --- memory and disk


def test_room_is_stated_and_claimed_before_the_run(tmp_path, monkeypatch, caplog):
    total = WINDOW.size
    with caplog.at_level("INFO", logger="cellmap"):
        CASES["one pass"](checkpoint=tmp_path / "basins.h5")
    assert "labelling 14,375 initial conditions" in caplog.text
    assert "on the disk" in caplog.text
    memory = basins_memory(total, checkpoint=True)
    monkeypatch.setattr("cellmap._lib.checks._ALWAYS_FREE", 0)
    monkeypatch.setattr("cellmap._lib.checks.memory_available", lambda: memory - 1)
    with pytest.raises(MemoryError, match="labelling 14,375 initial conditions needs"):
        CASES["one pass"](checkpoint=tmp_path / "other.h5")
    monkeypatch.undo()
    usage = shutil.disk_usage(tmp_path)._replace(free=basins_disk(total) - 1)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    with pytest.raises(OSError, match=r"checkpoint=.* needs .* and .* are free: take fewer initial conditions, or"):
        CASES["one pass"](checkpoint=tmp_path / "other.h5")
    assert [p.name for p in tmp_path.iterdir()] == ["basins.h5"]


def test_a_file_is_no_larger_than_stated(finished):
    assert 6 * WINDOW.size <= finished.stat().st_size <= basins_disk(WINDOW.size) / 2


MEASURE = """
import resource
from cellmap import CellGrid, discrete_map, find_basins
half = discrete_map(lambda x, p: (x[0] / 2, x[1] / 3), {{}}, ("x", "y"), name="half")
find_basins(half, CellGrid((-1, -1), (1, 1), (100, 100)), checkpoint={small!r})
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
find_basins(half, CellGrid((-1, -1), (1, 1), ({side}, {side})), checkpoint={path!r})
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.slow
def test_memory_does_not_grow_with_the_number_of_initial_conditions(tmp_path):
    grown = []
    for side in (1500, 4500):  # 13 MB and 120 MB of labels and times
        names = {"small": str(tmp_path / f"small{side}.h5"), "path": str(tmp_path / f"{side}.h5")}
        program = MEASURE.format(side=side, **names)
        output = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
        scale = 1 if sys.platform == "darwin" else 1024
        grown.append(int(output) * scale)
    assert grown[1] < 80e6, "less than the labels and times of all starts"
    assert grown[1] - grown[0] < 40e6


@pytest.mark.parametrize("name", ["undecided", "small basins", "multi-period steps"])
@pytest.mark.thorough
def test_states_that_are_too_many_to_be_kept_are_computed_again(name, plain, tmp_path, monkeypatch):
    """Where all that is left can be looked at, forgetting its states changes nothing."""
    monkeypatch.setattr("cellmap.basins.run._joined", lambda *_: None)
    assert_same(CASES[name](), plain[name])
    assert_same(CASES[name](checkpoint=tmp_path / "b.h5"), plain[name])


def test_of_very_many_that_are_left_a_part_is_searched(plain, tmp_path, monkeypatch):
    monkeypatch.setattr("cellmap.basins.run.HELD", 100)
    monkeypatch.setattr("cellmap.basins.run._LOOKED_AT", 50)
    found = CASES["small basins"]()
    assert_same(CASES["small basins"](checkpoint=tmp_path / "b.h5"), found)
    assert {str(a) for a in found.attractors} <= {str(a) for a in plain["small basins"].attractors}
    assert_same(CASES["undecided"](), plain["undecided"])


# --- rows by bits


@pytest.mark.parametrize("block", [8, 64, 2**20])
@pytest.mark.parametrize("total", [1, 7, 8, 63, 64, 65, 1000])
@pytest.mark.parametrize("fraction", [0.0, 0.02, 0.5, 1.0])
def test_rows_are_those_that_were_chosen(block, total, fraction, monkeypatch):
    monkeypatch.setattr("cellmap.basins.initial_conditions.BLOCK", block)
    chosen = np.random.default_rng(total).random(total) < fraction
    rows, expected = Rows.where(total, lambda part: chosen[part]), np.flatnonzero(chosen)
    assert len(rows) == len(expected)
    for begin in range(0, len(expected), 5):
        assert np.array_equal(rows[begin : begin + 17], expected[begin : begin + 17])
    spread = np.concatenate([np.empty(0, int), *rows.spread(10)])
    assert np.isin(spread, expected).all()
    assert len(spread) == min(len(expected), 10)
    assert np.array_equal(np.concatenate([np.empty(0, int), *rows.spread(10**6)]), expected)
    inside = [rows.inside(slice(k, min(k + block, total))) for k in range(0, total, block)]
    assert np.array_equal(np.concatenate(inside), chosen)
