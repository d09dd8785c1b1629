"""Figures of cell mappings: groups and steps, absorption probabilities, invariant measures, with matplotlib."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize, to_rgb

from .._lib.arrays import Floats
from .._lib.checks import whole_number
from .._lib.signatures import checked
from ..maps.coordinates import Coordinate
from ..maps.grid import CellGrid
from ..sets.cell_chain import CellChain
from ..sets.simple_cells import CellMapping
from ._axes import axes_or_new, colour_bar, label_axis, show_cells
from ._colours import CODE_COLOURS, colour_of
from ._draw import figure

_PALEST = 0.75  # fraction of white in the colour of the cells that are the last to reach their group


@figure
def cell_mapping(mapping: CellMapping, *, ax: Axes | None = None, show_steps: bool = False) -> Axes:
    """Draw the groups of a simple cell mapping.

    Parameters
    ----------
    mapping : CellMapping
        Result of :func:`simple_cell_mapping`, on a grid with two axes of more than one cell.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    show_steps : bool, optional
        Draw the number of steps to a group, in steps of the map, instead of the groups.

    Returns
    -------
    matplotlib Axes
        The axes.  Each group has its colour, paler for cells with many steps to it; periodic cells are black, and cells
        that escape are grey.

    Raises
    ------
    ValueError
        For a grid without two axes of more than one cell.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, plot
    >>> from cellmap.sets import simple_cell_mapping
    >>> halves = discrete_map(lambda x, p: (x[0] / 2, x[1] / 3), {}, ("x", "y"))
    >>> plot.cell_mapping(simple_cell_mapping(halves, CellGrid((-1, -1), (1, 1), (9, 9)))).get_xlabel()
    '$x$'
    """
    coordinates = mapping.point_map.coordinates
    groups = mapping.groups.ravel()
    periodic = mapping.periodic_cells
    title = f"{mapping.point_map.name}, {len(mapping.group_periods)} groups"
    if show_steps:
        taken = np.where(groups >= 0, mapping.steps.ravel() * mapping.periods, np.nan)
        return _image(ax, mapping.grid, coordinates, taken, title, "steps to a group")
    codes = [to_rgb(CODE_COLOURS[label]) for label in (-2, -1)]
    palette = np.array([*(colour_of(k) for k in range(len(mapping.group_periods))), *codes])
    late = mapping.steps.ravel() / max(int(mapping.steps.max()), 1) * (groups >= 0)
    image = palette[groups]
    image += (1.0 - image) * (_PALEST * late)[:, None]
    image[periodic] = 0.0
    return _image(ax, mapping.grid, coordinates, image, title)


@figure
def absorption(chain: CellChain, *, ax: Axes | None = None, group: int | None = None) -> Axes:
    """Draw the absorption probability of cells in a class, or the number of classes that can be reached.

    Parameters
    ----------
    chain : CellChain
        Result of :func:`generalized_cell_mapping`, on a grid with one axis or two of more than one cell.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    group : int, optional
        Number of a closed class, -1 for the outside or -2 for divergence; by default the number of classes that can be
        reached is drawn, which is more than 1 along basin boundaries.

    Returns
    -------
    matplotlib Axes
        The axes.

    Raises
    ------
    ValueError
        For a class that the chain does not have.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, plot
    >>> from cellmap.sets import generalized_cell_mapping
    >>> newton = discrete_map(lambda x, p: (x[0] / 2 + 1 / (2 * x[0]),), {}, ("x",))
    >>> plot.absorption(generalized_cell_mapping(newton, CellGrid((-3,), (3,), (60,))), group=1).get_ylabel()
    'probability of absorption in class 1'
    """
    coordinates = chain.point_map.coordinates
    if group is None:
        values = chain.domiciles.astype(float)
        return _image(ax, chain.grid, coordinates, values, chain.point_map.name, "number of reachable classes")
    group = whole_number("group", group, at_least=-2, at_most=len(chain.closed) - 1)
    name = {-1: "of escape", -2: "of divergence"}.get(group, f"of absorption in class {group}")
    values, scale = chain.absorption[..., group], Normalize(0.0, 1.0)
    return _image(ax, chain.grid, coordinates, values, chain.point_map.name, f"probability {name}", norm=scale)


@checked
def invariant_measure(chain: CellChain, *, ax: Axes | None = None, group: int = 0) -> Axes:
    """Draw the invariant density of a closed class.

    Parameters
    ----------
    chain : CellChain
        Result of :func:`generalized_cell_mapping`, on a grid with one axis or two of more than one cell.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    group : int, optional
        Number of the closed class.

    Returns
    -------
    matplotlib Axes
        The axes; over two axes its scale is logarithmic, and cells outside the class are white.

    Raises
    ------
    ValueError
        For a class that the chain does not have.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, plot
    >>> from cellmap.sets import generalized_cell_mapping
    >>> logistic = discrete_map(lambda x, p: (4 * x[0] * (1 - x[0]),), {}, ("x",))
    >>> plot.invariant_measure(generalized_cell_mapping(logistic, CellGrid((0,), (1.01,), (101,)))).get_ylabel()
    'invariant density'
    """
    density = chain.density(group)
    flat = sum(n > 1 for n in chain.grid.shape) == 2
    name = chain.point_map.name
    values = np.where(density > 0.0, density, np.nan) if flat else density
    norm = LogNorm() if flat else None
    return _image(ax, chain.grid, chain.point_map.coordinates, values, name, "invariant density", norm=norm)


def _image(
    ax: Axes | None,
    grid: CellGrid,
    coordinates: Sequence[Coordinate],
    values: Floats,
    title: str,
    measure: str | None = None,
    norm: Normalize | None = None,
) -> Axes:
    """Draw colours of cells, or with a `measure` their values: over two axes in colours, over one as a line."""
    wide = [j for j, n in enumerate(grid.shape) if n > 1]
    if len(wide) != 2 and (len(wide) != 1 or measure is None):
        raise ValueError(f"{title} on {grid.shape}: a figure needs a grid with two axes of more than one cell")
    ax = axes_or_new(ax, (7.0, 5.0))
    ax.set_title(title)
    if len(wide) == 1:
        assert measure is not None
        label_axis(ax.xaxis, coordinates[wide[0]], grid.upper[wide[0]] - grid.lower[wide[0]])
        ax.plot(grid.axis(wide[0]), values.ravel())
        ax.set_ylabel(measure)
        return ax
    image = values.reshape(*[grid.shape[j] for j in wide], -1).swapaxes(0, 1)
    drawn = show_cells(ax, image if measure is None else image[..., 0], grid, coordinates, norm=norm, cmap="magma")
    if measure is not None:
        colour_bar(ax, drawn, measure)
    return ax
