"""Branch points: intersections of two solution curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..orbits.arclength import Problem

_DIFFERENCE = 1e-4  # in the unknowns, between derivatives whose derivatives are wanted
_ROUNDS = 8
_CONVERGED = 1e-13


@dataclass(frozen=True, eq=False)
class Crossing:
    """Branch point: the unknowns (n + 1,) and the unit tangents of the known curve and of the other."""

    unknowns: NDArray[np.float64]
    along: NDArray[np.float64]
    branch_direction: NDArray[np.float64]


def crossing(problem: Problem, guess: NDArray[np.float64], along: NDArray[np.float64]) -> Crossing | None:
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
        return _crossing(problem, guess, along)
    except np.linalg.LinAlgError:
        return None


def _crossing(problem: Problem, guess: NDArray[np.float64], along: NDArray[np.float64]) -> Crossing:
    unknowns, unfolding = guess.copy(), 0.0
    left, _, right = np.linalg.svd(_finite(problem(unknowns)[1]))
    b, plane = left[:, -1], right[-2:]
    n = len(b)
    for _ in range(_ROUNDS):
        residual, derivatives = map(_finite, problem(unknowns))
        bordered = np.zeros((n + 2, n + 2))
        bordered[:n, : n + 1], bordered[:n, n + 1], bordered[n:, : n + 1] = derivatives, b, plane
        inverse = np.linalg.inv(bordered)
        z, defects, v = inverse[n + 1, :n], inverse[n + 1, n:], inverse[: n + 1, n:]
        matrix = np.zeros((n + 2, n + 2))
        matrix[:n, : n + 1], matrix[:n, n + 1] = derivatives, b
        matrix[n:, : n + 1] = -np.einsum("i,kij,jm->mk", z, _changes(problem, unknowns), v)
        change = np.linalg.lstsq(matrix, -np.append(residual + unfolding * b, defects), rcond=1e-8)[0]
        unknowns, unfolding = unknowns + change[:-1], unfolding + change[-1]
        if np.linalg.norm(change) <= _CONVERGED:
            break
    if not np.linalg.norm(unknowns - guess) <= 1e-2:
        unknowns = guess
    return _tangents(problem, unknowns, along)


def _changes(problem: Problem, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivatives of the derivatives by each unknown, shape (n + 1, n, n + 1)."""
    offsets = _DIFFERENCE * np.eye(len(unknowns))
    slopes = _finite(problem(np.concatenate([unknowns + offsets, unknowns - offsets]))[1])
    return (slopes[: len(offsets)] - slopes[len(offsets) :]) / (2.0 * _DIFFERENCE)


def _tangents(problem: Problem, unknowns: NDArray[np.float64], along: NDArray[np.float64]) -> Crossing:
    left, _, right = np.linalg.svd(_finite(problem(unknowns)[1]))
    plane = right[-2:]
    curved = plane @ np.einsum("i,kij->kj", left[:, -1], _changes(problem, unknowns)) @ plane.T
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
    return Crossing(unknowns, known, other / np.linalg.norm(other))


def _finite(values: NDArray[np.float64]) -> NDArray[np.float64]:
    if not np.isfinite(values).all():
        raise np.linalg.LinAlgError("values that are not finite")
    return values
