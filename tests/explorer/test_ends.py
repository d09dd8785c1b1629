"""Work that is cancelled or bounded, ports, failures in words, numbers of attractors; watchers and prepared views."""

import contextlib
import http.client
import json
import threading
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from served_pages import GALLERY, WELLS, WINDOW, Page, assert_same_image, connected, numbers_of, upright
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from cellmap import find_basins
from cellmap.explorer import Explorer
from cellmap.explorer.__main__ import main
from cellmap.explorer.accuracy import quality
from cellmap.explorer.equations import typed_system
from cellmap.explorer.films import FilmStopped
from cellmap.explorer.formulas import EquationError
from cellmap.explorer.images import Images
from cellmap.explorer.protocol import unpacked
from cellmap.explorer.questions import failure
from cellmap.explorer.serving import serve
from cellmap.explorer.view import View
from cellmap.explorer.views import load_views
from systems.gallery import GALLERY as OFFERED


def test_a_question_that_is_cancelled_holds_nobody_up(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    released = threading.Event()
    monkeypatch.setattr("cellmap.explorer.questions.measures", lambda frame: released.wait(20.0) or {})
    page.image()
    first, *others, last = (page.send("measures") for _ in range(9))
    answer = page.receive()
    assert (answer["request"], "8 questions are waiting" in answer["message"]) == (last, True)
    for request in (*others, first, first, 10**6):
        page.send("cancel", of=request)
    for request in (*others, first):
        answer = page.receive()
        assert (answer["request"], answer["message"], answer["cancelled"]) == (request, "cancelled", True)
    assert page.ask("quality")["map"] == "discrete"
    released.set()
    page.refused("cancel", "give a whole number")

    def broken(frame: Any) -> Any:
        raise RuntimeError("it broke")

    monkeypatch.setattr("cellmap.explorer.questions.measures", broken)
    assert page.ask("measures")["message"] == "RuntimeError: it broke"


def test_an_image_that_is_cancelled_ends_at_once(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    """As long as its thread is compiling; another system, and the same one later, have their images."""
    released, frames = threading.Event(), Images.frames

    def waiting(self: Images, *arguments: Any) -> Any:
        if self.explored.name == "wells":
            released.wait(20.0)
        return frames(self, *arguments)

    monkeypatch.setattr(Images, "frames", waiting)
    request = page.send("view", view={})
    page.send("cancel", of=request)
    answer = page.receive()
    assert (answer["request"], answer["cancelled"]) == (request, True)
    page.send("view", view={})
    page.ask("system", name="line")
    assert page.image(cells=[80])[0]["complete"]
    released.set()
    page.ask("system", name="wells")
    assert page.image()[0]["complete"]


def test_a_film_that_is_stopped_goes_on(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, released, frames, computed = threading.Event(), threading.Event(), Images.frames, list[float]()

    def waiting(self: Images, view: View, *arguments: Any) -> Any:
        computed.append(view.params["keep"])
        if view.params["keep"] > 0.62:
            begun.set()
            released.wait(20.0)
        return frames(self, view, *arguments)

    monkeypatch.setattr(Images, "frames", waiting)
    film = {"view": {}, "parameter": "keep", "lower": 0.5, "upper": 0.7, "stills": 5, "palette": [[0, 0, 0]] * 32}
    request = page.send("film", **film)
    seen = page.frames(lambda facts: facts["film"]["number"] == 3 and facts["complete"])
    values = [round(f["film"]["values"]["keep"], 12) for f in seen if f["complete"]]
    assert values == [v for v in (0.5, 0.55, 0.6) if v in values], "a slow page is not sent all images"
    assert values[-1] == 0.6
    assert {(f["film"]["of"], *f["film"]["values"]) for f in seen} == {(5, "keep")}
    assert begun.wait(20.0)
    page.send("cancel", of=request)
    answer = page.receive()
    assert (answer["request"], answer["cancelled"], answer["done"], answer["of"]) == (request, True, 3, 5)
    released.set()
    computed.clear()
    assert page.ask("film", **film, format="gif")["name"] == "basins.gif"
    assert computed == pytest.approx([0.65, 0.7])
    computed.clear()
    assert page.ask("film", **film)["name"] == "basins.gif"
    assert len(computed) == 5, "a complete film begins anew"


def test_a_port_is_free_as_soon_as_its_server_has_ended() -> None:
    with serve(GALLERY, open_page=False) as running, connected(running):
        port = int(running.address.split(":")[2].split("/")[0])
        with pytest.raises(OSError, match=f"port={port} is taken by another program"):
            serve(GALLERY, port, open_page=False)
    with serve(GALLERY, port, open_page=False) as again, connected(again) as page:
        assert page.image()[0]["complete"]


def test_the_command_says_in_one_line_what_is_wrong(explorer: Explorer, capsys: pytest.CaptureFixture[str]) -> None:
    port = explorer.address.split(":")[2].split("/")[0]
    for arguments, told in (
        (["--port", port], f"port={port} is taken"),
        (["--gallery", "no_such_module"], "gallery='no_such_module': give a module"),
        (["--equations", "no_such_file"], "No such file or directory: 'no_such_file'"),
    ):
        with pytest.raises(SystemExit, match="1"):
            main([*arguments, "--no-browser"])
        said = capsys.readouterr().err
        assert told in said
        assert said.count("\n") == 1


def test_what_would_take_too_long_to_compile_is_refused() -> None:
    sines = " + ".join(f"sin({k}*x)" for k in range(70))
    with pytest.raises(EquationError, match="line 2, column 1: more than 5000 operations, of which a function"):
        typed_system(f"v -> v\nx -> {sines}")
    with pytest.raises(EquationError, match="a formula has too many parts within or after each other"):
        typed_system("x -> " + " + ".join(400 * ["x"]))
    assert typed_system("x -> " + " + ".join(f"sin({k}*x)" for k in range(50))).system.dimension == 1


def test_failures_are_told_in_words() -> None:
    told = failure(np.linalg.LinAlgError("Matrix is not positive definite"), 3)
    assert told["message"].startswith("numbers became too large or too small on the way (matrix is not positive")
    assert "reset the parameters" in failure(OverflowError("Result too large"), 3)["message"]
    assert "take fewer cells" in failure(MemoryError("3 GB"), 3)["message"]
    assert failure(FilmStopped(2, 9), 3).items() >= {"cancelled": True, "done": 2, "of": 9, "request": 3}.items()


def test_lost_orbits_and_fine_pixels_are_looked_at() -> None:
    """Of negative damping, orbits grow without bound; pixels of 5e-11 are finer than the tolerance 1e-6 resolves."""
    explored = next(entry for entry in GALLERY if entry.name == "duffing")
    images = Images(explored)  # type: ignore[arg-type]

    def told(**view: Any) -> dict[str, Any]:
        asked = View.of({"nodes": 0, "cells": [6, 5], **view}, explored)  # type: ignore[arg-type]
        *_, last = images.frames(asked)
        return quality(asked, last)

    found = told(params={"delta": -0.5})
    assert found["grown"]["grown"] == found["grown"]["followed"] == 16
    assert found["grown"]["reached"] > 1e3
    found = told(lower=[0.3, -1.0], upper=[0.3 + 1e-9, 1.0], cells=[20, 20])
    assert found["noise"]["pixels"] > 0.5
    assert found["noise"]["tolerance"] < 1e-6
    assert told()["noise"] is None is told()["grown"]


def test_numbers_of_attractors_are_those_of_points_on_them(page: Page) -> None:
    anchors = [[7, [-1.0, 1e-4]], [3, [1.0, 0.0]], [0, [0.0, 0.0]]]  # the last one is a saddle
    request = page.send("view", view={}, anchors=anchors)
    *_, last = page.frames(lambda facts: facts["complete"])
    assert last["request"] == request
    assert {a["identity"]: a["points"][0][0] for a in last["attractors"]} == {7: pytest.approx(-1), 3: pytest.approx(1)}
    assert set(last["born"]) == {3, 7}
    labels = find_basins(WELLS, WINDOW).labels
    _, numbers = page.image(params={"keep": 0.6})
    assert sorted(np.unique(numbers)) == [3, 7]
    assert (numbers == 3).sum() in [int((labels == k).sum()) for k in (0, 1)]
    for wrong in (3, [[1]], [[-1, [0, 0]]], [[1, [0, 0, 0]]], [["a", [0, 0]]], [[1, [0, 0]]] * 300):
        page.refused("view", "anchors", view={}, anchors=wrong)
    for near, number in (([0.63, 0.19], 7), ([1.5, -1.5], 0)):  # a chaotic attractor is a cloud of points
        page.ask("system", text="x -> 1 - 1.4*x**2 + y\ny -> 0.3*x")
        page.send("view", view={}, anchors=[[7, near]])
        *_, last = page.frames(lambda facts: facts["complete"])
        assert [a["identity"] for a in last["attractors"]] == [number]


def test_a_server_gives_back_memory_as_long_as_it_serves(monkeypatch: pytest.MonkeyPatch) -> None:
    given, others = threading.Event(), set(threading.enumerate())
    monkeypatch.setattr("cellmap.explorer.serving._GIVING_BACK", 0.01)
    monkeypatch.setattr("cellmap.explorer.serving.give_back_memory", given.set)
    with serve(GALLERY, open_page=False):
        assert given.wait(20.0)
        waiting = [t for t in threading.enumerate() if t.name == "memory" and t not in others]
    assert waiting
    for thread in waiting:
        thread.join(20.0)
        assert not thread.is_alive()


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
            assert facts["compressed"] is True
            facts["data"] = zlib.decompress(data)
            assert_same_image(facts, numbers_of(facts), find_basins(WELLS.with_params(keep=0.65), WINDOW), upright)
            assert facts["view"]["params"] == {"keep": 0.65}
            socket.send(json.dumps({"type": "view", "view": {"params": {"keep": 0.9}}, "request": 1}))
            page.image(params={"keep": 0.55})
            facts, data = unpacked(socket.recv(5))
            assert facts["view"]["params"] == {"keep": 0.55}
            with pytest.raises(ConnectionClosed):  # while it sends or afterwards, as the server is quick
                for _ in range(100):
                    socket.send("x")
                for _ in range(20):
                    socket.recv(5)


def test_watchers_are_limited_and_reach_nothing_else(shared: Explorer) -> None:
    with watching(shared) as one, watching(shared) as other:
        assert [json.loads(s.recv(5))["type"] for s in (one, other)] == ["welcome"] * 2
        with (
            watching(shared) as third,
            pytest.raises(ConnectionClosed, match=r"1013 .*2 watch already, which is the limit"),
        ):
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


def test_nobody_watches_by_default_and_the_explorer_is_not_in_the_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its own token is unknown at any address but this machine's own."""
    monkeypatch.setattr("cellmap.explorer.server.HOSTS", ("127.0.0.9", "127.0.0.1", "localhost"))
    with serve(GALLERY, open_page=False) as running:
        assert running.watch_address is None
        assert "watch" not in str(running)
        place, token = running.address.split("/")[2:4]
        assert status(place, f"/{token}/") == 404
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
    lecture = load_views(Path(__file__).parents[2] / "docs" / "lecture.toml", {e.name: e for e in OFFERED})
    assert len(lecture) == 10
    assert all(view["title"] and view["sentence"] for view in lecture)
