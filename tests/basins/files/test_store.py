"""Basins in files: complete, self-describing, read without running code."""

import json
import pickle
import shutil
import subprocess
import sys
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from interrupted_files import READERS, halves
from known_basins import assert_same
from stored_basins import CASES, GRID

import cellmap
from cellmap import Attractor, Basins, CellGrid, discrete_map, find_basins, load_basins, save_basins
from cellmap._lib.sealed import get_mapping, put_text, seal
from cellmap.attractors.kinds.examined import Examined
from cellmap.basins import recompute_basins
from cellmap.basins.label_file import _read_examined, _write_examined

# --- round trip


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.thorough if n.startswith("limit") else []) for n in CASES]
)
def test_round_trip(name, made, tmp_path):
    basins = made[name]
    path = save_basins(basins, tmp_path / "basins.h5")
    same = load_basins(path)
    assert_same(basins, same)
    assert asdict(same.cost) == asdict(basins.cost)
    assert same.point_map is None
    assert repr(same) == repr(basins)
    assert same.fractions == basins.fractions
    assert [a.name for a in same.attractors] == [a.name for a in basins.attractors]
    assert [repr(a) for a in same.attractors] == [repr(a) for a in basins.attractors]


# --- the file itself


def test_file_describes_itself_to_plain_h5py(made, tmp_path):
    basins = made["table, escaped"]
    path = save_basins(basins, tmp_path / "b.h5")
    with h5py.File(path, "r") as file:
        assert file.attrs["format"].decode() == "cellmap basins"
        assert file.attrs["schema"] == 2
        assert json.loads(file.attrs["versions"]).keys() == {"cellmap", "numpy", "llvmlite", "h5py"}
        assert json.loads(file.attrs["versions"])["cellmap"] == cellmap.__version__
        assert file.attrs["written"][:2] == b"20"
        assert file.attrs["machine"]
        (image,) = file.values()
        assert image.attrs["system"] == b"driven pendulum"
        assert json.loads(image.attrs["params"]) == dict(basins.params)
        assert json.loads(image.attrs["settings"])["map"]["exact"]["rtol"] == 1e-9
        assert [c["name"] for c in json.loads(image.attrs["coordinates"])] == ["theta", "theta'"]
        assert json.loads(image.attrs["coordinates"])[1]["unit"] == "rad/s"
        assert image["grid"].attrs["shape"].tolist() == list(GRID.shape)
        assert image["grid"].attrs["wraps"].tolist() == [True, False]
        assert np.array_equal(image["labels"][()], basins.labels)
        meaning = json.loads(image["labels"].attrs["meaning"])
        assert meaning["0"] == "fixed point (0, 0)"
        assert (meaning["-1"], meaning["-2"], meaning["-3"]) == ("escaped", "diverged", "undecided")
        assert image["labels"].compression == "gzip"
        assert image["labels"].fletcher32
        assert image["settling_time"].attrs["unit"] == b"periods"
        first = image["attractors/0"]
        assert first.attrs["kind"] == b"fixed point"
        assert first["points"].shape == (1, 2)
        assert first["multipliers"].dtype.kind == "c"


def test_nothing_in_the_file_is_code(stored):
    """No pickles, no object references: plain numbers and text."""
    assert pickle.dumps(np.zeros(3))[:2] not in stored.read_bytes()
    found = []
    with h5py.File(stored, "r") as file:
        file.visititems(lambda _, item: found.append(item.dtype.kind) if isinstance(item, h5py.Dataset) else None)
    assert set(found) <= set("iufc")


def test_reading_needs_no_system_and_runs_nothing(made, tmp_path):
    """A name in the file that looks like code stays a name."""
    nasty = "__import__('os').system('touch hacked')"
    save_basins(replace(made["grid"], name=nasty, params={nasty: 1.0}), tmp_path / "b.h5")
    program = (
        f"import os; os.chdir({str(tmp_path)!r}); from cellmap import load_basins; b = load_basins('b.h5');"
        "print(b.label_name(0), b.labels.shape, b.name);"
        "import sys; assert not any(n.startswith('cellmap_') for n in sys.modules)"
    )
    output = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert output.strip() == f"fixed point (0, 0) (24, 20) {nasty}"
    assert not (tmp_path / "hacked").exists()


# --- written whole or not at all


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
@pytest.mark.parametrize("writes", [0, 5])
@pytest.mark.parametrize("older", [True, False])
def test_interrupted_write_leaves_everything_as_it_was(made, tmp_path, monkeypatch, error, writes, older):
    path = tmp_path / "b.h5"
    before = save_basins(made["initial_conditions"], path).read_bytes() if older else None
    original, left = h5py.Group.create_dataset, writes

    def failing(self, *args, **kwargs):
        nonlocal left
        if left == 0:
            raise error("interrupted")
        left -= 1
        return original(self, *args, **kwargs)

    monkeypatch.setattr(h5py.Group, "create_dataset", failing)
    with pytest.raises(error):
        save_basins(made["many attractors"], path)
    assert [p.name for p in tmp_path.iterdir()] == (["b.h5"] if older else [])
    assert not older or path.read_bytes() == before


def test_readers_of_the_older_file_are_not_disturbed(made, tmp_path, monkeypatch):
    """Whatever the folder is in which the store runs."""
    monkeypatch.chdir(tmp_path)
    path = save_basins(made["initial_conditions"], "with blanks and ü.h5")
    with h5py.File(path, "r") as reader:
        save_basins(made["grid"], path)
        (image,) = reader.values()
        assert np.array_equal(image["labels"][()], made["initial_conditions"].labels)
    assert_same(made["grid"], load_basins(str(path)))
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_records_that_are_stored_are_known_to_this_test():
    """A new field must be added to the store, and then here."""
    ours = "labels attractors settling_time grid initial_conditions name params coordinates settings inaccurate"
    assert {f.name for f in fields(Basins)} == {*ours.split(), "undecided", "cost", "point_map"}
    ours = "kind period points rotations multipliers exponents coordinates neighbourhood cover circle torus subspace"
    assert {f.name for f in fields(Attractor)} == {*ours.split(), "grazing_distance", "resolution", "symmetry"}


# --- arguments, attributes and files with the names that they had in cellmap 0.1


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
