"""Runs that are killed, interrupted and damaged go on to the same bits; files that are not theirs are refused."""

from __future__ import annotations

import contextlib
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import cellmap
import cellmap._lib.checkpoint
import systems
from cellmap import (
    Basins,
    CellGrid,
    ForcedSystem,
    discrete_map,
    find_basins,
    interpolated_map,
    load_basins,
    save_basins,
    stroboscopic_map,
)
from cellmap._lib.files import locked, written_whole
from cellmap.basins import StoreError
from cellmap.basins.initial_conditions import Rows
from cellmap.basins.record import basins_disk, basins_memory


class Died(BaseException):
    """What ends a run in the middle here, as a signal does elsewhere."""


def forced(t, x, p):
    return x[1], x[0] - x[0] ** 3 - p.delta * x[1] + p.gamma * cos(t)


DUFFING = stroboscopic_map(ForcedSystem(forced, {"delta": 0.2, "gamma": 0.1}, 2 * pi, ("q", "v")), rtol=1e-5, atol=1e-5)
WINDOW = CellGrid((-2.2, -2.2), (2.2, 2.2), (250, 230))  # four tiles


def pendulum():
    return stroboscopic_map(systems.driven_pendulum(amplitude=0.010), rtol=1e-6, atol=1e-6)


def conservative(x, p):
    """Hénon's area-preserving map: nothing settles, some orbits diverge."""
    y = x[1] - x[0] * x[0]
    return x[0] * cos(p.angle) - y * sin(p.angle), x[0] * sin(p.angle) + y * cos(p.angle)


CASES: dict[str, Callable[..., Basins]] = {
    # Two attractors that the sample finds; one pass.
    "one pass": lambda **how: find_basins(DUFFING, WINDOW, **how),
    # Small basins are found among the active orbits, and the sweep begins again for some of them.
    "small basins": lambda **how: find_basins(
        pendulum(), CellGrid((-pi, -500.0), (pi, 500.0), (200, 170)), 600, 8, **how
    ),
    # Everything is left after each pass.
    "undecided": lambda **how: find_basins(
        discrete_map(conservative, {"angle": 1.327}, ("x", "y")),
        CellGrid((-0.6, -0.6), (0.6, 0.6), (140, 130)),
        520,
        **how,
    ),
    # The same with multi-period steps, on whose division orbits depend.
    "leaps": lambda **how: find_basins(
        interpolated_map(
            discrete_map(conservative, {"angle": 1.327}, ("x", "y")),
            CellGrid((-1, -1), (1, 1), (60, 60)),
            outside="escape",
            max_step=8,
        ),
        CellGrid((-0.6, -0.6), (0.6, 0.6), (140, 130)),
        520,
        **how,
    ),
    # A cover in the place of a neighbourhood: all initial conditions are labelled again.
    "chaotic": lambda **how: find_basins(
        systems.henon_map(), CellGrid((-2.0, -2.0), (2.0, 2.0), (190, 190)), 500, **how
    ),
    "given starts": lambda **how: find_basins(
        discrete_map(lambda x, p: (x[0] / 2 + 1 / (2 * x[0]),), {}, ("x",), name="newton"),
        np.random.default_rng(0).uniform(-3.0, 3.0, (4, 9000, 1)),
        **how,
    ),
}


@pytest.fixture(scope="module")
def plain() -> dict[str, Basins]:
    return {name: make() for name, make in CASES.items()}


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Path:
    """The file of a run of one pass that came to its end."""
    path = tmp_path_factory.mktemp("finished") / "basins.h5"
    CASES["one pass"](checkpoint=path)
    return path


@pytest.fixture(scope="module")
def begun(tmp_path_factory) -> Path:
    """The file of the same run, which died after its first tile."""
    path = tmp_path_factory.mktemp("begun") / "basins.h5"
    with pytest.MonkeyPatch.context() as patch, pytest.raises(Died):
        dying(patch, 1, False)
        CASES["one pass"](checkpoint=path)
    return path


@pytest.fixture(scope="module")
def tabulated(tmp_path_factory) -> Path:
    """The file of a finished table."""
    path = tmp_path_factory.mktemp("tabulated") / "table.h5"
    interpolated_map(DUFFING, TABLE, checkpoint=path)
    return path


def assert_same(ours: Basins, theirs: Basins) -> None:
    for name in ("labels", "settling_time"):
        one, other = getattr(ours, name), getattr(theirs, name)
        assert one.dtype == other.dtype
        assert one.shape == other.shape
        assert np.array_equal(one, other), f"{name}: {np.count_nonzero(one != other)} of {one.size} differ"
    assert (ours.inaccurate, ours.cost.steps) == (theirs.inaccurate, theirs.cost.steps)
    assert ours.fractions == theirs.fractions
    assert len(ours.attractors) == len(theirs.attractors)
    for one, other in zip(ours.attractors, theirs.attractors, strict=True):
        assert_same_record(one, other)


def assert_same_record(one: Any, other: Any) -> None:
    for f in fields(one):
        a, b = getattr(one, f.name), getattr(other, f.name)
        if isinstance(a, np.ndarray):
            assert a.tobytes() == b.tobytes(), f.name
        elif f.name in ("neighbourhood", "cover") and a is not None:
            assert_same_record(a, b)
        else:
            assert a == b, f.name


# --- an undisturbed run


@pytest.mark.parametrize("name", CASES)
def test_a_checkpoint_changes_nothing(name, plain, tmp_path):
    path = tmp_path / "basins.h5"
    found = CASES[name](checkpoint=path)
    assert_same(found, plain[name])
    assert_same(load_basins(path), plain[name])
    assert [p.name for p in tmp_path.iterdir()] == ["basins.h5"]
    assert found.point_map is not None


def test_the_same_call_reads_what_is_finished(plain, finished, tmp_path, monkeypatch):
    path = Path(shutil.copy(finished, tmp_path))
    monkeypatch.setattr("cellmap.basins.passes.search", lambda *_: pytest.fail("searched again"))
    again = CASES["one pass"](checkpoint=path)
    assert_same(again, plain["one pass"])
    assert again.verify(50).wrong == 0


def test_labels_can_be_changed_and_the_file_stays(plain, tmp_path):
    path = tmp_path / "basins.h5"
    CASES["one pass"](checkpoint=path).labels[:] = 0
    assert_same(load_basins(path), plain["one pass"])


def test_a_finished_picture_can_be_saved_elsewhere_and_in_its_own_place(plain, tmp_path):
    path = tmp_path / "basins.h5"
    found = CASES["one pass"](checkpoint=path)
    for target in (tmp_path / "other.h5", path):
        assert_same(load_basins(save_basins(found, target)), plain["one pass"])


# --- runs that end before their time


def dying(monkeypatch: pytest.MonkeyPatch, moment: int, torn: bool) -> None:
    """Let the run die with the entry of one of its tiles, before it is made or in the middle of the contents.

    The other threads die with it: a checksum that one of them takes later would vouch for contents that were torn here.
    """
    original, left = cellmap._lib.checkpoint.Checkpoint.finish, moment
    lock = threading.Lock()

    def finish(self, tiles, number, tally, contents):
        nonlocal left
        with lock:
            left -= 1
            if left >= 0:
                return original(self, tiles, number, tally, contents)
            if torn and left == -1:  # contents that are not those of the tile, and an entry that says otherwise
                original(self, tiles, number, tally, contents)
                for name in {"tiles": ("labels", "settling_time")}.get(tiles, (tiles.removeprefix("tiles of "),)):
                    self[name].view(np.uint8).reshape(-1)[:: self[name].nbytes // 7] ^= 1
        raise Died

    monkeypatch.setattr(cellmap._lib.checkpoint.Checkpoint, "finish", finish)


@pytest.mark.parametrize(
    ("moment", "torn"), [(1, True), *(pytest.param(k, False, marks=pytest.mark.slow) for k in (0, 2, 4)), (5, False)]
)
@pytest.mark.parametrize("name", CASES)
def test_a_run_goes_on_where_it_died(name, moment, torn, plain, tmp_path, monkeypatch):
    path = tmp_path / "basins.h5"
    died = False
    dying(monkeypatch, moment, torn)
    try:
        CASES[name](checkpoint=path)
    except Died:
        died = True
        with h5py.File(path, "r") as file:
            assert file.attrs["format"] == b"cellmap checkpoint"
        with pytest.raises(StoreError, match="not one of basins"):
            load_basins(path)
    monkeypatch.undo()
    done = count_of_tiles(monkeypatch)
    assert_same(CASES[name](checkpoint=path), plain[name])
    assert_same(load_basins(path), plain[name])
    if died and not torn:
        assert done[0] == TILES[name] - moment, "tiles that were done are not done again"


TILES = {"one pass": 4, "small basins": 4, "undecided": 6, "leaps": 6, "chaotic": 3, "given starts": 3}
"""Tiles of all passes, as an undisturbed run has them."""


@pytest.mark.slow
def test_the_number_of_tiles(tmp_path, monkeypatch):
    for name, run in CASES.items():
        done = count_of_tiles(monkeypatch)
        run(checkpoint=tmp_path / f"{name}.h5")
        monkeypatch.undo()
        assert (name, done[0]) == (name, TILES[name])


def count_of_tiles(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    original, count = cellmap._lib.checkpoint.Checkpoint.finish, [0]

    def finish(self, *entry):
        count[0] += 1
        return original(self, *entry)

    monkeypatch.setattr(cellmap._lib.checkpoint.Checkpoint, "finish", finish)
    return count


@pytest.mark.parametrize("moment", [0, 1, 2])
def test_a_run_that_dies_between_passes(moment, plain, tmp_path, monkeypatch):
    """Files of passes, and that of the result, take their places as a whole: either the older or the newer is there."""
    path, original, left = tmp_path / "basins.h5", Path.replace, moment

    def replace(self, target):
        nonlocal left
        left -= 1
        if left < 0:
            raise Died
        return original(self, target)

    monkeypatch.setattr(Path, "replace", replace)
    with pytest.raises(Died):
        CASES["small basins"](checkpoint=path)
    monkeypatch.undo()
    assert_same(CASES["small basins"](checkpoint=path), plain["small basins"])


TABLE = CellGrid((-2.2, -2.2), (2.2, 2.2), (200, 150))  # three tiles of nodes, two of cells


@pytest.mark.parametrize("torn", [False, True], ids=["clean", "torn"])
@pytest.mark.parametrize("moment", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (2, 3)), 4])
def test_a_table_goes_on_where_it_died(moment, torn, tmp_path, monkeypatch):
    path = tmp_path / "table.h5"
    expected = interpolated_map(DUFFING, TABLE).table
    dying(monkeypatch, moment, torn)
    with pytest.raises(Died):
        interpolated_map(DUFFING, TABLE, checkpoint=path)
    monkeypatch.undo()
    for _ in range(2):
        found = interpolated_map(DUFFING, TABLE, checkpoint=path).table
        for name in ("coefficients", "indicator", "rough"):
            assert getattr(found, name).tobytes() == getattr(expected, name).tobytes()


@pytest.mark.filterwarnings("ignore:.* of the cells are fallback cells:UserWarning")
def test_nodes_without_an_image_are_kept_as_they_are(tmp_path):
    """The table fills them from their neighbours; the file must not, or the cells around them are no longer known."""
    exact = discrete_map(lambda x, p: (x[0] ** 2 if x[0] < 1.5 else x[0] ** 999, x[1] / 2), {}, ("x", "y"), name="far")
    grid, path = CellGrid((-1.0, -1.0), (3.0, 1.0), (50, 40)), tmp_path / "table.h5"
    expected = interpolated_map(exact, grid)
    for _ in range(2):
        found = interpolated_map(exact, grid, checkpoint=path)
        assert np.array_equal(found.table.rough, expected.table.rough)
        assert found.table.coefficients.tobytes() == expected.table.coefficients.tobytes()


# --- the real thing: other processes, and signals

PROGRAM = """
import sys
sys.path.insert(0, {folder!r})
import test_checkpoint
test_checkpoint.long_run({path!r})
print("finished")
"""


def long_run(folder: str | Path) -> tuple[Basins, Basins]:
    """A table, basins of its map that take some sweeps, and some whose sweeps go on from where others ended."""
    grid = CellGrid((-pi, -500.0), (pi, 500.0), (260, 260))
    icm = interpolated_map(pendulum(), grid, checkpoint=Path(folder) / "table.h5")
    picture = CellGrid((-pi, -500.0), (pi, 500.0), (400, 400))
    basins = find_basins(icm, picture, 1000, 8, checkpoint=Path(folder) / "basins.h5")
    return basins, CASES["undecided"](checkpoint=Path(folder) / "states.h5")


def assert_same_results(ours: tuple[Basins, ...], theirs: tuple[Basins, ...]) -> None:
    for one, other in zip(ours, theirs, strict=True):
        assert_same(one, other)


def started(tmp_path: Path) -> subprocess.Popen[str]:
    program = PROGRAM.format(folder=str(Path(__file__).parent), path=str(tmp_path))
    return subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def tiles_done(path: Path) -> dict[str, Any]:
    """What a file says of its tiles, and of its pass; every moment is a good one to look."""
    if not path.exists():
        return {}
    with h5py.File(path, "r", locking=False) as file:
        if "tiles" not in file:
            names = [name for name in file if name.startswith("tiles of")]
            return {name: int(np.count_nonzero(file[name]["done"])) for name in names} or {"result": True}
        moment = {"age": max(file["pass"].attrs["legs"], default=0)}
        return moment | {"tiles": int(np.count_nonzero(file["tiles"]["done"])), "rows": "rows" in file["pass"]}


MOMENTS: dict[str, tuple[str, Callable[[dict[str, Any]], bool]]] = {
    "while nodes are tabulated": ("table.h5", lambda seen: seen.get("tiles of displacement", 0) >= 1),
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


@pytest.mark.slow
@pytest.mark.parametrize("moment", MOMENTS)
def test_killed_without_mercy(moment, undisturbed, tmp_path):
    returned, _ = interrupt_at(tmp_path, moment, signal.SIGKILL)
    assert returned == -signal.SIGKILL
    for path in tmp_path.glob("*.h5"):
        tiles_done(path)  # each is a file that can be read
    assert_same_results(long_run(tmp_path), undisturbed)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["basins.h5", "states.h5", "table.h5"]


@pytest.mark.slow
def test_killed_again_and_again(undisturbed, tmp_path):
    """At moments that nobody chose, until it comes through."""
    rng, deaths = np.random.default_rng(0), 0
    while True:
        process = started(tmp_path)
        try:
            output, errors = process.communicate(timeout=float(rng.uniform(1.0, 2.0)) + 0.3 * deaths)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            deaths += 1
            continue
        assert output.strip() == "finished", errors
        break
    assert deaths
    assert_same_results((load_basins(tmp_path / "basins.h5"), load_basins(tmp_path / "states.h5")), undisturbed)


@pytest.mark.slow
@pytest.mark.parametrize("moment", ["while nodes are tabulated", "during the first labels"])
def test_interrupted_from_the_keyboard(moment, undisturbed, tmp_path):
    returned, output = interrupt_at(tmp_path, moment, signal.SIGINT)
    assert returned != 0
    assert "KeyboardInterrupt" in output
    assert_same_results(long_run(tmp_path), undisturbed)


def test_what_killed_writers_left_is_removed(plain, tmp_path):
    (tmp_path / ".basins.h5.0123456789abcdef.run.h5").write_bytes(b"half a file")
    assert_same(CASES["given starts"](checkpoint=tmp_path / "basins.h5"), plain["given starts"])
    assert [p.name for p in tmp_path.iterdir()] == ["basins.h5"]


def test_temporary_files_of_others_stay(plain, tmp_path):
    """Of files whose names begin alike, and of whoever saves something in the same place."""
    names = ["sweep.2.h5", "sweep", "sweep.h5.h5", "weep.h5", "sweep.h5.0123456789abcdef.run.h5"]
    with contextlib.ExitStack() as stack:
        others = [stack.enter_context(written_whole(tmp_path / name, kind="run")) for name in names]
        others.append(stack.enter_context(written_whole(tmp_path / "sweep.h5")))
        CASES["given starts"](checkpoint=tmp_path / "sweep.h5")
        assert all(other.exists() for other in others)


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
        for call in (CASES["given starts"], lambda checkpoint: interpolated_map(DUFFING, TABLE, checkpoint=checkpoint)):
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


def test_permissions_are_those_of_ordinary_files_without_touching_the_mask(tmp_path, monkeypatch):
    """To ask for the mask of the process is to change it, for all its threads."""
    monkeypatch.setattr("os.umask", lambda mask: pytest.fail("the mask was changed"))
    with written_whole(tmp_path / "a.txt") as part:
        part.write_text("text")
    (tmp_path / "plain").touch()
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "plain").stat().st_mode


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


def test_a_limit_of_file_sizes_is_an_error_and_not_the_end_of_the_process(tmp_path):
    """HDF5's library crashes when a write fails, so that nothing is written by it for which there is no room."""
    done = subprocess.run([sys.executable, "-c", LIMITED, str(tmp_path)], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    smallest = {line.split()[0] for line in done.stdout.splitlines()}
    assert smallest >= {"save"}, "what has room is written"
    assert [p for p in tmp_path.iterdir() if not p.name.endswith(".lock")] == []


# --- files that are not what they should be


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory) -> Path:
    """A run that died in a later pass."""
    path = tmp_path_factory.mktemp("unfinished") / "basins.h5"
    with pytest.MonkeyPatch.context() as patch:
        dying(patch, 3, False)
        with pytest.raises(Died):
            CASES["small basins"](checkpoint=path)
    with h5py.File(path, "r") as file:
        assert "rows" in file["pass"]
    return path


@pytest.mark.parametrize("part", ["labels", "settling_time", "pass/rows", "pass/settled", "pass/examined/guesses"])
def test_damage_to_what_earlier_passes_found_is_noticed(part, unfinished, tmp_path):
    path = Path(shutil.copy(unfinished, tmp_path / "basins.h5"))
    with h5py.File(path, "r+") as file:
        values = file[part][()]
        place = np.flatnonzero(file["labels"][()] >= 0)[5] if values.shape == file["labels"].shape else 0
        values.view(np.uint8).reshape(-1)[place * values.itemsize] ^= 1
        file[part][...] = values
    with pytest.raises(StoreError, match=r"checkpoint=.*basins\.h5' is damaged .*: delete it"):
        CASES["small basins"](checkpoint=path)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.9])
def test_truncated_checkpoint(share, unfinished, tmp_path):
    whole, path = unfinished.read_bytes(), tmp_path / "basins.h5"
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(StoreError, match=r"basins\.h5' is damaged or no HDF5 file: delete it, or give another name"):
        CASES["small basins"](checkpoint=path)


def test_foreign_file(tmp_path):
    path = tmp_path / "foreign.h5"
    with h5py.File(path, "w") as file:
        file["labels"] = np.zeros(3)
    for call in (CASES["one pass"], lambda checkpoint: interpolated_map(DUFFING, TABLE, checkpoint=checkpoint)):
        before = path.read_bytes()
        with pytest.raises(StoreError, match=r"foreign\.h5' is not a checkpoint.*give the name of a new file"):
            call(checkpoint=path)
        assert path.read_bytes() == before


def test_a_picture_that_was_merely_saved(plain, tmp_path):
    path = save_basins(plain["one pass"], tmp_path / "saved.h5")
    with pytest.raises(ValueError, match=r"checkpoint=.*saved\.h5' belongs to another run"):
        CASES["one pass"](checkpoint=path)


def test_a_table_in_the_place_of_a_picture(tabulated, tmp_path):
    path = Path(shutil.copy(tabulated, tmp_path))
    with pytest.raises(ValueError, match="what='table', and this one has 'basins': give another file, or delete"):
        CASES["one pass"](checkpoint=path)
    with pytest.raises(StoreError, match="not one of basins"):
        load_basins(path)


CHANGES: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "limit": ("max_periods=2000", lambda path: find_basins(DUFFING, WINDOW, 1999, checkpoint=path)),
    "longest period": ("max_period=32", lambda path: find_basins(DUFFING, WINDOW, max_period=5, checkpoint=path)),
    "parameter": ("params=", lambda path: find_basins(DUFFING.with_params(gamma=0.11), WINDOW, checkpoint=path)),
    "grid": (
        "initial_conditions=",
        lambda path: find_basins(DUFFING, CellGrid((-2, -2), (2, 2), (9, 9)), checkpoint=path),
    ),
    "initial_conditions": ("initial_conditions=", lambda path: find_basins(DUFFING, [[0.1, 0.2]], checkpoint=path)),
    "tolerance": (
        "map=",
        lambda path: find_basins(
            stroboscopic_map(ForcedSystem(forced, DUFFING.params, 2 * pi, ("q", "v"))), WINDOW, checkpoint=path
        ),
    ),
    "right-hand side": (
        "bits of images=",
        lambda path: find_basins(
            stroboscopic_map(
                ForcedSystem(
                    lambda t, x, p: (x[1], x[0] - 1.0000001 * x[0] ** 3 - p.delta * x[1] + p.gamma * cos(t)),
                    DUFFING.params,
                    2 * pi,
                    ("q", "v"),
                    name="forced",
                ),
                rtol=1e-5,
                atol=1e-5,
            ),
            WINDOW,
            checkpoint=path,
        ),
    ),
}


@pytest.mark.parametrize("state", ["finished", "begun"])
@pytest.mark.parametrize("change", CHANGES)
def test_a_run_of_other_arguments_is_refused_and_names_them(change, state, plain, tmp_path, request):
    path = Path(shutil.copy(request.getfixturevalue(state), tmp_path))
    named, call = CHANGES[change]
    before = path.read_bytes()
    with pytest.raises(ValueError, match=f"with {named}.*and this one has .*: give another file, or delete this one"):
        call(path)
    assert path.read_bytes() == before
    assert_same(CASES["one pass"](checkpoint=path), plain["one pass"])


def test_known_attractors_belong_to_a_run(plain, tmp_path):
    known = plain["one pass"].attractors
    path = tmp_path / "basins.h5"
    CASES["one pass"](attractors=known, checkpoint=path)
    with pytest.raises(ValueError, match=r"attractors='2, .*', and this one has 'none'"):
        CASES["one pass"](checkpoint=path)


@pytest.mark.parametrize("name", ["order", "tolerance", "grid", "parameter"])
def test_another_table_is_refused(name, tabulated, tmp_path):
    path = Path(shutil.copy(tabulated, tmp_path))
    exact = DUFFING.with_params(gamma=0.2) if name == "parameter" else DUFFING
    grid = CellGrid((-2.2, -2.2), (2.2, 2.2), (200, 151)) if name == "grid" else TABLE
    how = {"order": {"order": 3}, "tolerance": {"tolerance": 0.5}}.get(name, {})
    with pytest.raises(ValueError, match=r"checkpoint=.*table\.h5' belongs to another run, with"):
        interpolated_map(exact, grid, **how, checkpoint=path)


def test_places_where_no_file_can_be(tmp_path):
    for place, error in (
        (tmp_path / "nowhere" / "b.h5", FileNotFoundError),
        (tmp_path, IsADirectoryError),
        (3, TypeError),
    ):
        with pytest.raises(error, match="checkpoint="):
            CASES["given starts"](checkpoint=place)
        with pytest.raises(error, match="checkpoint="):
            interpolated_map(DUFFING, TABLE, checkpoint=place)


# --- memory and disk


def test_room_is_stated_and_claimed_before_the_run(tmp_path, monkeypatch, caplog):
    total = WINDOW.size
    with caplog.at_level("INFO", logger="cellmap"):
        CASES["one pass"](checkpoint=tmp_path / "basins.h5")
    assert "labelling 57,500 initial conditions" in caplog.text
    assert "on the disk" in caplog.text
    memory = basins_memory(total, checkpoint=True)
    monkeypatch.setattr("cellmap._lib.checks._ALWAYS_FREE", 0)
    monkeypatch.setattr("cellmap._lib.checks.memory_available", lambda: memory - 1)
    with pytest.raises(MemoryError, match="labelling 57,500 initial conditions needs"):
        CASES["one pass"](checkpoint=tmp_path / "other.h5")
    monkeypatch.undo()
    usage = shutil.disk_usage(tmp_path)._replace(free=basins_disk(total) - 1)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    with pytest.raises(OSError, match=r"checkpoint=.* needs .* and .* are free: take fewer initial conditions, or"):
        CASES["one pass"](checkpoint=tmp_path / "other.h5")
    assert [p.name for p in tmp_path.iterdir()] == ["basins.h5"]


def test_a_file_is_no_larger_than_stated(finished):
    assert 6 * WINDOW.size <= finished.stat().st_size <= basins_disk(WINDOW.size) / 2


MEASURE = """
import resource
from cellmap import CellGrid, discrete_map, find_basins
half = discrete_map(lambda x, p: (x[0] / 2, x[1] / 3), {{}}, ("x", "y"), name="half")
find_basins(half, CellGrid((-1, -1), (1, 1), (100, 100)), checkpoint={small!r})
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
find_basins(half, CellGrid((-1, -1), (1, 1), ({side}, {side})), checkpoint={path!r})
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.slow
def test_memory_does_not_grow_with_the_number_of_starts(tmp_path):
    grown = []
    for side in (1500, 4500):  # 13 MB and 120 MB of labels and times
        names = {"small": str(tmp_path / f"small{side}.h5"), "path": str(tmp_path / f"{side}.h5")}
        program = MEASURE.format(side=side, **names)
        output = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
        scale = 1 if sys.platform == "darwin" else 1024
        grown.append(int(output) * scale)
    assert grown[1] < 80e6, "less than the labels and times of all starts"
    assert grown[1] - grown[0] < 40e6


@pytest.mark.parametrize("name", ["undecided", "small basins", "leaps"])
@pytest.mark.slow
def test_states_that_are_too_many_to_be_kept_are_computed_again(name, plain, tmp_path, monkeypatch):
    """Where all that is left can be looked at, forgetting its states changes nothing."""
    monkeypatch.setattr("cellmap.basins.passes._joined", lambda *_: None)
    assert_same(CASES[name](), plain[name])
    assert_same(CASES[name](checkpoint=tmp_path / "b.h5"), plain[name])


def test_of_very_many_that_are_left_a_part_is_searched(plain, tmp_path, monkeypatch):
    monkeypatch.setattr("cellmap.basins.passes.HELD", 100)
    monkeypatch.setattr("cellmap.basins.passes._LOOKED_AT", 50)
    found = CASES["small basins"]()
    assert_same(CASES["small basins"](checkpoint=tmp_path / "b.h5"), found)
    assert {str(a) for a in found.attractors} <= {str(a) for a in plain["small basins"].attractors}
    assert_same(CASES["undecided"](), plain["undecided"])


# --- rows by bits


@pytest.mark.parametrize("block", [8, 64, 2**20])
@pytest.mark.parametrize("total", [1, 7, 8, 63, 64, 65, 1000])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 1.0])
def test_rows_are_those_that_were_chosen(block, total, share, monkeypatch):
    monkeypatch.setattr("cellmap.basins.initial_conditions.BLOCK", block)
    chosen = np.random.default_rng(total).random(total) < share
    rows, expected = Rows.where(total, lambda part: chosen[part]), np.flatnonzero(chosen)
    assert len(rows) == len(expected)
    for begin in range(0, len(expected), 5):
        assert np.array_equal(rows[begin : begin + 17], expected[begin : begin + 17])
    spread = np.concatenate([np.empty(0, int), *rows.spread(10)])
    assert np.isin(spread, expected).all()
    assert len(spread) == min(len(expected), 10)
    assert np.array_equal(np.concatenate([np.empty(0, int), *rows.spread(10**6)]), expected)
    inside = [rows.inside(slice(k, min(k + block, total))) for k in range(0, total, block)]
    assert np.array_equal(np.concatenate(inside), chosen)


def test_a_tile_is_a_multiple_of_a_byte_of_bits():
    assert cellmap.basins.initial_conditions.BLOCK % 8 == 0
