"""Figures of measures of basin boundaries, with matplotlib."""

from __future__ import annotations

from math import log

import numpy as np
from matplotlib.axes import Axes

from .._lib.arrays import Floats
from ..analysis.fractal.entropy import BasinEntropy
from ..analysis.fractal.randomness_test import FractalTest
from ..analysis.fractal.uncertainty_fits import UncertaintyExponent
from ..analysis.fractal.wada import MergingTest
from ..analysis.fractal.wada_search import WadaGrid
from ._axes import axes_or_new
from ._colours import COLOURS
from ._draw import figure
from ._fits import fit as draw_fit


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
        draw_fit(result.fit, ax=ax)
    else:
        low, high = result.intervals.T
        bars = np.maximum([result.fractions - low, high - result.fractions], 0.0)
        ax.errorbar(result.distances, result.fractions, bars, linestyle="none", marker="o", color=COLOURS[0])
        ax.set_xscale("log")
        ax.set_xlabel(f"distance ({result.unit})")
        ax.set_ylabel("fraction of uncertain pairs")
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
    elif isinstance(result, FractalTest):
        values, verdict = result.entropies, result.verdict
        mean, error = result.entropy, result.standard_error
        reference, meaning = result.smooth, "straight boundary"
    else:
        raise TypeError(f"result={result!r}: give a BasinEntropy or a FractalTest")
    ax = axes_or_new(ax, (6.0, 4.5))
    if len(values):
        ax.hist(values, bins=30, color=COLOURS[0], alpha=0.5)
        ax.axvspan(mean - 2 * error, mean + 2 * error, color=COLOURS[0], alpha=0.3, linewidth=0.0)
        ax.axvline(mean, color=COLOURS[0], label=f"mean {mean:.4g} ± {error:.2g}")
    if isinstance(result, FractalTest):
        ax.axvspan(*result.smooth_range, color="0.5", alpha=0.3, linewidth=0.0)
    ax.axvline(reference, color="black", linestyle="--", label=f"{meaning}: {reference:.4g}")
    ax.set_xlabel("entropy")
    ax.set_ylabel("discs" if isinstance(result, FractalTest) else "boxes")
    ax.set_title(_title(result.name, verdict))
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
        ax.set_xlabel("step")
        ax.set_ylabel("fraction of boundary boxes")
        ax.legend(frameon=False)
    else:
        numbers = np.arange(1, len(result.sides))
        ax.bar(numbers, result.sides[1:], color=COLOURS[0])
        ax.set_xticks(numbers)
        ax.set_xlabel(f"basins within {result.radius:g} cells")
        ax.set_ylabel("fraction of the boundary")
    ax.set_title(_title(result.name, result.verdict))
    return ax


def _title(name: str, verdict: str) -> str:
    return ": ".join(part for part in (name, verdict) if part)
