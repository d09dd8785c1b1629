"""Axes of coordinates: names, units, multiples of pi, and curves on a circle."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from math import gcd, isclose, pi
from textwrap import fill
from typing import TYPE_CHECKING, Any, TypeVar

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.cm import ScalarMappable
from matplotlib.image import AxesImage
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MultipleLocator
from numpy.typing import NDArray

from .._lib.arrays import Floats
from .._lib.checks import is_sequence, shown, whole_number
from ..basins.by_features import FeatureBasins
from ..basins.record import Basins
from ..bifurcations.period_measures import PeriodMeasure, Quantity
from ..maps.coordinates import Coordinate, turns_of
from ..maps.grid import CellGrid

if TYPE_CHECKING:
    from ..bifurcations.atlas_record import AttractorAtlas
    from ..bifurcations.equilibrium_stability import StabilityMap

One = TypeVar("One")

_GREEK = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi psi "
    "omega Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega"
).split()
_SYMBOL = re.compile(rf"(?P<base>[A-Za-z]|{'|'.join(_GREEK)})_?(?P<index>\d+|(?<=_)\w+)?(?P<dots>'{{0,3}})")


def symbol(name: str) -> str:
    r"""Return the name of a variable as mathematics, where it is a letter with what may stand beside one; else itself.

    Examples
    --------
    >>> symbol("theta'"), symbol("x_12"), symbol("amplitude")
    ('$\\dot{\\theta}$', '$x_{12}$', 'amplitude')
    """
    found = _SYMBOL.fullmatch(name)
    if found is None:
        return name
    letter = f"\\{found['base']}" if found["base"] in _GREEK else found["base"]
    letter = f"\\{'d' * len(found['dots'])}ot{{{letter}}}" if found["dots"] else letter
    index = found["index"] or ""
    words = index if index.isdigit() else rf"\mathrm{{{index}}}".replace("_", r"\_")
    return f"${letter}_{{{words}}}$" if index else f"${letter}$"


def titled(coordinate: Coordinate) -> str:
    """Return the label of the axis of a coordinate: its symbol, and its unit."""
    of, between, name = coordinate.name.rpartition(" of ")
    shown_as = f"{of}{between}{''.join(map(symbol, re.split('( [+-] )', name)))}"
    return _with_unit(shown_as, coordinate.unit)


def parameter_title(name: str, units: Mapping[str, str]) -> str:
    r"""Return the label of the axis of a parameter: its symbol, and its unit where a system declares one.

    Examples
    --------
    >>> parameter_title("omega", {"omega": "rad/s"}), parameter_title("gamma", {"omega": "rad/s"})
    ('$\\omega$ (rad/s)', '$\\gamma$')
    """
    return _with_unit(symbol(name), units.get(name, ""))


def _with_unit(shown_as: str, unit: str) -> str:
    return f"{shown_as} ({unit})" if unit else shown_as


def axes_or_new(ax: Axes | None, size: tuple[float, float] | None = None) -> Axes:
    """Return the given axes, or the axes of a new figure of a size in inches."""
    return plt.subplots(figsize=size, layout="constrained")[1] if ax is None else ax


def plane_of(basins: Basins | FeatureBasins) -> CellGrid:
    """Return the grid of basins that has two axes of more than one cell."""
    if basins.grid is None or sum(n > 1 for n in basins.grid.shape) != 2:
        raise ValueError(f"basins of {basins.name}: a figure needs a grid with two axes of more than one cell")
    return basins.grid


def show_cells(
    ax: Axes, image: NDArray[Any], grid: CellGrid, coordinates: Sequence[Coordinate], **style: Any
) -> AxesImage:
    """Draw values or colours of cells, rows from bottom to top, over the two axes of a grid that have several."""
    across, up = (j for j, n in enumerate(grid.shape) if n > 1)
    name_axes(ax, [coordinates[j] for j in (across, up)], [grid.upper[j] - grid.lower[j] for j in (across, up)])
    extent = (grid.lower[across], grid.upper[across], grid.lower[up], grid.upper[up])
    return ax.imshow(image, origin="lower", extent=extent, aspect="auto", interpolation="nearest", **style)


_LINE = 44  # characters that leave room for bars, and for a second column of a legend
_LINE_BELOW = 24  # characters beneath a bar


def short_name(name: str, number: int, kind: str = "", lines: int = 1) -> str:
    """Return the name of an attractor; with its number, and its first coordinates alone, if it is longer than lines."""
    if len(name) <= lines * _LINE:
        return f"{kind}{name if lines == 1 else fill(name, _LINE)}"
    room = name[: lines * _LINE - len(f"{number}: , ...)")]
    begin = room.rpartition(",")[0] or room
    text = f"{number}: {kind}{begin}, ...{')' if '(' in begin else ''}"
    return text if lines == 1 else fill(text, _LINE)


def name_columns(ax: Axes, names: Iterable[tuple[int, str]]) -> None:
    """Write the names of attractors, with their labels, beneath bars or columns at 0, 1, ...."""
    lines = [fill(short_name(name, label), _LINE_BELOW) for label, name in names]
    ax.set_xticks(range(len(lines)), lines, rotation=20, ha="right", rotation_mode="anchor")


def legend_below(ax: Axes, names: Iterable[tuple[Any, str]], height: float = -0.12) -> None:
    """Name colours below the axes."""
    handles = [Patch(facecolor=colour, edgecolor="0.3", label=name) for colour, name in names]
    style: dict[str, Any] = {"ncols": 2, "fontsize": "small", "frameon": False}
    ax.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, height), **style)


def label_axis(axis: Axis, coordinate: Coordinate, span: float) -> None:
    """Name an axis; write an angle whose turn is 2 pi in multiples of pi, unless it spans too little for them."""
    axis.set_label_text(titled(coordinate))
    if coordinate.period is not None and isclose(coordinate.period, 2 * pi) and span >= pi:
        axis.set_major_locator(MultipleLocator(pi / 2 if span <= 2.01 * pi else pi))
        axis.set_major_formatter(FuncFormatter(lambda x, _: multiple_of_pi(x)))


def name_axes(ax: Axes, coordinates: Sequence[Coordinate], spans: Sequence[float]) -> None:
    """Name the axes by the coordinates along them, which have some spans."""
    for axis, coordinate, span in zip((ax.xaxis, ax.yaxis), coordinates, spans, strict=False):
        label_axis(axis, coordinate, float(span))


def name_plane(ax: Axes, result: AttractorAtlas | StabilityMap) -> None:
    """Name the axes of two parameters, and let them end with their values."""
    name_parameters(ax, result.parameters, result.parameter_units)
    ax.set(xlim=(result.x[0], result.x[-1]), ylim=(result.y[0], result.y[-1]))


def name_parameters(ax: Axes, names: Sequence[str], units: Mapping[str, str]) -> None:
    """Name the axes of two parameters."""
    across, up = (parameter_title(name, units) for name in names)
    ax.set(xlabel=across, ylabel=up)


def colour_bar(ax: Axes, drawn: ScalarMappable, label: str) -> None:
    """Add the colour bar of an image."""
    assert ax.figure is not None
    ax.figure.colorbar(drawn, ax=ax, label=label)


def several_of(
    name: str,
    given: One | Sequence[One],
    kind: type[One],
    words: str,
    same: Callable[[One], object] = type,
    alike: str = "",
) -> tuple[One, ...]:
    """Return an argument that is one record of a kind, or several that have something in common."""
    several = tuple(given) if isinstance(given, Sequence) else (given,)
    if not several or not all(isinstance(one, kind) for one in several):
        raise TypeError(f"{name}={given!r}: give {words}")
    if any(same(one) != same(several[0]) for one in several):
        raise ValueError(f"{name}={given!r}: give {alike}")
    return several


def mark_zeros(ax: Axes, zeros: Iterable[tuple[str, Floats]]) -> None:
    """Mark zeros of functions by stars with their names."""
    for name, place in zeros:
        ax.plot(*place, "*", color="white", markeredgecolor="black", markersize=9.0, zorder=4)
        ax.annotate(name, (float(place[0]), float(place[1])), (5.0, 5.0), textcoords="offset points", fontsize="small")


def measured_axis(coordinates: Sequence[Coordinate], quantity: Quantity, measure: str) -> Coordinate:
    """Return the axis on which a measure of a quantity is drawn."""
    names = [c.name for c in coordinates]
    name = names[quantity] if isinstance(quantity, int) else quantity
    label = name if isinstance(name, str) else getattr(name, "__name__", "quantity").replace("<lambda>", "quantity")
    unit = coordinates[names.index(label)].unit if label in names else ""
    return Coordinate(f"{PeriodMeasure(measure)} of {label}", unit)


def column_of(given: int | str, coordinates: Sequence[Coordinate], argument: str = "coordinate") -> int:
    """Return the number of a coordinate, given by its number or its name."""
    known = [c.name for c in coordinates]
    if isinstance(given, str):
        if given not in known:
            raise ValueError(f"{argument}={given!r}: the coordinates are {known}")
        return known.index(given)
    return whole_number(argument, given, at_most=len(known) - 1)


def pair_of(argument: str, given: tuple[int | str, int | str], coordinates: Sequence[Coordinate]) -> tuple[int, int]:
    """Return the numbers of the coordinates that run across and up."""
    if not is_sequence(given) or len(given) != 2:
        raise TypeError(f"{argument}={shown(given)}: give two coordinates, by numbers or names")
    across, up = (column_of(one, coordinates, argument) for one in given)
    return across, up


def multiple_of_pi(x: float) -> str:
    """Write a number as a fraction of pi, in TeX."""
    ratio = Fraction(x / pi).limit_denominator(24)
    n, d = ratio.numerator, ratio.denominator
    if n == 0:
        return "0"
    assert gcd(n, d) == 1
    sign, count = "-" if n < 0 else "", "" if abs(n) == 1 else str(abs(n))
    return f"${sign}{count}\\pi{'' if d == 1 else f'/{d}'}$"


def cut_at_branch_cuts(curve: Floats, coordinates: Sequence[Coordinate]) -> Floats:
    """Return an unwrapped curve (n, columns) with its angles within their period, interrupted at their branch cuts.

    The curve is straight between its points, two at least.  At each crossing it runs up to the branch cut, a row of NaN
    lifts the pen, and it goes on from the other side.
    """
    lower, turn = turns_of(coordinates)
    angles = np.flatnonzero(turn)
    rounds = (curve[:, angles] - lower[angles]) / turn[angles]
    places = np.unique(np.concatenate([np.arange(len(curve), dtype=float), *map(_crossings, rounds.T)]))
    before, after = np.floor(places).astype(int), np.ceil(places).astype(int)
    points = curve[before] + (places - before)[:, None] * (curve[after] - curve[before])
    whole = np.zeros((len(points) - 1, curve.shape[1]))
    whole[:, angles] = np.floor((0.5 * (points[:-1] + points[1:]) - lower)[:, angles] / turn[angles])
    arriving, leaving = np.vstack([whole[:1], whole]), np.vstack([whole, whole[-1:]])
    rows = np.full((len(points), 3, curve.shape[1]), np.nan)
    rows[:, 0], rows[:, 2] = points - arriving * turn, points - leaving * turn
    kept = np.ones((len(points), 3), bool)
    kept[(arriving == leaving).all(axis=1), 1:] = False
    return rows[kept]


def _crossings(rounds: Floats) -> Floats:
    """Places on a curve, as fractional numbers of its points, at which a coordinate passes through whole numbers."""
    first, last = rounds[:-1], rounds[1:]
    lowest, highest = np.floor(np.minimum(first, last)) + 1, np.ceil(np.maximum(first, last)) - 1
    count = np.where(np.isfinite(first + last), np.maximum(highest - lowest + 1, 0), 0).astype(int)
    piece = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count) + lowest[piece]
    return piece + (number - first[piece]) / (last - first)[piece]
