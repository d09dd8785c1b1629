"""Bifurcation diagrams: attractors against a parameter, with Lyapunov exponents."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.arrays import Bools, Floats, Ints
from .._lib.checks import (
    claim_memory,
    finite_number,
    finite_points,
    known_parameter,
    monotone_values,
    one_of,
    real_array,
    shown,
    whole_number,
)
from .._lib.records import Array, ConvertsToDataFrame, ConvertsToXarray, Keyed, Layout
from .._lib.signatures import checked
from ..maps.coordinates import Coordinate, difference, state_points, turns_of, wrap
from ..maps.orbit_batch import Status
from ..maps.parameters_as_states import swept_map
from ..maps.point_map import PointMap, warn_of_tolerance
from ..orbits.lyapunov_qr import exponents_along, exponents_of_cycles, is_positive, swept_derivatives
from .parameter_sweep import Recorded, record_each, record_followed
from .period_measures import Quantity, measured, measured_along

_UNSETTLED = 10.0  # extrapolation falls short by a factor 6 at a period doubling, where returns shrink as k^(-3/2)
_FEWEST = 20
_GOLDEN = 0.6180339887498949  # golden ratio: its multiples, less whole numbers, differ most from one another
_DIRECTIONS = {"up": ("up",), "down": ("down",), "both": ("up", "down"), "none": ("none",)}


@dataclass(frozen=True, eq=False)
class BifurcationDiagram(ConvertsToXarray, ConvertsToDataFrame):
    """Bifurcation diagram: sampled orbits against a parameter.

    A branch is one initial condition followed in one direction: all of them upwards, then all downwards.

    Parameters
    ----------
    system, parameter : str
        Name of the system and of its parameter.
    values : ndarray, shape (n,)
        Parameter values, increasing, in its unit.
    directions : tuple of str
        Direction of each branch: ``"up"``, ``"down"`` or ``"none"``.
    initial_conditions : ndarray, shape (branches, dimension)
        Given initial condition of each branch.
    points : ndarray, shape (branches, n, periods, dimension)
        Orbits after the transient, angles within their period; NaN where `status` is ESCAPED or DIVERGED.
    status : ndarray of uint8, shape (branches, n)
        A :class:`Status` of each orbit.
    restarted : ndarray of bool, shape (branches, n)
        Where a followed orbit is restarted from the given initial condition, because it had terminated.
    period : ndarray of int, shape (branches, n)
        Least number of steps after which the orbit returns within the tolerance; 0 where there is none, or where the
        orbit has not converged.
    rotation_numbers : ndarray, shape (branches, n, dimension)
        Rotation number (winding number) of each coordinate: mean number of full rotations per step.
    exponents, standard_errors : ndarray, shape (branches, n, dimension)
        Lyapunov exponents per step of the map, in decreasing order, and their standard errors: 0 for a periodic orbit,
        whose exponents follow from its multipliers.  NaN where there are no points, or where they were not requested.
    coordinates : tuple of Coordinate
        State variables.
    params : mapping of str to float
        The other parameters.
    settings : mapping
        Arguments of :func:`bifurcation_diagram`.
    point_map : PointMap or None
        The map; None for a diagram that was read from a file without it.
    parameter_units : mapping of str to str
        Units of parameters, as far as the system declares them.
    """

    _layout: ClassVar = Layout(
        "Bifurcation diagram of {0.system}",
        {
            "values": Array("{parameter}", "{0.parameter}", "{parameter}"),
            "directions": Array("branch", name="direction"),
            "initial_conditions": Array("branch coordinate", name="initial_condition"),
        },
        {
            "points": Array("branch {parameter} step", name="{state}"),
            "status": Array("branch {parameter}", "status of the orbit", flags=Status),
            "restarted": Array("branch {parameter}"),
            "period": Array("branch {parameter}", "period in steps of the map; 0 without one", "orbit_period"),
            "chaotic": Array("branch {parameter}"),
            "rotation_numbers": Array("branch {parameter} coordinate"),
            "exponents": Array("branch {parameter} exponent", "Lyapunov exponents per step of the map"),
            "standard_errors": Array("branch {parameter} exponent", name="exponent_errors"),
        },
    )

    system: str
    parameter: str
    values: Floats
    directions: tuple[str, ...]
    initial_conditions: Floats
    points: Floats
    status: NDArray[np.uint8]
    restarted: Bools
    period: Ints
    rotation_numbers: Floats
    exponents: Floats
    standard_errors: Floats
    coordinates: tuple[Coordinate, ...]
    params: Mapping[str, float]
    settings: Mapping[str, Any]
    point_map: PointMap | None = None
    parameter_units: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        branches, n = self.status.shape
        ended = np.count_nonzero(self.status >= Status.ESCAPED)
        text = f"{self.parameter} from {self.values[0]:g} to {self.values[-1]:g}: {n} values, {branches} branches"
        return (
            f"BifurcationDiagram({self.system}, {text}, {np.mean(self.chaotic):.3g} chaotic, {ended} orbits terminated)"
        )

    @property
    def chaotic(self) -> Bools:
        """Orbits without a period whose largest exponent is significantly positive, shape (branches, n)."""
        with np.errstate(invalid="ignore"):
            return (self.period == 0) & is_positive(self.exponents[..., 0], self.standard_errors[..., 0])

    @checked
    def measure(self, quantity: Quantity = 0, measure: str = "maximum") -> Floats:
        """Return a measure of each orbit: over its period, or over all recorded steps where it has none.

        Parameters
        ----------
        quantity, measure
            As for :meth:`Branch.measure`.

        Returns
        -------
        ndarray, shape (branches, n)
            Values, in the unit of the quantity; NaN without an orbit, and for an angle that makes full rotations.

        Raises
        ------
        TypeError, ValueError
            For a quantity that the system does not have, or a diagram without its map.

        Examples
        --------
        >>> from cellmap import discrete_map
        >>> logistic = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 3.0}, ("x",), "logistic")
        >>> diagram = bifurcation_diagram(logistic, "r", [2.5, 4.0], [0.3], follow="none")
        >>> print(diagram.measure("x", "minimum")[0, 0], diagram.measure("x")[0, 1] > 0.99)
        0.6 True
        """
        if self.point_map is None:
            raise ValueError("point_map=None: this diagram came without its map; give from_xarray the map")
        result, exact, names = np.full(self.status.shape, np.nan), self.point_map, (self.parameter,)
        alive = self.status < Status.ESCAPED
        for q in np.unique(self.period[alive]).tolist():
            mine = alive & (self.period == q)
            values = self.values[np.nonzero(mine)[1], None]
            if q:
                result[mine] = measured(exact, names, values, self.points[mine][:, -q], q, quantity, measure)
            else:
                result[mine] = measured_along(exact, names, values, self.points[mine], quantity, measure)
        return result


@checked
def bifurcation_diagram(
    point_map: PointMap,
    parameter: str,
    values: ArrayLike,
    initial_conditions: ArrayLike,
    follow: str = "both",
    transient: int = 500,
    periods: int = 128,
    longest_period: int = 32,
    tolerance: float = 1e-6,
    perturbation: ArrayLike = 1e-6,
    exponents: bool = True,
    progress: bool = False,
) -> BifurcationDiagram:
    """Compute a bifurcation diagram: orbits after a transient for many values of a parameter.

    With `follow`, the initial condition at each value is the final state at the neighbouring value, so that coexisting
    attractors appear as a difference between the two directions (hysteresis).  An orbit that terminates is restarted
    from the given initial condition; if it terminates again, its status says so.  All branches, and without `follow`
    all values, are SIMD lanes of one batch.

    Parameters
    ----------
    point_map : PointMap
        The map; for an interpolated map, its exact map is used.
    parameter : str
        Name of the parameter.
    values : array_like, shape (n,)
        Parameter values, increasing or decreasing, in its unit.
    initial_conditions : array_like, shape (dimension,) or (starts, dimension)
        Initial conditions: at the first value of each direction, thus at the smallest one of "up".  Attractors that
        are known at a value between are followed in two diagrams, from there up and from there down.
    follow : {"both", "up", "down", "none"}, optional
        Follow orbits to larger values, to smaller values or both; with ``"none"`` every orbit begins at the given
        initial condition.
    transient : int, optional
        Steps of the map that are discarded at each value.
    periods : int, optional
        Steps that are recorded after these, at least 20.
    longest_period : int, optional
        Longest period that is detected, at most half of `periods`.
    tolerance : float, optional
        Distance within which an orbit counts as having returned: for angles in units of their period, for other
        coordinates relative to their largest size in the diagram, or to `perturbation` if that is larger.
    perturbation : float or array_like, shape (dimension,), optional
        Perturbation of followed orbits at each value, in the units of the coordinates: without one, an orbit on an
        equilibrium stays on it after it has become unstable.  One number is the largest component: the others are
        different parts of it, so that an orbit also leaves a set that a symmetry keeps, such as ``x = y``.
    exponents : bool, optional
        Compute Lyapunov exponents, from exact derivatives along the recorded orbits.
    progress : bool, optional
        Show a progress bar on a terminal if the work takes more than two seconds.

    Returns
    -------
    BifurcationDiagram
        Points, statuses, periods, rotation numbers and exponents.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range.
    MemoryError
        If the points do not fit into memory.

    Warns
    -----
    ToleranceWarning
        If the integrator missed its tolerance.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> logistic = discrete_map(lambda x, p: (p.r * x[0] * (1 - x[0]),), {"r": 3.0}, ("x",), "logistic")
    >>> diagram = bifurcation_diagram(logistic, "r", [2.8, 3.2, 3.5, 4.0], [0.3], follow="none")
    >>> diagram.period[0], diagram.chaotic[0]
    (array([1, 2, 4, 0]), array([False, False, False,  True]))
    """
    exact = point_map.without_table
    swept = swept_map(exact, known_parameter("parameter", parameter, exact.params))
    d = exact.dimension
    axis = np.sort(monotone_values("values", values))
    given = state_points("initial_conditions", initial_conditions, point_map.coordinates)
    if not 1 <= given.ndim <= 2 or not given.size:
        raise ValueError(
            f"initial_conditions has shape {given.shape}: give one initial condition, or several in an array of "
            f"shape (n, {d})"
        )
    one_of("follow", follow, tuple(_DIRECTIONS))
    transient = whole_number("transient", transient)
    periods = whole_number("periods", periods)
    longest_period = whole_number("longest_period", longest_period, at_least=1)
    fewest = max(_FEWEST, 2 * longest_period)
    if periods < fewest:
        raise ValueError(
            f"periods={periods!r}: give at least {fewest}, twice longest_period={longest_period!r} and no fewer than "
            f"{_FEWEST}, or a smaller longest_period"
        )
    tolerance = finite_number("tolerance", tolerance, above=0.0)
    shift = real_array("perturbation", perturbation)
    parts = 1.0 - 0.5 * (_GOLDEN * np.arange(d) % 1.0)
    shift = finite_points("perturbation", shift * parts if shift.ndim == 0 else shift, d)
    if shift.ndim != 1:
        raise ValueError(f"perturbation={shown(perturbation)}: give one number, or one for each of {d} coordinates")
    directions = tuple(way for way in _DIRECTIONS[follow] for _ in given.reshape(-1, d))
    initial_conditions = np.tile(wrap(given.reshape(-1, d), exact.coordinates), (len(_DIRECTIONS[follow]), 1))
    samples = len(directions) * axis.size * periods
    needed = 8 * samples * (2 * d + (d * d if exponents else 0))
    claim_memory(f"a diagram of {axis.size:,} values x {len(directions)} branches", needed, "take fewer of them")

    recorded = Recorded.empty(len(directions), axis.size, periods, d)
    label = f"diagram of {exact.name}" if progress else None
    if follow == "none":
        record_each(swept, axis, initial_conditions, transient, recorded, label)
    else:
        record_followed(swept, axis, initial_conditions, directions, shift, transient, recorded, label)
    warn_of_tolerance(recorded.status, exact)

    alive = recorded.status < Status.ESCAPED
    period = _periods(
        recorded.points,
        exact,
        np.maximum(np.abs(initial_conditions).max(axis=0), np.abs(shift)),
        longest_period,
        tolerance,
        alive,
    )
    spectrum = np.full((2, *recorded.status.shape, d), np.nan)
    if exponents:
        _fill_exponents(exact, swept, parameter, axis, recorded.points, period, alive, spectrum)
    return BifurcationDiagram(
        system=exact.name,
        parameter=parameter,
        values=axis,
        directions=directions,
        initial_conditions=initial_conditions,
        points=recorded.points,
        status=recorded.status,
        restarted=recorded.restarted,
        period=period,
        rotation_numbers=_rotation_numbers(recorded, exact, period, alive),
        exponents=spectrum[0],
        standard_errors=spectrum[1],
        coordinates=exact.coordinates,
        params=Keyed({key: v for key, v in exact.params.items() if key != parameter}, "params"),
        settings={
            "follow": follow,
            "transient": transient,
            "periods": periods,
            "longest_period": longest_period,
            "tolerance": tolerance,
        },
        point_map=exact,
        parameter_units=exact.parameter_units,
    )


def _periods(
    points: Floats, exact: PointMap, smallest: Floats, longest_period: int, tolerance: float, alive: Bools
) -> Ints:
    """Return the numbers of steps after which the second halves of orbits repeat; 0 for none.

    An orbit that comes in slowly, turning round or from side to side, seems to have a longer period than what it
    approaches.  The way that it has still to go, by Aitken's extrapolation of its returns, tells that from a cycle.
    """
    period = np.zeros(alive.shape, np.int64)
    if not alive.any():
        return period
    turn = turns_of(exact.coordinates)[1]
    size = np.maximum(np.abs(points[alive]).max(axis=(0, 1)), smallest)
    extent = np.where(turn > 0, turn, np.where(size > 0, size, 1.0))
    half = points.shape[2] // 2
    last = np.empty((longest_period, *alive.shape))
    for q in range(1, longest_period + 1):
        shift = difference(points[:, :, half:], points[:, :, half - q : -q], exact.coordinates)
        apart = np.abs(shift / extent).max(axis=-1)
        first, last[q - 1] = apart[:, :, :q].max(axis=-1), apart[:, :, -q:].max(axis=-1)
        with np.errstate(invalid="ignore", divide="ignore"):
            factor = (last[q - 1] / first) ** (q / max(apart.shape[2] - q, 1))
            remaining = last[q - 1] * np.where(factor < 1.0, factor / (1.0 - factor), 1.0)
            returns = (period == 0) & (apart <= tolerance).all(axis=-1)
            for p in range(1, q):
                if q % p == 0:
                    returns &= ~(last[p - 1] < _UNSETTLED * remaining)
        period[returns] = q
    return period


def _rotation_numbers(recorded: Recorded, exact: PointMap, period: Ints, alive: Bools) -> Floats:
    """Mean full rotations per step: over one period of a periodic orbit, else over all recorded steps."""
    turn = turns_of(exact.coordinates)[1]
    steps = np.where(period > 0, period, recorded.points.shape[2] - 1)
    first = (recorded.points.shape[2] - 1 - steps)[..., None, None]
    start, whole = (np.take_along_axis(a, first, axis=2)[:, :, 0] for a in (recorded.points, recorded.rotations))
    moved = recorded.points[:, :, -1] - start + (recorded.rotations[:, :, -1] - whole) * turn
    rounds = np.where(turn > 0, moved / np.where(turn > 0, turn, 1.0), 0.0)
    rounds = np.where((period > 0)[..., None], np.round(rounds), rounds)
    return np.where(alive[..., None], rounds / steps[..., None] + 0.0, np.nan)


def _fill_exponents(
    exact: PointMap,
    swept: PointMap,
    name: str,
    axis: Floats,
    points: Floats,
    period: Ints,
    alive: Bools,
    spectrum: Floats,
) -> None:
    """Fill in exponents and standard errors (2, branches, n, d): derivatives of all orbits together."""
    periods, d = points.shape[2:]
    steps = np.where(alive, np.where(period > 0, period, periods), 0)
    wanted = np.arange(periods) >= (periods - steps)[..., None]
    column = np.broadcast_to(np.arange(axis.size)[:, None], wanted.shape)[wanted]
    matrices = np.full((*wanted.shape, d, d), np.nan)
    matrices[wanted] = swept_derivatives(exact, swept, name, points[wanted], axis[column])
    for q in np.unique(period[alive]):
        mine = alive & (period == q)
        if q:
            spectrum[0][mine], spectrum[1][mine] = exponents_of_cycles(matrices[mine][:, -q:]), 0.0
        else:
            spectrum[0][mine], spectrum[1][mine] = exponents_along(matrices[mine])
