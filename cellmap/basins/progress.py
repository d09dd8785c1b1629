"""Progress of the labelling of many initial conditions."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .._lib.arrays import Ints
from .._lib.computed import computed_once
from .._lib.threads import slices
from ..attractors.examined import Examined
from ..maps.orbit_batch import CHUNK, NOTHING, Tally
from ..orbits.attractor import Attractor
from .initial_conditions import Rows
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
