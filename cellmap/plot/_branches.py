"""Figures of branches of periodic orbits, with matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from .._lib.arrays import Bools, Floats
from ..bifurcations.branch import Bifurcation, Branch
from ..bifurcations.function_zeros import FunctionZero
from ..bifurcations.kinds import BifurcationKind
from ..bifurcations.period_measures import Quantity, measured
from ..maps.coordinates import Coordinate, difference, in_turn
from ..maps.parameters_as_states import swept_map
from ._axes import (
    axes_or_new,
    column_of,
    cut_at_branch_cuts,
    label_axis,
    mark_zeros,
    measured_axis,
    parameter_title,
    several_of,
)
from ._colours import colour_of, one_colour
from ._draw import figure

MARKERS = {
    BifurcationKind.FOLD: "s",
    BifurcationKind.PERIOD_DOUBLING: "o",
    BifurcationKind.PITCHFORK: "D",
    BifurcationKind.TRANSCRITICAL: "X",
    BifurcationKind.NEIMARK_SACKER: "^",
}
"""Marker of each kind of bifurcation."""

_STABLE, _UNSTABLE = "-", "--"
_REACH = 0.06  # within which a branch begins beside the bifurcation that it leaves, scaled


@figure
def branches(
    branches: Branch | Sequence[Branch],
    *,
    coordinate: Quantity = 0,
    ax: Axes | None = None,
    all_points: bool = True,
    measure: str | None = None,
    colour: Any = None,
    legend: bool = True,
) -> Axes:
    """Draw branches of periodic orbits against their parameter, with bifurcations.

    Parameters
    ----------
    branches : Branch or sequence of Branch
        One or several branches over one parameter, such as the results of :func:`continue_orbit` and
        :func:`switch_branch`, or the branches of a :class:`Cascade`.
    coordinate : int, str or callable, optional
        Number or name of the coordinate that is drawn; with a measure also one of the outputs of the system, or a
        function ``f(t, x, p)``.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    all_points : bool, optional
        Draw all points of each orbit, for which the map is iterated; otherwise only the first one, which a branch
        stores.
    measure : {"maximum", "minimum", "amplitude", "mean", "norm"}, optional
        Draw this measure over the period of the orbit, as resonance curves do, instead of points of the map; see
        :meth:`Branch.measure`.
    colour : colour, optional
        Colour of all branches; by default each has its own.
    legend : bool, optional
        Name the lines and the kinds of bifurcations that occur.

    Returns
    -------
    matplotlib Axes
        The axes.  Stable parts are solid, unstable ones dashed; they end at the bifurcations between them, and begin at
        the one from which they bifurcate if that is on another of the branches.  Zeros of functions are stars with
        their names.  An angle is drawn within one period,
        and curves are interrupted at the branch cut.

    Raises
    ------
    TypeError, ValueError
        For something that is not a branch, branches over different parameters or of different coordinates, or a
        coordinate that they do not have.

    Examples
    --------
    >>> from cellmap import discrete_map, periodic_orbit, plot
    >>> from cellmap.bifurcations import period_doubling_cascade
    >>> logistic = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 2.8}, ("x",))
    >>> cascade = period_doubling_cascade(logistic, periodic_orbit(logistic, [0.5]), "r", 4.0, doublings=3)
    >>> ax = plot.branches(cascade.branches)
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('$r$', '$x$')
    """
    wanted, alike = "a Branch, or several, as continue_orbit returns them", "branches over one parameter of one system"
    several = several_of("branches", branches, Branch, wanted, lambda b: (b.parameter, b.point_map.coordinates), alike)
    name, coordinates = several[0].parameter, several[0].point_map.coordinates
    ax = axes_or_new(ax)
    if measure is None:
        column = column_of(coordinate, coordinates)  # type: ignore[arg-type]
        traces = [_Trace.of(branch, _birth(branch, several), column, all_points) for branch in several]
        shown_as = coordinates[column]
    else:
        traces = [_Trace.measured(branch, _birth(branch, several), coordinate, measure) for branch in several]
        shown_as = traces[0].axes[1]
    kinds: set[BifurcationKind] = set()
    styles: set[str] = set()
    for number, trace in enumerate(traces):
        own = one_colour(colour, colour_of(number))
        for style, stable in ((_STABLE, True), (_UNSTABLE, False)):
            line = trace.pieces(stable)
            if len(line):
                ax.plot(*line.T, style, color=own, linewidth=1.2)
                styles.add(style)
        for kind in MARKERS:
            marks = trace.marks(kind)
            if len(marks):
                ax.plot(*marks.T, MARKERS[kind], color=own, markeredgecolor="black", markersize=5.0, zorder=3)
                kinds.add(kind)
        for zero in (z for z in trace.kinds if isinstance(z, FunctionZero)):
            mark_zeros(ax, [(zero.name, place) for place in trace.marks(zero)])
    label_axis(ax.yaxis, shown_as, max(trace.span for trace in traces))
    ax.set_xlabel(parameter_title(name, several[0].point_map.parameter_units))
    if legend:
        words: dict[Any, str] = {_STABLE: "stable", _UNSTABLE: "unstable"}
        handles = [Line2D([], [], color="0.3", linestyle=s, label=w) for s, w in words.items() if s in styles]
        look: dict[str, Any] = {"linestyle": "none", "color": "0.7", "markeredgecolor": "black"}
        handles += [Line2D([], [], marker=m, label=str(k), **look) for k, m in MARKERS.items() if k in kinds]
        ax.legend(handles=handles, fontsize="small", frameon=False)
    return ax


@dataclass(frozen=True, eq=False)
class _Trace:
    """Curves of a branch over its parameter: one for each point of an orbit, through bifurcations.

    ``curves`` has the shape (points of an orbit, n, 2), its angles unwrapped; ``stable`` (n - 1) tells of the pieces
    between its points, and ``kinds`` (n) what happens at them, if anything does.
    """

    curves: Floats
    stable: Bools
    kinds: list[BifurcationKind | FunctionZero | None]
    axes: tuple[Coordinate, Coordinate]

    @classmethod
    def of(cls, branch: Branch, birth: Bifurcation | None, column: int, every_point: bool) -> _Trace:
        """Return the curves of a coordinate of the points of orbits."""
        values, states, stable, kinds = _places(branch, birth)
        axes = (Coordinate(branch.parameter), branch.point_map.coordinates[column])
        heights = _orbits(branch, values, states, branch.period if every_point else 1)[..., column]
        curves = np.stack([np.broadcast_to(values, heights.shape), _unwrapped(heights, axes[1])], axis=-1)
        return cls(curves, stable, kinds, axes)

    @classmethod
    def measured(cls, branch: Branch, birth: Bifurcation | None, quantity: Quantity, measure: str) -> _Trace:
        """Return the curve of a measure over the period."""
        values, states, stable, kinds = _places(branch, birth)
        exact = branch.point_map
        heights = measured(exact, (branch.parameter,), values[:, None], states, branch.period, quantity, measure)
        axes = Coordinate(branch.parameter), measured_axis(exact.coordinates, quantity, measure)
        return cls(np.stack([values, heights], axis=-1)[None], stable, kinds, axes)

    @property
    def span(self) -> float:
        """How far the points are apart at most, along the axis on which they are drawn."""
        turn = self.axes[1].period
        span = float(np.ptp(self.curves[..., 1]))
        return span if turn is None else min(span, turn)

    def pieces(self, stable: bool) -> Floats:
        """Return the stable or the unstable pieces (m, 2), with rows of NaN where the pen is lifted."""
        chosen = np.flatnonzero(self.stable == stable)
        runs = np.split(chosen, np.flatnonzero(np.diff(chosen) > 1) + 1) if len(chosen) else []
        gap = np.full((1, 2), np.nan)
        rows = [
            part
            for curve in self.curves
            for run in runs
            for part in (cut_at_branch_cuts(curve[run[0] : run[-1] + 2], self.axes), gap)
        ]
        return np.concatenate(rows[:-1]) if rows else np.empty((0, 2))

    def marks(self, kind: BifurcationKind | FunctionZero) -> Floats:
        """Return the places (m, 2) of bifurcations of one kind, or of a zero."""
        here = [k for k, other in enumerate(self.kinds) if other is kind]
        places = self.curves[:, here].reshape(-1, 2).copy()
        axis = self.axes[1]
        if axis.period is not None and axis.lower is not None:
            places[:, 1] = in_turn(places[:, 1], axis.lower, axis.period)
        return places


def _places(
    branch: Branch, birth: Bifurcation | None
) -> tuple[Floats, Floats, Bools, list[BifurcationKind | FunctionZero | None]]:
    """Return the parameter (n,), states (n, d), and the bifurcations and zeros (n) there, from its birth on.

    Also whether the pieces (n - 1) between them are stable.
    """
    values: list[float] = [] if birth is None else [birth.value]
    states: list[Floats] = [] if birth is None else [birth.point]
    counts: list[int] = [] if birth is None else [int(branch.unstable[0])]
    kinds: list[BifurcationKind | FunctionZero | None] = [] if birth is None else [None]
    special = branch.special_points
    for k, count in enumerate(branch.unstable.tolist()):
        values.append(float(branch.values[k]))
        states.append(branch.points[k])
        kinds.append(None)
        here = [b for b in special if b.place == k]
        found = [b for b in here if isinstance(b, Bifurcation)]
        # What is between two bifurcations, or beside one, is known from them; elsewhere both ends have to agree.
        last = k + 1 == len(branch.values)
        ahead = count if last else max(count, int(branch.unstable[k + 1]), key=abs)
        counts.append(found[0].before if found else ahead)
        for point in here:
            values.append(point.value)
            states.append(point.point)
            kinds.append(point.kind if isinstance(point, Bifurcation) else point)
            counts.append(point.after if isinstance(point, Bifurcation) else counts[-1])
    return np.array(values), np.array(states), np.array(counts[:-1]) == 0, kinds


def _birth(branch: Branch, others: Sequence[Branch]) -> Bifurcation | None:
    """Return the bifurcation that a branch leaves, if it is on one of the others."""
    if branch.ends[0] != "bifurcation":
        return None
    nearest, distance = None, _REACH
    for other in others:
        for bifurcation in other.bifurcations:
            rounds = 2 if bifurcation.kind is BifurcationKind.PERIOD_DOUBLING else 1
            shift = difference(branch.points[0], bifurcation.point, branch.point_map.coordinates)
            scale = branch._parts[0].problem.scale
            apart = np.append(shift / scale[: len(shift)], (branch.values[0] - bifurcation.value) / scale[-1])
            away = float(np.linalg.norm(apart))
            if other is not branch and rounds * other.period == branch.period and away < distance:
                nearest, distance = bifurcation, away
    return nearest


def _orbits(branch: Branch, values: Floats, states: Floats, points: int) -> Floats:
    """Return the first points of orbits (points, n, dimension), each orbit at its own value of the parameter."""
    orbits = [states]
    if points > 1:
        swept = swept_map(branch.point_map, branch.parameter)
        place = np.column_stack([states, values])
        for _ in range(points - 1):
            place = swept(place)
            orbits.append(place[:, :-1])
    return np.stack(orbits)


def _unwrapped(heights: Floats, axis: Coordinate) -> Floats:
    """Return curves (m, n) without the jumps of an angle: each point follows the one before on the shorter way."""
    if not axis.is_angle:
        return heights
    steps = difference(heights[:, 1:, None], heights[:, :-1, None], (axis,))[..., 0]
    return np.concatenate([heights[:, :1], heights[:, :1] + np.cumsum(steps, axis=1)], axis=1)
