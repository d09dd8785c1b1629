"""Equations of a connecting orbit: a chain of images from the unstable manifold of a saddle to a stable manifold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._lib.arrays import Floats
from ..maps.coordinates import difference, shortest, turns_of
from ..maps.point_map import PointMap
from ..maps.tangent import tangent
from .singular_orbits import smallest


@dataclass(frozen=True, eq=False)
class ConnectingProblem:
    """Equations for unknowns (p, q, x_0, ..., x_N, parameters) in units of `scale`.

    p and q are points of two saddles with one unstable multiplier each, fixed under `steps` steps of the map: x_0 - p
    lies in the unstable eigenspace of p, and x_N - q in the stable one of q, which has one dimension less than the
    state.  The others are x_(k+1) = P^steps(x_k), up to full rotations of angles.
    """

    swept: PointMap
    dimension: int
    steps: int
    length: int
    scale: Floats

    @property
    def parameters(self) -> int:
        """Number of free parameters."""
        return self.swept.dimension - self.dimension

    @property
    def points(self) -> int:
        """Number of points: both saddles, and those of the orbit."""
        return self.length + 3

    def states(self, unknowns: Floats) -> Floats:
        """Return the states (points, d + m) of saddles and orbit with the parameters."""
        n, d = self.points, self.dimension
        values = unknowns * self.scale
        return np.column_stack([values[: n * d].reshape(n, d), np.tile(values[n * d :], (n, 1))])

    def __call__(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Return residuals and their derivatives by the unknowns, of one orbit or of several."""
        if unknowns.ndim == 1:
            return self._assembled(unknowns)[:2]
        found = [self._assembled(each) for each in unknowns]
        return np.array([residual for residual, *_ in found]), np.array([slopes for _, slopes, _ in found])

    def _assembled(self, unknowns: Floats) -> tuple[Floats, Floats, Floats]:
        n, d, m = self.points, self.dimension, self.parameters
        states = self.states(unknowns)
        images, matrices = tangent(self.swept, states, self.steps)
        slopes = matrices[:, :d, :]
        turn = turns_of(self.swept.coordinates)[1][:d]
        target = np.concatenate([states[:2, :d], states[3:, :d]])  # the image of each point but the last one
        moved = shortest(images[:-1, :d] - target, turn)
        unit, places = self.scale[:d], np.concatenate([[0, 1], np.arange(3, n)])
        residual = np.zeros(n * d)
        jacobian = np.zeros((n * d, n * d + m))
        at, rows = (n - 1) * d, np.arange(n - 1)
        blocks = np.zeros((n - 1, d, n, d))
        blocks[rows, :, rows] = slopes[:-1, :, :d] * unit / unit[:, None]
        blocks[rows, :, places] -= np.eye(d)
        residual[:at] = (moved / unit).ravel()
        jacobian[:at, : n * d] = blocks.reshape(at, n * d)
        jacobian[:at, n * d :] = (slopes[:-1, :, d:] * self.scale[n * d :] / unit[:, None]).reshape(at, m)
        # The image of p is compared with p itself, that of q with q; those of the orbit with its next points.
        inside = self._left(slopes[0, :, :d], False)
        outside = self._left(slopes[1, :, :d], True)
        first = difference(states[2, :d], states[0, :d], self.swept.coordinates[:d]) / unit
        last = difference(states[-1, :d], states[1, :d], self.swept.coordinates[:d]) / unit
        residual[at : at + len(inside)] = inside @ first
        jacobian[at : at + len(inside), 2 * d : 3 * d] = inside
        jacobian[at : at + len(inside), :d] = -inside
        at += len(inside)
        residual[at:] = outside @ last
        jacobian[at:, (n - 1) * d : n * d] = outside
        jacobian[at:, d : 2 * d] = -outside
        return residual, jacobian, slopes

    def _left(self, matrix: Floats, unstable: bool) -> Floats:
        """Return a basis of rows (k, d) that vanish on the other eigenspace, in units of the scale.

        That of the unstable eigenspace is one row; the others are normal to the unstable eigenvector.
        """
        unit = self.scale[: self.dimension]
        scaled = matrix * unit / unit[:, None]
        values, vectors = np.linalg.eig(scaled.T if unstable else scaled)
        lead = np.real(vectors[:, np.argmax(np.abs(values))])
        rows = lead[None] / np.linalg.norm(lead) if unstable else np.linalg.svd(lead[None])[2][1:]
        # Signs that do not depend on the library of linear algebra.
        largest = np.take_along_axis(rows, np.abs(rows).argmax(axis=1)[:, None], axis=1)
        return np.asarray(rows * np.sign(largest))

    def has_saddles(self, unknowns: Floats) -> bool:
        """Return whether both ends are saddles with one unstable multiplier."""
        d = self.dimension
        slopes = tangent(self.swept, self.states(unknowns)[:2], self.steps)[1][:, :d, :d]
        return bool((np.count_nonzero(np.abs(np.linalg.eigvals(slopes)) > 1.0, axis=-1) == 1).all())

    def angle(self, unknowns: Floats) -> float:
        """Return the angle in radians, in scaled coordinates, between both manifolds at the middle of the orbit.

        Its sign tells on which side they cross; 0 at a tangency.
        """
        d, unit = self.dimension, self.scale[: self.dimension]
        slopes = self._assembled(unknowns)[2]
        scaled = slopes[:, :, :d] * unit / unit[:, None]
        values, vectors = np.linalg.eig(scaled[0])
        along = np.real(vectors[:, np.argmax(np.abs(values))])
        along = along * np.sign(along[np.argmax(np.abs(along))])
        across = self._left(slopes[1, :, :d], True)[0]
        middle = 2 + self.length // 2
        for k in range(2, middle):
            along = scaled[k] @ along
            along /= np.linalg.norm(along)
        for k in range(self.points - 2, middle - 1, -1):
            across = scaled[k].T @ across
            across /= np.linalg.norm(across)
        return float(np.arcsin(np.clip(across @ along, -1.0, 1.0)))

    @property
    def parameter_direction(self) -> Floats:
        """Unit vector along the last parameter."""
        return np.eye(len(self.scale))[-1]


@dataclass(frozen=True, eq=False)
class TangencyProblem:
    """Equations of connecting orbits with two parameters and the condition that both manifolds touch.

    Where they do, the derivatives by all but the parameters are singular.
    """

    orbits: ConnectingProblem

    def __call__(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Return residuals and their derivatives by the unknowns."""
        residual, slopes = self.orbits(unknowns)
        _, size, gradient = smallest(self.orbits, unknowns, slopes[:, : len(residual)])
        return np.append(residual, size), np.vstack([slopes, gradient])

    def has_saddles(self, unknowns: Floats) -> bool:
        """Return whether both ends are saddles with one unstable multiplier."""
        return self.orbits.has_saddles(unknowns)
