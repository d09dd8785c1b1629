"""Basins with the evidence for each label."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from .basins import Basins, Verification
from .orbit_batch import Cost


class Evidence(IntEnum):
    """Why a label stands."""

    CELL = 0
    """The whole cell of the table around the start goes to this attractor."""
    ORBIT = 1
    """The orbit goes there with all the error that it can have."""
    EXACT = 2
    """The table leaves it open; the exact map does not, whatever its tolerance adds."""
    OPEN = 3
    """The label of the exact map, which errors of the size of its tolerance could change, or its limit of periods."""


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
        Starts among them whose label came out differently.
    audit : Verification
        Random starts that were *not* redone, against the exact map.
    wrong : tuple of float
        95 % interval of the share of all starts whose label differs from that of the exact map.
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

    def __repr__(self) -> str:
        total = self.evidence.size
        return (
            f"Certificate({self.basins.name}, {total:,} starts: {self.redone:,} redone, {self.changed:,} of these "
            f"changed, {self.open:,} open; {self.audit.wrong} of {self.audit.starts:,} others wrong, so at most "
            f"{100 * self.wrong[1]:.2g} % of all)"
        )
