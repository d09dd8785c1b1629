"""Figures of Lyapunov exponents: their convergence, their fields, and tests for chaos, with matplotlib."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap

from .._lib.checks import one_of
from ..orbits.chaos_tests import CHAOTIC, REGULAR, UNDECIDED, ChaosTest
from ..orbits.covariant import CovariantVectors
from ..orbits.exponent_fields import ExponentField
from ..orbits.lyapunov import LyapunovSpectrum
from ._axes import axes_or_new, colour_bar, label_axis
from ._colours import colour_of
from ._draw import figure

_MOST_CURVES = 64
_VERDICT_COLOURS = {CHAOTIC: "#D55E00", REGULAR: "#0072B2", UNDECIDED: "0.5"}


@figure
def exponent_field(
    field: ExponentField,
    *,
    ax: Axes | None = None,
    backward: bool = False,
    per_time: bool = False,
    colours: str = "magma",
) -> Axes:
    """Draw finite-time Lyapunov exponents.

    Parameters
    ----------
    field : ExponentField
        Result of :func:`finite_time_exponents`, on a grid with one axis or two of more than one cell.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    backward : bool, optional
        Draw the exponents of the backward iteration, at the images of the initial conditions, instead of the forward
        ones.
    per_time : bool, optional
        Give exponents per unit of time instead of per step.
    colours : str, optional
        Name of a colour map.

    Returns
    -------
    matplotlib Axes
        The axes; initial conditions whose orbit terminated are white.  Over one axis it is a curve.

    Raises
    ------
    ValueError
        For a grid without one axis or two of more than one cell.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, plot
    >>> from cellmap.orbits import finite_time_exponents
    >>> henon = discrete_map(lambda x, p: (1 - 1.4 * x[0]**2 + x[1], 0.3 * x[0]), {}, ("x", "y"))
    >>> plot.exponent_field(finite_time_exponents(henon, CellGrid((-1, -1), (1, 1), (8, 8)), 4)).get_xlabel()
    '$x$'
    """
    grid = field.grid
    wide = [j for j, n in enumerate(grid.shape) if n > 1]
    if len(wide) not in (1, 2):
        what = f"field of {field.name} on {grid.shape}"
        raise ValueError(f"{what}: a figure needs two axes of more than one cell, or one")
    if not isinstance(colours, Colormap):
        one_of("colours", colours, tuple(colormaps))
    ax = axes_or_new(ax, (7.0, 5.0))
    unit = field.period if per_time else 1.0
    way, measure = "backward" if backward else "forward", f"exponent per {'unit of time' if per_time else 'step'}"
    ax.set_title(f"{field.name}, {field.periods} periods {way}")
    label_axis(ax.xaxis, field.coordinates[wide[0]], grid.upper[wide[0]] - grid.lower[wide[0]])
    if len(wide) == 1:
        values = (field.backward if backward else field.forward).ravel() / unit
        places = field.images.reshape(-1, grid.dimension)[:, wide[0]] if backward else grid.axis(wide[0])
        ax.plot(places, np.where(np.isfinite(values), values, np.nan), marker=".", linestyle="none", markersize=3.0)
        ax.set_ylabel(measure)
        return ax
    drawn: ScalarMappable
    if backward:
        places = field.images.reshape(-1, grid.dimension)[:, wide]
        values = field.backward.ravel() / unit
        known = np.isfinite(values)
        x, y = places[known].T
        drawn = ax.scatter(x, y, c=values[known], s=1.0, linewidths=0.0, cmap=colours, rasterized=True)
    else:
        values = np.where(np.isfinite(field.forward), field.forward / unit, np.nan).squeeze()
        drawn = ax.pcolormesh(*(grid.edges(j) for j in wide), values.T, cmap=colours, rasterized=True)
    label_axis(ax.yaxis, field.coordinates[wide[1]], grid.upper[wide[1]] - grid.lower[wide[1]])
    colour_bar(ax, drawn, measure)
    return ax


@figure
def lyapunov_spectrum(spectrum: LyapunovSpectrum, *, ax: Axes | None = None, per_time: bool = False) -> Axes:
    """Draw the convergence of Lyapunov exponents with the number of periods, for at most 64 orbits.

    Parameters
    ----------
    spectrum : LyapunovSpectrum
        Result of :func:`lyapunov_spectrum`.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    per_time : bool, optional
        Give exponents per unit of time instead of per step.

    Returns
    -------
    matplotlib Axes
        The axes with a curve for each orbit and exponent, and its final value with two standard errors.

    Examples
    --------
    >>> from cellmap import discrete_map, lyapunov_spectrum, plot
    >>> logistic = discrete_map(lambda x, p: (4 * x[0] * (1 - x[0]),), {}, ("x",))
    >>> plot.lyapunov_spectrum(lyapunov_spectrum(logistic, [0.3])).get_xlabel()
    'periods'
    """
    ax = axes_or_new(ax, (7.0, 4.5))
    unit = spectrum.period if per_time else 1.0
    d = spectrum.exponents.shape[-1]
    curves = spectrum.convergence.reshape(len(spectrum.steps), -1, d)[:, :_MOST_CURVES] / unit
    ends = spectrum.exponents.reshape(-1, d)[:_MOST_CURVES] / unit
    errors = spectrum.standard_errors.reshape(-1, d)[:_MOST_CURVES] / unit
    ax.axhline(0.0, color="0.6", linewidth=0.8)
    finite = np.isfinite(curves)
    for j in range(d):
        ax.plot(spectrum.steps, np.where(finite, curves, np.nan)[..., j], color=colour_of(j), linewidth=0.6, alpha=0.7)
        last = np.full(len(ends), spectrum.steps[-1])
        value = np.where(np.isfinite(ends[:, j]), ends[:, j], np.nan)
        style = {"fmt": ".", "markersize": 3, "elinewidth": 0.8, "capsize": 2}
        ax.errorbar(last, value, 2.0 * np.nan_to_num(errors[:, j]), color=colour_of(j), **style)  # type: ignore[arg-type]
    ax.set(xlabel="periods", ylabel=f"exponents per {'unit of time' if per_time else 'step'}", title=spectrum.name)
    return ax


@figure
def covariant_vectors(result: CovariantVectors, *, ax: Axes | None = None, first: int | None = None) -> Axes:
    """Draw a histogram of the angles between expanding and contracting directions.

    Parameters
    ----------
    result : CovariantVectors
        Result of :func:`covariant_vectors`.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    first : int, optional
        Number of leading directions, see :meth:`CovariantVectors.angles`.

    Returns
    -------
    matplotlib Axes
        The axes; with tangencies, the histogram begins at 0.

    Raises
    ------
    TypeError, ValueError
        For another type of result, or without directions on either side.

    Examples
    --------
    >>> from cellmap import plot
    >>> from matplotlib.figure import Figure
    >>> from cellmap import discrete_map
    >>> from cellmap.orbits import covariant_vectors
    >>> henon = discrete_map(lambda x, p: (1 - 1.4 * x[0]**2 + x[1], 0.3 * x[0]), {}, ("x", "y"))
    >>> plot.covariant_vectors(covariant_vectors(henon, [0.1, 0.1], periods=100), ax=Figure().subplots()).get_ylabel()
    'points'
    """
    angles = result.angles(first)
    ax = axes_or_new(ax, (6.0, 4.5))
    ax.hist(angles, bins=np.linspace(0.0, 0.5 * np.pi, 61).tolist(), color=colour_of(0), alpha=0.6)
    ax.axvline(float(angles.min()), color="black", linestyle="--", label=f"smallest: {angles.min():.2g}")
    ax.set(xlabel="angle (rad)", ylabel="points", xlim=(0.0, 0.5 * np.pi), title=result.name)
    ax.legend(fontsize="small", frameon=False)
    return ax


@figure
def chaos_test(test: ChaosTest, *, ax: Axes | None = None) -> Axes:
    """Draw the result of a test for chaos, for at most 64 orbits.

    Parameters
    ----------
    test : ChaosTest
        Result of :func:`exponent_test` or :func:`zero_one_test`.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes with exponents against the number of periods, or the K of all frequencies in increasing order, in the
        colour of the verdict; the limits between which there is none are dashed.

    Examples
    --------
    >>> from cellmap import plot
    >>> from cellmap.orbits import zero_one_test_of_series
    >>> plot.chaos_test(zero_one_test_of_series(np.cos(np.arange(500.0)))).get_ylabel()
    'K'
    """
    ax = axes_or_new(ax, (7.0, 4.5))
    curves = test.evidence.reshape(len(test.at), -1)
    verdicts = test.verdict.ravel()
    for k in range(min(curves.shape[1], _MOST_CURVES)):
        values = np.where(np.isfinite(curves[:, k]), curves[:, k], np.nan)
        ax.plot(test.at, values, color=_VERDICT_COLOURS[str(verdicts[k])], linewidth=0.8)
    for verdict, colour in _VERDICT_COLOURS.items():
        if (verdicts == verdict).any():
            ax.plot([], [], color=colour, label=f"{verdict}: {np.count_nonzero(verdicts == verdict)}")
    for limit in (test.below, test.above):
        ax.axhline(limit, color="0.4", linewidth=0.8, linestyle="--")
    ax.set(xlabel="fraction of the frequencies" if test.quantity == "K" else "periods", ylabel=test.quantity)
    ax.legend(fontsize="small", frameon=False)
    return ax
