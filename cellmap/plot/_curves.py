"""Figures of bifurcation curves and of atlases over two parameters, with matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from .._lib.checks import one_of, whole_number
from ..bifurcations.atlas_record import AttractorAtlas
from ..bifurcations.bifurcation_curve import BifurcationCurve
from ..bifurcations.connecting_branches import TangencyCurve
from ..bifurcations.kinds import BifurcationKind, CodimensionTwoKind
from ._axes import axes_or_new, colour_bar, mark_zeros, name_parameters, name_plane, several_of
from ._colours import COLOURS, colour_of
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
    words, alike = "a BifurcationCurve, or several", "curves over the same two parameters, in the same order"
    several = several_of("curves", curves, BifurcationCurve, words, lambda c: c.parameters, alike)
    names = several[0].parameters
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
    name_parameters(ax, names, several[0].point_map.parameter_units)
    if legend:
        look = [Line2D([], [], linestyle="none", marker="o", color="black", markersize=4.0) for _ in named]
        labels = [*handles, *(f"{short}: {word}" for short, word in named.items())]
        ax.legend([*handles.values(), *look], labels, fontsize="small", frameon=False)
    return ax


CURVE_STYLES: dict[str, Any] = {
    BifurcationKind.FOLD: "-",
    BifurcationKind.PERIOD_DOUBLING: "--",
    BifurcationKind.PITCHFORK: "-.",
    BifurcationKind.NEIMARK_SACKER: ":",
}
"""Line style of each kind of bifurcation."""


@figure
def attractor_atlas(
    atlas: AttractorAtlas,
    *,
    show: str | int = "classes",
    ax: Axes | None = None,
    most_classes: int = 9,
    curves: bool = True,
    extra_curves: Sequence[BifurcationCurve | TangencyCurve] = (),
    legend: bool = True,
) -> Axes:
    """Draw an atlas of attractors over its two parameters, with the bifurcation curves.

    Parameters
    ----------
    atlas : AttractorAtlas
        Result of :func:`attractor_atlas`.
    show : {"classes", "number"} or int, optional
        What the colours mean: which attractors coexist, named by their periods; how many; or, for the number of a
        family, the fraction of initial conditions that converge to it.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    most_classes : int, optional
        Classes with a colour of their own, the most frequent ones; the others are grey.
    curves : bool, optional
        Draw the bifurcation curves of the atlas.
    extra_curves : sequence of BifurcationCurve or TangencyCurve, optional
        Further curves over the same two parameters; those of tangencies are red.
    legend : bool, optional
        Name the classes and the kinds of bifurcations; a colour bar for other images.

    Returns
    -------
    matplotlib Axes
        The axes.

    Raises
    ------
    ValueError
        For another `show`, a family that the atlas does not have, or curves over other parameters.

    Examples
    --------
    >>> import numpy as np
    >>> from cellmap import discrete_map, plot
    >>> from cellmap.bifurcations import attractor_atlas
    >>> henon = discrete_map(lambda x, p: (1 - p.a * x[0]**2 + x[1], p.b * x[0]), {"a": 0.2, "b": 0.3}, ("x", "y"))
    >>> axes = ("a", np.linspace(0.0, 0.7, 21)), ("b", np.linspace(0.1, 0.4, 11))
    >>> ax = plot.attractor_atlas(attractor_atlas(henon, *axes, [[0.0, 0.0]]))
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['1', '2', 'period doubling']
    """
    if isinstance(show, str):
        one_of("show", show, ("classes", "number"))
    else:
        whole_number("show", show, at_most=len(atlas.families) - 1)
    ax = axes_or_new(ax)
    handles: list[Any] = []
    shading: dict[str, Any] = {"shading": "nearest", "rasterized": True}
    if show == "classes":
        number, names = atlas.classes
        most = min(whole_number("most_classes", most_classes, at_least=1), len(names))
        colours: list[Any] = [*(colour_of(k) for k in range(most)), "0.8"]
        image = np.minimum(number, most)
        ax.pcolormesh(atlas.x, atlas.y, image, cmap=ListedColormap(colours), vmin=-0.5, vmax=most + 0.5, **shading)
        handles += [Patch(facecolor=colours[k], label=names[k]) for k in range(most)]
        if most < len(names):
            handles.append(Patch(facecolor="0.8", label=f"{len(names) - most} others"))
    else:
        values = atlas.number if show == "number" else atlas.fraction(int(show))
        mesh = ax.pcolormesh(atlas.x, atlas.y, values, cmap="viridis", **shading)
        if legend:
            name = "attractors" if show == "number" else f"fraction of {atlas.families[int(show)].name}"
            colour_bar(ax, mesh, name)
    drawn: dict[str, Line2D] = {}
    for curve in (*(atlas.curves if curves else ()), *extra_curves):
        if set(curve.parameters) != set(atlas.parameters):
            raise ValueError(f"extra_curves holds {curve!r}: give curves over {' and '.join(atlas.parameters)}")
        across, up = (curve.values[:, curve.parameters.index(name)] for name in atlas.parameters)
        if isinstance(curve, TangencyCurve):
            name, colour, style = "tangency", "#990A00", "-"
        else:
            name, colour, style = str(curve.kind), "black", CURVE_STYLES.get(curve.kind, "-")
        (drawn[name],) = ax.plot(across, up, color=colour, linewidth=1.0, linestyle=style)
    handles += [
        Line2D([], [], color=line.get_color(), linestyle=line.get_linestyle(), label=name)
        for name, line in drawn.items()
    ]
    name_plane(ax, atlas)
    if legend and handles:
        ax.legend(handles=handles, fontsize="small")
    return ax
