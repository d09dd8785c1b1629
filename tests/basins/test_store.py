"""Basins in files: complete, self-describing, written whole or not at all, read without running code."""

from __future__ import annotations

import json
import pickle
import shutil
import subprocess
import sys
from dataclasses import asdict, fields, replace
from math import pi
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import cellmap
import systems
from cellmap import (
    Attractor,
    Basins,
    CellGrid,
    discrete_map,
    find_basins,
    interpolated_map,
    load_basins,
    save_basins,
    stroboscopic_map,
)
from cellmap._lib.sealed import seal
from cellmap.attractors.labels import Label
from cellmap.basins import StoreError

GRID = CellGrid((-pi, -100.0), (pi, 100.0), (24, 20))


def pendulum(**parameters: float):
    return stroboscopic_map(systems.driven_pendulum(**parameters))


def table(**options):
    return interpolated_map(pendulum(), CellGrid((-pi, -100.0), (pi, 100.0), (48, 32)), **options)


CASES = {
    "grid": lambda: find_basins(pendulum(), GRID),
    "many attractors": lambda: find_basins(
        pendulum(amplitude=0.010), CellGrid((-pi, -500.0), (pi, 500.0), (60, 60)), max_periods=900, max_period=8
    ),
    "table, escaped": lambda: find_basins(table(outside="escape"), GRID),
    "table, tolerance": lambda: find_basins(table(order=3, outside="integrate", tolerance=0.1), GRID),
    "initial_conditions": lambda: find_basins(pendulum(), np.random.default_rng(0).uniform(-3, 3, (5, 4, 2))),
    "one start": lambda: find_basins(pendulum(), [0.1, 0.2]),
    "chaotic and diverged": lambda: find_basins(systems.henon_map(), CellGrid((-2, -2), (2, 2), (30, 30))),
    "undecided": lambda: find_basins(pendulum(damping=0.0), [[0.1, 1.0], [1.0, 2.0]], max_periods=3),
    "quasi-periodic": lambda: find_basins(
        discrete_map(lambda x, p: (2.1 * x[0] * (1 - x[1]), x[0]), {}, ("x", "y")), CellGrid((0, 0), (1, 1), (20, 20))
    ),
    "no parameters": lambda: find_basins(
        discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",)), CellGrid((-1,), (1,), (9,))
    ),
}


@pytest.fixture(scope="module")
def made() -> dict[str, Basins]:
    return {name: make() for name, make in CASES.items()}


@pytest.fixture(scope="module")
def stored(made, tmp_path_factory) -> Path:
    """A file of one basin image, never changed."""
    return save_basins(made["grid"], tmp_path_factory.mktemp("stored") / "grid.h5")


def assert_same_record(a, b) -> None:
    for f in fields(a):
        one, other = getattr(a, f.name), getattr(b, f.name)
        if isinstance(one, np.ndarray):
            assert one.dtype == other.dtype, f.name
            assert np.array_equal(one, other), f.name
        elif f.name in ("neighbourhood", "cover", "circle") and one is not None:
            assert_same_record(one, other)
        elif f.name == "cycle_period":
            assert np.array_equal(one, other, equal_nan=True)
        else:
            assert one == other, f.name


def assert_same(a: Basins, b: Basins) -> None:
    for f in fields(Basins):
        if f.name not in ("attractors", "point_map", "params", "settings", "cost"):
            one, other = getattr(a, f.name), getattr(b, f.name)
            if isinstance(one, np.ndarray):
                assert one.dtype == other.dtype, f.name
                assert one.shape == other.shape, f.name
                assert np.array_equal(one, other), f.name
            else:
                assert one == other, f.name
    assert dict(a.params) == dict(b.params)
    assert plain(a.settings) == plain(b.settings)
    assert asdict(a.cost) == asdict(b.cost)
    assert len(a.attractors) == len(b.attractors)
    for one, other in zip(a.attractors, b.attractors, strict=True):
        assert_same_record(one, other)


def plain(value):
    return json.loads(json.dumps(value))


# --- round trip


@pytest.mark.parametrize("name", CASES)
def test_round_trip(name, made, tmp_path):
    basins = made[name]
    path = save_basins(basins, tmp_path / "basins.h5")
    same = load_basins(path)
    assert_same(basins, same)
    assert same.point_map is None
    assert repr(same) == repr(basins)
    assert same.fractions == basins.fractions
    assert [a.name for a in same.attractors] == [a.name for a in basins.attractors]
    assert [repr(a) for a in same.attractors] == [repr(a) for a in basins.attractors]


def test_every_code_is_stored(made, tmp_path):
    """The cases hold all codes between them."""
    codes = set()
    for basins in made.values():
        codes |= set(np.unique(load_basins(save_basins(basins, tmp_path / "b.h5")).labels).tolist())
    assert {Label.ESCAPED, Label.DIVERGED, Label.UNDECIDED, 0, 1} <= codes


def test_several_pictures_in_one_file(made, tmp_path):
    path = save_basins({name.replace(",", ""): basins for name, basins in made.items()}, tmp_path / "all.h5")
    for name, basins in made.items():
        assert_same(basins, load_basins(path, name.replace(",", "")))


def test_stored_twice_gives_the_same_again(stored, tmp_path):
    first = load_basins(stored)
    assert_same(first, load_basins(save_basins(first, tmp_path / "again.h5")))


@pytest.mark.parametrize("kind", [str, Path])
def test_paths_of_any_kind(kind, made, tmp_path):
    path = save_basins(made["initial_conditions"], kind(tmp_path / "with blanks and ü.h5"))
    assert isinstance(path, Path)
    assert_same(made["initial_conditions"], load_basins(kind(path)))


def test_labels_of_every_number_survive(made, tmp_path):
    """int16 from -3 to 30,000, in any pattern."""
    rng = np.random.default_rng(0)
    labels = rng.integers(-3, 30_000, GRID.shape).astype(np.int16)
    times = rng.integers(-1, 2**31 - 1, GRID.shape).astype(np.int32)
    few = replace(made["grid"], labels=np.minimum(labels, 1), settling_time=times)
    same = load_basins(save_basins(few, tmp_path / "b.h5"))
    assert np.array_equal(same.labels, few.labels)
    assert np.array_equal(same.settling_time, times)


# --- the file itself


def test_file_describes_itself_to_plain_h5py(made, tmp_path):
    basins = made["table, escaped"]
    path = save_basins(basins, tmp_path / "b.h5")
    with h5py.File(path, "r") as file:
        assert file.attrs["format"].decode() == "cellmap basins"
        assert file.attrs["schema"] == 2
        assert json.loads(file.attrs["versions"]).keys() == {"cellmap", "numpy", "numba", "h5py"}
        assert json.loads(file.attrs["versions"])["cellmap"] == cellmap.__version__
        assert file.attrs["written"][:2] == b"20"
        assert file.attrs["machine"]
        (picture,) = file.values()
        assert picture.attrs["system"] == b"driven pendulum"
        assert json.loads(picture.attrs["params"]) == dict(basins.params)
        assert json.loads(picture.attrs["settings"])["map"]["exact"]["rtol"] == 1e-9
        assert [c["name"] for c in json.loads(picture.attrs["coordinates"])] == ["theta", "theta'"]
        assert json.loads(picture.attrs["coordinates"])[1]["unit"] == "rad/s"
        assert picture["grid"].attrs["shape"].tolist() == list(GRID.shape)
        assert picture["grid"].attrs["wraps"].tolist() == [True, False]
        assert np.array_equal(picture["labels"][()], basins.labels)
        meaning = json.loads(picture["labels"].attrs["meaning"])
        assert meaning["0"] == "fixed point (0, 0)"
        assert (meaning["-1"], meaning["-2"], meaning["-3"]) == ("escaped", "diverged", "undecided")
        assert picture["labels"].compression == "gzip"
        assert picture["labels"].fletcher32
        assert picture["settling_time"].attrs["unit"] == b"periods"
        first = picture["attractors/0"]
        assert first.attrs["kind"] == b"fixed point"
        assert first["points"].shape == (1, 2)
        assert first["multipliers"].dtype.kind == "c"


def test_file_is_compressed(made, tmp_path):
    big = find_basins(pendulum(), CellGrid((-pi, -100.0), (pi, 100.0), (300, 300)))
    path = save_basins(big, tmp_path / "b.h5")
    assert path.stat().st_size < 0.5 * (big.labels.nbytes + big.settling_time.nbytes)


def test_nothing_in_the_file_is_code(stored):
    """No pickles, no object references: plain numbers and text."""
    assert pickle.dumps(np.zeros(3))[:2] not in stored.read_bytes()
    found = []
    with h5py.File(stored, "r") as file:
        file.visititems(lambda _, item: found.append(item.dtype.kind) if isinstance(item, h5py.Dataset) else None)
    assert set(found) <= set("iufc")


def test_reading_runs_nothing(made, tmp_path):
    """A name in the file that looks like code stays a name."""
    nasty = "__import__('os').system('touch hacked')"
    save_basins(replace(made["grid"], name=nasty, params={nasty: 1.0}), tmp_path / "b.h5")
    program = (
        f"import os; os.chdir({str(tmp_path)!r}); from cellmap import load_basins; print(load_basins('b.h5').name)"
    )
    output = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert output.strip() == nasty
    assert not (tmp_path / "hacked").exists()


def test_reading_needs_no_system_and_compiles_nothing(stored):
    program = (
        f"from cellmap import load_basins; b = load_basins({str(stored)!r}); print(b.label_name(0), b.labels.shape);"
        "import sys; assert not any(n.startswith('cellmap_') for n in sys.modules)"
    )
    output = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert output.strip() == "fixed point (0, 0) (24, 20)"


# --- files that are not what they should be


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.h5'?: there is no such file"):
        load_basins(tmp_path / "none.h5")


def test_folder_in_the_place_of_a_file(tmp_path, made):
    with pytest.raises((FileNotFoundError, IsADirectoryError, StoreError), match=r"path=|is a folder"):
        load_basins(tmp_path)
    with pytest.raises(OSError):
        save_basins(made["initial_conditions"], tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_missing_folder(made, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"there is no folder .*nowhere.*; make it first"):
        save_basins(made["initial_conditions"], tmp_path / "nowhere" / "b.h5")


def test_text_file(tmp_path):
    path = tmp_path / "notes.h5"
    path.write_text("theta, omega\n1, 2\n" * 100)
    with pytest.raises(StoreError, match=r"notes\.h5' is truncated, damaged or no HDF5 file"):
        load_basins(path)


def test_empty_file(tmp_path):
    path = tmp_path / "empty.h5"
    path.touch()
    with pytest.raises(StoreError, match=r"empty\.h5"):
        load_basins(path)


def test_foreign_hdf5_file(tmp_path):
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["labels"] = np.zeros((3, 3))
        file.attrs["format"] = "somebody else's"
    with pytest.raises(StoreError, match="is an HDF5 file, but not one of basins that cellmap wrote"):
        load_basins(tmp_path / "foreign.h5")
    with pytest.raises(StoreError, match=r"is an HDF5 file, but not one of basins that cellmap wrote$"):
        load_basins(tmp_path / "foreign.h5", unverified=True)
    with h5py.File(tmp_path / "bare.h5", "w"):
        pass
    with pytest.raises(StoreError, match="is an HDF5 file, but not one of basins"):
        load_basins(tmp_path / "bare.h5")


def test_newer_layout(stored, tmp_path):
    path = shutil.copy(stored, tmp_path / "newer.h5")
    with h5py.File(path, "r+") as file:
        file.attrs["schema"] = 99
    seal(Path(path))
    with pytest.raises(StoreError, match="has layout 99 and this cellmap knows 2: update cellmap"):
        load_basins(path)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99, 0.9999])
def test_truncated_file(stored, tmp_path, share):
    whole = stored.read_bytes()
    path = tmp_path / "part.h5"
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(StoreError, match=r"part\.h5' is truncated, damaged or no HDF5 file"):
        load_basins(path)


@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_flipped_bit_is_an_error_or_changes_nothing(stored, tmp_path, place, bit):
    damaged = bytearray(stored.read_bytes())
    damaged[int(place * len(damaged))] ^= 1 << bit
    path = tmp_path / "damaged.h5"
    path.write_bytes(damaged)
    try:
        read = load_basins(path)
    except StoreError as error:
        assert "damaged.h5" in str(error)
    else:
        assert_same(read, load_basins(stored))


@pytest.mark.parametrize("part", ["labels", "points", "params", "upper"])
def test_damaged_part_is_noticed(part, stored, tmp_path):
    """One changed byte in the labels, in a point of an attractor, in a parameter, in the window."""
    basins = load_basins(stored)
    needle = {
        "labels": stored_chunk(stored),
        "points": basins.attractors[1].points.tobytes(),
        "params": b'"amplitude": 0.003',
        "upper": np.array(basins.grid.upper).tobytes(),
    }[part]
    whole = stored.read_bytes()
    place = whole.index(needle) + len(needle) - 1
    path = tmp_path / "damaged.h5"
    path.write_bytes(whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :])
    with pytest.raises(StoreError, match=r"damaged\.h5"):
        load_basins(path)


def stored_chunk(path: Path) -> bytes:
    with h5py.File(path, "r") as file:
        (picture,) = file.values()
        return picture["labels"].id.read_direct_chunk((0, 0))[1][:20]


@pytest.mark.parametrize(
    "damage",
    [
        lambda p: p.pop("labels"),
        lambda p: p.pop("settling_time"),
        lambda p: p.pop("attractors"),
        lambda p: p.attrs.pop("params"),
        lambda p: p.attrs.__setitem__("params", "{not json"),
        lambda p: p.attrs.__setitem__("coordinates", "[]"),
        lambda p: p.attrs.__setitem__("coordinates", json.dumps([{"nome": "x"}])),
        lambda p: p["attractors/0"].attrs.__setitem__("kind", "unheard of"),
        lambda p: p["attractors/0"].attrs.__setitem__("period", "many"),
        lambda p: p["grid"].attrs.__setitem__("upper", [-10.0, -1000.0]),
        lambda p: p["grid"].attrs.__setitem__("shape", [3, 3]),
        lambda p: (p.pop("labels"), p.__setitem__("labels", np.zeros((2, 2), np.int16))),
        lambda p: (p.pop("labels"), p.__setitem__("labels", np.full((24, 20), 77, np.int16))),
        lambda p: (p.pop("labels"), p.__setitem__("labels", np.full((24, 20), -9, np.int16))),
        lambda p: (p.pop("labels"), p.__setitem__("labels", np.zeros((24, 20)))),
        lambda p: (p.pop("settling_time"), p.__setitem__("settling_time", np.full((24, 20), -2, np.int32))),
        lambda p: (p.pop("settling_time"), p.__setitem__("settling_time", np.zeros((20, 24), np.int32))),
        lambda p: p.attrs.__setitem__("inaccurate", -1),
        lambda p: p.attrs.__setitem__("inaccurate", 2.5),
        lambda p: p.attrs.__setitem__("params", json.dumps({"a": [1, 2]}).encode()),
        lambda p: p.attrs.__setitem__("cost", b'{"dollars": 3}'),
        lambda p: p["attractors/0"].attrs.__setitem__("turns", [1, 2, 3]),
        lambda p: p["attractors/0"].attrs.__setitem__("period", 2),
        lambda p: (p["attractors/0"].pop("points"), p.__setitem__("attractors/0/points", np.full((1, 2), np.nan))),
        lambda p: (p["attractors/0"].pop("multipliers"), p.__setitem__("attractors/0/multipliers", np.ones(2))),
        lambda p: (p["attractors/0"].pop("neighbourhood"), p.__setitem__("attractors/0/neighbourhood/centres", 1.0)),
        lambda p: p.move("attractors/0", "attractors/7"),
    ],
)
def test_file_whose_parts_do_not_fit_is_an_error(stored, tmp_path, damage):
    path = Path(shutil.copy(stored, tmp_path / "odd.h5"))
    with h5py.File(path, "r+") as file:
        (picture,) = file.values()
        damage(picture)
    with pytest.raises(StoreError, match=r"odd\.h5.*its contents are not those that were written|odd\.h5.*it had"):
        load_basins(path)
    with pytest.raises(StoreError, match=r"odd\.h5"):
        load_basins(path, unverified=True)
    seal(path)
    with pytest.raises(StoreError, match=r"odd\.h5"):
        load_basins(path)


def test_a_file_that_was_changed_on_purpose(stored, tmp_path):
    path = Path(shutil.copy(stored, tmp_path / "changed.h5"))
    with h5py.File(path, "r+") as file:
        next(iter(file.values()))["labels"][0, 0] = -3
    with pytest.raises(StoreError, match="damaged"):
        load_basins(path)
    assert load_basins(path, unverified=True).labels[0, 0] == -3


def test_names_of_pictures(made, tmp_path):
    path = save_basins({"a": made["initial_conditions"], "b": made["grid"]}, tmp_path / "two.h5")
    with pytest.raises(KeyError, match=r"two\.h5.* holds a, b; name one of them"):
        load_basins(path)
    with pytest.raises(KeyError, match="name='c'"):
        load_basins(path, "c")
    for names in ({}, {"": made["grid"]}, {"a/b": made["grid"]}):
        with pytest.raises(ValueError, match="at least one, none of them empty or with a slash"):
            save_basins(names, tmp_path / "bad.h5")
    assert not (tmp_path / "bad.h5").exists()


@pytest.mark.parametrize("wrong", [None, 3, "basins", [1, 2], {"a": 3}], ids=repr)
def test_something_that_is_no_picture(wrong, tmp_path):
    with pytest.raises((TypeError, ValueError), match="basins"):
        save_basins(wrong, tmp_path / "b.h5")
    assert list(tmp_path.iterdir()) == []


def test_arguments_in_the_wrong_order(made, tmp_path):
    with pytest.raises(TypeError, match=r"basins|path"):
        save_basins(tmp_path / "b.h5", made["grid"])


# --- whole or not at all


class Interruption(Exception):
    pass


@pytest.mark.parametrize("error", [Interruption, KeyboardInterrupt, SystemExit, OSError, MemoryError])
@pytest.mark.parametrize("writes", [0, 1, 2, 5])
@pytest.mark.parametrize("older", [True, False])
def test_interrupted_write_leaves_everything_as_it_was(made, tmp_path, monkeypatch, error, writes, older):
    path = tmp_path / "b.h5"
    if older:
        save_basins(made["initial_conditions"], path)
    before = path.read_bytes() if older else None
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
    monkeypatch.undo()
    assert [p.name for p in tmp_path.iterdir()] == (["b.h5"] if older else [])
    if older:
        assert path.read_bytes() == before


def test_failing_move_leaves_no_temporary(made, tmp_path, monkeypatch):
    def failing(self, target):
        raise PermissionError("no")

    monkeypatch.setattr(Path, "replace", failing)
    with pytest.raises(PermissionError):
        save_basins(made["initial_conditions"], tmp_path / "b.h5")
    assert list(tmp_path.iterdir()) == []


def test_newer_file_replaces_the_older(made, tmp_path):
    path = save_basins(made["initial_conditions"], tmp_path / "b.h5")
    save_basins(made["grid"], path)
    assert_same(made["grid"], load_basins(path))
    assert [p.name for p in tmp_path.iterdir()] == ["b.h5"]


def test_readers_of_the_older_file_are_not_disturbed(made, tmp_path):
    path = save_basins(made["initial_conditions"], tmp_path / "b.h5")
    with h5py.File(path, "r") as reader:
        save_basins(made["grid"], path)
        (picture,) = reader.values()
        assert np.array_equal(picture["labels"][()], made["initial_conditions"].labels)
    assert_same(made["grid"], load_basins(path))


def test_file_has_ordinary_permissions(made, tmp_path):
    path = save_basins(made["initial_conditions"], tmp_path / "b.h5")
    (tmp_path / "plain").touch()
    assert path.stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_store_does_not_depend_on_the_folder_it_is_run_in(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = save_basins(made["initial_conditions"], "b.h5")
    assert_same(made["initial_conditions"], load_basins(path))


def test_records_that_are_stored_are_known_to_this_test():
    """A new field must be added to the store, and then here."""
    assert {f.name for f in fields(Basins)} == {
        *(
            "labels",
            "attractors",
            "settling_time",
            "grid",
            "initial_conditions",
            "name",
            "params",
            "coordinates",
            "settings",
        ),
        *("inaccurate", "undecided", "cost", "point_map"),
    }
    assert {f.name for f in fields(Attractor)} == {
        *("kind", "period", "points", "rotations", "multipliers", "exponents", "coordinates", "neighbourhood", "cover"),
        *("circle", "grazing_distance"),
    }
