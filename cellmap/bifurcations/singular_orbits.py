"""Orbits at which derivatives are singular: equations of bifurcations in two parameters, and branch points in one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .._lib.arrays import Complexes, Floats
from ..orbits.arclength import Problem, SolutionPoint
from ..orbits.multipliers import pair_on_circle
from ..orbits.orbit_equations import OrbitProblem
from .homological import cycle_matrix
from .kinds import BifurcationKind

_DIFFERENCE = 3e-5  # displacement in scaled unknowns by which derivatives are differentiated
_REAL = 1e-4  # imaginary part of multipliers that have met on the real axis
_BESIDE = 1e-3  # displacement, scaled, along the null vector, at which a symmetry shows
_EVEN = 1e-4  # even part of the residual there, in squares of it, that is rounding and terms of the fourth order
_CLOSED = 1e-9  # residual of an orbit
_CENTRED = 1e-11  # residual at a centre about which the equations are odd to third order
_ROUNDS = 8
_CONVERGED = 1e-13

Vectors = Floats


@dataclass(frozen=True, eq=False)
class SingularOrbits:
    """Equations of an orbit with a bifurcation condition, for unknowns (x_1, ..., x_n, q) in units of a scale.

    The orbit is in n segments, and q are m parameters.  At a fold and at a pitchfork the derivatives by the states are
    singular; at a period doubling they are with the sign of the last segment's end changed, and at a Neimark-Sacker
    bifurcation those of the areas between two deviations, which have the products of two multipliers each.  The
    condition is that the smallest singular value vanishes: it does whatever the size of the other multipliers, with a
    gradient from second derivatives along the singular vectors.  At a pitchfork, which is a branch point at `origin` (n
    d + m,) and persists through a symmetry, the residual along the left null vector is an unfolding that is left out,
    and displacements along it are held at zero; where the centre of the symmetry moves (an `origin` of NaN), the second
    derivative of that residual along the right null vector vanishes instead.

    References
    ----------
    Govaerts, *Numerical Methods for Bifurcations of Dynamical Equilibria* (2000), chapters 3 to 5.
    """

    orbits: OrbitProblem
    kind: BifurcationKind
    origin: Vectors

    def multipliers(self, place: SolutionPoint) -> Complexes:
        """Return the multipliers, by decreasing modulus."""
        return self.orbits.multipliers(self._orbit(place))

    def _orbit(self, place: SolutionPoint) -> SolutionPoint:
        """Return the place as a solution of the equations of the orbit alone."""
        pitchfork = self.kind is BifurcationKind.PITCHFORK
        slopes = self.orbits(place.unknowns)[1] if pitchfork else place.derivatives[: self.orbits.states]
        return SolutionPoint(place.unknowns, slopes, place.tangent)

    def has_met(self, place: SolutionPoint) -> bool:
        """Return whether the multipliers whose product is 1 on a curve of Neimark-Sacker bifurcations are real."""
        if self.kind is not BifurcationKind.NEIMARK_SACKER:
            return False
        found = self.multipliers(place)
        return bool(abs(found[pair_on_circle(found)[0]].imag) < _REAL)

    def is_symmetric(self, place: SolutionPoint) -> bool:
        """Return whether a place is an orbit, about which the residual is odd along the null vector of a pitchfork.

        A symmetry has this effect, in the limit of small displacements; without one there is no curve of pitchforks.
        """
        if self.kind is not BifurcationKind.PITCHFORK:
            return True
        matrix = self.orbits(place.unknowns)[1][:, : self.orbits.states]
        left, _, right = np.linalg.svd(matrix)
        along = np.append(_BESIDE * right[-1], np.zeros(len(place.unknowns) - len(matrix)))
        here, ahead, behind = self.orbits(place.unknowns + np.outer([0.0, 1.0, -1.0], along))[0] @ left[:, -1]
        size = 1.0 + float(np.linalg.norm(matrix))
        curved = abs(ahead + behind - 2.0 * here) / (2.0 * _BESIDE**2)
        return bool(abs(here) <= (_CENTRED if self._moves else _CLOSED) * size and curved <= _EVEN * size)

    def __call__(self, unknowns: Vectors) -> tuple[Vectors, Floats]:
        """Return residuals (n d + 1,) and their derivatives (n d + 1, n d + m) at unknowns (n d + m,)."""
        residual, slopes = self.orbits(unknowns)
        states = self.orbits.states
        if not np.isfinite(slopes).all():
            return np.full(states + 1, np.nan), np.full((states + 1, len(unknowns)), np.nan)
        if self.kind is BifurcationKind.NEIMARK_SACKER:
            test, gradient = self._of_areas(unknowns, slopes)
            return np.append(residual, test), np.vstack([slopes, gradient])
        block = self.orbits.twisted(slopes) if self.kind is BifurcationKind.PERIOD_DOUBLING else slopes[:, :states]
        null, size, gradient = smallest(self.orbits, unknowns, block)
        if self.kind is BifurcationKind.PITCHFORK:
            if self._moves:
                broken, across = self._curvature(unknowns, null), self._curvature_slopes(unknowns, null)
            else:
                broken = float(null @ (unknowns - self.origin)[:states])
                across = np.append(null, np.zeros(len(unknowns) - states))
            residual = residual + (broken - null @ residual) * null
            slopes = slopes + np.outer(null, across - null @ slopes)
        return np.append(residual, size), np.vstack([slopes, gradient])

    @property
    def _moves(self) -> bool:
        return bool(np.isnan(self.origin).any())

    def with_moving_centre(self) -> SingularOrbits:
        """Return the equations of pitchforks about a centre that depends on the parameters."""
        return replace(self, origin=np.full_like(self.origin, np.nan))

    def _curvature(self, unknowns: Vectors, null: Vectors) -> float:
        """Return the second derivative along the right null vector of the residual along the left one.

        The left null vector has the direction of a similar one.
        """
        left, _, right = np.linalg.svd(self.orbits(unknowns)[1][:, : self.orbits.states])
        along = np.append(right[-1], np.zeros(len(unknowns) - len(left)))
        return float(_bent(self.orbits, unknowns, left[:, -1], along[None])[0] @ along * np.sign(left[:, -1] @ null))

    def _curvature_slopes(self, unknowns: Vectors, null: Vectors) -> Vectors:
        shifts = _BESIDE * np.eye(len(unknowns))
        around = [self._curvature(unknowns + s, null) - self._curvature(unknowns - s, null) for s in shifts]
        return np.array(around) / (2.0 * _BESIDE)

    def _of_areas(self, unknowns: Vectors, slopes: Floats) -> tuple[float, Vectors]:
        """Return the smallest singular value of the derivatives of areas, and its gradient (n d + m,)."""
        orbits, d = self.orbits, self.orbits.dimension
        areas = _of_pairs(orbits.factors(slopes))
        n, pairs = areas.shape[:2]
        left, sizes, right = np.linalg.svd(cycle_matrix(areas, 1.0))
        # Each segment depends on its own state alone, so that all of them are displaced at once.
        m = len(unknowns) - n * d
        each = np.zeros((d + m, len(unknowns)))
        each[:d, : n * d], each[d:, n * d :] = np.tile(np.eye(d), n), np.eye(m)
        around = _of_pairs(orbits.factors(orbits(unknowns + _DIFFERENCE * np.concatenate([each, -each]))[1]))
        changes = (around[: d + m] - around[d + m :]) / (2.0 * _DIFFERENCE)
        null, image = left[:, -1].reshape(n, pairs), right[-1].reshape(n, pairs)
        gradient = np.einsum("ki,jkil,kl->kj", null, changes, image)
        return float(sizes[-1]), np.append(gradient[:, :d].ravel(), gradient[:, d:].sum(axis=0))


def _of_pairs(matrices: Floats) -> Floats:
    """Return the action of matrices (..., d, d) on areas: their minors of order two, by pairs of rows and columns."""
    i, j = np.triu_indices(matrices.shape[-1], 1)
    a, b = matrices[..., i, :], matrices[..., j, :]
    return np.asarray(a[..., i] * b[..., j] - a[..., j] * b[..., i])


def smallest(problem: Problem, unknowns: Vectors, block: Floats) -> tuple[Vectors, float, Vectors]:
    """Return the left vector of the smallest singular value, that value, and its gradient by the unknowns (n + m,).

    The block (n, n) are derivatives of the residuals by the first n unknowns, up to constants.
    """
    left, sizes, right = np.linalg.svd(block)
    along = np.append(right[-1], np.zeros(len(unknowns) - len(block)))
    return left[:, -1], float(sizes[-1]), _bent(problem, unknowns, left[:, -1], along[None])[0]


def _bent(problem: Problem, unknowns: Vectors, left: Vectors, directions: Floats) -> Floats:
    """Return the second derivatives (k, n + m) along directions (k, n + m) of the part of residuals along a vector."""
    lengths = _DIFFERENCE / np.maximum(np.abs(directions).max(axis=1, keepdims=True), 1e-300)
    shifts = lengths * directions
    slopes = left @ problem(unknowns + np.concatenate([shifts, -shifts]))[1]
    return np.asarray((slopes[: len(shifts)] - slopes[len(shifts) :]) / (2.0 * lengths))


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """Branch point: the unknowns (n + 1,) and the unit tangents of the known curve and of the other."""

    unknowns: Vectors
    along: Vectors
    branch_direction: Vectors


def branch_point(problem: Problem, guess: Vectors, along: Vectors) -> BranchPoint | None:
    """Return the branch point near a guess, where the derivatives (n, n + 1) are rank-deficient, and both tangents.

    None where the derivatives are not known around it.

    The branch point solves G + mu b = 0 and z D = 0 for the left null vector z of the derivatives D, with an unfolding
    mu that vanishes, so that it is found as accurately as a regular solution.  The tangents are the roots of the
    algebraic branching equation, of which the one next to `along` is known.

    References
    ----------
    Griewank, Reddien, SIAM Journal on Numerical Analysis 21 (1984) 176; Keller, *Lectures on Numerical Methods in
    Bifurcation Problems* (1987), section 5.
    """
    try:
        return _branch_point(problem, guess, along)
    except np.linalg.LinAlgError:
        return None


def _branch_point(problem: Problem, guess: Vectors, along: Vectors) -> BranchPoint:
    unknowns, unfolding = guess.copy(), 0.0
    left, _, right = np.linalg.svd(_finite(problem(unknowns)[1]))
    b, plane = left[:, -1], right[-2:]
    n = len(b)
    for _ in range(_ROUNDS):
        residual, derivatives = map(_finite, problem(unknowns))
        inverse = np.linalg.inv(np.block([[derivatives, b[:, None]], [plane, np.zeros((2, 1))]]))
        z, defects, v = inverse[n + 1, :n], inverse[n + 1, n:], inverse[: n + 1, n:]
        bent = _finite(_bent(problem, unknowns, z, v.T))
        matrix = np.block([[derivatives, b[:, None]], [-bent, np.zeros((2, 1))]])
        change = np.linalg.lstsq(matrix, -np.append(residual + unfolding * b, defects), rcond=1e-8)[0]
        unknowns, unfolding = unknowns + change[:-1], unfolding + change[-1]
        if np.linalg.norm(change) <= _CONVERGED:
            break
    if not np.linalg.norm(unknowns - guess) <= 1e-2:
        unknowns = guess
    left, _, right = np.linalg.svd(_finite(problem(unknowns)[1]))
    plane = right[-2:]
    curved = plane @ _finite(_bent(problem, unknowns, left[:, -1], plane)).T
    size, axes = np.linalg.eigh(0.5 * (curved + curved.T))
    if not size[0] < 0.0 < size[1]:
        # Without a second root nothing is known of the other curve but that it leaves the first one.
        known = plane.T @ (plane @ along)
        other = plane.T @ (np.array([[0.0, -1.0], [1.0, 0.0]]) @ (plane @ known))
    else:
        parts = np.sqrt(size[1]) * axes[:, 0], np.sqrt(-size[0]) * axes[:, 1]
        known, other = plane.T @ (parts[0] + parts[1]), plane.T @ (parts[0] - parts[1])
        if abs(other @ along) * np.linalg.norm(known) > abs(known @ along) * np.linalg.norm(other):
            known, other = other, known
    known *= np.copysign(1.0, known @ along) / np.linalg.norm(known)
    return BranchPoint(unknowns, known, other / np.linalg.norm(other))


def _finite(values: Floats) -> Floats:
    if not np.isfinite(values).all():
        raise np.linalg.LinAlgError("values that are not finite")
    return values
