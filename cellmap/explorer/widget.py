"""The explorer as a widget of notebooks, whose messages go through the notebook's own connection."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .._lib.signatures import checked
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from ..maps.system import ForcedSystem
from .explored import explored_from


@checked
def explorer_widget(
    system: ForcedSystem | PointMap, region: CellGrid | None = None, nodes: int = 0, height: int = 900
) -> Any:
    """Return the explorer of a system as a widget for notebooks.

    It is the page of :func:`explore` without a server: messages go through the connection that the notebook has to its
    kernel, so that the kernel may run on another machine.

    Parameters
    ----------
    system, region, nodes
        As in :func:`explore`.
    height : int, optional
        Height (pixels).

    Returns
    -------
    anywidget.AnyWidget
        The widget; ``close()`` ends its sessions.

    Raises
    ------
    TypeError, ValueError
        As :func:`explore`.
    ModuleNotFoundError
        Without the packages of the extra ``notebook``.
    """
    explored = explored_from(system, region, nodes)
    try:
        import anywidget
        import traitlets

        from .channels import Channels
        from .one_file import page_of_one_file
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(f"{error}: pip install 'cellmap-dynamics[notebook]'") from error

    class ExplorerWidget(anywidget.AnyWidget):  # type: ignore[misc] # the checker passes over optional packages
        """A page and its sessions."""

        _esm = Path(__file__).parent / "page" / "widget.mjs"
        page = traitlets.Unicode().tag(sync=True)
        height = traitlets.Int().tag(sync=True)

        def __init__(self) -> None:
            super().__init__(page=page_of_one_file(), height=height)
            self._channels = Channels({explored.name: explored}, lambda message, data: self.send(message, list(data)))
            self.on_msg(lambda _, message, buffers: self._channels.receive(message))

        def close(self) -> None:
            """End the sessions and remove the widget."""
            self._channels.close()
            super().close()

    return ExplorerWidget()
