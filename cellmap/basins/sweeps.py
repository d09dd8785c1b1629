"""One sweep over initial conditions: what it depends on, and the labelling of its tiles in any process."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .._lib.arrays import Floats, Ints
from .._lib.computed import computed_once
from .._lib.stopping import Stop
from .._lib.threads import slices
from ..attractors.kinds.creeping import settled_at_last
from ..attractors.kinds.examined import Examined
from ..attractors.settling.escape import far_bound
from ..attractors.settling.settle import Catalogue, Settled, settle
from ..maps.orbit_batch import CHUNK, NOTHING, Orbits, Tally
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor
from .initial_conditions import InitialConditions, Rows
from .strides import StridedTile


@dataclass(frozen=True, eq=False)
class Progress:
    """State before a sweep over initial conditions: all that it depends on besides these and the map.

    ``rows``: initial conditions that are labelled; ``restart_times``: periods after which earlier sweeps, with the same
    attractors, ended, so that their orbits restart from there; ``time_limit``: periods after which this sweep ends;
    ``repeats``: sweeps with the same time limit before this one, with fewer attractors; ``undecided``: initial
    conditions that the last of them left; ``tally``: work of all sweeps before; ``tiles``: the initial conditions of
    each tile, where these are not simply consecutive ones; ``size``: their number in a tile otherwise.
    """

    attractors: tuple[Attractor, ...]
    examined: Examined
    rows: Rows
    restart_times: tuple[int, ...]
    time_limit: int
    repeats: int = 0
    undecided: int | None = None
    tally: Tally = NOTHING
    tiles: tuple[StridedTile, ...] | None = None
    size: int = CHUNK

    @computed_once
    def parts(self) -> list[slice]:
        """Tiles, as slices of the rows."""
        if self.tiles is None:
            return slices(len(self.rows), self.size)
        ends = np.cumsum([0, *map(len, self.tiles)]).tolist()
        return [slice(begin, end) for begin, end in pairwise(ends)]

    def rows_of(self, number: int) -> slice | Ints:
        """Return the initial conditions of a tile."""
        if self.tiles is not None:
            return self.tiles[number].rows
        part = self.parts[number]
        return part if self.rows.bits is None else self.rows[part]


@dataclass(frozen=True, eq=False)
class Batch:
    """Initial conditions of a tile, by their indices, and the present states of their orbits where these are kept."""

    rows: slice | Ints
    states: Orbits | None = None


@dataclass(frozen=True, eq=False)
class LabellingTask:
    """Labels of initial conditions after `time_limit` periods.

    ``restart_times``: periods after which the orbits of a tile were examined before and went on; where their states are
    not kept, they are computed again with the same restarts, on which the iteration of an orbit may depend.  ``last``:
    whether none goes on, so that those that creep to a continuum are labelled; ``stop``: a request to end before that,
    in this process; ``bound``: where orbits have escaped, if some were seen to.
    """

    point_map: PointMap
    initial_conditions: InitialConditions
    attractors: tuple[Attractor, ...]
    restart_times: tuple[int, ...]
    time_limit: int
    last: bool = False
    stop: Stop | None = None
    bound: Floats | None = None

    def __call__(self, batch: Batch) -> Settled:
        """Return the labels of a tile."""
        # States are moved in place, and a tile that is lost begins again from the same ones.
        states = self._states(batch.rows) if batch.states is None else Orbits.joined([batch.states])
        settled = self._settled(states, self.restart_times[-1] if self.restart_times else 0, self.time_limit)
        if not self.last:
            return settled
        return settled_at_last(self.point_map, self.attractors, self.time_limit, settled, self._farthest)

    def _states(self, rows: slice | Ints) -> Orbits:
        orbits = Orbits.starting(self.initial_conditions.wrapped(rows, self.point_map))
        for begin, end in pairwise((0, *self.restart_times)):
            orbits = self._settled(orbits, begin, end).orbits
        return orbits

    def _settled(self, orbits: Orbits, begin: int, end: int) -> Settled:
        return settle(self.point_map, orbits, self._catalogue, end - begin, begin, self.stop, self.bound)

    @computed_once
    def _farthest(self) -> Floats:
        return far_bound(self.point_map, self.initial_conditions.region)

    @computed_once
    def _catalogue(self) -> Catalogue:
        return Catalogue.of(self.attractors, self.point_map)
