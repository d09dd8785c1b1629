"""Runs that end early go on to the same bits."""

import shutil
import subprocess
import sys
from itertools import product
from pathlib import Path
from unittest.mock import Mock

import h5py
import numpy as np
import pytest
from checkpointed_runs import CASES, TABLE, Died, dying
from known_basins import WINDOW, assert_same, duffing

import cellmap
import cellmap._lib.checkpoint
from cellmap import CellGrid, discrete_map, interpolated_map, load_basins, save_basins
from cellmap.attractors.search import Search
from cellmap.basins import StoreError
from cellmap.basins.initial_conditions import Rows
from cellmap.basins.label_store import basins_disk, basins_memory

pytestmark = pytest.mark.usefixtures("small_tiles")

# --- an undisturbed run


@pytest.mark.parametrize(
    "name", [n if n in ("one pass", "chaotic") else pytest.param(n, marks=pytest.mark.thorough) for n in CASES]
)
def test_a_checkpoint_changes_nothing(name, plain, tmp_path):
    path = tmp_path / "basins.h5"
    found = CASES[name](checkpoint=path)
    assert_same(found, plain[name])
    assert_same(load_basins(path), plain[name])
    assert [p.name for p in tmp_path.iterdir()] == ["basins.h5"]
    assert found.point_map is not None


def test_what_a_kill_leaves_before_the_lock_is_removed(plain, tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", Mock(side_effect=Died))
        with pytest.raises(Died):
            CASES["one pass"](checkpoint=tmp_path / "basins.h5")
    assert len(list(tmp_path.iterdir())) == 1
    assert_same(CASES["one pass"](checkpoint=tmp_path / "basins.h5"), plain["one pass"])
    assert [p.name for p in tmp_path.iterdir()] == ["basins.h5"]


def test_the_same_call_reads_what_is_finished(plain, finished, tmp_path, monkeypatch):
    path = Path(shutil.copy(finished, tmp_path))
    monkeypatch.setattr(Search, "by_sample", lambda *_: pytest.fail("searched again"))
    again = CASES["one pass"](checkpoint=path)
    assert_same(again, plain["one pass"])
    assert again.verify(50).wrong == 0


def test_a_finished_image_can_be_saved_elsewhere_and_in_its_own_place(plain, tmp_path):
    path = tmp_path / "basins.h5"
    found = CASES["one pass"](checkpoint=path)
    CASES["one pass"](checkpoint=path).labels[:] = 0
    for target in (tmp_path / "other.h5", path):
        assert_same(load_basins(save_basins(found, target)), plain["one pass"])


# --- runs that end before their time


QUICK = {("small basins", 1, True), ("one pass", 5, False), ("given starts", 5, False)}


@pytest.mark.parametrize(
    ("name", "moment", "torn"),
    [
        pytest.param(
            *case, marks=[] if case in QUICK else pytest.mark.thorough if case[1] in (1, 5) else pytest.mark.slow
        )
        for case in product(CASES, (1, 5, 0, 2, 4), (True, False))
        if case[2] == (case[1] == 1)
    ],
)
def test_a_run_goes_on_where_it_died(name, moment, torn, plain, tmp_path, monkeypatch):
    path = tmp_path / "basins.h5"
    died = False
    dying(monkeypatch, moment, torn)
    try:
        CASES[name](checkpoint=path)
    except Died:
        died = True
        with h5py.File(path, "r") as file:
            assert file.attrs["format"] == b"cellmap checkpoint"
        with pytest.raises(StoreError, match="not one of basins"):
            load_basins(path)
    monkeypatch.undo()
    done = count_of_tiles(monkeypatch)
    assert_same(CASES[name](checkpoint=path), plain[name])
    assert_same(load_basins(path), plain[name])
    if died and not torn:
        assert done[0] == TILES[name] - moment, "tiles that were done are not done again"


TILES = {"one pass": 4, "small basins": 4, "undecided": 6, "multi-period steps": 6, "chaotic": 3, "given starts": 9}
"""Tiles of all passes, as an undisturbed run has them."""


def count_of_tiles(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    original, count = cellmap._lib.checkpoint.Checkpoint.finish, [0]

    def finish(self, *entry):
        count[0] += 1
        return original(self, *entry)

    monkeypatch.setattr(cellmap._lib.checkpoint.Checkpoint, "finish", finish)
    return count


@pytest.mark.parametrize("moment", [0, *(pytest.param(k, marks=pytest.mark.thorough) for k in (1, 2))])
def test_a_run_that_dies_between_passes(moment, plain, tmp_path, monkeypatch):
    """Files of passes, and that of the result, take their places as a whole: either the older or the newer is there."""
    path, original, left = tmp_path / "basins.h5", Path.replace, moment

    def replace(self, target):
        nonlocal left
        left -= 1
        if left < 0:
            raise Died
        return original(self, target)

    monkeypatch.setattr(Path, "replace", replace)
    with pytest.raises(Died):
        CASES["small basins"](checkpoint=path)
    monkeypatch.undo()
    assert_same(CASES["small basins"](checkpoint=path), plain["small basins"])


@pytest.mark.parametrize("torn", [False, True], ids=["clean", "torn"])
@pytest.mark.parametrize("moment", [0, *(pytest.param(k, marks=pytest.mark.thorough) for k in (2, 3)), 4])
def test_a_table_goes_on_where_it_died(moment, torn, tmp_path, monkeypatch):
    path = tmp_path / "table.h5"
    expected = interpolated_map(duffing(), TABLE).table
    dying(monkeypatch, moment, torn)
    with pytest.raises(Died):
        interpolated_map(duffing(), TABLE, checkpoint=path)
    monkeypatch.undo()
    for _ in range(2):
        found = interpolated_map(duffing(), TABLE, checkpoint=path).table
        for name in ("coefficients", "indicator", "fallback"):
            assert getattr(found, name).tobytes() == getattr(expected, name).tobytes()


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
def test_nodes_without_an_image_are_kept_as_they_are(tmp_path):
    """The table fills them from their neighbours; the file must not, or the cells around them are no longer known."""
    exact = discrete_map(lambda x, p: (x[0] ** 2 if x[0] < 1.5 else x[0] ** 999, x[1] / 2), {}, ("x", "y"), name="far")
    grid, path = CellGrid((-1.0, -1.0), (3.0, 1.0), (50, 40)), tmp_path / "table.h5"
    expected = interpolated_map(exact, grid)
    for _ in range(2):
        found = interpolated_map(exact, grid, checkpoint=path)
        assert np.array_equal(found.table.fallback, expected.table.fallback)
        assert found.table.coefficients.tobytes() == expected.table.coefficients.tobytes()


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


@pytest.mark.parametrize("block", [8, 64, 2**20])
@pytest.mark.parametrize("total", [1, 8, 65, 1000])
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
