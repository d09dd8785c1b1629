"""Equations of periodic orbits in segments at a fold or a period doubling, in two parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._lib.checks import shown
from ..maps.parameters_as_states import swept_map
from ..maps.point_map import PointMap
from ..orbits.arclength import SolutionPoint
from ..orbits.shooting import ShootingProblem
from .branch import Bifurcation
from .kinds import BifurcationKind

_DIFFERENCE = 1e-5  # of derivatives, in scaled unknowns


@dataclass(frozen=True, eq=False)
class SingularSegments:
    """Equations of an orbit in segments with the bifurcation condition, for unknowns (x_1, ..., x_n, q1, q2).

    The derivatives by the states are singular at a fold; at a period doubling they are with the sign of the last
    segment's end changed.  A bordered system (Govaerts 2000) has a solution that vanishes there, whatever the size of
    the other multipliers, with a gradient from second derivatives along the null vectors.
    """

    orbits: ShootingProblem
    kind: BifurcationKind
    left: NDArray[np.float64]
    right: NDArray[np.float64]

    @classmethod
    def at(
        cls, exact: PointMap, names: tuple[str, str], spans: tuple[float, float], bifurcation: Bifurcation
    ) -> tuple[SingularSegments, NDArray[np.float64]]:
        """Set up the equations at a bifurcation of orbits in segments, and return its unknowns."""
        old, kind = bifurcation._problem, bifurcation.kind
        assert isinstance(old, ShootingProblem)
        if kind not in {BifurcationKind.FOLD, BifurcationKind.PERIOD_DOUBLING}:
            raise ValueError(
                f"bifurcation={shown(bifurcation)}: of orbits in segments, those with multipliers of more than 1e6, "
                "folds and period doublings are continued alone"
            )
        swept = swept_map(exact, *names)
        parts = swept.specified.parts(len(old.parts))
        assert parts is not None, "the orbit is in segments"
        orbits = ShootingProblem(exact, swept, old.period, np.append(old.scale[:-1], spans), parts)
        states = (bifurcation._unknowns * old.scale)[:-1]
        unknowns = np.append(states, [exact.params[name] for name in names]) / orbits.scale
        none = cls(orbits, kind, np.zeros(orbits.states), np.zeros(orbits.states))
        left, _, right = np.linalg.svd(none._twisted(orbits(unknowns)[1]))
        return cls(orbits, kind, left[:, -1], right[-1]), unknowns

    def _twisted(self, slopes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives (n d, n d) by the states that are singular at the bifurcation."""
        d, n = self.orbits.dimension, self.orbits.states
        block = slopes[:, :n].copy()
        if self.kind is BifurcationKind.PERIOD_DOUBLING:
            block[-d:, :d] += 2.0 * np.eye(d)
        return block

    def __call__(self, unknowns: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residuals (n d + 1,) and their derivatives (n d + 1, n d + 2)."""
        n = self.orbits.states
        residual, slopes = self.orbits(unknowns)
        bordered = np.block([[self._twisted(slopes), self.left[:, None]], [self.right[None], np.zeros((1, 1))]])
        end = np.append(np.zeros(n), 1.0)
        along, across = np.linalg.solve(bordered, end), np.linalg.solve(bordered.T, end)
        step = _DIFFERENCE / max(float(np.abs(along[:n]).max()), 1e-300)
        shift = np.append(step * along[:n], np.zeros(2))
        ahead, behind = self.orbits(unknowns + shift)[1], self.orbits(unknowns - shift)[1]
        gradient = -across[:n] @ (ahead - behind) / (2.0 * step)
        return np.append(residual, along[-1]), np.vstack([slopes, gradient])

    def multipliers(self, place: SolutionPoint) -> NDArray[np.complex128]:
        """Return the multipliers, by decreasing modulus."""
        return self.orbits.multipliers(place)
