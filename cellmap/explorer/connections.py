"""Connections that have not become a page: few at a time, and none for long, so that strangers keep nobody out."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

from .._lib.systems import open_files

ACCEPTED = 4
"""Connections that are accepted in one go: the loop comes to close others before it accepts more."""

_PATIENCE = 10.0  # seconds for the head of a request


def most_guests() -> int:
    """Return how many connections to an address may not have become a page: two addresses take a quarter of all."""
    return open_files() // 8


class Connection(H11Protocol):
    """A connection of a browser's, or of somebody else's; until it becomes that of a page it is a guest.

    Where there are too many guests at an address, the oldest one that is not being answered goes, and the newest one is
    served: an answer takes milliseconds.  `pages` says how many pages there may be at each port.
    """

    def __init__(self, pages: Mapping[int, int], **given: Any) -> None:
        super().__init__(**given)
        self._pages = pages
        self._began = self.loop.time()
        self._end: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Wait for a request, and close another connection where they are too many."""
        super().connection_made(transport)
        self._wait()
        guests = [c for c in self.connections if isinstance(c, Connection) and c.server == self.server]
        if len(guests) > most_guests():
            oldest = min((c for c in guests if not c._is_answered), key=lambda c: c._began, default=self)
            self.connections.discard(oldest)
            oldest.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait for nothing any more."""
        self._wait_no_more()
        super().connection_lost(exc)

    def handle_events(self) -> None:
        """Take the events that have come; a request, once complete, may take any time to be answered."""
        super().handle_events()
        if self._is_answered:
            self._wait_no_more()

    def handle_websocket_upgrade(self, event: Any) -> None:
        """Let the connection become that of a page, unless there are many more of these than there may be."""
        self._wait_no_more()
        others = [c for c in self.connections if not isinstance(c, Connection)]
        pages = sum(getattr(c, "server", None) == self.server for c in others)
        if pages < self._pages[self.transport.get_extra_info("sockname")[1]] + most_guests():
            super().handle_websocket_upgrade(event)
        else:
            self.transport.abort()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        self._wait()

    @property
    def _is_answered(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _wait(self) -> None:
        self._wait_no_more()
        self._end = self.loop.call_later(_PATIENCE, self.transport.abort)

    def _wait_no_more(self) -> None:
        if self._end is not None:
            self._end.cancel()
            self._end = None
