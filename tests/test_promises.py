"""What holds whatever happens: the same bits after kills, on any threads, from any cache; bad disks; no leak.

Each has a small witness here; the long campaign is thorough.
"""

import contextlib
import errno
import gc
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from math import cos, pi
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from cellmap import Basins, CellGrid, ForcedSystem, PointMap, discrete_map, find_basins, interpolated_map, set_threads
from cellmap._compiled.codegen.lookup import lookup_kernel
from cellmap._compiled.codegen.period import compiled_advance
from cellmap._compiled.machine_code import machine_code
from cellmap._lib.memory import give_back_memory
from cellmap.basins import load_basins, save_basins
from cellmap.maps import stroboscopic_map

WINDOW = CellGrid((-1.5, -1.0), (1.5, 1.05), (190, 180))  # three tiles
SMALL = CellGrid((-1.5, -1.0), (1.5, 1.05), (60, 50))
TABLE = CellGrid((-1.4, -1.2), (1.4, 1.2), (150, 150))


def wells() -> PointMap:
    """Two fixed points, +-1, in a function that nobody has compiled yet; their basins wind around each other."""

    def step(x, p):
        speed = 0.6 * x[1] + 0.2 * (x[0] - x[0] ** 3)
        return x[0] + speed, speed

    return discrete_map(step, {}, ("x", "y"))


def duffing() -> PointMap:
    system = ForcedSystem(
        lambda t, x, p: (x[1], x[0] - x[0] ** 3 - 0.2 * x[1] + 0.1 * cos(t)), {}, 2 * pi, ("q", "v"), "Duffing"
    )
    return stroboscopic_map(system, rtol=1e-5, atol=1e-5)


def conservative() -> PointMap:
    """Hénon's area-preserving map: nothing settles, so that passes go on from the states of those before."""

    def step(x, p):
        y = x[1] - x[0] * x[0]
        return x[0] * 0.24 - y * 0.97, x[0] * 0.97 + y * 0.24

    return discrete_map(step, {}, ("x", "y"))


def assert_same(ours: Basins, theirs: Basins) -> None:
    assert np.array_equal(ours.labels, theirs.labels)
    assert np.array_equal(ours.settling_time, theirs.settling_time)
    assert ours.fractions == theirs.fractions
    assert [a.points.tobytes() for a in ours.attractors] == [a.points.tobytes() for a in theirs.attractors]
    assert [a.multipliers.tobytes() for a in ours.attractors] == [a.multipliers.tobytes() for a in theirs.attractors]


@pytest.fixture(scope="module")
def double_well() -> PointMap:
    return wells()


def run_with_files(maps: tuple[PointMap, PointMap], folder: Path | None) -> tuple[Any, Basins, Basins]:
    """A table, basins in one pass, and basins in several; with files that a run can go on from."""
    names = [folder / f"{k}.h5" for k in range(3)] if folder else [None] * 3
    table = interpolated_map(maps[1], CellGrid((-1, -1), (1, 1), (90, 90)), checkpoint=names[0]).table
    basins = find_basins(maps[0], WINDOW, checkpoint=names[1])
    left = find_basins(maps[1], CellGrid((-0.5, -0.5), (0.5, 0.5), (30, 30)), 300, 1, checkpoint=names[2])
    return table, basins, left


def killed_at_random(kills: int) -> None:
    """Kill children of this process, each at a random moment, until so many have died; then finish and compare."""
    set_threads(2)
    maps, rng, died = (wells(), conservative()), np.random.default_rng(0), 0
    run_with_files(maps, None)
    begin = time.perf_counter()
    expected = run_with_files(maps, None)
    usual = time.perf_counter() - begin
    while died < kills:
        with tempfile.TemporaryDirectory() as name:
            ended = False
            while not ended and died < kills:  # the next child goes on where this one was killed
                child = os.fork()
                if not child:
                    run_with_files(maps, Path(name))
                    os._exit(0)
                time.sleep(rng.uniform(0.0, usual))
                os.kill(child, signal.SIGKILL)
                ended = os.waitpid(child, 0)[1] == 0
                died += not ended
            table, *basins = run_with_files(maps, Path(name))
            assert sorted(p.name for p in Path(name).iterdir()) == ["0.h5", "1.h5", "2.h5"]
        assert table.coefficients.tobytes() == expected[0].coefficients.tobytes()
        assert table.indicator.tobytes() == expected[0].indicator.tobytes()
        for one, other in zip(basins, expected[1:], strict=True):
            assert_same(one, other)
    print("killed", died)


@pytest.mark.parametrize("times", [3, pytest.param(17, marks=pytest.mark.thorough)])
def test_killed_at_random_moments(times: int) -> None:
    program = "import sys; sys.path.insert(0, sys.argv[1]); import test_promises as t; t.killed_at_random({})"
    command = [sys.executable, "-c", program.format(times), str(Path(__file__).parent)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert (done.returncode, done.stdout.split()) == (0, ["killed", str(times)]), done.stderr


@pytest.mark.parametrize("make", [wells, duffing])
def test_bits_of_tables_and_basins_do_not_depend_on_threads(make) -> None:
    point_map, results = make(), []
    for threads in (1, 2, 3, 8, 16):
        set_threads(threads)
        table = interpolated_map(point_map, TABLE, outside="integrate", tolerance=1e6)
        results.append((find_basins(point_map, SMALL), find_basins(table, SMALL), table.table.coefficients.tobytes()))
    for exact, interpolated, coefficients in results[1:]:
        assert_same(exact, results[0][0])
        assert_same(interpolated, results[0][1])
        assert coefficients == results[0][2]


def test_bits_do_not_depend_on_how_initial_conditions_are_split(double_well) -> None:
    initial_conditions = WINDOW.centres().reshape(-1, 2)
    table = interpolated_map(double_well, TABLE, outside="integrate", tolerance=1e6)
    whole = find_basins(table, initial_conditions)
    cuts = np.sort(np.random.default_rng(0).choice(len(initial_conditions), 6, replace=False))
    parts = [find_basins(table, part, attractors=whole.attractors) for part in np.split(initial_conditions, cuts)]
    assert np.array_equal(np.concatenate([p.labels for p in parts]), whole.labels)
    assert np.array_equal(np.concatenate([p.settling_time for p in parts]), whole.settling_time)
    for point_map in (double_well, table):
        images = np.concatenate([point_map.iterate(part, 7).points for part in np.split(initial_conditions, cuts)])
        assert images.tobytes() == point_map.iterate(initial_conditions, 7).points.tobytes()


def test_bits_do_not_depend_on_the_cache_of_compiled_code(tmp_path, monkeypatch) -> None:
    """Compiled in memory, into two folders, and loaded from one of them."""
    found, kept = [], []
    for folder in ("", tmp_path / "one", tmp_path / "other", tmp_path / "one"):
        monkeypatch.setenv("CELLMAP_CACHE_DIR", str(folder))
        for compiled in (machine_code, lookup_kernel, compiled_advance):
            compiled.cache_clear()
        exact = wells()
        found.append(find_basins(exact, SMALL))
        found.append(find_basins(interpolated_map(exact, TABLE, outside="integrate", tolerance=1e6), SMALL))
        kept.append({p.name: p.stat().st_ino for p in Path(folder).glob("*.object")} if folder else {})
    for k in range(2, len(found)):
        assert_same(found[k], found[k % 2])
    assert not kept[0]
    assert len(kept[1]) >= 2
    assert kept[1].keys() == kept[2].keys()
    assert kept[3] == kept[1], "the last run compiled nothing"


def writers(point_map: PointMap, basins: Basins, folder: Path) -> dict[str, Any]:
    grid = CellGrid((-1, -1), (1, 1), (40, 40))
    return {
        "saved.h5": lambda: save_basins(basins, folder / "saved.h5"),
        "found.h5": lambda: find_basins(point_map, basins.grid, checkpoint=folder / "found.h5"),
        "table.h5": lambda: interpolated_map(point_map, grid, tolerance=1e6, checkpoint=folder / "table.h5"),
    }


@pytest.fixture(scope="module")
def basins_of(double_well) -> Basins:
    return find_basins(double_well, CellGrid((-1.5, -1.0), (1.5, 1.05), (40, 40)))


def limited(write: Callable[..., Any], room: Iterator[int]) -> Callable[..., Any]:
    """Writing that fails when a number of writings have used up the room."""

    def attempt(*arguments: Any) -> Any:
        if next(room, None) is None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(*arguments)

    return attempt


@pytest.mark.parametrize("writer", ["saved.h5", "found.h5", "table.h5"])
def test_a_disk_that_is_full(writer, double_well, basins_of, tmp_path, monkeypatch) -> None:
    """At whatever moment it becomes full, the error names the file, and the same call succeeds when there is room."""
    call, failures = writers(double_well, basins_of, tmp_path)[writer], 0
    for moment in range(20):
        room = iter(range(moment))
        with monkeypatch.context() as patch:
            for owner, name in ((os, "posix_fallocate"), (Path, "write_bytes")):
                patch.setattr(owner, name, limited(getattr(owner, name), room))
            try:
                call()
            except OSError as error:
                assert (error.errno, "free some" in str(error), writer in str(error)) == (errno.ENOSPC, True, True)
                failures += 1
            else:
                break
        assert {p.name for p in tmp_path.iterdir()} <= {writer}
    assert 0 < failures < 20
    if writer != "table.h5":
        assert_same(load_basins(tmp_path / writer), basins_of)


@contextlib.contextmanager
def somebody_else() -> Iterator[None]:
    """Nothing is read-only to the system's administrator: be nobody for a while."""
    administrator = os.geteuid() == 0
    if administrator:
        os.seteuid(65534)
    try:
        yield
    finally:
        if administrator:
            os.seteuid(0)


@pytest.fixture
def read_only(basins_of) -> Iterator[Path]:
    """A folder that can be read and not written to, with basins in it."""
    folder = Path(tempfile.mkdtemp())
    save_basins(basins_of, folder / "basins.h5")
    (folder / "basins.h5").chmod(0o444)
    folder.chmod(0o555)
    yield folder
    folder.chmod(0o755)
    shutil.rmtree(folder)


def test_a_folder_that_cannot_be_written_to(double_well, basins_of, read_only) -> None:
    for writer, call in writers(double_well, basins_of, read_only).items():
        with somebody_else():
            with pytest.raises(PermissionError, match=writer):
                call()
            assert_same(load_basins(read_only / "basins.h5"), basins_of)
        assert [p.name for p in read_only.iterdir()] == ["basins.h5"]


def test_repetitions_leave_nothing_behind(double_well, basins_of) -> None:
    """Forty times a map, a table and its basins: more than 200 kB each, of which nothing stays."""
    process = psutil.Process()

    def once(k: int) -> None:
        point_map = double_well.with_params() if k % 4 else wells()
        table = interpolated_map(point_map, TABLE, outside="integrate", tolerance=1e6)
        find_basins(table, SMALL, attractors=basins_of.attractors if k % 8 else ())

    def used() -> tuple[int, int]:
        gc.collect()
        give_back_memory()  # of what other tests have left free, some pages come into use again
        return process.memory_info().rss, len(gc.get_objects())

    def grown() -> tuple[int, int]:
        resident, objects = used()
        for k in range(40):
            once(k)
        after = used()
        return after[0] - resident, after[1] - objects

    for k in range(9):
        once(k)
    # What stays behind does so each time; pages that other tests have left free come into use again once.
    memory, objects = zip(*(grown() for _ in range(2)), strict=True)
    assert min(memory) < 4e6
    assert min(objects) < 2000
