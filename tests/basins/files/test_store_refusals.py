"""Files of basins that are damaged, foreign or newer, and arguments that cannot be stored."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from cellmap import load_basins, save_basins
from cellmap._lib.sealed import seal
from cellmap.basins import StoreError

NOT_HDF5 = "odd.h5' is truncated, damaged or no HDF5 file"
FOREIGN = "is an HDF5 file, but not one of basins that cellmap wrote"


def test_what_is_no_file_of_basins(tmp_path, stored):
    path, whole = tmp_path / "odd.h5", stored.read_bytes()
    with pytest.raises(FileNotFoundError, match=r"odd\.h5'?: there is no such file"):
        load_basins(path)
    parts = (whole[: int(fraction * len(whole))] for fraction in (0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99, 0.9999))
    for contents in (b"", b"theta, omega\n1, 2\n" * 100, *parts):
        path.write_bytes(contents)
        with pytest.raises(StoreError, match=NOT_HDF5):
            load_basins(path)
    for names in ({}, {"labels": np.zeros((3, 3))}):
        with h5py.File(path, "w") as file:
            file.attrs["format"] = "somebody else's"
            for name, values in names.items():
                file[name] = values
        with pytest.raises(StoreError, match=FOREIGN):
            load_basins(path)
        with pytest.raises(StoreError, match=rf"{FOREIGN}$"):
            load_basins(path, unverified=True)


def test_folders(tmp_path, made):
    with pytest.raises((FileNotFoundError, IsADirectoryError, StoreError), match=r"path=|is a folder"):
        load_basins(tmp_path)
    with pytest.raises(OSError):
        save_basins(made["initial_conditions"], tmp_path)
    with pytest.raises(FileNotFoundError, match=r"there is no folder .*nowhere.*; make it first"):
        save_basins(made["initial_conditions"], tmp_path / "nowhere" / "b.h5")
    assert list(tmp_path.iterdir()) == []


def test_newer_layout(stored, tmp_path):
    path = Path(shutil.copy(stored, tmp_path / "newer.h5"))
    with h5py.File(path, "r+") as file:
        file.attrs["schema"] = 99
    seal(path)
    with pytest.raises(StoreError, match="has layout 99 and this cellmap knows 2: update cellmap"):
        load_basins(path)


def test_names_of_images(made, tmp_path):
    path = save_basins({"a": made["initial_conditions"], "b": made["grid"]}, tmp_path / "two.h5")
    with pytest.raises(KeyError, match=r"two\.h5.* holds a, b; name one of them"):
        load_basins(path)
    with pytest.raises(KeyError, match="name='c'"):
        load_basins(path, "c")
    for names in ({}, {"": made["grid"]}, {"a/b": made["grid"]}):
        with pytest.raises(ValueError, match="at least one, none of them empty or with a slash"):
            save_basins(names, tmp_path / "bad.h5")
    for wrong in ([1, 2], {"a": 3}):
        with pytest.raises((TypeError, ValueError), match="basins"):
            save_basins(wrong, tmp_path / "bad.h5")
    assert [p.name for p in tmp_path.iterdir()] == ["two.h5"]


CHANGES = {
    "attribute": lambda file: file.attrs.__setitem__("note", "mine"),
    "attribute of labels": lambda file: file["basins/labels"].attrs.__setitem__("note", "mine"),
    "array": lambda file: file.__setitem__("mine", np.arange(3.0)),
    "array of basins": lambda file: file.__setitem__("basins/mine", np.arange(3.0)),
    "group": lambda file: file.create_group("laboratory").attrs.__setitem__("who", "me"),
    "label": lambda file: file["basins/labels"].__setitem__((0, 0), -3),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_file_that_its_owner_has_changed_is_read_when_asked_for_so(change, stored, made, tmp_path):
    path = Path(shutil.copy(stored, tmp_path / "changed.h5"))
    with h5py.File(path, "r+") as file:
        CHANGES[change](file)
    with pytest.raises(StoreError, match=r"another program has changed it.*unverified=True|damaged"):
        load_basins(path)
    again, expected = load_basins(path, unverified=True), made["grid"].labels.copy()
    expected[0, 0] = -3 if change == "label" else expected[0, 0]
    np.testing.assert_array_equal(again.labels, expected)
    save_basins(again, path)
    np.testing.assert_array_equal(load_basins(path).labels, expected)
