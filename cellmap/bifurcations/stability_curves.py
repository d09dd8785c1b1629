"""Stability boundaries as curves: points on the lines of a grid, connected through its cells."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from .._lib.arrays import Floats, Ints
from .crossings import Crossing


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
