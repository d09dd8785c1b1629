"""Basins of attraction: labels of initial conditions, attractors and settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.binomial import binomial_interval
from .._lib.checks import affordable_number, one_of, random_numbers
from .._lib.signatures import checked
from .._lib.threads import run_over, slices
from ..attractors.settling import DIVERGED, ESCAPED, NO_RETURN, UNDECIDED, Catalogue, settle
from ..maps.coordinates import Coordinate
from ..maps.grid import CellGrid
from ..maps.orbit_batch import CHUNK, Cost, Orbits
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor, distinct_names
from .initial_conditions import BLOCK, Starts

LABEL_NAMES = {ESCAPED: "escaped", DIVERGED: "diverged", UNDECIDED: "undecided", NO_RETURN: "did not return"}
"""Names of the labels that are not attractors."""

HELD = 2**20
"""Starts whose states are kept from one pass over the starts to the next; of more the states are computed again."""

_HELD_BYTES = 256  # for each of them, while they are put together


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
        Random initial conditions that were compared.
    wrong : int
        Initial conditions whose label differs.
    share : float
        ``wrong / starts``.
    low, high : float
        95 % confidence interval of that fraction (Wilson 1927), of all initial conditions drawn but the excluded ones:
        from none of the undecided being wrong to all of them.
    excluded : int
        Initial conditions drawn whose orbits escaped, so that there is nothing to compare.
    undecided : int
        Initial conditions drawn that are undecided, also with the exact map: neither right nor wrong, and not in
        `starts`.
    """

    starts: int
    wrong: int
    share: float
    low: float
    high: float
    excluded: int
    undecided: int = 0

    @classmethod
    def of(cls, wrong: int, starts: int, excluded: int = 0, undecided: int = 0) -> Verification:
        """Give the share of `wrong` among some starts its interval; further ones that are undecided widen it."""
        (low, _), (_, high) = np.transpose(
            binomial_interval([wrong, wrong + undecided], starts + undecided, method="Wilson")
        ).tolist()
        return cls(starts, wrong, wrong / starts if starts else 0.0, low, high, excluded, undecided)


@dataclass(frozen=True, eq=False)
class Basins:
    """Basins of attraction: labels of initial conditions, and the attractors.

    Parameters
    ----------
    labels : ndarray of int16
        For each initial condition the number of its attractor, or -1 (escaped), -2 (diverged), -3 (undecided), -4 (did
        not return to the section); shape of the grid, or of the initial conditions without their last axis.
    attractors : tuple of Attractor
        Attractor k has the label k.
    settling_time : ndarray of int32
        Period in which the orbit first entered a trapping region of its attractor; -1 without an attractor.
    grid : CellGrid or None
        Cells whose centres are the initial conditions.
    starts : ndarray or None
        Initial conditions, if no grid was given.
    name : str
        Name of the system.
    params : mapping of str to float
        Parameters of the system.
    coordinates : tuple of Coordinate
        State variables.
    settings : mapping
        Arguments of :func:`find_basins`, and under ``"map"`` the recipe of the map.
    inaccurate : int
        Initial conditions along whose orbits the integrator missed its tolerance.
    undecided : mapping of str to int
        Reasons why initial conditions are undecided, in words, and the number of orbits with each.  At most 32 of the
        undecided orbits are examined, evenly spread; empty if none is undecided.
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
    undecided: Mapping[str, int] = field(default_factory=dict)
    cost: Cost = Cost()
    point_map: PointMap | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        shares = "; ".join(f"{self.label_name(k)} {100 * f.share:.4g} %" for k, f in self.fractions.items())
        return f"Basins({self.name}, {self.labels.size:,} initial conditions: {shares})"

    @checked
    def label_name(self, label: int) -> str:
        """Return the meaning of a label."""
        one_of("label", label, (*range(len(self.attractors)), *LABEL_NAMES))
        return distinct_names(self.attractors)[label] if label >= 0 else LABEL_NAMES[label]

    @property
    def fractions(self) -> dict[int, Fraction]:
        """Fraction of the initial conditions for each label: all attractors, then the other labels that occur."""
        total, counts = self.labels.size, self._counts()
        result = {}
        for label in [*range(len(self.attractors)), *(label for label in LABEL_NAMES if counts[label])]:
            count = counts[label]
            share = count / total
            result[label] = Fraction(share, float(np.sqrt(share * (1 - share) / total)), count)
        return result

    def _counts(self) -> dict[int, int]:
        """Count the starts of each label; a block at a time, for labels may be more than memory holds."""
        lowest = min(LABEL_NAMES)
        counts = np.zeros(len(self.attractors) - lowest, np.int64)
        labels = self.labels.reshape(-1)
        for part in slices(labels.size, BLOCK):
            numbers = labels[part].astype(np.int64) - lowest
            counts += np.bincount(numbers, minlength=len(counts))[: len(counts)]
        return {lowest + k: int(count) for k, count in enumerate(counts)}

    @checked
    def verify(self, n: int = 1000, seed: int = 0) -> Verification:
        """Compare the labels of random initial conditions with those of the exact map.

        Initial conditions that are undecided by both are neither right nor wrong, and are counted separately.

        Parameters
        ----------
        n : int, optional
            Number of initial conditions, drawn with replacement.
        seed : int, optional
            Seed of the random draw.

        Returns
        -------
        Verification
            Fraction of wrong labels with its confidence interval.

        Raises
        ------
        ValueError
            For basins without their map, such as those loaded from a file.
        """
        if self.point_map is None:
            raise ValueError("these basins have no map: rebuild it with rebuild_map and find the basins again")
        n = affordable_number("n", n, 8 * (3 * len(self.coordinates) + 5), at_least=1)
        exact = self.point_map.exact or self.point_map
        drawn = random_numbers(seed).integers(0, self.labels.size, n)
        drawn = drawn[self.labels.ravel()[drawn] != ESCAPED]
        starts = Starts(self.grid, self.starts).wrapped(drawn, exact)
        # Far inside the neighbourhoods, so that these are not taken on trust.
        catalogue = Catalogue.of(self.attractors, exact)
        close = catalogue.shrunk(0.01)
        labels = np.empty(len(drawn), np.int16)
        # Neighbourhoods of a cycle are not all of one size, and in a round an orbit visits each.
        round_ = max((a.period for a in self.attractors), default=1)

        def label(part: slice) -> None:
            orbits = Orbits.starting(starts[part].copy())
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
        given = self.labels.ravel()[drawn]
        wrong = int(np.count_nonzero(labels != given))
        undecided = int(np.count_nonzero((labels == UNDECIDED) & (given == UNDECIDED)))
        return Verification.of(wrong, len(drawn) - undecided, n - len(drawn), undecided)


def basins_memory(starts: int, checkpoint: bool = False) -> int:
    """Return the bytes of memory that the labels and settling times of a number of starts need.

    With a checkpoint these are on the disk, and what remains is a few bits for each start, which say what the present
    pass and the next one are about, and the states of those that are left, as long as they are few.

    Examples
    --------
    >>> basins_memory(10**8) // 10**6, basins_memory(10**8, checkpoint=True) // 10**6
    (625, 305)
    """
    if checkpoint:
        return 3 * (starts // 8) + _HELD_BYTES * min(starts, HELD)
    return 6 * starts + 24 * min(starts, BLOCK)


def basins_disk(starts: int) -> int:
    """Return the bytes on the disk that a checkpoint needs: twice, for a file is made before the older one goes.

    Examples
    --------
    >>> basins_disk(10**8) // 10**6
    1225
    """
    return 2 * (6 * starts + starts // 8) + 2**20 // 4


def _closest(exact: PointMap, orbits: Orbits, catalogue: Catalogue, periods: int) -> NDArray[np.float64]:
    """Return how close orbits come to attractors within some periods, in radii of their neighbourhoods."""
    moving = Orbits.starting(orbits.points.copy())
    closest = catalogue.distances_of(moving.points)
    for _ in range(periods - 1):
        exact.advance(moving, 1)
        closest = np.fmin(closest, catalogue.distances_of(moving.points))
    return closest
