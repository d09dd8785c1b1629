"""Basins of attraction: labels of initial conditions, attractors and settings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from .._compiled.kernels.labelling import count_labels
from .._lib.arrays import Floats, Ints
from .._lib.checks import affordable_number, one_of, shown
from .._lib.computed import computed_once
from .._lib.randomness import Rng
from .._lib.records import Array, ConvertsToDataFrame, ConvertsToXarray, Keyed, Layout, ShownAsHtml
from .._lib.signatures import checked
from .._lib.threads import slices
from ..attractors.settling.labels import LABEL_NAMES, stored_names
from ..maps.coordinates import Coordinate
from ..maps.grid import CellGrid
from ..maps.orbit_batch import Cost
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor, distinct_names
from .initial_conditions import BLOCK, InitialConditions
from .verification import Verification, verified


@dataclass(frozen=True)
class Fraction:
    """Fraction of the initial conditions with one label.

    Parameters
    ----------
    fraction : float
        Between 0 and 1.
    standard_error : float
        Of the fraction, as an estimate for the whole window from random initial conditions; for the centres of a grid
        this is an upper bound.
    count : int
        Number of initial conditions.
    """

    fraction: float
    standard_error: float
    count: int


@dataclass(frozen=True, eq=False)
class Basins(ShownAsHtml, ConvertsToXarray, ConvertsToDataFrame):
    """Basins of attraction: labels of initial conditions, and the attractors.

    Parameters
    ----------
    labels : ndarray of int16, or of int32 for more than 32,767 attractors
        For each initial condition the number of its attractor, or -1 (escaped), -2 (diverged), -3 (undecided), -4 (did
        not return to the section), -5 (unlabelled: the call ended before), -6 (out of steps); shape of the
        grid, or of the initial conditions without their last axis.
    attractors : tuple of Attractor
        Attractor k has the label k.
    settling_time : ndarray of int32
        Period in which the orbit first entered a trapping region of its attractor, or came to one of the ends of its
        system; -1 without either.
    grid : CellGrid or None
        Cells whose centres are the initial conditions.
    initial_conditions : ndarray or None
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

    _layout: ClassVar = Layout(
        "Basins of attraction of {0.name}",
        {},
        {
            "labels": Array("{cells}", "label of the attractor", flags="_meanings"),
            "settling_time": Array("{cells}", "settling time in steps of the map", comment="-1 without attractor"),
        },
    )

    labels: NDArray[np.int16]
    attractors: tuple[Attractor, ...]
    settling_time: NDArray[np.int32]
    grid: CellGrid | None
    initial_conditions: Floats | None
    name: str
    params: Mapping[str, float]
    coordinates: tuple[Coordinate, ...]
    settings: Mapping[str, Any]
    inaccurate: int = 0
    undecided: Mapping[str, int] = field(default_factory=dict)
    cost: Cost = Cost()
    point_map: PointMap | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        parts = "; ".join(f"{self.label_name(k)} {100 * f.fraction:.4g} %" for k, f in self.fractions.items())
        return f"Basins({self.name}, {self.labels.size:,} initial conditions: {parts})"

    @computed_once
    def _meanings(self) -> dict[int, str]:
        """Names of all labels that there may be."""
        return dict(enumerate(distinct_names(self.attractors))) | stored_names(self.settings)

    @checked
    def label_name(self, label: int) -> str:
        """Return the meaning of a label."""
        return self._meanings[one_of("label", label, tuple(self._meanings))]

    @checked
    def named(self, names: Mapping[int, str]) -> Basins:
        """Return the same basins with names for some of their labels, which figures, tables and files take over.

        Parameters
        ----------
        names : mapping of int to str
            Names of labels; those that are not in it keep theirs, and an empty name takes a given one away.

        Raises
        ------
        ValueError
            For a label that these basins do not have, or a name that another label has.

        Examples
        --------
        >>> from cellmap import discrete_map, find_basins
        >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))
        >>> find_basins(cubic, [[-0.5], [0.3], [0.4]]).named({0: "right", 1: "left"})
        Basins(<lambda>, 3 initial conditions: right 66.67 %; left 33.33 %)
        """
        if not (isinstance(names, Mapping) and all(isinstance(name, str) for name in names.values())):
            raise TypeError(f"names={shown(names)}: give a mapping of labels to texts, such as {{0: 'upright'}}")
        given = {one_of("names", k, tuple(self._meanings)): name for k, name in names.items()}
        known = {int(k): name for k, name in self.settings.get("names", {}).items()} | given
        kept = {str(k): name for k, name in known.items() if name}
        basins = replace(self, settings={**self.settings, "names": kept})
        for name, times in Counter(basins._meanings.values()).items():
            if times > 1:
                raise ValueError(f"names={names!r}: {name!r} would name {times} labels; give each a name of its own")
        return basins

    @property
    def fractions(self) -> dict[int, Fraction]:
        """Fraction of the initial conditions for each label: all attractors, then the other labels that occur."""
        return Keyed(fractions_of(self.labels, len(self.attractors)), "fractions", lambda: self._meanings)

    @checked
    def verify(self, n_samples: int = 1000, *, search: bool = False, rng: Rng = 0) -> Verification:
        """Compare the labels of random initial conditions with those of the exact map.

        Initial conditions that are undecided by both are neither right nor wrong, and are counted separately.
        The attractors are taken as they are, so that an attractor that is missing, or two that are taken for one, go
        unnoticed; with `search` they are searched for again.

        Parameters
        ----------
        n_samples : int, optional
            Number of initial conditions, drawn with replacement.
        search : bool, optional
            Search for attractors from the initial conditions that are drawn, over twice as many periods, and compare
            with the basins of these, each matched with the one whose labels agree most.  It takes several times as
            long, and shares the map and the rules of the search.  By other rules, 64 orbits of each chaotic or
            quasi-periodic attractor (all that are drawn, if one of these is elsewhere) are followed for four times as
            long again: those whose averages differ from the others' are `separate`, and wrong.
        rng : int, numpy.random.Generator or None, optional
            Seed or generator of the random draw: with a seed, the default included, each call draws the same.

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
        n_samples = affordable_number("n_samples", n_samples, 8 * (3 * len(self.coordinates) + 5), at_least=1)
        initial_conditions = InitialConditions(self.grid, self.initial_conditions)
        periods = self.settings["max_periods"]
        return verified(
            self.point_map.without_table,
            self.attractors,
            initial_conditions,
            self.labels.ravel(),
            periods,
            n_samples,
            rng,
            search,
        )


def label_counts(labels: NDArray[np.int16], n_attractors: int, release: Callable[[], None] = lambda: None) -> Ints:
    """Count each label (n,), from the lowest :class:`Label` to the last attractor, a block at a time.

    ``release`` is called after each block, to give memory back whose contents are kept in a file.
    """
    counts = np.zeros(n_attractors - min(LABEL_NAMES), np.int64)
    for part in slices(len(labels), BLOCK):
        count_labels(labels[part], min(LABEL_NAMES), counts)
        release()
    return counts


def fractions_of(
    labels: NDArray[np.int16], n_attractors: int, release: Callable[[], None] = lambda: None
) -> dict[int, Fraction]:
    """Return the fraction of each label; ``release`` as for :func:`label_counts`.

    Examples
    --------
    >>> fractions_of(np.array([0, 0, 1, -3], np.int16), 2)[0]
    Fraction(fraction=0.5, standard_error=0.25, count=2)
    """
    lowest, total = min(LABEL_NAMES), labels.size
    numbers = label_counts(labels.reshape(-1), n_attractors, release)
    counts = {lowest + k: int(count) for k, count in enumerate(numbers)}
    result = {}
    for label in [*range(n_attractors), *(label for label in LABEL_NAMES if counts[label])]:
        mean = counts[label] / total
        result[label] = Fraction(mean, float(np.sqrt(mean * (1 - mean) / total)), counts[label])
    return result
