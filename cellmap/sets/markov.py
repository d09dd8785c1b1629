"""Finite Markov chains as sparse matrices: classes, absorption, invariant measures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, reverse_cuthill_mckee

from .._compiled.kernels.chains import balance, eliminate, relax, substitute, sweep
from .._lib.arrays import Bools, Floats, Ints
from .._lib.checks import warn_caller

_PATIENCE = 100  # sweeps, up and down, before a class is left to another solver
_TOLERANCE = 1e-11
_DIRECT = 2e10  # multiplications in a band up to which a class is solved by elimination
_AT_ONCE = 4e9  # multiplications up to which measures that steps of the chain may find as well are found by elimination
_ACCEPTED = 1e-5  # error that is not worth a warning
_POWERS = 1000

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

    of: Ints
    order: Ints
    begin: Ints
    closed: Bools
    recurs: Bools

    def states(self, number: int) -> Ints:
        """Return the states of a component, sorted."""
        return np.sort(self.order[self.begin[number] : self.begin[number + 1]])


def components_of(matrix: Sparse, leaks: Bools | None = None) -> Components:
    """Return the strongly connected components of a matrix of transitions; states may also leak elsewhere."""
    count, of = connected_components(matrix, directed=True, connection="strong")
    rows, columns = _steps(matrix)
    if (of[rows] < of[columns]).any():  # the order of the numbers is a custom of SciPy's algorithm, not a promise
        of = count - 1 - of
    within = of[rows] == of[columns]
    closed, recurs = np.ones(count, bool), np.zeros(count, bool)
    closed[of[rows[~within]]], recurs[of[rows[within]]] = False, True
    if leaks is not None:
        closed[of[leaks]] = False
    begin = np.concatenate([[0], np.cumsum(np.bincount(of, minlength=count))])
    return Components(of.astype(np.int64), np.argsort(of, kind="stable"), begin, closed, recurs)


def recurrent_parts(graph: Sparse) -> Ints:
    """Return the number of the component on which each state lies, -1 for states on no closed path of steps.

    Components are numbered by their first states.
    """
    found = components_of(graph)
    numbers = np.full(len(found.of), -1)
    where = np.flatnonzero(found.recurs[found.of])
    _, first, part = np.unique(found.of[where], return_index=True, return_inverse=True)
    numbers[where] = np.argsort(np.argsort(first))[part]
    return numbers


def periods_of(matrix: Sparse, components: Components, numbers: Ints) -> Ints:
    """Return the periods of some components, in order: the greatest common divisors of the lengths of their cycles."""
    n, of = len(components.of), components.of
    rows, columns = _steps(matrix)
    within = (of[rows] == of[columns]) & np.isin(of, numbers)[rows]
    rows, columns = rows[within], columns[within]
    roots = components.order[components.begin[numbers]]
    # One more state leads to a state of each component: its search by breadth gives the distances from these.
    links = np.concatenate([rows, np.full(len(roots), n)]), np.concatenate([columns, roots])
    before = breadth_first_order(csr_array((np.ones(len(links[0]), np.int8), links), shape=(n + 1, n + 1)), n)[1]
    ahead, distance = np.where(before < 0, n, before), (before >= 0).astype(np.int64)
    while (ahead < n).any():
        distance, ahead = distance + distance[ahead], ahead[ahead]
    gaps = np.concatenate([np.abs(distance[rows] + 1 - distance[columns]), np.zeros(len(roots), np.int64)])
    owner = np.concatenate([of[rows], of[roots]])
    order = np.argsort(owner, kind="stable")
    begin = np.searchsorted(owner[order], numbers)
    return np.gcd.reduceat(gaps[order], begin) if len(numbers) else begin


def _steps(matrix: Sparse) -> tuple[Ints, Ints]:
    """Return the states that the entries of a matrix lead from, and to."""
    return np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr)), matrix.indices


def solve_transient(matrix: Sparse, components: Components, values: Floats, gain: Floats) -> None:
    """Solve ``values = gain + matrix @ values`` in the states that are not in closed components, in place.

    ``values`` (states, k) are given in closed components and 0 elsewhere; ``gain`` (k,) is what a step adds.
    Components are solved one after the other, so that each has those that it leads to behind it: states alone by
    substitution, others by Gauss and Seidel's method.  Where this converges slowly, as it does where chance leaves a
    component late, elimination takes its place, or GMRES for components whose states lead everywhere; a RuntimeWarning
    says where probabilities of a component are left with an error above 1e-5.
    """
    number, last = 0, len(components.closed)
    while True:
        number = relax(
            (matrix.indptr, matrix.indices, matrix.data),
            (components.order, components.begin, components.closed),
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


def _solve_component(matrix: Sparse, states: Ints, values: Floats, gain: Floats) -> None:
    """Solve the equations of one transient component, from values that are close."""
    rows = matrix[states]
    guess = values[states]
    values[states] = 0.0
    right = rows @ values + gain
    elsewhere = np.ones(len(values))
    elsewhere[states] = 0.0
    values[states] = _solved(rows[:, states], right, rows @ elsewhere, guess)


def _solved(inner: Sparse, right: Floats, leak: Floats, guess: Floats) -> Floats:
    """Solve ``x = right + inner @ x``, where `leak` goes elsewhere: by elimination where it fills a narrow band only.

    No number is subtracted in an elimination, so that a component is solved to all digits however late it is left.
    """
    order, band = _banded(inner)
    if band is None:
        return _by_gmres(inner, right, leak, guess)
    ordered, pivots = right[order], np.empty(len(right))
    eliminate(band, ordered, leak[order], pivots)
    substitute(band, ordered, pivots)
    solution = np.empty_like(right)
    solution[order] = ordered
    return solution


def _banded(inner: Sparse) -> tuple[Ints, Floats | None]:
    """Return an order of states in which most of them lead to close ones, and their fractions; None for a wide band."""
    n = inner.shape[0]
    order = np.asarray(reverse_cuthill_mckee(inner + inner.T, symmetric_mode=True), dtype=np.int64)
    place = np.empty(n, np.int64)
    place[order] = np.arange(n)
    entries = inner.tocoo()
    rows, columns = place[entries.row], place[entries.col]
    width = int(np.abs(rows - columns).max(initial=0))
    if n * (width + 1) ** 2 > _DIRECT:
        return order, None
    band = np.zeros((n, 2 * width + 1))
    band[rows, columns - rows + width] = entries.data
    return order, band


def _by_gmres(inner: Sparse, right: Floats, leak: Floats, guess: Floats) -> Floats:
    """Solve for several right sides by GMRES; each step begins with a sweep, which leaves it the slow modes alone.

    One more right side, `leak`, has the solution 1.  What comes out in its place is an error that all others share, and
    they are freed from it.
    """
    from scipy.sparse import eye_array
    from scipy.sparse.linalg import LinearOperator, gmres

    system = eye_array(len(right), format="csr") - inner

    def swept(residual: Floats) -> Floats:
        out = np.empty(len(right))
        sweep((inner.indptr, inner.indices, inner.data), residual.ravel(), out)
        return out

    preconditioner = LinearOperator(system.shape, swept, dtype=float)

    def solve(one: Floats, start: Floats) -> Floats:
        return np.asarray(
            gmres(system, one, x0=start, rtol=1e-12, atol=0.0, restart=100, maxiter=5, M=preconditioner)[0]
        )

    certain = solve(leak, np.ones(len(right)))
    error = float(np.abs(certain - 1.0).max())
    if not error <= _ACCEPTED:
        warn_caller(
            f"probabilities of a transient class of {len(right):,} states sum up to 1 with an error of {error:.1g} "
            "only: the class is left too slowly; take several periods at a time, or finer cells",
            RuntimeWarning,
        )
    solution = guess.copy()
    for k in np.flatnonzero(right.any(axis=0)):
        solution[:, k] = np.maximum(solve(right[:, k], guess[:, k]) / certain, 0.0)
    return solution


def invariant_measure(matrix: Sparse, states: Ints) -> Floats:
    """Compute the invariant measure of a closed component: the stationary probabilities of its states.

    Warns
    -----
    RuntimeWarning
        If the residual of the measure is above 1e-5.
    """
    if len(states) == 1:
        return np.ones(1)
    inner = matrix[states][:, states]
    order, band = _banded(inner)
    if band is not None and band.size * band.shape[1] <= _AT_ONCE:
        return _eliminated(order, band)
    # Steps of the chain are cheaper for many states, and as good where none of these is left seldom.
    forward = inner.T.tocsr()
    measure, residual = _by_powers(forward, np.full(len(states), 1.0 / len(states)))
    if residual <= _TOLERANCE:
        return measure
    if band is not None:
        return _eliminated(order, band)
    measure, residual = _by_arnoldi(forward, measure)
    if residual > _ACCEPTED:
        warn_caller(
            f"the invariant measure of a class of {len(states):,} states has a residual of {residual:.1g}: "
            "it mixes too slowly; take several periods at a time, or coarser cells",
            RuntimeWarning,
        )
    return measure


def _eliminated(order: Ints, band: Floats) -> Floats:
    """Return the measure of a chain whose shares lie in a band."""
    n = len(order)
    pivots, ordered, measure = np.empty(n), np.empty(n), np.empty(n)
    eliminate(band, np.empty((n, 0)), np.zeros(n), pivots)
    balance(band, pivots, ordered)
    measure[order] = ordered / ordered.sum()
    return measure


def _by_powers(forward: Sparse, measure: Floats) -> tuple[Floats, float]:
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


def _by_arnoldi(forward: Sparse, measure: Floats) -> tuple[Floats, float]:
    """Improve a measure of a chain that mixes slowly."""
    from scipy.sparse.linalg import ArpackNoConvergence, eigs

    try:
        _, vectors = eigs(forward, k=1, which="LR", v0=measure, ncv=60, tol=1e-12)
    except ArpackNoConvergence:
        return measure, float(np.abs(forward @ measure - measure).sum())
    better = np.abs(vectors[:, 0].real)
    better /= better.sum()
    return better, float(np.abs(forward @ better - better).sum())
