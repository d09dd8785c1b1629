"""Checkpoints that are damaged, foreign, or of another run."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from math import cos
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from checkpointed_runs import CASES, TABLE, interrupted
from known_basins import FORCED, WINDOW, assert_same, duffing

from cellmap import CellGrid, find_basins, interpolated_map, load_basins, stroboscopic_map
from cellmap.basins import StoreError

pytestmark = pytest.mark.usefixtures("small_tiles")


@pytest.fixture(scope="module")
def begun(small_tiles, tmp_path_factory) -> Path:
    """The file of the same run, which died after its first tile."""
    return interrupted(CASES["one pass"], tmp_path_factory.mktemp("begun") / "basins.h5", 1)


@pytest.fixture(scope="module")
def interpolated_file(tmp_path_factory) -> Path:
    """The file of a finished table."""
    path = tmp_path_factory.mktemp("interpolated") / "table.h5"
    interpolated_map(duffing(), TABLE, checkpoint=path)
    return path


@pytest.fixture(scope="module")
def unfinished(small_tiles, tmp_path_factory) -> Path:
    """A run that died in a later pass."""
    path = interrupted(CASES["small basins"], tmp_path_factory.mktemp("unfinished") / "basins.h5", 3)
    with h5py.File(path, "r") as file:
        assert "rows" in file["pass"]
    return path


@pytest.mark.parametrize("part", ["labels", "settling_time", "pass/rows", "pass/settled", "pass/examined/guesses"])
def test_damage_to_what_earlier_passes_found_is_noticed(part, unfinished, tmp_path):
    path = Path(shutil.copy(unfinished, tmp_path / "basins.h5"))
    with h5py.File(path, "r+") as file:
        values = file[part][()]
        place = np.flatnonzero(file["labels"][()] >= 0)[5] if values.shape == file["labels"].shape else 0
        values.view(np.uint8).reshape(-1)[place * values.itemsize] ^= 1
        file[part][...] = values
    with pytest.raises(StoreError, match=r"checkpoint=.*basins\.h5' is damaged .*: delete it"):
        CASES["small basins"](checkpoint=path)


def test_foreign_file(tmp_path):
    path = tmp_path / "foreign.h5"
    with h5py.File(path, "w") as file:
        file["labels"] = np.zeros(3)
    for call in (CASES["one pass"], lambda checkpoint: interpolated_map(duffing(), TABLE, checkpoint=checkpoint)):
        before = path.read_bytes()
        with pytest.raises(StoreError, match=r"foreign\.h5' is not a checkpoint.*give the name of a new file"):
            call(checkpoint=path)
        assert path.read_bytes() == before


def test_a_table_in_the_place_of_an_image(interpolated_file, tmp_path):
    path = Path(shutil.copy(interpolated_file, tmp_path))
    with pytest.raises(ValueError, match="what='table', and this one has 'basins': give another file, or delete"):
        CASES["one pass"](checkpoint=path)
    with pytest.raises(StoreError, match="not one of basins"):
        load_basins(path)


def nearly_forced(t, x, p):
    return x[1], x[0] - 1.0000001 * x[0] ** 3 - p.delta * x[1] + p.gamma * cos(t)


CHANGES: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "limit": ("max_periods=None", lambda path: find_basins(duffing(), WINDOW, 1999, checkpoint=path)),
    "period": ("longest_period=32", lambda path: find_basins(duffing(), WINDOW, longest_period=5, checkpoint=path)),
    "parameter": ("params=", lambda path: find_basins(duffing().with_params(gamma=0.11), WINDOW, checkpoint=path)),
    "grid": (
        "initial_conditions=",
        lambda path: find_basins(duffing(), CellGrid((-2, -2), (2, 2), (9, 9)), checkpoint=path),
    ),
    "initial_conditions": ("initial_conditions=", lambda path: find_basins(duffing(), [[0.1, 0.2]], checkpoint=path)),
    "tolerance": ("map=", lambda path: find_basins(stroboscopic_map(FORCED), WINDOW, checkpoint=path)),
    "right-hand side": (
        "bits of images=",
        lambda path: find_basins(
            stroboscopic_map(replace(FORCED, rhs=nearly_forced), rtol=1e-5, atol=1e-5), WINDOW, checkpoint=path
        ),
    ),
}


@pytest.mark.parametrize("state", ["finished", "begun"])
@pytest.mark.parametrize("change", CHANGES)
def test_a_run_of_other_arguments_is_refused_and_names_them(change, state, plain, tmp_path, request):
    path = Path(shutil.copy(request.getfixturevalue(state), tmp_path))
    named, call = CHANGES[change]
    before = path.read_bytes()
    with pytest.raises(ValueError, match=f"with {named}.*and this one has .*: give another file, or delete this one"):
        call(path)
    assert path.read_bytes() == before
    assert_same(CASES["one pass"](checkpoint=path), plain["one pass"])


def test_known_attractors_belong_to_a_run(plain, tmp_path):
    known = plain["one pass"].attractors
    path = tmp_path / "basins.h5"
    CASES["one pass"](attractors=known, checkpoint=path)
    with pytest.raises(ValueError, match=r"attractors='2, .*', and this one has 'none'"):
        CASES["one pass"](checkpoint=path)


@pytest.mark.parametrize("name", ["order", "tolerance", "grid", "parameter"])
def test_another_table_is_refused(name, interpolated_file, tmp_path):
    path = Path(shutil.copy(interpolated_file, tmp_path))
    exact = duffing().with_params(gamma=0.2) if name == "parameter" else duffing()
    grid = CellGrid((-2.2, -2.2), (2.2, 2.2), (200, 151)) if name == "grid" else TABLE
    how = {"order": {"order": 3}, "tolerance": {"tolerance": 0.5}}.get(name, {})
    with pytest.raises(ValueError, match=r"checkpoint=.*table\.h5' belongs to another run, with"):
        interpolated_map(exact, grid, **how, checkpoint=path)
