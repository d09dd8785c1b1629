"""Basins of attraction."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .attractor import Attractor, distinct_names, sort_key
from .chaos import chaotic_attractors
from .checks import claim_memory, finite_points, whole_number
from .coordinates import Coordinate, wrap
from .grid import CellGrid, grid_points
from .pointmap import CHUNK, Cost, Orbits, PointMap, ToleranceWarning
from .search import Examined, check_attractors, region_extent, search, sort_out
from .settling import DIVERGED, ESCAPED, NO_RETURN, UNDECIDED, Catalogue, settle
from .threads import run_over, slices

LABEL_NAMES = {ESCAPED: "left the window", DIVERGED: "diverged", UNDECIDED: "undecided", NO_RETURN: "did not return"}
"""Names of the labels that are not attractors."""

_Rows = range | NDArray[np.int64]

_SAMPLE = 1024  # starts from which attractors are sought first
_PATIENCE = 256  # periods before starts that are left are searched for further attractors


@dataclass(frozen=True)
class Fraction:
    """Share of the starts that carry one label.

    Parameters
    ----------
    share : float
        Between 0 and 1.
    standard_error : float
        Of the share, as an estimate of the basin's share of the window, if the starts were random; for the centres of a
        grid this is an upper bound.
    count : int
        Number of starts.
    """

    share: float
    standard_error: float
    count: int


@dataclass(frozen=True)
class Verification:
    """Agreement of labels with exact integration.

    Parameters
    ----------
    starts : int
        Random starts that were compared.
    wrong : int
        Starts whose label differs.
    share : float
        ``wrong / starts``.
    low, high : float
        95 % confidence interval of the share (Wilson 1927).
    excluded : int
        Starts drawn that left the window, where there is nothing to compare.
    """

    starts: int
    wrong: int
    share: float
    low: float
    high: float
    excluded: int


@dataclass(frozen=True, eq=False)
class Basins:
    """Labels of starts, and the attractors that they name.

    Parameters
    ----------
    labels : ndarray of int16
        For each start the number of its attractor, or -1 (left the window), -2 (diverged), -3 (undecided), -4 (did not
        return to the section); shape of the grid, or of the starts without their last axis.
    attractors : tuple of Attractor
        Attractor k has the label k.
    settling_time : ndarray of int32
        Period in which the orbit was first inside a region that is known to belong to its attractor; -1 without one.
    grid : CellGrid or None
        Cells whose centres are the starts.
    starts : ndarray or None
        Starts, where no grid was given.
    name : str
        Name of the system.
    params : mapping of str to float
        Its parameters.
    coordinates : tuple of Coordinate
        State variables.
    settings : mapping
        Arguments of :func:`find_basins`, and under ``"map"`` the recipe of the map.
    inaccurate : int
        Starts on whose way the integrator missed its tolerance.
    cost : Cost
        Wall time and number of steps of the map.
    point_map : PointMap or None
        The map; None after loading from a file.
    """

    labels: NDArray[np.int16]
    attractors: tuple[Attractor, ...]
    settling_time: NDArray[np.int32]
    grid: CellGrid | None
    starts: NDArray[np.float64] | None
    name: str
    params: Mapping[str, float]
    coordinates: tuple[Coordinate, ...]
    settings: Mapping[str, Any]
    inaccurate: int = 0
    cost: Cost = Cost()
    point_map: PointMap | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        shares = "; ".join(f"{self.label_name(k)} {100 * f.share:.4g} %" for k, f in self.fractions.items())
        return f"Basins({self.name}, {self.labels.size:,} starts: {shares})"

    def label_name(self, label: int) -> str:
        """Return what a label stands for."""
        return distinct_names(self.attractors)[label] if label >= 0 else LABEL_NAMES[label]

    @property
    def fractions(self) -> dict[int, Fraction]:
        """Share of the starts for each label: all attractors, then the other labels that occur."""
        total = self.labels.size
        present = [label for label in LABEL_NAMES if (self.labels == label).any()]
        result = {}
        for label in [*range(len(self.attractors)), *present]:
            count = int(np.count_nonzero(self.labels == label))
            share = count / total
            result[label] = Fraction(share, float(np.sqrt(share * (1 - share) / total)), count)
        return result

    def verify(self, n: int = 1000, seed: int = 0) -> Verification:
        """Label random starts again by the exact map and compare.

        Parameters
        ----------
        n : int, optional
            Starts, drawn with replacement.
        seed : int, optional
            Seed of the draw.

        Returns
        -------
        Verification
            Share of wrong labels with its confidence interval.

        Raises
        ------
        ValueError
            For basins without their map, as they come from a file.
        """
        if self.point_map is None:
            raise ValueError("these basins have no map: rebuild it with rebuild_map and find the basins again")
        n = whole_number("n", n, at_least=1)
        exact = self.point_map.exact or self.point_map
        drawn = np.random.default_rng(seed).integers(0, self.labels.size, n)
        drawn = drawn[self.labels.ravel()[drawn] != ESCAPED]
        starts = _starts(self.grid, self.starts, drawn)
        # Far inside the neighbourhoods, so that these are not taken on trust.
        catalogue = Catalogue.of(self.attractors, exact)
        close = catalogue.shrunk(0.01)
        labels = np.empty(len(drawn), np.int16)
        # Neighbourhoods of a cycle are not all of one size, and in a round an orbit visits each.
        round_ = max((a.period for a in self.attractors), default=1)

        def label(part: slice) -> None:
            orbits = Orbits.starting(wrap(starts[part], exact.coordinates))
            half = self.settings["max_periods"] // 2
            early = settle(exact, orbits, close, half)
            labels[part] = early.labels
            before = _closest(exact, early.orbits, catalogue, round_)
            late = settle(exact, early.orbits, close, self.settings["max_periods"] - half, half)
            # One that converges slowly is still on its way; one at rest elsewhere is not.
            slow = late.undecided
            nearer = _closest(exact, late.orbits, catalogue, round_) < before[slow] * (1.0 - 1e-9)
            owners = settle(exact, late.orbits, catalogue, round_).labels
            late.labels[slow] = np.where((owners >= 0) & nearer, owners, UNDECIDED)
            labels[part.start + early.undecided] = late.labels

        run_over(slices(len(drawn), CHUNK // 8), label)
        wrong = int(np.count_nonzero(labels != self.labels.ravel()[drawn]))
        return Verification(len(drawn), wrong, wrong / max(len(drawn), 1), *_wilson(wrong, len(drawn)), n - len(drawn))


def find_basins(
    point_map: PointMap,
    starts: CellGrid | ArrayLike,
    max_periods: int = 2000,
    max_period: int = 32,
    attractors: Sequence[Attractor] = (),
    progress: bool = False,
) -> Basins:
    """Find the attractors of a map and the basin to which each start belongs.

    Every start is iterated until it is inside a neighbourhood that is verified to belong to an attractor; see
    :func:`find_attractors` for how those are found.  Starts that are left after many periods are searched for further
    attractors, so that small basins are found too.

    Parameters
    ----------
    point_map : PointMap
        Exact, interpolated or discrete map.
    starts : CellGrid or array_like, shape (..., dimension)
        Cells, whose centres are the starts, or the starts themselves.
    max_periods : int, optional
        Periods after which a start that has not settled is undecided.
    max_period : int, optional
        Longest period of a periodic attractor.
    attractors : sequence of Attractor, optional
        Attractors that are known already, with their neighbourhoods.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.

    Returns
    -------
    Basins
        Labels, attractors, fractions and settling times.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range.
    MemoryError
        Where labels do not fit into memory.

    Warns
    -----
    ToleranceWarning
        Where the integrator missed its tolerance on the way of some starts.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> def newton(x, p):
    ...     return x[0] / 2 + 1 / (2 * x[0]),
    >>> signs = find_basins(discrete_map(newton, {}, ("x",)), CellGrid((-3,), (3,), (100,)))
    >>> signs.attractors[0].points.round(12), signs.fractions[0].share
    (array([[1.]]), 0.5)
    """
    if not isinstance(point_map, PointMap):
        raise TypeError(f"point_map={point_map!r}: give a PointMap, such as stroboscopic_map returns")
    max_periods = whole_number("max_periods", max_periods, at_least=1)
    max_period = whole_number("max_period", max_period, at_least=1)
    check_attractors(attractors, point_map, "attractors")
    began = time.perf_counter()
    if isinstance(starts, CellGrid):
        grid, given, shape = starts.on(point_map.coordinates), None, starts.shape
    else:
        given = finite_points("starts", starts, point_map.dimension)
        grid, shape = None, given.shape[:-1]
    total = int(np.prod(shape, dtype=object))
    if not total:
        raise ValueError("starts is empty: give at least one start")
    claim_memory(f"labels of {total:,} starts", basins_memory(total), "take fewer starts")
    run = _Run(point_map, grid, given, total, max_periods, max_period, progress)
    run.find(list(attractors))
    found = run.in_use()
    if run.inaccurate:
        warnings.warn(
            f"the integrator missed its tolerance on the way of {run.inaccurate} of {total} starts; loosen rtol and "
            "atol, or allow more steps with max_steps",
            ToleranceWarning,
            stacklevel=2,
        )
    return Basins(
        labels=run.labels.reshape(shape),
        attractors=found,
        settling_time=run.times.reshape(shape),
        grid=grid,
        starts=given,
        name=point_map.name,
        params=dict(point_map.params),
        coordinates=point_map.coordinates,
        settings={"max_periods": max_periods, "max_period": max_period, "map": dict(point_map.recipe)},
        inaccurate=run.inaccurate,
        cost=Cost(seconds=time.perf_counter() - began, steps=run.steps),
        point_map=point_map,
    )


def basins_memory(starts: int) -> int:
    """Return the bytes that the labels and settling times of a number of starts need."""
    return 6 * starts


def _starts(grid: CellGrid | None, given: NDArray[np.float64] | None, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return some of the starts, by their flat numbers."""
    if grid is not None:
        return grid_points([grid.axis(j) for j in range(grid.dimension)], rows)
    assert given is not None
    return given.reshape(-1, given.shape[-1])[rows]


def _closest(exact: PointMap, orbits: Orbits, catalogue: Catalogue, periods: int) -> NDArray[np.float64]:
    """Return how close orbits come to attractors within some periods, in radii of their neighbourhoods."""
    moving = Orbits.starting(orbits.points.copy())
    closest = catalogue.distances_of(moving.points)
    for _ in range(periods - 1):
        exact.advance(moving, 1)
        closest = np.fmin(closest, catalogue.distances_of(moving.points))
    return closest


class _Run:
    """Labelling of all starts, in slices; only what is left after many periods keeps its state."""

    def __init__(
        self,
        point_map: PointMap,
        grid: CellGrid | None,
        given: NDArray[np.float64] | None,
        total: int,
        max_periods: int,
        max_period: int,
        progress: bool,
    ) -> None:
        self.point_map, self.grid, self.given = point_map, grid, given
        self.max_periods, self.max_period, self.progress = max_periods, max_period, progress
        self.labels = np.full(total, UNDECIDED, np.int16)
        self.times = np.full(total, -1, np.int32)
        self.attractors: list[Attractor] = []
        self.inaccurate = self.steps = 0

    def find(self, known: list[Attractor]) -> None:
        """Find attractors from a sample, label all starts, and look again at those that are left."""
        total = len(self.labels)
        sample = np.arange(total)
        if total > _SAMPLE:
            sample = np.sort(np.random.default_rng(0).choice(total, _SAMPLE, replace=False))
        chosen = self._begin(sample)
        corners = chosen if self.grid is None else np.array([self.grid.lower, self.grid.upper])
        extent = region_extent(self.point_map, corners)
        examined = Examined.nothing_yet(self.point_map, extent)
        self._search(chosen, known, total > _SAMPLE, extent, examined)
        rows: _Rows = range(total)
        orbits: Orbits | None = None
        age, horizon = 0, min(_PATIENCE, self.max_periods)
        while True:
            rows, orbits = self._label(rows, orbits, horizon - age, age)
            age = horizon
            if not len(rows):
                return
            if self._find_more(orbits, extent, age, examined):
                # From the beginning, so that settling times are those of the whole catalogue.
                rows, orbits, age = self._unsettled(), None, 0
            elif age == self.max_periods:
                return
            else:
                horizon = min(2 * horizon, self.max_periods)

    def _search(
        self,
        chosen: NDArray[np.float64],
        known: list[Attractor],
        to_the_end: bool,
        extent: NDArray[np.float64],
        examined: Examined,
    ) -> None:
        """Find attractors from a sample; where this is all starts, those that take long are left to their labelling."""
        own = region_extent(self.point_map, chosen)
        if not np.array_equal(own, extent):
            examined = Examined.nothing_yet(self.point_map, own)
        periods = self.max_periods if to_the_end else min(_PATIENCE, self.max_periods)
        left, self.attractors, age = search(self.point_map, chosen, known, periods, self.max_period, own, examined)
        if to_the_end and len(left):
            self.attractors += chaotic_attractors(self.point_map, left.points, own, self.attractors, age)

    def _unsettled(self) -> _Rows:
        """Rows that further attractors may concern: no orbit from a verified neighbourhood enters another one."""
        if any(a.neighbourhood is None for a in self.attractors):
            return range(len(self.labels))
        return np.flatnonzero(self.labels < 0)

    def in_use(self) -> tuple[Attractor, ...]:
        """Order the attractors, drop those that no start ends on, and number the labels accordingly."""
        used = [k for k in range(len(self.attractors)) if (self.labels == k).any()]
        used.sort(key=lambda k: sort_key(self.attractors[k]))
        number = np.arange(min(LABEL_NAMES), len(self.attractors), dtype=np.int16)
        for new, old in enumerate(used):
            number[old - min(LABEL_NAMES)] = new
        self.labels = number[self.labels - min(LABEL_NAMES)]
        return tuple(self.attractors[k] for k in used)

    def _begin(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        return wrap(_starts(self.grid, self.given, rows), self.point_map.coordinates)

    def _label(self, rows: _Rows, orbits: Orbits | None, periods: int, age: int) -> tuple[NDArray[np.int64], Orbits]:
        """Label starts within some periods, from states of some age; return the rows that are left and their states."""
        catalogue = Catalogue.of(self.attractors, self.point_map)
        parts = slices(len(rows), CHUNK)
        left: dict[int, tuple[NDArray[np.int64], Orbits]] = {}
        tally = np.zeros((len(parts), 2), np.int64)

        def work(number: int) -> None:
            mine = np.asarray(rows[parts[number]])
            states = Orbits.starting(self._begin(mine)) if orbits is None else orbits[parts[number]]
            settled = settle(self.point_map, states, catalogue, periods, age)
            self.labels[mine], self.times[mine] = settled.labels, settled.times
            left[number] = (mine[settled.undecided], settled.orbits)
            tally[number] = settled.steps, settled.inaccurate

        run_over(range(len(parts)), work, f"basins of {self.point_map.name}" if self.progress else None)
        steps, inaccurate = tally.sum(axis=0)
        self.steps += int(steps)
        self.inaccurate += int(inaccurate)
        remaining = [left[number] for number in range(len(parts))]
        return np.concatenate([mine for mine, _ in remaining]), Orbits.joined([o for _, o in remaining])

    def _find_more(self, orbits: Orbits, extent: NDArray[np.float64], age: int, examined: Examined) -> bool:
        """Search the orbits that are left for further attractors; tell whether there are any."""
        before = len(self.attractors)
        left, self.attractors = sort_out(
            self.point_map, orbits, self.attractors, self.max_period, extent, age, examined
        )
        if age == self.max_periods and len(left):
            self.attractors += chaotic_attractors(self.point_map, left.points, extent, self.attractors, age)
        return len(self.attractors) > before


def _wilson(wrong: int, n: int) -> tuple[float, float]:
    """Return the 95 % interval of a share of `wrong` in n (Wilson 1927)."""
    if n == 0:
        return 0.0, 1.0
    z, share = 1.959963984540054, wrong / n
    centre = share + z * z / (2 * n)
    half = z * np.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    low, high = (centre - half) / (1 + z * z / n), (centre + half) / (1 + z * z / n)
    return float(max(low, 0.0)) if wrong else 0.0, float(min(high, 1.0)) if wrong < n else 1.0
