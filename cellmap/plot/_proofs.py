"""Figures of what is proved of basins, with matplotlib."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..basins.proofs.proof import Proof
from ..basins.proofs.regions import in_figures
from ._axes import axes_or_new, legend_below, plane_of, short_name, show_cells
from ._colours import label_colours
from ._draw import figure

_PALE = 0.25  # part of a colour that is left where its label is not proved


@figure
def proof(proof: Proof, *, ax: Axes | None = None, colours: Mapping[int, Any] | None = None) -> Axes:
    """Draw what is proved of basins in the colours of the labels, and the rest in pale ones.

    Parameters
    ----------
    proof : Proof
        Proof of basins on a grid with two axes of more than one cell.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    colours : mapping of int to colour, optional
        Colours of some labels; others keep the default ones.

    Returns
    -------
    matplotlib Axes
        The axes.  The legend has the lower bounds of the areas; points are those of the proved attractors.

    Raises
    ------
    ValueError
        For basins that are not on a grid with two axes.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins, plot
    >>> from cellmap.basins import prove
    >>> halves = discrete_map(lambda x, p: (x[0] / 2, x[1] / 3), {}, ("x", "y"))
    >>> plot.proof(prove(find_basins(halves, CellGrid((-1, -1), (1, 1), (8, 8))))).get_xlabel()
    '$x$'
    """
    basins = proof.basins
    grid = plane_of(basins)
    ax = axes_or_new(ax, (7.0, 5.5))
    palette = label_colours(basins.fractions, colours)
    cells = np.squeeze(proof.cells.in_window).T
    below = np.squeeze(basins.labels).T
    for axis, (n, m) in enumerate(zip(cells.shape, below.shape, strict=True)):
        below = np.repeat(below, n // m, axis=axis)
    image = np.empty((*cells.shape, 3))
    for label, colour in palette.items():
        image[below == label] = 1.0 - _PALE * (1.0 - np.array(colour))
        image[cells == label + 1] = colour
    show_cells(ax, image, grid, basins.coordinates)
    wide = [j for j, n in enumerate(grid.shape) if n > 1]
    for balls in proof.attractors.values():
        ax.plot(
            *balls.centres[:, wide].T,
            "o",
            markersize=4,
            color="white",
            markeredgecolor="black",
            scalex=False,
            scaley=False,
        )
    shown = [
        (palette[k], f"{short_name(basins.label_name(k), k, lines=2)}: {in_figures(area)} or more")
        for k, area in proof.areas.items()
    ]
    legend_below(ax, shown)
    ax.set_title(f"{basins.name}: {in_figures(100.0 * proof.share)} % proved")
    return ax
