"""Runs with a checkpoint that are killed or interrupted, in processes of their own."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from math import pi
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from checkpointed_runs import CASES, TABLE
from known_basins import CONSERVATIVE, assert_same, duffing, pendulum

from cellmap import Basins, CellGrid, find_basins, interpolated_map
from cellmap._lib.files import locked
from cellmap.basins import StoreError
from cellmap.utils import written_whole

PROGRAM = """
import sys
sys.path[:0] = {folders!r}
import test_killed_runs
test_killed_runs.long_run({path!r})
print("finished")
"""


def long_run(folder: str | Path) -> tuple[Basins, Basins]:
    """A table, basins of its map that take some sweeps, and some whose sweeps go on from where others ended."""
    grid = CellGrid((-pi, -500.0), (pi, 500.0), (260, 260))
    icm = interpolated_map(pendulum(), grid, checkpoint=Path(folder) / "table.h5")
    cells = CellGrid((-pi, -500.0), (pi, 500.0), (400, 400))
    basins = find_basins(icm, cells, 1000, 8, checkpoint=Path(folder) / "basins.h5")
    places = CellGrid((-0.6, -0.6), (0.6, 0.6), (140, 130))
    return basins, find_basins(CONSERVATIVE, places, 520, checkpoint=Path(folder) / "states.h5")


def assert_same_results(ours: tuple[Basins, ...], theirs: tuple[Basins, ...]) -> None:
    for one, other in zip(ours, theirs, strict=True):
        assert_same(one, other)


def started(tmp_path: Path) -> subprocess.Popen[str]:
    program = PROGRAM.format(folders=[str(p) for p in Path(__file__).parents[:2]], path=str(tmp_path))
    return subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def tiles_done(path: Path) -> dict[str, Any]:
    """What a file says of its tiles, and of its pass; every moment is a good one to look."""
    if not path.exists():
        return {}
    with h5py.File(path, "r", locking=False) as file:
        if "tiles" not in file:
            names = [name for name in file if name.startswith("tiles of")]
            return {name: int(np.count_nonzero(file[name]["done"])) for name in names} or {"result": True}
        moment = {"age": max(file["pass"].attrs["restart_times"], default=0)}
        return moment | {"tiles": int(np.count_nonzero(file["tiles"]["done"])), "rows": "rows" in file["pass"]}


MOMENTS: dict[str, tuple[str, Callable[[dict[str, Any]], bool]]] = {
    "while nodes are interpolated": ("table.h5", lambda seen: seen.get("tiles of displacement", 0) >= 1),
    "while the table is checked": ("table.h5", lambda seen: seen.get("tiles of indicator", 0) >= 1),
    "at the beginning of the first labels": ("basins.h5", lambda seen: "tiles" in seen),
    "during the first labels": ("basins.h5", lambda seen: seen.get("tiles", 0) >= 3),
    "during a later pass": ("basins.h5", lambda seen: bool(seen.get("rows"))),
    "during a pass that goes on from states": ("states.h5", lambda seen: seen.get("age", 0) > 0),
}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> tuple[Basins, Basins]:
    return long_run(tmp_path_factory.mktemp("undisturbed"))


def interrupt_at(tmp_path: Path, moment: str, number: int) -> tuple[int, str]:
    name, reached = MOMENTS[moment]
    process = started(tmp_path)
    try:
        while process.poll() is None and not reached(tiles_done(tmp_path / name)):
            time.sleep(0.002)
        process.send_signal(number)
        output, errors = process.communicate(timeout=120)
    finally:
        process.kill()
    return process.returncode, output + errors


@pytest.mark.parametrize(
    ("moment", "number"),
    [
        pytest.param(m, number, marks=pytest.mark.thorough if m == "during a later pass" else pytest.mark.slow)
        for m in MOMENTS
        for number in (signal.SIGKILL, signal.SIGINT)
    ],
)
def test_killed_without_mercy_or_interrupted_from_the_keyboard(moment, number, undisturbed, tmp_path):
    for attempt in range(5):  # a process that came to its end before the signal is started again
        folder = tmp_path / str(attempt)
        folder.mkdir()
        returned, output = interrupt_at(folder, moment, number)
        if returned != 0:
            break
    assert returned == -signal.SIGKILL or (returned != 0 and "KeyboardInterrupt" in output)
    for path in folder.glob("[!.]*.h5"):  # other names are those of files that are being written
        tiles_done(path)  # each is a file that can be read
    assert_same_results(long_run(folder), undisturbed)
    assert sorted(p.name for p in folder.iterdir()) == ["basins.h5", "states.h5", "table.h5"]


def test_temporary_files_of_others_stay(plain, tmp_path):
    """Of files whose names begin alike, and of whoever saves something; what killed writers left is removed."""
    (tmp_path / ".sweep.h5.0123456789abcdef.run.h5").write_bytes(b"half a file")
    names = ["sweep.2.h5", "sweep", "sweep.h5.h5", "weep.h5", "sweep.h5.0123456789abcdef.run.h5"]
    with contextlib.ExitStack() as stack:
        others = [stack.enter_context(written_whole(tmp_path / name, kind="run")) for name in names]
        others.append(stack.enter_context(written_whole(tmp_path / "sweep.h5")))
        CASES["given starts"](checkpoint=tmp_path / "sweep.h5")
        assert all(other.exists() for other in others)
    assert not (tmp_path / ".sweep.h5.0123456789abcdef.run.h5").exists()


def test_two_checkpoints_side_by_side(plain, tmp_path):
    """One after another removes what is left of its own, and never what the other one is writing."""
    names = ["sweep.h5", "sweep.gamma0.2.h5"]
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(lambda name: CASES["given starts"](checkpoint=tmp_path / name), names))
    for basins in found:
        assert_same(basins, plain["given starts"])


HOLDER = """
import sys
from pathlib import Path
from cellmap._lib.files import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_second_process_is_told_so(plain, tmp_path):
    path = tmp_path / "basins.h5"
    with subprocess.Popen([sys.executable, "-c", HOLDER, str(path)], stdin=-1, stdout=-1, text=True) as holder:
        assert holder.stdout.readline() == "held\n"
        for call in (
            CASES["given starts"],
            lambda checkpoint: interpolated_map(duffing(), TABLE, checkpoint=checkpoint),
        ):
            with pytest.raises(
                StoreError, match=rf"checkpoint=.*basins\.h5' is in use by process {holder.pid} on .*: wait"
            ):
                call(checkpoint=path)
        holder.kill()
    assert (tmp_path / ".basins.h5.lock").exists(), "the system gave the lock of the dead process back, not its file"
    assert_same(CASES["given starts"](checkpoint=path), plain["given starts"])
    assert [p.name for p in tmp_path.iterdir()] == ["basins.h5"]


def test_one_process_has_a_file_at_a_time(tmp_path):
    """Taken and given back by many threads: never two at once, although the file of the lock comes and goes."""
    inside, most = [], []

    def take(_: int) -> bool:
        try:
            with locked(tmp_path / "a.h5"):
                inside.append(1)
                most.append(len(inside))
                inside.pop()
                return True
        except StoreError:
            return False

    with ThreadPoolExecutor(8) as pool:
        taken = sum(pool.map(take, range(2000)))
    assert taken > 0
    assert max(most) == 1
    assert list(tmp_path.iterdir()) == []


LIMITED = """
import resource, sys
from pathlib import Path
from cellmap import CellGrid, discrete_map, find_basins, interpolated_map, save_basins
half = discrete_map(lambda x, p: (x[0] / 2, x[1] / 3), {}, ("x", "y"), name="half")
grid, folder = CellGrid((-1, -1), (1, 1), (60, 60)), Path(sys.argv[1])
basins, _ = find_basins(half, grid), interpolated_map(half, grid)
for limit in (0, 300, 1000, 3000, 10_000, 25_000, 40_000, 70_000, 90_000):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    for name, call in {
        "save": lambda: save_basins(basins, folder / "save"),
        "find": lambda: find_basins(half, grid, checkpoint=folder / "find"),
        "table": lambda: interpolated_map(half, grid, checkpoint=folder / "table"),
    }.items():
        try:
            call()
        except OSError as error:
            assert error.errno == 27 and "ulimit -f" in str(error) and "." + name in str(error), error
        else:
            print(name, limit)
            (folder / name).unlink()
"""


@pytest.mark.thorough
def test_a_limit_of_file_sizes_is_an_error_and_not_the_end_of_the_process(tmp_path):
    """HDF5's library crashes when a write fails, so that nothing is written by it for which there is no room."""
    done = subprocess.run([sys.executable, "-c", LIMITED, str(tmp_path)], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    smallest = {line.split()[0] for line in done.stdout.splitlines()}
    assert smallest >= {"save"}, "what has room is written"
    assert [p for p in tmp_path.iterdir() if not p.name.endswith(".lock")] == []
