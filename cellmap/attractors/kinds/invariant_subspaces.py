"""Invariant subspaces, in which orbits stay: chaos in those that attract on average, and on both sides of others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints, evenly
from ..._lib.stopping import check_stop
from ...maps.coordinates import turns_of, wrap
from ...maps.orbit_batch import Orbits
from ...maps.paths import history_of, path_of
from ...maps.point_map import PointMap
from ...maps.tangent import tangent
from ...orbits.attractor import Attractor, InvariantSubspace, Kind, aperiodic
from ..regions.boxes import in_units, tree_of
from ..regions.covers import FLAT
from ..settling.labels import Label
from ..settling.settle import Catalogue, settle
from .clouds import Clouds

_TRIED = 32  # points whose images show that a subspace is invariant,
_MOST, _EXACT = 0.9, 1e-9  # most of them to this part of the extent
_THIN = 1e-4  # part of an orbit's size within which it is seen to stay beside a subspace, before the map is asked
_FRACTIONS = 12  # a formula's subspace has multiples of 1/12 in its normals
_BLOCK = 64  # periods, over which growth is taken to be independent of that before
_BESIDE = 1e-3, 1e-2, 1e-1  # of the extent, distances from where it is seen whether orbits go elsewhere
_LEAVING = 1e-3  # probability that an orbit that counts as converged comes out again
_DEEPEST = 1e-3  # of the extent, at which growth is surely that of small displacements


def invariant_planes(point_map: PointMap, points: Floats, extent: Floats) -> Ints:
    """Return the coordinates k for which x_k = 0 is an invariant plane with points on both sides.

    That is so where images of points (n, dimension) with a zero in place of x_k have an exact zero there, or rounding
    that is none beside the `extent`.
    """
    still = turns_of(point_map.coordinates)[1] == 0
    both = np.flatnonzero(still & (points > 0.0).any(axis=0) & (points < 0.0).any(axis=0))
    some, exact = points[evenly(len(points), _TRIED)], point_map.without_table
    found = []
    for k in both.tolist():
        orbits = Orbits.starting(some.copy())
        orbits.points[:, k] = 0.0
        exact.advance(orbits, 1)
        images = orbits.points[orbits.alive, k]
        if len(images) and (np.abs(images) <= np.finfo(float).eps * extent[k]).all():
            found.append(k)
    return np.array(found, np.int64)


def attractors_in_subspaces(
    point_map: PointMap,
    points: Floats,
    exponents: Floats,
    extent: Floats,
    known: Sequence[Attractor],
    images: float,
    age: int,
) -> tuple[list[Attractor], Ints, Bools, list[InvariantSubspace]]:
    """Return chaotic attractors in invariant subspaces that attract on average, who is on which, and who is beside one.

    ``points``, ``exponents`` (n, dimension): of chaotic orbits.  Displacements from the subspace grow along an orbit in
    it by random factors, whose logarithms have a negative mean: almost all orbits beside it come to it, but some go
    away from any distance, and where they come to another attractor the basin is riddled (Milnor 1985; Alexander and
    others 1992).  An orbit at a distance y goes away with a probability near y^eta, where growth to the power eta has
    the mean 1 (Ott and others 1994); it counts as converged where that is below 1e-3.  The numbers of the known
    attractors are before those of the new ones.  Orbits beside a subspace that repels are on no attractor either.  All
    these subspaces are returned as well, for :func:`hold`; those that repel have a positive exponent.
    """
    exact, turn = point_map.without_table, turns_of(point_map.coordinates)[1]
    coming, found = np.zeros(len(points), bool), list[Attractor]()
    inside = [(a, a.subspace) for a in known if a.subspace is not None and not a.subspace.is_neutral]
    met = [replace(subspace, exponent=0.0) for _, subspace in inside]
    history, rotations = history_of(exact, Orbits.starting(points.copy()), 4 * _BLOCK)
    for subspace in _subspaces(exact, history + rotations * turn, extent):
        mine = np.flatnonzero(_beside(subspace, history, exact).all(axis=0) & ~coming)
        if not len(mine):
            continue
        if any((subspace.distances(a.points, exact.coordinates) <= _EXACT).all() for a, _ in inside):
            coming[mine] = True
            continue
        mean, error, variance = _growth(exact, subspace, points[mine], images)
        if abs(mean) <= _EXACT or mean == -inf:
            continue
        depth = float(_LEAVING ** (variance / (-2.0 * mean))) if mean < -5.0 * error else 0.0
        repels = mean > 5.0 * error
        if depth >= _DEEPEST or not (repels or _some_go_elsewhere(point_map, subspace, points[mine], known, age)):
            continue  # an attractor like others
        coming[mine] = True
        met.append(replace(subspace, exponent=mean) if repels else subspace)
        if not depth:
            continue
        attracting = replace(subspace, depth=depth, exponent=mean)
        samples = subspace.projected(history[:, mine], exact.coordinates).swapaxes(0, 1)
        group = Clouds(point_map, list(samples), np.maximum(np.ptp(samples, axis=(0, 1)), FLAT * extent)).group
        for g in range(int(group.max()) + 1):
            spectrum = -np.sort(-exponents[mine[group == g]].mean(axis=0))
            sample = samples[group == g].reshape(-1, exact.dimension)
            found.append(aperiodic(Kind.CHAOTIC, sample, spectrum, exact.coordinates, subspace=attracting))
    return found, owners_in_subspaces(point_map, points, [*known, *found]), coming, met


def _some_go_elsewhere(
    point_map: PointMap, subspace: InvariantSubspace, points: Floats, known: Sequence[Attractor], periods: int
) -> bool:
    """Tell whether any orbit from beside a subspace comes to an end or to an attractor that is not near to it."""
    steps = np.concatenate([sign * step * np.diag(subspace.sizes) for step in _BESIDE for sign in (-1.0, 1.0)])
    begins = np.repeat(subspace.projected(points, point_map.coordinates)[None], len(steps), axis=0)
    begins[..., subspace.pivots] += steps[:, None]
    others = [a for a in known if not _beside(subspace, a.points, point_map).any()]
    orbits = Orbits.starting(wrap(begins.reshape(-1, point_map.dimension), point_map.coordinates))
    return bool((settle(point_map, orbits, Catalogue.of(others, point_map), periods).labels != Label.UNDECIDED).any())


def hold(subspaces: Sequence[InvariantSubspace], points: Floats, point_map: PointMap) -> bool:
    """Tell whether a set of some points is no attractor beside one of some subspaces.

    It is none if it comes near to a subspace that is not seen to repel, nor if it stays so near to one that repels that
    it grows away from there.
    """
    for subspace in subspaces:
        apart = subspace.distances(points, point_map.coordinates)
        if apart.max() <= _DEEPEST if subspace.exponent > 0.0 else apart.min() <= _THIN:
            return True
    return False


def _beside(subspace: InvariantSubspace, points: Floats, point_map: PointMap) -> Bools:
    return np.asarray(subspace.distances(points, point_map.coordinates) <= _THIN)


def owners_in_subspaces(point_map: PointMap, points: Floats, attractors: Sequence[Attractor]) -> Ints:
    """Return on which attractors in invariant subspaces orbits from some points are, -1 for none.

    Of several in one subspace it is the one with the nearest sample.  Orbits are followed for 64 periods: rounding
    takes those in a subspace out of it now and then, if that is oblique.
    """
    owners, nearest = np.full(len(points), -1), np.full(len(points), np.inf)
    if not len(points) or all(a.subspace is None for a in attractors):
        return owners
    path = path_of(point_map, Orbits.starting(points.copy()), _BLOCK)
    for k, attractor in enumerate(attractors):
        if (subspace := attractor.subspace) is None or subspace.is_neutral:
            continue
        near = subspace.distances(path, point_map.coordinates) <= subspace.depth
        rows = np.flatnonzero(near.any(axis=0))
        size = np.maximum(np.ptp(attractor.points, axis=0), subspace.sizes.min())
        there = in_units(path[near[:, rows].argmax(axis=0), rows], size, point_map)
        far = tree_of(attractor.points, size, point_map).query(there)[0]
        closer = far < nearest[rows]
        owners[rows[closer]], nearest[rows[closer]] = k, far[closer]
    return owners


def neutral_family(point_map: PointMap, history: Floats, extent: Floats) -> tuple[Bools, InvariantSubspace | None]:
    """Tell which of some chaotic orbits (periods, n, d) are in parallel subspaces of a neutral family, and give one.

    Displacements from such a subspace neither grow nor shrink, as where a coordinate keeps its value, so that there is
    a continuum of chaotic sets beside one another.
    """
    exact, mine, one = point_map.without_table, np.zeros(history.shape[1], bool), None
    for subspace in _subspaces(exact, history, extent):
        if one is not None and not subspace.is_parallel(one):
            continue
        beside = _beside(subspace, history, exact).all(axis=0)
        if one is None:
            if not beside.any():  # the path from which it was guessed stays near to it, and farther off than this
                continue
            mean, _, variance = _growth(exact, subspace, history[-1, beside], 0.0)
            if abs(mean) > _EXACT or variance > _EXACT**2:
                continue
            one = replace(subspace, depth=inf)
        mine |= beside
    return mine, one


def _subspaces(exact: PointMap, lifted: Floats, extent: Floats) -> Iterator[InvariantSubspace]:
    """Yield the invariant subspaces beside which orbits (periods, n, d) stay, each once; the thinnest orbits first."""
    paths = lifted.swapaxes(0, 1) / extent
    alive = np.flatnonzero(np.isfinite(paths).all(axis=(1, 2)))
    centred = paths[alive] - paths[alive].mean(axis=1, keepdims=True)
    _, sizes, axes = np.linalg.svd(centred, full_matrices=False)
    thin = sizes <= _THIN * sizes[:, :1]
    found = list[InvariantSubspace]()
    for k in np.argsort(np.where(thin, sizes / sizes[:, :1], 1.0).min(axis=1), kind="stable"):
        if not thin[k].any() or thin[k, 0]:
            continue
        path = lifted[:, alive[k]]
        if any(_beside(s, path, exact).all() for s in found):
            continue
        guesses = _guesses(path, axes[k][thin[k]] / extent, extent)
        if (subspace := next((s for s in guesses if _is_invariant(exact, s, path)), None)) is not None:
            found.append(subspace)
            yield subspace


def _guesses(path: Floats, normals: Floats, extent: Floats) -> Iterator[InvariantSubspace]:
    """Yield subspaces with some normals (k, d) beside a path: first those that have round numbers."""
    reduced, pivots = _reduced(normals, extent)
    fractions = np.round(_FRACTIONS * reduced) / _FRACTIONS
    for some in (np.where(np.abs(reduced - fractions) <= _THIN, fractions, reduced), reduced):
        middle = (path @ some.T).mean(axis=0)
        for offsets in (np.where(np.abs(middle) <= _THIN * extent[pivots], 0.0, middle), path[-1] @ some.T):
            yield InvariantSubspace(some, offsets, extent[pivots])


def _reduced(normals: Floats, extent: Floats) -> tuple[Floats, Ints]:
    """Return the reduced echelon form of normals (k, d), and the coordinates along which each is 1 and others 0."""
    found, pivots = normals.copy(), np.zeros(len(normals), np.int64)
    for row in range(len(found)):
        weight = np.abs(found[row]) * extent
        pivots[row] = np.flatnonzero(weight >= 0.999 * weight.max())[-1]  # of equal ones the last, whatever rounding is
        found[row] /= found[row, pivots[row]]
        for other in range(len(found)):
            if other != row:
                found[other] -= found[other, pivots[row]] * found[row]
    order = np.argsort(pivots)
    return found[order], pivots[order]


def _is_invariant(exact: PointMap, subspace: InvariantSubspace, path: Floats) -> bool:
    places = wrap(path[evenly(len(path), _TRIED)], exact.coordinates)
    orbits = Orbits.starting(subspace.projected(places, exact.coordinates))
    exact.advance(orbits, 1)
    apart = subspace.distances(orbits.points[orbits.alive], exact.coordinates)
    return len(apart) > 0 and bool(np.quantile(apart, _MOST) <= _EXACT)


def _growth(exact: PointMap, subspace: InvariantSubspace, points: Floats, images: float) -> tuple[float, float, float]:
    """Return the mean growth of displacements from a subspace along orbits in it, its error, and variance per period.

    Orbits are followed for twice as long again and again until the sign is known by five errors, or images have been
    used up.
    """
    places = subspace.projected(points, exact.coordinates)
    frames = np.tile(np.eye(len(subspace.normals)), (len(points), 1, 1))
    sums, wanted = list[Floats](), 4
    while True:
        while len(sums) < wanted:
            check_stop()
            total = np.zeros(len(places))
            for _ in range(_BLOCK):
                moved, matrices = tangent(exact, places, coarse=True)
                places = subspace.projected(wrap(moved, exact.coordinates), exact.coordinates)
                frames, upper = np.linalg.qr(subspace.normal_part(matrices) @ frames)
                with np.errstate(divide="ignore"):
                    total += np.log(np.abs(upper[:, 0, 0]))
            sums.append(total)
        growth = np.array(sums)[1:]  # the first one aligns frames with the direction of largest growth
        with np.errstate(invalid="ignore"):  # a vanishing derivative has an infinite logarithm
            mean, variance = float(growth.mean()) / _BLOCK, float(growth.var()) / _BLOCK
        error = np.sqrt(variance / (_BLOCK * growth.size))
        cost = wanted * _BLOCK * max(len(places), _TRIED)  # few orbits take as long as some
        if abs(mean) >= 5.0 * error or cost > images or not np.isfinite(mean):
            return mean, float(error), variance
        images, wanted = images - cost, 2 * wanted
