"""Proofs checked by another program: cells and balls once more, by mpmath's intervals of forty digits."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._lib.arrays import Floats
from ..._lib.checks import whole_number
from ..._lib.randomness import Rng, random_numbers
from ..._lib.records import ShownAsHtml
from ..._lib.stopping import check_stop
from ...maps.coordinates import turns_of
from ...maps.interval_witness import Interval, NotEnclosedError, intervals, moved, product, witness
from .proof import Proof

_HALVINGS = 3  # halvings of a cell until all its parts are confirmed
_PARTS = 64  # boxes along a ball's width in which its contraction is tried


@dataclass(frozen=True)
class ProofCheck(ShownAsHtml):
    """Outcome of checking a proof by another program.

    Parameters
    ----------
    cells, confirmed : int
        Cells that were drawn, and those that were proved again.
    boxes, contracting : int
        Boxes drawn from the balls around attractors, and those on which the map contracts at the stated rate, or which
        come to where it does.
    unconfirmed : tuple of tuple of float
        Centres of cells that were not confirmed: the other program is coarser, and may fail where nothing is wrong.
    """

    cells: int
    confirmed: int
    boxes: int
    contracting: int
    unconfirmed: tuple[tuple[float, ...], ...]


def check(proof: Proof, n_samples: int, rng: Rng) -> ProofCheck:
    """Prove random cells and boxes again, as :meth:`Proof.check` does."""
    n = whole_number("n_samples", n_samples, at_least=1)
    if proof.basins.point_map is None:
        raise ValueError("this proof has no map: rebuild it with rebuild_map, find the basins again and prove them")
    checker, random = _Checker(proof), random_numbers(rng)
    cells = np.flatnonzero(proof.cells.labels.ravel() > 0)
    drawn = random.choice(cells, n) if len(cells) else cells
    failed = [cell for cell in drawn.tolist() if not checker.confirms(cell)]
    balls = list(proof.attractors)
    boxes = [balls[k] for k in random.integers(0, len(balls), n)] if balls else []
    contracting = sum(checker.contracts(k, random) for k in boxes)
    unconfirmed = tuple(tuple(checker.centre(cell).tolist()) for cell in failed)
    return ProofCheck(len(drawn), len(drawn) - len(failed), len(boxes), contracting, unconfirmed)


class _Checker:
    """Data from which a cell is proved again."""

    def __init__(self, proof: Proof) -> None:
        point_map = proof.basins.point_map
        assert point_map is not None
        self.proof, self.context = proof, intervals()
        self.enclose = witness(point_map.without_table, proof.parameters)
        self.region = proof.cells.region
        self.edges = [self.region.edges(j) for j in range(self.region.grid.dimension)]
        self.turn = turns_of(proof.coordinates)[1]
        self.labels, self.ranks = proof.cells.labels, proof.cells.ranks

    def centre(self, cell: int) -> Floats:
        """Return the centre of a cell."""
        index = np.unravel_index(cell, self.region.shape)
        return np.array([0.5 * (e[i] + e[i + 1]) for e, i in zip(self.edges, index, strict=True)])

    def confirms(self, cell: int) -> bool:
        """Tell whether a cell is proved again."""
        index = np.unravel_index(cell, self.region.shape)
        box = [(float(e[i]), float(e[i + 1])) for e, i in zip(self.edges, index, strict=True)]
        label, rank = int(self.labels[index]), int(self.ranks[index])
        if rank == 0:
            return self._in_ball([self.context.mpf([a, b]) for a, b in box], label)
        return self._comes(box, label, rank, _HALVINGS)

    def _comes(
        self, box: list[tuple[float, float]], label: int, rank: int, halvings: int, contracts: bool = False
    ) -> bool:
        """Tell whether a box comes to cells of a label and smaller rank, or into a ball, if need be in parts.

        The ball is that of all points that are proved to converge, or the one on which the map contracts.
        """
        check_stop()
        context, d = self.context, len(box)
        place = [context.mpf([a, b]) for a, b in box]
        middle = [context.mpf(x.mid.a) for x in place]
        offsets = [x - m for x, m in zip(place, middle, strict=True)]
        total = [[context.mpf(int(i == k)) for k in range(d)] for i in range(d)]
        try:
            for _ in range(max(self.proof.max_periods, 1)):
                hull = moved(middle, total, offsets)
                if any(float(x.delta.b) > 1e3 for x in hull):
                    break
                image, slopes = self.enclose(hull)
                # The image of the hull's midpoint is that of a point near the middle: the mean-value form is about it.
                shift = [m - context.mpf(x.mid.a) for m, x in zip(middle, hull, strict=True)]
                middle, total = moved(image, slopes, shift), product(slopes, total)
                found = moved(middle, total, offsets)
                if self._is_proved(found, label, rank) or self._in_ball(found, label, contracts):
                    return True
        except NotEnclosedError:
            pass
        if halvings == 0:
            return False
        halves = [((a, 0.5 * (a + b)), (0.5 * (a + b), b)) if a < b else ((a, b),) for a, b in box]
        return all(self._comes(list(part), label, rank, halvings - 1, contracts) for part in itertools.product(*halves))

    def _is_proved(self, box: Sequence[Interval], label: int, rank: int) -> bool:
        """Tell whether all cells that a box meets have a label and smaller ranks."""
        if self.region.is_slice:
            return False
        ranges = []
        for j, x in enumerate(box):
            low, high, edges, n = float(x.a), float(x.b), self.edges[j], len(self.edges[j]) - 1
            low, high = np.nextafter(low, -np.inf), np.nextafter(high, np.inf)
            if self.turn[j] > 0.0:
                turns = np.floor((0.5 * (low + high) - 0.5 * (edges[0] + edges[-1])) / self.turn[j] + 0.5)
                slack = 1e-12 * (abs(low) + abs(high) + self.turn[j])
                low, high = low - turns * self.turn[j] - slack, high - turns * self.turn[j] + slack
            around = bool(self.region.grid.wraps[j])
            if not high - low < (self.turn[j] if around else np.inf):
                return False
            if around:
                edges = np.concatenate([edges[:-1] - self.turn[j], edges[:-1], edges + self.turn[j]])
            if not (edges[0] <= low and high <= edges[-1]):
                return False
            first, last = np.searchsorted(edges, low, "left") - 1, np.searchsorted(edges, high, "right") - 1
            some = np.arange(max(int(first), 0), min(int(last), len(edges) - 2) + 1)
            ranges.append(np.unique(some % n) if around else some)
        cells = np.ix_(*ranges)
        return bool((self.labels[cells] == label).all() and (self.ranks[cells] < rank).all())

    def _in_ball(self, box: Sequence[Interval], label: int, contracts: bool = False) -> bool:
        """Tell whether a box lies in a ball of an attractor, one of contraction or of all points that converge."""
        balls = self.proof.attractors.get(label - 1)
        if balls is None:
            return False
        context = self.context
        for centre, frame in zip(balls.centres, balls.frames, strict=True):
            gaps = []
            for j, x in enumerate(box):
                gap = x - context.mpf(float(centre[j]))
                if self.turn[j] > 0.0:
                    turns = float(np.round(float(gap.mid.a) / self.turn[j]))
                    ulp = abs(turns) * self.turn[j] * 2.0**-52
                    gap = gap - context.mpf(turns) * context.mpf(float(self.turn[j])) + context.mpf([-ulp, ulp])
                gaps.append(gap)
            size = sum(sum(context.mpf(float(f)) * g for f, g in zip(row, gaps, strict=True)) ** 2 for row in frame)
            if size <= context.mpf(balls.radius if contracts else balls.reach) ** 2:
                return True
        return False

    def contracts(self, attractor: int, random: np.random.Generator) -> bool:
        """Tell whether the map contracts, at the stated rate, on a random small box in a ball, or takes it there."""
        balls = self.proof.attractors[attractor]
        context, d = self.context, balls.centres.shape[1]
        k = int(random.integers(len(balls.centres)))
        inverse = np.linalg.inv(balls.frames[k])
        direction = random.normal(size=d)
        direction *= random.random() ** (1.0 / d) / np.linalg.norm(direction)
        size = (balls.radius, balls.reach)[int(random.integers(2))]
        at = balls.centres[k] + size * (inverse @ direction)
        half = size * np.linalg.norm(inverse, axis=1) / _PARTS
        if size * np.linalg.norm(direction) > balls.radius:
            box = list(zip((at - half).tolist(), (at + half).tolist(), strict=True))
            return self._comes(box, attractor + 1, 0, _HALVINGS, contracts=True)
        try:
            _, slopes = self.enclose(
                [context.mpf([a - h, a + h]) for a, h in zip(at.tolist(), half.tolist(), strict=True)]
            )
        except NotEnclosedError:
            return False
        ahead = _matrix(context, balls.frames[(k + 1) % len(balls.centres)])
        here = _inverse(context, _matrix(context, balls.frames[k]))
        step = product(product(ahead, slopes), here)
        rate = context.mpf(balls.rate) ** 2
        gram = [[sum(row[i] * row[j] for row in step) for j in range(d)] for i in range(d)]
        return _is_positive([[(rate if i == j else 0) - g for j, g in enumerate(row)] for i, row in enumerate(gram)])


def _matrix(context: Any, numbers: Floats) -> list[list[Interval]]:
    return [[context.mpf(float(v)) for v in row] for row in numbers]


def _inverse(context: Any, a: list[list[Interval]]) -> list[list[Interval]]:
    """Return the inverse of a matrix by Gauss and Jordan."""
    d = len(a)
    rows = [[*row, *(context.mpf(int(i == k)) for k in range(d))] for i, row in enumerate(a)]
    for i in range(d):
        pivot = max(range(i, d), key=lambda r: float(abs(rows[r][i]).a))
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for r in range(d):
            if r != i:
                rows[r] = [x - rows[r][i] * y for x, y in zip(rows[r], rows[i], strict=True)]
    return [row[d:] for row in rows]


def _is_positive(a: list[list[Interval]]) -> bool:
    """Tell whether all symmetric matrices of an interval matrix are positive definite, by Gauss's pivots."""
    rows = [list(row) for row in a]
    for i in range(len(rows)):
        if not rows[i][i] > 0:
            return False
        for r in range(i + 1, len(rows)):
            factor = rows[r][i] / rows[i][i]
            rows[r] = [x - factor * y for x, y in zip(rows[r], rows[i], strict=True)]
    return True
