"""Basins by features of orbits, where no trapping region can be verified."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.arrays import Floats, Ints
from .._lib.checks import claim_memory, finite_number, one_of, whole_number
from .._lib.records import Keyed
from .._lib.signatures import checked
from .._lib.threads import slices
from ..attractors.features.feature_groups import FeatureGroups, check_clusterer, grouped
from ..attractors.features.orbit_features import Features, extents, features_of, settled
from ..attractors.settling.labels import LABEL_NAMES, Label, label_of, stored_names
from ..maps.coordinates import Coordinate
from ..maps.grid import CellGrid
from ..maps.orbit_batch import Status
from ..maps.point_map import PointMap, follow
from .initial_conditions import BLOCK, InitialConditions
from .record import Fraction, fractions_of

UNLIKE = "features of no group"
CHANGING = "features of different groups in the halves of the periods"
NOT_FINITE = "features that are not finite"


@dataclass(frozen=True, eq=False)
class FeatureBasins:
    """Initial conditions grouped by features of their orbits: basins by conjecture.

    Parameters
    ----------
    labels : ndarray of int16
        For each initial condition the number of its group, the largest group first, or -7 (doubtful), -1 (escaped), -2
        (diverged), -4 (did not return to the section), -6 (out of steps); shape of the grid, or of the initial
        conditions without their last axis.
    features : ndarray, shape (..., features)
        Features of the orbits; NaN for terminated ones.
    representatives : tuple of ndarray, shapes (periods + 1, dimension)
        Orbit of each group after the transient, the one with features nearest to their median.
    doubts : mapping of str to int
        Reasons why initial conditions are doubtful, and the number of orbits with each.
    grid, initial_conditions, name, params, coordinates, inaccurate
        As of :class:`Basins`.
    settings : mapping
        Arguments of :func:`classify_by_features`, and under ``"map"`` the recipe of the map.
    """

    labels: NDArray[np.int16]
    features: Floats
    representatives: tuple[Floats, ...]
    doubts: Mapping[str, int]
    grid: CellGrid | None
    initial_conditions: Floats | None
    name: str
    params: Mapping[str, float]
    coordinates: tuple[Coordinate, ...]
    settings: Mapping[str, Any]
    inaccurate: int = 0

    def __repr__(self) -> str:
        parts = "; ".join(f"{self.label_name(k)} {100 * f.fraction:.4g} %" for k, f in self.fractions.items())
        return f"FeatureBasins({self.name}, {self.labels.size:,} initial conditions: {parts})"

    @checked
    def label_name(self, label: int) -> str:
        """Return the meaning of a label."""
        one_of("label", label, (*range(len(self.representatives)), *LABEL_NAMES))
        return stored_names(self.settings).get(label, f"group {label}")

    @property
    def fractions(self) -> dict[int, Fraction]:
        """Fraction of the initial conditions for each label: all groups, then the other labels that occur."""
        found = fractions_of(self.labels, len(self.representatives))
        return Keyed(found, "fractions", {k: self.label_name(k) for k in found})


@checked
def classify_by_features(
    point_map: PointMap,
    initial_conditions: CellGrid | ArrayLike,
    features: Features | None = None,
    clusterer: Any = None,
    transient: int = 1000,
    periods: int = 200,
    resolution: float = 0.02,
    min_size: int = 10,
) -> FeatureBasins:
    """Group initial conditions by features of their orbits, where trapping regions of attractors cannot be verified.

    :func:`find_basins` proves what it labels, and leaves undecided what it cannot prove: weak chaos, for instance, or
    attractors in many dimensions.  Here the orbit of each initial condition is described by a few numbers, and those
    with like numbers are one group.  Nothing is proved: attractors that the features do not distinguish are one
    group, as are features that are scattered without gaps, and one attractor is several groups if its orbits have
    different features.  Initial conditions are doubtful if their features are those of no group, or if the first and
    the second half of the periods speak for different groups, as they do on orbits that have not settled.

    Parameters
    ----------
    point_map : PointMap
        Exact, interpolated or discrete map.
    initial_conditions : CellGrid or array_like, shape (..., dimension)
        Grid of cells whose centres are the initial conditions, or the initial conditions themselves.
    features : callable, optional
        ``features(orbit)`` of the images of n orbits, an :class:`Iterate` with ``orbit.points`` and ``orbit.unwrapped``
        of the shape (periods + 1, n, dimension): returns an array (n, features) in whose row k are numbers of orbit k
        alone.  It is called for all periods, and for each half of them.  Scale the numbers such that differences below
        `resolution` do not matter.  By default the mean and the standard deviation of each coordinate, as fractions of
        its range over all orbits; of an angle, the mean of its cosine and its sine, and its full rotations per step.
    clusterer : estimator of scikit-learn, optional
        Groups features by its ``fit_predict(X)``, with -1 for outliers; by default ``HDBSCAN`` with groups of at least
        `min_size`.  It sees at most 2000 small cells of features, which are distinct, and `min_size` orbits in each.
    transient : int, optional
        Steps of the map before features are taken.
    periods : int, optional
        Steps over which they are taken, at least 2.
    resolution : float, optional
        Distance of features, above 0.  Orbits that a chain of others joins, each within this distance of the next, are
        never in different groups, whatever the estimator says.
        Attractors with features closer than this are one group; with much less than 4 / `periods`, phases of one cycle
        may be several.
    min_size : int, optional
        Number of orbits, at least 2, that are a group if their features are alike; fewer that lie apart are doubtful.

    Returns
    -------
    FeatureBasins
        Labels, fractions, features and an orbit of each group.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, features of another shape or that depend on other orbits, an estimator without a
        seed.
    MemoryError
        If features or orbits do not fit into memory.

    References
    ----------
    Gelbrecht, Kurths, Hellmann, New Journal of Physics 22 (2020) 033032; Stender, Hoffmann, Nonlinear Dynamics 107
    (2022) 1451, on features of orbits; Campello, Moulavi, Sander, PAKDD (2013) 160, on HDBSCAN.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> wells = discrete_map(lambda x, p: (x[0] - 0.1 * x[0] * (x[0] ** 2 - 1),), {}, ("x",))
    >>> found = classify_by_features(wells, CellGrid((-2,), (2,), (100,)), lambda orbit: orbit.points.mean(axis=0))
    >>> found
    FeatureBasins(<lambda>, 100 initial conditions: group 0 50 %; group 1 50 %)
    """
    places = InitialConditions.of(initial_conditions, point_map)
    check_clusterer(clusterer)
    transient, periods = whole_number("transient", transient), whole_number("periods", periods, at_least=2)
    resolution = finite_number("resolution", resolution, above=0.0)
    min_size = whole_number("min_size", min_size, at_least=2)
    values, status, ranges = _features(point_map, places, transient, periods, features)
    terminated = status >= Status.ESCAPED
    finite = np.isfinite(values).all(axis=(0, 2)) & ~terminated
    if features is None:
        values /= extents(values[0], finite, point_map.coordinates, ranges)
    labels = np.where(terminated, label_of(status), Label.DOUBTFUL).astype(np.int16)
    doubts = {NOT_FINITE: int(np.count_nonzero(~finite & ~terminated))}
    representatives: tuple[Floats, ...] = ()
    if finite.any():
        rows = np.flatnonzero(finite)
        groups = grouped(values[0, rows], clusterer, resolution, min_size)
        of_halves = [groups.nearest(half) for half in values[1:, rows]]
        steady = (of_halves[0] == groups.labels) & (of_halves[1] == groups.labels)
        doubts[UNLIKE] = int(np.count_nonzero(groups.labels < 0))
        doubts[CHANGING] = int(np.count_nonzero((groups.labels >= 0) & ~steady))
        labels[rows] = np.where((groups.labels >= 0) & steady, groups.labels, Label.DOUBTFUL)
        middle = rows[_middle(values[0, rows], groups)]
        begin = follow(point_map, places.wrapped(middle, point_map), transient).points
        orbits = point_map.orbit(begin, periods).points
        representatives = tuple(orbits[:, k].copy() for k in range(groups.count))
    settings = {
        "features": "default" if features is None else getattr(features, "__name__", type(features).__name__),
        "clusterer": f"HDBSCAN(min_cluster_size={min_size})"
        if clusterer is None
        else " ".join(repr(clusterer).split()),
        "transient": transient,
        "periods": periods,
        "resolution": resolution,
        "min_size": min_size,
        "map": dict(point_map.recipe),
    }
    return FeatureBasins(
        labels.reshape(places.shape),
        values[0].reshape(*places.shape, -1),
        representatives,
        {reason: count for reason, count in doubts.items() if count},
        places.grid,
        places.given,
        point_map.name,
        point_map.params,
        point_map.coordinates,
        settings,
        int(np.count_nonzero(status == Status.INACCURATE)),
    )


def _features(
    point_map: PointMap, places: InitialConditions, transient: int, periods: int, features: Features | None
) -> tuple[Floats, NDArray[np.uint8], Floats]:
    """Return features (3, n, features) over all periods and over their halves, the status (n,), and ranges (d,)."""
    half = periods // 2
    windows = slice(None), slice(0, half + 1), slice(half, None)
    parts: list[tuple[Floats, NDArray[np.uint8]]] = []
    low, high = np.full(point_map.dimension, np.inf), np.full(point_map.dimension, -np.inf)
    for part in slices(len(places), BLOCK):
        images, least, most = settled(point_map, places.wrapped(part, point_map), transient)
        low, high = np.minimum(low, least), np.maximum(high, most)
        parts.append(features_of(point_map, images, periods, features, windows))
        if part.start == 0:
            needed = (len(windows) + 4) * 8 * len(places) * parts[0][0].shape[2]
            remedy = "take fewer initial conditions, or fewer features"
            claim_memory(f"features of {len(places):,} initial conditions", needed, remedy)
    columns = max(values.shape[2] for values, _ in parts)  # 1 where all orbits of a part are terminated
    whole = [np.broadcast_to(v, (*v.shape[:2], columns)) if v.shape[2] == 1 else v for v, _ in parts]
    return np.concatenate(whole, axis=1), np.concatenate([status for _, status in parts]), high - low


def _middle(values: Floats, groups: FeatureGroups) -> Ints:
    """Return the vector of each group that is nearest to their median."""
    found = []
    for k in range(groups.count):
        rows = np.flatnonzero(groups.labels == k)
        distance = np.square(values[rows] - np.median(values[rows], axis=0)).sum(axis=1)
        found.append(rows[np.argmin(distance)])
    return np.array(found, np.int64)
