"""Figures of the fractions of many attractors: sorted bars in the place of images, with matplotlib."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from .._lib.checks import whole_number
from .._lib.signatures import checked
from ..basins.by_features import FeatureBasins
from ..basins.record import Basins
from ..basins.symmetries import SymmetricGroups
from ._axes import axes_or_new, short_name
from ._colours import label_colour
from ._draw import figure


class _Bar(NamedTuple):
    fraction: float
    error: float
    name: str
    colour: Any


@checked
def fractions(basins: Basins | FeatureBasins, *, largest: int = 20, ax: Axes | None = None) -> Axes:
    """Draw the fractions of basins as bars, the largest first, for many attractors or many dimensions.

    Parameters
    ----------
    basins : Basins or FeatureBasins
        Basins of any initial conditions.
    largest : int, optional
        Number of attractors with a bar of their own; all with smaller fractions are summed up in one more.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes with a bar and its standard error for each attractor, then for each other label that occurs.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins, plot
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))
    >>> ax = plot.fractions(find_basins(cubic, CellGrid((-1.5,), (1.0,), (60,))), largest=1)
    >>> [text.get_text() for text in ax.get_yticklabels()]
    ['fixed point (-1)', '1 smaller']
    """
    bars = {
        k: _Bar(f.fraction, f.standard_error, short_name(basins.label_name(k), k), label_colour(k))
        for k, f in basins.fractions.items()
    }
    own, others = ([bar for k, bar in bars.items() if (k < 0) is other] for other in (False, True))
    return _drawn(own, others, largest, basins.labels.size, ax)


@figure
def symmetric_groups(groups: SymmetricGroups, *, largest: int = 20, ax: Axes | None = None) -> Axes:
    """Draw the fractions of groups of symmetric attractors as bars, the largest first.

    Parameters
    ----------
    groups : SymmetricGroups
        Result of :func:`symmetric_groups`.
    largest : int, optional
        Number of groups with a bar of their own; all with smaller fractions are summed up in one more.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes with a bar and its standard error for each group.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins, plot
    >>> from cellmap.basins import symmetric_groups
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))
    >>> basins = find_basins(cubic, CellGrid((-1.5,), (1.0,), (60,)))
    >>> [text.get_text() for text in plot.symmetric_groups(symmetric_groups(basins)).get_yticklabels()]
    ['2 like fixed point (1)']
    """
    rows = zip(groups.fractions, groups.standard_errors, groups.names, groups.sizes, strict=True)
    bars = [
        _Bar(float(f), float(error), short_name(name, k, "" if size == 1 else f"{size} like "), label_colour(0))
        for k, (f, error, name, size) in enumerate(rows)
    ]
    return _drawn(bars, [], largest, groups.n_initial_conditions, ax)


def _drawn(own: list[_Bar], others: list[_Bar], largest: int, total: int, ax: Axes | None) -> Axes:
    shown = whole_number("largest", largest, at_least=1)
    bars = sorted(own, key=lambda bar: -bar.fraction)
    if len(bars) > shown:
        rest = min(1.0, sum(bar.fraction for bar in bars[shown:]))
        error = float(np.sqrt(rest * (1.0 - rest) / total))
        bars[shown:] = [_Bar(rest, error, f"{len(bars) - shown} smaller", "0.6")]
    bars += others
    ax = axes_or_new(ax, (6.0, 1.0 + 0.25 * len(bars)))
    errors = [bar.error for bar in bars]
    ax.barh(range(len(bars)), [b.fraction for b in bars], xerr=errors, color=[b.colour for b in bars], ecolor="0.2")
    ax.set_yticks(range(len(bars)), [bar.name for bar in bars], fontsize="small")
    ax.invert_yaxis()
    ax.set(xlabel="fraction of initial conditions", xlim=(0.0, None))
    return ax
