"""Figures of connecting orbits, invariant circles and Arnold tongues over parameters, with matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from .._lib.checks import one_of
from ..bifurcations.circle_branches import CircleBranch, CircleStatus
from ..bifurcations.connecting_branches import ConnectionBranch
from ..bifurcations.tongues import ArnoldTongue
from ..maps.coordinates import difference
from ._axes import (
    axes_or_new,
    colour_bar,
    cut_at_branch_cuts,
    name_axes,
    name_parameters,
    pair_of,
    parameter_title,
    several_of,
)
from ._colours import colour_of
from ._draw import figure

_STATUS_STYLES: dict[CircleStatus, Any] = {
    CircleStatus.SMOOTH: {"marker": "o", "color": "#0072B2", "markersize": 3.0},
    CircleStatus.LOCKED: {"marker": "s", "color": "#E69F00", "markersize": 4.0},
    CircleStatus.BROKEN: {"marker": "x", "color": "#990A00", "markersize": 4.0},
}
_PHASES = 512  # phases of a curve that are drawn


@figure
def connections(
    branches: ConnectionBranch | Sequence[ConnectionBranch], *, ax: Axes | None = None, legend: bool = True
) -> Axes:
    """Draw branches of connecting orbits: the angle at which the manifolds cross against the parameter.

    Parameters
    ----------
    branches : ConnectionBranch or sequence of ConnectionBranch
        One or several over the same parameter, as :func:`continue_connection` returns them.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    legend : bool, optional
        Name the marks of tangencies, if there are any.

    Returns
    -------
    matplotlib Axes
        The axes.  A branch turns back at a tangency, where the angle is 0.

    Raises
    ------
    TypeError, ValueError
        For something that is not such a branch, or branches over different parameters.

    Examples
    --------
    >>> from cellmap import discrete_map, periodic_orbit, plot
    >>> from cellmap.bifurcations import connecting_orbits, continue_connection
    >>> henon = discrete_map(lambda x, p: (p.a - x[0]**2 + p.b * x[1], x[0]), {"a": 1.4, "b": -0.3}, ("x", "y"))
    >>> orbit = connecting_orbits(henon, periodic_orbit(henon, [-2.0, -2.0]), max_steps=20)[0]
    >>> ax = plot.connections(continue_connection(orbit, "a", 1.2, 1.5))
    >>> ax.get_ylabel()
    'angle between the manifolds (rad)'
    """
    words = "a ConnectionBranch, or several, as continue_connection returns them"
    alike = "branches over one parameter"
    several = several_of("branches", branches, ConnectionBranch, words, lambda b: b.parameter, alike)
    ax = axes_or_new(ax)
    ax.axhline(0.0, color="0.7", linewidth=0.8)
    for number, branch in enumerate(several):
        ax.plot(branch.values, branch.angles, color=colour_of(number), linewidth=1.2)
    touching = [t.value for b in several for t in b.tangencies]
    if touching:
        ax.plot(touching, np.zeros(len(touching)), "o", color="black", markersize=4.0, label="tangency")
        if legend:
            ax.legend(fontsize="small", frameon=False)
    ax.set(
        xlabel=parameter_title(several[0].parameter, several[0].parameter_units),
        ylabel="angle between the manifolds (rad)",
    )
    return ax


@figure
def invariant_circles(
    branch: CircleBranch,
    *,
    show: str = "rotation",
    coordinates: tuple[int | str, int | str] = (0, 1),
    ax: Axes | None = None,
    legend: bool = True,
) -> Axes:
    """Draw invariant circles over a parameter: their rotation numbers, how smooth they are, or the curves.

    Parameters
    ----------
    branch : CircleBranch
        Result of :func:`continue_circle` or :func:`switch_circle`.
    show : {"rotation", "decay", "circles"}, optional
        Rotation numbers against the parameter, with marks for smooth, locked and broken, hollow ones where circles
        repel; the rate at which Fourier coefficients decay; or the curves in a plane, coloured by the parameter.
    coordinates : tuple of int or str, optional
        Coordinates of that plane, by number or name.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    legend : bool, optional
        Name the marks; a colour bar for curves.

    Returns
    -------
    matplotlib Axes
        The axes.  At a broken circle, which has no rotation number, a mark is at the lower edge.

    Raises
    ------
    TypeError, ValueError
        For another `show`, or coordinates that the map does not have.

    Examples
    --------
    >>> import numpy as np
    >>> from cellmap import discrete_map, plot
    >>> from cellmap.bifurcations import continue_circle
    >>> delayed = discrete_map(lambda x, p: (p.a * x[0] * (1 - x[1]), x[0]), {"a": 2.0}, ("x", "y"))
    >>> circles = continue_circle(delayed, "a", np.linspace(2.02, 2.2, 7), [0.5, 0.4])
    >>> ax = plot.invariant_circles(circles)
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['smooth', 'locked']
    """
    kind = one_of("show", show, ("rotation", "decay", "circles"))
    plane = pair_of("coordinates", coordinates, branch.coordinates) if kind == "circles" else (0, 0)
    ax = axes_or_new(ax)
    if kind == "circles":
        _draw_curves(ax, branch, plane, legend)
        return ax
    heights = branch.rotation if kind == "rotation" else branch.decay
    repelling = branch.exponents > 0.0
    if repelling.any():
        hollow = _STATUS_STYLES[CircleStatus.SMOOTH] | {"fillstyle": "none", "linestyle": "none"}
        ax.plot(branch.values[repelling], heights[repelling], label="repelling", **hollow)
    for status, style in _STATUS_STYLES.items():
        chosen = np.array([s is status for s in branch.status]) & ~repelling
        if status is CircleStatus.BROKEN:
            ax.plot(
                branch.values[chosen], np.zeros(chosen.sum()), linestyle="none", label=str(status),
                transform=ax.get_xaxis_transform(), clip_on=False, **style,
            )  # fmt: skip
        else:
            chosen &= np.isfinite(heights)
            ax.plot(branch.values[chosen], heights[chosen], linestyle="none", label=str(status), **style)
        if not chosen.any():
            ax.lines[-1].remove()
    words = {"rotation": "rotation number", "decay": "decay of Fourier coefficients"}
    ax.set(xlabel=parameter_title(branch.parameter, branch.parameter_units), ylabel=words[kind])
    if legend and len(ax.lines):
        ax.legend(fontsize="small", frameon=False)
    return ax


def _draw_curves(ax: Axes, branch: CircleBranch, plane: tuple[int, int], legend: bool) -> None:
    """Draw the curves of a branch in a plane of two coordinates."""
    axes = branch.coordinates[plane[0]], branch.coordinates[plane[1]]
    scale = ScalarMappable(Normalize(float(branch.values.min()), float(branch.values.max())), "viridis")
    phases, spans = np.linspace(0.0, 1.0, _PHASES + 1), np.zeros(2)
    for value, circle in zip(branch.values.tolist(), branch.circles, strict=True):
        for wrapped in () if circle is None else circle.points(phases, branch.coordinates)[..., list(plane)]:
            steps = np.cumsum(difference(wrapped[1:], wrapped[:-1], axes), axis=0)
            curve = np.vstack([wrapped[:1], wrapped[0] + steps])
            ax.plot(*cut_at_branch_cuts(curve, axes).T, color=scale.to_rgba(value), linewidth=1.0)
            spans = np.maximum(spans, np.ptp(curve, axis=0))
    name_axes(ax, axes, spans.tolist())
    if legend:
        colour_bar(ax, scale, parameter_title(branch.parameter, branch.parameter_units))


@figure
def arnold_tongues(
    tongues: ArnoldTongue | Sequence[ArnoldTongue], *, ax: Axes | None = None, legend: bool = True
) -> Axes:
    """Draw Arnold tongues in the plane of their two parameters.

    Parameters
    ----------
    tongues : ArnoldTongue or sequence of ArnoldTongue
        One or several over the same parameters, as :func:`arnold_tongue` returns them.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    legend : bool, optional
        Name the tongues by their rotation numbers.

    Returns
    -------
    matplotlib Axes
        The axes, with the tongues filled between their borders.

    Raises
    ------
    TypeError, ValueError
        For something that is not a tongue, or tongues over different parameters.

    Examples
    --------
    >>> from math import pi, sin
    >>> from cellmap import angle, discrete_map, plot
    >>> from cellmap.bifurcations import arnold_tongue
    >>> circle = discrete_map(
    ...     lambda x, p: (x[0] + p.omega - p.k / (2 * pi) * sin(2 * pi * x[0]),),
    ...     {"omega": 0.5, "k": 0.8},
    ...     (angle("x", "", 1.0, 0.0),),
    ... )
    >>> tongue = arnold_tongue(circle, 1, 2, ("omega", "k"), (0.4, 0.6), (0.4, 1.0), [0.1])
    >>> [text.get_text() for text in plot.arnold_tongues(tongue).get_legend().get_texts()]
    ['1/2']
    """
    words = "an ArnoldTongue, or several, as arnold_tongue returns them"
    alike = "tongues over the same two parameters, in the same order"
    several = several_of("tongues", tongues, ArnoldTongue, words, lambda t: t.left.parameters, alike)
    names = several[0].left.parameters
    ax = axes_or_new(ax)
    for number, tongue in enumerate(several):
        # Both borders upwards in the second parameter, so that they enclose the tongue one behind the other.
        left, right = (v if v[0, 1] <= v[-1, 1] else v[::-1] for v in (tongue.left.values, tongue.right.values))
        colour, name = colour_of(number), f"{tongue.rotations}/{tongue.period}"
        ax.fill(*np.concatenate([left, right[::-1]]).T, color=colour, alpha=0.3, linewidth=0.0, label=name)
        for border in (left, right):
            ax.plot(*border.T, color=colour, linewidth=1.0)
    name_parameters(ax, names, several[0].left.point_map.parameter_units)
    if legend:
        ax.legend(fontsize="small", frameon=False)
    return ax
