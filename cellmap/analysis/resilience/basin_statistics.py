"""Statistics of basins: the fraction of random states that converge to each attractor, and how long that takes."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._lib.arrays import Floats, Ints
from ..._lib.binomial import binomial_interval
from ..._lib.checks import affordable_number, finite_number, of_the_user
from ..._lib.randomness import Rng, random_numbers
from ..._lib.records import Keyed
from ..._lib.signatures import checked
from ...attractors.settling.labels import LABEL_NAMES, Label, label_names, stored_names
from ...basins.classification import labeller
from ...basins.finding import labelled
from ...basins.record import Basins
from ...maps.coordinates import Coordinate, state_points
from ...maps.grid import CellGrid
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, distinct_names

Distribution = Callable[[np.random.Generator, int], Floats]
"""``distribution(rng, n)`` draws n states, shape (n, dimension)."""


@dataclass(frozen=True, eq=False)
class SampledFraction:
    """Fraction of random states that converge to one attractor, or that have one of the other labels.

    Parameters
    ----------
    fraction : float
        Fraction of all states drawn; undecided ones count as outside the basin.
    standard_error : float
        Standard error of the fraction.
    low, high : float
        Confidence interval of the fraction.  For a basin, `low` assumes that no undecided state belongs to it and
        `high` that all do, so that the interval is valid wherever they converge.
    count : int
        Number of states.
    """

    fraction: float
    standard_error: float
    low: float
    high: float
    count: int

    def __repr__(self) -> str:
        return f"SampledFraction({self.fraction:.4g} in [{self.low:.4g}, {self.high:.4g}], {self.count} states)"


@dataclass(frozen=True, eq=False)
class BasinStability:
    """Basin stability: fractions of the basins in a distribution of states.

    Parameters
    ----------
    fractions : mapping of int to SampledFraction
        Fraction of each attractor, then of each of the labels -1, -2, -3 that occurred.
    names : mapping of int to str
        Meaning of each label.
    states : ndarray, shape (n, dimension)
        States that were drawn.
    labels : ndarray of int16, shape (n,), or of int32 for more than 32,767 attractors
        Labels of the states.
    settling_time : ndarray of int32, shape (n,)
        Settling times of the states, -1 without one.
    confidence : float
        Confidence level of the intervals.
    exponents : mapping of int to float
        Largest Lyapunov exponent of each attractor per step of the map: its linear stability.
    """

    fractions: Mapping[int, SampledFraction]
    names: Mapping[int, str]
    states: Floats
    labels: NDArray[np.int16]
    settling_time: NDArray[np.int32]
    confidence: float
    exponents: Mapping[int, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        parts = [f"{self.names[k]} {s.fraction:.4g} [{s.low:.4g}, {s.high:.4g}]" for k, s in self.fractions.items()]
        return f"BasinStability({len(self.labels)} states: {'; '.join(parts)})"

    @property
    def undecided(self) -> int:
        """Number of undecided states."""
        return int(np.count_nonzero(self.labels == Label.UNDECIDED))


@checked
def basin_stability(
    source: Basins | PointMap,
    distribution: CellGrid | Distribution | None = None,
    n_samples: int = 10_000,
    attractors: Sequence[Attractor] = (),
    *,
    rng: Rng = 0,
    confidence: float = 0.95,
    method: str = "exact",
    point_map: PointMap | None = None,
    max_periods: int | None = None,
    client: Any = None,
    checkpoint: str | os.PathLike[str] | None = None,
) -> BasinStability:
    r"""Compute basin stability: the fraction of random states that converge to each attractor.

    It is :math:`S = \int_B \rho(x) \, dx` for the basin B and the density :math:`\rho` of the states.

    Parameters
    ----------
    source : Basins or PointMap
        Basins with their map, or a map with its `attractors`.
    distribution : CellGrid or callable, optional
        A window in which states are uniform, a function ``distribution(rng, n)`` that draws n states, or what
        :func:`random_box` and :func:`random_ball` return.  By default the window of the basins.
    n_samples : int, optional
        Number of states.
    attractors : sequence of Attractor, optional
        Attractors of a map.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the draw.
    confidence : float, optional
        Confidence level of each interval separately.
    method : {"exact", "Wilson"}, optional
        Method of the interval, see :func:`binomial_interval`.
    point_map : PointMap, optional
        Map to use instead of the exact one of the basins, such as an interpolated map.
    max_periods : int, optional
        Number of periods after which a state is undecided.
    client : distributed.Client, optional
        Dask cluster that labels the states; by default the threads of this process do.
    checkpoint : path-like, optional
        File in which labels are stored as they are computed, as by :func:`~cellmap.basins.find_basins`: repeating a
        call that was interrupted resumes it.  States have to be drawn again as they were, by a seed.

    Returns
    -------
    BasinStability
        Fractions with their confidence intervals.

    Raises
    ------
    TypeError, ValueError
        For basins without their map, no attractors, or a distribution that does not draw n states.

    References
    ----------
    Menck, Heitzig, Marwan, Kurths, Nature Physics 9 (2013) 89.

    Examples
    --------
    >>> from cellmap import discrete_map, find_basins
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))
    >>> basins = find_basins(cubic, CellGrid((-1.5,), (1.5,), (60,)))
    >>> basin_stability(basins, CellGrid((-0.5,), (1.5,), (1,)), n_samples=1000).fractions[0]
    SampledFraction(0.769 in [0.7416, 0.7948], 769 states)
    """
    label = labeller(source, attractors, point_map, max_periods)
    number = affordable_number("n_samples", n_samples, 8 * (4 * label.point_map.dimension + 6), at_least=1)
    if distribution is None and isinstance(source, Basins):
        distribution = source.grid
    states = drawn_states(distribution, label.point_map.coordinates, number, rng)
    if client is None and checkpoint is None:
        settled = label.settle(states)
        labels, times = settled.labels, settled.times
    else:
        labels, times = labelled(label.point_map, states, label.attractors, label.max_periods, client, checkpoint)
    undecided = int(np.count_nonzero(labels == Label.UNDECIDED))
    others = label_names(label.point_map.ends)
    present = [code for code in LABEL_NAMES if (labels == code).any()]
    sampled = {}
    for k in [*range(len(label.attractors)), *present]:
        count = int(np.count_nonzero(labels == k))
        low, high = (float(v) for v in binomial_interval(count, number, confidence, method))
        if k >= 0 and undecided:
            high = float(binomial_interval(count + undecided, number, confidence, method)[1])
        mean = count / number
        sampled[k] = SampledFraction(mean, float(np.sqrt(mean * (1.0 - mean) / number)), low, high, count)
    names = {**dict(enumerate(distinct_names(label.attractors))), **{code: others[code] for code in present}}
    exponents = {k: float(a.exponents[0]) for k, a in enumerate(label.attractors)}
    return BasinStability(
        Keyed(sampled, "fractions", names),
        Keyed(names, "names"),
        states,
        labels,
        times,
        confidence,
        Keyed(exponents, "exponents", names),
    )


def drawn_states(distribution: object, coordinates: Sequence[Coordinate], n: int, rng: Rng) -> Floats:
    """Draw states (n, d) from a window or by a function, the argument `distribution` of that name."""
    rng = random_numbers(rng)
    d = len(coordinates)
    if isinstance(distribution, CellGrid):
        window = distribution.on(coordinates, "distribution")
        return rng.uniform(window.lower, window.upper, (n, d))
    if distribution is None:
        raise ValueError("distribution is missing: give a CellGrid as a window, or a function (rng, n) of states")
    if not callable(distribution):
        raise TypeError(f"distribution={distribution!r}: give a CellGrid as a window, or a function (rng, n) of states")
    drawn = of_the_user("distribution", distribution, rng, n)
    states = state_points("distribution", drawn, coordinates)
    if states.shape != (n, d):
        raise ValueError(f"distribution returns the shape {states.shape}: return {n} states, shape ({n}, {d})")
    return states


@dataclass(frozen=True, eq=False)
class SettlingTimes:
    """Settling times of the initial conditions in one basin, in steps of the map.

    Parameters
    ----------
    name : str
        Name of the attractor.
    count : int
        Number of initial conditions.
    mean, standard_error : float
        Mean and its standard error, as for random initial conditions; NaN for fewer than one and two of them.
    levels : tuple of float
        Levels of the quantiles.
    quantiles : ndarray, shape (levels,)
        Smallest times that at least this fraction of the initial conditions does not exceed; NaN without any.
    longest : int
        Longest time, -1 without any.
    times : ndarray of int32, shape (longest + 1,)
        Number of initial conditions for each settling time 0, 1, ...
    """

    name: str
    count: int
    mean: float
    standard_error: float
    levels: tuple[float, ...]
    quantiles: Floats
    longest: int
    times: Ints

    def __repr__(self) -> str:
        middle = ", ".join(f"{100 * p:g} %: {q:g}" for p, q in zip(self.levels, self.quantiles, strict=True))
        mean = f"mean {self.mean:.4g} +- {self.standard_error:.2g}"
        return f"SettlingTimes({self.name}, {self.count} initial conditions, {mean}; {middle})"


@dataclass(frozen=True, eq=False)
class SettlingStatistics:
    """Settling times in all basins, and numbers of initial conditions without one.

    Parameters
    ----------
    basins : mapping of int to SettlingTimes
        Settling times by label.
    others : mapping of str to int
        Numbers of initial conditions that escaped, diverged or are undecided.  Undecided ones have longer settling
        times in some basin, so that the times of each basin are conditional on having settled.
    """

    basins: Mapping[int, SettlingTimes]
    others: Mapping[str, int]

    def __repr__(self) -> str:
        lines = [f"{s.name} {s.mean:.4g} +- {s.standard_error:.2g}" for s in self.basins.values()]
        lines += [f"{count} initial conditions {name}" for name, count in self.others.items() if count]
        return f"SettlingStatistics({'; '.join(lines)})"

    @property
    def undecided(self) -> int:
        """Number of initial conditions that had not settled at the end."""
        return self.others[LABEL_NAMES[Label.UNDECIDED]]


@checked
def settling_statistics(
    source: Basins | BasinStability, levels: Sequence[float] = (0.25, 0.5, 0.75, 0.95)
) -> SettlingStatistics:
    r"""Compute mean and quantiles of the settling times in each basin.

    The settling time of x is :math:`T(x) = \min\{n \ge 0 \,:\, f^n(x) \in U\}`, the first step at which its orbit under
    the map f is inside the verified trapping neighbourhood U of its attractor.  It depends on the width of that
    neighbourhood; compare only times of the same set of attractors.

    Parameters
    ----------
    source : Basins or BasinStability
        Basins, or states, with settling times.
    levels : sequence of float, optional
        Levels of quantiles, between 0 and 1.

    Returns
    -------
    SettlingStatistics
        Statistics of each basin; initial conditions that are undecided, escaped or diverged are counted separately.

    Raises
    ------
    TypeError, ValueError
        For something without settling times, or levels out of range.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map, find_basins
    >>> half = discrete_map(lambda x, p: (x[0] / 2 + 4 * x[0] ** 3,), {}, ("x",))
    >>> settling_statistics(find_basins(half, CellGrid((-0.5,), (0.5,), (64,)))).others["diverged"]
    18
    """
    wanted = tuple(finite_number("levels", p, at_least=0.0, at_most=1.0) for p in levels)
    if isinstance(source, Basins):
        names = {k: source.label_name(k) for k in range(len(source.attractors))}
    else:
        names = {k: name for k, name in source.names.items() if k >= 0}
    labels, times = source.labels.ravel(), source.settling_time.ravel()
    found = {k: _statistics(name, times[labels == k], wanted) for k, name in names.items()}
    known = stored_names(source.settings) if isinstance(source, Basins) else {**LABEL_NAMES, **source.names}
    counts = {k: int(np.count_nonzero(labels == k)) for k in LABEL_NAMES}
    others = {known[k]: count for k, count in counts.items() if count or k > Label.ENDED}
    return SettlingStatistics(Keyed(found, "basins", names), Keyed(others, "others"))


def _statistics(name: str, times: NDArray[np.int32], levels: tuple[float, ...]) -> SettlingTimes:
    n = len(times)
    mean = float(times.mean()) if n else np.nan
    error = float(times.std(ddof=1) / np.sqrt(n)) if n > 1 else np.nan
    quantiles = np.quantile(times, levels, method="inverted_cdf") if n else np.full(len(levels), np.nan)
    counts = np.bincount(times).astype(np.int64) if n else np.zeros(0, np.int64)
    return SettlingTimes(
        name, n, mean, error, levels, np.asarray(quantiles, dtype=float), int(times.max(initial=-1)), counts
    )
