"""The web application: the page and one connection for each tab, to nobody but the page itself."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.responses import Response
from starlette.routing import Mount, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from .explored import Explored, ExploredScene
from .session import Session

PAGE = Path(__file__).parent / "page"
HOSTS = ("127.0.0.1", "localhost")
MOST_SESSIONS = 16

_HEADERS = {
    b"content-security-policy": b"default-src 'self'; img-src 'self' blob: data:; style-src 'self'; object-src 'none'; "
    b"base-uri 'none'; form-action 'none'; frame-ancestors http://127.0.0.1:* http://localhost:*",
    b"referrer-policy": b"no-referrer",
    b"x-content-type-options": b"nosniff",
    b"cache-control": b"no-store",
    b"cross-origin-opener-policy": b"same-origin",
    b"cross-origin-resource-policy": b"same-site",
}


class _Headers:
    """Adds headers to every answer that keep other pages, frames and caches out."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def sent(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *_HEADERS.items()]
            await send(message)

        await self._app(scope, receive, sent)


def application(gallery: Mapping[str, Explored | ExploredScene], token: str) -> Starlette:
    """Return the application that serves some systems at addresses that begin with a token.

    Every address without it is unknown.  A connection is accepted from a page of this server alone, by its `Origin`.
    """
    sessions: set[Session] = set()

    async def connected(socket: WebSocket) -> None:
        if not same_origin(socket.headers.get("origin"), socket.headers.get("host")):
            await socket.close(1008, "origin: open the address that the explorer has printed")
            return
        await socket.accept()
        if len(sessions) >= MOST_SESSIONS:
            await socket.close(1013, f"{MOST_SESSIONS} pages are open: close one of them")
            return
        session = Session(socket, gallery)
        sessions.add(session)
        try:
            await session.run()
        finally:
            sessions.discard(session)

    inside = [WebSocketRoute("/connection", connected), Mount("/", StaticFiles(directory=PAGE, html=True))]
    return Starlette(
        routes=[Mount(f"/{token}", routes=inside)],
        middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=list(HOSTS)), Middleware(_Headers)],
        exception_handlers={404: lambda request, error: Response("not found", 404, media_type="text/plain")},
    )


def same_origin(origin: str | None, host: str | None) -> bool:
    """Tell whether a connection is from a page of the server at `host`, which is on this machine.

    Examples
    --------
    >>> same_origin("http://127.0.0.1:8000", "127.0.0.1:8000"), same_origin("http://example.org", "127.0.0.1:8000")
    (True, False)
    """
    return host is not None and host.split(":")[0] in HOSTS and origin == f"http://{host}"
