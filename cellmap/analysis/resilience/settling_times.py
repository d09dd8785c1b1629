"""Statistics of settling times by basin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._lib.arrays import Floats, Ints
from ..._lib.checks import finite_number
from ..._lib.signatures import checked
from ...attractors.labels import LABEL_NAMES, Label
from ...basins.record import Basins
from ...orbits.attractor import distinct_names
from .basin_fractions import BasinStability


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
    """Compute mean and quantiles of the settling times in each basin.

    The settling time is the first step at which an orbit is inside the verified trapping neighbourhood of its
    attractor. It depends on the width of that neighbourhood; compare only times of the same set of attractors.

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
        names = dict(enumerate(distinct_names(source.attractors)))
    else:
        names = {k: name for k, name in source.names.items() if k >= 0}
    labels, times = source.labels.ravel(), source.settling_time.ravel()
    found = {k: _statistics(name, times[labels == k], wanted) for k, name in names.items()}
    return SettlingStatistics(found, {name: int(np.count_nonzero(labels == k)) for k, name in LABEL_NAMES.items()})


def _statistics(name: str, times: NDArray[np.int32], levels: tuple[float, ...]) -> SettlingTimes:
    n = len(times)
    mean = float(times.mean()) if n else np.nan
    error = float(times.std(ddof=1) / np.sqrt(n)) if n > 1 else np.nan
    quantiles = np.quantile(times, levels, method="inverted_cdf") if n else np.full(len(levels), np.nan)
    counts = np.bincount(times).astype(np.int64) if n else np.zeros(0, np.int64)
    return SettlingTimes(
        name, n, mean, error, levels, np.asarray(quantiles, dtype=float), int(times.max(initial=-1)), counts
    )
