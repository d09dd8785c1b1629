"""Pages without a browser, and the systems that they are served."""

import contextlib
import json
from collections.abc import Callable, Iterator
from math import cos, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray
from websockets.sync.client import ClientConnection, connect

from cellmap import CellGrid, ForcedSystem, discrete_map
from cellmap.explorer import Explored, ExploredScene, Explorer
from cellmap.explorer.protocol import LOWEST, unpacked

WINDOW = CellGrid((-2.0, -1.5), (2.0, 1.5), (64, 48))


def step(x, p):
    """Damped motion in a double well: fixed points (-1, 0) and (1, 0) of two basins that wind around each other."""
    speed = p.keep * x[1] + 0.2 * (x[0] - x[0] ** 3)
    return x[0] + speed, speed


def forced(t, x, p):
    return x[1], x[0] - x[0] ** 3 - p.delta * x[1] + p.gamma * cos(t)


def push(x, p):
    speed = p.keep * x[1] + 0.2 * (x[0] - x[0] ** 3) + 0.2 * p.push
    return x[0] + speed, speed


def made(body: str, effects: tuple[str, ...]) -> Explored:
    """A double well, perhaps with a force."""
    params = {"keep": 0.6 if body == "light" else 0.7, **({"push": 0.5} if "push" in effects else {})}
    return Explored("", lambda: discrete_map(push if "push" in effects else step, params, ("x", "v")), WINDOW)


WELLS = discrete_map(step, {"keep": 0.6}, ("x", "v"))
DUFFING = ForcedSystem(forced, {"delta": 0.2, "gamma": 0.1}, 2 * pi, ("q", "v"), "Duffing")
GALLERY = (
    Explored("wells", lambda: WELLS, WINDOW),
    Explored("duffing", lambda: DUFFING, CellGrid((-2.2, -2.2), (2.2, 2.2), (60, 50)), nodes=128),
    Explored("line", lambda: discrete_map(lambda x, p: (x[0] * x[0] + p.c,), {"c": 0.0}, ("x",))),
    ExploredScene("parts", "From parts", ("light", "heavy"), ("push",), ("light",), made),
)


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
        """Ask, and draw what comes before the answer."""
        request = self.send(kind, **fields)
        while True:
            answer = self.receive()
            if answer["type"] == "frame":
                self.socket.send(json.dumps({"type": "drawn", "frame": answer["frame"]}))
            elif answer["request"] == request:
                return answer

    def refused(self, kind: str, message: str, **fields: Any) -> None:
        """Ask for something that is answered with a message."""
        assert message in self.ask(kind, **fields)["message"]

    def image(self, **view: Any) -> tuple[dict[str, Any], NDArray[np.int64]]:
        """Ask for a view and return its complete frame, with the numbers of its pixels."""
        request = self.send("view", view=view)
        frame = self.frames(lambda facts: facts["request"] == request and facts["complete"])[-1]
        return frame, numbers_of(frame)

    def frames(self, last: Callable[[dict[str, Any]], bool]) -> list[dict[str, Any]]:
        """Receive frames until one is the last of interest."""
        frames: list[dict[str, Any]] = []
        while not frames or not last(frames[-1]):
            frames.append(self.receive())
            assert frames[-1]["type"] == "frame", frames[-1]
            self.socket.send(json.dumps({"type": "drawn", "frame": frames[-1]["frame"]}))
        return frames


def numbers_of(frame: dict[str, Any]) -> NDArray[np.int64]:
    codes = np.frombuffer(frame["data"], np.dtype(frame["pixels"]).newbyteorder("<"))
    return codes.reshape(frame["rows"], frame["columns"]).astype(int) + LOWEST


@contextlib.contextmanager
def connected(explorer: Explorer, **options: Any) -> Iterator[Page]:
    origin = explorer.address.split("/", 3)[0] + "//" + explorer.address.split("/", 3)[2]
    options = {"origin": origin, "compression": None, "max_size": None, **options}
    with connect(explorer.address.replace("http", "ws") + "connection", **options) as socket:
        yield Page(socket)


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
