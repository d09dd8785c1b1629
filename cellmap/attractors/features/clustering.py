"""Attractors distinguished by features of orbits where no trapping region proves them, such as quasi-periodic ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._lib.arrays import Floats
from ..._lib.checks import finite_number, whole_number
from ..._lib.signatures import checked
from ...maps.coordinates import Coordinate, state_points
from ...maps.orbit_batch import Status
from ...maps.point_map import PointMap
from ..settling.labels import Label, label_of
from .orbit_features import Features, extents, features_of, settled

_ROUNDED = 0.05  # of the radius, within which features count as one and the same
_SHOWN = 10_000  # sample points of a cluster


@dataclass(frozen=True, eq=False)
class OrbitClusters:
    """Clusters of orbits with like features: attractors by conjecture.

    Parameters
    ----------
    labels : ndarray of int16, shape (...)
        Cluster of each initial condition, the largest cluster first; -3 (undecided) for an orbit whose features are
        those of few others, and the label of a terminated orbit as in :class:`Basins`.
    features : ndarray, shape (..., features)
        Features of the orbits; NaN for terminated ones.
    samples : tuple of ndarray, shapes (n, dimension)
        Points of the orbits in each cluster after the transient.
    coordinates : tuple of Coordinate
        State variables.
    """

    labels: NDArray[np.int16]
    features: Floats
    samples: tuple[Floats, ...]
    coordinates: tuple[Coordinate, ...]

    def __repr__(self) -> str:
        fractions = ", ".join(f"{100.0 * np.mean(self.labels == k):.3g} %" for k in range(len(self.samples)))
        return (
            f"OrbitClusters({len(self.samples)} clusters of {self.labels.size} orbits{fractions and ': ' + fractions})"
        )


@checked
def cluster_orbits(
    point_map: PointMap,
    initial_conditions: ArrayLike,
    transient: int = 1000,
    periods: int = 200,
    features: Features | None = None,
    radius: float = 0.05,
    min_size: int = 10,
) -> OrbitClusters:
    """Group initial conditions by features of their orbits, as a conjecture of the attractors that they converge to.

    :func:`find_attractors` proves what it finds: periodic attractors by trapping regions, chaotic ones by their
    exponents.  Orbits on an invariant circle or torus are neither, and it leaves them undecided, as it does orbits
    that settle too slowly.  Here two orbits belong together if a chain of orbits with features within `radius` of one
    another joins them; nothing is proved, and attractors that the features do not distinguish are one cluster.

    Parameters
    ----------
    point_map : PointMap
        The map.
    initial_conditions : array_like, shape (..., dimension)
        Initial conditions of the orbits.
    transient : int, optional
        Steps of the map before features are taken.
    periods : int, optional
        Steps over which they are taken.
    features : callable, optional
        ``features(orbit)`` of the images of n orbits, an :class:`Iterate` with arrays of the shapes (periods + 1, n,
        ...): returns an array (n, features).  By default the mean and the standard deviation of each coordinate, as
        fractions of its range over all orbits; of an angle, the mean of its cosine and its sine, and its full
        rotations per step, so that its branch cut parts nothing.
    radius : float, optional
        Distance of features of neighbours in a cluster, above 0.
    min_size : int, optional
        Number of orbits within `radius`, the orbit itself included, from which on it is in the interior of a cluster.

    Returns
    -------
    OrbitClusters
        Labels, features, and points of each cluster.

    References
    ----------
    Ester, Kriegel, Sander, Xu, Proceedings of KDD (1996) 226, on the clusters (DBSCAN); Gelbrecht, Kurths, Hellmann,
    New Journal of Physics 22 (2020) 033032, on features of orbits.

    Examples
    --------
    >>> from cellmap import angle, discrete_map
    >>> circles = discrete_map(lambda x, p: (x[0] + 2.4, x[1] + x[1] * (1 - x[1] ** 2) / 4), {}, (angle("a"), "r"))
    >>> cluster_orbits(circles, np.stack([np.zeros(40), np.linspace(-2.0, 2.0, 40)], axis=-1), transient=100)
    OrbitClusters(2 clusters of 40 orbits: 50 %, 50 %)
    """
    from sklearn.cluster import DBSCAN  # slow to import

    places = state_points("initial_conditions", initial_conditions, point_map.coordinates)
    transient, periods = whole_number("transient", transient), whole_number("periods", periods, at_least=1)
    radius = finite_number("radius", radius, above=0.0)
    min_size = whole_number("min_size", min_size, at_least=1)
    images, low, high = settled(point_map, places.reshape(-1, point_map.dimension), transient)
    (values,), status = features_of(point_map, images, periods, features, (slice(None),))
    alive = np.isfinite(values).all(axis=1) & (status < Status.ESCAPED)
    values[~alive] = np.nan
    if features is None:
        values /= extents(values, alive, point_map.coordinates, high - low)
    labels = np.where(status >= Status.ESCAPED, label_of(status), Label.UNDECIDED).astype(np.int16)
    # Orbits that have settled have equal features, of which one with their number as its weight is enough.
    distinct, which, count = np.unique(
        np.round(values[alive] / (_ROUNDED * radius)), axis=0, return_inverse=True, return_counts=True
    )
    if len(distinct):
        search = DBSCAN(eps=1.0 / _ROUNDED, min_samples=min_size)
        cluster = search.fit_predict(distinct, sample_weight=count)[which.ravel()]
        sizes = np.bincount(cluster[cluster >= 0])
        rank = np.argsort(np.argsort(-sizes, kind="stable"))
        labels[alive] = np.where(cluster >= 0, np.append(rank, 0)[cluster], Label.UNDECIDED)
    samples = tuple(images.points[np.flatnonzero(labels == k)[:_SHOWN]] for k in range(int(labels.max(initial=-1)) + 1))
    shape = places.shape[:-1]
    return OrbitClusters(labels.reshape(shape), values.reshape(*shape, -1), samples, point_map.coordinates)
