"""Watchers and prepared views: what is served to whom, and what files of views may say."""

from __future__ import annotations

import contextlib
import http.client
import json
import zlib
from pathlib import Path

import pytest
from served_pages import GALLERY, WELLS, WINDOW, assert_same_image, connected, numbers_of, upright
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from cellmap import find_basins
from cellmap.explorer import Explorer
from cellmap.explorer.__main__ import main
from cellmap.explorer.protocol import unpacked
from cellmap.explorer.serving import serve
from cellmap.explorer.views import load_views

SYSTEMS = {e.name: e for e in GALLERY}


def watching(explorer: Explorer, **options: object) -> connect:  # type: ignore[valid-type]
    address = str(explorer.watch_address)
    origin = "http://" + address.split("/")[2]
    return connect(address.replace("http", "ws") + "connection", **{"origin": origin, "max_size": None, **options})


def status(place: str, path: str, **headers: str) -> int:
    with contextlib.closing(http.client.HTTPConnection(place)) as connection:
        connection.request("GET", path, headers=headers)
        return connection.getresponse().status


def test_a_watcher_gets_the_image_and_moves_nothing(shared: Explorer) -> None:
    with connected(shared) as page:
        page.image(params={"keep": 0.65})
        with watching(shared) as socket:
            assert json.loads(socket.recv(5)) == {"type": "welcome"}
            facts, data = unpacked(socket.recv(5))
            facts["data"] = zlib.decompress(data)
            assert_same_image(facts, numbers_of(facts), find_basins(WELLS.with_params(keep=0.65), WINDOW), upright)
            assert facts["view"]["params"] == {"keep": 0.65}
            socket.send(json.dumps({"type": "view", "view": {"params": {"keep": 0.9}}, "request": 1}))
            page.image(params={"keep": 0.55})
            facts, data = unpacked(socket.recv(5))
            assert facts["view"]["params"] == {"keep": 0.55}
            for _ in range(100):
                socket.send("x")
            with pytest.raises(ConnectionClosed):
                for _ in range(20):
                    socket.recv(5)


def test_watchers_are_limited_and_reach_nothing_else(shared: Explorer) -> None:
    with watching(shared) as one, watching(shared) as other:
        assert [json.loads(s.recv(5))["type"] for s in (one, other)] == ["welcome"] * 2
        with watching(shared) as third, pytest.raises(ConnectionClosed, match="2 watch already, which is the limit"):
            third.recv(5)
    with pytest.raises(InvalidStatus), watching(shared, origin="http://example.org"):
        pass
    watch, own = str(shared.watch_address).split("/"), shared.address.split("/")
    assert watch[3] != own[3]

    assert status(watch[2], f"/{watch[3]}/") == 200
    assert status(watch[2], f"/{watch[3]}/viewer.js") == 200
    for path in ("/", f"/{watch[3]}/../../etc/passwd", f"/{watch[3]}/%2e%2e/session.py", "/x/watch.js"):
        assert status(watch[2], path) == 404
    assert status(watch[2], f"/{watch[3]}/", Host="example.org") == 400


def test_the_explorer_itself_is_not_in_the_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its own token is unknown at any address but this machine's own."""
    monkeypatch.setattr("cellmap.explorer.server.HOSTS", ("127.0.0.9", "127.0.0.1", "localhost"))
    with serve(GALLERY, open_page=False) as running:
        place, token = running.address.split("/")[2:4]
        assert status(place, f"/{token}/") == 404


def test_nobody_watches_by_default() -> None:
    with serve(GALLERY, open_page=False) as running:
        assert running.watch_address is None
        assert "watch" not in str(running)
    with pytest.raises(OSError, match=r"host='192\.0\.2\.7': this machine has no such address"):
        serve(GALLERY, open_page=False, watchers=5, host="192.0.2.7")


def test_views_of_a_file_are_checked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "views.toml"

    def views(text: str) -> list[dict[str, object]]:
        path.write_text(text, encoding="utf-8")
        return load_views(path, SYSTEMS)

    (one, other) = views(
        '[[view]]\nsystem = "parts"\nparts = ["heavy", "push"]\nsentence = "Two."\nparams = {push = 0.1}\n'
        '[[view]]\nequations = "x -> a x\\na = 0.5"\nlower = [0.0]\nupper = [1.0]\ncells = [9]\n'
    )
    assert (one["name"], one["parts"], one["view"]) == ("parts", ("heavy", "push"), {"params": {"push": 0.1}})
    assert str(other["text"]).startswith("x -> a x")
    for text, told in (
        ("view = 3", "write a table"),
        ("[[view", "no TOML"),
        ("[[view]]\ntitle = 'x'", "view 1: give either the name of a system or equations"),
        ("[[view]]\nsystem = 'none'", "choose one of wells, duffing"),
        ("[[view]]\nsystem = 'wells'\nparams = {kep = 0.1}", "view 1: params has no"),
        ("[[view]]\nsystem = 'wells'\nlower = [3.0, 0.0]", "view 1: "),
        ("[[view]]\nsystem = 'wells'\nzoom = 3", "view has no"),
        ("[[view]]\nequations = 'x = 3'", "view 1: line 1"),
        ("[[view]]\nsystem = 'wells'\nsentence = 3", "sentence=3: give a string"),
    ):
        with pytest.raises((ValueError, TypeError), match="(?s)" + told):
            views(text)
    with pytest.raises(SystemExit):
        main(["--views", str(path), "--no-browser"])
    assert "sentence=3" in capsys.readouterr().err


def test_the_lecture_of_the_pages_can_be_shown() -> None:
    from systems.gallery import GALLERY as ALL

    views = load_views(Path(__file__).parents[2] / "docs" / "lecture.toml", {e.name: e for e in ALL})
    assert len(views) == 10
    assert all(view["title"] and view["sentence"] for view in views)
