"""All branches of periodic orbits in a window, with isolas: orbits searched for at several parameter values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.checks import known_parameter, warn_caller, whole_number
from .._lib.signatures import checked
from ..maps.coordinates import difference
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from ..orbits.orbit_kinds import PeriodicOrbit
from ..orbits.periodic_search import find_periodic_orbits, is_inside
from .branch import Bifurcation, Branch
from .intervals import interval_between
from .kinds import BifurcationKind
from .orbit_continuation import continue_orbit, switch_branch

_OFFSET = 0.5 * (3.0 - np.sqrt(5.0))  # place of a value in its part of the interval, away from round numbers
_SINGULAR = 1e-4  # distance of a multiplier from 1
_SAME = 1e-6  # distance of equal solutions, as a fraction of the window or of an angle's period
_TWO_SIDED = {BifurcationKind.PITCHFORK, BifurcationKind.TRANSCRITICAL}


@dataclass(frozen=True, eq=False)
class BranchSearch:
    """Branches of periodic orbits that pass through a window, found by a search at several parameter values.

    Parameters
    ----------
    parameter : str
        Name of the parameter.
    branches : tuple of Branch
        The branches, each once; one whose ends are both "closed" is an isola.
    values : ndarray, shape (n,)
        Parameter values of the search, in the unit of the parameter.
    orbits : ndarray, shape (n,)
        Number of periodic orbits that the search has found at each value.
    present : ndarray of bool, shape (branches, n)
        Whether a branch passes each value of the search.
    connected : ndarray of bool, shape (branches,)
        Whether a branch was reached from another one at a bifurcation; the others were found by the search.
    not_followed : tuple of Bifurcation
        Bifurcations from which no further branch could be followed, though one leaves them.
    missed : ndarray of int, shape (n,)
        Number of orbits at each value, on the branches and in the window, that the search there has not found.
    late : ndarray of bool, shape (branches,)
        Whether a branch was found by the second search alone, half-way between the values and in other cells.
    """

    parameter: str
    branches: tuple[Branch, ...]
    values: Floats
    orbits: Ints
    present: Bools
    connected: Bools
    not_followed: tuple[Bifurcation, ...]
    missed: Ints
    late: Bools

    def __repr__(self) -> str:
        closed, missed, late = len(self.isolas), int(self.missed.sum()), int(self.late.sum())
        return (
            f"BranchSearch({len(self.branches)} branches over {self.parameter}, {closed} of them closed"
            f"{f', {late} found late' if late else ''}, {int(self.orbits.sum())} orbits at {len(self.values)} values"
            f"{f', {missed} missed' if missed else ''})"
        )

    @property
    def isolas(self) -> tuple[Branch, ...]:
        """The branches that are closed curves."""
        return tuple(b for b in self.branches if b.ends == ("closed", "closed"))


@checked
def find_branches(
    point_map: PointMap,
    parameter: str,
    lower: float,
    upper: float,
    region: CellGrid,
    longest_period: int = 1,
    n_values: int = 9,
    step: float = 0.01,
    max_points: int = 1000,
    progress: bool = False,
) -> BranchSearch:
    """Find the branches of periodic orbits in a window of states and an interval of a parameter, isolas included.

    At several parameter values all periodic orbits in the window are searched for.  Each that is on no known branch is
    continued, and from its bifurcations the branches that leave them.  A branch is missed if it passes none of the
    values, as a small isola between two of them, or if the search fails at all values that it passes.

    How likely that is, is seen in two ways.  The search is repeated half-way between the values, with one cell more
    along each axis; and what the first search has found at its values is compared with the orbits there of all
    branches.  Branches found by the second search alone, and orbits that the first one has missed, are in the record,
    and a warning says where they are, since both may have missed others.

    Parameters
    ----------
    point_map : PointMap
        The map; an interpolated map makes the search faster.
    parameter : str
        Name of the parameter.
    lower, upper : float
        Interval of parameter values, in its unit.
    region : CellGrid
        Window and cells of the search, as for :func:`find_periodic_orbits`.
    longest_period : int, optional
        Longest period in steps of the map.
    n_values : int, optional
        Number of equally spaced parameter values of the search.
    step, max_points, progress
        As for :func:`continue_orbit`.

    Returns
    -------
    BranchSearch
        The branches, and what the search has found at each value.

    Raises
    ------
    TypeError, ValueError
        For an unknown parameter, an empty interval, or a window that does not fit the map.

    Warns
    -----
    UserWarning
        If a branch is found by the second search alone, or an orbit on a branch is missed by the first.

    Examples
    --------
    A circle of fixed points, x^2 + q^2 = 1, beside a line of others, x = 3:

    >>> from cellmap import CellGrid, discrete_map
    >>> ring = discrete_map(lambda x, p: (x[0] + 0.1 * (1 - x[0]**2 - p.q**2) * (x[0] - 3),), {"q": 0.0}, ("x",))
    >>> find_branches(ring, "q", -2.0, 2.0, CellGrid((-2.05,), (4.0,), (200,)))
    BranchSearch(2 branches over q, 1 of them closed, ... orbits at 9 values)
    """
    low, high = interval_between(lower, upper)
    known_parameter("parameter", parameter, point_map.params)
    longest = whole_number("longest_period", longest_period, at_least=1)
    count = whole_number("n_values", n_values, at_least=1)
    values = low + (high - low) * (np.arange(count) + _OFFSET) / count
    grid = region.on(point_map.coordinates, "region")
    more = replace(grid, shape=tuple(n + (a < b) for n, a, b in zip(grid.shape, grid.lower, grid.upper, strict=True)))
    found = _Found(_tolerances(point_map, region), (low, high), longest, step, max_points, progress)
    searches = {v: found.search(point_map, parameter, v, grid) for v in values.tolist()}
    early = len(found.branches)
    for value in (0.5 * (values[:-1] + values[1:])).tolist():
        found.search(point_map, parameter, value, more)
    branches = found.branches
    present = [[bool(b.values.min() <= v <= b.values.max()) for v in values.tolist()] for b in branches]
    search = BranchSearch(
        parameter=parameter,
        branches=tuple(branches),
        values=values,
        orbits=np.array([len(orbits) for orbits in searches.values()]),
        present=np.array(present, dtype=bool).reshape(len(branches), count),
        connected=np.array(found.connected, dtype=bool),
        not_followed=tuple(found.not_followed),
        missed=np.array([found.missing(orbits, v, grid) for v, orbits in searches.items()]),
        late=np.arange(len(branches)) >= early,
    )
    _warn(search)
    return search


def _warn(search: BranchSearch) -> None:
    """Warn where orbits or branches were not found by the first search."""
    if search.missed.any():
        places = ", ".join(f"{v:.6g}" for v in search.values[search.missed > 0])
        warn_caller(
            f"{int(search.missed.sum())} orbits on the branches at {search.parameter}={places} were missed by the "
            "search there, and others may be missed at all values: give finer cells in region"
        )
    if search.late.any():
        places = ", ".join(
            f"{b.values.min():.6g} to {b.values.max():.6g}" for b in np.array(search.branches)[search.late]
        )
        warn_caller(
            f"{int(search.late.sum())} of {len(search.late)} branches, over {search.parameter}={places}, were found by "
            "the second search alone, and others may be missed: give more n_values, or finer cells in region"
        )


def _is_regular(orbit: PeriodicOrbit) -> bool:
    """Return whether an orbit is away from a bifurcation, at which Newton's method ends anywhere near it."""
    return float(np.abs(orbit.multipliers - 1.0).min()) > _SINGULAR


def _tolerances(point_map: PointMap, region: CellGrid) -> Floats:
    """Return how near to each other points of one orbit are, at least, in each coordinate."""
    widths = np.subtract(region.upper, region.lower)
    periods = [c.period or np.inf for c in point_map.coordinates]
    return np.asarray(_SAME * np.minimum(widths, periods))


class _Found:
    """Branches found so far, each once."""

    def __init__(
        self, tolerances: Floats, interval: tuple[float, float], longest: int, step: float, most: int, progress: bool
    ) -> None:
        self.branches: list[Branch] = []
        self.connected: list[bool] = []
        self.not_followed: list[Bifurcation] = []
        self._tolerances, self._interval, self._longest = tolerances, interval, longest
        self._step, self._most, self._progress = step, most, progress
        self._orbits: dict[tuple[int, float], tuple[PeriodicOrbit, ...]] = {}

    def search(self, point_map: PointMap, parameter: str, value: float, grid: CellGrid) -> tuple[PeriodicOrbit, ...]:
        """Return the orbits found at a parameter value, and add the branches of those that are on none."""
        there = point_map.with_params(**{parameter: value})
        orbits = find_periodic_orbits(there, grid, self._longest, self._progress)
        for orbit in orbits:
            if _is_regular(orbit) and not self.has(orbit, value):
                exact, (low, high) = there.without_table, self._interval
                branch = continue_orbit(
                    exact, orbit, parameter, low, high, self._step, self._most, progress=self._progress
                )
                self.add(branch, connected=False)
        return orbits

    def has(self, orbit: PeriodicOrbit, value: float) -> bool:
        """Return whether an orbit at a parameter value is on one of the branches."""
        return any(
            self._same(orbit, other)
            for number, branch in enumerate(self.branches)
            if branch.period % orbit.period == 0
            for other in self._at(number, value)
        )

    def missing(self, orbits: Sequence[PeriodicOrbit], value: float, grid: CellGrid) -> int:
        """Return how many orbits in the window are on the branches at a value, and not among those found there."""
        there = [o for number in range(len(self.branches)) for o in self._at(number, value) if _is_regular(o)]
        inside = [o for o in there if any(is_inside(grid, point) for point in o.points)]
        return sum(not any(self._same(orbit, other) for orbit in orbits) for other in inside)

    def _at(self, number: int, value: float) -> tuple[PeriodicOrbit, ...]:
        key = (number, value)
        if key not in self._orbits:
            self._orbits[key] = self.branches[number].orbits_at(value)
        return self._orbits[key]

    def _same(self, orbit: PeriodicOrbit, other: PeriodicOrbit) -> bool:
        apart = np.abs(difference(other.points, orbit.points[0], orbit.coordinates))
        return bool((apart <= self._tolerances).all(axis=-1).any())

    def add(self, branch: Branch, connected: bool) -> None:
        """Add a branch, and those that leave it at its bifurcations if they are new."""
        self.branches.append(branch)
        self.connected.append(connected)
        for bifurcation, side in self._leaving(branch):
            try:
                further = switch_branch(
                    branch, bifurcation, *self._interval, self._step, self._most, side, self._progress
                )
            except ValueError:
                self.not_followed.append(bifurcation)
                continue
            value = float(0.5 * (further.values.min() + further.values.max()))
            orbits = further.orbits_at(value)
            if not orbits or not self.has(orbits[0], value):
                self.add(further, connected=True)

    def _leaving(self, branch: Branch) -> Iterator[tuple[Bifurcation, int]]:
        for bifurcation in branch.bifurcations:
            if bifurcation.kind is BifurcationKind.PERIOD_DOUBLING and 2 * branch.period <= self._longest:
                yield bifurcation, 1
            elif bifurcation.kind in _TWO_SIDED:
                yield bifurcation, 1
                yield bifurcation, -1
