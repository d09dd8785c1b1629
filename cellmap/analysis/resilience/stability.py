"""Basin stability: the share of perturbations after which a system comes back; and how long it takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._lib.binomial import binomial_interval
from ..._lib.checks import affordable_number, of_the_user, random_numbers
from ..._lib.signatures import checked
from ...attractors.settling import UNDECIDED
from ...basins.classification import Labeller, labeller
from ...basins.record import LABEL_NAMES, Basins
from ...maps.coordinates import state_points
from ...maps.grid import CellGrid
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor, distinct_names

Distribution = Callable[[np.random.Generator, int], NDArray[np.float64]]
"""``distribution(rng, n)`` draws n states, shape (n, dimension)."""


@dataclass(frozen=True, eq=False)
class Share:
    """Share of random states that end on one attractor, or that carry one of the other labels.

    Parameters
    ----------
    share : float
        Of all states drawn; those that are undecided count as not in the basin.
    standard_error : float
        Of the share.
    low, high : float
        Interval of the share.  For a basin, `low` takes all undecided states to belong elsewhere and `high` to belong
        to it, so that the interval covers the basin whatever they do.
    count : int
        States.
    """

    share: float
    standard_error: float
    low: float
    high: float
    count: int

    def __repr__(self) -> str:
        return f"Share({self.share:.4g} in [{self.low:.4g}, {self.high:.4g}], {self.count} states)"


@dataclass(frozen=True, eq=False)
class BasinStability:
    """Shares of the basins in a distribution of states.

    Parameters
    ----------
    shares : mapping of int to Share
        For each attractor, then for each of the labels -1, -2, -3 that occurred.
    names : mapping of int to str
        What the labels stand for.
    states : ndarray, shape (n, dimension)
        States that were drawn.
    labels : ndarray of int16, shape (n,)
        Their labels.
    settling_time : ndarray of int32, shape (n,)
        Their settling times, -1 without one.
    confidence : float
        Of the intervals.
    seed : int
        Seed of the draw.
    """

    shares: Mapping[int, Share]
    names: Mapping[int, str]
    states: NDArray[np.float64]
    labels: NDArray[np.int16]
    settling_time: NDArray[np.int32]
    confidence: float
    seed: int

    def __repr__(self) -> str:
        parts = [f"{self.names[k]} {s.share:.4g} [{s.low:.4g}, {s.high:.4g}]" for k, s in self.shares.items()]
        return f"BasinStability({len(self.labels)} states: {'; '.join(parts)})"

    @property
    def undecided(self) -> int:
        """States that are undecided."""
        return int(np.count_nonzero(self.labels == UNDECIDED))


@checked
def basin_stability(
    source: Basins | PointMap,
    distribution: CellGrid | Distribution | None = None,
    n: int = 10_000,
    attractors: Sequence[Attractor] = (),
    seed: int = 0,
    confidence: float = 0.95,
    method: str = "exact",
    point_map: PointMap | None = None,
    max_periods: int | None = None,
) -> BasinStability:
    """Draw random states and return the share of them that ends on each attractor.

    Parameters
    ----------
    source : Basins or PointMap
        Basins with their map, or a map with its `attractors`.
    distribution : CellGrid or callable, optional
        A window in which states are uniform, or a function ``distribution(rng, n)`` that draws n states.  By default
        the window of the basins.
    n : int, optional
        States.
    attractors : sequence of Attractor, optional
        Attractors of a map.
    seed : int, optional
        Seed of the draw.
    confidence : float, optional
        Of the intervals, each of them by itself.
    method : {"exact", "Wilson"}, optional
        See :func:`binomial_interval`.
    point_map : PointMap, optional
        Map to use in the place of the exact one of the basins, such as a table.
    max_periods : int, optional
        Periods after which a state is undecided.

    Returns
    -------
    BasinStability
        Shares with their intervals.

    Raises
    ------
    TypeError, ValueError
        For basins without their map, no attractors, or a distribution that draws something else than n states.

    References
    ----------
    Menck, Heitzig, Marwan, Kurths, Nature Physics 9 (2013) 89.

    Examples
    --------
    >>> from cellmap import discrete_map, find_basins
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))
    >>> basins = find_basins(cubic, CellGrid((-1.5,), (1.5,), (60,)))
    >>> basin_stability(basins, CellGrid((-0.5,), (1.5,), (1,)), n=1000).shares[0]
    Share(0.769 in [0.7416, 0.7948], 769 states)
    """
    label = labeller(source, attractors, point_map, max_periods)
    number = affordable_number("n", n, 8 * (4 * label.point_map.dimension + 6), at_least=1)
    if distribution is None and isinstance(source, Basins):
        distribution = source.grid
    states = _drawn(distribution, label, number, seed)
    labels, times = label.settle(states)
    undecided = int(np.count_nonzero(labels == UNDECIDED))
    present = [code for code in LABEL_NAMES if (labels == code).any()]
    shares = {}
    for k in [*range(len(label.attractors)), *present]:
        count = int(np.count_nonzero(labels == k))
        low, high = (float(v) for v in binomial_interval(count, number, confidence, method))
        if k >= 0 and undecided:
            high = float(binomial_interval(count + undecided, number, confidence, method)[1])
        share = count / number
        shares[k] = Share(share, float(np.sqrt(share * (1.0 - share) / number)), low, high, count)
    names = {**dict(enumerate(distinct_names(label.attractors))), **{code: LABEL_NAMES[code] for code in present}}
    return BasinStability(shares, names, states, labels, times, confidence, seed)


def _drawn(distribution: object, label: Labeller, n: int, seed: int) -> NDArray[np.float64]:
    rng = random_numbers(seed)
    d = label.point_map.dimension
    if isinstance(distribution, CellGrid):
        window = distribution.on(label.point_map.coordinates, "distribution")
        return rng.uniform(window.lower, window.upper, (n, d))
    if distribution is None:
        raise ValueError("distribution is missing: give a CellGrid as a window, or a function (rng, n) of states")
    if not callable(distribution):
        raise TypeError(f"distribution={distribution!r}: give a CellGrid as a window, or a function (rng, n) of states")
    drawn = of_the_user("distribution", distribution, rng, n)
    states = state_points("distribution", drawn, label.point_map.coordinates)
    if states.shape != (n, d):
        raise ValueError(f"distribution returns the shape {states.shape}: return {n} states, shape ({n}, {d})")
    return states
