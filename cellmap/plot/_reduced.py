"""Reduced coordinates: states shifted along the directions of a continuous symmetry.

They are shifted until coordinates of reference have a value: where all angles may turn together, others become
differences to the angle of reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._lib.arrays import Floats
from .._lib.checks import is_sequence, listed, shown
from ..basins.record import Basins
from ..maps.coordinates import Coordinate, wrap
from ._axes import column_of


@dataclass(frozen=True, eq=False)
class SymmetryReduction:
    """Shifts along ``directions`` (k, d), each of which is 1 at one coordinate of reference and 0 at the others."""

    references: Sequence[int]
    directions: Floats
    coordinates: tuple[Coordinate, ...]

    def shifted(self, points: Floats, values: Floats | float = 0.0) -> Floats:
        """Return states (n, d) shifted until the references have some values."""
        moved = points + (values - points[:, self.references]) @ self.directions
        moved[:, self.references] = values
        return wrap(moved, self.coordinates)

    def axes(self) -> tuple[Coordinate, ...]:
        """Return the coordinates of shifted states, named by what is subtracted."""
        return tuple(replace(c, name=c.name + self._subtracted(j)) for j, c in enumerate(self.coordinates))

    def _subtracted(self, j: int) -> str:
        names = [self.coordinates[r].name for r in self.references]
        parts = [(w, name) for w, name in zip(self.directions[:, j].tolist(), names, strict=True) if w]
        return "".join(
            f" {'-' if w > 0 else '+'} {'' if abs(w) == 1.0 else f'{abs(w):.4g} '}{name}" for w, name in parts
        )


def reduction_of(basins: Any, reference: int | str | Sequence[int | str]) -> SymmetryReduction:
    """Return the shifts of the symmetry that the attractors of basins have, by coordinates of reference."""
    known = [a.symmetry for a in basins.attractors if a.symmetry is not None] if isinstance(basins, Basins) else []
    if not known:
        raise ValueError(
            f"reference={shown(reference)}: no attractor of these basins has a continuous symmetry; leave it out"
        )
    given: Sequence[Any] = listed("reference", reference) if is_sequence(reference) else [reference]
    references = [column_of(one, basins.coordinates, "reference") for one in given]
    chosen = known[0][:, references]
    if len(references) != len(chosen) or len({*references}) < len(chosen) or np.linalg.cond(chosen) > 1e8:
        raise ValueError(
            f"reference={shown(reference)}: give {len(known[0])} of the coordinates that the symmetry shifts, "
            f"{[c.name for c, w in zip(basins.coordinates, known[0].T, strict=True) if w.any()]}"
        )
    directions = np.linalg.solve(chosen, known[0])
    nearest = np.round(directions)
    whole = np.abs(directions - nearest) < 1e-9
    return SymmetryReduction(references, np.asarray(np.where(whole, nearest, directions), float), basins.coordinates)
