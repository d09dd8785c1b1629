"""Samples of orbits in chaos: which of them are on one attractor, by where orbits go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints
from ..._lib.threads import thread_count
from ...maps.orbit_batch import Orbits
from ...maps.paths import path_of
from ...maps.point_map import PointMap
from ..regions.boxes import boxes_of, in_units, tree_of

_NEIGHBOURS = 8  # nearest points of all samples that are looked at
_MIXED = 0.2  # of the neighbours that two samples of one set have in each other, from which on they are of one set
_ON = 0.5  # of some points, that are as near to points of a sample as these are to one another
_SHOWN = 0.95  # of the distances between neighbours in a sample are at most what counts as its resolution
_RETURNING = 0.9  # of the pieces of orbits, that are on the samples which these orbits make later
_ASIDE = 0.382  # of a box: rounding must not tell on which side of an edge points are, where the map has its ends
_GAP = 8.0  # widths of all samples together, between the two sides of an invariant plane
_PIECE, _EVERY = 16, 2  # points of a piece of an orbit, and periods between them


@dataclass(frozen=True, eq=False)
class Clouds:
    """Samples of orbits, each given by its points (n, dimension), in units of `size` (dimension,).

    Nearest neighbours tell samples apart at the distance between the points of them all: of two samples of one set,
    each has as many neighbours in the other as in itself; of two sets that touch, only points where they touch do.
    Points on the two sides of an invariant plane of some `planes`, coordinates that are zero there, are no neighbours.
    ``group`` numbers the sets of the samples (number,), by this alone.
    """

    point_map: PointMap
    samples: Sequence[Floats]
    size: Floats
    planes: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    group: Ints = field(init=False)
    _tree: Any = field(init=False)
    _owners: Ints = field(init=False)
    _spacing: Floats = field(init=False)

    def __post_init__(self) -> None:
        from scipy.sparse.csgraph import connected_components

        # Initial conditions that are mirror images may have one and the same orbit, with no neighbours elsewhere.
        _, first, same = np.unique([s[-1] for s in self.samples], axis=0, return_index=True, return_inverse=True)
        distinct = [self.samples[k] for k in first]
        counts = np.array([len(s) for s in distinct])
        who = np.repeat(np.arange(len(distinct)), counts)
        tree = tree_of(self.opened(np.concatenate(distinct)), self.size, self.point_map)
        apart, near = tree.query(tree.data, k=np.arange(2, _NEIGHBOURS + 2), workers=thread_count())
        pairs = np.repeat(who, _NEIGHBOURS) * len(counts) + who[np.minimum(near, len(who) - 1)].ravel()
        found = np.bincount(pairs, minlength=len(counts) ** 2).reshape(len(counts), -1)
        mixed = found >= _MIXED * _NEIGHBOURS * np.outer(counts, counts) / counts.sum()
        group = connected_components(mixed, directed=False)[1]
        values = {"group": group[same.ravel()], "_tree": tree, "_owners": first[who], "_spacing": apart[:, -1]}
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def opened(self, points: Floats) -> Floats:
        """Return points (..., dimension) with a gap between the sides of each plane, wider than the samples are."""
        shift = np.zeros(points.shape)
        shift[..., self.planes] = _GAP * self.size[self.planes] * (points[..., self.planes] > 0.0)
        return points + shift

    def place_of(self, pieces: Floats, group: Ints) -> Ints:
        """Return the group of samples on which each of some pieces of orbits (..., steps, dimension) is, -1 for none.

        A point is on a sample if it is as near to one of its points as this is to its neighbours.
        """
        *shape, steps, d = pieces.shape
        points = pieces.reshape(-1, d)
        rows = np.flatnonzero(np.isfinite(points).all(axis=1))
        apart, near = self._tree.query(
            in_units(self.opened(points[rows]), self.size, self.point_map), workers=thread_count()
        )
        on = np.full(len(points), -1)
        on[rows] = np.where(apart <= self._spacing[near], group[self._owners[near]], -1)
        votes = np.array([(on.reshape(-1, steps) == g).sum(axis=1) for g in range(int(group.max()) + 1)])
        return np.where(votes.max(axis=0) >= _ON * steps, votes.argmax(axis=0), -1).reshape(shape)

    def resolution(self, members: Ints) -> Floats:
        """Return the distance (dimension,) at which most points of some samples have neighbours."""
        return np.asarray(np.quantile(self._spacing[np.isin(self._owners, members)], _SHOWN) * self.size)


def pieces_of(point_map: PointMap, begins: Floats) -> Floats:
    """Return points (..., steps, dimension) of orbits after some places (..., dimension), NaN where they end."""
    orbits = Orbits.starting(begins.reshape(-1, point_map.dimension).copy())
    points = path_of(point_map, orbits, _PIECE * _EVERY)[_EVERY - 1 :: _EVERY]
    return points.swapaxes(0, 1).reshape(*begins.shape[:-1], _PIECE, -1)


def recurrent_groups(clouds: Clouds, path: Floats, widths: Floats, transients: Floats) -> tuple[Ints, Bools]:
    """Return the number of the set of each sample, and of which samples the orbits go elsewhere, or do not return.

    ``path`` (times, orbits, dimension) is where the orbits of the first samples were before, ``transients`` (number,
    steps, dimension) are pieces of orbits that came to another attractor.  Samples between which orbits went to and fro
    are one set.  So are those in common boxes of some widths where orbits are not yet seen to return to their samples.
    """
    from scipy.sparse.csgraph import connected_components

    group, orbits = clouds.group, np.arange(path.shape[1])
    place = clouds.place_of(pieces_of(clouds.point_map, path), group)
    own = group[orbits]
    for _ in range(2):
        number = int(group.max()) + 1
        returns = np.array([(place[:, own == g] == g).mean() if (own == g).any() else 1.0 for g in range(number)])
        if number == 1 or (returns >= _RETURNING).all():
            break
        joined = _common_boxes(clouds, group, widths) & (np.minimum.outer(returns, returns) < _RETURNING)
        merged = connected_components(joined, directed=False)[1]
        group, own, place = merged[group], merged[own], np.where(place >= 0, merged[place], -1)
    to = np.zeros((number, number), bool)
    for m in orbits:
        seen = np.append(place[place[:, m] >= 0, m], own[m])
        to[seen[:-1], seen[1:]] = True
    strong = connected_components(to, directed=True, connection="strong")[1]
    leaves = np.zeros(int(strong.max()) + 1, bool)
    np.logical_or.at(leaves, strong[np.nonzero(to)[0]], strong[np.nonzero(to)[0]] != strong[np.nonzero(to)[1]])
    group, place = strong[group], np.where(place >= 0, strong[place], -1)
    for g in range(len(leaves)):
        mine = group[orbits] == g
        leaves[g] |= bool(mine.any() and (place[:, mine] == g).mean() < _ON)
    if len(transients):
        there = clouds.place_of(transients, group)
        leaves[there[there >= 0]] = True
    return group, leaves[group]


def _common_boxes(clouds: Clouds, group: Ints, widths: Floats) -> Bools:
    """Tell which groups of samples visit common boxes."""
    points = clouds.opened(np.concatenate(clouds.samples))
    boxes = boxes_of(points, points.min(axis=0) - _ASIDE * widths, widths, clouds.point_map)
    _, keys = np.unique(boxes, axis=0, return_inverse=True)
    visits = np.zeros((int(group.max()) + 1, int(keys.max()) + 1), np.int64)
    visits[np.repeat(group, [len(s) for s in clouds.samples]), keys.ravel()] = 1
    return np.asarray(visits @ visits.T > 0)
