"""Start and end of the explorer's server, in a thread of its own."""

from __future__ import annotations

import errno
import os
import secrets
import socket
import sys
import threading
import time
import webbrowser
from collections.abc import Sequence
from functools import partial
from types import TracebackType
from typing import Any, Self

from .._lib.checks import whole_number
from .._lib.memory import give_back_memory, share_heaps
from .._lib.signatures import checked
from .._lib.systems import open_files
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from ..maps.system import ForcedSystem
from .explored import Explored, ExploredScene, checked_gallery, explored_from
from .views import load_views

HERE = "127.0.0.1"
MOST_WATCHERS = 1000

_STARTING = 20.0  # seconds
_QUEUE = 2048  # connections that the system keeps until they are accepted
_OTHERS = 64  # open files that are no watchers, in the half of all that watchers may take
_GIVING_BACK = 30.0  # seconds between two returns of free memory, which take milliseconds


class Explorer:
    """A server of the explorer that is running; made by :func:`explore`.

    Attributes
    ----------
    address : str
        Address of the page, with a random token that nobody else knows.
    watch_address : str or None
        Address at which others on the network watch, with a token of its own; None where nobody may.
    """

    def __init__(
        self, server: Any, listening: Sequence[socket.socket], address: str, watch_address: str | None = None
    ) -> None:
        self.address, self.watch_address = address, watch_address
        self._server, self._listening = server, listening
        self._thread = threading.Thread(
            target=server.run, kwargs={"sockets": list(listening)}, name="explorer", daemon=True
        )

    def __repr__(self) -> str:
        return f"Explorer({self.address if self._thread.is_alive() else 'closed'})"

    def __str__(self) -> str:
        return self.address + (f"\nto watch: {self.watch_address}" if self.watch_address else "")

    def _repr_html_(self) -> str:
        """Return the page as a notebook on the same machine shows it."""
        return f'<iframe src="{self.address}" width="100%" height="900" allow="clipboard-write"></iframe>'

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.close()

    def start(self) -> None:
        """Begin to serve; return when the page can be opened."""
        self._thread.start()
        begin = time.monotonic()
        while not self._server.started:
            if not self._thread.is_alive() or time.monotonic() - begin > _STARTING:
                raise RuntimeError(f"the explorer did not start at {self.address}: its log says why")
            time.sleep(0.01)
        for end in self._listening:
            end.listen(_QUEUE)  # the loop has made it as short as what it accepts in one go
        threading.Thread(target=self._give_back, name="memory", daemon=True).start()

    def _give_back(self) -> None:
        while self._thread.is_alive():
            self._thread.join(_GIVING_BACK)
            give_back_memory()

    def close(self) -> None:
        """End the server and all connections."""
        self._server.should_exit = self._server.force_exit = True
        if self._thread.is_alive():
            self._thread.join(10.0)

    def wait(self) -> None:
        """Wait until the server ends, or the program is interrupted."""
        try:
            while self._thread.is_alive():
                self._thread.join(3600.0)
        except KeyboardInterrupt:
            self.close()


def serve(
    gallery: Sequence[Explored | ExploredScene],
    port: int = 0,
    open_page: bool = True,
    views: str | os.PathLike[str] | None = None,
    watchers: int = 0,
    host: str | None = None,
) -> Explorer:
    """Return a running server of some systems, bound to this machine alone, and for watchers to its network.

    Raises
    ------
    ModuleNotFoundError
        Without the packages of the extra ``explorer``.
    OSError
        If the port is taken.
    """
    try:
        import uvicorn

        from .connections import ACCEPTED, Connection
        from .server import MOST_SESSIONS, Shared, application
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(f"{error}: pip install 'cellmap-dynamics[explorer]'") from error
    share_heaps()
    systems = {e.name: e for e in checked_gallery(gallery)}
    prepared = [] if views is None else load_views(views, systems)
    most = whole_number("watchers", watchers, at_most=MOST_WATCHERS)
    if most > (room := max(0, open_files() // 2 - _OTHERS)):
        raise ValueError(
            f"watchers={most}: this process may open {open_files():,} files, which are enough for {room:,}; raise its "
            f"limit (ulimit -n {2 * (most + _OTHERS)}), or give a smaller number"
        )
    shared = Shared(host or _host_in_network(), secrets.token_urlsafe(9), most) if most else None
    listening = [_listening(HERE, whole_number("port", port, at_most=65535))]
    if shared is not None:
        try:
            listening.append(_listening(shared.host, listening[0].getsockname()[1] if shared.host != HERE else 0))
        except OSError:
            listening[0].close()
            raise
    token = secrets.token_urlsafe(24)
    pages = {end.getsockname()[1]: number for end, number in zip(listening, (MOST_SESSIONS, most), strict=False)}
    config = uvicorn.Config(
        application(systems, token, prepared, shared),
        loop="asyncio",  # whose bound on what is accepted in one go is its `backlog`
        backlog=ACCEPTED,
        http=partial(Connection, pages),  # type: ignore[arg-type]
        ws="websockets-sansio",
        ws_per_message_deflate=False,
        ws_max_size=2**17,
        ws_max_queue=8,
        log_level="warning",
        access_log=False,
        server_header=False,
        lifespan="off",
    )
    places = [f"http://{end.getsockname()[0]}:{end.getsockname()[1]}" for end in listening]
    watch = None if shared is None else f"{places[1]}/{shared.token}/"
    explorer = Explorer(uvicorn.Server(config), listening, f"{places[0]}/{token}/", watch)
    explorer.start()
    if open_page:
        webbrowser.open(explorer.address)
    return explorer


def _host_in_network() -> str:
    """Return the address of this machine in its network, which it would use towards a place elsewhere."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as towards:
        try:
            towards.connect(("192.0.2.1", 9))  # of a range for documents; nothing is sent
        except OSError as error:
            raise OSError(error.errno, "this machine is in no network: connect it, or name its address") from None
        return str(towards.getsockname()[0])


def _listening(host: str, port: int) -> socket.socket:
    """Return a socket at a port, also just after another server of it has ended, whose pages are open."""
    listening = socket.socket()
    if os.name == "posix":  # elsewhere the option takes the port from a server that is running
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
        listening.listen(_QUEUE)
    except OSError as error:
        listening.close()
        if error.errno == errno.EADDRNOTAVAIL:
            raise OSError(error.errno, f"host={host!r}: this machine has no such address") from None
        taken = "is taken by another program: end that one, or give another port or none"
        raise OSError(error.errno, f"port={port} {taken}") from None
    return listening


@checked
def explore(
    system: ForcedSystem | PointMap,
    region: CellGrid | None = None,
    nodes: int = 0,
    *,
    port: int = 0,
    open_page: bool = True,
    wait: bool | None = None,
    views: str | os.PathLike[str] | None = None,
    watchers: int = 0,
) -> Explorer:
    """Show the basins of a system in the browser, where parameters, phase and window can be changed.

    The server listens on this machine alone, and its address has a random token.  With `watchers`, others on the
    network see the same images at a second address, and can change nothing.

    Parameters
    ----------
    system : ForcedSystem or PointMap
        The system, or a discrete map.
    region : CellGrid, optional
        First window, over all coordinates, and number of initial conditions along each.  By default angles have one
        period, and other coordinates reach from -2 to 2.
    nodes : int, optional
        Cells of the interpolation grid along each axis; by default the exact map is used.
    port : int, optional
        Port, by default a free one.
    open_page : bool, optional
        Open the page in the browser.
    wait : bool, optional
        Return when the server ends, as a script needs it.  By default in a script, but not in an interactive session.
    views : path, optional
        File of prepared views, see the page on the explorer; the system's name there is ``given``.
    watchers : int, optional
        How many others may watch at a time, by default nobody.

    Returns
    -------
    Explorer
        The server, with its `address` and its `watch_address`; ``close()`` ends it.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, or a map that was built without parameter dependence.
    ModuleNotFoundError
        Without the packages of the extra ``explorer``.
    OSError
        If the port is taken.
    """
    explorer = serve([explored_from(system, region, nodes)], port, open_page, views, watchers)
    if wait if wait is not None else not (hasattr(sys, "ps1") or "IPython" in sys.modules):
        print(explorer, flush=True)
        explorer.wait()
    return explorer
