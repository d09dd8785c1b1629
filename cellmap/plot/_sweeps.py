"""Figures of bifurcation diagrams, and of attractors and basins against a parameter, with matplotlib."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from .._lib.arrays import Floats
from ..basins.continuation_record import BasinContinuation
from ..bifurcations.diagram import BifurcationDiagram
from ..bifurcations.period_measures import Quantity
from ..orbits.attractor import Kind
from ._axes import axes_or_new, column_of, label_axis, legend_below, measured_axis, parameter_title, short_name
from ._colours import Colour, colour_of, label_colours
from ._draw import figure

_SMALLEST, _LARGEST = 0.6, 3.0  # sizes of points by default
_ROWS = 400  # heights that a figure shows apart


@figure
def bifurcation_diagram(
    diagram: BifurcationDiagram,
    *,
    coordinate: Quantity = 0,
    ax: Axes | None = None,
    size: float | None = None,
    measure: str | None = None,
) -> tuple[Axes, ...]:
    """Draw a bifurcation diagram: points above, the largest Lyapunov exponent below.

    Parameters
    ----------
    diagram : BifurcationDiagram
        Result of :func:`bifurcation_diagram`.
    coordinate : int, str or callable, optional
        Number or name of the coordinate that is drawn; with a measure as for :func:`branches`.
    ax : matplotlib Axes, optional
        Axes for the points, without exponents; by default a new figure with both.
    size : float, optional
        Size of a point, in typographic points.  By default the fewer points there are to each value of the parameter
        that lie apart, the larger they are, from 0.6 for chaos to 3 for a fixed point.
    measure : {"maximum", "minimum", "amplitude", "mean", "norm"}, optional
        Draw this measure of each orbit instead of its points; see :meth:`BifurcationDiagram.measure`.

    Returns
    -------
    tuple of matplotlib Axes
        The axes of the points and, in a new figure, those of the largest Lyapunov exponents per step of the map, if the
        diagram has them, with a band of one standard error.  Each branch has its colour; points of later ones lie under
        those of earlier ones.

    Raises
    ------
    ValueError
        For a coordinate that it does not have.

    Examples
    --------
    >>> from cellmap import bifurcation_diagram, discrete_map, plot
    >>> logistic = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 3.0}, ("x",))
    >>> upper, lower = plot.bifurcation_diagram(bifurcation_diagram(logistic, "r", [3.2, 3.5], [0.3]))
    >>> upper.get_ylabel(), lower.get_xlabel()
    ('$x$', '$r$')
    """
    if measure is None:
        column = column_of(coordinate, diagram.coordinates)  # type: ignore[arg-type]
        places, shown_as = diagram.points[..., column], diagram.coordinates[column]
    else:
        places = diagram.measure(coordinate, measure)[..., None]
        shown_as = measured_axis(diagram.coordinates, coordinate, measure)
    drawn: tuple[Axes, ...]
    if ax is None and not np.isnan(diagram.exponents).all():
        _, panels = plt.subplots(2, sharex=True, figsize=(7.0, 6.0), height_ratios=(2.5, 1.0), layout="constrained")
        drawn = (panels[0], panels[1])
        _draw_exponents(panels[1], diagram)
    else:
        drawn = (axes_or_new(ax, (7.0, 4.5)),)
    _draw_points(drawn[0], diagram, places, size)
    finite = places[np.isfinite(places)]
    label_axis(drawn[0].yaxis, shown_as, float(np.ptp(finite)) if finite.size else 0.0)
    drawn[-1].set_xlabel(parameter_title(diagram.parameter, diagram.parameter_units))
    drawn[0].set_title(diagram.system)
    return drawn


def _draw_points(ax: Axes, diagram: BifurcationDiagram, places: Floats, size: float | None) -> None:
    across = np.broadcast_to(diagram.values[:, None], places.shape[1:])
    size = _size(places) if size is None else size
    style = {"linestyle": "none", "marker": ".", "markersize": size, "markeredgewidth": 0.0, "rasterized": True}
    for branch in reversed(range(len(places))):
        ax.plot(across.ravel(), places[branch].ravel(), color=colour_of(branch), **style)  # type: ignore[arg-type]
    names = _branch_names(diagram)
    if len(names) > 1:
        marks = [Line2D([], [], marker="o", linestyle="none", color=colour_of(b)) for b in range(len(names))]
        ax.legend(marks, names, fontsize="small", frameon=False)


def _size(places: Floats) -> float:
    """Return the size of points that suits how many of them lie apart, on average over the values."""
    finite = places[np.isfinite(places)]
    if not finite.size:
        return _LARGEST
    rows = np.round((places - finite.min()) / (np.ptp(finite) or 1.0) * _ROWS)
    seen = np.isfinite(rows).reshape(*rows.shape[:2], -1).any(axis=-1)
    apart = [len(np.unique(row[np.isfinite(row)])) for row in rows.reshape(-1, rows.shape[-1])]
    mean = sum(apart) / max(int(seen.sum()), 1)
    return float(np.clip(_LARGEST / np.sqrt(mean), _SMALLEST, _LARGEST))


def _draw_exponents(ax: Axes, diagram: BifurcationDiagram) -> None:
    ax.axhline(0.0, color="0.6", linewidth=0.8)
    largest = np.where(np.isfinite(diagram.exponents[..., 0]), diagram.exponents[..., 0], np.nan)
    error = diagram.standard_errors[..., 0]
    for branch in reversed(range(len(largest))):
        colour = colour_of(branch)
        ax.plot(diagram.values, largest[branch], color=colour, linewidth=0.8)
        band = largest[branch] - error[branch], largest[branch] + error[branch]
        ax.fill_between(diagram.values, *band, color=colour, alpha=0.3, linewidth=0.0)
    ax.set_ylabel("largest exponent")


def _branch_names(diagram: BifurcationDiagram) -> list[str]:
    """Name branches by their directions, and by their initial conditions if there are several."""
    rounds = len(diagram.directions) // len(set(diagram.directions))
    names = []
    for branch, way in enumerate(diagram.directions):
        words = [] if way == "none" else [way]
        if rounds > 1 or not words:
            words.append(f"from ({', '.join(f'{v:.4g}' for v in diagram.initial_conditions[branch])})")
        names.append(" ".join(words))
    return names


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
    ('fraction of initial conditions', '$x$')
    """
    if not len(continuation.values):
        raise ValueError(f"continuation={continuation!r} has no values: there is nothing to draw")
    column = column_of(coordinate, continuation.coordinates)
    palette = label_colours(continuation.labels, colours)
    drawn: tuple[Axes, ...] = (ax,) if ax is not None else ()
    if ax is None:
        _, panels = plt.subplots(2, sharex=True, figsize=(7.0, 6.5), layout="constrained")
        drawn = (panels[0], panels[1])
        _draw_attractors(panels[1], continuation, column, palette)
    upper = drawn[0]
    upper.stackplot(continuation.values, continuation.fractions.T, colors=list(palette.values()), linewidth=0.0)
    upper.set(ylim=(0.0, 1.0), ylabel="fraction of initial conditions", title=continuation.system)
    upper.margins(x=0.0)
    drawn[-1].set_xlabel(parameter_title(continuation.parameter, continuation.parameter_units))
    if legend:
        legend_below(
            drawn[-1], [(c, short_name(continuation.label_name(k), k, lines=2)) for k, c in palette.items()], -0.14
        )
    return drawn


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
