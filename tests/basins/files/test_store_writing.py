"""Files of basins are written whole or not at all."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import h5py
import numpy as np
import pytest
from stored_basins import assert_same

from cellmap import Attractor, Basins, load_basins, save_basins


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
        (image,) = reader.values()
        assert np.array_equal(image["labels"][()], made["initial_conditions"].labels)
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
        *("circle", "torus", "grazing_distance", "resolution", "symmetry"),
    }
