"""Folds of the orbits that are born at degenerate period doublings and pitchforks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .arclength import SolutionPoint, corrected
from .kinds import BifurcationKind, CodimensionTwoKind
from .singular_orbits import SingularOrbits

_FIRST_DISTANCE, _NEAREST = 0.1, 1e-3  # of a fold from the point at which its curve begins


@dataclass(frozen=True, eq=False)
class FoldBirth:
    """Point of a curve of period doublings or pitchforks at which a curve of folds of the new orbits begins."""

    old: SingularOrbits
    ratio: NDArray[np.float64]
    origin: NDArray[np.float64]
    direction: NDArray[np.float64]

    @classmethod
    def at(cls, old: SingularOrbits, ratio: NDArray[np.float64], origin: NDArray[np.float64]) -> FoldBirth:
        """Return a point in new units, which are `ratio` times smaller than those of the old curve."""
        doubled = old.kind is BifurcationKind.PERIOD_DOUBLING
        matrix = old.matrices(origin / ratio)
        null = np.linalg.svd(matrix - (-1.0 if doubled else 1.0) * np.eye(len(matrix)))[2][-1]
        return cls(old, ratio, origin, np.append(null, [0.0, 0.0]))

    @property
    def name(self) -> str:
        """Name of the point, as the reason why a curve ends there."""
        doubled = self.old.kind is BifurcationKind.PERIOD_DOUBLING
        return str(CodimensionTwoKind.GENERALISED_FLIP if doubled else CodimensionTwoKind.DEGENERATE_PITCHFORK)

    def is_between(self, first: SolutionPoint, second: SolutionPoint) -> bool:
        """Return whether the new orbits shrink to the old one, and grow on its other side, between two points."""
        (one, along_one), (two, along_two) = self._away(first), self._away(second)
        return along_one * along_two < 0.0 and max(one, two) < _FIRST_DISTANCE

    def _away(self, place: SolutionPoint) -> tuple[float, float]:
        """Return how far a new orbit is from the old one, and how far along the critical eigenvector."""
        unknowns, d = place.unknowns / self.ratio, self.old.orbits.dimension
        if self.old.kind is BifurcationKind.PERIOD_DOUBLING:
            moved = -0.5 * self.old.orbits(unknowns)[0]
        else:
            moved = unknowns[:d] - self.old.symmetric
        return float(np.linalg.norm(moved)), float(moved @ self.direction[:d])

    def fold(self, problem: SingularOrbits) -> SolutionPoint | None:
        """Return a fold of the new orbits beside the point."""
        distance = _FIRST_DISTANCE
        while distance > _NEAREST:
            place = corrected(problem, self.origin + distance * self.direction, self.direction)
            near = place is not None and np.linalg.norm(place.unknowns - self.origin) < 3.0 * distance
            if place is not None and near and abs(self._away(place)[1]) > 0.25 * distance:
                return place
            distance *= 0.5
        return None
