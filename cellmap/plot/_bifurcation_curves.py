"""Figures of curves of bifurcations over two parameters, with matplotlib."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..bifurcations.bifurcation_curve import BifurcationCurve
from ..bifurcations.kinds import BifurcationKind, CodimensionTwoKind
from ._axes import axes_or_new, mark_zeros
from ._colours import COLOURS
from ._draw import figure

KIND_COLOURS = dict(zip(BifurcationKind, COLOURS, strict=False))
"""Colour of each kind of bifurcation."""

SHORT_NAMES = {
    CodimensionTwoKind.CUSP: "cusp",
    CodimensionTwoKind.GENERALISED_FLIP: "GF",
    CodimensionTwoKind.DEGENERATE_PITCHFORK: "DP",
    CodimensionTwoKind.CHENCINER: "CH",
    CodimensionTwoKind.RESONANCE_1_1: "1:1",
    CodimensionTwoKind.RESONANCE_1_2: "1:2",
    CodimensionTwoKind.RESONANCE_1_3: "1:3",
    CodimensionTwoKind.RESONANCE_1_4: "1:4",
    CodimensionTwoKind.FOLD_FLIP: "FF",
    CodimensionTwoKind.FOLD_NEIMARK_SACKER: "FN",
    CodimensionTwoKind.FLIP_NEIMARK_SACKER: "PN",
    CodimensionTwoKind.DOUBLE_NEIMARK_SACKER: "NN",
}
"""How points of codimension two are named beside their markers."""


@figure
def bifurcation_curves(
    curves: BifurcationCurve | Sequence[BifurcationCurve],
    *,
    ax: Axes | None = None,
    codimension_two: bool = True,
    legend: bool = True,
) -> Axes:
    """Draw curves of bifurcations in the plane of their two parameters, with the points of codimension two.

    Parameters
    ----------
    curves : BifurcationCurve or sequence of BifurcationCurve
        One or several curves over the same parameters, as :func:`continue_bifurcation` and :func:`switch_curve`
        return them.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    codimension_two : bool, optional
        Mark the points of codimension two, which are computed if they have not been asked for yet.
    legend : bool, optional
        Name the kinds of bifurcations and of points of codimension two that occur.

    Returns
    -------
    matplotlib Axes
        The axes.  Curves of orbits of more than one period are dashed; zeros of functions are stars with their names.

    Raises
    ------
    TypeError, ValueError
        For something that is not a curve, or curves over different parameters.

    Examples
    --------
    >>> from cellmap import continue_orbit, discrete_map, periodic_orbit, plot
    >>> from cellmap.bifurcations import continue_bifurcation
    >>> henon = discrete_map(lambda x, p: (1 - p.a * x[0]**2 + x[1], p.b * x[0]), {"a": 0.2, "b": 0.3}, ("x", "y"))
    >>> branch = continue_orbit(henon, periodic_orbit(henon, [0.5, 0.2]), "a", 0.0, 1.4)
    >>> doublings = continue_bifurcation(branch, branch.bifurcations[0], "b", (0.0, 4.0), (-1.5, 0.9))
    >>> ax = plot.bifurcation_curves(doublings)
    >>> [t.get_text() for t in ax.texts]
    ['1:2']
    """
    several = tuple(curves) if isinstance(curves, Sequence) else (curves,)
    if not several or not all(isinstance(c, BifurcationCurve) for c in several):
        raise TypeError(f"curves={curves!r}: give a BifurcationCurve, or several")
    names = several[0].parameters
    if any(c.parameters != names for c in several):
        raise ValueError(f"curves={curves!r}: give curves over the same two parameters, in the same order")
    ax = axes_or_new(ax)
    least = min(c.period for c in several)
    handles: dict[str, Line2D] = {}
    for curve in several:
        style = "-" if curve.period == least else "--"
        words = str(curve.kind) + (f", period {curve.period}" if curve.period > 1 else "")
        colour = KIND_COLOURS[curve.kind] if isinstance(curve.kind, BifurcationKind) else "0.3"
        (handles[words],) = ax.plot(*curve.values.T, style, color=colour, linewidth=1.4)
        mark_zeros(ax, [(z.name, z.values) for z in curve.zeros])
    named: dict[str, str] = {}
    for point in (p for c in several for p in c.codimension_two()) if codimension_two else ():
        ax.plot(*point.values, "o", color="black", markersize=4.0, zorder=3)
        short = SHORT_NAMES[point.kind]
        place = (float(point.values[0]), float(point.values[1]))
        if not any(t.get_text() == short and t.xy == place for t in ax.texts):  # type: ignore[attr-defined]
            ax.annotate(short, place, (4.0, 4.0), textcoords="offset points", fontsize="small")
        if short != str(point.kind) and ":" not in short:
            named[short] = str(point.kind)
    ax.set_xlabel(names[0])
    ax.set_ylabel(names[1])
    if legend:
        look = [Line2D([], [], linestyle="none", marker="o", color="black", markersize=4.0) for _ in named]
        labels = [*handles, *(f"{short}: {word}" for short, word in named.items())]
        ax.legend([*handles.values(), *look], labels, fontsize="small", frameon=False)
    return ax
