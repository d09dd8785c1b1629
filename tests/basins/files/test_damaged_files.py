"""Damaged files: an error that names the file, or what was written."""

import faulthandler
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from interrupted_files import READERS

import cellmap._lib.checkpoint
from cellmap._lib.sealed import ROOM
from cellmap.basins import StoreError

_SECONDS = 60.0  # for one file, and the run that goes on from it, on a busy machine


def damage(whole: bytes, rng: np.random.Generator) -> bytes:
    """Return contents as disks, programs and people leave them."""
    part = bytearray(whole)
    kind, size = rng.integers(8), int(rng.choice([1, 4, 512, 4096]))
    place = int(rng.integers(len(part))) // size * size
    if kind == 0:
        part[place] ^= 1 << int(rng.integers(8))
    elif kind == 1:
        part[place : place + size] = bytes(len(part[place : place + size]))
    elif kind == 2:
        part[place : place + size] = rng.bytes(len(part[place : place + size]))
    elif kind == 3:
        del part[place:]
    elif kind == 4:
        del part[place : place + size]
    elif kind == 5:
        part[place:place] = bytes(size)
    elif kind == 6:
        other = int(rng.integers(len(part))) // size * size
        part[place : place + size], part[other : other + size] = part[other : other + size], part[place : place + size]
    else:
        part += rng.bytes(size)
    return bytes(part)


def campaign(folder: Path, files: Path, count: int, seed: int) -> None:
    """Damage files and read them; say which one it is, so that one that hangs can be found."""
    rng, refused = np.random.default_rng(seed), 0
    cellmap.set_threads(1)
    for name, reader in READERS.items():
        whole, path = (files / f"{name}.h5").read_bytes(), folder / f"{name}.h5"
        shutil.copy(files / f"{name}.h5", path)
        expected = reader(path)
        for k in range(6 * count // 10 if name == "picture" else count // 10):
            path.write_bytes(damaged := damage(whole, rng))
            print(f"{name} {k}", file=sys.stderr, flush=True)
            faulthandler.dump_traceback_later(_SECONDS, exit=True)
            try:
                found = reader(path)
            except StoreError as error:
                refused += 1
                assert str(path) in str(error), error
                assert path.read_bytes() == damaged, "what cannot be read is not changed"
            else:
                assert found == expected
    faulthandler.cancel_dump_traceback_later()
    print(f"{refused} refused")


def run_campaign(folder: Path, files: Path, count: int) -> int:
    here = Path(__file__).parent
    program = (
        f"import sys; sys.path[:0] = {[str(here), str(here.parent), str(here.parent / 'checkpoints')]!r}\n"
        "from pathlib import Path\n"
        "from test_damaged_files import campaign\n"
        f"campaign(Path({str(folder)!r}), Path({str(files)!r}), {count}, 0)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return int(done.stdout.split()[0])


@pytest.mark.parametrize(
    "count", [pytest.param(100, marks=pytest.mark.thorough), pytest.param(10_000, marks=pytest.mark.slow)]
)
def test_damage_is_an_error_that_names_the_file_or_changes_nothing(count, files, tmp_path):
    """In a process of its own, which ends where a file takes long: HDF5's library does not listen to anything else."""
    refused = run_campaign(tmp_path, files, count)
    assert refused > 0.6 * count, "what is not refused has hit tiles that are done again"


@pytest.mark.parametrize(
    "name", [n if n in ("picture", "table") else pytest.param(n, marks=pytest.mark.thorough) for n in READERS]
)
def test_every_sector_counts(name, files, tmp_path):
    """Each sector outside the arrays, zeroed, is noticed before HDF5 sees it."""
    whole, path = (files / f"{name}.h5").read_bytes(), tmp_path / "damaged.h5"
    content = json.loads(whole[len(b"cellmap seal 1\n") : ROOM].rstrip(b"\0"))
    arrays = [range(begin, begin + length) for begin, length in content["holes"]]
    for place in range(0, len(whole), 512):
        if not any(place in part or place + 511 in part for part in arrays) and any(whole[place : place + 512]):
            path.write_bytes(whole[:place] + bytes(512) + whole[place + 512 :])
            with pytest.raises(StoreError, match=r"damaged\.h5"):
                READERS[name](path)
