"""Figures of resilience: basin stability, settling times, fatal shocks, tipping; with matplotlib."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from .._lib.arrays import Floats
from ..analysis.resilience.basin_statistics import BasinStability, SettlingStatistics
from ..analysis.resilience.integrity import Ball
from ..analysis.resilience.nodes import NodeStability
from ..analysis.resilience.shocks import FatalShock
from ..analysis.resilience.survival import Survivability
from ..analysis.resilience.tipping import TippingProbabilities
from ..basins.record import Basins
from ..maps.coordinates import Coordinate
from ._axes import axes_or_new, cut_at_branch_cuts, label_axis, name_columns, short_name
from ._basins import basins as draw_basins
from ._colours import label_colour
from ._draw import figure


@figure
def basin_stability(stability: BasinStability, *, ax: Axes | None = None) -> Axes:
    """Draw the fractions of the basins with their intervals.

    Parameters
    ----------
    stability : BasinStability
        Result of :func:`basin_stability`.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes with a bar for each attractor and each other label that occurred.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins, plot
    >>> from cellmap.analysis.resilience import basin_stability
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))
    >>> basins = find_basins(cubic, CellGrid((-1.5,), (1.5,), (60,)))
    >>> len(plot.basin_stability(basin_stability(basins, n_samples=100)).patches)
    2
    """
    ax = axes_or_new(ax, (6.0, 4.5))
    places = np.arange(len(stability.fractions))
    fractions = np.array([s.fraction for s in stability.fractions.values()])
    ends = np.array([[s.low, s.high] for s in stability.fractions.values()])
    bars = np.stack([fractions - ends[:, 0], ends[:, 1] - fractions]).clip(min=0.0)
    colours = [label_colour(k) for k in stability.fractions]
    ax.bar(places, fractions, color=colours, yerr=bars, capsize=4.0, ecolor="0.2")
    name_columns(ax, [(k, stability.names[k]) for k in stability.fractions])
    ax.set(ylim=(0.0, min(1.02, 1.15 * float(ends[:, 1].max()))), ylabel="fraction of states")
    return ax


@figure
def node_stability(stability: NodeStability, *, ax: Axes | None = None) -> Axes:
    """Draw single-node basin stability with its intervals.

    Parameters
    ----------
    stability : NodeStability
        Result of :func:`node_stability`.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes with a bar for each node.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins, plot
    >>> from cellmap.analysis.resilience import node_stability
    >>> two = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3, x[1] / 2), {}, ("x", "y"))
    >>> basins = find_basins(two, CellGrid((-1.5, -1), (1.5, 1), (20, 20)))
    >>> nodes = {"first": {"x": (-1.5, 1.5)}, "second": {"y": (-1, 1)}}
    >>> len(plot.node_stability(node_stability(basins, 0, nodes, n_samples=100)).patches)
    2
    """
    ax = axes_or_new(ax, (6.0, 4.5))
    places = np.arange(len(stability.nodes))
    ends = np.stack([stability.fractions - stability.low, stability.high - stability.fractions]).clip(min=0.0)
    ax.bar(places, stability.fractions, color=label_colour(0), yerr=ends, capsize=4.0, ecolor="0.2")
    ax.set_xticks(places, stability.nodes)
    ax.set(ylim=(0.0, 1.02), xlabel="node disturbed", ylabel="basin stability", title=stability.attractor)
    return ax


@figure
def survivability(survival: Survivability, *, ax: Axes | None = None) -> Axes:
    """Draw the fraction of orbits that have not left the allowed region, against time.

    Parameters
    ----------
    survival : Survivability
        Result of :func:`survivability`.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes with a curve and the band of its intervals.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, plot
    >>> from cellmap.analysis.resilience import survivability
    >>> double = discrete_map(lambda x, p: (2 * x[0],), {}, ("x",))
    >>> found = survivability(double, {"x": (-1, 1)}, CellGrid((-1,), (1,), (1,)), periods=3)
    >>> plot.survivability(found).get_xlabel()
    'time'
    """
    ax = axes_or_new(ax, (6.0, 4.5))
    (line,) = ax.step(survival.times, survival.fractions, where="post")
    ax.fill_between(survival.times, survival.low, survival.high, step="post", color=line.get_color(), alpha=0.25)
    ax.set(xlim=(0.0, survival.times[-1]), ylim=(0.0, 1.02), xlabel="time", ylabel="fraction that survives")
    return ax


@figure
def settling_times(statistics: SettlingStatistics, *, ax: Axes | None = None) -> Axes:
    """Draw for each basin the fraction of initial conditions that have not settled yet, against the step.

    Parameters
    ----------
    statistics : SettlingStatistics
        Result of :func:`settling_statistics`.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes with a curve for each basin, on a logarithmic axis; initial conditions that never settled are in none.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins, plot
    >>> from cellmap.analysis.resilience import settling_statistics
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))
    >>> basins = find_basins(cubic, CellGrid((-1.5,), (1.5,), (60,)))
    >>> plot.settling_times(settling_statistics(basins)).get_yscale()
    'log'
    """
    ax = axes_or_new(ax, (6.0, 4.5))
    for k, basin in statistics.basins.items():
        if basin.count:
            left = (basin.count - np.cumsum(basin.times)) / basin.count
            label = f"{basin.name}: mean {basin.mean:.3g} ± {basin.standard_error:.1g}"
            shown = np.where(left > 0, left, np.nan)
            ax.step(np.arange(len(left)), shown, where="post", color=label_colour(k), label=label)
    ax.set(yscale="log", xlabel="step", ylabel="fraction not settled")
    if any(basin.count for basin in statistics.basins.values()):
        ax.legend(frameon=False, fontsize="small")
    return ax


@figure
def fatal_shock(shock: FatalShock, *, basins: Basins, ax: Axes | None = None) -> Axes:
    """Draw a minimal fatal shock over the basins: an arrow, and the ball whose radius it is.

    Parameters
    ----------
    shock : FatalShock
        Result of :func:`minimal_fatal_shock`.
    basins : Basins
        Basins on a grid of one axis or two.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins, plot
    >>> from cellmap.analysis.resilience import minimal_fatal_shock
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3, x[1] / 2), {}, ("x", "y"))
    >>> basins = find_basins(cubic, CellGrid((-1.5, -1), (1.5, 1), (60, 40)))
    >>> plot.fatal_shock(minimal_fatal_shock(basins, 0, n_trials=64), basins=basins).get_ylabel()
    '$y$'
    """
    ax = _on_basins(basins, ax)
    _draw_ball(ax, shock.point, shock.size, shock.scale, basins)
    _draw_curve(ax, np.stack([shock.point, shock.point + shock.shock]), basins, "-", 1.8)
    end = _in_plane(shock.end[None])[0]
    ax.plot(*end, "X", color="black", markeredgecolor="white", markersize=8, scalex=False, scaley=False)
    ax.set_title(f"{basins.name}: fatal shock of size {shock.size:.4g}")
    return ax


@figure
def ball(ball: Ball, *, basins: Basins, ax: Axes | None = None) -> Axes:
    """Draw a ball inside a basin over the basins.

    Parameters
    ----------
    ball : Ball
        Result of :func:`local_integrity` or :func:`largest_ball`.
    basins : Basins
        Basins on a grid of one axis or two.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins, plot
    >>> from cellmap.analysis.resilience import largest_ball
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3, x[1] / 2), {}, ("x", "y"))
    >>> basins = find_basins(cubic, CellGrid((-1.5, -1), (1.5, 1), (60, 40)))
    >>> plot.ball(largest_ball(basins, 0), basins=basins).get_xlabel()
    '$x$'
    """
    ax = _on_basins(basins, ax)
    _draw_ball(ax, ball.centre, ball.radius, ball.scale, basins)
    ax.plot(*_in_plane(ball.centre[None])[0], "+", color="black", markersize=9, scalex=False, scaley=False)
    ax.set_title(f"{basins.name}: ball of radius {ball.radius:.4g}")
    return ax


@figure
def tipping(tipping: TippingProbabilities, *, ax: Axes | None = None) -> Axes:
    """Draw tipping probabilities as a matrix.

    Parameters
    ----------
    tipping : TippingProbabilities
        Result of :func:`tipping_probabilities`.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes.  Rows are labels before the change, columns those after it; framed entries are states that do not tip.

    Examples
    --------
    >>> from cellmap import plot
    >>> from cellmap.analysis.resilience import tipping_probabilities
    >>> plot.tipping(tipping_probabilities([0, 0, 1, 1], [0, 1, 1, -3])).get_xlabel()
    'after'
    """
    ax = axes_or_new(ax, (3.0 + 1.2 * max(len(tipping.after), 2), 1.7 + 0.7 * max(len(tipping.before), 4)))
    ax.imshow(tipping.probabilities, vmin=0.0, vmax=1.0, cmap="Blues", aspect="auto")
    for (row, column), fraction in np.ndenumerate(tipping.probabilities):
        if np.isfinite(fraction):
            low, high = tipping.low[row, column], tipping.high[row, column]
            text, colour = f"{fraction:.3g}\n[{low:.2g}, {high:.2g}]", "white" if fraction > 0.6 else "black"
            ax.text(column, row, text, ha="center", va="center", color=colour, fontsize=8)
    for row, label in enumerate(tipping.continuation):
        if label is not None:
            corner = (tipping.after.index(label) - 0.48, row - 0.48)
            ax.add_patch(Rectangle(corner, 0.96, 0.96, fill=False, edgecolor="black", linewidth=1.5))
    name_columns(ax, zip(tipping.after, tipping.names[1], strict=True))
    rows = zip(tipping.before, tipping.names[0], strict=True)
    ax.set_yticks(range(len(tipping.before)), [short_name(name, label) for label, name in rows])
    ax.set(xlabel="after", ylabel="before")
    return ax


def _on_basins(basins: Basins, ax: Axes | None) -> Axes:
    """Draw basins in a plane, or those of one coordinate as a strip."""
    if not isinstance(basins, Basins) or basins.grid is None or len(basins.coordinates) > 2:
        raise ValueError(f"basins={basins!r}: a figure needs basins on a grid of one axis or two axes")
    if len(basins.coordinates) == 2:
        return draw_basins(basins, ax=ax)
    ax = axes_or_new(ax, (7.0, 2.5))
    edges = basins.grid.edges(0)
    ends = np.flatnonzero(np.diff(basins.labels)) + 1
    for first, last in zip([0, *ends], [*ends, len(basins.labels)], strict=True):
        ax.axvspan(edges[first], edges[last], color=label_colour(int(basins.labels[first])), linewidth=0.0)
    ax.set(xlim=(edges[0], edges[-1]), ylim=(-1.0, 1.0), yticks=[])
    label_axis(ax.xaxis, basins.coordinates[0], edges[-1] - edges[0])
    return ax


def _draw_ball(ax: Axes, centre: Floats, radius: float, scale: Floats, basins: Basins) -> None:
    way = np.linspace(0.0, 2 * np.pi, 361)
    circle = np.stack([np.cos(way), 0.5 * np.sin(way) if len(centre) == 1 else np.sin(way)], axis=1)
    units = np.append(radius * scale, 1.0)[:2]
    _draw_curve(ax, _in_plane(centre[None]) + units * circle, basins, "--", 1.2)


def _draw_curve(ax: Axes, curve: Floats, basins: Basins, style: str, width: float) -> None:
    pieces = cut_at_branch_cuts(_in_plane(curve), [*basins.coordinates, Coordinate("height")][:2])
    ax.plot(*pieces.T, style, color="black", linewidth=width, scalex=False, scaley=False)


def _in_plane(points: Floats) -> Floats:
    """Return points (n, 2): those of one coordinate in the middle of their strip."""
    return points if points.shape[1] == 2 else np.column_stack([points, np.zeros(len(points))])
