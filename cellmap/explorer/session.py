"""One connection of the explorer: the newest view wins, and at most two frames are under way."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from starlette.websockets import WebSocket, WebSocketDisconnect

from .._lib.checks import shown, text, whole_number
from ..attractors.labels import LABEL_NAMES
from . import downloads
from .equations import typed_system
from .explored import Explored, ExploredScene, explored_of
from .films import Film, sweep
from .formulas import EquationError
from .images import Images, basin_image, described, orbit, quality, verification
from .measures import certificate, measures
from .protocol import LOWEST, MessageError, decoded, encoded, packed
from .saddles import saddles
from .stability import stability
from .sweeps import diagram
from .view import SCHEMA, View

UNDER_WAY = 2
"""Frames that have been sent, and that the page has not drawn yet."""

PATIENCE = 1.0
"""Seconds for which an image without a first frame is not given up for a newer one."""

RATE, BURST = 300.0, 600.0
"""Messages a second that a page may send for long, and at once."""


_Still = tuple[View, NDArray[np.int16]]


@dataclass(frozen=True, eq=False)
class _Wanted:
    """An image that the page has asked for, or the images of a film."""

    request: int
    images: Images
    views: tuple[View, ...]
    near: Any
    since: float
    film: Film | None = None


class Session:
    """A page that is connected.

    Parameters
    ----------
    socket : WebSocket
        Connection that has been accepted.
    gallery : mapping of str to Explored or ExploredScene
        Systems by name.
    """

    def __init__(self, socket: WebSocket, gallery: Mapping[str, Explored | ExploredScene]) -> None:
        self._socket, self._gallery = socket, gallery
        self._images = Images(explored_of(next(iter(gallery.values()))))
        self._wanted: _Wanted | None = None  # newest
        self._present: _Wanted | None = None  # being computed
        self._has_frame = False
        self._wake, self._room = asyncio.Event(), asyncio.Event()
        self._waiting: tuple[_Wanted, dict[str, Any], bytes] | None = None
        self._sent: set[int] = set()
        self._frames = 0
        self._answering = asyncio.Lock()
        self._sending = asyncio.Lock()
        self._jobs: set[asyncio.Task[None]] = set()
        self._drawing, self._asking = ThreadPoolExecutor(1, "image"), ThreadPoolExecutor(1, "question")

    async def run(self) -> None:
        """Serve the page until it is gone."""
        work = [asyncio.ensure_future(self._draw()), asyncio.ensure_future(self._send_frames())]
        try:
            await self._hello()
            await self._listen()
        except (WebSocketDisconnect, RuntimeError):
            pass  # the page is gone, while it was listened to or written to
        finally:
            self._wanted = None
            self._images.cancel()
            for task in [*work, *self._jobs]:
                task.cancel()
            await asyncio.gather(*work, *self._jobs, return_exceptions=True)
            self._drawing.shutdown(wait=False, cancel_futures=True)
            self._asking.shutdown(wait=False, cancel_futures=True)

    async def _hello(self) -> None:
        await self._tell(
            {
                "type": "hello",
                "schema": SCHEMA,
                "lowest": LOWEST,
                "codes": {name: code for code, name in LABEL_NAMES.items()},
                "systems": [{"name": e.name, "title": e.title} for e in self._gallery.values()],
                "system": described(self._images.explored),
            }
        )

    async def _listen(self) -> None:
        allowance, before = BURST, time.monotonic()
        while True:
            message = await self._socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            now = time.monotonic()
            allowance, before = min(BURST, allowance + RATE * (now - before)) - 1.0, now
            if allowance < 0.0:
                await self._socket.close(1008, f"more than {RATE:g} messages a second")
                return
            request: Any = None
            try:
                if message.get("text") is None:
                    raise MessageError("message of bytes: send text")
                asked = decoded(message["text"])
                request = asked.get("request")
                await self._answer(asked)
            except (EquationError, TypeError, ValueError, ArithmeticError, MemoryError) as error:
                await self._tell(failure(error, request))

    async def _answer(self, asked: Mapping[str, Any]) -> None:
        kind = asked["type"]
        if kind == "drawn":
            self._sent.discard(whole_number("frame", asked.get("frame")))
            self._room.set()
        elif kind == "view":
            request = whole_number("request", asked.get("request"))
            view = View.of(asked.get("view"), self._images.explored)
            self._ask_for(_Wanted(request, self._images, (view,), asked.get("near"), time.monotonic()))
        elif kind == "film":
            request = whole_number("request", asked.get("request"))
            view = View.of(asked.get("view"), self._images.explored)
            views = sweep(view, *_range(asked), asked.get("stills"))
            film = Film.of(asked["parameter"], asked.get("format"), asked.get("palette"), view)
            self._ask_for(_Wanted(request, self._images, views, None, time.monotonic(), film))
        elif kind == "system":
            self._later(asked, lambda: self._chosen(asked), self._use)
        elif kind in _QUESTIONS:
            images = self._images
            self._later(asked, lambda: _QUESTIONS[kind](images, asked), self._reply)
        else:
            raise MessageError(
                f"type={shown(kind)}: this is none of drawn, view, film, system, {', '.join(_QUESTIONS)}"
            )

    def _later(
        self, asked: Mapping[str, Any], work: Callable[[], Any], then: Callable[[Mapping[str, Any], Any], Any]
    ) -> None:
        """Answer a question in its thread; at most a few may wait."""
        if len(self._jobs) >= 8:
            raise ValueError(f"type={asked['type']!r}: eight questions are waiting for answers, ask again later")

        async def job() -> None:
            try:
                answer = await asyncio.get_running_loop().run_in_executor(self._asking, work)
                await then(asked, answer)
            except (WebSocketDisconnect, RuntimeError):
                pass
            except Exception as error:
                with contextlib.suppress(WebSocketDisconnect, RuntimeError):
                    await self._tell(failure(error, asked.get("request")))

        task = asyncio.ensure_future(job())
        self._jobs.add(task)
        task.add_done_callback(self._jobs.discard)

    async def _reply(self, asked: Mapping[str, Any], answer: Any) -> None:
        facts = {"type": asked["type"], "request": asked.get("request")}
        if isinstance(answer, tuple):
            async with self._sending:
                await self._socket.send_bytes(packed({**facts, **answer[0]}, answer[1]))
        else:
            await self._tell({**facts, **answer})

    def _chosen(self, asked: Mapping[str, Any]) -> Images:
        """Return the images of another system: one of the gallery, perhaps with parts, or one that was typed."""
        if asked.get("text") is not None:
            return Images(typed_system(text("text", asked["text"])))
        name = text("name", asked.get("name"))
        if name not in self._gallery:
            raise ValueError(f"name={shown(name)}: choose one of {', '.join(self._gallery)}")
        return Images(explored_of(self._gallery[name], asked.get("parts")))

    async def _use(self, asked: Mapping[str, Any], images: Images) -> None:
        self._images.cancel()
        self._images, self._wanted = images, None
        answer = {"type": "system", "request": asked.get("request"), "text": asked.get("text")}
        await self._tell({**answer, "system": described(images.explored)})

    def _ask_for(self, wanted: _Wanted) -> None:
        self._wanted = wanted
        self._wake.set()
        now = self._present
        if now is not None and (self._has_frame or time.monotonic() - now.since > PATIENCE):
            now.images.cancel()

    async def _draw(self) -> None:
        """Compute the newest image, again and again."""
        loop = asyncio.get_running_loop()
        while True:
            await self._wake.wait()
            self._wake.clear()
            wanted, self._has_frame = self._wanted, False
            if wanted is None or wanted is self._present:
                continue
            self._present = wanted
            try:
                stills = await loop.run_in_executor(self._drawing, self._compute, wanted, loop)
                if wanted.film is not None:
                    await self._send_film(wanted, wanted.film, stills)
            except (WebSocketDisconnect, RuntimeError):
                return
            except Exception as error:
                await self._tell(failure(error, wanted.request))

    def _compute(self, wanted: _Wanted, loop: asyncio.AbstractEventLoop) -> list[_Still]:
        """Compute images, in the thread for them, until others are wanted; return those of a film."""
        stills: list[_Still] = []
        for view in wanted.views:
            for frame in wanted.images.frames(view, wanted.near):
                self._has_frame = True
                loop.call_soon_threadsafe(self._offer, wanted, *basin_image(view, frame))
                if self._wanted is not wanted:
                    return stills
                if frame.complete and wanted.film is not None:
                    stills.append((view, view.raster(frame.identity_image)))
        return stills

    async def _send_film(self, wanted: _Wanted, film: Film, stills: list[_Still]) -> None:
        """Send a film that is complete."""
        if len(stills) < len(wanted.views):
            raise ValueError("film has ended early, for another image was wanted: ask for it again")
        facts, data = await asyncio.get_running_loop().run_in_executor(None, film.file, stills)
        async with self._sending:
            await self._socket.send_bytes(packed({"type": "film", "request": wanted.request, **facts}, data))

    def _offer(self, wanted: _Wanted, facts: dict[str, Any], data: bytes) -> None:
        """Queue a frame, in the place of the one that waits."""
        self._waiting = wanted, facts, data
        self._room.set()

    async def _send_frames(self) -> None:
        while True:
            await self._room.wait()
            self._room.clear()
            if self._waiting is None or len(self._sent) >= UNDER_WAY:
                continue
            (wanted, facts, data), self._waiting = self._waiting, None
            self._frames += 1
            self._sent.add(self._frames)
            facts = {"type": "frame", "request": wanted.request, "frame": self._frames, **facts}
            facts["seconds"] = time.monotonic() - wanted.since
            try:
                async with self._sending:
                    await self._socket.send_bytes(packed(facts, data))
            except (WebSocketDisconnect, RuntimeError):
                return
            self._room.set()

    async def _tell(self, message: Mapping[str, Any]) -> None:
        async with self._sending:
            await self._socket.send_text(encoded(message))


def failure(error: Exception, request: Any) -> dict[str, Any]:
    """Return the message that says what has failed, and for typed equations where."""
    message = str(error) or type(error).__name__
    if not isinstance(error, EquationError | TypeError | ValueError):
        message = f"{type(error).__name__}: {message}"
    told = {"type": "error", "request": request if isinstance(request, int) else None, "message": message}
    if isinstance(error, EquationError):
        told |= {"line": error.line, "column": error.column}
    return told


def _range(asked: Mapping[str, Any]) -> tuple[Any, Any, Any]:
    return asked.get("parameter"), asked.get("lower"), asked.get("upper")


def _number_of_samples(asked: Mapping[str, Any]) -> int:
    return whole_number("n_samples", asked.get("n_samples", 1000), 1, 20000)


_QUESTIONS: Mapping[str, Callable[[Images, Mapping[str, Any]], Any]] = {
    "quality": lambda images, asked: quality(*images.seen()),
    "verify": lambda images, asked: verification(images.seen()[1], _number_of_samples(asked)),
    "certify": lambda images, asked: certificate(*images.seen()),
    "measures": lambda images, asked: measures(images.seen()[1]),
    "orbit": lambda images, asked: orbit(*images.seen(complete=False), asked.get("point", ())),
    "saddles": lambda images, asked: saddles(*images.seen(), asked.get("longest_period", 1)),
    "diagram": lambda images, asked: diagram(*images.seen(), *_range(asked)),
    "stability": lambda images, asked: stability(*images.seen(), asked.get("x"), asked.get("y")),
    "script": lambda images, asked: {"text": downloads.script(images.explored, *images.seen())},
    "hdf5": lambda images, asked: downloads.hdf5(images.seen()[1]),
    "netcdf": lambda images, asked: downloads.netcdf(images.seen()[1]),
}
