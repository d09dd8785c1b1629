"""Figures of attractors and basins against a parameter, with matplotlib."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch

from .._lib.arrays import Floats
from ..basins.continuation_record import BasinContinuation
from ..orbits.attractor import Kind
from ._axes import column_of, label_axis
from ._colours import CODE_COLOURS, Colour, chosen_colours, colour_of
from ._draw import figure


@figure
def basin_continuation(
    continuation: BasinContinuation,
    *,
    coordinate: int | str = 0,
    ax: Axes | None = None,
    colours: Mapping[int, Any] | None = None,
    legend: bool = True,
) -> tuple[Axes, ...]:
    """Draw the stacked fractions of basins against a parameter, and the attractors below.

    Parameters
    ----------
    continuation : BasinContinuation
        Result of :func:`continue_basins`.
    coordinate : int or str, optional
        Number or name of the coordinate of the attractors that is drawn.
    ax : matplotlib Axes, optional
        Axes for the fractions, without attractors; by default a new figure with both.
    colours : mapping of int to colour, optional
        Colours of some labels, instead of the default ones, which are those of :func:`basins`.
    legend : bool, optional
        Name each label.

    Returns
    -------
    tuple of matplotlib Axes
        The axes of the fractions and, in a new figure, those of the attractors.

    Raises
    ------
    TypeError, ValueError
        For something that is not a continuation or has no values, or a coordinate that it does not have.

    Examples
    --------
    >>> from math import tanh
    >>> from cellmap import CellGrid, discrete_map, plot
    >>> from cellmap.basins import continue_basins
    >>> wells = discrete_map(lambda x, p: (tanh(p.a * x[0]),), {"a": 1.0}, ("x",), "wells")
    >>> sweep = continue_basins(wells, "a", [0.5, 0.9, 1.5], CellGrid((-1,), (1,), (100,)))
    >>> upper, lower = plot.basin_continuation(sweep)
    >>> upper.get_ylabel(), lower.get_ylabel()
    ('fraction of initial conditions', 'x')
    """
    if not len(continuation.values):
        raise ValueError(f"continuation={continuation!r} has no values: there is nothing to draw")
    column = column_of(coordinate, continuation.coordinates)
    palette = _palette(continuation, colours)
    drawn: tuple[Axes, ...] = (ax,) if ax is not None else ()
    if ax is None:
        _, panels = plt.subplots(2, sharex=True, figsize=(7.0, 6.5), layout="constrained")
        drawn = (panels[0], panels[1])
        _draw_attractors(panels[1], continuation, column, palette)
    upper = drawn[0]
    upper.stackplot(continuation.values, continuation.fractions.T, colors=list(palette.values()), linewidth=0.0)
    upper.set_ylim(0.0, 1.0)
    upper.set_ylabel("fraction of initial conditions")
    upper.margins(x=0.0)
    upper.set_title(continuation.system)
    drawn[-1].set_xlabel(continuation.parameter)
    if legend:
        names = [continuation.label_name(label) for label in palette]
        patches = [Patch(facecolor=c, edgecolor="0.3", label=n) for n, c in zip(names, palette.values(), strict=True)]
        drawn[-1].legend(
            handles=patches,
            loc="upper center",
            bbox_to_anchor=(0.5, -0.14),
            ncols=2,
            fontsize="small",
            frameon=False,
        )
    return drawn


def _palette(continuation: BasinContinuation, colours: Mapping[int, Any] | None) -> dict[int, Colour]:
    """Return the colour of each label."""
    given = chosen_colours(colours)
    return {k: to_rgb(given.get(k, CODE_COLOURS[k] if k < 0 else colour_of(k))) for k in continuation.labels}


def _draw_attractors(ax: Axes, continuation: BasinContinuation, column: int, palette: Mapping[int, Colour]) -> None:
    """Draw a coordinate of the points of attractors in the colours of their basins; chaotic ones as a cloud."""
    drawn: dict[tuple[int, str], list[tuple[Floats, Floats]]] = {}
    for value, found in zip(continuation.values, continuation.attractors, strict=True):
        for label, attractor in found.items():
            places = attractor.points[:, column]
            marker = "," if attractor.kind in (Kind.CHAOTIC, Kind.QUASIPERIODIC) else "."
            drawn.setdefault((label, marker), []).append((np.full(len(places), value), places))
    heights = [places for pieces in drawn.values() for _, places in pieces]
    for (label, marker), pieces in drawn.items():
        across, up = (np.concatenate(part) for part in zip(*pieces, strict=True))
        ax.plot(across, up, marker, color=palette[label], markersize=4)
    span = float(np.ptp(np.concatenate(heights))) if heights else 0.0
    label_axis(ax.yaxis, continuation.coordinates[column], span)
