"""How long it takes to settle, basin by basin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._lib.checks import finite_number
from ..._lib.signatures import checked
from ...attractors.settling import UNDECIDED
from ...basins.record import LABEL_NAMES, Basins
from ...orbits.attractor import distinct_names
from .stability import BasinStability


@dataclass(frozen=True, eq=False)
class SettlingTimes:
    """Settling times of the starts of one basin, in steps of the map.

    Parameters
    ----------
    name : str
        Of the attractor.
    count : int
        Starts.
    mean, standard_error : float
        Mean and its standard error, as for random starts; NaN for fewer than one and two starts.
    levels : tuple of float
        Levels of the quantiles.
    quantiles : ndarray, shape (levels,)
        Smallest times that at least this share of the starts does not exceed; NaN without a start.
    longest : int
        Longest time, -1 without a start.
    times : ndarray of int32, shape (longest + 1,)
        Numbers of starts by their settling times 0, 1, ...
    """

    name: str
    count: int
    mean: float
    standard_error: float
    levels: tuple[float, ...]
    quantiles: NDArray[np.float64]
    longest: int
    times: NDArray[np.int64]

    def __repr__(self) -> str:
        middle = ", ".join(f"{100 * p:g} %: {q:g}" for p, q in zip(self.levels, self.quantiles, strict=True))
        mean = f"mean {self.mean:.4g} +- {self.standard_error:.2g}"
        return f"SettlingTimes({self.name}, {self.count} starts, {mean}; {middle})"


@dataclass(frozen=True, eq=False)
class SettlingStatistics:
    """Settling times of all basins, and what has none.

    Parameters
    ----------
    basins : mapping of int to SettlingTimes
        By label.
    others : mapping of str to int
        Starts that left the window, diverged or are undecided; these last ones would have longer times in some basin,
        so that with them the times of each basin are those of its starts that have settled.
    """

    basins: Mapping[int, SettlingTimes]
    others: Mapping[str, int]

    def __repr__(self) -> str:
        lines = [f"{s.name} {s.mean:.4g} +- {s.standard_error:.2g}" for s in self.basins.values()]
        lines += [f"{count} starts {name}" for name, count in self.others.items() if count]
        return f"SettlingStatistics({'; '.join(lines)})"

    @property
    def undecided(self) -> int:
        """Starts that had not settled at the end."""
        return self.others[LABEL_NAMES[UNDECIDED]]


@checked
def settling_statistics(
    source: Basins | BasinStability, levels: Sequence[float] = (0.25, 0.5, 0.75, 0.95)
) -> SettlingStatistics:
    """Return mean and quantiles of the settling times in each basin.

    The settling time is the step in which an orbit is first inside the verified neighbourhood of its attractor, so it
    depends on how wide that is; compare times of one catalogue of attractors only.

    Parameters
    ----------
    source : Basins or BasinStability
        Labels with settling times.
    levels : sequence of float, optional
        Levels of quantiles, between 0 and 1.

    Returns
    -------
    SettlingStatistics
        Of each basin; starts that are undecided, left or diverged are counted apart.

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
