"""Figures of basins, with matplotlib."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from .._lib.arrays import Floats
from ..basins.by_features import FeatureBasins
from ..basins.record import Basins
from ..maps.grid import CellGrid
from ..orbits.attractor import Kind
from ._axes import axes_or_new, label_axis, legend_below, pair_of, plane_of, show_cells
from ._colours import label_colours
from ._draw import figure


@figure
def basins(
    basins: Basins | FeatureBasins,
    *,
    ax: Axes | None = None,
    colours: Mapping[int, Any] | None = None,
    shade: bool = False,
    show_attractors: bool = True,
    legend: bool = True,
    plane: tuple[int | str, int | str] | None = None,
) -> Axes:
    """Draw basins of attraction.

    Parameters
    ----------
    basins : Basins or FeatureBasins
        Basins on a grid with one or two axes of more than one cell, further axes of one cell make it a slice; or of any
        list of initial conditions, which is drawn as points.  A grid with one such axis is drawn as a strip.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    colours : mapping of int to colour, optional
        Colours of some labels; others keep the default ones.
    shade : bool, optional
        Draw initial conditions with long settling times in lighter colours; FeatureBasins have none.
    show_attractors : bool, optional
        Mark the attractors' points.
    legend : bool, optional
        Name each attractor with the fraction of its basin.
    plane : tuple of int or str, optional
        Coordinates across and up of initial conditions that are no grid; by default the first two.

    Returns
    -------
    matplotlib Axes
        The axes; angles are in multiples of pi.

    Raises
    ------
    ValueError
        For basins on a grid with three or more axes of more than one cell.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins, plot
    >>> halves = discrete_map(lambda x, p: (x[0] / 2, x[1] / 3), {}, ("x", "y"))
    >>> plot.basins(find_basins(halves, CellGrid((-1, -1), (1, 1), (8, 8)))).get_xlabel()
    'x'
    """
    wide = _coordinates_of_axes(basins, plane)
    ax = axes_or_new(ax, (7.0, 5.5))
    palette = label_colours(basins, colours)
    if basins.grid is None:
        _show_points(ax, basins, palette, wide)
    elif len(wide) == 1:
        _show_strip(ax, basins, painted(basins, palette, shade), basins.grid, wide[0])
    else:
        show_cells(ax, painted(basins, palette, shade), basins.grid, basins.coordinates)
    if show_attractors:
        _mark_attractors(ax, basins, wide)
    if legend:
        fractions = {k: _percent(f.fraction) for k, f in basins.fractions.items()}
        legend_below(ax, [(palette[k], f"{basins.label_name(k)}: {s}") for k, s in fractions.items()])
    ax.set_title(basins.name)
    return ax


def _coordinates_of_axes(basins: Basins | FeatureBasins, plane: tuple[int | str, int | str] | None) -> list[int]:
    """Return the one or two coordinates along the axes of a figure."""
    if basins.grid is None:
        one = len(basins.coordinates) == 1
        return [0] if one else list(pair_of("plane", (0, 1) if plane is None else plane, basins.coordinates))
    if plane is not None:
        raise ValueError(f"plane={plane!r}: a grid has its own axes; leave plane= to lists of initial conditions")
    wide = [j for j, n in enumerate(basins.grid.shape) if n > 1]
    if len(wide) != 1:
        plane_of(basins)
    return wide


def _show_points(ax: Axes, basins: Basins | FeatureBasins, palette: Mapping[int, Any], wide: list[int]) -> None:
    """Draw initial conditions as points."""
    points = np.asarray(basins.initial_conditions).reshape(-1, len(basins.coordinates))
    labels = basins.labels.ravel()
    size = float(np.clip(250.0 / np.sqrt(len(labels)), 1.5, 8.0))
    for label, colour in palette.items():
        ax.plot(*_across(points[labels == label], wide), ".", markersize=size, color=colour)
    for axis, j in zip((ax.xaxis, ax.yaxis), wide, strict=False):
        label_axis(axis, basins.coordinates[j], float(np.ptp(points[:, j])))
    if len(wide) == 1:
        ax.set_yticks([])


def _show_strip(ax: Axes, basins: Basins | FeatureBasins, colours: Floats, grid: CellGrid, j: int) -> None:
    """Draw a line of cells along one coordinate as a strip of colours."""
    ends = (grid.lower[j], grid.upper[j])
    ax.imshow(colours.reshape(1, -1, 3), extent=(*ends, -0.5, 0.5), aspect="auto", interpolation="nearest")
    label_axis(ax.xaxis, basins.coordinates[j], ends[1] - ends[0])
    ax.set_yticks([])


def painted(basins: Basins | FeatureBasins, palette: Mapping[int, Any], shade: bool) -> Floats:
    """Colours of all cells, rows from bottom to top."""
    labels = np.squeeze(basins.labels).T
    image = np.empty((*labels.shape, 3))
    for label, colour in palette.items():
        image[labels == label] = colour
    if shade and isinstance(basins, Basins) and (basins.settling_time > 0).any():
        times = np.squeeze(basins.settling_time).T
        lateness = np.log1p(np.maximum(times, 0)) / np.log1p(times.max())
        image += (1.0 - image) * (0.7 * np.where(times >= 0, lateness, 0.0))[..., None]
    return image


def _mark_attractors(ax: Axes, basins: Basins | FeatureBasins, wide: list[int]) -> None:
    """Draw the points of attractors that lie in the window; a chaotic, quasi-periodic or unknown one as a cloud."""
    if isinstance(basins, FeatureBasins):
        for points in basins.representatives:
            ax.plot(*_across(points, wide), ".", markersize=3, color="black", scalex=False, scaley=False)
        return
    for attractor in basins.attractors:
        places = np.stack(_across(attractor.points, wide), axis=-1)
        if attractor.kind in (Kind.CHAOTIC, Kind.QUASIPERIODIC):
            alpha = 0.5 if attractor.kind is Kind.CHAOTIC else 1.0
            ax.plot(*places.T, ",", color="black", alpha=alpha, scalex=False, scaley=False)
            continue
        for k, j in enumerate(wide):
            turn = basins.coordinates[j].period
            if turn is not None:  # a point on the branch cut is seen at both ends
                places = np.concatenate([places + n * turn * np.eye(2)[k] for n in (-1, 0, 1)])
        style = {"marker": "o", "markersize": 5, "markerfacecolor": "white", "markeredgecolor": "black"}
        ax.plot(*places.T, linestyle="none", scalex=False, scaley=False, **style)  # type: ignore[arg-type]


def _across(points: Floats, wide: list[int]) -> tuple[Floats, Floats]:
    """Return where points lie on the axes; a single axis runs through the middle of a strip."""
    return points[:, wide[0]], points[:, wide[1]] if len(wide) == 2 else np.zeros(len(points))


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.2f} %" if fraction > 0.0005 or fraction == 0 else f"{100 * fraction:.2g} %"
