"""Random use of the explorer by several pages at once: storms, garbage, reconnects, systems that diverge or fail."""

import asyncio
import contextlib
import gc
import json
import logging
import random
import time
from collections import Counter
from typing import Any

import numpy as np
import psutil
import pytest
from served_pages import GALLERY, WELLS, WINDOW
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from cellmap import CellGrid, find_basins
from cellmap.explorer.protocol import LOWEST, unpacked
from cellmap.explorer.serving import serve

TYPED = (
    "x' = x**2 + cos(t)\nperiod = 2*pi",  # escapes in a finite time
    "x -> 1/x\n",  # has no image of 0
    "x -> a*x*(1 - x)\na = 3.9",
    "x' = y\ny' = log(x)\nperiod = 1",  # NaN on one side
    "x' = ",
    "import os",
)
GARBAGE = ("", "{", "[]", '{"type": 1}', *(f'{{"type": "{kind}"}}' for kind in ("view", "orbit", "film", "drawn")))
NUMBERS = (-0.5, 1e300, 0.3, 0.5, 0.61, 0.7, 1.2, 30.0)


class RandomPage:
    """A page that does anything, and draws what it gets."""

    def __init__(self, address: str, seed: int) -> None:
        self.address, self.random = address, random.Random(seed)
        self.number = 0
        self.told: Counter[str] = Counter()

    async def use(self, seconds: float) -> None:
        end = time.monotonic() + seconds

        def goes_on() -> bool:
            """Tell whether there is time left; on a busy machine there is until some images have come."""
            return time.monotonic() < end + (0.0 if self.told["frame"] > 2 else 60.0)

        while goes_on():
            async with self.connected() as socket:
                reading = asyncio.ensure_future(self.read(socket))
                try:
                    for _ in range(self.random.randint(1, 60)):
                        await self.act(socket)
                        await asyncio.sleep(self.random.choice((0.0, 0.01, 0.05, 0.3)))
                        if not goes_on():
                            break
                except ConnectionClosed:
                    self.told["closed"] += 1
                reading.cancel()
                with contextlib.suppress(asyncio.CancelledError, ConnectionClosed):
                    await reading

    def connected(self) -> Any:
        origin = "http://" + self.address.split("/")[2]
        return connect(
            self.address.replace("http", "ws") + "connection",
            origin=origin,
            compression=None,
            max_size=None,
            open_timeout=60.0,  # on a machine that has much else to do
        )

    async def send(self, socket: ClientConnection, kind: str, **fields: Any) -> int:
        self.number += 1
        await socket.send(json.dumps({"type": kind, "request": self.number, **fields}))
        return self.number

    async def act(self, socket: ClientConnection) -> None:
        draw = self.random
        kind = draw.choice("view view view storm window system typed garbage question silence".split())
        if kind in ("view", "storm"):
            for _ in range(1 if kind == "view" else 40):
                name = draw.choice(("keep", "keep", "delta", "gamma"))
                await self.send(socket, "view", view={"params": {name: draw.choice(NUMBERS)}})
        elif kind == "window":
            lower = [draw.uniform(-3, 0) for _ in range(2)]
            view = {"lower": lower, "upper": [v + draw.choice((1e-9, 0.5, 4.0)) for v in lower]}
            await self.send(socket, "view", view={**view, "cells": [draw.randint(1, 120), draw.randint(1, 120)]})
        elif kind == "system":
            await self.send(socket, "system", name=draw.choice(("wells", "duffing", "swing", "none")))
        elif kind == "typed":
            await self.send(socket, "system", text=draw.choice(TYPED))
        elif kind == "garbage":
            await socket.send(draw.choice(GARBAGE))
        elif kind == "question":
            question = draw.choice(("quality", "verify", "script", "hdf5", "netcdf", "orbit", "diagram"))
            point = [draw.choice((0.0, 0.3, 1e9, 1e300)) for _ in range(draw.randint(1, 2))]
            await self.send(socket, question, point=point, parameter="keep", lower=0.5, upper=0.7)

    async def read(self, socket: ClientConnection) -> None:
        async for message in socket:
            if isinstance(message, str):
                answer = json.loads(message)
                self.told[answer["type"]] += 1
                assert answer["type"] != "error" or answer["message"]
                continue
            facts, data = unpacked(message)
            self.told[facts["type"]] += 1
            if facts["type"] == "frame":
                codes = np.frombuffer(data, facts["pixels"])
                assert codes.size == facts["rows"] * facts["columns"]
                known = {a["identity"] for a in facts["attractors"]} | set(range(LOWEST, 0))
                assert set((codes.astype(int) + LOWEST).tolist()) <= known
                await socket.send(json.dumps({"type": "drawn", "frame": facts["frame"]}))

    async def last(self) -> None:
        """A page that is opened after all that has the image of the library."""
        async with self.connected() as socket:
            await socket.recv()
            await self.send(socket, "view", view={})
            while True:
                facts, data = unpacked(await asyncio.wait_for(socket.recv(), 60))
                await socket.send(json.dumps({"type": "drawn", "frame": facts["frame"]}))
                if facts["complete"]:
                    break
        columns, rows = facts["columns"], facts["rows"]
        basins = find_basins(WELLS, CellGrid(WINDOW.lower, WINDOW.upper, (columns, rows)))
        codes = np.frombuffer(data, facts["pixels"]).reshape(rows, columns)
        expected = basins.labels.T[::-1]
        pairs = set(zip(codes.ravel().tolist(), expected.ravel().tolist(), strict=True))
        assert len(pairs) == len(basins.attractors) == 2, "the same sets"


def used(address: str, pages: int, seconds: float, seed: int) -> Counter[str]:
    async def all_at_once() -> Counter[str]:
        some = [RandomPage(address, seed + k) for k in range(pages)]
        await asyncio.gather(*(page.use(seconds) for page in some))
        await some[0].last()
        return sum((page.told for page in some), Counter())

    return asyncio.run(all_at_once())


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize(
    "seconds", [pytest.param(2.0, marks=pytest.mark.thorough), pytest.param(600.0, marks=pytest.mark.slow)]
)
def test_random_use_leaves_no_error_leak_or_wrong_image(seconds: float, caplog: pytest.LogCaptureFixture) -> None:
    process = psutil.Process()

    def memory() -> float:
        gc.collect()
        return process.memory_info().rss / 2**20

    with caplog.at_level(logging.WARNING), serve(GALLERY, open_page=False) as explorer:
        used(explorer.address, 3, min(seconds / 2, 60.0), seed=100)  # loads and compiles what there is
        before = memory()
        told = used(explorer.address, 3 if seconds < 60 else 10, seconds, seed=0)
        deadline = time.monotonic() + 20.0
        while seconds > 60.0 and memory() > before + 20.0 and time.monotonic() < deadline:
            time.sleep(0.5)
        grown = memory() - before
    assert told["frame"] > 5
    assert told["error"] > 5
    assert not [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR]
    assert seconds < 60.0 or grown < 20.0
