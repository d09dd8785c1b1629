"""Matching of attractors between neighbouring parameter values."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from .._lib.arrays import Floats, thinned
from ..maps.coordinates import circular_tree
from ..orbits.attractor import Attractor

_MOST_POINTS = 512  # of a cloud, that are compared
UNLIKE = 2.0
"""Factor by which a distance counts more between attractors that hardly become each other."""

_DIGITS = 9  # so that rounding does not decide between mirror images


def attractor_distance(a: Attractor, b: Attractor, extent: Floats) -> float:
    """Return the distance of two attractors, in units of an extent (dimension,).

    It is the mean distance of the points of one to the nearest of the other, of both the larger: Hausdorff's distance
    with a mean in the place of the maximum, which chance decides on for samples of chaotic attractors.  Along angles
    the shorter way counts.

    References
    ----------
    Dubuisson, Jain, Proceedings of the 12th International Conference on Pattern Recognition (1994) 566.
    """
    points = _thinned(a), _thinned(b)
    trees = [circular_tree(some, extent, a.coordinates) for some in points]
    return max(
        float(tree.query(scaled(some))[0].mean()) for (tree, scaled), some in zip(trees, points[::-1], strict=True)
    )


def match_attractors(
    found: Sequence[Attractor], known: Mapping[int, Attractor], extent: Floats, threshold: float, unlike: float = UNLIKE
) -> dict[int, int]:
    """Match attractors with labelled ones so that the sum of their distances, in units of the extent, is least.

    Returns labels by places in `found`, without those that are farther away than the threshold.  Distances between
    attractors with different rotation numbers, or with periods of which none divides the other, are multiplied by
    `unlike`; infinite where these are never the same.
    """
    from scipy.optimize import linear_sum_assignment

    if not found or not known:
        return {}
    labels = list(known)
    cost = np.array([[_cost(a, known[label], extent, unlike) for label in labels] for a in found])
    cost = np.round(np.where(cost <= threshold, cost, 1e3 * (1.0 + threshold)), _DIGITS)
    rows, columns = linear_sum_assignment(cost)
    return {int(i): labels[j] for i, j in zip(rows, columns, strict=True) if cost[i, j] <= threshold}


def persistent_labels(
    found: Sequence[Attractor],
    before: Mapping[int, Attractor],
    memory: Mapping[int, Attractor],
    extent: Floats,
    threshold: float,
    taken: Collection[int] = (),
) -> list[int]:
    """Return a label for each attractor: that of one just before, that of one which had vanished, or a new one.

    ``before``: attractors just before, by label; ``memory``: those and all earlier ones, as they were seen last;
    ``taken``: labels that other attractors have.
    """
    memory, before = ({k: a for k, a in known.items() if k not in taken} for known in (memory, before))
    labels = match_attractors(found, before, extent, threshold)
    rest = [k for k in range(len(found)) if k not in labels]
    vanished = {label: a for label, a in memory.items() if label not in before}
    # After a gap nearness alone is no evidence.
    again = match_attractors([found[k] for k in rest], vanished, extent, threshold, unlike=np.inf)
    labels |= {rest[k]: label for k, label in again.items()}
    fresh = max([*memory, *before, *taken], default=-1) + 1
    for k in rest:
        if k not in labels:
            labels[k] = fresh
            fresh += 1
    return [labels[k] for k in range(len(found))]


def _cost(a: Attractor, b: Attractor, extent: Floats, unlike: float) -> float:
    if not _are_unlike(a, b):
        return attractor_distance(a, b, extent)
    return attractor_distance(a, b, extent) * unlike if np.isfinite(unlike) else np.inf


def _are_unlike(a: Attractor, b: Attractor) -> bool:
    """Tell whether rotation numbers differ, or periods of which none divides the other; chaos is like anything."""
    if not a.period or not b.period:
        return False
    turning = np.abs(np.subtract(a.rotation_number, b.rotation_number)).max() > 1e-9
    return bool(turning) or max(a.period, b.period) % min(a.period, b.period) != 0


def _thinned(attractor: Attractor) -> Floats:
    return thinned(attractor.points, _MOST_POINTS)
