"""Arguments, attributes and files with the names that they had in cellmap 0.1."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from interrupted_files import READERS, halves

from cellmap import CellGrid, discrete_map, find_basins, load_basins, save_basins
from cellmap._lib.sealed import get_mapping, put_text, seal
from cellmap.attractors.examined import Examined
from cellmap.basins import recompute_basins
from cellmap.basins.label_file import _read_examined, _write_examined


def renamed_text(group: h5py.Group, name: str, names: dict[str, str]) -> None:
    values = {names.get(key, key): value for key, value in get_mapping(group, name).items()}
    if f".{name}" in group:
        del group[f".{name}"]
    else:
        del group.attrs[name]
    put_text(group, name, json.dumps(values))


def test_settings_of_older_files_have_the_names_of_today(tmp_path: Path) -> None:
    basins, path = halves(), tmp_path / "old.h5"
    save_basins(basins, path)
    with h5py.File(path, "r+") as file:
        renamed_text(file["basins"], "settings", {"longest_period": "max_period"})
    seal(path)
    loaded = load_basins(path)
    assert loaded.settings == basins.settings
    source = discrete_map(lambda x, p: (x[0] / 2, x[1] / 3), {}, ("x", "y"))
    assert np.array_equal(recompute_basins(loaded, source).labels, basins.labels)


@pytest.mark.parametrize("pass_", ["first pass", "later pass"])
def test_an_older_run_goes_on(pass_: str, files: Path, tmp_path: Path) -> None:
    """Nothing that was computed under the former names is refused, and the labels are those of one go."""
    path = Path(shutil.copy(files / f"{pass_}.h5", tmp_path / "old.h5"))
    with h5py.File(path, "r+") as file:
        renamed_text(file, "belongs", {"longest_period": "max_period"})
        attributes = file["pass"].attrs
        for now, before in {"restart_times": "legs", "time_limit": "horizon"}.items():
            attributes[before] = attributes[now]
            del attributes[now]
    seal(path)
    assert READERS[pass_](path) == READERS["finished"](files / "finished.h5")


@pytest.mark.parametrize("count", [0, 1, 3])
def test_what_was_tried_comes_back_with_its_lines(count: int, tmp_path: Path) -> None:
    """Lines that do not attract are counted by a search; files of 0.1 had none of them."""
    rng, point_map = np.random.default_rng(0), discrete_map(lambda x, p: (x[0] / 2, x[1]), {}, ("x", "y"))
    tried = Examined.nothing_yet(point_map, np.ones(2))
    tried.refuse(rng.normal(size=(4, 2)))
    tried.lines += [rng.normal(size=(k + 2, 2)) for k in range(count)]
    with h5py.File(tmp_path / "tried.h5", "w") as file:
        _write_examined(file.create_group("now"), tried)
        again = _read_examined(file["now"], Examined.nothing_yet(point_map, np.ones(2)))
        assert [line.tobytes() for line in again.lines] == [line.tobytes() for line in tried.lines]
        assert again.points.tobytes() == tried.points.tobytes()
        if count:
            file["now/points of lines"][0] = 99
            with pytest.raises(ValueError, match="points of lines"):
                _read_examined(file["now"], Examined.nothing_yet(point_map, np.ones(2)))
        del file["now/lines"], file["now/points of lines"]
        assert _read_examined(file["now"], Examined.nothing_yet(point_map, np.ones(2))).lines == []


def test_an_older_argument_is_accepted_with_a_warning() -> None:
    point_map, grid = discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",)), CellGrid((-1,), (1,), (10,))
    old: dict[str, Any] = {"max_period": 4}
    message = "max_period is called longest_period since .*longest_period=4"
    with pytest.warns(DeprecationWarning, match=message) as found:
        basins = find_basins(point_map, grid, **old)
    assert basins.settings["longest_period"] == 4
    assert found[0].filename == __file__
