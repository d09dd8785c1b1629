"""Bifurcation curves at the borders of families in an atlas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.threads import progress_bar
from ..maps.coordinates import difference
from ..maps.point_map import PointMap, follow
from ..orbits.newton import closed_orbit, newton
from .atlas_families import Attractors
from .bifurcation_curve import BifurcationCurve, continue_bifurcation
from .branch import Bifurcation, Branch
from .kinds import BifurcationKind
from .orbit_continuation import continue_orbit

_CLOSE = 1.5  # cells between a curve and a border that it explains
_BEYOND = 4  # cells beyond a border up to which an orbit is followed
_TRIES = 3  # borders of one family in turn from which no curve is found, after which its others are left
_STEP = 0.02  # step along curves, as a fraction of the window
_SAME = 1e-3  # distance, relative to the orbit, within which half of its period brings it back
_SMALLEST = 4  # parameter points of a family whose borders are looked at


@dataclass(frozen=True, eq=False)
class Borders:
    """Borders of families: parameter points, and neighbours of theirs at which an attractor does not go on.

    ``row`` (n,) is the attractor, ``family`` (n,) its family, ``axis`` (n,) the parameter that changes and ``side``
    (n,) the sign of the change; ``middle`` (n, 2) the point between, in units of the grid.
    """

    row: Ints
    family: Ints
    axis: Ints
    side: Ints
    middle: Floats


def borders_of(attractors: Attractors, links: tuple[Ints, Ints], family: Ints, shape: tuple[int, int]) -> Borders:
    """Return the borders of families of periodic orbits within the grid.

    A border is where an attractor is linked to none of a neighbouring point: around a cusp both attractors between
    the folds belong to one family, and which families are present says nothing.
    """
    ny, nx = shape
    periodic = attractors.period > 0
    periodic &= np.bincount(family, minlength=1)[family] >= _SMALLEST
    place = np.stack([attractors.place % nx, attractors.place // nx], axis=-1)
    parts = []
    for axis, side in ((0, -1), (0, 1), (1, -1), (1, 1)):
        last = (0, (nx, ny)[axis] - 1)[side > 0]
        goes_on = np.zeros(len(attractors), bool)
        goes_on[links[axis][(1, 0)[side > 0]]] = True
        rows = np.flatnonzero(periodic & (place[:, axis] != last) & ~goes_on)
        ones = np.ones(len(rows), np.int64)
        parts.append((rows, family[rows], axis * ones, side * ones, place[rows] + 0.5 * side * (np.arange(2) == axis)))
    return Borders(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def curves_at(
    exact: PointMap,
    names: tuple[str, str],
    axes: tuple[Floats, Floats],
    attractors: Attractors,
    borders: Borders,
    most: int,
    progress: str | None,
) -> tuple[tuple[BifurcationCurve, ...], Bools]:
    """Return bifurcation curves through borders, the longest border first, and which borders (n,) lie on them."""
    explained = np.zeros(len(borders.row), bool)
    tried = np.zeros(len(borders.row), bool)
    curves: list[BifurcationCurve] = []
    misses: dict[int, int] = {}
    with progress_bar(len(explained), progress) as tick:
        while len(curves) < most and not (explained | tried).all():
            left = np.flatnonzero(~(explained | tried))
            family = int(np.bincount(borders.family[left]).argmax())
            mine = left[borders.family[left] == family]
            border = mine[len(mine) // 2]
            tried[border] = True
            curve = _curve(exact, names, axes, attractors, borders, border)
            close = np.zeros(len(explained), bool) if curve is None else _beside(curve, names, axes, borders.middle)
            if curve is not None and (close & ~explained).any():
                curves.append(curve)
                tick(int(np.count_nonzero(close & ~explained)))
                explained |= close
                misses[family] = 0
            else:
                misses[family] = misses.get(family, 0) + 1
                if misses[family] == _TRIES:
                    tried[mine] = True
    return tuple(curves), explained


def _curve(
    exact: PointMap,
    names: tuple[str, str],
    axes: tuple[Floats, Floats],
    attractors: Attractors,
    borders: Borders,
    border: int,
) -> BifurcationCurve | None:
    """Return the curve of the bifurcation at which an orbit loses its stability or ends across a border."""
    row, axis, side = borders.row[border], int(borders.axis[border]), int(borders.side[border])
    nx = len(axes[0])
    place = attractors.place[row] % nx, attractors.place[row] // nx
    here = {name: float(a[k]) for name, a, k in zip(names, axes, place, strict=True)}
    along, name = axes[axis], names[axis]
    end = float(along[np.clip(place[axis] + side * _BEYOND, 0, len(along) - 1)])
    back = float(along[np.clip(place[axis] - side, 0, len(along) - 1)])
    point_map = exact.with_params(**here)
    try:
        branch = _branch(point_map, attractors.point[row], int(attractors.period[row]), name, (end, back))
        at = None if branch is None else _first(branch, here[name], side)
        if branch is None or at is None:
            return None
        branch, at = _of_parent(branch, at)
        other = axes[1 - axis]
        first, second = ((float(a[0]), float(a[-1])) for a in (along, other))
        curve = continue_bifurcation(branch, at, names[1 - axis], first, second, step=_STEP, max_points=400)
    except ValueError:
        return None
    return curve if len(curve.values) > 1 else None  # a pitchfork at one point of the plane is the cusp of two folds


def _branch(
    point_map: PointMap, point: Floats, period: int, parameter: str, ends: tuple[float, float]
) -> Branch | None:
    """Return the branch of the orbit next to a point between two values of a parameter; None where there is none."""
    extent = np.maximum(np.abs(point), 1.0)
    solution, settled = newton(point_map, point[None], np.array([period]), extent)
    if not settled[0]:
        return None
    orbit = closed_orbit(point_map, solution[0], period, extent)
    return continue_orbit(point_map, orbit, parameter, min(ends), max(ends), step=0.1, max_points=100)


def _first(branch: Branch, value: float, side: int) -> Bifurcation | None:
    """Return the bifurcation nearest to a value on one side of it at which the orbit gains or loses stability."""
    found = [
        b
        for b in branch.bifurcations
        if side * (b.value - value) >= 0.0
        and 0 in (b.before, b.after)
        and b.kind not in (BifurcationKind.TRANSCRITICAL, BifurcationKind.DEGENERATE)
    ]
    return min(found, key=lambda b: abs(b.value - value), default=None)


def _of_parent(branch: Branch, at: Bifurcation) -> tuple[Branch, Bifurcation]:
    """Return the period doubling, on the branch of its parent, at which an orbit of twice the period is born.

    On the branch of the doubled orbit it is a pitchfork of two steps.  Other bifurcations are returned as they are.
    """
    half = branch.period // 2
    if branch.period % 2 or at.kind is not BifurcationKind.PITCHFORK:
        return branch, at
    point_map = branch.point_map.with_params(**{branch.parameter: at.value})
    extent = np.maximum(np.abs(at.point), 1.0)
    apart = difference(follow(point_map, at.point, half).points, at.point, point_map.coordinates)
    if not (np.abs(apart) <= _SAME * extent).all():
        return branch, at
    reach = float(np.ptp(branch.values))
    parent = _branch(point_map, at.point, half, branch.parameter, (at.value - reach, at.value + reach))
    if parent is None:
        return branch, at
    doublings = parent.of_kind(BifurcationKind.PERIOD_DOUBLING)
    nearest = min(doublings, key=lambda b: abs(b.value - at.value), default=None)
    return (branch, at) if nearest is None else (parent, nearest)


def _beside(curve: BifurcationCurve, names: tuple[str, str], axes: tuple[Floats, Floats], middle: Floats) -> Bools:
    """Return which points (n, 2), in units of the grid, are close to a curve."""
    from scipy.spatial import cKDTree

    places = np.column_stack(
        [
            np.interp(curve.values[:, curve.parameters.index(name)], axis, np.arange(len(axis), dtype=float))
            for name, axis in zip(names, axes, strict=True)
        ]
    )
    pieces = np.diff(places, axis=0)
    fine = [places]
    for k in range(1, steps := int(np.ceil(np.abs(pieces).max(initial=0.0))) + 1):
        fine.append(places[:-1] + pieces * (k / steps))
    return np.asarray(cKDTree(np.concatenate(fine)).query(middle)[0] <= _CLOSE)
