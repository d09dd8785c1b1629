"""The figure of a plan: predicted errors and times of its options."""

from __future__ import annotations

from matplotlib.axes import Axes

from ..basins.planning.plans import Plan
from ..basins.planning.predictions import Option
from ._axes import axes_or_new
from ._draw import figure


@figure
def plan(plan: Plan, *, ax: Axes | None = None) -> Axes:
    """Draw the predicted error against the predicted time of all options of a plan, and mark the chosen one.

    Parameters
    ----------
    plan : Plan
        From :func:`plan`.
    ax : matplotlib Axes, optional
        Axes to draw on; by default those of a new figure.

    Returns
    -------
    matplotlib Axes
        The axes: one line for each integration method and for each order of interpolation, from fast and inaccurate to
        slow and accurate, with hollow markers where memory does not suffice, the requested accuracy and the chosen
        option.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, plan, plot
    >>> exact = discrete_map(lambda x, p: (x[0] / 2 + x[0] ** 3 / 9,), {}, ("x",))
    >>> plot.plan(plan(exact, CellGrid((-1,), (1,), (50,)), accuracy=1e-3)).get_xscale()
    'log'
    """
    ax = axes_or_new(ax, (7.0, 5.0))
    families: dict[str, list[Option]] = {}
    for option in plan.options:
        families.setdefault(option.family, []).append(option)
    for number, (family, members) in enumerate(families.items()):
        marker = "s" if members[0].kind == "direct" else "o"
        colour = f"C{number}"
        possible = [o for o in members if not o.obstacle]
        closed = [o for o in members if o.obstacle]
        name = family if members[0].kind == "direct" else f"interpolated map of {family}"
        ax.plot(*_costs(possible), marker + "-", color=colour, markersize=4, linewidth=1.0, label=name)
        ax.plot(*_costs(closed), marker, color=colour, markersize=4, markerfacecolor="none")
    chosen = plan.chosen
    ax.plot(*_costs([chosen]), "*", color="black", markersize=14, zorder=3, label=f"chosen: {chosen}")
    ax.axhline(plan.accuracy, color="0.5", linestyle="--", linewidth=1.0, label=f"requested: {plan.accuracy:.1e}")
    ax.set(xscale="log", yscale="log", xlabel="predicted time (s)")
    ax.set_ylabel("predicted error of one period (99th percentile)")
    ax.legend(fontsize="small")
    ax.set_title(f"{plan.job.reference.name}: {plan.measurements.initial_conditions:,} initial conditions")
    return ax


def _costs(options: list[Option]) -> tuple[list[float], list[float]]:
    return [o.seconds for o in options], [max(o.error, 1e-18) for o in options]
