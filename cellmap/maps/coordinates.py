"""Coordinates of a phase space: names, units, and which of them are angles."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan, pi, prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._compiled.kernels.blocks import MOST_TURNS
from .._lib.arrays import Floats
from .._lib.checks import finite_points, label, listed, real_number, shown, warn_caller
from .._lib.signatures import checked


@dataclass(frozen=True)
class Coordinate:
    """One state variable.

    Parameters
    ----------
    name : str
        Name on axes and in files.
    unit : str, optional
        Unit, such as ``"rad/s"``; empty for a pure number.
    period : float or None, optional
        Period of an angle, in `unit`; None for a variable on the line.
    lower : float or None, optional
        Branch cut of an angle: values are wrapped into ``[lower, lower + period)``.  Default ``-period/2``.

    Examples
    --------
    >>> Coordinate("theta", "rad", period=2 * pi).lower
    -3.141592653589793
    """

    name: str
    unit: str = ""
    period: float | None = None
    lower: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ValueError(f"name={shown(self.name)}: a coordinate needs a name, such as 'theta'")
        if not isinstance(self.unit, str):
            raise TypeError(f"unit={shown(self.unit)}: give a unit, such as 'rad', or '' for a pure number")
        label("name", self.name)
        label("unit", self.unit)
        if self.period is None:
            if self.lower is not None:
                raise ValueError(f"lower={self.lower!r}: only an angle has a branch cut; give period= as well")
            return
        turn = real_number("period", self.period)
        if not 0.0 < turn < inf:
            raise ValueError(f"period={self.period!r}: the period of an angle is a positive number, such as 2*pi")
        if self.unit.lower().rstrip("s") in {"deg", "degree", "°"} and turn == 2 * pi:
            raise ValueError(f"unit={self.unit!r}: an angle in degrees has period=360, and 2 pi in 'rad'")
        lower = -0.5 * turn if self.lower is None else real_number("lower", self.lower)
        if not isfinite(lower):
            raise ValueError(f"lower={self.lower!r}: the branch cut of an angle is a finite number")
        object.__setattr__(self, "period", turn)
        object.__setattr__(self, "lower", lower)

    @property
    def is_angle(self) -> bool:
        """Whether the variable is an angle."""
        return self.period is not None

    def __str__(self) -> str:
        return f"{self.name} ({self.unit})" if self.unit else self.name


@checked
def angle(name: str, unit: str = "rad", period: float = 2 * pi, lower: float | None = None) -> Coordinate:
    """Return the coordinate of an angle.

    Parameters
    ----------
    name, unit : str
        Name and unit.
    period : float, optional
        Period of the angle in that unit.
    lower : float, optional
        Branch cut, by default ``-period/2``.

    Returns
    -------
    Coordinate
        An angle that is wrapped into ``[lower, lower + period)``.

    Examples
    --------
    >>> angle("theta").is_angle
    True
    """
    return Coordinate(name, unit, period, lower)


def as_coordinates(given: Iterable[str | Coordinate]) -> tuple[Coordinate, ...]:
    """Turn names and coordinates into coordinates, all of different names."""
    if isinstance(given, str | Coordinate):
        given = (given,)
    if not isinstance(given, Iterable):
        raise TypeError(f"coordinates={shown(given)}: give the names of the state variables, such as ('q', 'v')")
    given = listed("coordinates", given)
    if not all(isinstance(c, Coordinate) or (isinstance(c, str) and c) for c in given):
        raise TypeError(f"coordinates={shown(given)}: give a name or a Coordinate for each state variable")
    coordinates = tuple(c if isinstance(c, Coordinate) else Coordinate(c) for c in given)
    names = [c.name for c in coordinates]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"coordinates={names!r}: one different name for each state variable is needed")
    return coordinates


def turns_of(coordinates: Sequence[Coordinate]) -> tuple[Floats, Floats]:
    """Return branch cuts and periods of all coordinates as arrays; the period 0 marks a variable on the line."""
    lower = np.array([c.lower if c.lower is not None else -inf for c in coordinates])
    turn = np.array([c.period or 0.0 for c in coordinates])
    return lower, turn


def state_points(name: str, points: ArrayLike, coordinates: Sequence[Coordinate], some: bool = False) -> Floats:
    """Return states as a new C-contiguous array of shape (..., dimension), all finite, and each angle with a phase.

    Where there have to be `some`, none are an error.
    """
    states = finite_points(name, points, len(coordinates))
    if some and not states.size:
        raise ValueError(f"{name} is empty: give at least one initial condition")
    for j, c in enumerate(coordinates):
        if c.period is None or not states.size:
            continue
        angles, most = states[..., j], MOST_TURNS * c.period
        if angles.min() <= -most or angles.max() >= most:
            far = np.argwhere(np.abs(angles) >= most)[0]
            raise ValueError(
                f"{name}{[*map(int, far), j]}={angles[tuple(far)]}: at {MOST_TURNS:.0e} periods of {c.period:g} and "
                "beyond an angle has no phase in double precision; give it within a few periods of 0"
            )
    return states


def check_no_window(name: str, given: Any, dimension: int) -> None:
    """Say of tuples (low, high), one for each state variable, that they are states and no window, and of axes no grid.

    Raises
    ------
    ValueError
        Where they cannot be states, for these have as many numbers as there are state variables; for one axis, those
        of all state variables, or the coordinates that NumPy's meshgrid makes of them.

    Warns
    -----
    UserWarning
        In two dimensions, where they are states.
    """
    _check_no_axes(name, given, dimension)
    pairs = given if isinstance(given, list | tuple) and len(given) == dimension else ()
    if not pairs or not all(isinstance(pair, tuple) and len(pair) == 2 for pair in pairs):
        return
    if not all(isinstance(v, int | float) for pair in pairs for v in pair) or not all(a < b for a, b in pairs):
        return
    comma = "," if dimension == 1 else ""
    lower, upper = (f"({', '.join(map(repr, side))}{comma})" for side in zip(*pairs, strict=True))
    window = f"for a window give CellGrid({lower}, {upper}, shape)"
    if dimension != 2:
        raise ValueError(f"{name}={shown(given)}: states have length {dimension}, and these pairs 2; {window}")
    warn_caller(f"{name}={shown(given)} are two states; {window}, for states {[[*pair] for pair in pairs]}")


def _check_no_axes(name: str, given: Any, dimension: int) -> None:
    """Refuse values along one axis, or along each, in the place of states."""
    axes = _axes_of(given, dimension)
    if not axes:
        return
    known = [axis if _is_of_three(axis) else (axis[0], axis[-1], len(axis)) for axis in axes]
    more, which, last = "", "the coordinates of a grid", ""
    if len(axes) < dimension:
        more, which, last = ", ...", "values along one axis", f", of {dimension} entries each"
    elif dimension == 1:
        more = ","
    corners = [f"({', '.join(f'{value:.6g}' for value in column)}{more})" for column in zip(*known, strict=True)]
    raise ValueError(
        f"{name}={shown(given)}: these are {which}, and states have length {dimension}; give "
        f"CellGrid({', '.join(corners)}), corners and numbers of cells{last}, or states of shape (..., {dimension})"
    )


def _axes_of(given: Any, dimension: int) -> list[Floats]:
    """Return rising values along one axis, or along each, where they are given, also by NumPy's meshgrid."""
    if not isinstance(given, list | tuple | range | np.ndarray):
        return []
    try:
        whole = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        whole = None  # rows of different lengths
    if whole is not None and (whole.ndim == 0 or whole.shape[-1] == dimension):
        return []
    try:
        parts = [np.asarray(part, dtype=float) for part in given] if len(given) == dimension else []
        if whole is not None and whole.ndim == 1:
            axes = [whole]
        elif all(part.ndim == 1 for part in parts):
            axes = parts
        else:
            axes = [np.unique(part) for part in parts]
            if prod(np.broadcast_shapes(*(part.shape for part in parts))) != prod(map(len, axes)):
                return []
    except (TypeError, ValueError):
        return []
    rise = all(len(axis) > 0 and (np.diff(axis) > 0.0).all() for axis in axes)
    whole_number = all(axis[2] % 1.0 == 0.0 for axis in axes if _is_of_three(axis))
    return axes if rise and whole_number and max(map(len, axes), default=0) > 2 else []


def _is_of_three(axis: Floats) -> bool:
    """Tell whether an axis has three numbers, unevenly spaced: its ends and its number of cells."""
    return len(axis) == 3 and not np.isclose(*np.diff(axis))


def in_turn(values: Floats, lower: Floats | float, turn: Floats | float) -> Floats:
    """Return numbers in the period that begins at an edge, NaN where they have no phase; 0 stands for the line.

    A number that is there stays as it is.
    """
    circle = _is_circle(turn)
    upper, around = lower + turn, turn if circle else np.where(np.greater(turn, 0.0), turn, inf)
    with np.errstate(invalid="ignore"):
        whole = np.floor((values - lower) / around)
        turned = np.maximum(values - np.where(np.abs(whole) < MOST_TURNS, whole, nan) * turn, lower)
        stays = (values >= lower) & (values < upper)
        if not circle:
            stays |= np.less_equal(turn, 0.0)
    return np.asarray(np.where(stays, values, np.where(turned >= upper, lower, turned)))


def shortest(differences: Floats, turn: Floats | float) -> Floats:
    """Return differences, on circles the shorter way round; a period of 0 stands for the line."""
    around = turn if _is_circle(turn) else np.where(np.greater(turn, 0.0), turn, 1.0)
    with np.errstate(invalid="ignore"):
        whole = turn * np.round(differences / around)
    return np.asarray(differences - (whole if around is turn else np.where(np.greater(turn, 0.0), whole, 0.0)))


def _is_circle(turn: Floats | float) -> bool:
    """Tell whether there is one circle, of which a single number needs no look at each coordinate."""
    return isinstance(turn, float) and turn > 0.0


def wrap(points: Floats, coordinates: Sequence[Coordinate]) -> Floats:
    """Return points (..., dimension) with every angle wrapped; NaN where it is too large to have a phase."""
    wrapped = np.array(points, dtype=float)
    for columns, lower, period in _circles(tuple(coordinates)):
        if lower is not None:
            wrapped[..., columns] = in_turn(wrapped[..., columns], lower, period)
    return wrapped


def difference(a: Floats, b: Floats, coordinates: Sequence[Coordinate]) -> Floats:
    """Return a - b, along angles the shorter way round."""
    d = np.asarray(a, dtype=float) - np.asarray(b, dtype=float)
    for columns, _, period in _circles(tuple(coordinates)):
        d[..., columns] = shortest(d[..., columns], period)
    return d


@functools.lru_cache(maxsize=256)
def _circles(coordinates: tuple[Coordinate, ...]) -> tuple[tuple[slice, float | None, float], ...]:
    """Return angles one beside the other on equal circles as slices, with where these are cut and their periods."""
    found, begin = [], 0
    for (lower, period), group in itertools.groupby(coordinates, lambda c: (c.lower, c.period)):
        end = begin + len(list(group))
        if period is not None:
            found.append((slice(begin, end), lower, period))
        begin = end
    return tuple(found)


def circular_tree(
    places: Floats, unit: Floats, coordinates: Sequence[Coordinate]
) -> tuple[Any, Callable[[Floats], Floats]]:
    """Return a k-d tree of places in units of length, angles as circles, and what scales points for queries to it."""
    from scipy.spatial import cKDTree

    cut, turn = turns_of(coordinates)
    around = turn / unit

    def scaled(points: Floats) -> Floats:
        x = (wrap(points, coordinates) - np.where(turn > 0.0, cut, 0.0)) / unit
        return np.asarray(np.where((turn > 0.0) & (x >= around), 0.0, x))  # the tree takes no end of a circle

    return cKDTree(scaled(places), boxsize=around), scaled
