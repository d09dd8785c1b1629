"""Figures of stability maps, with matplotlib."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from .._lib.arrays import Bools, Floats
from .._lib.checks import real_array
from ..bifurcations.crossings import Crossing
from ..bifurcations.equilibrium_stability import StabilityMap
from ._axes import axes_or_new, name_plane
from ._colours import COLOURS, chosen_colours
from ._draw import figure

CROSSING_COLOURS = dict(zip(Crossing, COLOURS, strict=False))
"""Colour of each way in which multipliers cross the unit circle."""

CROSSING_NAMES = {
    Crossing.PLUS_ONE: "multiplier +1",
    Crossing.MINUS_ONE: "multiplier −1",
    Crossing.NEIMARK_SACKER: "complex pair",
}

_DOTS: dict[str, Any] = {
    **{"fmt": "o", "markerfacecolor": "white", "markeredgecolor": "black", "markersize": 5.0},
    **{"ecolor": "black", "elinewidth": 1.0, "capsize": 2.0, "zorder": 4},
}


@figure
def stability_map(
    stability: StabilityMap,
    *,
    ax: Axes | None = None,
    colours: Mapping[Crossing, Any] | None = None,
    background: bool = True,
    legend: bool = True,
    measured: ArrayLike | None = None,
) -> Axes:
    """Draw the stability map of an equilibrium or a periodic orbit, with the stability boundaries.

    Parameters
    ----------
    stability : StabilityMap
        Result of :func:`stability_map`.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    colours : mapping of Crossing to colour, optional
        Colours of some boundaries; others keep the default ones.
    background : bool, optional
        Shade the classes; otherwise only boundaries are drawn, so that several maps can be superposed.
    legend : bool, optional
        Name the classes and the boundaries that occur.
    measured : array_like, shape (n, 2) or (n, 3), optional
        Measured points of a boundary, drawn over it as white dots: values along both axes, in the units of the map,
        then standard errors of the second, if known.  The legend counts those outside the map.

    Returns
    -------
    matplotlib Axes
        The axes: white where all multipliers are inside the unit circle, darker grey the more of them are outside, and
        hatched where the orbit does not exist or its multipliers are not known.

    Raises
    ------
    TypeError, ValueError
        For something that is not a stability map, and for measured points that are not rows of two or three finite
        numbers, or have negative errors.

    Examples
    --------
    >>> from math import cos, pi, sin
    >>> from cellmap import ForcedSystem, plot, stability_map
    >>> def rhs(t, x, p):
    ...     theta, v = x
    ...     return v, -p.gamma * v - (p.alpha - p.beta * cos(t)) * sin(theta)
    >>> pendulum = ForcedSystem(rhs, {"alpha": 0.25, "beta": 0.0, "gamma": 0.05}, 2 * pi, ("theta", "v"))
    >>> axes = ("beta", np.linspace(0, 1, 41)), ("alpha", np.linspace(0.01, 0.1, 10))
    >>> ax = plot.stability_map(stability_map(pendulum, [pi, 0], *axes))
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['stable', '1 multiplier outside', 'multiplier +1', 'multiplier −1']
    >>> over = plot.stability_map(stability_map(pendulum, [pi, 0], *axes), measured=[[0.2, 0.02, 0.003]])
    >>> over.get_legend().get_texts()[-1].get_text()
    'measured'
    """
    dots = None if measured is None else _measured(measured)
    ax = axes_or_new(ax)
    handles: list[Any] = _shade(ax, stability) if background else []
    palette = {**CROSSING_COLOURS, **chosen_colours(colours)}
    curves = stability.curves
    for curve in curves:
        lone = "." if len(curve) == 1 else ""
        ax.plot(curve.x, curve.y, color=palette[curve.crossing], linewidth=1.2, marker=lone, markersize=2.0)
    found = {curve.crossing for curve in curves}
    handles += [Line2D([], [], color=palette[c], label=CROSSING_NAMES[c]) for c in Crossing if c in found]
    if dots is not None:
        errors = dots[:, 2] if dots.shape[1] == 3 else None
        away = _outside(dots[:, 0], stability.x) | _outside(dots[:, 1], stability.y)
        label = f"measured ({away.sum()} of {away.size} outside of the map)" if away.any() else "measured"
        handles.append(ax.errorbar(dots[:, 0], dots[:, 1], errors, label=label, **_DOTS))
    name_plane(ax, stability)
    if legend:
        ax.legend(handles=handles, fontsize="small")
    return ax


def _outside(places: Floats, axis: Floats) -> Bools:
    return (places < axis.min()) | (places > axis.max())


def _measured(given: ArrayLike) -> Floats:
    points = real_array("measured", given, "rows of two or three real numbers")
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise ValueError(f"measured has the shape {points.shape}: give rows of x, y and, if known, the error of y")
    if not np.isfinite(points).all():
        raise ValueError(f"measured[{int(np.argmin(np.isfinite(points).all(axis=1)))}] is not finite: leave it out")
    if (points[:, 2:] < 0.0).any():
        raise ValueError(f"measured holds the error {points[:, 2].min():g}: give standard errors of at least 0")
    return points


def _shade(ax: Axes, stability: StabilityMap) -> list[Patch | Line2D]:
    """Colour the classes, and return what names those that occur."""
    unstable = stability.unstable
    most = max(1, int(unstable.max()))
    shades = [str(1.0 - 0.25 * k / most) for k in range(most + 1)]
    ax.pcolormesh(
        stability.x,
        stability.y,
        np.ma.masked_less(unstable, 0),
        cmap=ListedColormap(shades),
        norm=BoundaryNorm(np.arange(most + 2) - 0.5, most + 1),
        shading="nearest",
        rasterized=True,
    )
    names = ["stable", "1 multiplier outside", *(f"{k} multipliers outside" for k in range(2, most + 1))]
    handles: list[Patch | Line2D] = [
        Patch(facecolor=shades[k], edgecolor="0.3", label=names[k]) for k in range(most + 1) if (unstable == k).any()
    ]
    if (unstable < 0).any():
        # The ground shows where no class covers it.
        hatched: dict[str, Any] = {"facecolor": "white", "edgecolor": "0.6", "hatch": "////"}
        ax.patch.set(**hatched)
        handles.append(Patch(label="no orbit", **hatched))
    return handles
