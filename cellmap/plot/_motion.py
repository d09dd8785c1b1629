"""Figures of motions: time series and phase portraits, with periodic angles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from .._lib.arrays import Floats
from .._lib.checks import is_sequence, label, listed, shown
from .._lib.signatures import checked
from ..maps.coordinates import Coordinate, wrap
from ..maps.trajectories import Trajectory
from ._axes import cut_at_branch_cuts, label_axis, name_axes, pair_of, symbol
from ._colours import colour_of
from ._draw import figure

_TIME = Coordinate("t")


@figure
def time_series(
    trajectory: Trajectory,
    *,
    names: str | Sequence[str] | None = None,
    ax: Axes | Sequence[Axes] | None = None,
    labels: Sequence[str] | None = None,
    stroboscopic: bool = True,
) -> tuple[Axes, ...]:
    """Draw state variables, or outputs, against time.

    Parameters
    ----------
    trajectory : Trajectory
        One orbit or many; each has its colour.
    names : str or sequence of str, optional
        Coordinates and outputs of the system, a panel for each component; by default all coordinates.
    ax : matplotlib Axes or sequence of them, optional
        Axes to draw on, one for each panel; by default those of a new figure.
    labels : sequence of str, optional
        Names of the orbits, for a legend.
    stroboscopic : bool, optional
        Mark the points of the stroboscopic map.

    Returns
    -------
    tuple of matplotlib Axes
        The panels.  Angles are drawn within one period, with a gap where they cross the branch cut.

    Raises
    ------
    TypeError, ValueError
        For names that the system does not have, or a wrong number of axes or labels.

    Examples
    --------
    >>> from math import pi
    >>> from cellmap import ForcedSystem, plot, trajectory
    >>> oscillator = ForcedSystem(lambda t, x, p: (x[1], -x[0]), {}, 2 * pi, ("q", "v"))
    >>> [panel.get_ylabel() for panel in plot.time_series(trajectory(oscillator, [1.0, 0.0], periods=3))]
    ['$q$', '$v$']
    """
    _check(trajectory, labels)
    series = _series(trajectory, names)
    if ax is None:
        _, grid = plt.subplots(
            len(series), figsize=(7.0, 1.0 + 1.7 * len(series)), sharex=True, squeeze=False, layout="constrained"
        )
        panels = tuple(grid[:, 0])
        panels[0].set_title(trajectory.system.name)
    else:
        panels = (ax,) if isinstance(ax, Axes) else tuple(ax)
        if len(panels) != len(series):
            raise ValueError(f"ax has {len(panels)} panels: give {len(series)}, one for each component")
    for panel, (coordinate, values) in zip(panels, series, strict=True):
        times = np.broadcast_to(trajectory.times[:, None], values.shape)
        _draw(panel, trajectory, (_TIME, coordinate), (times, values), labels, stroboscopic)
        low, high = panel.get_ylim()
        label_axis(panel.yaxis, coordinate, high - low)
        panel.set_xlim(trajectory.times[0], trajectory.times[-1])
    panels[-1].set_xlabel(symbol("t"))
    if labels is not None:
        panels[0].legend(fontsize="small")
    return panels


@checked
def phase_portrait(
    trajectory: Trajectory,
    *,
    coordinates: tuple[int | str, int | str] = (0, 1),
    ax: Axes | None = None,
    labels: Sequence[str] | None = None,
    stroboscopic: bool = True,
) -> Axes:
    """Draw one state variable against another.

    Parameters
    ----------
    trajectory : Trajectory
        One orbit or many; each has its colour.
    coordinates : tuple, optional
        Coordinates on the horizontal and the vertical axis, by number or name.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.
    labels : sequence of str, optional
        Names of the orbits, for a legend.
    stroboscopic : bool, optional
        Mark the points of the stroboscopic map.

    Returns
    -------
    matplotlib Axes
        The axes.  The axis of an angle covers one period; a curve that crosses the branch cut continues at the other
        side.

    Raises
    ------
    TypeError, ValueError
        For coordinates that the system does not have, or a wrong number of labels.

    Examples
    --------
    >>> from math import pi
    >>> from cellmap import ForcedSystem, plot, trajectory
    >>> oscillator = ForcedSystem(lambda t, x, p: (x[1], -x[0]), {}, 2 * pi, ("q", "v"))
    >>> plot.phase_portrait(trajectory(oscillator, [1.0, 0.0], periods=1), coordinates=("q", "v")).get_ylabel()
    '$v$'
    """
    _check(trajectory, labels)
    columns = pair_of("coordinates", coordinates, trajectory.system.axes)
    if ax is None:
        _, ax = plt.subplots(figsize=(6.0, 5.0), layout="constrained")
        ax.set_title(trajectory.system.name)
    pair = tuple(trajectory.system.axes[j] for j in columns)
    states = _flat(trajectory.states)
    _draw(ax, trajectory, pair, tuple(states[..., j] for j in columns), labels, stroboscopic)
    name_axes(ax, pair, [c.period or 0.0 for c in pair])
    for c, name in zip(pair, ("xlim", "ylim"), strict=True):
        if c.lower is not None and c.period is not None:
            ax.set(**{name: (c.lower, c.lower + c.period)})
    if labels is not None:
        ax.legend(fontsize="small")
    return ax


def _check(trajectory: Trajectory, labels: Sequence[str] | None) -> None:
    if labels is None:
        return
    own = is_sequence(labels) and all(isinstance(one, str) for one in labels)
    if not own or len(labels) != trajectory.status.size:
        raise ValueError(f"labels={shown(labels)}: give {trajectory.status.size} names in a list, one for each orbit")
    for k, one in enumerate(labels):
        label(f"labels[{k}]", one)


def _flat(values: Floats) -> Floats:
    """Put all orbits on one axis, shape (n, orbits, components)."""
    return values.reshape(len(values), -1, values.shape[-1])


def _series(trajectory: Trajectory, names: str | Sequence[str] | None) -> list[tuple[Coordinate, Floats]]:
    """Look up components by name: labels, and values of shape (n, orbits)."""
    system = trajectory.system
    known = [c.name for c in system.axes]
    wanted = known if names is None else (names,) if isinstance(names, str) else listed("names", names)
    if not wanted or not all(isinstance(name, str) for name in wanted):
        raise ValueError(f"names={shown(names)}: name at least one coordinate or output")
    series = []
    for name in wanted:
        if name in known:
            j = known.index(name)
            series.append((system.axes[j], _flat(trajectory.states)[..., j]))
        elif name in system.outputs:
            values = _flat(trajectory.output(name))
            for i in range(values.shape[-1]):
                title = name if values.shape[-1] == 1 else f"{name}[{i}]"
                series.append((Coordinate(title), values[..., i]))
        else:
            raise ValueError(
                f"names has {name!r}: the coordinates of {system.name} are {known} and its outputs "
                f"{sorted(system.outputs) or 'none'}"
            )
    return series


def _draw(
    ax: Axes,
    trajectory: Trajectory,
    pair: Sequence[Coordinate],
    values: Sequence[Floats],
    labels: Sequence[str] | None,
    strobe: bool,
) -> None:
    """Draw the curves of all orbits, each with its stroboscopic points on top."""
    points: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 4, "markeredgecolor": "black"}
    for k in range(values[0].shape[1]):
        curve = np.stack([v[:, k] for v in values], axis=-1)
        colour = colour_of(k)
        ax.plot(*cut_at_branch_cuts(curve, pair).T, color=colour, linewidth=1.0, label=labels[k] if labels else None)
        if strobe:
            marks = wrap(curve[:: trajectory.samples], pair)
            ax.plot(*marks.T, color=colour, markeredgewidth=0.5, zorder=3, clip_on=False, **points)
