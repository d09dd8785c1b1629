"""Tipping probabilities: overlap of the basins before and after a sudden change of a parameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..._lib.arrays import Floats, Ints
from ..._lib.binomial import binomial_interval
from ..._lib.checks import finite_number, one_of, whole_array
from ..._lib.signatures import checked
from ...attractors.matching import match_attractors
from ...attractors.settling.labels import stored_names
from ...basins.classification import labeller, places_of, span_of
from ...basins.record import Basins
from ...maps.point_map import PointMap
from ...orbits.attractor import distinct_names

_MATCHES = ("distance", "overlap", "labels")


@dataclass(frozen=True, eq=False)
class TippingProbabilities:
    """Tipping probabilities: overlap of the basins before a change with those after it.

    Parameters
    ----------
    before, after : tuple of int
        Labels of the rows and of the columns: basins, then those of -1, -2, -3 that occur.
    names : tuple of tuple of str
        Meanings of these labels.
    counts : ndarray of int, shape (rows, columns)
        Number of cells with each pair of labels before and after.
    probabilities : ndarray, shape (rows, columns)
        ``counts`` divided by the number of cells of the row; NaN for a basin without cells.
    low, high : ndarray, shape (rows, columns)
        Exact binomial intervals, as if the cells were random states; for the centres of a grid they are too wide.
    landing : ndarray, shape (basins before, columns), or None
        Fraction of the points of each attractor that has the label of the column after the change; None without a map.
    continuation : tuple of int or None
        For each basin before the change, the label after it of the attractor that continues its own; None where no
        attractor does.
    match : str
        Method by which attractors were matched.
    confidence : float
        Confidence level of the intervals.
    """

    before: tuple[int, ...]
    after: tuple[int, ...]
    names: tuple[tuple[str, ...], tuple[str, ...]]
    counts: Ints
    probabilities: Floats
    low: Floats
    high: Floats
    landing: Floats | None
    continuation: tuple[int | None, ...]
    match: str
    confidence: float

    def __repr__(self) -> str:
        tipped = ", ".join(
            f"{name} {fraction:.4g}" for name, fraction in zip(self.names[0], self.tipping[:, 0], strict=False)
        )
        return f"TippingProbabilities({int(self.counts.sum())} cells; tipped: {tipped})"

    @property
    def tipping(self) -> Floats:
        """Fraction of each basin before the change that tips, with its interval, shape (basins, 3).

        A state does not tip if it converges to the attractor that continues its own; without a continuation all states
        tip.
        """
        rows = [
            [1.0, 1.0, 1.0] if label is None else [1.0 - a[i, j] for a in (self.probabilities, self.high, self.low)]
            for i, label in enumerate(self.continuation)
            for j in [None if label is None else self.after.index(label)]
        ]
        return np.array(rows).reshape(-1, 3)

    @checked
    def probability(self, before: int, after: int) -> float:
        """Return the fraction of a basin before the change with a label after it; 0 for one that does not occur."""
        if before not in self.before:
            raise ValueError(f"before={before!r}: the labels before are {self.before}")
        if after not in self.after:
            return 0.0
        return float(self.probabilities[self.before.index(before), self.after.index(after)])


@checked
def tipping_probabilities(
    before: Basins | ArrayLike,
    after: Basins | ArrayLike,
    confidence: float = 0.95,
    point_map: PointMap | None = None,
    match: str | None = None,
    threshold: float = 0.5,
) -> TippingProbabilities:
    r"""Compute the probabilities with which states of each basin tip to others at a sudden change of a parameter.

    They are :math:`P_{ij} = \frac{\lvert B_i \cap B'_j \rvert}{\lvert B_i \rvert}` for the basins :math:`B_i`
    before and :math:`B'_j` after the change.

    Parameters
    ----------
    before, after : Basins or array_like of int
        Labels of the same initial conditions, before and after the change.
    confidence : float, optional
        Confidence level of the intervals.
    point_map : PointMap, optional
        Map after the change, for `landing`; by default the exact one of `after`.
    match : {"distance", "overlap", "labels"}, optional
        Rule by which attractors after the change continue those before it: the nearest ones, such that the sum of
        distances is minimal; those whose basins overlap most; or those with the same label.  By default the nearest
        ones for basins, and the same labels for arrays, which have no attractors.
    threshold : float, optional
        Largest distance of an attractor from its continuation, in sizes of the window.

    Returns
    -------
    TippingProbabilities
        The probabilities, with rows and columns in the order of the labels, and `continuation`, which identifies
        attractors before and after: attractor 0 after the change need not continue attractor 0.

    Raises
    ------
    TypeError, ValueError
        For labels of different initial conditions, or none.

    References
    ----------
    Kaszas, Feudel, Tel, Scientific Reports 9 (2019) 8654.

    Examples
    --------
    >>> found = tipping_probabilities([0, 0, 1, 1], [0, 1, 1, -3])
    >>> found.probabilities
    array([[0.5, 0.5, 0. ],
           [0. , 0.5, 0.5]])
    >>> found.tipping[:, 0]
    array([0.5, 0.5])
    """
    way = _way(match, before, after)
    reach = finite_number("threshold", threshold, above=0.0)
    labels = [_labels_of(name, given) for name, given in (("before", before), ("after", after))]
    if labels[0].shape != labels[1].shape:
        raise ValueError(
            f"before, after have the shapes {labels[0].shape}, {labels[1].shape}: label the same initial conditions"
        )
    if not labels[0].size:
        raise ValueError("before, after are empty: give at least one label")
    if isinstance(before, Basins) and isinstance(after, Basins):
        _check_initial_conditions(before, after)
    rows, columns = (_numbers_of(given, found) for given, found in zip((before, after), labels, strict=True))
    landed: Floats | None = None
    if isinstance(before, Basins) and isinstance(after, Basins) and (point_map or after.point_map) is not None:
        columns, landed = _landing(before, after, columns, point_map)
    counts = np.array([[np.count_nonzero((labels[0] == i) & (labels[1] == j)) for j in columns] for i in rows])
    total = counts.sum(axis=1, keepdims=True)
    low, high = binomial_interval(counts, np.broadcast_to(total, counts.shape), confidence)
    with np.errstate(invalid="ignore"):
        fractions = counts / np.where(total > 0, total, np.nan)
    names = (_names_of(before, rows), _names_of(after, columns))
    mine, theirs = (tuple(k for k in numbers if k >= 0) for numbers in (rows, columns))
    if way == "distance":
        continuation = _nearest(before, after, reach)
    elif way == "overlap":
        continuation = _overlapping(counts[: len(mine)][:, [columns.index(k) for k in theirs]], theirs)
    else:
        continuation = tuple(k if k in theirs else None for k in mine)
    return TippingProbabilities(
        rows, columns, names, counts, fractions, low, high, landed, continuation, way, confidence
    )


def _way(match: str | None, before: Any, after: Any) -> str:
    """Check how attractors are to be matched."""
    known = isinstance(before, Basins) and isinstance(after, Basins)
    way = one_of("match", ("distance" if known else "labels") if match is None else match, _MATCHES)
    if way == "distance" and not known:
        raise ValueError("match='distance': arrays of labels have no attractors; give Basins, or another match")
    return way


def _nearest(before: Any, after: Any, farthest: float) -> tuple[int | None, ...]:
    """Return the labels of the attractors nearest to those before, one for each at most."""
    span = span_of(before)
    extent = np.ptp(places_of(before), axis=0) if span is None else span
    extent = np.where(extent > 0.0, extent, 1.0)
    found = match_attractors(after.attractors, dict(enumerate(before.attractors)), extent, farthest)
    label = {k: j for j, k in found.items()}
    return tuple(label.get(k) for k in range(len(before.attractors)))


def _overlapping(counts: Ints, labels: tuple[int, ...]) -> tuple[int | None, ...]:
    """Return the labels of the basins that have most in common with those before, where that is mutual."""
    best = (counts == counts.max(axis=1, keepdims=True, initial=1)) & (
        counts == counts.max(axis=0, keepdims=True, initial=1)
    )
    alone = best & (best.sum(axis=1, keepdims=True) == 1) & (best.sum(axis=0, keepdims=True) == 1)
    return tuple(labels[int(np.argmax(row))] if row.any() else None for row in alone)


def _labels_of(name: str, given: Basins | ArrayLike) -> Ints:
    return whole_array(name, given.labels if isinstance(given, Basins) else given, "Basins or whole numbers as labels")


def _check_initial_conditions(before: Basins, after: Basins) -> None:
    if before.coordinates != after.coordinates:
        raise ValueError("before, after are basins of other coordinates: label the same initial conditions")
    if (before.grid, after.grid) != (None, None):
        same = before.grid == after.grid
    else:
        same = bool(np.array_equal(np.asarray(before.initial_conditions), np.asarray(after.initial_conditions)))
    if not same:
        raise ValueError(f"before, after are on {before.grid} and {after.grid}: find both basins on one window")


def _numbers_of(given: Any, labels: Ints) -> tuple[int, ...]:
    basins = range(len(given.attractors)) if isinstance(given, Basins) else np.unique(labels[labels >= 0]).tolist()
    return (*basins, *sorted(np.unique(labels[labels < 0]).tolist(), reverse=True))


def _names_of(given: Any, numbers: tuple[int, ...]) -> tuple[str, ...]:
    known = dict(enumerate(distinct_names(given.attractors))) if isinstance(given, Basins) else {}
    known |= stored_names(given.settings if isinstance(given, Basins) else {})
    return tuple(known.get(k, f"label {k}") for k in numbers)


def _landing(
    before: Basins, after: Basins, columns: tuple[int, ...], point_map: PointMap | None
) -> tuple[tuple[int, ...], Floats]:
    """Return the columns, with labels that only points of attractors have, and the landing of these points."""
    label = labeller(after, point_map=point_map, name="after")
    ends = [label(a.points) for a in before.attractors]
    columns = (*columns, *sorted({int(k) for e in ends for k in e} - set(columns), reverse=True))
    return columns, np.array([[np.mean(e == k) for k in columns] for e in ends]).reshape(len(ends), len(columns))
