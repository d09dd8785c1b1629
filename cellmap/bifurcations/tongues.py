"""Arnold tongues: regions of two parameters in which a rotation number is locked, between two fold curves."""

from __future__ import annotations

from dataclasses import dataclass
from math import gcd

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Floats
from .._lib.checks import finite_number, pair_of, shown, whole_number
from .._lib.signatures import checked
from ..maps.compiled_advance import recorded
from ..maps.coordinates import state_points, turns_of
from ..maps.orbit_batch import Orbits
from ..maps.parameters_as_states import swept_map
from ..maps.point_map import PointMap
from ..orbits.invariant_circle import bump
from ..orbits.newton import closed_orbit, newton
from ..orbits.orbit_kinds import PeriodicOrbit
from .bifurcation_curve import BifurcationCurve, continue_bifurcation
from .branch import Bifurcation, Branch
from .intervals import two_parameters
from .kinds import BifurcationKind
from .orbit_continuation import continue_orbit

_PARTS = 64  # values between two others at which rotation numbers are compared
_ROUNDS = 12
_REACH = 0.25  # largest distance, in extents, of the locked orbit from where orbits end
_LOCKED = 1e-9  # difference of rotation numbers that counts as none
_WIDER = 4.0  # borders of a tongue are sought this many of its widths to either side
_FURTHER = 256.0  # factor by which the search goes on where borders are not found, as when orbits settle slowly


@dataclass(frozen=True, eq=False)
class ArnoldTongue:
    """Arnold tongue: the rotation number is p/q between two curves of folds of orbits of period q.

    Parameters
    ----------
    rotations, period : int
        p and q.
    orbit : PeriodicOrbit
        Locked orbit inside the tongue.
    values : tuple of float
        Borders along the first parameter, at the second parameter of the map, in their unit.
    left, right : BifurcationCurve
        Curves of folds through these.
    """

    rotations: int
    period: int
    orbit: PeriodicOrbit
    values: tuple[float, float]
    left: BifurcationCurve
    right: BifurcationCurve

    @property
    def width(self) -> float:
        """Width along the first parameter, at the second parameter of the map."""
        return self.values[1] - self.values[0]

    def __repr__(self) -> str:
        name = self.left.parameters[0]
        return f"ArnoldTongue({self.rotations}/{self.period}, {name} from {self.values[0]:.9g} to {self.values[1]:.9g})"


@checked
def arnold_tongue(
    point_map: PointMap,
    rotations: int,
    period: int,
    parameters: tuple[str, str],
    first: tuple[float, float],
    second: tuple[float, float],
    initial_condition: ArrayLike,
    transient: int = 2000,
    periods: int = 4000,
    step: float = 0.02,
    max_points: int = 400,
) -> ArnoldTongue:
    """Find the Arnold tongue of a rotation number and continue its borders, curves of folds of locked orbits.

    At the second parameter of the map the rotation number is computed for values of the first one, and the tongue is
    enclosed: between values with smaller and larger rotation numbers.  Its locked orbit is refined by Newton's method
    and continued to its folds, which are continued in both parameters.  Rotation numbers are weighted Birkhoff
    averages: of the first angle, or of the turns around the mean of the orbit in the plane of the first two
    coordinates.

    Parameters
    ----------
    point_map : PointMap
        The map, at a value of the second parameter at which the tongue is open.
    rotations, period : int
        p and q of the rotation number p/q, without common divisor, 0 <= p <= q, or -q <= p < 0 for an angle that turns
        backwards.  In a plane without angles orbits are counted anticlockwise: where they turn p/q clockwise, the
        number is (q - p)/q.
    parameters : tuple of str
        Names of the two parameters.
    first, second : tuple of float
        Intervals of both, in their units.
    initial_condition : array_like, shape (dimension,)
        Initial condition of all orbits.
    transient, periods : int, optional
        Steps of the map that are discarded, and those over which rotation numbers are averaged.
    step : float, optional
        Longest step of the curves, in units in which the intervals have length 1.
    max_points : int, optional
        Largest number of points of each curve on either side.

    Returns
    -------
    ArnoldTongue
        The locked orbit and both borders.

    Raises
    ------
    ValueError
        For unknown parameters, p/q that are not reduced, or where no orbit with this rotation number is found: then the
        interval does not contain the tongue, or it is narrower than a part in 1e12 of it.

    References
    ----------
    Arnold, *Geometrical Methods in the Theory of Ordinary Differential Equations* (1983), chapter 3; Das, Saiki,
    Sander, Yorke, Nonlinearity 30 (2017) 4111 (weighted averages).

    Examples
    --------
    >>> from math import pi, sin
    >>> from cellmap import angle, discrete_map
    >>> circle = discrete_map(
    ...     lambda x, p: (x[0] + p.omega - p.k / (2 * pi) * sin(2 * pi * x[0]),),
    ...     {"omega": 0.5, "k": 0.8},
    ...     (angle("x", "", 1.0, 0.0),),
    ... )
    >>> arnold_tongue(circle, 1, 2, ("omega", "k"), (0.4, 0.6), (0.4, 1.0), [0.1])
    ArnoldTongue(1/2, omega from 0.475749661 to 0.524250339)
    """
    exact = point_map.without_table
    one, two = two_parameters(parameters, exact.params)
    if exact.dimension == 1 and exact.coordinates[0].period is None:
        raise ValueError(f"point_map={point_map!r} has neither an angle nor a plane in which orbits could rotate")
    q = whole_number("period", period, at_least=1)
    p = whole_number("rotations", rotations, -q if turns_of(exact.coordinates)[1].any() else 0)
    if gcd(p, q) != 1 or p > q:
        raise ValueError(f"rotations={p!r}, period={q!r}: give p and q without common divisor, p at most q")
    low, high = (finite_number("first", value) for value in pair_of("first", first))
    if not low < high:
        raise ValueError(f"first={shown(first)}: give an increasing pair of numbers")
    state = state_points("initial_condition", initial_condition, exact.coordinates)
    if state.ndim != 1:
        raise ValueError(f"initial_condition has shape {state.shape}: give one state")
    numbers = _RotationNumbers(
        exact, one, state, whole_number("transient", transient), whole_number("periods", periods, at_least=64)
    )
    inside, width = numbers.enclosed(p / q, low, high)
    here = exact.with_params(**{one: inside})
    orbit = _locked(here, numbers.end(inside), q)
    branch, ends = _borders(here, orbit, one, (low, high), _WIDER * width)

    def curve(fold: Bifurcation) -> BifurcationCurve:
        return continue_bifurcation(branch, fold, two, (low, high), second, step, max_points)

    return ArnoldTongue(p, q, orbit, (ends[0].value, ends[1].value), curve(ends[0]), curve(ends[1]))


def _borders(
    here: PointMap, orbit: PeriodicOrbit, name: str, interval: tuple[float, float], reach: float
) -> tuple[Branch, tuple[Bifurcation, Bifurcation]]:
    """Return the branch of a locked orbit and its folds on either side, looked for ever further away."""
    inside = here.params[name]
    while True:
        low, high = max(interval[0], inside - reach), min(interval[1], inside + reach)
        branch = continue_orbit(here, orbit, name, low, high, step=0.02, max_points=2000)
        folds = branch.of_kind(BifurcationKind.FOLD)
        left, right = [f for f in folds if f.value <= inside], [f for f in folds if f.value >= inside]
        if left and right:
            return branch, (max(left, key=lambda f: f.value), min(right, key=lambda f: f.value))
        if (low, high) == interval:
            raise ValueError(
                f"first={interval!r}: the locked orbit of period {orbit.period} at {name}={inside:.12g} does not end "
                "in folds on both sides within the interval"
            )
        reach *= _FURTHER


@dataclass(frozen=True, eq=False)
class _RotationNumbers:
    """Rotation numbers for values of one parameter, in SIMD lanes."""

    exact: PointMap
    name: str
    state: Floats
    transient: int
    periods: int

    @property
    def _has_angle(self) -> bool:
        return bool(turns_of(self.exact.coordinates)[1].any())

    def _orbits(self, values: Floats) -> tuple[PointMap, Orbits]:
        swept = swept_map(self.exact, self.name)
        states = np.column_stack([np.tile(self.state, (len(values), 1)), values])
        orbits = Orbits.starting(states)
        swept.advance(orbits, self.transient)
        orbits.rotations[:] = 0
        return swept, orbits

    def end(self, value: float) -> Floats:
        """Return where the orbit at a value is after the transient."""
        return np.asarray(self._orbits(np.array([value]))[1].points[0, :-1])

    def at(self, values: Floats) -> Floats:
        """Return the rotation numbers (n,) at values; NaN where an orbit ends."""
        swept, orbits = self._orbits(values)
        before = orbits.points.copy()
        points, rotations = [before], [orbits.rotations.copy()]
        for places, turned, _ in recorded(swept.advance, orbits, self.periods):
            points.extend(places)
            rotations.extend(turned)
        history, turns = np.array(points)[..., :-1], np.array(rotations)[..., :-1]
        if self._has_angle:
            turn = turns_of(self.exact.coordinates)[1]
            j = int(np.argmax(turn > 0.0))
            steps = np.diff(history[..., j], axis=0) / turn[j] + np.diff(turns[..., j], axis=0)
        else:
            shift = history[..., :2] - history[..., :2].mean(axis=0)
            phase = np.arctan2(shift[..., 1], shift[..., 0]) / (2.0 * np.pi)
            steps = np.diff(phase, axis=0) % 1.0
        return np.asarray(bump(len(steps)) @ steps)

    def enclosed(self, ratio: float, low: float, high: float) -> tuple[float, float]:
        """Return a value at which the rotation number is locked to p/q, and the width of the interval where it is."""
        left, right, remedy = low, high, ""
        for _ in range(_ROUNDS):
            values = np.linspace(left, right, _PARTS + 1)
            numbers = self.at(values)
            apart = numbers - ratio
            locked = np.flatnonzero(np.abs(apart) <= _LOCKED)
            if len(locked):
                first, last = locked[0], locked[-1]
                inside = float(values[(first + last) // 2])
                width = float(values[min(last + 1, _PARTS)] - values[max(first - 1, 0)])
                return inside, max(width, 1e-12 * (high - low))
            crossing = np.flatnonzero(apart[:-1] * apart[1:] < 0.0)
            # Rotation numbers are known up to whole numbers.
            crossing = crossing[np.abs(apart[crossing + 1] - apart[crossing]) < 0.5]
            if not len(crossing):
                mirrored = (numbers + ratio - (not self._has_angle))[np.isfinite(numbers)]
                found = mirrored.min(initial=np.inf) <= 0.0 <= mirrored.max(initial=-np.inf)
                if found and self._has_angle:
                    remedy = (
                        f"; the angle turns the other way, with the rotation number {-ratio:.9g}: give rotations with "
                        "the other sign"
                    )
                elif found:
                    remedy = (
                        f"; in the plane of the first two coordinates orbits turn clockwise, with the rotation number "
                        f"{1.0 - ratio:.9g}: give rotations=period - rotations"
                    )
                break
            left, right = float(values[crossing[0]]), float(values[crossing[0] + 1])
        raise ValueError(
            f"first={(low, high)!r}: no orbit with the rotation number {ratio:.9g} is found; give another interval of "
            f"{self.name}, or another initial condition{remedy}"
        )


def _locked(here: PointMap, state: Floats, period: int) -> PeriodicOrbit:
    """Return the periodic orbit beside a state."""
    turn = turns_of(here.coordinates)[1]
    extent = np.where(turn > 0.0, turn, np.maximum(np.abs(state), 1e-9))
    found, good = newton(here, state[None], np.array([period]), extent, _REACH)
    if not good[0]:
        raise ValueError(
            f"period={period!r}: the locked orbit is not found by Newton's method: take a longer transient"
        )
    return closed_orbit(here, found[0], period, extent)
