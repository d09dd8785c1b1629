"""Derivatives of point maps up to the third: the multilinear forms of their Taylor series."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement, pairwise, permutations
from math import factorial, prod

import numpy as np
from numpy.typing import NDArray

from .coordinates import wrap
from .orbit_batch import Orbits
from .point_map import PointMap
from .side_by_side import advance_on_threads
from .tangent import tangent

_ORDER = 3
_LONGER = 1.7  # factor between the curves of two evaluations
_DISTANCES = 0.04, 0.02, 0.01  # of Jacobian matrices whose differences are taken, in natural sizes


@dataclass(frozen=True, eq=False)
class MultilinearForms:
    """Taylor series x + h -> P(x) + A h + B(h, h)/2 + C(h, h, h)/6 of a map, in units of natural sizes.

    ``linear`` (n, d, d), ``quadratic`` (n, d, d, d) and ``cubic`` (n, d, d, d, d) are computed in two ways of equal
    right, along the first axis of all three, (2, n, ...), so that their difference shows the error.  With `exact` they
    come from integrated higher variational equations, else from differences of Jacobian matrices.
    """

    linear: NDArray[np.float64]
    quadratic: NDArray[np.float64]
    cubic: NDArray[np.float64]
    exact: bool


def multilinear_forms(
    point_map: PointMap, points: NDArray[np.float64], periods: int, sizes: NDArray[np.float64], once: bool = False
) -> MultilinearForms:
    """Return the derivatives of P^periods at points (n, D) by the first d state variables, of sizes (d,), with d <= D.

    The higher variational equations are integrated where the formulas of the right-hand side are known; with `once`
    there is no second evaluation of them.  A form follows from its values in as many directions as it has coefficients.
    """
    exact = point_map.without_table
    step = None if exact.spec is None else exact.spec.curve_step(_ORDER)
    if step is None:
        return _from_differences(exact, points, periods, sizes)
    d, (n, states) = len(sizes), points.shape
    indices = list(combinations_with_replacement(range(d), _ORDER))
    directions = np.array([_direction(index, d) for index in indices])
    linear, quadratic, cubic = found = tuple[list[NDArray[np.float64]], ...]([[], [], []])
    # Curves so long that derivatives are no smaller than the absolute tolerance asks for.
    least = max(1.0, 1.0 / float(sizes.min()))
    for length in (least,) if once else (least, _LONGER * least):
        curves = np.zeros((n, len(indices), _ORDER + 1, states))
        curves[:, :, 0] = points[:, None]
        curves[:, :, 1, :d] = length * directions * sizes
        orbits = Orbits.starting(curves.reshape(-1, (_ORDER + 1) * states))
        for _ in range(periods):
            orbits.points[:, :states] = wrap(orbits.points[:, :states], exact.coordinates)
            advance_on_threads(lambda some, _: step(some), orbits, 1)
        images = orbits.points.reshape(curves.shape)[..., :d] / sizes
        for k, tensors in enumerate(found, 1):
            tensors.append(_tensors(images[:, :, k] / length**k, directions, k))
    return MultilinearForms(np.stack(linear), np.stack(quadratic), np.stack(cubic), exact=True)


def _direction(index: tuple[int, ...], d: int) -> NDArray[np.float64]:
    """Return e_i for (i, i, i), e_i + e_j and e_i - e_j for (i, i, j) and (i, j, j), and e_i + e_j + e_k."""
    direction = np.zeros(d)
    direction[list(index)] = 1.0
    if len(set(index)) == 2 and index[1] == index[2]:
        direction[index[1]] = -1.0
    return direction


def _tensors(values: NDArray[np.float64], directions: NDArray[np.float64], order: int) -> NDArray[np.float64]:
    """Return the symmetric tensors (n, d, d, ...) of forms from their values (n, m, d) in directions (m, d)."""
    d = directions.shape[1]
    indices = list(combinations_with_replacement(range(d), order))
    weights = [factorial(order) // prod(factorial(index.count(i)) for i in set(index)) for index in indices]
    design = np.prod(directions[:, indices], axis=-1) * weights
    coefficients = np.einsum("cm,nmi->nic", np.linalg.pinv(design), values)
    tensor = np.empty((*(d,) * order, *values.shape[::2]))
    for c, index in enumerate(indices):
        for place in permutations(index):
            tensor[place] = coefficients[..., c]
    return np.moveaxis(tensor, (-2, -1), (0, 1))


def _from_differences(
    exact: PointMap, points: NDArray[np.float64], periods: int, sizes: NDArray[np.float64]
) -> MultilinearForms:
    """Return derivatives from central differences of Jacobian matrices at three distances, extrapolated."""
    d, n = len(sizes), len(points)
    pairs = list(combinations_with_replacement(range(d), 2))
    offsets = np.zeros((len(pairs), points.shape[1]))
    for k, pair in enumerate(pairs):
        offsets[k, list(pair)] = sizes[list(pair)]

    def matrices(places: NDArray[np.float64]) -> NDArray[np.float64]:
        found = tangent(exact, places, periods)[1][..., :d, :d]
        return np.asarray(found * sizes / sizes[:, None])

    middle = matrices(points)
    slopes, curvatures = [], []
    for distance in _DISTANCES:
        ahead, back = (matrices(points[:, None] + sign * distance * offsets) for sign in (1.0, -1.0))
        slopes.append((ahead - back) / (2.0 * distance))
        curvatures.append((ahead - 2.0 * middle[:, None] + back) / distance**2)
    quadratic, cubic = np.empty((2, n, d, d, d)), np.empty((2, n, d, d, d, d))
    for which, (slope, curvature) in enumerate(zip(_extrapolated(slopes), _extrapolated(curvatures), strict=True)):
        single = [pairs.index((i, i)) for i in range(d)]
        for k, (i, j) in enumerate(pairs):
            if i == j:
                quadratic[which, ..., i] = slope[:, k]
            mixed = curvature[:, k] if i == j else curvature[:, k] - curvature[:, single[i]] - curvature[:, single[j]]
            cubic[which, ..., i, j] = cubic[which, ..., j, i] = mixed if i == j else 0.5 * mixed
    return MultilinearForms(np.stack([middle, middle]), quadratic, cubic, exact=False)


def _extrapolated(ladder: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """Return limits of differences at three distances, each half the one before: from all, and from the last two."""
    first, second = ((4.0 * fine - coarse) / 3.0 for coarse, fine in pairwise(ladder))
    return [(16.0 * second - first) / 15.0, second]
