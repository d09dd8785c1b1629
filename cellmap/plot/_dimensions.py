"""Figures of generalized and Kaplan-Yorke dimensions, with matplotlib."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ..analysis.fractal.generalized import GeneralizedDimensions, KaplanYorke
from ._axes import axes_or_new
from ._colours import COLOURS
from ._draw import figure


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
    ax.errorbar(
        result.orders, result.dimensions, result.standard_errors, color=COLOURS[0], marker="o", markersize=4, capsize=2
    )
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
    ax.errorbar(np.arange(len(sums)), sums, np.nan_to_num(bars), color=COLOURS[0], marker="o", markersize=4, capsize=2)
    ax.axvline(result.dimension, color=COLOURS[1], linestyle="--", label=f"dimension {result.dimension:.5g}")
    ax.set(xlabel="number of exponents", ylabel="sum of the largest")
    ax.legend(frameon=False)
    return ax
