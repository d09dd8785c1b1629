"""Pages without a web server: a host, such as a notebook, carries the messages between them and their sessions."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from starlette.websockets import WebSocketDisconnect

from .explored import Explored, ExploredScene
from .server import MOST_SESSIONS
from .session import Session

Send = Callable[[dict[str, Any], Sequence[bytes]], None]
"""Carries a message to a page: an object, and the bytes of those that have some."""


class _Socket:
    """Connection of a session, over messages of the host."""

    def __init__(self, page: str, send: Send) -> None:
        self.coming: asyncio.Queue[str | None] = asyncio.Queue()
        self._page, self._send = page, send

    async def receive(self) -> dict[str, Any]:
        text = await self.coming.get()
        return {"type": "websocket.disconnect"} if text is None else {"type": "websocket.receive", "text": text}

    async def send_text(self, text: str) -> None:
        self._send({"page": self._page, "text": text}, ())

    async def send_bytes(self, data: bytes) -> None:
        self._send({"page": self._page}, (data,))

    async def close(self, code: int = 1000, reason: str = "") -> None:
        self._send({"page": self._page, "closed": reason}, ())
        raise WebSocketDisconnect(code, reason)


class Channels:
    """Sessions of the pages of one host, in a thread of their own.

    Parameters
    ----------
    gallery : mapping of str to Explored or ExploredScene
        Systems by name.
    send : callable
        Carries a message to the pages; called from the thread of the sessions.
    """

    def __init__(self, gallery: Mapping[str, Explored | ExploredScene], send: Send) -> None:
        self._gallery, self._send = gallery, send
        self._pages: dict[str, _Socket] = {}
        self._running: set[asyncio.Task[None]] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="explorer", daemon=True)
        self._thread.start()

    def receive(self, message: Any) -> None:
        """Take a message from a page: ``page``, its name, with ``opened``, ``closed`` or a ``text``."""
        if isinstance(message, Mapping) and isinstance(message.get("page"), str):
            self._loop.call_soon_threadsafe(self._take, dict(message))

    def close(self) -> None:
        """End all sessions and the thread."""
        if self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._end(), self._loop).result(10.0)
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(10.0)
            self._loop.close()

    def _take(self, message: dict[str, Any]) -> None:
        page = message["page"]
        if message.get("opened"):
            self._open(page)
        elif (socket := self._pages.get(page)) is not None:
            text = message.get("text")
            if not isinstance(text, str):
                del self._pages[page]
            socket.coming.put_nowait(text if isinstance(text, str) else None)

    def _open(self, page: str) -> None:
        if page in self._pages:
            return
        if len(self._pages) >= MOST_SESSIONS:
            self._send({"page": page, "closed": f"{MOST_SESSIONS} pages are open: close one of them"}, ())
            return
        socket = self._pages[page] = _Socket(page, self._send)
        session: Any = socket  # of a web socket it has what a session uses
        task = self._loop.create_task(Session(session, self._gallery).run())
        self._running.add(task)

        def ended(done: asyncio.Task[None]) -> None:
            self._running.discard(done)
            if self._pages.get(page) is socket:
                del self._pages[page]

        task.add_done_callback(ended)

    async def _end(self) -> None:
        for socket in self._pages.values():
            socket.coming.put_nowait(None)
        await asyncio.gather(*self._running, return_exceptions=True)
