"""The web application: the page and one connection for each tab, to nobody but the page itself, and to watchers."""

from __future__ import annotations

import mimetypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Mount, Route, Router, WebSocketRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from .explored import Explored, ExploredScene
from .one_file import PAGE
from .session import Session
from .sharing import Broadcast

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


class _ThisMachine:
    """Lets connections through that came to this machine's own address alone."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        server = scope.get("server") or ("", 0)
        own = server[0] == HOSTS[0]
        await (self._app if own else _unknown)(scope, receive, send)


async def _unknown(scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await WebSocket(scope, receive, send).close(1008)
    else:
        await Response("not found", 404, media_type="text/plain")(scope, receive, send)


@dataclass(frozen=True)
class Shared:
    """Where those who watch find the page: the address of this machine in a network, a token, and how many may."""

    host: str
    token: str
    most: int


def application(
    gallery: Mapping[str, Explored | ExploredScene],
    token: str,
    views: Sequence[Mapping[str, Any]] = (),
    shared: Shared | None = None,
) -> Starlette:
    """Return the application that serves some systems at addresses that begin with a token.

    Every address without it is unknown.  A connection is accepted from a page of this server alone, by its `Origin`.
    Where it is shared, another token leads to a page that shows the same images, and reads nothing.
    """
    sessions: set[Session] = set()
    hosts = HOSTS if shared is None else (*HOSTS, shared.host)
    broadcast = None if shared is None else Broadcast(shared.most)

    async def refused(socket: WebSocket) -> bool:
        if same_origin(socket.headers.get("origin"), socket.headers.get("host"), hosts):
            return False
        await socket.close(1008, "origin: open the address that the explorer has printed")
        return True

    async def connected(socket: WebSocket) -> None:
        if await refused(socket):
            return
        await socket.accept()
        if len(sessions) >= MOST_SESSIONS:
            await socket.close(1013, f"{MOST_SESSIONS} pages are open: close one of them")
            return
        session = Session(socket, gallery, views, broadcast)
        sessions.add(session)
        try:
            await session.run()
        finally:
            sessions.discard(session)

    async def watched(socket: WebSocket) -> None:
        assert broadcast is not None
        if not await refused(socket):
            await broadcast.watched(socket)

    files = {file.name: file.read_bytes() for file in PAGE.iterdir()}

    def file_of(request: Request) -> Response:
        """Return a file of the page from memory, so that none is open when the server ends."""
        name = request.path_params["name"] or "index.html"
        if name not in files:
            raise HTTPException(404)
        return Response(files[name], media_type=mimetypes.guess_type(name)[0])

    pages = Route("/{name:path}", file_of)
    own = Router([WebSocketRoute("/connection", connected), pages])
    routes: list[BaseRoute] = [Mount(f"/{token}", _ThisMachine(own))]
    if shared is not None:
        page = Route("/", lambda request: Response(files["watch.html"], media_type="text/html"))
        routes.append(Mount(f"/{shared.token}", Router([page, WebSocketRoute("/connection", watched), pages])))
    return Starlette(
        routes=routes,
        middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=list(hosts)), Middleware(_Headers)],
        exception_handlers={404: lambda request, error: Response("not found", 404, media_type="text/plain")},
    )


def same_origin(origin: str | None, host: str | None, hosts: Sequence[str] = HOSTS) -> bool:
    """Tell whether a connection is from a page of the server at `host`, which is one of this machine's names.

    Examples
    --------
    >>> same_origin("http://127.0.0.1:8000", "127.0.0.1:8000"), same_origin("http://example.org", "127.0.0.1:8000")
    (True, False)
    """
    return host is not None and host.split(":")[0] in hosts and origin == f"http://{host}"
