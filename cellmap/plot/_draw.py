"""The figure of a result, whatever it is of."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Callable
from difflib import SequenceMatcher
from typing import Any, TypeVar, get_args, get_type_hints

from matplotlib.axes import Axes

from .._lib.checks import shown
from .._lib.fit import Fit
from .._lib.signatures import checked

F = TypeVar("F", bound=Callable[..., Any])

FIGURES: dict[type, Callable[..., Any]] = {}
"""The figure of each record, of those modules that are imported."""

_ROOM = __name__.rpartition(".")[0]


def figure(function: F) -> F:
    """Check the arguments of a figure, and take it for the records that its first argument may be.

    A second figure of a record is :func:`checked` only: it is drawn by its name.
    """
    held = checked(function)
    hint = get_type_hints(function)[next(iter(inspect.signature(function).parameters))]
    FIGURES.update({kind: held for kind in (hint, *get_args(hint)) if isinstance(kind, type) and kind is not Any})
    return held


def draw(result: Any, *, ax: Axes | None = None, **options: Any) -> Axes | tuple[Axes, ...]:
    """Draw a result by the function of `cellmap.plot` for its type.

    Parameters
    ----------
    result : record of cellmap
        Basins, Branch, BifurcationDiagram, StabilityMap, Trajectory, ...: anything for which there is a figure.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    **options
        Arguments of that function.  A Ball and a FatalShock need `basins`.

    Returns
    -------
    matplotlib Axes, or tuple of them
        What that function returns: its axes, or those of all panels where it draws several.

    Raises
    ------
    TypeError
        For anything that has no figure; the message lists what has one.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins, plot
    >>> halves = discrete_map(lambda x, p: (x[0] - 0.1 * x[0] ** 3, 0.5 * x[1]), {}, ("x", "y"))
    >>> plot.draw(find_basins(halves, CellGrid((-1, -1), (1, 1), (8, 8)))).get_xlabel()
    '$x$'
    """
    room = importlib.import_module(_ROOM)
    like = re.sub(r"(?<!^)(?=[A-Z])", "_", type(result).__name__).lower()
    for name in sorted(room.__all__, key=lambda name: SequenceMatcher(None, like, name).ratio(), reverse=True):
        if type(result) in FIGURES:
            break
        getattr(room, name)  # a figure is known once its module is imported, that of a like name most probably first
    carried = [] if isinstance(result, type) or not isinstance(getattr(result, "fit", None), Fit) else [Fit]
    for kind in (*type(result).__mro__, *carried):
        if kind in FIGURES:
            needed = [p.name for p in inspect.signature(FIGURES[kind]).parameters.values() if p.default is p.empty]
            if "basins" in needed[1:] and "basins" not in options:
                raise TypeError(f"basins is missing: a {kind.__name__} is drawn on basins, so give them as basins=")
            drawn: Axes | tuple[Axes, ...] = FIGURES[kind](result, ax=ax, **options)
            return drawn
    several = isinstance(result, list | tuple) and bool(result) and type(result[0]) in FIGURES
    what = "its entries, each alone" if several else f"one of {', '.join(sorted(kind.__name__ for kind in FIGURES))}"
    raise TypeError(f"result={shown(result)}: there is no figure of it; give {what}, or what has a fit")
