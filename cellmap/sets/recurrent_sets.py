"""Attractors from sets of recurrent cells: iterated with the exact map, or taken as they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Floats, Ints
from .._lib.records import Keyed
from ..attractors.settling.labels import Label, label_of
from ..basins.finding import find_basins
from ..basins.record import Basins
from ..maps.coordinates import Coordinate
from ..maps.grid import CellGrid
from ..maps.orbit_batch import Cost, Orbits
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor, Kind, sort_key
from .box_images import DIVERGED, LEFT, cells_of, centres_of
from .box_set import BoxSet, neighbours_of

_REPRESENTATIVES = 8  # cells of a set that are followed
_LATEST = 2**31 - 1
_FOLLOWED = 1024  # steps of a mapping for which orbits of sets go on without being rounded, at most


def refined_sets(
    point_map: PointMap, grid: CellGrid, cells: Ints, owners: Ints, limits: Mapping[str, Any]
) -> tuple[tuple[Attractor, ...], Ints]:
    """Return the attractors on which orbits of the exact map end that begin in sets of cells, and each set's label.

    ``cells`` (n,) belong to the sets 0, 1, ... in ``owners`` (n,); `limits` are further arguments of
    :func:`find_basins`.  Where the cells of a set end on different attractors, its label is that of most of them; sets
    whose orbits end have the number of a sink.
    """
    if not len(cells):
        return (), np.empty(0, np.int64)
    chosen = _representatives(cells, owners)
    followed, where = np.unique(chosen, return_inverse=True)
    found = find_basins(point_map.without_table, centres_of(grid, followed), **limits)
    columns = len(found.attractors) + 3  # codes behind the attractors, where their negative numbers lead
    votes = np.zeros((len(chosen), columns), np.int64)
    ends = np.where(found.labels == Label.NO_RETURN, DIVERGED, found.labels)
    np.add.at(votes, (np.arange(len(chosen))[:, None], ends[where.reshape(chosen.shape)]), 1)
    label = votes.argmax(axis=1)
    return found.attractors, np.where(label < len(found.attractors), label, label - columns)


def adjacent_sets(
    grid: CellGrid,
    coordinates: tuple[Coordinate, ...],
    cells: Ints,
    owners: Ints,
    images: Ints,
    weights: Floats,
    periods: Ints | None = None,
    alike: Ints | None = None,
) -> tuple[tuple[Attractor, ...], Ints]:
    """Return sets of cells as attractors, those that touch as one, and each set's label.

    ``cells`` (n,) belong to the sets 0, 1, ... in ``owners`` (n,) and go, or most likely go, to the cells ``images``
    (n,); ``alike`` (2, m) are pairs of sets that are one as well.  The points of an attractor begin at the cell of the
    largest weight.  Its period is that in `periods`, or the number of clusters of cells in which it lies, or of cells
    on its cycle.  Multipliers, exponents and neighbourhoods are not known.
    """
    if not len(cells):
        return (), np.empty(0, np.int64)
    order = np.argsort(cells, kind="stable")
    cells, owners, images, weights = cells[order], owners[order], images[order], weights[order]
    touching = np.stack(BoxSet(grid, cells).touching())
    cluster = _joined(len(cells), touching)
    first = np.unique(owners, return_index=True)[1]
    pairs = [touching, np.stack([first[owners], np.arange(len(cells))])] + ([] if alike is None else [first[alike]])
    whole = _joined(len(cells), np.concatenate(pairs, axis=1))
    found = []
    by_set = np.argsort(whole, kind="stable")
    for rows in np.split(by_set, np.cumsum(np.bincount(whole))[:-1]):
        start = rows[np.argmax(weights[rows])]
        period = len(np.unique(cluster[rows])) if periods is None else int(periods[owners[start]])
        path = _path(cells, images, start, period, closed=periods is None)
        still = period == 1 and len(rows) <= 3**grid.dimension
        found.append(_unverified(still, centres_of(grid, path), coordinates))
    ranks = sorted(range(len(found)), key=lambda k: sort_key(found[k]))
    label = np.empty(len(found), np.int64)
    label[ranks] = np.arange(len(found))
    return tuple(found[k] for k in ranks), label[whole[first]]


def exchanging_sets(grid: CellGrid, cells: Ints, owners: Ints, ends: Ints) -> Ints:
    """Return pairs of sets between which an orbit changes, both ways, when it is moved by one cell; shape (2, pairs).

    Rounding to centres moves an orbit by up to half a cell in each step: a mapping cannot distinguish such sets.
    ``cells`` (n,) belong to the sets in ``owners`` (n,); each cell of the grid ends in the set ``ends``, negative for
    none.
    """
    if not len(cells):
        return np.empty((2, 0), np.int64)
    moves = np.concatenate([(owners[rows], ends[there]) for rows, there in neighbours_of(grid, cells)], axis=1)
    count = int(owners.max()) + 1
    strong = _joined(count, moves[:, moves[1] >= 0], both_ways=True)
    return np.stack([np.arange(count), np.unique(strong, return_index=True)[1][strong]])


def ends_of_sets(point_map: PointMap, grid: CellGrid, cells: Ints, owners: Ints, ends: Ints, periods: int) -> Ints:
    """Return for each set another one in which orbits from it end that are not rounded, or itself.

    Where a map attracts or repels weakly, rounding to centres keeps orbits in sets that are no attractors.  Orbits from
    some cells of each set are followed, for no more work than all cells of the grid have taken.  They end in another
    set where all the cells that they visit in the second half of that time end there.  Arguments are those of
    :func:`exchanging_sets`, and the steps of the map in one step of the mapping.
    """
    if not len(cells):
        return np.empty(0, np.int64)
    chosen = _representatives(cells, owners)
    own = np.arange(len(chosen))
    steps = min(_FOLLOWED, grid.size // chosen.size)
    if len(chosen) == 1 or steps < 2:
        return own
    orbits = Orbits.starting(centres_of(grid, chosen.ravel()))
    point_map.advance(orbits, periods * (steps // 2))
    visited = []
    for _ in range(steps // 2):
        point_map.advance(orbits, periods)
        at = cells_of(point_map, grid, orbits)
        visited.append(np.where(at >= 0, ends[at], LEFT).reshape(chosen.shape))
    first, last = (np.asarray(bound(visited, axis=(0, 2))) for bound in (np.min, np.max))
    following = np.where((first == last) & (first >= 0), first, own)
    group = _joined(len(own), np.stack([own, following]))
    # Sets that lead on to one another have one end; it is the first of those that stay, or of a cycle.
    order = np.lexsort((own, following != own, group))
    return order[np.unique(group[order], return_index=True)[1]][group]


def _representatives(cells: Ints, owners: Ints) -> Ints:
    """Return some cells of each set, shape (sets, m), evenly spread over them and repeated where there are fewer."""
    order = np.argsort(owners, kind="stable")
    sizes = np.bincount(owners)
    ranks = np.arange(_REPRESENTATIVES) * sizes[:, None] // _REPRESENTATIVES
    return np.asarray(cells[order[(np.cumsum(sizes) - sizes)[:, None] + ranks]])


def _joined(count: int, pairs: Ints, both_ways: bool = False) -> Ints:
    """Number things so that those of a pair, and of chains of pairs, have one number; or of chains that lead back."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(pairs.shape[1], np.int8), tuple(pairs)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=both_ways, connection="strong")[1], dtype=np.int64)


def _path(cells: Ints, images: Ints, row: int, length: int, closed: bool) -> Ints:
    """Follow cells for some steps, by places in a sorted list of cells and their images, or until they close."""
    path = [row]
    while len(path) < length:
        following = int(np.searchsorted(cells, images[path[-1]]))
        if closed and following == row:
            break
        path.append(following)
    return cells[path]


def _unverified(still: bool, points: Floats, coordinates: tuple[Coordinate, ...]) -> Attractor:
    """Return an attractor of which points are known alone."""
    d = len(coordinates)
    kind = Kind.FIXED_POINT if still else Kind.PERIODIC
    unknown = np.full(d, np.nan)
    return Attractor(kind, len(points), points, (0,) * d, unknown.astype(complex), unknown, coordinates)


def basins_from_cells(
    point_map: PointMap | None,
    grid: CellGrid,
    labels: Ints,
    attractors: Sequence[Attractor],
    times: NDArray[Any],
    like: PointMap,
    settings: Mapping[str, Any],
    inaccurate: int,
    cost: Cost,
) -> Basins:
    """Return labels of cells as basins, without attractors that no cell belongs to."""
    used = np.unique(labels[labels >= 0])
    number = np.full(len(attractors) + 3, -3, np.int64)
    number[[LEFT, DIVERGED]] = LEFT, label_of(like.no_image)
    number[used] = np.arange(len(used))
    final = number[labels].astype(np.int16)
    return Basins(
        labels=final.reshape(grid.shape),
        attractors=tuple(attractors[k] for k in used),
        settling_time=np.where(final >= 0, np.minimum(times, _LATEST), -1).astype(np.int32).reshape(grid.shape),
        grid=grid,
        initial_conditions=None,
        name=like.name,
        params=Keyed(like.params, "params"),
        coordinates=like.coordinates,
        settings={**settings, "map": dict(like.recipe)},
        inaccurate=inaccurate,
        cost=cost,
        point_map=point_map,
    )
