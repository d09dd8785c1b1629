"""Crossings of the unit circle by multipliers, on lines through parameter space, and curves through them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import IntEnum
from itertools import combinations
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Bools, Floats, Ints
from .._lib.roots import extrema, zeros
from ..maps.orbit_batch import Status
from ..orbits.multipliers import MARGIN, multipliers_of, pairs_beside_one, unstable_count

_DIP = 0.3  # an extremum that a parabola puts this near to zero, relative to the values around, is looked into
_BESIDE = 0.25  # distance at which both sides of a crossing are looked at, in steps of the scan
_REAL = 1e-5  # imaginary part of a double multiplier that rounding explains
_AT_NODE = 1e-6  # distance from a point of the scan, in steps, at which a zero belongs to both sides
_KEPT = 1e-9  # distance of a determinant from 1 that rounding explains
_LEAVING = 3  # test function: the largest modulus against 1


class Crossing(IntEnum):
    """Ways in which a multiplier crosses the unit circle."""

    PLUS_ONE = 0
    """Through +1: det(M - I) = 0, a fold or pitchfork."""
    MINUS_ONE = 1
    """Through -1: det(M + I) = 0, a period doubling."""
    NEIMARK_SACKER = 2
    """As a complex pair (Neimark-Sacker); without damping two pairs collide on the circle (Krein)."""


@dataclass(frozen=True, eq=False)
class Matrices:
    """Monodromy matrices (n, d, d), their determinants (n), the same less 1 (n), and statuses (n).

    A determinant may be far smaller, and its distance from 1 known far better, than the entries of a matrix tell.
    """

    matrices: Floats
    determinants: Floats
    excess: Floats
    status: NDArray[np.uint8]


class MultiplierSource(Protocol):
    """Source of the monodromy matrices as functions of parameters."""

    def matrices(self, points: Floats, progress: str | None = None) -> Matrices:
        """Return the matrices at parameter points (n, m)."""


@dataclass(frozen=True, eq=False)
class Seen:
    """Test functions (n, 4) at parameter points, with what else is known there (n).

    ``crossing`` is how the multiplier that is nearest to the unit circle would cross it, ``conservative`` whether the
    map is volume-preserving there.
    """

    tests: Floats
    largest: Floats
    unstable: Ints
    status: NDArray[np.uint8]
    crossing: Ints
    conservative: Bools

    def turned(self, shape: tuple[int, int]) -> Seen:
        """Return the points of a grid column by column instead of row by row."""
        order = np.arange(len(self.tests)).reshape(shape).T.ravel()
        return Seen(*(getattr(self, f.name)[order] for f in fields(self)))


@dataclass(frozen=True, eq=False)
class CrossingFunctions:
    """Test functions of a linearised system, one column for each crossing and one for the largest modulus."""

    source: MultiplierSource

    def __call__(self, points: Floats, progress: str | None = None) -> Seen:
        """Return the test functions at parameter points (n, m)."""
        seen = self.source.matrices(points, progress)
        matrices, excess = seen.matrices, seen.excess
        d = matrices.shape[-1]
        found = multipliers_of(matrices, seen.determinants)
        tests = np.empty((len(points), 4))
        if d == 2:
            # Of a matrix near to I the entries know more than its trace and determinant.
            (a, b), (c, e) = np.moveaxis(matrices, 0, -1)
            tests[:, Crossing.PLUS_ONE] = (a - 1.0) * (e - 1.0) - b * c
            tests[:, Crossing.MINUS_ONE] = (a + 1.0) * (e + 1.0) - b * c
            tests[:, Crossing.NEIMARK_SACKER] = excess
        else:
            known = np.asarray(np.isfinite(matrices).all(axis=(-2, -1)))[:, None, None]
            for which, sign in ((Crossing.PLUS_ONE, -1.0), (Crossing.MINUS_ONE, 1.0)):
                tests[:, which] = np.linalg.det(np.where(known, matrices, 0.0) + sign * np.eye(d))
            tests[:, Crossing.NEIMARK_SACKER] = pairs_beside_one(found)
        with np.errstate(divide="ignore"):
            tests[:, _LEAVING] = np.log(np.abs(found[:, 0])) - MARGIN
        distance = np.where(np.isnan(found[:, :1]), 0.0, np.abs(np.abs(found) - 1.0))
        nearest = np.take_along_axis(found, np.argmin(distance, axis=1)[:, None], axis=1)[:, 0]
        real = np.where(nearest.real > 0.0, Crossing.PLUS_ONE, Crossing.MINUS_ONE)
        crossing = np.where(np.abs(nearest.imag) > _REAL, Crossing.NEIMARK_SACKER, real)
        return Seen(tests, np.abs(found[:, 0]), unstable_count(found), seen.status, crossing, np.abs(excess) < _KEPT)


@dataclass(frozen=True, eq=False)
class CriticalValues:
    """Critical values on lines of a scan, sorted by line and value; all arrays of shape (n,)."""

    lines: Ints
    values: Floats
    crossing: Ints
    below: Ints
    above: Ints


def crossings_on_lines(
    tests: CrossingFunctions, others: Floats, place: int, scan: Floats, seen: Seen, every: bool, progress: str | None
) -> CriticalValues:
    """Refine the critical values on all lines of a scan together.

    `others` (lines, m - 1) are the parameters that are constant on a line, `place` is that of the scanned one among
    all, and `seen` are the test functions line by line.
    """
    lines, count = len(others), len(scan)
    functions = np.where((seen.status >= Status.ESCAPED)[:, None], np.nan, seen.tests).reshape(lines, count, 4)
    # Without damping the product of multipliers is 1 everywhere, but for rounding.
    kept = seen.conservative.reshape(lines, count)
    beside = np.pad(kept, ((0, 0), (1, 1)))
    functions[kept & (beside[:, 2:] | beside[:, :-2]), Crossing.NEIMARK_SACKER] = 1.0
    unstable = seen.unstable.reshape(lines, count)

    def at(line: Ints, value: Floats) -> Seen:
        return tests(np.insert(others[line], place, value, axis=1), progress)

    def function(line: Ints, which: Ints) -> Callable[..., Floats]:
        return lambda part, value: at(line[part], value).tests[np.arange(len(value)), which[part]]

    # Zeros between neighbours, and pairs of zeros around an extremum between three.
    signs = np.where(functions < 0.0, -1, 1)
    known = np.isfinite(functions)
    changed = (signs[:, 1:] != signs[:, :-1]) & known[:, 1:] & known[:, :-1]
    changed[:, :, _LEAVING] = False
    line, step, which = np.nonzero(changed)
    ends = [scan[step], scan[step + 1], functions[line, step, which], functions[line, step + 1, which]]
    dips = _dips(functions)
    if len(dips[0]):
        dip_line, middle, dip_which = dips
        sides = [scan[middle - 1], scan[middle], scan[middle + 1]]
        height = [functions[dip_line, middle + k, dip_which] for k in (-1, 0, 1)]
        turn, value = extrema(function(dip_line, dip_which), sides, height)
        through = np.flatnonzero((value < 0.0) != (height[1] < 0.0))
        for side, outer in ((sides[0], height[0]), (sides[2], height[2])):
            line, which = np.append(line, dip_line[through]), np.append(which, dip_which[through])
            step = np.append(step, np.searchsorted(scan, turn[through], side="right") - 1)
            fresh = (side[through], turn[through], outer[through], value[through])
            ends = [np.append(e, f) for e, f in zip(ends, fresh, strict=True)]
    roots = zeros(function(line, which), *ends)

    # A change of stability without a zero of its own: zeros of even order, and pairs that collide on the circle.
    jumps = (unstable[:, 1:] > 0) != (unstable[:, :-1] > 0)
    jumps &= (unstable[:, 1:] >= 0) & (unstable[:, :-1] >= 0)
    if len(roots):
        # A zero at a point of the scan changes the number on either side of it.
        for beyond in (-_AT_NODE, _AT_NODE):
            jumps[line, _cells(scan, roots + beyond * (scan[1] - scan[0]))] = False
    jump_line, jump_step = np.nonzero(jumps)
    if len(jump_line):
        modulus = np.full(len(jump_line), _LEAVING)
        sides = [functions[jump_line, jump_step + k, _LEAVING] for k in (0, 1)]
        edges = (scan[jump_step], scan[jump_step + 1])
        found = zeros(function(jump_line, modulus), *edges, *sides)
        line, roots = np.append(line, jump_line), np.append(roots, found)
        which = np.append(which, np.full(len(found), Crossing.NEIMARK_SACKER))

    # The product of two real multipliers is 1 as well where both cross together.
    pairs = np.flatnonzero(which == Crossing.NEIMARK_SACKER)
    if len(pairs):
        which[pairs] = at(line[pairs], roots[pairs]).crossing

    order = np.lexsort((which, roots, line))
    line, roots, which = line[order], roots[order], which[order]
    below, above = _beside(at, line, roots, scan)
    kept = (below != above) if every else ((below > 0) != (above > 0))
    kept &= (below >= 0) & (above >= 0)
    return CriticalValues(line[kept], roots[kept], which[kept], below[kept], above[kept])


def _cells(scan: Floats, values: Floats) -> Ints:
    return np.clip(np.searchsorted(scan, values, side="right") - 1, 0, len(scan) - 2)


def _beside(at: Callable[..., Seen], line: Ints, roots: Floats, scan: Floats) -> tuple[Ints, Ints]:
    """Return the numbers of unstable multipliers just below and above critical values, sorted by line."""
    if not len(roots):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    cell = _cells(scan, roots)
    reach = _BESIDE * (scan[cell + 1] - scan[cell])
    gap = np.where(np.diff(line) == 0, 0.5 * np.diff(roots), np.inf)
    down = np.minimum(np.minimum(reach, np.append(np.inf, gap)), roots - scan[0])
    up = np.minimum(np.minimum(reach, np.append(gap, np.inf)), scan[-1] - roots)
    both = at(np.append(line, line), np.append(roots - down, roots + up)).unstable
    return both[: len(roots)], both[len(roots) :]


def _dips(functions: Floats) -> tuple[Ints, Ints, Ints]:
    """Return where a test function of one sign comes near to zero between three neighbours: line, middle, which."""
    with np.errstate(all="ignore"):
        left, middle, right = (functions[:, k : functions.shape[1] - 2 + k] for k in range(3))
        sign = np.where(middle < 0.0, -1.0, 1.0)
        left, middle, right = left * sign, middle * sign, right * sign
        curvature = left - 2.0 * middle + right
        lowest = middle - (right - left) ** 2 / (8.0 * curvature)
        dips = (left >= middle) & (right >= middle) & (curvature > 0.0) & (lowest < _DIP * np.minimum(left, right))
    dips[:, :, _LEAVING] = False
    line, first, which = np.nonzero(dips)
    return line, first + 1, which


@dataclass(frozen=True, eq=False)
class BoundaryCurve:
    """Piece of a stability boundary in the plane of two parameters.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Points in order, in the units of the parameters; a closed curve ends with its first point.
    crossing : Crossing
        Way in which multipliers cross the unit circle.
    """

    x: Floats
    y: Floats
    crossing: Crossing

    def __len__(self) -> int:
        return len(self.x)

    def __repr__(self) -> str:
        return f"BoundaryCurve({self.crossing.name}, {len(self)} points)"


def linked(
    x: Floats, y: Floats, on_rows: tuple[Floats, Floats, Ints], on_columns: tuple[Floats, Floats, Ints]
) -> tuple[BoundaryCurve, ...]:
    """Link points on the rows and on the columns of a grid, each given as x, y and crossing, to curves.

    Within a cell the points on its edges are linked in pairs of one crossing, the nearest ones first.
    """
    px, py, kinds = (np.concatenate([a, b]) for a, b in zip(on_rows, on_columns, strict=True))
    rows = np.arange(len(px)) < len(on_rows[0])
    members: dict[tuple[int, int], list[int]] = defaultdict(list)
    left, bottom = (np.searchsorted(axis, p, side="right") - 1 for axis, p in ((x, px), (y, py)))
    for k, (i, j) in enumerate(zip(left.tolist(), bottom.tolist(), strict=True)):
        # A point on a row is on the edge of the cells above and below it, one on a column of those beside it.
        for cell in ((i, j), (i, j - 1)) if rows[k] else ((i, j), (i - 1, j)):
            members[cell].append(k)
    scale = np.array([np.ptp(x), np.ptp(y)])
    places = np.stack([px, py], axis=-1) / scale
    neighbours: dict[int, list[int]] = defaultdict(list)
    for cell in sorted(members):
        free = set(members[cell])
        pairs = [(a, b) for a, b in combinations(members[cell], 2) if kinds[a] == kinds[b]]
        for a, b in sorted(pairs, key=lambda ab: float(np.linalg.norm(places[ab[0]] - places[ab[1]]))):
            if a in free and b in free:
                free -= {a, b}
                neighbours[a].append(b)
                neighbours[b].append(a)
    return tuple(
        BoundaryCurve(px[chain], py[chain], Crossing(int(kinds[chain[0]]))) for chain in _chains(len(px), neighbours)
    )


def _chains(count: int, neighbours: dict[int, list[int]]) -> list[list[int]]:
    """Return chains of linked points, open ones from their ends; a closed one ends with its first point."""
    seen: set[int] = set()
    chains = []
    for start in sorted(range(count), key=lambda k: len(set(neighbours[k])) > 1):
        if start in seen:
            continue
        chain, here = [start], start
        seen.add(start)
        while further := [n for n in neighbours[here] if n not in seen]:
            here = further[0]
            seen.add(here)
            chain.append(here)
        if len(chain) > 2 and start in neighbours[here]:
            chain.append(start)
        chains.append(chain)
    return chains
