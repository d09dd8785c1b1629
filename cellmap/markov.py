"""Finite Markov chains as sparse matrices: classes, absorption, invariant measures."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .kernels.cells import component_period, describe_components, relax, strong_components, sweep

_PATIENCE = 100  # sweeps, up and down, before a class is left to another solver
_TOLERANCE = 1e-11
_DIRECT = 1e11  # multiplications in a band up to which a class is solved by elimination
_FEW = 2000  # states of which the invariant measure comes from elimination
_ACCEPTED = 1e-7  # residual that is worth a warning
_POWERS = 2000

Sparse = Any
"""A ``scipy.sparse.csr_array``."""


@dataclass(frozen=True, eq=False)
class Components:
    """Strongly connected components of a chain, each behind those that it leads to.

    Parameters
    ----------
    of : ndarray of int, shape (states,)
        Component of each state.
    order : ndarray of int, shape (states,)
        States, component by component.
    begin : ndarray of int, shape (components + 1,)
        Where each component begins in `order`.
    closed : ndarray of bool, shape (components,)
        Components that no step leaves.
    recurs : ndarray of bool, shape (components,)
        Components with a step from one of their states to one of their states.
    """

    of: NDArray[np.int64]
    order: NDArray[np.int64]
    begin: NDArray[np.int64]
    closed: NDArray[np.bool_]
    recurs: NDArray[np.bool_]

    def states(self, number: int) -> NDArray[np.int64]:
        """Return the states of a component, sorted."""
        return np.sort(self.order[self.begin[number] : self.begin[number + 1]])


def components_of(matrix: Sparse) -> Components:
    """Return the strongly connected components of a row-stochastic matrix.

    References
    ----------
    Tarjan, SIAM Journal on Computing 1 (1972) 146.
    """
    n = matrix.shape[0]
    of, order = np.empty(n, np.int64), np.empty(n, np.int64)
    count = strong_components(matrix.indptr, matrix.indices, of, order)
    leaves, recurs = np.empty(count, bool), np.empty(count, bool)
    describe_components(matrix.indptr, matrix.indices, of, leaves, recurs)
    begin = np.concatenate([[0], np.cumsum(np.bincount(of, minlength=count))])
    return Components(of, order, begin, ~leaves, recurs)


def periods_of(matrix: Sparse, components: Components, numbers: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the periods of some components: the greatest common divisors of the lengths of their cycles."""
    level = np.full(len(components.of), -1, np.int64)
    queue = np.empty(len(components.of), np.int64)
    arguments = matrix.indptr, matrix.indices, components.of
    return np.array(
        [component_period(*arguments, components.order[components.begin[c]], level, queue) for c in numbers], np.int64
    )


def solve_transient(
    matrix: Sparse, components: Components, values: NDArray[np.float64], gain: NDArray[np.float64]
) -> None:
    """Solve ``values = gain + matrix @ values`` in the states that are not in closed components, in place.

    Components are solved one after the other, so that each has those that it leads to behind it: states alone by
    substitution, others by Gauss and Seidel's method.  Where this converges slowly, as it does where chance leaves a
    component    late, elimination takes its place, or GMRES for components whose states lead everywhere.

    Parameters
    ----------
    matrix : csr_array
        Row-stochastic.
    components : Components
        Of the matrix.
    values : ndarray, shape (states, k)
        Given in closed components, 0 elsewhere.
    gain : ndarray, shape (k,)
        What a step adds.

    Warns
    -----
    RuntimeWarning
        Where an equation is left with a residual above 1e-7.
    """
    number, last = 0, len(components.closed)
    while True:
        number = relax(
            matrix.indptr,
            matrix.indices,
            matrix.data,
            components.order,
            components.begin,
            components.closed,
            gain,
            values,
            number,
            last,
            _PATIENCE,
            _TOLERANCE,
        )
        if number == last:
            return
        _solve_component(matrix, components.states(number), values, gain)
        number += 1


def _solve_component(
    matrix: Sparse, states: NDArray[np.int64], values: NDArray[np.float64], gain: NDArray[np.float64]
) -> None:
    """Solve the equations of one transient component, from values that are close."""
    rows = matrix[states]
    guess = values[states]
    values[states] = 0.0
    right = rows @ values + gain
    values[states] = _solved(rows[:, states], right, guess)


def _solved(inner: Sparse, right: NDArray[np.float64], guess: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve ``x = right + inner @ x`` for several right sides: by elimination where this fills a narrow band only."""
    from scipy.sparse import eye_array
    from scipy.sparse.csgraph import reverse_cuthill_mckee
    from scipy.sparse.linalg import splu

    n = len(right)
    system = eye_array(n, format="csr") - inner
    order = reverse_cuthill_mckee(system)
    place = np.empty(n, np.int64)
    place[order] = np.arange(n)
    entries = system.tocoo()
    band = int(np.abs(place[entries.row] - place[entries.col]).max())
    if n * band**2 > _DIRECT:
        return _by_gmres(inner, system, right, guess)
    solution = np.empty_like(right)
    solution[order] = splu(system[order][:, order].tocsc(), permc_spec="NATURAL").solve(right[order])
    return solution


def _by_gmres(
    inner: Sparse, system: Sparse, right: NDArray[np.float64], guess: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Solve for several right sides by GMRES; each step begins with a sweep, which leaves it the slow modes alone."""
    from scipy.sparse.linalg import LinearOperator, gmres

    def swept(residual: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.empty(len(right))
        sweep(inner.indptr, inner.indices, inner.data, residual.ravel(), out)
        return out

    preconditioner = LinearOperator(system.shape, swept, dtype=float)
    solution = guess.copy()
    for k in np.flatnonzero(right.any(axis=0)):
        solution[:, k], _ = gmres(
            system, right[:, k], x0=guess[:, k], rtol=1e-12, atol=0.0, restart=100, maxiter=5, M=preconditioner
        )
    residual = np.abs(system @ solution - right).max() / max(1.0, float(np.abs(solution).max()))
    if residual > _ACCEPTED:
        warnings.warn(
            f"a transient class of {len(right):,} states is solved to a residual of {residual:.1g} only: chance leaves "
            "it too late; take several periods at a time, or finer cells",
            RuntimeWarning,
            stacklevel=2,
        )
    return solution


def invariant_measure(matrix: Sparse, states: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the probabilities with which a chain is found in the states of a closed component, in the long run.

    Warns
    -----
    RuntimeWarning
        Where the measure is left with a residual above 1e-7.
    """
    if len(states) == 1:
        return np.ones(1)
    inner = matrix[states][:, states]
    forward = inner.T.tocsr()
    measure = np.full(len(states), 1.0 / len(states)) if len(states) > _FEW else _eliminated(inner)
    measure, residual = _by_powers(forward, measure)
    if residual > _TOLERANCE:
        measure, residual = _by_arnoldi(forward, measure)
    if residual > _ACCEPTED:
        warnings.warn(
            f"the invariant measure of a class of {len(states):,} states is left with a residual of {residual:.1g}: "
            "it mixes too slowly; take several periods at a time, or coarser cells",
            RuntimeWarning,
            stacklevel=2,
        )
    return measure


def _eliminated(inner: Sparse) -> NDArray[np.float64]:
    """Return the measure of few states: that of the last one is 1, and the others follow."""
    from scipy.sparse import eye_array
    from scipy.sparse.linalg import splu

    rest = inner.shape[0] - 1
    system = (eye_array(rest, format="csc") - inner[:rest, :rest].T).tocsc()
    measure = np.append(splu(system).solve(inner[[rest], :rest].toarray()[0]), 1.0)
    return np.asarray(measure / measure.sum())


def _by_powers(forward: Sparse, measure: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Improve a measure by steps of the chain, half of which rest, so that those with a period converge too."""
    residual = np.inf
    for _ in range(_POWERS):
        image = forward @ measure
        image /= image.sum()
        residual = float(np.abs(image - measure).sum())
        measure = 0.5 * (measure + image)
        if residual <= _TOLERANCE:
            break
    return measure, residual


def _by_arnoldi(forward: Sparse, measure: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Improve a measure of a chain that mixes slowly."""
    from scipy.sparse.linalg import ArpackNoConvergence, eigs

    try:
        _, vectors = eigs(forward, k=1, which="LR", v0=measure, ncv=60, tol=1e-12)
    except ArpackNoConvergence:
        return measure, float(np.abs(forward @ measure - measure).sum())
    better = np.abs(vectors[:, 0].real)
    better /= better.sum()
    return better, float(np.abs(forward @ better - better).sum())
