"""The explorer's server, over real connections: its images are the library's, and it serves nobody but its page."""

from __future__ import annotations

import contextlib
import io
import json
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from math import cos, pi
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from cellmap import CellGrid, ForcedSystem, discrete_map, find_basins, interpolated_map, load_basins, stroboscopic_map
from cellmap.analysis.fractal import basin_entropy, boundary_dimension
from cellmap.explorer import Explored, Explorer, explore
from cellmap.explorer.protocol import LOWEST, unpacked
from cellmap.explorer.server import MOST_SESSIONS, same_origin
from cellmap.explorer.serving import serve

WINDOW = CellGrid((-2.0, -1.5), (2.0, 1.5), (64, 48))


def step(x, p):
    """Damped motion in a double well: fixed points (-1, 0) and (1, 0) of two basins that wind around each other."""
    speed = p.keep * x[1] + 0.2 * (x[0] - x[0] ** 3)
    return x[0] + speed, speed


def forced(t, x, p):
    return x[1], x[0] - x[0] ** 3 - p.delta * x[1] + p.gamma * cos(t)


WELLS = discrete_map(step, {"keep": 0.6}, ("x", "v"))
DUFFING = ForcedSystem(forced, {"delta": 0.2, "gamma": 0.1}, 2 * pi, ("q", "v"), "Duffing")
GALLERY = (
    Explored("wells", lambda: WELLS, WINDOW),
    Explored("duffing", lambda: DUFFING, CellGrid((-2.2, -2.2), (2.2, 2.2), (60, 50)), nodes=128),
    Explored("line", lambda: discrete_map(lambda x, p: (x[0] * x[0] + p.c,), {"c": 0.0}, ("x",))),
)


@pytest.fixture(scope="module")
def explorer() -> Iterator[Explorer]:
    with serve(GALLERY, open_page=False) as running:
        yield running


class Page:
    """A page without a browser."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.number = 0
        self.hello = json.loads(socket.recv(10))

    def send(self, kind: str, **fields: Any) -> int:
        self.number += 1
        self.socket.send(json.dumps({"type": kind, "request": self.number, **fields}))
        return self.number

    def receive(self, timeout: float = 20.0) -> dict[str, Any]:
        message = self.socket.recv(timeout)
        if isinstance(message, str):
            return dict(json.loads(message))
        facts, data = unpacked(message)
        return {**facts, "data": data}

    def ask(self, kind: str, **fields: Any) -> dict[str, Any]:
        request = self.send(kind, **fields)
        while True:
            answer = self.receive()
            if answer["type"] == "frame":
                self.socket.send(json.dumps({"type": "drawn", "frame": answer["frame"]}))
            elif answer["request"] == request:
                return answer

    def image(self, **view: Any) -> tuple[dict[str, Any], NDArray[np.int64]]:
        """Ask for a view and return its complete frame, with the numbers of its pixels."""
        request = self.send("view", view=view)
        while True:
            frame = self.receive()
            assert frame["type"] == "frame", frame
            self.socket.send(json.dumps({"type": "drawn", "frame": frame["frame"]}))
            if frame["request"] == request and frame["complete"]:
                return frame, numbers_of(frame)


def numbers_of(frame: dict[str, Any]) -> NDArray[np.int64]:
    codes = np.frombuffer(frame["data"], np.dtype(frame["pixels"]).newbyteorder("<"))
    return codes.reshape(frame["height"], frame["width"]).astype(int) + LOWEST


@contextlib.contextmanager
def connected(explorer: Explorer, **options: Any) -> Iterator[Page]:
    origin = explorer.address.split("/", 3)[0] + "//" + explorer.address.split("/", 3)[2]
    options = {"origin": origin, "compression": None, "max_size": None, **options}
    with connect(explorer.address.replace("http", "ws") + "connection", **options) as socket:
        yield Page(socket)


@pytest.fixture
def page(explorer: Explorer) -> Iterator[Page]:
    with connected(explorer) as there:
        yield there


def assert_same_image(frame: dict[str, Any], numbers: NDArray[np.int64], basins: Any, raster: Any) -> None:
    """Pixel by pixel the attractors that the library finds, whatever the numbers of these are."""
    places = {a["identity"]: np.array(a["points"]) for a in frame["attractors"]}
    found = np.array([
        next(k for k, p in places.items() if p.shape == a.points.shape and np.abs(p - a.points).max() < 1e-6)
        for a in basins.attractors
    ])  # fmt: skip
    assert np.array_equal(numbers, raster(np.where(basins.labels < 0, basins.labels, found[basins.labels])))


def upright(labels: NDArray[Any]) -> NDArray[Any]:
    return labels.T[::-1]


def test_images_are_those_of_the_library(page: Page) -> None:
    assert page.hello["system"]["view"]["params"] == {"keep": 0.6}
    frame, numbers = page.image()
    assert_same_image(frame, numbers, find_basins(WELLS, WINDOW), upright)
    frame, numbers = page.image(params={"keep": 0.7}, lower=[-1, -1], upper=[0.5, 1], cells=[40, 30])
    grid = CellGrid((-1.0, -1.0), (0.5, 1.0), (40, 30))
    assert_same_image(frame, numbers, find_basins(WELLS.with_params(keep=0.7), grid), upright)
    frame, numbers = page.image(axes=[1, 0], lower=[-1.5, -2], upper=[1.5, 2], cells=[48, 64])
    assert_same_image(frame, numbers, find_basins(WELLS, WINDOW), lambda labels: labels[::-1])


def test_parameters_phases_and_kinds_of_maps_of_a_forced_system(page: Page) -> None:
    assert page.ask("system", name="duffing")["system"]["forced"]
    grid = CellGrid((-2.2, -2.2), (2.2, 2.2), (60, 50))
    for nodes, phase in ((0, 0.0), (128, 0.25)):
        frame, numbers = page.image(params={"gamma": 0.12}, phase=phase, nodes=nodes)
        exact = stroboscopic_map(DUFFING.with_params(gamma=0.12), phase, rtol=1e-6, atol=1e-6)
        table = CellGrid((-2.42, -2.42), (2.42, 2.42), (128, 128))
        point_map = interpolated_map(exact, table) if nodes else exact
        assert_same_image(frame, numbers, find_basins(point_map, grid), upright)
        told = page.ask("quality")
        assert told["map"] == ("interpolated" if nodes else "stroboscopic")
        assert not nodes or 0 < told["error"]["median"] < told["error"]["largest"]
    verified = page.ask("verify", n_samples=200)
    assert verified["compared"] == 200
    assert verified["low"] <= verified["wrong"] / 200 <= verified["high"]


def test_a_map_of_one_coordinate_is_a_strip(page: Page) -> None:
    page.ask("system", name="line")
    _, numbers = page.image(cells=[80])
    assert numbers.shape == (1, 80)
    places = np.abs(np.linspace(-2 + 2 / 80, 2 - 2 / 80, 80))
    assert np.array_equal(numbers[0] >= 0, places < 1)


def test_an_orbit_ends_where_its_pixel_says(page: Page) -> None:
    page.ask("system", name="duffing")
    frame, numbers = page.image(nodes=0)
    for column, row in ((3, 7), (30, 20), (55, 44)):
        place = [-2.2 + 4.4 * (column + 0.5) / 60, 2.2 - 4.4 * (row + 0.5) / 50]
        orbit = page.ask("orbit", point=place)
        assert orbit["identity"] == numbers[row, column]
        (end,) = (a for a in frame["attractors"] if a["identity"] == orbit["identity"])
        assert np.abs(np.array(orbit["strobe"][-1]) - end["points"][0]).max() < 0.1
        states, samples = np.array(orbit["motion"]["states"]), orbit["motion"]["samples"]
        assert np.abs(states[::samples] - np.array(orbit["strobe"])).max() < 1e-4


def test_the_script_computes_the_image_again_to_the_bit(page: Page, capsys: pytest.CaptureFixture[str]) -> None:
    text = "\n".join(["q' = v", "v' = q - q**3 - c*v + f*cos(w*t)", "c = 0.2", "f = 0.1", "w = 1.1", "period = 2*pi/w"])
    assert page.ask("system", text=text)["system"]["view"]["params"] == {"c": 0.2, "f": 0.1, "w": 1.1}
    page.image(params={"f": 0.11}, phase=0.1, cells=[50, 40])
    frame, _ = page.image(params={"f": 0.12}, phase=0.1, cells=[50, 40], nodes=128)
    names: dict[str, Any] = {"__name__": "script"}
    exec(page.ask("script")["text"], names)
    assert "bit by bit" in capsys.readouterr().out
    assert names["basins"].labels.shape == (50, 40)
    assert sum(a["fraction"] for a in frame["attractors"]) == pytest.approx(1.0)


def test_the_file_is_one_of_basins(page: Page, tmp_path: Any) -> None:
    frame, numbers = page.image()
    file = page.ask("hdf5")
    (tmp_path / file["name"]).write_bytes(file["data"])
    assert_same_image(frame, numbers, load_basins(tmp_path / file["name"]), upright)


# --- the newest view wins


def test_at_most_two_frames_are_under_way_and_the_last_view_comes_to_its_end(page: Page) -> None:
    for k in range(40):
        last = page.send("view", view={"params": {"keep": 0.5 + 0.005 * k}, "cells": [300, 300]})
    frames = []
    with contextlib.suppress(TimeoutError):
        while True:
            frames.append(page.receive(2.0))
    assert len(frames) == 2
    for frame in frames:
        page.send("drawn", frame=frame["frame"])
    while not (frames[-1]["request"] == last and frames[-1]["complete"]):
        frames.append(page.receive())
        page.send("drawn", frame=frames[-1]["frame"])
    assert len(frames) < 40, "views in between are left out"
    requests = [frame["request"] for frame in frames]
    assert requests == sorted(requests)


def test_a_newer_view_ends_the_image_before(page: Page) -> None:
    """Four million initial conditions, for which nobody waits."""
    page.image()
    page.send("view", view={"params": {"keep": 0.65}, "cells": [2000, 2000]})
    frame = page.receive()
    page.send("drawn", frame=frame["frame"])
    wanted = page.send("view", view={"params": {"keep": 0.7}})
    frames = [frame]
    while not (frames[-1]["request"] == wanted and frames[-1]["complete"]):
        frames.append(page.receive())
        page.send("drawn", frame=frames[-1]["frame"])
    assert not any(f["complete"] for f in frames if f["request"] != wanted)


def test_work_ends_with_the_connection(explorer: Explorer) -> None:
    def workers() -> int:
        return sum(t.name.startswith(("image", "question")) for t in threading.enumerate())

    before = workers()
    for _ in range(3):
        with connected(explorer) as page:
            page.send("view", view={"cells": [2000, 2000]})
            assert not page.receive()["complete"]
    deadline = time.monotonic() + 10.0
    while workers() > before and time.monotonic() < deadline:
        time.sleep(0.02)
    assert workers() <= before


def test_a_server_with_a_page_that_rests_costs_nothing(page: Page) -> None:
    page.image()
    time.sleep(0.3)
    began = time.process_time()
    time.sleep(1.0)
    assert time.process_time() - began < 0.02


# --- who is served, and what is understood


def test_nothing_is_served_without_the_token(explorer: Explorer) -> None:
    base = explorer.address.rsplit("/", 2)[0]
    with urllib.request.urlopen(explorer.address) as answer:
        assert b"cellmap explorer" in answer.read()
        assert answer.headers["Referrer-Policy"] == "no-referrer"
        assert "default-src 'self'" in answer.headers["Content-Security-Policy"]
    for address in (f"{base}/", f"{base}/main.js", f"{base}/{'x' * 32}/", f"{explorer.address}../server.py"):
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(address)
    with pytest.raises(InvalidStatus):
        connect(f"{base.replace('http', 'ws')}/connection")


def test_no_other_page_is_served(explorer: Explorer) -> None:
    for origin in ("http://example.org", "null", None, "http://127.0.0.1", "https://" + explorer.address.split("/")[2]):
        with pytest.raises((InvalidStatus, ConnectionClosed)), connected(explorer, origin=origin):
            pass
    request = urllib.request.Request(explorer.address, headers={"Host": "example.org"})
    with pytest.raises(urllib.error.HTTPError, match="400"):
        urllib.request.urlopen(request)
    assert not same_origin("http://example.org:80", "example.org:80")


GARBAGE = [
    ("", "send JSON"),
    ("{", "send JSON"),
    ("[1, 2]", "send an object with a type"),
    ('{"type": 3}', "send an object with a type"),
    ('{"type": "view", "request": NaN}', "NaN is no number"),
    ("[" * 5000, "send JSON"),
    ('{"type": "destroy"}', "type='destroy': this is none of drawn, view"),
    ('{"type": "view"}', "request=None: give a whole number"),
    ('{"type": "view", "request": 1, "view": 7}', "view=7: give an object"),
    ('{"type": "view", "request": 1, "view": {"colour": 1}}', "view has no ['colour']"),
    ('{"type": "view", "request": 1, "view": {"params": {"mass": 1}}}', "params has no ['mass']"),
    ('{"type": "view", "request": 1, "view": {"params": {"keep": "1"}}}', "params['keep']='1': give one real number"),
    ('{"type": "view", "request": 1, "view": {"params": {"keep": 1e999}}}', "give a finite number"),
    ('{"type": "view", "request": 1, "view": {"cells": [4000, 4000]}}', "give at most 4,000,000 initial conditions"),
    ('{"type": "view", "request": 1, "view": {"axes": [0, 0]}}', "axes=(0, 0): choose different coordinates"),
    ('{"type": "view", "request": 1, "view": {"axes": [0, 9]}}', "axes=9: give a whole number of at most 1"),
    ('{"type": "view", "request": 1, "view": {"lower": [3, 3]}}', "the window is empty or inverted"),
    ('{"type": "view", "request": 1, "view": {"lower": [[0], 1]}}', "lower"),
    ('{"type": "view", "request": 1, "view": {"nodes": 5}}', "nodes=5"),
    ('{"type": "system", "name": "os"}', "name='os': choose one of wells, duffing"),
    ('{"type": "system", "text": 4}', "text=4: give a string"),
    ('{"type": "orbit", "point": [1]}', ""),
    ('{"type": "verify", "n_samples": 1e9}', ""),
    (b"\x00\x01", "message of bytes: send text"),
]


def test_garbage_is_answered_with_an_error_and_the_page_lives_on(page: Page) -> None:
    page.image()
    for garbage, message in GARBAGE:
        page.socket.send(garbage)
        answer = page.receive()
        assert answer["type"] == "error", (garbage, answer)
        assert message in answer["message"], (garbage, answer)
    assert page.image()[0]["complete"]


def test_too_much_ends_the_connection(explorer: Explorer) -> None:
    with connected(explorer) as page, pytest.raises(ConnectionClosed):
        page.socket.send("x" * 200_000)
        page.receive()
    with connected(explorer) as page, pytest.raises(ConnectionClosed) as closed:
        for _ in range(2000):
            page.socket.send('{"type": "drawn", "frame": 0}')
        page.receive()
    assert "messages a second" in str(closed.value)


def test_a_number_of_pages_is_the_limit(explorer: Explorer) -> None:
    with contextlib.ExitStack() as open_pages:
        for _ in range(MOST_SESSIONS):
            open_pages.enter_context(connected(explorer))
        with pytest.raises(ConnectionClosed, match="close one of them"), connected(explorer):
            pass


def test_a_system_that_is_given() -> None:
    with explore(WELLS, WINDOW, open_page=False, wait=False) as running, connected(running) as page:
        assert page.hello["system"]["name"] == "given"
        frame, numbers = page.image()
        assert_same_image(frame, numbers, find_basins(WELLS, WINDOW), upright)
        assert f'src="{running.address}"' in running._repr_html_()
    assert repr(running) == "Explorer(closed)"
    with pytest.raises(ValueError, match="give the ForcedSystem of the map"):
        explore(stroboscopic_map(DUFFING), open_page=False)
    with pytest.raises(TypeError, match="system=3: give"):
        explore(3)  # type: ignore[arg-type]


def test_a_diagram_follows_the_attractors(page: Page) -> None:
    """Pitchfork: the fixed points of x + 0.2 (x - x^3) are 0 and +-1 at any value of `keep`."""
    frame, _ = page.image()
    found = page.ask("diagram", parameter="keep", lower=0.4, upper=0.7)
    points = np.frombuffer(found["data"], "<f4").reshape(found["shape"])
    assert points.shape[0] == 2
    assert points.shape[1] == len(found["values"])
    assert (np.diff(found["values"]) >= 0).all()
    for identity, branch in zip(found["identities"], points, strict=True):
        (attractor,) = (a for a in frame["attractors"] if a["identity"] == identity)
        assert np.abs(branch - attractor["points"][0]).max() < 1e-5
    assert "give a range around the present value" not in str(found)
    wrong = page.ask("diagram", parameter="mass", lower=0.4, upper=0.7)
    assert wrong["message"].startswith("parameter='mass'")


def test_a_film_has_the_images_of_its_values(page: Page) -> None:
    palette = np.random.default_rng(0).integers(0, 256, (32, 3)).tolist()
    request = page.send("film", view={}, parameter="keep", lower=0.5, upper=0.7, stills=3, palette=palette)
    while (answer := page.receive())["type"] == "frame":
        page.send("drawn", frame=answer["frame"])
    assert (answer["type"], answer["request"]) == ("film", request)
    with Image.open(io.BytesIO(answer["data"])) as film:
        assert film.n_frames == 3
        film.seek(2)
        last = np.array(film.convert("RGB"))
    _, numbers = page.image(params={"keep": 0.7})
    assert np.array_equal(last, np.array(palette)[numbers - LOWEST])
    assert (
        "palette" in page.ask("film", view={}, parameter="keep", lower=0, upper=1, stills=2, palette=[[300]])["message"]
    )


def test_measures_and_certificates_are_the_librarys(page: Page) -> None:
    cells = [200, 200]
    page.image(cells=cells)
    basins = find_basins(WELLS, CellGrid((-2.0, -1.5), (2.0, 1.5), (200, 200)))
    found = {m["name"]: m for m in page.ask("measures")["measures"]}
    entropy, dimension = basin_entropy(basins), boundary_dimension(basins)
    assert found["basin entropy"]["value"] == pytest.approx(entropy.entropy)
    assert found["boundary basin entropy"]["error"] == pytest.approx(entropy.boundary_error)
    assert found["boundary dimension"]["value"] == pytest.approx(dimension.fit.slope)
    assert len(found["uncertainty exponent"]["fit"]["x"]) > 3
    page.ask("system", name="line")
    page.image(cells=[80])
    assert "certificates are for maps of two coordinates" in page.ask("certify")["message"]
    page.ask("system", name="duffing")
    page.image(cells=[40, 30])
    told = page.ask("certify")
    assert told["open"] == np.frombuffer(told["data"], np.uint8).sum()
    assert (told["height"], told["width"]) == (30, 40)
    assert 0 <= told["changed"] <= told["redone"] <= 1200
