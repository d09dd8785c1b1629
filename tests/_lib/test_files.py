"""Whatever writes a file goes by one rule: it replaces files alone, follows links, and writes whole or not at all."""

import errno
import os
import socket
import stat
from collections.abc import Callable
from functools import cache
from math import cos, sin
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

import cellmap
from cellmap import CellGrid, angle, discrete_map, find_basins, plot
from cellmap._compiled.object_cache import ObjectCache
from cellmap.basins import prove
from cellmap.bifurcations import attractor_atlas
from cellmap.exchange import save_auto
from cellmap.explorer import export_html
from cellmap.utils import StoreError, written_whole
from systems.lab import StabilityPoints, film_at_rate, write_film, write_stability_points

HALF = discrete_map(lambda x, p: (p.a * x[0], p.b * x[1]), {"a": 0.5, "b": 0.3}, ("x", "y"), name="half")
GRID = CellGrid((-1, -1), (1, 1), (8, 8))


@cache
def basins() -> Any:
    return find_basins(HALF, GRID)


@cache
def proof() -> Any:
    return prove(basins(), splits=0)


def atlas(folder: Path) -> None:
    attractor_atlas(HALF, ("a", [0.3, 0.5]), ("b", [0.3, 0.5]), [[0.5, 0.5]], checkpoint=folder)


def animated(path: Path) -> None:
    shown = {"positions": lambda t, x, p: (0.0, 0.0, sin(x[0]), -cos(x[0]))}
    swing = lambda t, x, p: (x[1], -sin(x[0]))  # noqa: E731
    pendulum = cellmap.ForcedSystem(swing, {}, 1.0, (angle("theta"), "v"), outputs=shown)
    plot.animate(cellmap.trajectory(pendulum, [2.0, 0.0], periods=1, samples_per_period=2), path)


@cache
def branch() -> Any:
    return cellmap.continue_orbit(HALF, cellmap.periodic_orbit(HALF, [0.0, 0.0]), "a", 0.4, 0.6)


FILM = film_at_rate(np.zeros((2, 16, 16), np.uint8), 10.0)
POINTS = StabilityPoints(np.array([15.0, 35.0]), np.array([8.3e-3, 3.5e-3]))

SAVERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "basins": ("b.h5", lambda path: cellmap.save_basins(basins(), path)),
    "proof": ("p.h5", lambda path: proof().save(path)),
    "checkpoint of basins": ("b.h5", lambda path: find_basins(HALF, GRID, checkpoint=path)),
    "checkpoint of a table": ("t.h5", lambda path: cellmap.interpolated_map(HALF, GRID, checkpoint=path)),
    "checkpoint of a proof": ("p.h5", lambda path: prove(basins(), splits=0, checkpoint=path)),
    "branch": ("b.branch", lambda path: save_auto(branch(), path)),
    "animation": ("a.gif", animated),
    "film": ("f.gif", lambda path: write_film(FILM, path)),
    "stack": ("f.tif", lambda path: write_film(FILM, path)),
    "points": ("p.csv", lambda path: write_stability_points(POINTS, path)),
    "page": ("p.html", lambda path: export_html(path, HALF, {"a": [0.5]}, GRID, progress=False)),
}
ALL = [pytest.param(*saver, id=name) for name, saver in SAVERS.items()]


def special(path: Path, kind: str) -> None:
    if kind == "a socket":
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(str(path))
    else:
        os.mknod(path, (stat.S_IFIFO if kind == "a named pipe" else stat.S_IFCHR) | 0o600, os.makedev(1, 3))


@pytest.fixture
def near(tmp_path, monkeypatch):
    """A folder with a name short enough for a socket."""
    monkeypatch.chdir(tmp_path)
    return Path()


KINDS = ["a named pipe", "a socket", *(["a device"] if os.geteuid() == 0 else [])]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("name", "save"), ALL)
def test_what_is_no_file_is_refused_and_stays(name, save, kind, near):
    special(near / name, kind)
    (near / f"link to {name}").symlink_to(name)
    before = (near / name).lstat()
    for path in (near / name, near / f"link to {name}"):
        with pytest.raises(StoreError, match=rf"{path.name}' is {kind}: give the name of a file"):
            save(path)
    assert (near / name).lstat() == before
    assert {p.name for p in near.iterdir()} == {name, f"link to {name}"}


@pytest.mark.parametrize(("name", "save"), ALL)
def test_links_are_followed_and_permissions_kept(name, save, tmp_path):
    """By links of links, to a file that is there and to one that is not; what was there before is replaced whole."""
    kept = tmp_path / "kept"
    kept.mkdir()
    (tmp_path / "second").symlink_to(kept / name)
    (tmp_path / name).symlink_to("second")
    save(tmp_path / name)
    assert (kept / name).is_file() and (kept / name).stat().st_size > 0
    (kept / name).chmod(0o640)
    if os.geteuid() == 0:
        os.chown(kept / name, 12, 34)
    before = (kept / name).stat()
    save(tmp_path / name)
    after = (kept / name).stat()
    assert (after.st_mode, after.st_uid, after.st_gid) == (before.st_mode, before.st_uid, before.st_gid)
    assert after.st_size > 0 and [p.name for p in kept.iterdir()] == [name]
    assert (tmp_path / "second").is_symlink() and (tmp_path / name).is_symlink()


@pytest.mark.parametrize(("name", "save"), ALL)
def test_places_where_nothing_can_be_written_are_refused_at_once(name, save, tmp_path, monkeypatch):
    """That is by the name of the argument, before anything is computed."""
    (tmp_path / f"loop{name}").symlink_to(f"loop{name}")
    (tmp_path / f"dangling{name}").symlink_to("none/file")
    (tmp_path / "file").touch()
    (tmp_path / f"folder{name}").symlink_to(tmp_path)
    monkeypatch.setattr("cellmap.explorer.images.Images.__init__", lambda *_: pytest.fail("it is computed"))
    for place, error, words in (
        *((place + name, FileNotFoundError, "there is no folder") for place in ("none/", "dangling", "file/")),
        ("loop" + name, OSError, "symbolic links"),
        ("folder" + name, IsADirectoryError, "is a folder"),
        ("n" * (250 - len(name)) + name, OSError, "give another"),
    ):
        with pytest.raises(error, match=rf"(path|checkpoint)=.*{name}'.*{words}"):
            save(tmp_path / place)
    assert len(list(tmp_path.iterdir())) == 4


def test_a_folder_without_permission_is_refused_at_once(tmp_path, monkeypatch):
    tmp_path.chmod(0o555)
    monkeypatch.setattr("cellmap.explorer.images.Images.__init__", lambda *_: pytest.fail("it is computed"))
    if os.geteuid() == 0:  # who may all
        real = os.open

        def refused(place, flags, *more, **how):
            if flags & os.O_CREAT:
                raise PermissionError(errno.EACCES, "Permission denied", str(place))
            return real(place, flags, *more, **how)

        monkeypatch.setattr("os.open", refused)
    for name, (ending, save) in SAVERS.items():
        with pytest.raises(PermissionError, match=r"(path|checkpoint)=.*give another folder"):
            save(tmp_path / ending)
        assert not list(tmp_path.iterdir()), name


@pytest.mark.parametrize(("name", "save"), ALL)
def test_a_full_disk_keeps_the_older_file_and_says_what_to_do(name, save, tmp_path, monkeypatch):
    if "checkpoint" not in str(save.__code__.co_names + save.__code__.co_consts):
        (tmp_path / name).write_bytes(b"older")
    before = [(p, p.read_bytes()) for p in tmp_path.iterdir()]
    monkeypatch.setattr("os.fsync", Mock(side_effect=OSError(errno.ENOSPC, "No space left on device")))
    with pytest.raises(OSError, match=rf"free some, or choose another folder.*{name}") as found:
        save(tmp_path / name)
    assert found.value.errno == errno.ENOSPC
    assert [(p, p.read_bytes()) for p in tmp_path.iterdir()] == before


@pytest.mark.parametrize("kind", KINDS)
def test_a_checkpoint_in_a_folder_waits_for_no_pipe(kind, near):
    special(near / "atlas", kind)
    with pytest.raises(NotADirectoryError, match="checkpoint='atlas' is no folder"):
        atlas(near / "atlas")
    (near / "folder").mkdir()
    special(near / "folder" / "atlas.json", kind)
    with pytest.raises(StoreError, match=r"damaged atlas\.json"):
        atlas(near / "folder")
    assert not stat.S_ISREG((near / "atlas").lstat().st_mode)


def test_a_lock_is_taken_of_files_alone(tmp_path):
    """By a link of that name another file could be emptied."""
    (tmp_path / "other").write_text("content")
    (tmp_path / ".b.h5.lock").symlink_to("other")
    with pytest.raises(StoreError, match=r"b\.h5.*\.b\.h5\.lock' is a link; remove that"):
        find_basins(HALF, GRID, checkpoint=tmp_path / "b.h5")
    assert (tmp_path / "other").read_text() == "content"


def test_one_checkpoint_by_two_names_has_one_lock(tmp_path, monkeypatch):
    (tmp_path / "link.h5").symlink_to("b.h5")
    seen = []

    def looked(*_: object, **__: object) -> Any:
        seen.append([p.name for p in tmp_path.glob("*.lock")])
        raise KeyboardInterrupt

    monkeypatch.setattr("cellmap.basins.finding.label_store", looked)
    for name in ("b.h5", "link.h5"):
        with pytest.raises(KeyboardInterrupt):
            find_basins(HALF, GRID, checkpoint=tmp_path / name)
    assert seen == [[".b.h5.lock"]] * 2


@pytest.mark.parametrize("kind", KINDS)
def test_the_cache_of_code_leaves_what_is_no_file(kind, near):
    kept = ObjectCache(near, limit=10)
    special(near / f"{'a' * 32}.object", kind)
    with pytest.warns(RuntimeWarning, match="cannot be read"):
        assert kept.read("a" * 64) is None
    kept.write("a" * 64, b"code")
    kept.write("b" * 64, bytes(100))  # and drops what is too much
    assert [p.name for p in near.iterdir()] == [f"{'a' * 32}.object"]


def test_what_is_written_in_the_place_of_a_private_file_is_never_open_to_others(tmp_path):
    for name, mode in (("private", 0o600), ("read only", 0o444)):
        (tmp_path / name).touch(mode)
        with written_whole(tmp_path / name) as part:
            assert part.stat().st_mode & 0o777 == 0o600
            part.write_text("text")
        assert (tmp_path / name).stat().st_mode & 0o777 == mode
