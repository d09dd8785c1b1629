"""Figures of sets of boxes, Morse graphs and transfer operators, with matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from numpy.typing import ArrayLike

from .._lib.arrays import Floats
from .._lib.checks import finite_number, listed, real_array, whole_number
from .._lib.signatures import checked
from ..maps.coordinates import Coordinate, as_coordinates
from ..maps.grid import CellGrid
from ..sets.box_set import BoxSet
from ..sets.morse_graphs import MorseGraph
from ..sets.transfer_operators import TransferOperator
from ._axes import axes_or_new, colour_bar, name_axes, pair_of
from ._colours import colour_of
from ._draw import figure


@figure
def boxes(
    boxes: BoxSet,
    *,
    values: ArrayLike | None = None,
    names: Sequence[str | Coordinate] = (),
    coordinates: tuple[int | str, int | str] = (0, 1),
    ax: Axes | None = None,
    **style: Any,
) -> Axes:
    """Draw boxes, in one colour or by a value for each.

    Parameters
    ----------
    boxes : BoxSet
        Boxes; in more than two dimensions their projections are drawn, in one dimension bars whose heights are the
        values.
    values : array_like, shape (n,), optional
        A number for each box, such as a density or a component of an eigenvector, shown as colour.
    names : sequence of str or Coordinate, optional
        Names of the axes, such as ``point_map.coordinates``.
    coordinates : tuple, optional
        Coordinates on the horizontal and the vertical axis, by number or name.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    **style
        Style of the collection of polygons, such as ``facecolor`` or ``cmap``.

    Returns
    -------
    matplotlib Axes
        The axes.

    Raises
    ------
    ValueError
        For another number of values than boxes.
    """
    ax = axes_or_new(ax)
    names = listed("names", names)
    axes = as_coordinates(names or [f"x{j + 1}" for j in range(boxes.grid.dimension)])
    if len(axes) != boxes.grid.dimension:
        raise ValueError(f"names={names!r}: give one for each of {boxes.grid.dimension} axes")
    shown = None if values is None else real_array("values", values)
    if shown is not None and shown.shape != (len(boxes),):
        raise ValueError(f"values has the shape {shown.shape}: give one for each of the {len(boxes)} boxes")
    if boxes.grid.dimension == 1:
        heights = np.ones(len(boxes)) if shown is None else shown
        ax.bar(boxes.lower_corners()[:, 0], heights, boxes.grid.widths[0], align="edge", **style)
        _frame(ax, boxes.grid, axes, [0])
        return ax
    pair = list(pair_of("coordinates", coordinates, axes))
    squares = PolyCollection(list(_rectangles(boxes, pair)), **{"linewidth": 0.0, **style})
    if shown is not None:
        squares.set_array(shown)
    ax.add_collection(squares)
    _frame(ax, boxes.grid, axes, pair)
    return ax


@figure
def morse_graph(
    graph: MorseGraph, *, coordinates: tuple[int | str, int | str] = (0, 1), ax: Axes | None = None
) -> Axes:
    """Draw Morse sets, each in its colour, with arrows along the edges of the Morse graph.

    Parameters
    ----------
    graph : MorseGraph
        Morse sets and their order.
    coordinates : tuple, optional
        Coordinates on the horizontal and the vertical axis, by number or name.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes; attracting sets are marked as such in the legend.
    """
    ax = axes_or_new(ax)
    if not graph.sets:
        raise ValueError(f"graph={graph!r} has no sets: nothing recurs in its window")
    plane = graph.sets[0].grid.dimension > 1
    for k, members in enumerate(graph.sets):
        label = f"{k}, attracting" if k in graph.sinks else str(k)
        colour = colour_of(k)
        style: dict[str, Any] = (
            {"facecolor": colour, "edgecolor": colour, "linewidth": 1.0} if plane else {"color": colour}
        )
        boxes(members, names=graph.coordinates, coordinates=coordinates, ax=ax, label=label, **style)
    if plane:
        pair = list(pair_of("coordinates", coordinates, graph.coordinates))
        middles = [_middle(boxes)[pair] for boxes in graph.sets]
        for i, j in graph.edges:
            ax.annotate("", middles[j], middles[i], arrowprops={"arrowstyle": "->", "color": "0.4"})
    ax.legend(title="Morse set", loc="upper right")
    return ax


@figure
def eigenvalues(operator: TransferOperator, *, n_eigenvalues: int = 12, ax: Axes | None = None) -> Axes:
    """Draw the largest eigenvalues of a transfer operator, with the unit circle.

    Parameters
    ----------
    operator : TransferOperator
        The operator.
    n_eigenvalues : int, optional
        Number of eigenvalues.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes.
    """
    ax = axes_or_new(ax)
    values = operator.eigenvalues(min(n_eigenvalues, len(operator.boxes)))
    turn = np.exp(2j * np.pi * np.linspace(0.0, 1.0, 400))
    ax.plot(turn.real, turn.imag, color="0.7", linewidth=0.8)
    ax.plot(values.real, values.imag, "o", color=colour_of(0))
    ax.set(aspect="equal", xlabel="real part of the eigenvalue", ylabel="imaginary part")
    return ax


@checked
def eigenvector(
    operator: TransferOperator,
    *,
    index: int = 0,
    saturation: float = 0.98,
    coordinates: tuple[int | str, int | str] = (0, 1),
    ax: Axes | None = None,
) -> Axes:
    """Draw an eigenvector of a transfer operator over its boxes, or the invariant density.

    Parameters
    ----------
    operator : TransferOperator
        The operator.
    index : int, optional
        0 for the density of the invariant measure; else the real part of the eigenvector of that number, the largest
        eigenvalue being number 0.
    saturation : float, optional
        Quantile of the modulus at which the colours end, above 0.
    coordinates : tuple, optional
        Coordinates on the horizontal and the vertical axis, by number or name.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes, with a colour bar.
    """
    ax = axes_or_new(ax)
    quantile = finite_number("saturation", saturation, above=0.0, at_most=1.0)
    index = whole_number("index", index, at_most=len(operator.boxes) - 1)
    try:
        values = operator.density if index == 0 else operator.eigenvectors(index + 1)[1][:, index].real
    except ValueError as error:
        raise ValueError(f"operator={operator!r}, index={index}: {error}") from error
    top = float(np.quantile(np.abs(values), quantile)) or 1.0
    style: dict[str, Any] = (
        {"cmap": "viridis", "clim": (0.0, top)} if index == 0 else {"cmap": "RdBu_r", "clim": (-top, top)}
    )
    plane = operator.boxes.grid.dimension > 1
    common: dict[str, Any] = {"names": operator.coordinates, "coordinates": coordinates, "ax": ax}
    boxes(operator.boxes, values=values, **common, **(style if plane else {}))
    if plane:
        colour_bar(ax, ax.collections[-1], "density" if index == 0 else f"eigenvector {index}")
    return ax


def _rectangles(boxes: BoxSet, pair: list[int]) -> Floats:
    """Return the corners, in their order around it, of each box seen along the other axes, shape (n, 4, 2)."""
    low = boxes.lower_corners()[:, pair]
    steps = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * boxes.grid.widths[pair]
    return np.asarray(low[:, None, :] + steps)


def _middle(boxes: BoxSet) -> Floats:
    """Return the centre of the box that is nearest to the mean of all centres."""
    centres = boxes.centres()
    apart = ((centres - centres.mean(axis=0)) / boxes.grid.widths) ** 2
    return np.asarray(centres[np.argmin(apart.sum(axis=1))])


def _frame(ax: Axes, grid: CellGrid, coordinates: Sequence[Coordinate], pair: list[int]) -> None:
    """Set limits and names of the axes."""
    ends = [(grid.lower[j], grid.upper[j]) for j in pair]
    ax.set(**dict(zip(("xlim", "ylim"), ends, strict=False)))
    name_axes(ax, [coordinates[j] for j in pair], [high - low for low, high in ends])
