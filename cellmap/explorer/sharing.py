"""Watchers on a network: they see the images of the explorer's page, and can change nothing."""

from __future__ import annotations

import asyncio
import contextlib
import time
import zlib
from collections.abc import Mapping
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from .protocol import encoded, packed

OFTEN = 0.25
"""Seconds between two images that are not complete: a network carries each to every watcher."""

MOST_HEARD = 64  # messages that a watcher may send, of which none is read
_PATIENCE = 20.0  # seconds for which a watcher may take to receive an image


class Broadcast:
    """The newest image of a page, for those who watch.

    Parameters
    ----------
    most : int
        Watchers at a time.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self.watchers = 0
        self._message: bytes = b""
        self._newest: tuple[Mapping[str, Any], bytes] | None = None
        self._changed = asyncio.Event()
        self._shown = -OFTEN

    def show(self, facts: Mapping[str, Any], data: bytes) -> None:
        """Take an image with all that is said of it; incomplete ones are left out while they are many."""
        now = time.monotonic()
        if not facts["complete"] and now - self._shown < OFTEN:
            return
        self._newest, self._message, self._shown = (facts, data), b"", now
        self._changed.set()
        self._changed = asyncio.Event()

    def _packed(self) -> bytes:
        """Return the newest image as a message, made once for all."""
        if not self._message and self._newest is not None:
            facts, data = self._newest
            self._message = packed({**facts, "type": "shown", "compressed": True}, zlib.compress(data, 1))
        return self._message

    async def watched(self, socket: WebSocket) -> None:
        """Serve a watcher until it is gone."""
        await socket.accept()
        if self.watchers >= self.most:
            await socket.close(1013, f"{self.most} watch already, which is the limit")
            return
        self.watchers += 1
        listening = asyncio.ensure_future(self._gone(socket))
        sending = asyncio.ensure_future(self._send(socket))
        try:
            await asyncio.wait([listening, sending], return_when=asyncio.FIRST_COMPLETED)
        finally:
            self.watchers -= 1
            for task in (listening, sending):
                task.cancel()
            await asyncio.gather(listening, sending, return_exceptions=True)
            with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                await socket.close(1008)

    async def _send(self, socket: WebSocket) -> None:
        await socket.send_text(encoded({"type": "welcome"}))
        while True:
            changed = self._changed
            if message := self._packed():
                await asyncio.wait_for(socket.send_bytes(message), _PATIENCE)
            await changed.wait()

    async def _gone(self, socket: WebSocket) -> None:
        """Return when a watcher has left, or talks."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            for _ in range(MOST_HEARD):
                if (await socket.receive())["type"] == "websocket.disconnect":
                    return
