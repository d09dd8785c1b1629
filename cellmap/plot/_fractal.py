"""Figures of fitted lines, dimensions and measures of basin boundaries, with matplotlib."""

from __future__ import annotations

from math import log
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from .._lib.arrays import Floats
from .._lib.checks import shown
from .._lib.fit import Fit
from ..analysis.fractal.entropy import BasinEntropy
from ..analysis.fractal.generalized import GeneralizedDimensions, KaplanYorke
from ..analysis.fractal.randomness_test import FractalTest
from ..analysis.fractal.uncertainty_fits import UncertaintyExponent
from ..analysis.fractal.wada import MergingTest
from ..analysis.fractal.wada_search import WadaGrid
from ._axes import axes_or_new
from ._colours import COLOURS, one_colour
from ._draw import figure

_BARS: dict[str, Any] = {"color": COLOURS[0], "marker": "o", "markersize": 4, "capsize": 2}


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
    for chosen, filling in ((inside, colour), (~inside, "white")):
        style = _BARS | {"linestyle": "none", "markersize": 4.5, "color": colour, "markerfacecolor": filling}
        ax.errorbar(x[chosen], y[chosen], None if bars is None else bars[:, chosen], **style)
    ends = fit.x[[fit.fit_range[0], fit.fit_range[1]]]
    if shade:
        low, high = sorted(np.exp(ends) if logarithmic[0] else ends)
        ax.axvspan(low, high, color=colour, alpha=0.12, linewidth=0.0)
    slope = f"{fit.slope:.4g} ± {fit.standard_error:.2g}"
    if getattr(result, "scales_agree", None) is False:
        slope += ", scales do not agree"
    line = [np.exp(v) if is_log else v for v, is_log in zip((ends, fit(ends)), logarithmic, strict=True)]
    ax.plot(*line, color=colour, label=f"slope {slope}" if label is None else f"{label}: {slope}")
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


@figure
def generalized_dimensions(result: GeneralizedDimensions, *, ax: Axes | None = None) -> Axes:
    """Draw D_q against q.  :func:`fit` draws the fit of one order, ``result[q]``.

    Parameters
    ----------
    result : GeneralizedDimensions
        Result of :func:`generalized_dimensions`.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes; bars are one standard error.
    """
    ax = axes_or_new(ax, (6.0, 4.0))
    ax.errorbar(result.orders, result.dimensions, result.standard_errors, **_BARS)
    ax.set(xlabel="order q", ylabel="$D_q$")
    return ax


@figure
def kaplan_yorke(result: KaplanYorke, *, ax: Axes | None = None) -> Axes:
    """Draw sums of the largest Lyapunov exponents against their number; the zero of the line is the dimension.

    Parameters
    ----------
    result : KaplanYorke
        Result of :func:`kaplan_yorke_dimension`.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes; bars are one standard error of a sum.
    """
    ax = axes_or_new(ax, (6.0, 4.0))
    sums = np.concatenate([[0.0], np.cumsum(result.exponents)])
    bars = np.concatenate([[0.0], np.sqrt(np.cumsum(result.errors**2))])
    ax.axhline(0.0, color="0.6", linewidth=0.8)
    ax.errorbar(np.arange(len(sums)), sums, np.nan_to_num(bars), **_BARS)
    ax.axvline(result.dimension, color=COLOURS[1], linestyle="--", label=f"dimension {result.dimension:.5g}")
    ax.set(xlabel="number of exponents", ylabel="sum of the largest")
    ax.legend(frameon=False)
    return ax


@figure
def uncertainty_exponent(result: UncertaintyExponent, *, ax: Axes | None = None) -> Axes:
    """Draw the fraction of uncertain pairs against their distance, with the fit and the smallest usable distance.

    Parameters
    ----------
    result : UncertaintyExponent
        Result to draw.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes; without a fit, fractions with their 95 % intervals.

    Examples
    --------
    >>> from cellmap import plot
    >>> import numpy as np
    >>> from cellmap.analysis.fractal import image_uncertainty_exponent
    >>> halves = np.add.outer(np.arange(90), np.arange(90)) > 80
    >>> plot.uncertainty_exponent(image_uncertainty_exponent(halves)).get_ylabel()
    'fraction of uncertain pairs'
    """
    ax = axes_or_new(ax, (6.0, 4.5))
    if result.fit is not None:
        fit(result.fit, ax=ax)
    else:
        low, high = result.intervals.T
        bars = np.maximum([result.fractions - low, high - result.fractions], 0.0)
        ax.errorbar(result.distances, result.fractions, bars, linestyle="none", marker="o", color=COLOURS[0])
        ax.set(xscale="log", xlabel=f"distance ({result.unit})", ylabel="fraction of uncertain pairs")
    ax.axvline(result.floor, color="0.4", linestyle=":")
    ax.set_title(_title(result.name, result.verdict))
    return ax


@figure
def basin_entropy(result: BasinEntropy | FractalTest, *, ax: Axes | None = None) -> Axes:
    """Draw a histogram of the entropies of boxes or discs on a boundary, with the mean and its reference value.

    Parameters
    ----------
    result : BasinEntropy or FractalTest
        Result to draw.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes.

    Examples
    --------
    >>> from cellmap import plot
    >>> import numpy as np
    >>> from cellmap.analysis.fractal import basin_entropy
    >>> halves = np.add.outer(np.arange(90), np.arange(90)) > 80
    >>> plot.basin_entropy(basin_entropy(halves)).get_xlabel()
    'entropy'
    """
    if isinstance(result, BasinEntropy):
        values: Floats = result.boxes[result.boxes > 0.0]
        mean, error, verdict = result.boundary_entropy, result.boundary_error, ""
        reference, meaning = log(2.0), "ln 2"
    else:
        values, verdict = result.entropies, result.verdict
        mean, error = result.entropy, result.standard_error
        reference, meaning = result.smooth, "straight boundary"
    ax = axes_or_new(ax, (6.0, 4.5))
    if len(values):
        ax.hist(values, bins=30, color=COLOURS[0], alpha=0.5)
        ax.axvspan(mean - 2 * error, mean + 2 * error, color=COLOURS[0], alpha=0.3, linewidth=0.0)
        ax.axvline(mean, color=COLOURS[0], label=f"mean {mean:.4g} ± {error:.2g}")
    if isinstance(result, FractalTest):
        ax.axvspan(*result.smooth_range, color="0.5", alpha=0.3, linewidth=0.0)
    ax.axvline(reference, color="black", linestyle="--", label=f"{meaning}: {reference:.4g}")
    counted = "discs" if isinstance(result, FractalTest) else "boxes"
    ax.set(xlabel="entropy", ylabel=counted, title=_title(result.name, verdict))
    ax.legend(frameon=False)
    return ax


@figure
def wada(result: WadaGrid | MergingTest, *, ax: Axes | None = None) -> Axes:
    """Draw the fraction of a boundary by the number of basins around it; for the grid method, at each step.

    Parameters
    ----------
    result : WadaGrid or MergingTest
        Result to draw.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes.

    Examples
    --------
    >>> from cellmap import plot
    >>> import numpy as np
    >>> from cellmap.analysis.fractal import wada_merging
    >>> plot.wada(wada_merging(np.arange(90)[:, None] % 3 + np.zeros((90, 60), int))).get_title()
    'Wada'
    """
    ax = axes_or_new(ax, (6.0, 4.5))
    if isinstance(result, WadaGrid):
        for m in range(2, len(result.basins) + 1):
            colour = COLOURS[m % len(COLOURS)]
            ax.plot(result.fractions[:, m], marker="o", markersize=4, color=colour, label=f"{m} basins")
        ax.set(xlabel="step", ylabel="fraction of boundary boxes")
        ax.legend(frameon=False)
    else:
        numbers = np.arange(1, len(result.sides))
        ax.bar(numbers, result.sides[1:], color=COLOURS[0])
        ax.set(xticks=numbers, xlabel=f"basins within {result.radius:g} cells", ylabel="fraction of the boundary")
    ax.set_title(_title(result.name, result.verdict))
    return ax


def _title(name: str, verdict: str) -> str:
    return ": ".join(part for part in (name, verdict) if part)
