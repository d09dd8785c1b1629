"""One connection of the explorer: the newest view wins, and at most two frames are under way."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from .._lib.arrays import Floats
from .._lib.checks import shown, text, whole_number
from .._lib.stopping import Stop, Stopped, heeding
from .accuracy import TOLERANCES
from .equations import typed_system
from .explored import Explored, ExploredScene, explored_of
from .family import Still
from .films import Film, FilmStopped
from .formulas import EquationError
from .images import LONGEST, Images, basin_image, listed
from .jobs import THREADS, Jobs
from .numbering import anchors_of
from .protocol import LOWEST, MessageError, decoded, encoded, packed
from .questions import QUESTIONS, failure
from .sharing import Broadcast
from .view import SCHEMA, View

UNDER_WAY = 2
"""Frames that have been sent, and that the page has not drawn yet."""

PATIENCE = 1.0
"""Seconds for which an image without a first frame is not given up for a newer one."""

LONGEST_CAPTION = 500
"""Characters of a sentence that watchers see below the image."""

RATE, BURST = 300.0, 600.0
"""Messages a second that a page may send for long, and at once."""


@dataclass(frozen=True, eq=False)
class _Wanted:
    """An image that the page has asked for, or the images of a film."""

    request: int
    images: Images
    views: tuple[View, ...]
    near: Any
    anchors: Mapping[int, Floats]
    since: float
    film: Film | None = None
    caption: str = ""
    stop: Stop = field(default_factory=Stop)
    given_up: asyncio.Event = field(default_factory=asyncio.Event)

    def said(self, number: int) -> dict[str, Any]:
        """Return the message to watchers about an image."""
        view, explored = self.views[number], self.images.explored
        facts = {name: getattr(view, name) for name in View.__dataclass_fields__}
        said = {"view": facts, "system": self.images.described, "title": explored.title, "caption": self.caption}
        return {**said, "codes": self.images.described["codes"], "lowest": LOWEST}

    def give_up(self) -> None:
        """End it, at once for the page; its thread may be compiling, and ends later."""
        self.stop.request()
        self.images.cancel()
        self.given_up.set()


class Session:
    """A page that is connected.

    Parameters
    ----------
    socket : WebSocket
        Connection that has been accepted.
    gallery : mapping of str to Explored or ExploredScene
        Systems by name.
    views : sequence, optional
        Views that were prepared; see :func:`load_views`.
    broadcast : Broadcast or None, optional
        Watchers of the images.
    """

    def __init__(
        self,
        socket: WebSocket,
        gallery: Mapping[str, Explored | ExploredScene],
        views: Sequence[Mapping[str, Any]] = (),
        broadcast: Broadcast | None = None,
    ) -> None:
        self._socket, self._gallery, self._views, self._broadcast = socket, gallery, views, broadcast
        self._images = Images(explored_of(next(iter(gallery.values()))))
        self._wanted: _Wanted | None = None  # newest
        self._present: _Wanted | None = None  # being computed
        self._has_frame = False
        self._wake, self._room = asyncio.Event(), asyncio.Event()
        self._waiting: tuple[_Wanted, dict[str, Any], bytes] | None = None
        self._sent: set[int] = set()
        self._frames = 0
        self._sending = asyncio.Lock()
        self._jobs = Jobs(self._tell)
        self._stills: tuple[Images, str, list[Still]] | None = None  # of a film that is not complete
        self._drawing = ThreadPoolExecutor(THREADS, "image")

    async def run(self) -> None:
        """Serve the page until it is gone."""
        work = [asyncio.ensure_future(self._draw()), asyncio.ensure_future(self._send_frames())]
        try:
            await self._hello()
            await self._listen()
        except (WebSocketDisconnect, RuntimeError):
            pass  # the page is gone, while it was listened to or written to
        finally:
            self._give_up()
            self._wanted = None
            for task in work:
                task.cancel()
            await asyncio.gather(*work, return_exceptions=True)
            await self._jobs.end()
            self._drawing.shutdown(wait=False, cancel_futures=True)

    async def _hello(self) -> None:
        await self._tell(
            {
                "type": "hello",
                "schema": SCHEMA,
                "lowest": LOWEST,
                "tolerances": TOLERANCES,
                "systems": [listed(e) for e in self._gallery.values()],
                "views": self._views,
                "system": self._images.described,
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
            anchors = anchors_of(asked.get("anchors"), len(view.others))
            caption = text("caption", asked.get("caption") or "")[:LONGEST_CAPTION]
            wanted = _Wanted(
                request, self._images, (view,), asked.get("near"), anchors, time.monotonic(), caption=caption
            )
            self._ask_for(wanted)
        elif kind == "film":
            request = whole_number("request", asked.get("request"))
            view = View.of(asked.get("view"), self._images.explored)
            film, views = Film.of(asked, view)
            self._ask_for(_Wanted(request, self._images, views, None, {}, time.monotonic(), film))
        elif kind == "cancel":
            await self._cancel(whole_number("of", asked.get("of")))
        elif kind == "system":
            self._jobs.begin(asked, lambda: self._chosen(asked), self._use)
        elif kind in QUESTIONS:
            images = self._images
            self._jobs.begin(asked, lambda: QUESTIONS[kind](images, asked), self._reply)
        else:
            known = ", ".join(("drawn", "view", "film", "cancel", "system", *QUESTIONS))
            raise MessageError(f"type={shown(kind)}: this is none of {known}")

    async def _cancel(self, request: int) -> None:
        """End what was asked for under a number; what has ended already is no mistake."""
        ended = await self._jobs.cancel(request)
        if not ended and self._wanted is not None and self._wanted.request == request:
            self._give_up()

    def _give_up(self) -> None:
        """End the image that is being computed, and that which was asked for."""
        for wanted in (self._present, self._wanted):
            if wanted is not None:
                wanted.give_up()

    async def _reply(self, asked: Mapping[str, Any], answer: Any) -> None:
        facts = {"type": asked["type"], "request": asked.get("request")}
        if isinstance(answer, tuple):
            async with self._sending:
                await self._socket.send_bytes(packed({**facts, **answer[0]}, answer[1]))
        else:
            await self._tell({**facts, **answer})

    def _chosen(self, asked: Mapping[str, Any]) -> tuple[Images, dict[str, Any]]:
        """Return the images of another system: one of the gallery, perhaps with parts, or one that was typed."""
        if asked.get("text") is not None:
            explored = typed_system(text("text", asked["text"]))
        else:
            name = text("name", asked.get("name"))
            if name not in self._gallery:
                raise ValueError(f"name={shown(name)}: choose one of {', '.join(self._gallery)}")
            explored = explored_of(self._gallery[name], asked.get("parts"))
        images = Images(explored)
        return images, images.described

    async def _use(self, asked: Mapping[str, Any], chosen: tuple[Images, dict[str, Any]]) -> None:
        self._give_up()
        self._images, self._wanted, self._stills = chosen[0], None, None
        answer = {"type": "system", "request": asked.get("request"), "text": asked.get("text")}
        await self._tell({**answer, "system": chosen[1]})

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
                complete = await self._computed(wanted, loop)
                if wanted.film is not None:
                    await self._send_film(wanted, wanted.film)
                elif not complete and self._wanted is wanted:
                    raise ValueError(
                        f"image is not complete after {LONGEST:g} s: take fewer cells, or a looser tolerance"
                    )
            except (WebSocketDisconnect, RuntimeError):
                return
            except Exception as error:
                if wanted.film is not None or wanted.images is self._images:
                    await self._tell(failure(error, wanted.request))

    async def _computed(self, wanted: _Wanted, loop: asyncio.AbstractEventLoop) -> bool:
        """Compute images, and tell whether the last one is complete; return at once where they are given up."""
        leaving = asyncio.ensure_future(wanted.given_up.wait())
        computing = loop.run_in_executor(self._drawing, self._compute, wanted, loop)
        computing.add_done_callback(lambda done: done.cancelled() or done.exception())  # nobody may be waiting
        try:
            either: list[asyncio.Future[Any]] = [computing, leaving]
            await asyncio.wait(either, return_when=asyncio.FIRST_COMPLETED)
        finally:
            leaving.cancel()
        if wanted.given_up.is_set():
            if wanted.film is None:
                raise Stopped
            return False
        try:
            return computing.result()
        except RuntimeError as error:
            raise ValueError(str(error)) from error  # of the computation, not of the connection

    def _compute(self, wanted: _Wanted, loop: asyncio.AbstractEventLoop) -> bool:
        """Compute images, in a thread for them, until others are wanted; keep those of a film."""
        stills, complete, film = self._stills_of(wanted), False, wanted.film
        with heeding(wanted.stop):
            for k, view in enumerate(wanted.views):
                if k < len(stills):
                    continue
                shown = b""
                for frame in wanted.images.frames(view, wanted.near, wanted.anchors):
                    if wanted.stop.requested:
                        return False
                    self._has_frame, complete = True, frame.complete
                    if frame.settled and not complete:
                        continue  # the complete one follows at once
                    facts, data = basin_image(view, frame)
                    if data == shown and not complete:
                        continue  # the same pixels as those of the preview
                    shown = data
                    if film is not None:
                        values = {name: view.params[name] for name in film.parameters}
                        facts["film"] = {"number": k + 1, "of": len(wanted.views), "values": values}
                        if frame.complete and len(stills) == k:
                            stills.append(Still(view, view.raster(frame.identity_image), facts["attractors"]))
                    loop.call_soon_threadsafe(self._offer, wanted, facts, data)
                    if self._wanted is not wanted:
                        return complete
                if not complete:
                    return False
        return complete

    def _stills_of(self, wanted: _Wanted) -> list[Still]:
        """Return the images of a film that have been computed already."""
        if wanted.film is None:
            return []
        kept, views = self._stills, repr(wanted.views)
        if kept is None or kept[:2] != (wanted.images, views):
            kept = self._stills = wanted.images, views, []
        return kept[2]

    async def _send_film(self, wanted: _Wanted, film: Film) -> None:
        """Send a film that is complete."""
        stills = self._stills_of(wanted)
        if len(stills) < len(wanted.views):
            raise FilmStopped(len(stills), len(wanted.views))
        facts, data = await asyncio.get_running_loop().run_in_executor(None, film.file, wanted.images.explored, stills)
        self._stills = None
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
            if self._broadcast is not None:
                self._broadcast.show({**facts, **wanted.said(facts.get("film", {}).get("number", 1) - 1)}, data)
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
