"""Higher derivatives of point maps: the multilinear forms of their Taylor series."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations_with_replacement, pairwise, permutations, product
from math import factorial, prod

import numpy as np

from .._lib.arrays import Floats
from .coordinates import wrap
from .orbit_batch import Orbits
from .point_map import PointMap
from .side_by_side import advance_on_threads
from .tangent import tangent

_LONGER = 1.7  # factor between the curves of two evaluations
_SIGNS = 3  # components of directions with either sign
_DISTANCES = 0.04, 0.034  # longest distances between Jacobian matrices whose differences are taken, in natural sizes
_NEARER = 0.25 ** np.arange(6)  # parts of these distances, for maps that are smooth on less, as beside grazing
_ALIKE = 1e-6  # difference of two ways, relative to a form, from which shorter distances are tried


@dataclass(frozen=True, eq=False)
class MultilinearForms:
    """Taylor series x + h -> P(x) + A h + B(h, h)/2 + C(h, h, h)/6 + ... of a map, in units of natural sizes.

    ``tensors[k - 1]`` (2, n, d, d, ...) has the derivatives of order k, computed in two ways of equal right along the
    first axis, so that their difference shows the error.  With `exact` they come from integrated higher variational
    equations, else from differences of Jacobian matrices, and are known to the third order.
    """

    tensors: tuple[Floats, ...]
    exact: bool

    @property
    def linear(self) -> Floats:
        """First derivatives A (2, n, d, d)."""
        return self.tensors[0]

    def at(self, way: int, number: int) -> tuple[Floats, ...]:
        """Return the derivatives A, B, C, ... at one of the points, computed in one of the ways."""
        return tuple(t[way, number] for t in self.tensors)


def multilinear_forms(
    point_map: PointMap,
    points: Floats,
    periods: int,
    sizes: Floats,
    once: bool = False,
    order: int = 3,
    part: tuple[int, int] = (0, 1),
) -> MultilinearForms:
    """Return the derivatives of P^periods at points (n, D) by the first d state variables, of sizes (d,), with d <= D.

    Or those of one `part` of a step of the map, given by its number and that of all parts.

    The higher variational equations are integrated where the formulas of the right-hand side are known; with `once`
    there is no second evaluation of them.  A form follows from its values in as many directions as it has coefficients.
    """
    exact = point_map.without_table
    ways = (False,) if once else (False, True)
    steps = [] if exact.spec is None else [exact.spec.curve_step(order, finer, part) for finer in ways]
    if not steps or None in steps:
        parts = exact.specified.parts(part[1]) if part[1] > 1 else None
        return _from_differences(parts[part[0]] if parts else lambda x: tangent(exact, x, periods), points, sizes)
    d, (n, states) = len(sizes), points.shape
    directions = directions_for(d, order)
    found = tuple[list[Floats], ...]([] for _ in range(order))
    # Curves so long that derivatives are no smaller than the absolute tolerance asks for.
    least = max(1.0, 1.0 / float(sizes.min()))
    for step, length in zip(filter(None, steps), (least, _LONGER * least), strict=False):
        curves = np.zeros((n, len(directions), order + 1, states))
        curves[:, :, 0] = points[:, None]
        curves[:, :, 1, :d] = length * directions * sizes
        orbits = Orbits.starting(curves.reshape(-1, (order + 1) * states))
        for _ in range(periods):
            orbits.points[:, :states] = wrap(orbits.points[:, :states], exact.coordinates)
            advance_on_threads(lambda some, _, step=step: step(some), orbits, 1)  # type: ignore[misc]
        images = orbits.points.reshape(curves.shape)[..., :d] / sizes
        for k, tensors in enumerate(found, 1):
            tensors.append(_tensors(images[:, :, k] / length**k, directions, k))
    return MultilinearForms(tuple(map(np.stack, found)), exact=True)


@functools.cache
def directions_for(d: int, order: int) -> Floats:
    """Return directions (m, d), as many as a form of an order has coefficients, which its values there determine."""
    from scipy.linalg import qr

    indices = list(combinations_with_replacement(range(d), order))
    # Of lattice vectors with some signs those at which the values of a form are best conditioned, by pivoting.
    signs = [np.append(1.0, np.resize(some, d - 1)) for some in product((1.0, -1.0), repeat=min(d - 1, _SIGNS))]
    lattice = np.array([[index.count(i) for i in range(d)] for index in indices])
    some = np.concatenate([lattice * sign for sign in signs])
    some /= np.linalg.norm(some, axis=1)[:, None]
    chosen = qr(_design(some, order).T, mode="r", pivoting=True)[1][: len(indices)]
    return np.asarray(some[np.sort(chosen)])


def _tensors(values: Floats, directions: Floats, order: int) -> Floats:
    """Return the symmetric tensors (n, d, d, ...) of forms from their values (n, m, d) in directions (m, d)."""
    d = directions.shape[1]
    coefficients = np.einsum("cm,nmi->nic", np.linalg.pinv(_design(directions, order)), values)
    tensor = np.empty((*(d,) * order, *values.shape[::2]))
    for c, index in enumerate(combinations_with_replacement(range(d), order)):
        for place in permutations(index):
            tensor[place] = coefficients[..., c]
    return np.moveaxis(tensor, (-2, -1), (0, 1))


def _design(directions: Floats, order: int) -> Floats:
    """Return the matrix (m, c) from the c coefficients of a form of an order to its values in directions (m, d)."""
    indices = list(combinations_with_replacement(range(directions.shape[1]), order))
    weights = [factorial(order) // prod(factorial(index.count(i)) for i in set(index)) for index in indices]
    return np.asarray(np.prod(directions[:, indices], axis=-1) * weights)


def _from_differences(
    tangent_map: Callable[[Floats], tuple[Floats, Floats]], points: Floats, sizes: Floats
) -> MultilinearForms:
    """Return derivatives from differences of Jacobian matrices, at distances at which two ways agree best."""
    best, least = list[Floats](), np.full(3, np.inf)
    for part in _NEARER:
        found = _differences(tangent_map, points, sizes, part)
        errors = np.array([np.nan_to_num(np.abs(np.diff(t, axis=0)).max(), nan=np.inf) for t in found])
        best = [t if closer else old for t, closer, old in zip(found, errors < least, best or found, strict=True)]
        least = np.minimum(least, errors)
        if all(e <= _ALIKE * np.abs(t).max() for t, e in zip(best, least, strict=True)):
            break
    return MultilinearForms(tuple(best), exact=False)


def _differences(
    tangent_map: Callable[[Floats], tuple[Floats, Floats]], points: Floats, sizes: Floats, part: float
) -> tuple[Floats, Floats, Floats]:
    """Return derivatives from central differences of Jacobian matrices at three distances, extrapolated."""
    d, n = len(sizes), len(points)
    pairs = list(combinations_with_replacement(range(d), 2))
    offsets = np.zeros((len(pairs), points.shape[1]))
    for k, pair in enumerate(pairs):
        offsets[k, list(pair)] = sizes[list(pair)]

    def matrices(places: Floats) -> Floats:
        found = tangent_map(places)[1][..., :d, :d]
        return np.asarray(found * sizes / sizes[:, None])

    middle = matrices(points)
    linear, quadratic, cubic = np.empty((2, n, d, d)), np.empty((2, n, d, d, d)), np.empty((2, n, d, d, d, d))
    single = [pairs.index((i, i)) for i in range(d)]
    for which, longest in enumerate(part * np.array(_DISTANCES)):
        means, slopes, curvatures = [], [], []
        for distance in (longest, longest / 2.0, longest / 4.0):
            ahead, back = (matrices(points[:, None] + sign * distance * offsets) for sign in (1.0, -1.0))
            means.append((ahead + back) / 2.0)
            slopes.append((ahead - back) / (2.0 * distance))
            curvatures.append((ahead - 2.0 * middle[:, None] + back) / distance**2)
        slope, curvature = _extrapolated(slopes), _extrapolated(curvatures)
        linear[which] = _extrapolated(means).mean(axis=1) if which else middle
        for k, (i, j) in enumerate(pairs):
            if i == j:
                quadratic[which, ..., i] = slope[:, k]
            mixed = curvature[:, k] if i == j else curvature[:, k] - curvature[:, single[i]] - curvature[:, single[j]]
            cubic[which, ..., i, j] = cubic[which, ..., j, i] = mixed if i == j else 0.5 * mixed
    return linear, quadratic, cubic


def _extrapolated(ladder: list[Floats]) -> Floats:
    """Return the limit of differences at three distances, each half the one before."""
    first, second = ((4.0 * fine - coarse) / 3.0 for coarse, fine in pairwise(ladder))
    return np.asarray((16.0 * second - first) / 15.0)
