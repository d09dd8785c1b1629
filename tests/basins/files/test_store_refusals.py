"""Files of basins that are damaged, foreign or newer, and arguments that cannot be stored."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from stored_basins import assert_same

from cellmap import CellGrid, discrete_map, find_basins, load_basins, save_basins
from cellmap._lib.sealed import seal
from cellmap.basins import StoreError


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


@pytest.mark.parametrize("fraction", [0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99, 0.9999])
def test_truncated_file(stored, tmp_path, fraction):
    whole = stored.read_bytes()
    path = tmp_path / "part.h5"
    path.write_bytes(whole[: int(fraction * len(whole))])
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
        (image,) = file.values()
        return image["labels"].id.read_direct_chunk((0, 0))[1][:20]


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
        (image,) = file.values()
        damage(image)
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


def test_names_of_images(made, tmp_path):
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
def test_something_that_is_no_image(wrong, tmp_path):
    with pytest.raises((TypeError, ValueError), match="basins"):
        save_basins(wrong, tmp_path / "b.h5")
    assert list(tmp_path.iterdir()) == []


def test_arguments_in_the_wrong_order(made, tmp_path):
    with pytest.raises(TypeError, match=r"basins|path"):
        save_basins(tmp_path / "b.h5", made["grid"])


def own_attribute(file):
    file.attrs["note"] = file["basins/labels"].attrs["note"] = "mine"


def own_array(file):
    file["mine"] = file["basins/mine"] = np.arange(3.0)


def own_group(file):
    file.create_group("laboratory").attrs["who"] = "me"


@pytest.mark.parametrize("change", [own_attribute, own_array, own_group])
def test_a_file_that_its_owner_has_added_to_is_read_when_asked_for_so(change, tmp_path):
    halves = discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",))
    image = find_basins(halves, CellGrid((-1,), (1,), (8,)))
    path = save_basins(image, tmp_path / "a.h5")
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(StoreError, match=r"another program has changed it.*unverified=True"):
        load_basins(path)
    again = load_basins(path, unverified=True)
    np.testing.assert_array_equal(again.labels, image.labels)
    save_basins(again, path)
    assert load_basins(path).attractors[0].period == 1
