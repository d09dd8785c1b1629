"""Invariant circles followed over a parameter: rotation numbers, locking, and loss of smoothness."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Floats, Ints
from .._lib.checks import known_parameter, monotone_values, whole_number
from .._lib.records import ConvertsToDataFrame, ConvertsToXarray
from .._lib.signatures import checked
from .._lib.stopping import check_stop
from .._lib.threads import progress_bar
from ..maps.coordinates import Coordinate, difference, state_points, turns_of
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..orbits.invariant_circle import InvariantCircle, fitted_circle, recorded_orbit
from .circle_equations import across_exponent

_SAMPLED = 512  # points of an orbit that tell the extent of an attractor
_NOISE = 1e-13  # Fourier coefficients below this part of the largest are rounding, and below the invariance error


class CircleStatus(StrEnum):
    """Fate of an invariant circle."""

    SMOOTH = "smooth"
    """A Fourier series satisfies the equation of invariance."""
    LOCKED = "locked"
    """The orbit is periodic: on the circle inside a tongue, or no circle at all."""
    BROKEN = "broken"
    """The orbit neither closes nor lies on a smooth curve: the circle has lost its smoothness, or is about to."""
    ESCAPED = "escaped"
    """The orbit has terminated."""


@dataclass(frozen=True, eq=False)
class CircleBranch(ConvertsToXarray, ConvertsToDataFrame):
    """Invariant circles over a parameter.

    Parameters
    ----------
    parameter : str
        Name of the parameter.
    values : ndarray, shape (n,)
        Its values, in the order in which the circle was followed.
    status : tuple of CircleStatus
        What was found at each value.
    rotation : ndarray, shape (n,)
        Rotation number along the curve between 0 and 1: turns in one step, or p/q where the orbit is locked; NaN
        where there is none.
    rotation_errors : ndarray, shape (n,)
        Their errors; 0 where the orbit is locked.
    period : ndarray of int, shape (n,)
        Period of locked orbits; 0 for the others.
    invariance_errors : ndarray, shape (n,)
        Largest distance of images from the curve, in units of its size; NaN without a curve.
    decay : ndarray, shape (n,)
        Rate at which the logarithms of the Fourier coefficients fall with the number of the harmonic: the half-width of
        the strip of complex phases, in radians, on which the curve is analytic.  It tends to zero where smoothness is
        lost.
    circles : tuple of InvariantCircle or None
        The curves, None where there is none.
    coordinates : tuple of Coordinate
        State variables.
    exponents : ndarray, shape (n,)
        Largest Lyapunov exponent per step across the curve, negative where it attracts; NaN without a curve.  In more
        than two dimensions its error is about 1e-5, or 1e-3 where the two largest ones are nearly equal.
    ends : tuple of str
        Reasons why the branch ends at its first and at its last value.
    parameter_units : mapping of str to str
        Units of parameters, as far as the system declares them.
    """

    parameter: str
    values: Floats
    status: tuple[CircleStatus, ...]
    rotation: Floats
    rotation_errors: Floats
    period: Ints
    invariance_errors: Floats
    decay: Floats
    circles: tuple[InvariantCircle | None, ...]
    coordinates: tuple[Coordinate, ...]
    exponents: Floats
    ends: tuple[str, str] = ("first value", "last value")
    parameter_units: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        parts = [f"{self.status.count(s)} {s}" for s in CircleStatus if s in self.status]
        return f"CircleBranch({self.parameter} from {self.values[0]:g} to {self.values[-1]:g}: {', '.join(parts)})"

    @property
    def loss_of_smoothness(self) -> tuple[float, float] | None:
        """Neighbouring values between which a smooth circle becomes broken for the first time; None if none does."""
        for k, (one, other) in enumerate(zip(self.status, self.status[1:], strict=False)):
            if one is not CircleStatus.BROKEN and other is CircleStatus.BROKEN:
                return float(self.values[k]), float(self.values[k + 1])
        return None


@checked
def continue_circle(
    point_map: PointMap,
    parameter: str,
    values: ArrayLike,
    initial_condition: ArrayLike,
    transient: int = 2000,
    progress: bool = False,
) -> CircleBranch:
    """Follow an attracting invariant circle over a parameter, through the intervals where it is locked.

    The orbit at each value begins where that at the value before has ended.  After the transient, its rotation number
    follows from weighted Birkhoff averages, and its points give a Fourier series of the curve, which has to satisfy the
    equation of invariance (Das et al. 2017).

    Parameters
    ----------
    point_map : PointMap
        The map; for an interpolated map, its exact map is used.
    parameter : str
        Name of the parameter.
    values : array_like, shape (n,)
        Its values, increasing or decreasing, in its unit.
    initial_condition : array_like, shape (dimension,)
        Initial condition at the first value.
    transient : int, optional
        Steps of the map at each value before the orbit is taken.
    progress : bool, optional
        Show progress on a terminal.

    Returns
    -------
    CircleBranch
        Rotation numbers, curves, and where they are lost.

    Raises
    ------
    ValueError
        For an unknown parameter, or values that are not monotone.

    References
    ----------
    Das, Saiki, Sander, Yorke, Nonlinearity 30 (2017) 4111; Aronson, Chory, Hall, McGehee, Communications in
    Mathematical Physics 83 (1982) 303 (loss of smoothness, delayed logistic map).

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> delayed = discrete_map(lambda x, p: (p.a * x[0] * (1 - x[1]), x[0]), {"a": 2.0}, ("x", "y"))
    >>> continue_circle(delayed, "a", np.linspace(2.02, 2.1, 5), [0.5, 0.4])
    CircleBranch(a from 2.02 to 2.1: 5 smooth)
    """
    exact = point_map.without_table
    known_parameter("parameter", parameter, exact.params)
    axis = monotone_values("values", values)
    states = state_points("initial_condition", initial_condition, exact.coordinates)
    if states.ndim != 1:
        raise ValueError(f"initial_condition has shape {states.shape}: give one state")
    steps = whole_number("transient", transient, at_least=1)
    found: list[tuple[CircleStatus, InvariantCircle | None, int, float]] = []
    label = f"invariant circle over {parameter}" if progress else None
    with progress_bar(axis.size, label) as tick:
        for value in axis.tolist():
            check_stop()
            here = exact.with_params(**{parameter: value})
            orbits = Orbits.starting(states[None].copy())
            here.advance(orbits, steps)
            found.append(_looked_at(here, orbits, steps))
            if found[-1][0] is not CircleStatus.ESCAPED:
                states = orbits.points[0]
            tick(1)
    return circle_branch(exact, parameter, axis, found)


def circle_branch(
    exact: PointMap,
    parameter: str,
    values: Floats,
    found: Sequence[tuple[CircleStatus, InvariantCircle | None, int, float]],
    ends: tuple[str, str] = ("first value", "last value"),
) -> CircleBranch:
    """Return the record of what orbits are on at values (n,), the circles, the periods and the rotation numbers."""
    status, circles, periods, rotation = zip(*found, strict=True)
    errors, invariance, decay, exponents = np.full((4, len(values)), np.nan)
    for k, (circle, value) in enumerate(zip(circles, values.tolist(), strict=True)):
        if circle is not None:
            errors[k], invariance[k], decay[k] = circle.frequency_error, circle.invariance_error, _decay_of(circle)
            exponents[k] = across_exponent(exact.with_params(**{parameter: value}), circle)
        elif periods[k]:
            errors[k] = 0.0
    return CircleBranch(
        parameter, values, status, np.array(rotation), errors, np.array(periods, np.int64), invariance, decay, circles,
        exact.coordinates, exponents, ends, exact.parameter_units,
    )  # fmt: skip


def _looked_at(here: PointMap, orbits: Orbits, age: int) -> tuple[CircleStatus, InvariantCircle | None, int, float]:
    """Return what an orbit is on, the circle, the period and the rotation number."""
    if not orbits.alive.all():
        return CircleStatus.ESCAPED, None, 0, np.nan
    history = recorded_orbit(here, orbits, _SAMPLED)[0]
    if not orbits.alive.all():
        return CircleStatus.ESCAPED, None, 0, np.nan
    turn = turns_of(here.coordinates)[1]
    extent = np.where(turn > 0.0, turn, np.maximum(np.ptp(history, axis=0), 1e-12))
    fitted, period = fitted_circle(here, orbits.points[0], extent, age)
    if fitted is not None:
        return CircleStatus.SMOOTH, fitted.circle, 0, fitted.circle.frequency
    if period:
        history, rotations = recorded_orbit(here, Orbits.starting(orbits.points.copy()), period + 1)
        return CircleStatus.LOCKED, None, period, _locked_rotation(history, rotations, here.coordinates)
    return CircleStatus.BROKEN, None, 0, np.nan


def _locked_rotation(history: Floats, rotations: Ints, coordinates: Sequence[Coordinate]) -> float:
    """Return p/q for the q points of a periodic orbit, with the first one again at the end: the turns around it."""
    period = len(history) - 1
    turn = turns_of(coordinates)[1]
    if turn.any():
        j = int(np.argmax(turn > 0.0))
        moved = history[-1, j] - history[0, j] + (rotations[-1, j] - rotations[0, j]) * turn[j]
        return float(round(moved / turn[j]) % period / period)
    if period == 1 or len(coordinates) < 2:
        return 0.0
    shift = difference(history[:-1], history[:-1].mean(axis=0), coordinates)
    order = np.argsort(np.arctan2(shift[:, 1], shift[:, 0]))
    rank = np.empty(period, np.int64)
    rank[order] = np.arange(period)
    return float((rank[1] - rank[0]) % period / period)


def _decay_of(circle: InvariantCircle) -> float:
    """Return the rate at which Fourier coefficients fall, from the least-squares line through their logarithms."""
    sizes = np.abs(circle.coefficients).max(axis=(0, 1))
    middle = len(sizes) // 2
    both = np.maximum(sizes[middle + 1 :], sizes[:middle][::-1])
    envelope = np.maximum.accumulate(both[::-1])[::-1]
    used = np.flatnonzero(envelope > max(_NOISE, 10.0 * circle.invariance_error) * envelope[0])
    last = int(used[-1]) + 1 if len(used) else 0
    if last < 3:
        return np.inf
    slope = np.polyfit(np.arange(1, last + 1), np.log(envelope[:last]), 1)[0]
    return float(-slope)


def circle_columns(branch: CircleBranch) -> dict[str, Any]:
    """Return the columns of a table."""
    return {
        branch.parameter: branch.values,
        "status": [str(s) for s in branch.status],
        "rotation": branch.rotation,
        "rotation_error": branch.rotation_errors,
        "period": branch.period,
        "invariance_error": branch.invariance_errors,
        "decay": branch.decay,
        "exponent": branch.exponents,
    }
