"""Basins with the evidence for each label."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ...attractors.settling import UNDECIDED
from ...maps.orbit_batch import Cost
from ..record import Basins, Verification


class Evidence(IntEnum):
    """Why a label stands."""

    CELL = 0
    """The whole cell of the table around the start goes to this attractor."""
    ORBIT = 1
    """The orbit goes there with all the error that it can have."""
    EXACT = 2
    """The table leaves it open; the exact map does not, whatever its tolerance adds."""
    OPEN = 3
    """The label of the exact map, which errors of the size of its tolerance could change, or its limit of periods.

    A start that is undecided is among these, and has no label yet."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """Basins with the evidence for each label.

    Parameters
    ----------
    basins : Basins
        The basins, with the labels that were made again.
    evidence : ndarray of uint8, shape of the labels
        An :class:`Evidence` for each start.
    redone : int
        Starts that were labelled again by the exact map: those with the evidence EXACT and OPEN.
    changed : int
        Starts whose label came out differently.
    audit : Verification
        Random starts that were *not* redone, against the exact map.
    wrong : tuple of float
        95 % interval of the share of all starts whose label is not that of the exact map.  Undecided starts have no
        label that could be right, and count in its upper end.
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
        """Number of starts whose label even the tolerance of the exact map could change."""
        return int(np.count_nonzero(self.evidence == Evidence.OPEN))

    @property
    def undecided(self) -> int:
        """Number of starts that the exact map leaves undecided within the periods allowed."""
        return int(np.count_nonzero(self.basins.labels == UNDECIDED))

    def __repr__(self) -> str:
        total = self.evidence.size
        return (
            f"Certificate({self.basins.name}, {total:,} starts: {self.redone:,} redone, {self.changed:,} changed, "
            f"{self.open:,} open, {self.undecided:,} of these undecided; "
            f"{self.audit.wrong} of {self.audit.starts:,} others wrong, so at most "
            f"{100 * self.wrong[1]:.2g} % of all)"
        )
