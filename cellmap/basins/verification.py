"""Comparison of labels with those of the exact map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Bools, Floats
from .._lib.binomial import binomial_interval
from .._lib.randomness import Rng, random_numbers
from .._lib.threads import run_over, slices
from ..attractors.kinds.creeping import owners_at_last
from ..attractors.kinds.mixing import unmixed
from ..attractors.regions.extents import ways_of
from ..attractors.search import find_attractors
from ..attractors.settling.escape import escape_on, far_bound
from ..attractors.settling.labels import Label, label_type
from ..attractors.settling.settle import Catalogue, settle, without_escaped
from ..maps.orbit_batch import CHUNK, Orbits
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor, Kind
from .initial_conditions import InitialConditions

_FOLLOWED = 64  # orbits of a label, whose long-time averages are compared


@dataclass(frozen=True)
class Verification:
    """Agreement of labels with exact integration.

    Parameters
    ----------
    compared : int
        Random initial conditions that were compared.
    wrong : int
        Initial conditions whose label differs.
    fraction : float
        ``wrong / compared``.
    low, high : float
        95 % confidence interval of that fraction (Wilson 1927), of all initial conditions drawn but the excluded ones:
        from none of the undecided being wrong to all of them.
    excluded : int
        Initial conditions drawn whose orbits escaped, so that there is nothing to compare.
    undecided : int
        Initial conditions drawn that are undecided, also with the exact map: neither right nor wrong, and not in
        `compared`.
    shared : tuple of str
        What the comparison shares with the labels: nothing wrong with it is seen.
    searched : int or None
        Number of attractors that a search of its own found; None without one.
    separate : int or None
        Of the wrong ones, initial conditions whose label is a chaotic or quasi-periodic attractor, and whose orbits
        have other long-time averages than others of this label: they did not come where these go.  None without search.
    """

    compared: int
    wrong: int
    fraction: float
    low: float
    high: float
    excluded: int
    undecided: int = 0
    shared: tuple[str, ...] = ()
    searched: int | None = None
    separate: int | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "shared", tuple(self.shared))  # a list in files

    @classmethod
    def of(cls, wrong: int, compared: int, excluded: int = 0, undecided: int = 0) -> Verification:
        """Return the fraction of wrong labels with its confidence interval, which undecided ones widen."""
        (low, _), (_, high) = np.transpose(
            binomial_interval([wrong, wrong + undecided], compared + undecided, method="Wilson")
        ).tolist()
        return cls(
            compared,
            wrong,
            wrong / compared if compared else 0.0,
            low,
            high,
            excluded,
            undecided,
        )


def verified(
    exact: PointMap,
    attractors: Sequence[Attractor],
    initial_conditions: InitialConditions,
    labels: NDArray[np.int16],
    max_periods: int,
    n: int,
    rng: Rng,
    search: bool = False,
) -> Verification:
    """Compare labels (of all `initial_conditions`, flat) of `n` random ones with those of an exact map."""
    drawn = random_numbers(rng).integers(0, labels.size, n)
    drawn = drawn[~np.isin(labels[drawn], (Label.ESCAPED, Label.UNLABELLED))]
    given, points, listed = labels[drawn], initial_conditions.wrapped(drawn, exact), attractors
    if search and len(drawn):
        # Twice as long, and from other initial conditions: what merged by chance or haste comes out in another way.
        attractors, max_periods = find_attractors(exact, points, 2 * max_periods), 2 * max_periods
    # Far inside the neighbourhoods, so that these are not taken on trust.
    catalogue = Catalogue.of(attractors, exact)
    close = catalogue.shrunk(0.01)
    found = np.empty(len(drawn), label_type(len(attractors)))
    past, gone = far_bound(exact, initial_conditions.region), given == Label.DIVERGED
    bound = past if gone.any() and escape_on(ways_of(exact, points[gone])[1], past) else None
    # Neighbourhoods of a cycle differ in size, and within its period an orbit visits each.
    period = max((a.period for a in attractors), default=1)

    def label(part: slice) -> None:
        orbits = Orbits.starting(points[part].copy())
        half = max_periods // 2
        early = settle(exact, orbits, close, half, bound=bound)
        found[part] = early.labels
        before = _closest(exact, early.orbits, catalogue, period)
        late = settle(exact, early.orbits, close, max_periods - half, half, bound=bound)
        late = without_escaped(exact, late, past, max_periods)
        # One that converges slowly is still on its way; one at rest elsewhere is not.
        slow = late.undecided
        nearer = _closest(exact, late.orbits, catalogue, period) < before[slow] * (1.0 - 1e-9)
        owners = settle(exact, late.orbits, catalogue, period).labels
        late.labels[slow] = np.where((owners >= 0) & nearer, owners, Label.UNDECIDED)
        left = np.flatnonzero(late.labels[slow] == Label.UNDECIDED)
        last = owners_at_last(exact, late.orbits[left], attractors)
        late.labels[slow[left]] = np.where(last >= 0, last, Label.UNDECIDED)
        found[part.start + early.undecided] = late.labels

    run_over(slices(len(drawn), CHUNK // 8), label)
    if search:
        found = _renamed(found, given)
    separate = _separate(exact, listed, points, given, found, max_periods) if search else np.zeros(len(drawn), bool)
    wrong = int(np.count_nonzero((found != given) | separate))
    undecided = int(np.count_nonzero((found == Label.UNDECIDED) & (given == Label.UNDECIDED)))
    return replace(
        Verification.of(wrong, len(drawn) - undecided, n - len(drawn), undecided),
        shared=("the formulas of the map", "the rules of the search")
        if search
        else ("the attractors", "the formulas of the map"),
        searched=len(attractors) if search else None,
        separate=int(np.count_nonzero(separate)) if search else None,
    )


def _separate(
    exact: PointMap,
    attractors: Sequence[Attractor],
    points: Floats,
    given: NDArray[np.int16],
    found: NDArray[np.int16],
    periods: int,
) -> Bools:
    """Tell which orbits do not go where others go that have their label, by no rule of the search, shape (n,).

    Some of each label are followed; all of them, if any of these is elsewhere.
    """
    separate = np.zeros(len(points), bool)
    for k, attractor in enumerate(attractors):
        together = attractor.subspace is not None and attractor.subspace.is_neutral
        if together or attractor.kind not in (Kind.CHAOTIC, Kind.QUASIPERIODIC):
            continue
        rows = np.flatnonzero(given == k)
        for some in (rows[:_FOLLOWED], rows):
            separate[some] = unmixed(exact, points[some], found[some] == k, periods)
            if not separate[some].any() or len(some) == len(rows):
                break
    return separate


def _renamed(found: NDArray[np.int16], given: NDArray[np.int16]) -> NDArray[np.int16]:
    """Return labels by attractors of another search with the numbers of those that they agree with most, one to one.

    An attractor without a partner gets a number that no other one has.
    """
    from scipy.optimize import linear_sum_assignment

    both = (found >= 0) & (given >= 0)
    counts = np.zeros((found.max(initial=0) + 1, given.max(initial=0) + 1), np.int64)
    np.add.at(counts, (found[both], given[both]), 1)
    numbers = counts.shape[1] + np.arange(len(counts))
    rows, columns = linear_sum_assignment(counts, maximize=True)
    numbers[rows] = np.where(counts[rows, columns] > 0, columns, numbers[rows])
    return np.where(found >= 0, numbers[np.maximum(found, 0)], found).astype(
        label_type(int(numbers.max(initial=0)) + 1)
    )


def _closest(exact: PointMap, orbits: Orbits, catalogue: Catalogue, periods: int) -> Floats:
    """Return how close orbits come to attractors within some periods, in radii of their neighbourhoods."""
    moving = Orbits.starting(orbits.points.copy())
    closest = catalogue.distances_of(moving.points)
    for _ in range(periods - 1):
        exact.advance(moving, 1)
        closest = np.fmin(closest, catalogue.distances_of(moving.points))
    return closest
