"""Equations of periodic orbits at a bifurcation, in two parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..orbits.arclength import SolutionPoint
from ..orbits.multipliers import multipliers_of, pair_on_circle, pairs_beside_one
from ..orbits.orbit_equations import OrbitProblem
from .kinds import BifurcationKind

_DIFFERENCE = 1e-5  # of test functions, in scaled unknowns
_REAL = 1e-4  # imaginary part of multipliers that have met on the real axis
_BESIDE = 1e-3  # displacement, scaled, along the null vector, at which a symmetry shows
_EVEN = 1e-4  # even part of the residual there, in squares of it, that is rounding and terms of the fourth order
_CLOSED = 1e-9  # residual of an orbit


@dataclass(frozen=True, eq=False)
class SingularOrbits:
    """Equations of the orbit with the bifurcation condition, for unknowns (x, q1, q2) in units of a scale."""

    orbits: OrbitProblem
    kind: BifurcationKind
    null: NDArray[np.float64]
    symmetric: NDArray[np.float64]

    @classmethod
    def at(cls, orbits: OrbitProblem, kind: BifurcationKind, unknowns: NDArray[np.float64]) -> SingularOrbits:
        """Set up the equations at a point of the curve."""
        d = orbits.dimension
        left, _, _ = np.linalg.svd(orbits(unknowns)[1][:, :d])
        return cls(orbits, kind, left[:, -1], unknowns[:d])

    def matrix(self, place: SolutionPoint) -> NDArray[np.float64]:
        """Return the monodromy matrix."""
        return self.matrices(place.unknowns)

    def multipliers(self, place: SolutionPoint) -> NDArray[np.complex128]:
        """Return the multipliers, by decreasing modulus."""
        return multipliers_of(self.matrix(place))

    def has_met(self, place: SolutionPoint) -> bool:
        """Return whether the multipliers whose product is 1 on a curve of Neimark-Sacker bifurcations are real."""
        if self.kind is not BifurcationKind.NEIMARK_SACKER:
            return False
        found = multipliers_of(self.matrix(place))
        return bool(abs(found[pair_on_circle(found)[0]].imag) < _REAL)

    def is_symmetric(self, place: SolutionPoint) -> bool:
        """Return whether a place is an orbit, about which the residual is odd along the null vector of a pitchfork.

        A symmetry has this effect, in the limit of small displacements; without one there is no curve of pitchforks.
        """
        if self.kind is not BifurcationKind.PITCHFORK:
            return True
        d = self.orbits.dimension
        matrix = self.orbits(place.unknowns)[1][:, :d]
        left, _, right = np.linalg.svd(matrix)
        along = np.append(_BESIDE * right[-1], [0.0, 0.0])
        here, ahead, behind = self.orbits(place.unknowns + np.outer([0.0, 1.0, -1.0], along))[0] @ left[:, -1]
        size = 1.0 + float(np.linalg.norm(matrix))
        curved = abs(ahead + behind - 2.0 * here) / (2.0 * _BESIDE**2)
        return bool(abs(here) <= _CLOSED * size and curved <= _EVEN * size)

    def matrices(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the monodromy matrices at unknowns (..., d + 2)."""
        d = self.orbits.dimension
        return self.orbits(unknowns)[1][..., :d] + np.eye(d)

    def _test(self, matrices: NDArray[np.float64]) -> NDArray[np.float64]:
        unit = np.eye(matrices.shape[-1])
        if self.kind is BifurcationKind.NEIMARK_SACKER:
            return pairs_beside_one(np.linalg.eigvals(matrices).astype(np.complex128))
        sign = 1.0 if self.kind is BifurcationKind.PERIOD_DOUBLING else -1.0
        with np.errstate(invalid="ignore"):  # a trial may be where there is no image
            return np.asarray(np.linalg.det(matrices + sign * unit))

    def __call__(self, unknowns: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residuals (d + 1,) and their derivatives (d + 1, d + 2) at unknowns (d + 2,)."""
        residual, slopes = self.orbits(unknowns)
        d, m = self.orbits.dimension, len(unknowns)
        offsets = _DIFFERENCE * np.eye(m)
        around = np.concatenate([unknowns + offsets, unknowns - offsets])
        tests = self._test(self.matrices(around))
        gradient = (tests[:m] - tests[m:]) / (2.0 * _DIFFERENCE)
        test = self._test(slopes[:, :d] + np.eye(d))
        if self.kind is not BifurcationKind.PITCHFORK:
            return np.append(residual, test), np.vstack([slopes, gradient])
        # By symmetry the residual has no part along the left null vector, and the state none that breaks the symmetry.
        broken = self.null @ (unknowns[:d] - self.symmetric)
        residual = residual - (self.null @ residual) * self.null + broken * self.null
        slopes = slopes - np.outer(self.null, self.null @ slopes)
        slopes[:, :d] += np.outer(self.null, self.null)
        gradient[:d] -= (gradient[:d] @ self.null) * self.null
        return np.append(residual, test), np.vstack([slopes, gradient])
