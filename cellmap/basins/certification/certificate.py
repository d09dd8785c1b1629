"""Basins with the evidence for each label."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ..._lib.records import ConvertsToXarray, ShownAsHtml
from ...attractors.settling.labels import Label
from ...maps.orbit_batch import Cost
from ..record import Basins
from ..verification import Verification


class Evidence(IntEnum):
    """Evidence for a label."""

    CELL = 0
    """All orbits of the interpolation cell around the initial condition converge to this attractor."""
    ORBIT = 1
    """The orbit converges to this attractor for every error within its bounds."""
    EXACT = 2
    """Undetermined by the interpolated map; the exact map gives this label for every error within its tolerance."""
    OPEN = 3
    """Label of the exact map, which errors within its tolerance, or a larger limit of periods, could change.

    Undecided initial conditions are among these, and have no label yet."""
    DIRECT = 4
    """Label of the exact map, without a bound of its errors: direct integration was predicted to cost less."""
    PROVED = 5
    """Proved by interval arithmetic for the whole cell of the grid, see :func:`cellmap.basins.prove`."""


@dataclass(frozen=True, eq=False)
class Certificate(ShownAsHtml, ConvertsToXarray):
    """Basins with the evidence for each label.

    Parameters
    ----------
    basins : Basins
        The basins, with the recomputed labels.
    evidence : ndarray of uint8, shape of the labels
        An :class:`Evidence` for each initial condition.
    redone : int
        Number of labels recomputed with the exact map: those with the evidence EXACT, OPEN and DIRECT.
    changed : int
        Number of labels that changed.
    audit : Verification
        Comparison of random labels that were *not* recomputed with the exact map.
    wrong : tuple of float
        95 % confidence interval of the fraction of all initial conditions whose label is not that of the exact map.
        Undecided initial conditions have no label that could be right, and count in its upper end.
    cost : Cost
        Wall time, and periods of all orbits.
    """

    basins: Basins
    evidence: NDArray[np.uint8]
    redone: int
    changed: int
    audit: Verification
    wrong: tuple[float, float]
    cost: Cost

    @property
    def open(self) -> int:
        """Number of labels that the tolerance of the exact map could change, as far as is known."""
        return int(np.count_nonzero(np.isin(self.evidence, (Evidence.OPEN, Evidence.DIRECT))))

    @property
    def undecided(self) -> int:
        """Number of initial conditions that are undecided by the exact map within the periods allowed."""
        return int(np.count_nonzero(self.basins.labels == Label.UNDECIDED))

    def __repr__(self) -> str:
        total = self.evidence.size
        return (
            f"Certificate({self.basins.name}, {total:,} initial conditions: {self.redone:,} recomputed, "
            f"{self.changed:,} changed, {self.open:,} open, {self.undecided:,} of these undecided; "
            f"{self.audit.wrong} of {self.audit.compared:,} others wrong, so at most "
            f"{100 * self.wrong[1]:.2g} % of all)"
        )
