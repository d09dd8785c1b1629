"""Figures of edge states, manifolds and chaotic saddles, with matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..analysis.boundary.edge import EdgeOrbit
from ..analysis.boundary.manifolds import BoundaryDistance, Manifold
from ..analysis.boundary.saddle_sets import ChaoticSaddle
from ..basins.record import Basins
from ..maps.coordinates import Coordinate
from ..orbits.orbit_kinds import PeriodicOrbit
from ._axes import axes_or_new, cut_at_branch_cuts, label_axis, name_axes, pair_of, several_of, titled
from ._basins import basins as draw_basins
from ._draw import figure

_MANIFOLD_COLOURS = {"stable": "#000000", "unstable": "#D55E00"}


@figure
def edge_orbit(
    edge: EdgeOrbit, *, basins: Basins | None = None, coordinates: tuple[int | str, int | str] = (0, 1),
    ax: Axes | None = None
) -> Axes:  # fmt: skip
    """Draw a straddle orbit and the edge state at its end.

    Parameters
    ----------
    edge : EdgeOrbit
        Result of :func:`edge_orbit`.
    basins : Basins, optional
        Basins to draw underneath, on a grid of two axes.
    coordinates : tuple of int or str, optional
        Coordinates on the horizontal and the vertical axis.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes with the midpoints, later ones darker; a square marks the edge state.  An orbit of one coordinate is
        drawn against the step.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins, plot
    >>> from cellmap.analysis.boundary import edge_orbit
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3, x[1] / 2), {}, ("x", "y"))
    >>> basins = find_basins(cubic, CellGrid((-1.5, -1), (1.5, 1), (60, 40)))
    >>> plot.edge_orbit(edge_orbit(basins, periods=30), basins=basins).get_ylabel()
    '$y$'
    """
    if len(edge.coordinates) == 1:
        ax = axes_or_new(ax, (7.0, 5.5))
        ax.plot(edge.points[:, 0], marker=".", color="black", linewidth=0.6)
        ax.set_xlabel("step")
        label_axis(ax.yaxis, edge.coordinates[0], float(np.ptp(edge.points)))
        return ax
    columns = list(pair_of("coordinates", coordinates, edge.coordinates))
    ax = _below(basins, ax)
    points = edge.points[:, columns]
    limits = ax.get_xlim(), ax.get_ylim()
    age = np.linspace(0.15, 1.0, len(points))
    style: dict[str, Any] = {"cmap": "Greys", "edgecolors": "0.3", "linewidths": 0.4, "zorder": 3}
    ax.scatter(points[:, 0], points[:, 1], c=age, vmin=0.0, s=12, **style)
    if basins is not None:  # a scatter widens the axes
        ax.set(xlim=limits[0], ylim=limits[1])
    if edge.orbit is not None:
        _mark_orbit(ax, edge.orbit, columns)
    _name_axes(ax, basins, edge.coordinates, columns, points)
    return ax


@figure
def manifolds(
    manifolds: Manifold | Sequence[Manifold],
    *,
    basins: Basins | None = None,
    ax: Axes | None = None,
    width: float = 0.9,
) -> Axes:
    """Draw stable and unstable manifolds with their saddles.

    Parameters
    ----------
    manifolds : Manifold or sequence of Manifold
        Result of :func:`saddle_manifold`.
    basins : Basins, optional
        Basins to draw underneath.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    width : float, optional
        Width of the lines, in typographic points.

    Returns
    -------
    matplotlib Axes
        The axes, with stable manifolds in black and unstable ones in vermilion.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, periodic_orbit, plot
    >>> from cellmap.analysis.boundary import saddle_manifold
    >>> bent = discrete_map(lambda x, p: (2 * x[0], x[1] / 2 + 3.5 * x[0] ** 2), {}, ("x", "y"))
    >>> window = CellGrid((-1, -1), (1, 1), (1, 1))
    >>> plot.manifolds(saddle_manifold(bent, periodic_orbit(bent, [0.1, 0.1]), "unstable", window)).get_xlabel()
    '$x$'
    """
    curves = several_of("manifolds", manifolds, Manifold, "what saddle_manifold returns, one or several")
    ax = _below(basins, ax)
    for manifold in curves:
        for branch in manifold.branches:
            breaks = np.flatnonzero(~np.isfinite(branch.points).all(axis=1))
            for piece in np.split(branch.points, breaks):
                clean = piece[np.isfinite(piece).all(axis=1)]
                if len(clean) > 1:
                    drawn = cut_at_branch_cuts(clean, manifold.coordinates)
                    ax.plot(*drawn.T, color=_MANIFOLD_COLOURS[manifold.kind], linewidth=width,
                            scalex=basins is None, scaley=basins is None)  # fmt: skip
        _mark_orbit(ax, manifold.orbit, [0, 1])
    kinds = dict.fromkeys(m.kind for m in curves)
    handles = [Line2D([], [], color=_MANIFOLD_COLOURS[kind], label=f"{kind} manifold") for kind in kinds]
    if basins is None:
        ax.legend(handles=handles, frameon=False, fontsize="small")
    _name_axes(ax, basins, curves[0].coordinates, [0, 1], np.concatenate([m.points for m in curves]))
    return ax


@figure
def boundary_distance(distance: BoundaryDistance, *, ax: Axes | None = None) -> Axes:
    """Draw the fraction of a boundary that is within a distance of curves, against the distance.

    Parameters
    ----------
    distance : BoundaryDistance
        Result of :func:`boundary_distance`.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes with the cumulative distribution and the largest distance that counts.

    Examples
    --------
    >>> from cellmap import plot
    >>> import numpy as np
    >>> near = BoundaryDistance(np.zeros((3, 2)), np.array([0.1, 0.2, 3.0]), np.zeros((3, 2), np.int16), 1.0, 2 / 3)
    >>> plot.boundary_distance(near).get_xlabel()
    'distance (cells)'
    """
    ax = axes_or_new(ax, (6.0, 4.0))
    finite = np.sort(distance.distances[np.isfinite(distance.distances)])
    ax.step(finite, np.arange(1, len(finite) + 1) / len(distance.distances), where="post", color="black")
    ax.axvline(distance.within, linestyle="--", color="0.5", label=f"{100 * distance.fraction:.4g} % within")
    ax.set(xlabel="distance (cells)", ylabel="fraction of the boundary", ylim=(0.0, 1.02))
    ax.legend(frameon=False)
    return ax


@figure
def chaotic_saddle(
    saddle: ChaoticSaddle, *, coordinates: tuple[int | str, int | str] = (0, 1), basins: Basins | None = None,
    ax: Axes | None = None, size: float = 1.0
) -> Axes:  # fmt: skip
    """Draw the points of a chaotic saddle; for a map of one coordinate, each point against its successor.

    Parameters
    ----------
    saddle : ChaoticSaddle
        Result of :func:`chaotic_saddle`.
    coordinates : tuple of int or str, optional
        Coordinates on the horizontal and the vertical axis.
    basins : Basins, optional
        Basins to draw underneath.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    size : float, optional
        Size of a point, in typographic points.

    Returns
    -------
    matplotlib Axes
        The axes with the points.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, plot
    >>> from cellmap.analysis.boundary import chaotic_saddle
    >>> tent = discrete_map(lambda x, p: (1.5 - 3 * abs(x[0] - 0.5),), {}, ("x",))
    >>> plot.chaotic_saddle(chaotic_saddle(tent, CellGrid((0,), (1,), (1,)), n_points=100)).get_ylabel()
    'next $x$'
    """
    ax = _below(basins, ax)
    style: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": size, "color": "black"}
    style |= {"markeredgewidth": 0.0, "rasterized": True}
    if len(saddle.coordinates) == 1:
        ax.plot(saddle.points[:-1, 0], saddle.points[1:, 0], **style)
        ax.set(xlabel=titled(saddle.coordinates[0]), ylabel=f"next {titled(saddle.coordinates[0])}")
        return ax
    columns = list(pair_of("coordinates", coordinates, saddle.coordinates))
    points = saddle.points[:, columns]
    ax.plot(*points.T, **style, scalex=basins is None, scaley=basins is None)
    _name_axes(ax, basins, saddle.coordinates, columns, points)
    return ax


def _below(basins: Basins | None, ax: Axes | None) -> Axes:
    ax = axes_or_new(ax, (7.0, 5.5))
    return ax if basins is None else draw_basins(basins, ax=ax)


def _mark_orbit(ax: Axes, orbit: PeriodicOrbit, columns: list[int]) -> None:
    style = {"marker": "s", "markersize": 6, "markerfacecolor": "white", "markeredgecolor": "black", "zorder": 4}
    ax.plot(*orbit.points[:, columns].T, linestyle="none", scalex=False, scaley=False, **style)  # type: ignore[arg-type]


def _name_axes(
    ax: Axes, basins: Basins | None, coordinates: Sequence[Coordinate], columns: list[int], points: Any
) -> None:
    if basins is not None:
        return
    name_axes(ax, [coordinates[j] for j in columns], np.ptp(points, axis=0) if len(points) else (0.0, 0.0))
