"""Where orbits are that have not settled: what each kind of attractor is looked for by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..._lib.arrays import Floats
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor
from .examined import Examined

ORBITS = 32
"""Orbits that are followed or tested for all that are left, at most."""

MATURE = 64
"""Periods after which orbits that do not settle are tried for more than cycles of few periods."""


@dataclass(frozen=True, eq=False)
class Ends:
    """The ends of orbits that have not settled, and what a look at them may use.

    Each kind of attractor has a function ``look``, which returns the attractors of its kind on which some of the orbits
    are, or to which they come.

    ``points`` (n, dimension); ``age``: how many periods orbits have made; ``known``: attractors to which none of them
    has come; ``longest_period``: of cycles that are tried at once; ``patient``: whether orbits go on in any case, so
    that what takes long may wait; ``last``: whether none of them goes on; ``wandering``: whether they are seen to be
    chaotic.
    """

    point_map: PointMap
    points: Floats
    age: int
    known: Sequence[Attractor]
    examined: Examined
    longest_period: int
    patient: bool = False
    last: bool = False
    wandering: bool = False

    @property
    def extent(self) -> Floats:
        """The size of the region (dimension,)."""
        return self.examined.extent

    @property
    def mature(self) -> bool:
        """Whether orbits are old enough to be looked at for more than cycles of few periods."""
        return self.age >= MATURE or not self.patient
