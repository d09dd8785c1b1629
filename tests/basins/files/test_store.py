"""Basins in files: complete, self-describing, read without running code."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
from dataclasses import replace
from math import pi
from pathlib import Path

import h5py
import numpy as np
import pytest
from stored_basins import CASES, GRID, assert_same, pendulum

import cellmap
from cellmap import CellGrid, Label, find_basins, load_basins, save_basins

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


def test_several_images_in_one_file(made, tmp_path):
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
