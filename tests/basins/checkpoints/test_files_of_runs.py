"""Files of runs with a checkpoint: those of others, of dead processes, and where there is no room for them."""

import contextlib
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest
from checkpointed_runs import CASES, TABLE
from known_basins import assert_same, duffing

from cellmap import interpolated_map
from cellmap._lib.files import locked
from cellmap.basins import StoreError
from cellmap.utils import written_whole


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
