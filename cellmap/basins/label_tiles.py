"""Labelling of one tile of initial conditions, or of states that their orbits have reached, in any process."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .._lib.stopping import Stop
from ..attractors.settling import Catalogue, Settled, settle
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor
from .initial_conditions import Starts


@dataclass(frozen=True, eq=False)
class Batch:
    """Starts of a tile, by their numbers, and the states that they have come to where these are at hand."""

    rows: slice | NDArray[np.int64]
    states: Orbits | None = None


@dataclass(frozen=True, eq=False)
class Labelling:
    """Labels of starts after some periods, the horizon.

    ``legs``: periods after which the starts of a tile were looked at before and then went on; where their states are
    not at hand, they go through all of that again, for how an orbit is iterated may depend on it.  ``stop``: a request
    to end before that, in this process.
    """

    point_map: PointMap
    initial_conditions: Starts
    attractors: tuple[Attractor, ...]
    legs: tuple[int, ...]
    horizon: int
    stop: Stop | None = None

    def __call__(self, batch: Batch) -> Settled:
        """Return the labels of a tile."""
        # States are moved in place, and a tile that is lost begins again from the same ones.
        states = self._states(batch.rows) if batch.states is None else Orbits.joined([batch.states])
        return self._settled(states, self.legs[-1] if self.legs else 0, self.horizon)

    def _states(self, rows: slice | NDArray[np.int64]) -> Orbits:
        orbits = Orbits.starting(self.initial_conditions.wrapped(rows, self.point_map))
        for begin, end in pairwise((0, *self.legs)):
            orbits = self._settled(orbits, begin, end).orbits
        return orbits

    def _settled(self, orbits: Orbits, begin: int, end: int) -> Settled:
        return settle(self.point_map, orbits, self._catalogue, end - begin, begin, self.stop)

    @cached_property
    def _catalogue(self) -> Catalogue:
        return Catalogue.of(self.attractors, self.point_map)
