"""Progress of the labelling of many initial conditions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .._lib.threads import slices
from ..attractors.search import Examined
from ..maps.orbit_batch import CHUNK, NOTHING, Tally
from ..orbits.attractor import Attractor
from .initial_conditions import Rows
from .strides import StridedTile


@dataclass(frozen=True, eq=False)
class Progress:
    """What a sweep over initial conditions begins with, and all that it depends on besides them and the map.

    ``rows``: initial conditions that are labelled; ``legs``: periods after which earlier sweeps, with the same
    attractors, looked at those that went on, and which they have behind them now; ``horizon``: periods after which
    this one does; ``repeats``: sweeps up to that horizon before this one, with fewer attractors; ``undecided``: initial
    conditions that the last of them left; ``tally``: what all sweeps before it took; ``tiles``: the initial conditions
    of each tile, where these are not simply consecutive ones; ``size``: how many are in a tile otherwise.
    """

    attractors: tuple[Attractor, ...]
    examined: Examined
    rows: Rows
    legs: tuple[int, ...]
    horizon: int
    repeats: int = 0
    undecided: int | None = None
    tally: Tally = NOTHING
    tiles: tuple[StridedTile, ...] | None = None
    size: int = CHUNK

    @cached_property
    def parts(self) -> list[slice]:
        """Tiles, as slices of the rows."""
        if self.tiles is None:
            return slices(len(self.rows), self.size)
        ends = np.cumsum([0, *map(len, self.tiles)]).tolist()
        return [slice(begin, end) for begin, end in pairwise(ends)]

    def rows_of(self, number: int) -> slice | NDArray[np.int64]:
        """Return the starts of a tile."""
        if self.tiles is not None:
            return self.tiles[number].rows
        part = self.parts[number]
        return part if self.rows.bits is None else self.rows[part]
