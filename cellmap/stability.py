"""Where equilibria gain and lose stability: critical parameter values and maps over two parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import claim_memory, finite_number, whole_number
from .floquet import Linearised, linearise, multipliers_of, swept_values
from .orbit import MARGIN, unstable_count
from .pointmap import Status
from .system import ForcedSystem

_TOLERANCE = 1e-13  # of the monodromy matrices
_ROUNDS = 80
_GOLDEN = 0.5 * (3.0 - np.sqrt(5.0))
_DIP = 0.3  # an extremum that a parabola puts this near to zero, relative to the values around, is looked into
_BESIDE = 0.25  # distance at which both sides of a crossing are looked at, in steps of the scan
_REAL = 1e-5  # imaginary part of a double multiplier that rounding explains
_LEAVING = 3  # test function: the largest modulus against 1


class Crossing(IntEnum):
    """How a multiplier crosses the unit circle."""

    PLUS_ONE = 0
    """Through +1: det(M - I) = 0, a fold or pitchfork."""
    MINUS_ONE = 1
    """Through -1: det(M + I) = 0, a period doubling."""
    NEIMARK_SACKER = 2
    """As a complex pair; without damping two pairs that collide on the circle (Krein)."""


@dataclass(frozen=True)
class CriticalValue:
    """A parameter value at which the number of unstable multipliers changes.

    Parameters
    ----------
    value : float
        The parameter, in its unit.
    crossing : Crossing
        How multipliers cross the unit circle there.
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
    """Points of boundaries of stability over two parameters; all arrays of shape (n,).

    Parameters
    ----------
    x, y : ndarray
        Parameters, in their units.
    crossing : ndarray of int
        A :class:`Crossing` for each point.
    below, above : ndarray of int
        Number of unstable multipliers just below and above, in the direction of the refined parameter.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    crossing: NDArray[np.int64]
    below: NDArray[np.int64]
    above: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.x)

    def __repr__(self) -> str:
        parts = [f"{np.count_nonzero(self.crossing == c)} {c.name}" for c in Crossing if (self.crossing == c).any()]
        return f"Boundary({', '.join(parts) or 'no points'})"


@dataclass(frozen=True, eq=False)
class StabilityMap:
    """Stability of an equilibrium over two parameters.

    Parameters
    ----------
    names : tuple of str
        Names of the parameters along x and y.
    x, y : ndarray, shapes (nx,) and (ny,)
        Their values.
    largest : ndarray, shape (ny, nx)
        Largest modulus of the multipliers; NaN where `status` is DIVERGED.
    unstable : ndarray of int, shape (ny, nx)
        Number of multipliers outside the unit circle by more than 1e-8; -1 where they are not known.
    status : ndarray of uint8, shape (ny, nx)
        A :class:`Status` for each point.
    rows, columns : Boundary
        Boundaries of stability, refined in x at every value of y, and in y at every value of x.
    """

    names: tuple[str, str]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    largest: NDArray[np.float64]
    unstable: NDArray[np.int64]
    status: NDArray[np.uint8]
    rows: Boundary
    columns: Boundary

    def __repr__(self) -> str:
        share = np.mean(self.unstable == 0)
        return f"StabilityMap({self.names[0]} x {self.names[1]}: {self.x.size} x {self.y.size}, {share:.4g} stable)"


def critical_values(
    system: ForcedSystem,
    equilibrium: ArrayLike,
    name: str,
    lower: float,
    upper: float,
    points: int = 512,
    every: bool = False,
) -> tuple[CriticalValue, ...]:
    """Return the values of a parameter at which an equilibrium gains or loses stability, in increasing order.

    Test functions det(M - I), det(M + I) and, from three state variables on, the product of all mu_i mu_j - 1 are
    scanned, extrema near zero are looked into for pairs of zeros, and zeros refined by inverse quadratic interpolation
    to rounding.  Those that change the number of unstable multipliers are kept.  Windows narrower than a step of the
    scan may be missed where the test function gives no sign of them.

    Parameters
    ----------
    system : ForcedSystem
        System without switches, whose right-hand side can be traced and differentiated.
    equilibrium : array_like, shape (dimension,)
        State at which the right-hand side vanishes at all times, for all values of the parameter.
    name : str
        Name of the parameter.
    lower, upper : float
        Interval of its values, in its unit.
    points : int, optional
        Values at which it is scanned, at least 3.
    every : bool, optional
        Keep as well the values at which one unstable state becomes another.

    Returns
    -------
    tuple of CriticalValue
        Relative error about 1e-12, where multipliers cross the circle at a rate of order 1.

    Raises
    ------
    TypeError, ValueError
        As :func:`floquet_multipliers`; and for an empty interval.

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
    low, high = finite_number("lower", lower), finite_number("upper", upper)
    if not low < high:
        raise ValueError(f"upper={upper!r}: give a number above lower={lower!r}")
    count = whole_number("points", points, at_least=3)
    linear = linearise(system, equilibrium, (name,), _TOLERANCE)
    scan = np.linspace(low, high, count)
    linear.check(scan[:, None])
    tests = _Tests(linear)
    found = _crossings(tests, np.empty((1, 0)), 0, scan, tests(scan[:, None]), every, None)
    return tuple(
        CriticalValue(float(x), Crossing(int(c)), int(b), int(a))
        for x, c, b, a in zip(found.values, found.crossing, found.below, found.above, strict=True)
    )


def stability_map(
    system: ForcedSystem,
    equilibrium: ArrayLike,
    x: tuple[str, ArrayLike],
    y: tuple[str, ArrayLike],
    progress: bool = False,
) -> StabilityMap:
    """Return the stability of an equilibrium over two parameters, with its boundaries as curves.

    Boundaries are refined between neighbouring points of every row and column as :func:`critical_values` does it,
    to a relative error of 1e-12 where multipliers cross the unit circle at a rate of order 1.

    Parameters
    ----------
    system : ForcedSystem
        System without switches, whose right-hand side can be traced and differentiated.
    equilibrium : array_like, shape (dimension,)
        State at which the right-hand side vanishes at all times, for all values of the parameters.
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
        As :func:`floquet_multipliers`; and for values that do not increase.
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
    linear = linearise(system, equilibrium, names, _TOLERANCE)
    shape, d = (axes[1].size, axes[0].size), linear.dimension
    count = axes[0].size * axes[1].size
    claim_memory(f"a stability map of {shape[1]} x {shape[0]}", 8 * count * (d * d + 3 * d + 60), "give fewer values")
    grid = np.stack(np.broadcast_arrays(axes[0][None, :], axes[1][:, None]), axis=-1)
    linear.check(grid.reshape(-1, 2))
    tests = _Tests(linear)
    label = "stability map" if progress else None
    on_grid = tests(grid.reshape(-1, 2), label)
    rows = _crossings(tests, axes[1][:, None], 0, axes[0], on_grid, False, label)
    columns = _crossings(tests, axes[0][:, None], 1, axes[1], on_grid.turned(shape), False, label)
    return StabilityMap(
        names=(names[0], names[1]),
        x=axes[0],
        y=axes[1],
        largest=on_grid.largest.reshape(shape),
        unstable=on_grid.unstable.reshape(shape),
        status=on_grid.status.reshape(shape),
        rows=Boundary(rows.values, axes[1][rows.lines], rows.crossing, rows.below, rows.above),
        columns=Boundary(axes[0][columns.lines], columns.values, columns.crossing, columns.below, columns.above),
    )


def _axis(label: str, given: tuple[str, ArrayLike]) -> tuple[str, NDArray[np.float64]]:
    try:
        name, values = given
    except (TypeError, ValueError):
        raise TypeError(f"{label}={given!r}: give a pair of a parameter's name and its values") from None
    if not isinstance(name, str):
        raise TypeError(f"{label}[0]={name!r}: give the name of a parameter")
    axis = swept_values(f"{label}[1]", values)
    if axis.ndim != 1 or axis.size < 3 or not (np.diff(axis) > 0.0).all():
        raise ValueError(f"{label}[1] has the shape {axis.shape}: give at least 3 values in increasing order")
    return name, axis


@dataclass(frozen=True, eq=False)
class _Seen:
    """Test functions (n, 4) at parameter points, with what else is known there (n).

    ``crossing`` is how the multiplier that is nearest to the unit circle would cross it.
    """

    tests: NDArray[np.float64]
    largest: NDArray[np.float64]
    unstable: NDArray[np.int64]
    status: NDArray[np.uint8]
    crossing: NDArray[np.int64]

    def turned(self, shape: tuple[int, int]) -> _Seen:
        """Return the points of a grid column by column instead of row by row."""
        order = np.arange(len(self.tests)).reshape(shape).T.ravel()
        return _Seen(*(getattr(self, f.name)[order] for f in fields(self)))


@dataclass(frozen=True, eq=False)
class _Tests:
    """Test functions of a linearised system, one column for each crossing and one for the largest modulus."""

    linear: Linearised

    def __call__(self, points: NDArray[np.float64], progress: str | None = None) -> _Seen:
        matrices, logarithms, status = self.linear.monodromy(points, progress)
        d, determinant = matrices.shape[-1], np.exp(logarithms)
        found = multipliers_of(matrices, determinant)
        tests = np.empty((len(points), 4))
        if d == 2:
            # Of a matrix near to I the entries know more than its trace and determinant.
            (a, b), (c, e) = np.moveaxis(matrices, 0, -1)
            tests[:, Crossing.PLUS_ONE] = (a - 1.0) * (e - 1.0) - b * c
            tests[:, Crossing.MINUS_ONE] = (a + 1.0) * (e + 1.0) - b * c
            tests[:, Crossing.NEIMARK_SACKER] = np.expm1(logarithms)
        else:
            tests[:, Crossing.PLUS_ONE] = np.linalg.det(matrices - np.eye(d))
            tests[:, Crossing.MINUS_ONE] = np.linalg.det(matrices + np.eye(d))
            first, second = np.triu_indices(d, 1)
            tests[:, Crossing.NEIMARK_SACKER] = np.prod(found[:, first] * found[:, second] - 1.0, axis=-1).real
        # Without damping this vanishes everywhere, but for rounding.
        tests[np.abs(logarithms) < 1e-9, Crossing.NEIMARK_SACKER] = 1.0
        tests[:, _LEAVING] = np.log(np.abs(found[:, 0])) - MARGIN
        distance = np.where(np.isnan(found[:, :1]), 0.0, np.abs(np.abs(found) - 1.0))
        nearest = np.take_along_axis(found, np.argmin(distance, axis=1)[:, None], axis=1)[:, 0]
        real = np.where(nearest.real > 0.0, Crossing.PLUS_ONE, Crossing.MINUS_ONE)
        crossing = np.where(np.abs(nearest.imag) > _REAL, Crossing.NEIMARK_SACKER, real)
        return _Seen(tests, np.abs(found[:, 0]), unstable_count(found), status, crossing)


@dataclass(frozen=True, eq=False)
class _Found:
    """Critical values on lines of a scan, sorted by line and value; all arrays of shape (n,)."""

    lines: NDArray[np.int64]
    values: NDArray[np.float64]
    crossing: NDArray[np.int64]
    below: NDArray[np.int64]
    above: NDArray[np.int64]


def _crossings(
    tests: _Tests,
    others: NDArray[np.float64],
    place: int,
    scan: NDArray[np.float64],
    seen: _Seen,
    every: bool,
    progress: str | None,
) -> _Found:
    """Refine the critical values on all lines of a scan together.

    `others` (lines, m - 1) are the parameters that rest on a line, `place` is that of the scanned one among all, and
    `seen` are the test functions line by line.
    """
    lines, count = len(others), len(scan)
    functions = np.where((seen.status >= Status.ESCAPED)[:, None], np.nan, seen.tests).reshape(lines, count, 4)
    unstable = seen.unstable.reshape(lines, count)

    def at(line: NDArray[np.int64], value: NDArray[np.float64]) -> _Seen:
        return tests(np.insert(others[line], place, value, axis=1), progress)

    def function(line: NDArray[np.int64], which: NDArray[np.int64]) -> Callable[..., NDArray[np.float64]]:
        return lambda part, value: at(line[part], value).tests[np.arange(len(value)), which[part]]

    # Zeros between neighbours, and pairs of zeros around an extremum between three.
    signs = np.where(functions < 0.0, -1, 1)
    known = np.isfinite(functions)
    changed = (signs[:, 1:] != signs[:, :-1]) & known[:, 1:] & known[:, :-1]
    changed[:, :, _LEAVING] = False
    line, step, which = np.nonzero(changed)
    ends = [scan[step], scan[step + 1], functions[line, step, which], functions[line, step + 1, which]]
    dips = _dips(functions)
    if len(dips[0]):
        dip_line, middle, dip_which = dips
        sides = [scan[middle - 1], scan[middle], scan[middle + 1]]
        height = [functions[dip_line, middle + k, dip_which] for k in (-1, 0, 1)]
        turn, value = _extremum(function(dip_line, dip_which), sides, height)
        through = np.flatnonzero((value < 0.0) != (height[1] < 0.0))
        for side, outer in ((sides[0], height[0]), (sides[2], height[2])):
            line, which = np.append(line, dip_line[through]), np.append(which, dip_which[through])
            step = np.append(step, np.searchsorted(scan, turn[through], side="right") - 1)
            fresh = (side[through], turn[through], outer[through], value[through])
            ends = [np.append(e, f) for e, f in zip(ends, fresh, strict=True)]
    roots = _refined(function(line, which), *ends)

    # A change of stability without a zero of its own: zeros of even order, and pairs that collide on the circle.
    jumps = (unstable[:, 1:] > 0) != (unstable[:, :-1] > 0)
    jumps &= (unstable[:, 1:] >= 0) & (unstable[:, :-1] >= 0)
    if len(roots):
        cell = np.clip(np.searchsorted(scan, roots, side="right") - 1, 0, count - 2)
        jumps[line, cell] = False
    jump_line, jump_step = np.nonzero(jumps)
    if len(jump_line):
        modulus = np.full(len(jump_line), _LEAVING)
        sides = [functions[jump_line, jump_step + k, _LEAVING] for k in (0, 1)]
        edges = (scan[jump_step], scan[jump_step + 1])
        found = _refined(function(jump_line, modulus), *edges, *sides)
        line, roots = np.append(line, jump_line), np.append(roots, found)
        which = np.append(which, np.full(len(found), Crossing.NEIMARK_SACKER))

    # The product of two real multipliers is 1 as well where both cross together.
    pairs = np.flatnonzero(which == Crossing.NEIMARK_SACKER)
    if len(pairs):
        which[pairs] = at(line[pairs], roots[pairs]).crossing

    order = np.lexsort((which, roots, line))
    line, roots, which = line[order], roots[order], which[order]
    below, above = _beside(at, line, roots, scan)
    kept = (below != above) if every else ((below > 0) != (above > 0))
    kept &= (below >= 0) & (above >= 0)
    return _Found(line[kept], roots[kept], which[kept], below[kept], above[kept])


def _beside(
    at: Callable[..., _Seen], line: NDArray[np.int64], roots: NDArray[np.float64], scan: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the numbers of unstable multipliers just below and above critical values, sorted by line."""
    if not len(roots):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    cell = np.clip(np.searchsorted(scan, roots, side="right") - 1, 0, len(scan) - 2)
    reach = _BESIDE * (scan[cell + 1] - scan[cell])
    gap = np.where(np.diff(line) == 0, 0.5 * np.diff(roots), np.inf)
    down = np.minimum(np.minimum(reach, np.append(np.inf, gap)), roots - scan[0])
    up = np.minimum(np.minimum(reach, np.append(gap, np.inf)), scan[-1] - roots)
    both = at(np.append(line, line), np.append(roots - down, roots + up)).unstable
    return both[: len(roots)], both[len(roots) :]


def _dips(functions: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return where a test function of one sign comes near to zero between three neighbours: line, middle, which."""
    with np.errstate(all="ignore"):
        left, middle, right = (functions[:, k : functions.shape[1] - 2 + k] for k in range(3))
        sign = np.where(middle < 0.0, -1.0, 1.0)
        left, middle, right = left * sign, middle * sign, right * sign
        curvature = left - 2.0 * middle + right
        lowest = middle - (right - left) ** 2 / (8.0 * curvature)
        dips = (left >= middle) & (right >= middle) & (curvature > 0.0) & (lowest < _DIP * np.minimum(left, right))
    dips[:, :, _LEAVING] = False
    line, first, which = np.nonzero(dips)
    return line, first + 1, which


def _extremum(
    function: Callable[..., NDArray[np.float64]],
    sides: Sequence[NDArray[np.float64]],
    height: Sequence[NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find the extrema towards zero between three points each, by golden sections; stop a search beyond zero."""
    low, best, high = (s.copy() for s in sides)
    sign = np.where(height[1] < 0.0, -1.0, 1.0)
    value = height[1] * sign
    for _ in range(_ROUNDS):
        active = np.flatnonzero((value > 0.0) & (high - low > 1e-9 * np.maximum(np.abs(low), np.abs(high))))
        if not len(active):
            break
        a, b, c = low[active], best[active], high[active]
        right = c - b > b - a
        new = np.where(right, b + _GOLDEN * (c - b), b - _GOLDEN * (b - a))
        seen = function(active, new) * sign[active]
        lower = seen < value[active]
        low[active] = np.where(right & lower, b, np.where(~right & ~lower, new, a))
        high[active] = np.where(~right & lower, b, np.where(right & ~lower, new, c))
        best[active] = np.where(lower, new, b)
        value[active] = np.where(lower, seen, value[active])
    return best, value * sign


def _refined(
    function: Callable[..., NDArray[np.float64]],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    at_low: NDArray[np.float64],
    at_high: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Find one zero in each bracket, to rounding, by inverse quadratic interpolation and bisection (Chandrupatla)."""
    a, b, c = high.copy(), low.copy(), high.copy()
    fa, fb, fc = at_high.copy(), at_low.copy(), at_high.copy()
    share = np.full(len(a), 0.5)
    root = np.where(np.abs(fa) < np.abs(fb), a, b)
    active = np.arange(len(a))
    for _ in range(_ROUNDS):
        if not len(active):
            break
        x = a[active] + share[active] * (b[active] - a[active])
        fx = function(active, x)
        same = (fx < 0.0) == (fa[active] < 0.0)
        c[active] = np.where(same, a[active], b[active])
        fc[active] = np.where(same, fa[active], fb[active])
        b[active] = np.where(same, b[active], a[active])
        fb[active] = np.where(same, fb[active], fa[active])
        a[active], fa[active] = x, fx
        root[active] = np.where(np.abs(fa[active]) < np.abs(fb[active]), a[active], b[active])
        width = np.abs(b - a)[active]
        resolution = 2e-15 * np.abs(root[active]) + 1e-300
        limit = resolution / np.maximum(width, 1e-300)
        with np.errstate(all="ignore"):
            xi = ((a - b) / (c - b))[active]
            phi = ((fa - fb) / (fc - fb))[active]
            inverse = (fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb))[active]
            smooth = (phi**2 < xi) & ((1.0 - phi) ** 2 < 1.0 - xi) & np.isfinite(inverse)
        share[active] = np.clip(np.where(smooth, inverse, 0.5), np.minimum(limit, 0.5), 1.0 - np.minimum(limit, 0.5))
        active = active[(width > 2.0 * resolution) & (fx != 0.0) & np.isfinite(fx)]
    return root
