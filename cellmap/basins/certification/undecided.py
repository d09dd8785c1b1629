"""Search for attractors that were missed, among undecided initial conditions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from ..._lib.arrays import Ints
from ...attractors.settling.labels import label_type
from ...attractors.settling.residence import is_same
from ...maps.orbit_batch import NOTHING
from ...orbits.attractor import Attractor, sort_key
from ..doubts import UnsettledWarning
from ..finding import find_basins
from ..initial_conditions import InitialConditions
from ..record import Basins
from .cell_owners import exact_within


class MissedAttractors:
    """Attractors and labels that the exact map adds to basins that were found with a table.

    ``basins`` have the labels of the exact map at some starts, the attractors that came up there, and the reasons of
    the orbits that were undecided when last searched; ``told`` (n,) says which these are, and ``tally`` what it took.
    """

    def __init__(self, basins: Basins, progress: bool) -> None:
        self.basins, self.progress = basins, progress
        self.told = np.zeros(basins.labels.size, bool)
        self.tally = NOTHING

    def before(self, basins: Basins) -> NDArray[np.int16]:
        """Return the labels of the basins that this began with, in the numbers of all attractors."""
        return _renumbered(basins, self.basins.attractors)

    def among(self, rows: Ints) -> bool:
        """Label starts by the exact map, and search those that it leaves undecided; tell whether attractors came up.

        Nothing is done where all of the orbits have been searched before.
        """
        if self.told[rows].all():
            return False
        basins, known = self.basins, self.basins.attractors
        assert basins.point_map is not None
        points = InitialConditions(basins.grid, basins.initial_conditions).points(rows)
        limits = {name: basins.settings[name] for name in ("max_periods", "longest_period")}
        with catch_warnings():
            simplefilter("ignore", UnsettledWarning)  # these are all undecided, and few of the whole image
            found = find_basins(
                exact_within(basins.point_map), points, attractors=known, progress=self.progress, **limits
            )
        new = [a for a in found.attractors if not any(is_same(a, k) for k in known)]
        attractors = tuple(sorted([*known, *new], key=sort_key))
        labels, times = _renumbered(basins, attractors), basins.settling_time.copy()
        labels.ravel()[rows], times.ravel()[rows] = _renumbered(found, attractors), found.settling_time
        self.basins = replace(
            basins, labels=labels, attractors=attractors, settling_time=times, undecided=found.undecided
        )
        self.told[rows] = True
        self.tally = self.tally.plus((found.cost.steps, found.inaccurate, found.cost.evaluations, found.cost.look_ups))
        return bool(new)


def _renumbered(basins: Basins, attractors: Sequence[Attractor]) -> NDArray[np.int16]:
    """Return labels that number the same attractors in another sequence, which may have more of them."""
    numbers = np.array(
        [next(k for k, a in enumerate(attractors) if is_same(a, b)) for b in basins.attractors],
        label_type(len(attractors)),
    )
    labels = basins.labels.astype(numbers.dtype)
    labels[basins.labels >= 0] = numbers[basins.labels[basins.labels >= 0]]
    return labels
