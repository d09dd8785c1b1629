"""Start and end of the explorer's server, in a thread of its own."""

from __future__ import annotations

import os
import secrets
import socket
import sys
import threading
import time
import webbrowser
from collections.abc import Sequence
from types import TracebackType
from typing import Any, Self

from .._lib.checks import whole_number
from .._lib.signatures import checked
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from ..maps.system import ForcedSystem
from .explored import Explored, ExploredScene, checked_gallery, explored_from

_STARTING = 20.0  # seconds


class Explorer:
    """A server of the explorer that is running; made by :func:`explore`.

    Attributes
    ----------
    address : str
        Address of the page, with a random token that nobody else knows.
    """

    def __init__(self, server: Any, listening: socket.socket, address: str) -> None:
        self.address = address
        self._server = server
        self._thread = threading.Thread(
            target=server.run, kwargs={"sockets": [listening]}, name="explorer", daemon=True
        )

    def __repr__(self) -> str:
        return f"Explorer({self.address if self._thread.is_alive() else 'closed'})"

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


def serve(gallery: Sequence[Explored | ExploredScene], port: int = 0, open_page: bool = True) -> Explorer:
    """Return a running server of some systems, bound to this machine alone.

    Raises
    ------
    ModuleNotFoundError
        Without the packages of the extra ``explorer``.
    OSError
        If the port is taken.
    """
    try:
        import uvicorn

        from .server import application
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(f"{error}: pip install 'cellmap-dynamics[explorer]'") from error
    systems = {e.name: e for e in checked_gallery(gallery)}
    listening = _listening(whole_number("port", port, at_most=65535))
    token = secrets.token_urlsafe(24)
    config = uvicorn.Config(
        application(systems, token),
        ws="websockets-sansio",
        ws_per_message_deflate=False,
        ws_max_size=2**17,
        ws_max_queue=8,
        log_level="warning",
        access_log=False,
        server_header=False,
        lifespan="off",
    )
    explorer = Explorer(uvicorn.Server(config), listening, f"http://127.0.0.1:{listening.getsockname()[1]}/{token}/")
    explorer.start()
    if open_page:
        webbrowser.open(explorer.address)
    return explorer


def _listening(port: int) -> socket.socket:
    """Return a socket at a port, also just after another server of it has ended, whose pages are open."""
    listening = socket.socket()
    if os.name == "posix":  # elsewhere the option takes the port from a server that is running
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind(("127.0.0.1", port))
        listening.listen(2048)
    except OSError as error:
        listening.close()
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
) -> Explorer:
    """Show the basins of a system in the browser, where parameters, phase and window can be changed.

    The server listens on this machine alone, and its address has a random token.

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

    Returns
    -------
    Explorer
        The server, with its `address`; ``close()`` ends it.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, or a map that was built without parameter dependence.
    ModuleNotFoundError
        Without the packages of the extra ``explorer``.
    OSError
        If the port is taken.
    """
    explorer = serve([explored_from(system, region, nodes)], port, open_page)
    if wait if wait is not None else not (hasattr(sys, "ps1") or "IPython" in sys.modules):
        print(explorer.address, flush=True)
        explorer.wait()
    return explorer
