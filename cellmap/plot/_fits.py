"""Figures of fitted lines, with matplotlib."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from .._lib.arrays import Floats
from .._lib.checks import shown
from .._lib.fit import Fit
from ._axes import axes_or_new
from ._colours import COLOURS, one_colour
from ._draw import figure


@figure
def fit(
    result: Fit | Any, *, ax: Axes | None = None, colour: Any = None, label: str | None = None, shade: bool = True
) -> Axes:
    """Draw the points of a fit, its window, and the line with its slope.

    Parameters
    ----------
    result : Fit, or anything that carries one as `fit`
        Result to draw.  A quantity whose name begins with "ln " is drawn as itself on a logarithmic axis.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    colour : colour, optional
        Colour of points and line.
    label : str, optional
        Name in the legend, before the slope.
    shade : bool, optional
        Shade the window.

    Returns
    -------
    matplotlib Axes
        The axes: points in the window are filled, the others open; bars are one standard error.

    Examples
    --------
    >>> from cellmap import plot
    >>> from cellmap._lib.fit import fit_line
    >>> plot.fit(fit_line([0, 1, 2], [0, 2, 4], labels=("ln 1/size", "ln boxes"))).get_ylabel()
    'boxes'
    """
    fit = result if isinstance(result, Fit) else getattr(result, "fit", None)
    if not isinstance(fit, Fit):
        raise TypeError(f"result={shown(result)}: give a Fit, or a result that carries one as .fit")
    ax = axes_or_new(ax, (6.0, 4.5))
    colour = one_colour(colour, COLOURS[0])
    logarithmic = [name.startswith("ln ") for name in fit.labels]
    x, y = (np.exp(v) if is_log else v for v, is_log in zip((fit.x, fit.y), logarithmic, strict=True))
    inside = np.zeros(len(x), bool)
    inside[fit.inside] = True
    bars = _bars(fit, y, logarithmic[1])
    for chosen, filled in ((inside, True), (~inside, False)):
        ax.errorbar(
            x[chosen],
            y[chosen],
            None if bars is None else bars[:, chosen],
            linestyle="none",
            marker="o",
            markersize=4.5,
            color=colour,
            markerfacecolor=colour if filled else "white",
            capsize=2.0,
        )
    ends = fit.x[[fit.fit_range[0], fit.fit_range[1]]]
    if shade:
        low, high = sorted(np.exp(ends) if logarithmic[0] else ends)
        ax.axvspan(low, high, color=colour, alpha=0.12, linewidth=0.0)
    slope = f"{fit.slope:.4g} ± {fit.standard_error:.2g}"
    line = fit(ends)
    ax.plot(
        np.exp(ends) if logarithmic[0] else ends,
        np.exp(line) if logarithmic[1] else line,
        color=colour,
        label=f"slope {slope}" if label is None else f"{label}: {slope}",
    )
    for axis, name, is_log in zip("xy", fit.labels, logarithmic, strict=True):
        getattr(ax, f"set_{axis}scale")("log" if is_log else "linear")
        getattr(ax, f"set_{axis}label")(name.removeprefix("ln ") if is_log else name)
    ax.legend(frameon=False)
    return ax


def _bars(fit: Fit, y: Floats, logarithmic: bool) -> Floats | None:
    """Lower and upper lengths of error bars."""
    if fit.errors is None:
        return None
    if not logarithmic:
        return np.stack([fit.errors, fit.errors])
    return np.stack([y - y * np.exp(-fit.errors), y * np.exp(fit.errors) - y])
