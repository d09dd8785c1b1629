"""Stability of equilibria and periodic orbits: critical parameter values and stability maps of two parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.arrays import Floats, Ints
from .._lib.checks import affordable_number, claim_memory
from .._lib.records import Array, ConvertsToXarray, Layout
from .._lib.signatures import checked
from ..maps.orbit_batch import Status
from ..maps.point_map import PointMap
from ..maps.system import ForcedSystem
from ..orbits.attractor import Attractor
from ..orbits.orbit_kinds import PeriodicOrbit
from .crossings import BoundaryCurve, Crossing, CrossingFunctions, MultiplierSource, crossings_on_lines, linked
from .floquet import linearise, swept_values
from .intervals import axis_of, interval_between
from .orbit_grid import follow_over

_TOLERANCE = 1e-13  # tolerance of the monodromy matrices


@dataclass(frozen=True)
class CriticalValue:
    """Parameter value at which the number of unstable multipliers changes.

    Parameters
    ----------
    value : float
        Critical value of the parameter, in its unit.
    crossing : Crossing
        Way in which multipliers cross the unit circle.
    below, above : int
        Number of multipliers outside the unit circle just below and just above.
    """

    value: float
    crossing: Crossing
    below: int
    above: int

    @property
    def gains(self) -> bool:
        """Whether the equilibrium becomes stable as the parameter grows."""
        return self.below > 0 and self.above == 0

    @property
    def loses(self) -> bool:
        """Whether the equilibrium becomes unstable as the parameter grows."""
        return self.below == 0 and self.above > 0


@dataclass(frozen=True, eq=False)
class Boundary:
    """Points of stability boundaries in the plane of two parameters; all arrays have shape (n,).

    Parameters
    ----------
    x, y : ndarray
        Parameters, in their units.
    crossing : ndarray of int
        A :class:`Crossing` of each point.
    below, above : ndarray of int
        Number of unstable multipliers just below and above, in the direction of the refined parameter.
    """

    x: Floats
    y: Floats
    crossing: Ints
    below: Ints
    above: Ints

    def __len__(self) -> int:
        return len(self.x)

    def __repr__(self) -> str:
        parts = [f"{np.count_nonzero(self.crossing == c)} {c.name}" for c in Crossing if (self.crossing == c).any()]
        return f"Boundary({', '.join(parts) or 'no points'})"


@dataclass(frozen=True, eq=False)
class StabilityMap(ConvertsToXarray):
    """Stability map of an equilibrium or a periodic orbit over two parameters.

    Parameters
    ----------
    parameters : tuple of str
        Names of the parameters along x and y.
    x, y : ndarray, shapes (nx,) and (ny,)
        Their values.
    largest : ndarray, shape (ny, nx)
        Largest modulus of the multipliers; NaN where `status` is DIVERGED.
    unstable : ndarray of int, shape (ny, nx)
        Number of multipliers outside the unit circle by more than 1e-8; -1 where they are not known.
    status : ndarray of uint8, shape (ny, nx)
        A :class:`Status` of each point.
    rows, columns : Boundary
        Stability boundaries, refined in x at every value of y, and in y at every value of x.
    parameter_units : mapping of str to str
        Units of parameters, as far as the system declares them.
    """

    _layout: ClassVar = Layout(
        "Stability map",
        {"x": Array("{x}", "{0.parameters[0]}", "{x}"), "y": Array("{y}", "{0.parameters[1]}", "{y}")},
        {
            "largest": Array("{y} {x}", "largest modulus of the multipliers", unit="1"),
            "unstable": Array("{y} {x}", "multipliers outside the unit circle; -1 where unknown"),
            "status": Array("{y} {x}", flags=Status),
        },
    )

    parameters: tuple[str, str]
    x: Floats
    y: Floats
    largest: Floats
    unstable: Ints
    status: NDArray[np.uint8]
    rows: Boundary
    columns: Boundary
    parameter_units: Mapping[str, str] = field(default_factory=dict)

    @property
    def curves(self) -> tuple[BoundaryCurve, ...]:
        """Stability boundaries as curves: the points of `rows` and `columns`, connected through the cells."""
        sides = ((b.x, b.y, b.crossing) for b in (self.rows, self.columns))
        return linked(self.x, self.y, *sides)

    def __repr__(self) -> str:
        share = np.mean(self.unstable == 0)
        plane = f"{self.parameters[0]} x {self.parameters[1]}"
        return f"StabilityMap({plane}: {self.x.size} x {self.y.size}, {share:.4g} stable)"


@checked
def critical_values(
    system: ForcedSystem,
    equilibrium: ArrayLike,
    parameter: str,
    lower: float,
    upper: float,
    n_points: int = 512,
    all_crossings: bool = False,
) -> tuple[CriticalValue, ...]:
    """Compute the parameter values at which an equilibrium gains or loses stability, in increasing order.

    Test functions det(M - I), det(M + I) and, from three state variables on, the product of all mu_i mu_j - 1 are
    scanned, extrema near zero are searched for pairs of zeros, and zeros are refined by inverse quadratic interpolation
    to rounding error.  Those that change the number of unstable multipliers are kept.  Intervals of stability narrower
    than a step of the scan can be missed if the test functions show no extremum there.

    Parameters
    ----------
    system : ForcedSystem
        System without switches, whose right-hand side can be traced and differentiated.
    equilibrium : array_like, shape (dimension,)
        State at which the right-hand side vanishes at all times, for all values of the parameter.
    parameter : str
        Name of the parameter.
    lower, upper : float
        Interval of parameter values, in its unit.
    n_points : int, optional
        Parameter values of the scan, at least 3.
    all_crossings : bool, optional
        Also keep values at which the number of unstable multipliers changes without a change of stability.

    Returns
    -------
    tuple of CriticalValue
        The critical values, with a relative error of about 1e-12 where multipliers cross the circle at a rate of order
        1.

    Raises
    ------
    TypeError, ValueError
        As :func:`floquet_multipliers`; also for an empty interval.

    References
    ----------
    Kuznetsov, *Elements of Applied Bifurcation Theory* (2004), section 10.2 (test functions); Chandrupatla, Advances in
    Engineering Software 28 (1997) 145 (refinement).

    Examples
    --------
    >>> from math import cos, pi, sin
    >>> def rhs(t, x, p):
    ...     theta, v = x
    ...     return v, -p.gamma * v - (p.alpha - p.beta * cos(t)) * sin(theta)
    >>> pendulum = ForcedSystem(rhs, {"alpha": 0.25, "beta": 0.0, "gamma": 0.05}, 2 * pi, ("theta", "v"))
    >>> critical_values(pendulum, [0.0, 0.0], "beta", 0.0, 0.2)
    (CriticalValue(value=0.050027335537, crossing=<Crossing.MINUS_ONE: 1>, below=0, above=1),)
    """
    low, high = interval_between(lower, upper)
    count = affordable_number("n_points", n_points, 8 * 100, at_least=3)
    linear = linearise(system, equilibrium, (parameter,), _TOLERANCE)
    scan = np.linspace(low, high, count)
    linear.check(scan[:, None])
    tests = CrossingFunctions(linear)
    found = crossings_on_lines(tests, np.empty((1, 0)), 0, scan, tests(scan[:, None]), all_crossings, None)
    return tuple(
        CriticalValue(float(x), Crossing(int(c)), int(b), int(a))
        for x, c, b, a in zip(found.values, found.crossing, found.below, found.above, strict=True)
    )


@checked
def stability_map(
    system: ForcedSystem | PointMap,
    equilibrium: ArrayLike | PeriodicOrbit | Attractor,
    x: tuple[str, ArrayLike],
    y: tuple[str, ArrayLike],
    progress: bool = False,
) -> StabilityMap:
    """Compute the stability of an equilibrium or a periodic orbit over two parameters, with its boundaries.

    Boundaries are refined between neighbouring points of every row and column as in :func:`critical_values`, to a
    relative error of 1e-12 where multipliers cross the unit circle at a rate of order 1.

    A periodic orbit depends on the parameters: it is continued from the parameters of the map to all points of the
    grid, which are treated in SIMD lanes.  The stability map ends where the orbit ceases to exist, at folds;
    :func:`continue_bifurcation` continues these.

    Parameters
    ----------
    system : ForcedSystem or PointMap
        For an equilibrium, a system without switching functions whose right-hand side can be traced and differentiated;
        for a periodic orbit, its map, whose tolerance determines the accuracy of the boundaries.
    equilibrium : array_like, shape (dimension,), or PeriodicOrbit or Attractor
        State at which the right-hand side vanishes at all times, for all values of the parameters; or a periodic orbit
        at the parameters of the map.
    x, y : tuple of str and array_like
        Name of each parameter and its values, at least 3, increasing, in its unit.
    progress : bool, optional
        Show progress on a terminal.

    Returns
    -------
    StabilityMap
        Moduli and numbers of unstable multipliers on the grid, and the boundaries.

    Raises
    ------
    TypeError, ValueError
        As :func:`floquet_multipliers`; also for values that do not increase.
    MemoryError
        If the map needs more memory than is free.

    Examples
    --------
    >>> from math import cos, pi, sin
    >>> def rhs(t, x, p):
    ...     theta, v = x
    ...     return v, -p.gamma * v - (p.alpha - p.beta * cos(t)) * sin(theta)
    >>> pendulum = ForcedSystem(rhs, {"alpha": 0.25, "beta": 0.0, "gamma": 0.05}, 2 * pi, ("theta", "v"))
    >>> inverted = stability_map(pendulum, [pi, 0], ("beta", np.linspace(0, 1, 41)), ("alpha", [0.01, 0.02, 0.03]))
    >>> inverted.rows
    Boundary(3 PLUS_ONE, 3 MINUS_ONE)
    """
    names, axes = zip(*(_axis(label, given) for label, given in (("x", x), ("y", y))), strict=True)
    if names[0] == names[1]:
        raise ValueError(f"y has the parameter {names[1]!r} of x: give two parameters")
    shape = axes[1].size, axes[0].size
    label = "stability map" if progress else None
    count = axes[0].size * axes[1].size
    grid = np.stack(np.broadcast_arrays(axes[0][None, :], axes[1][:, None]), axis=-1)
    source: MultiplierSource
    if isinstance(system, PointMap):
        if not isinstance(equilibrium, PeriodicOrbit | Attractor):
            raise TypeError(f"equilibrium={equilibrium!r}: with a PointMap give a PeriodicOrbit or an Attractor")
        source, d = follow_over(system, equilibrium, (names[0], names[1]), axes[0], axes[1], label), system.dimension
    else:
        if isinstance(equilibrium, PeriodicOrbit | Attractor):
            raise TypeError(f"system={system!r}: with a periodic orbit give its PointMap")
        source = linearise(system, equilibrium, names, _TOLERANCE)
        source.check(grid.reshape(-1, 2))
        d = source.dimension
    claim_memory(f"a stability map of {shape[1]} x {shape[0]}", 8 * count * (d * d + 3 * d + 60), "give fewer values")
    tests = CrossingFunctions(source)
    on_grid = tests(grid.reshape(-1, 2), label)
    rows = crossings_on_lines(tests, axes[1][:, None], 0, axes[0], on_grid, False, label)
    columns = crossings_on_lines(tests, axes[0][:, None], 1, axes[1], on_grid.turned(shape), False, label)
    return StabilityMap(
        parameters=(names[0], names[1]),
        x=axes[0],
        y=axes[1],
        largest=on_grid.largest.reshape(shape),
        unstable=on_grid.unstable.reshape(shape),
        status=on_grid.status.reshape(shape),
        rows=Boundary(rows.values, axes[1][rows.lines], rows.crossing, rows.below, rows.above),
        columns=Boundary(axes[0][columns.lines], columns.values, columns.crossing, columns.below, columns.above),
        parameter_units=dict(system.parameter_units),
    )


def _axis(label: str, given: tuple[str, ArrayLike]) -> tuple[str, Floats]:
    name, values = axis_of(label, given)
    if not isinstance(name, str):
        raise TypeError(f"{label}[0]={name!r}: give the name of a parameter")
    axis = swept_values(f"{label}[1]", values)
    if axis.ndim != 1 or axis.size < 3 or not (np.diff(axis) > 0.0).all():
        raise ValueError(f"{label}[1] has the shape {axis.shape}: give at least 3 values in increasing order")
    return name, axis
