"""Groups of feature vectors by an estimator of scikit-learn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from ..._lib.arrays import Floats, Ints, evenly
from ..._lib.checks import of_the_user, shown, whole_array

_FITTED = 2000  # distinct feature vectors to which an estimator is fitted
_USUAL = 0.75  # of the orbits of a group have a neighbour no farther off than usual
_APART = 10.0  # such distances lie between a group and what is not of it


def check_clusterer(clusterer: Any) -> None:
    """Check the argument of that name: None, or an estimator that groups, and the same way each time."""
    if clusterer is None:
        return
    if isinstance(clusterer, type) or not callable(getattr(clusterer, "fit_predict", None)):
        raise TypeError(
            f"clusterer={shown(clusterer)}: give an estimator with a method fit_predict, such as "
            "sklearn.cluster.HDBSCAN()"
        )
    parameters = clusterer.get_params() if callable(getattr(clusterer, "get_params", None)) else {}
    if parameters.get("random_state", 0) is None:
        raise ValueError(f"clusterer={shown(clusterer)} draws other numbers each time: give it a seed, random_state=0")


@dataclass(frozen=True, eq=False)
class FeatureGroups:
    """Groups of feature vectors, the largest first.

    ``labels`` (n,) are the groups of the vectors, -1 for those that are in none; ``count`` is the number of groups.
    """

    labels: Ints
    count: int
    _tree: KDTree
    _owners: Ints

    def nearest(self, values: Floats) -> Ints:
        """Return the groups of the fitted vectors that are nearest to some others."""
        return self._owners[self._tree.query(values)[1]]


def grouped(values: Floats, clusterer: Any, resolution: float, min_size: int) -> FeatureGroups:
    """Group feature vectors (n, features), n > 0, all finite.

    Vectors that a chain of others joins, each within `resolution` of the next, are alike and never in different groups.
    Of those in one small cell `min_size` are given to the estimator, which decides how such chains belong together.
    Fewer than `min_size` vectors that lie apart from the others of their group are in none.
    """
    lattice = np.round(values / (resolution / (2.0 * np.sqrt(values.shape[1]))))
    _, first, cell, counts = np.unique(lattice, axis=0, return_index=True, return_inverse=True, return_counts=True)
    cell = cell.ravel()
    # Crowded cells first, so that no large group is left out; the order of equal ones is that of the vectors.
    chosen = np.lexsort((first, -np.minimum(counts, min_size)))
    crowded = int(np.count_nonzero(counts >= min_size))
    sparse = chosen[crowded:]
    sparse = sparse[evenly(len(sparse), max(0, _FITTED - crowded))]
    chosen = np.sort(np.concatenate([chosen[:crowded][:_FITTED], sparse]))
    places = values[first[chosen]]
    tree = KDTree(places)
    groups = _by_estimator(values, cell, chosen, clusterer, min_size)
    owners = _of_parts(_parts(tree, resolution), groups, counts[chosen], min_size)
    owners = _without_outliers(places, owners, counts[chosen], resolution, min_size)
    place = np.full(len(counts), -1)
    place[chosen] = np.arange(len(chosen))
    labels = np.where(place[cell] >= 0, owners[place[cell]], -1)
    rest = np.flatnonzero(place[cell] < 0)
    if len(rest):
        labels[rest] = _of_neighbours(tree, owners, values[rest], resolution)
    sizes = np.bincount(labels[labels >= 0], minlength=owners.max(initial=-1) + 1)
    order = np.argsort(-sizes, kind="stable")
    number = np.append(np.argsort(order, kind="stable"), -1)  # the last one for -1
    return FeatureGroups(number[labels], len(sizes), tree, number[owners])


def _parts(tree: KDTree, reach: float) -> Ints:
    """Return the number of the chain of near vectors to which each one belongs."""
    pairs = tree.query_pairs(reach, output_type="ndarray")
    joined = coo_array((np.ones(len(pairs), np.int8), tuple(pairs.T)), shape=(tree.n, tree.n))
    return np.asarray(connected_components(joined, directed=False)[1], np.int64)


def _by_estimator(values: Floats, cell: Ints, chosen: Ints, clusterer: Any, min_size: int) -> list[Ints]:
    """Return for each chosen cell the groups into which an estimator puts its first vectors."""
    order = np.argsort(cell, kind="stable")
    ends = np.searchsorted(cell[order], chosen, "right")
    begins = np.searchsorted(cell[order], chosen, "left")
    taken = [order[a : min(b, a + min_size)] for a, b in zip(begins, ends, strict=True)]
    rows = np.concatenate(taken)
    alone = clusterer is None
    if clusterer is None:
        if len(rows) < min_size:
            return [np.full(len(some), -1) for some in taken]
        from sklearn.cluster import HDBSCAN  # slow to import

        clusterer = HDBSCAN(min_cluster_size=min_size, allow_single_cluster=True, copy=True)
    found = whole_array("clusterer", of_the_user("clusterer", clusterer.fit_predict, values[rows]))
    if found.shape != rows.shape:
        raise ValueError(f"clusterer={shown(clusterer)} returned the shape {found.shape} for {len(rows)} orbits")
    if alone and found.max() < 1:  # the root of the hierarchy, of which HDBSCAN returns the densest part
        found = np.zeros_like(found)
    return np.split(found, np.cumsum([len(some) for some in taken])[:-1])


def _of_parts(part: Ints, groups: list[Ints], counts: Ints, min_size: int) -> Ints:
    """Return the group of each cell: that of most vectors alike, or a new one for many that are alike and in none."""
    owner = np.full(int(part.max()) + 1, -1)
    within = np.repeat(part, [len(some) for some in groups])
    labels = np.concatenate(groups)
    known = labels >= 0
    pairs, votes = np.unique(np.stack([within[known], labels[known]]), axis=1, return_counts=True)
    for k in np.argsort(votes, kind="stable"):
        owner[pairs[0, k]] = pairs[1, k]
    fresh = np.flatnonzero((owner < 0) & (np.bincount(part, counts) >= min_size))
    owner[fresh] = labels.max(initial=-1) + 1 + np.arange(len(fresh))
    return owner[part]


def _without_outliers(places: Floats, owners: Ints, counts: Ints, resolution: float, min_size: int) -> Ints:
    """Return groups, renumbered, without small parts that lie apart: estimators keep these with the nearest group."""
    kept = owners.copy()
    for group in np.unique(owners[owners >= 0]):
        mine = np.flatnonzero(owners == group)
        tree = KDTree(places[mine])
        spacing = (
            np.where(counts[mine] > 1, 0.0, tree.query(places[mine], 2)[0][:, 1]) if len(mine) > 1 else np.zeros(1)
        )
        order = np.argsort(spacing)
        total = np.cumsum(counts[mine][order])
        usual = spacing[order][np.searchsorted(total, _USUAL * total[-1])]
        part = _parts(tree, max(resolution, _APART * usual))
        kept[mine[np.bincount(part, counts[mine])[part] < min_size]] = -1
    kept[kept >= 0] = np.unique(kept[kept >= 0], return_inverse=True)[1]
    return kept


def _of_neighbours(tree: KDTree, owners: Ints, values: Floats, resolution: float) -> Ints:
    """Return the groups of vectors that were not fitted: none for those farther off than neighbours in the group."""
    spacing = tree.query(tree.data, 2)[0][:, 1]
    reach = np.full(owners.max(initial=-1) + 2, resolution)
    np.maximum.at(reach, owners, np.where(owners >= 0, spacing, 0.0))
    distance, which = tree.query(values)
    return np.where(distance <= reach[owners[which]], owners[which], -1)
