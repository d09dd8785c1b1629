"""Cost of a certificate beside direct integration of its labels, by counts of work: equal on any machine.

Costs are in evaluations of the right-hand side.  On two processors one of a Taylor series took 20 to 30 ns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._lib.arrays import Ints, evenly
from ...attractors.settling.labels import Label
from ...attractors.settling.settle import Catalogue, settle_on_threads
from ...maps.orbit_batch import Orbits, Tally
from ...maps.point_map import PointMap
from ..initial_conditions import InitialConditions
from ..record import Basins
from .cell_owners import exact_within
from .table_errors import has_power_series

_CELL = 22.0  # cost of the derivatives, bounds of errors, and owner of a cell, in evaluations
_ROW = 8.0  # cost of carrying an ellipsoid over a period, in evaluations
_LOOK_UP = 2.5
_FREE = 3e6  # evaluations that take a tenth of a second: an image that costs less is certified in full
_CELLS = 0.75  # fraction of the cost beyond direct integration that may go into the cells of the table in any case
_DOUBTED = 3.0  # cost of a label that the table does not make certain, in direct integrations of its orbit
_OTHERS = 0.2  # cost of any other label, in direct integrations of its orbit
_SAMPLE = 64, 512  # initial conditions that are integrated or certified first, at least and at most
_SHARE = 64  # one of so many, between these


@dataclass(frozen=True)
class Budget:
    """Budget of a certificate.

    ``direct``: cost of integrating all labels; ``cells``: predicted cost of what is known of the cells of the table;
    ``most``: largest cost of the certificate, in direct integrations; ``doubted``: about the fraction of the labels
    that the table will not make certain, 1 where that is not known.
    """

    direct: float
    cells: float
    most: float
    doubted: float = 1.0

    @classmethod
    def of(cls, basins: Basins, most: float) -> Budget:
        """Return the budget of basins that were found with a table, from the exact orbits of a few of them."""
        point_map, total = basins.point_map, basins.labels.size
        assert point_map is not None and point_map.table is not None
        if most == np.inf or not point_map.is_flow:
            return cls(np.inf, 0.0, np.inf)
        exact, rows = exact_within(point_map), some_of(np.arange(total))
        orbits = Orbits.starting(InitialConditions(basins.grid, basins.initial_conditions).wrapped(rows, exact))
        catalogue, periods = Catalogue.of(basins.attractors, exact), int(basins.settings["max_periods"])
        work = settle_on_threads(exact, orbits, catalogue, periods).tally
        integrated = np.count_nonzero(point_map.table.fallback) * (1 + 2 * point_map.dimension)
        cells = _CELL * point_map.table.grid.size + float(integrated) * work.evaluations / max(work.steps, 1)
        return cls(work.evaluations * total / len(rows), cells, most, _doubted(basins, exact))

    @property
    def is_spent_on_cells(self) -> bool:
        """Whether the cells cost so much that direct integration after them would cost too much."""
        if self.cells <= _CELLS * (self.most - 1.0) * self.direct:
            return False
        return self.cells + (_DOUBTED * self.doubted + _OTHERS) * self.direct > max(self.direct, _FREE)

    def holds(self, tally: Tally, done: int, left: int) -> bool:
        """Return whether the labels that are left can be certified as well, from the work on some."""
        expected = self.cells + cost(tally) * (done + left) / max(done, 1)
        return expected <= max(self.most * self.direct, _FREE)


def _doubted(basins: Basins, exact: PointMap) -> float:
    """Return the fraction of labels beside others, and of those that say of an orbit that it does not settle."""
    if basins.grid is None or not has_power_series(exact):
        return 1.0
    labels = basins.labels
    lasting = [k for k, a in enumerate(basins.attractors) if a.cover is not None]
    found = np.isin(labels, [*lasting, Label.UNDECIDED])
    for axis in range(labels.ndim):
        one, other = np.moveaxis(labels, axis, 0), np.moveaxis(found, axis, 0)
        differ = one[1:] != one[:-1]
        other[1:] |= differ
        other[:-1] |= differ
    return float(found.mean())


def cost(tally: Tally) -> float:
    """Return the cost of orbits that were followed with their errors."""
    return tally.evaluations + _ROW * tally.steps + _LOOK_UP * tally.look_ups


def some_of(rows: Ints) -> Ints:
    """Return some of the rows, evenly spread."""
    count = min(max(len(rows) // _SHARE, _SAMPLE[0]), _SAMPLE[1])
    return rows[evenly(len(rows), count)]
