"""Coverings of invariant sets by subdivision: boxes are bisected, and those that cannot intersect the set discarded."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.sparse import csr_array

from .._lib.arrays import Bools
from .._lib.signatures import checked
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from .box_images import Samples, bisections, box_transitions
from .box_set import BoxSet
from .markov import recurrent_parts

Depth = int | Sequence[int]
"""Number of bisections of each axis: one for all, or one for each."""


@checked
def relative_attractor(
    point_map: PointMap, region: CellGrid | BoxSet, depth: Depth, samples: Samples = "adaptive", periods: int = 1
) -> BoxSet:
    """Compute a covering of the relative global attractor of a window (Dellnitz and Hohmann 1997).

    It consists of all points with a backward orbit that stays in the window, and contains every attractor in the window
    and the unstable manifolds of all invariant sets there.  Boxes are bisected, one axis after the other, and those
    without an infinite backward chain of boxes are discarded.

    Parameters
    ----------
    point_map : PointMap
        The map.
    region : CellGrid or BoxSet
        Initial covering: the cells of a window, or boxes.  They should be so small that a few points in each resolve
        the folds of the map.
    depth : int or sequence of int
        Number of bisections of each axis: a cell becomes ``2**depth`` boxes along it.
    samples : int or "adaptive", optional
        Sample points in a box, as for :func:`box_image`.
    periods : int, optional
        Number of iterates of the map that are taken as one step.

    Returns
    -------
    BoxSet
        Boxes of the covering.

    Raises
    ------
    TypeError, ValueError
        For a window that does not fit the map, or arguments out of range.
    MemoryError
        If the boxes need more memory than is free.

    References
    ----------
    Dellnitz, Hohmann, Numerische Mathematik 75 (1997) 293.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> half = discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",))
    >>> relative_attractor(half, CellGrid((-1,), (1.1,), (1,)), depth=8)
    BoxSet(3 of 256 boxes)
    """

    def select(boxes: BoxSet) -> BoxSet:
        return boxes.chosen(_lasting(box_transitions(boxes, point_map, samples, periods), backwards_only=True))

    return subdivide(point_map, region, depth, select)


@checked
def maximal_invariant_set(
    point_map: PointMap, region: CellGrid | BoxSet, depth: Depth, samples: Samples = "adaptive", periods: int = 1
) -> BoxSet:
    """Compute a covering of the maximal invariant set: all orbits that stay in the window in forward and backward time.

    Parameters
    ----------
    point_map, window, depth, samples, steps
        As for :func:`relative_attractor`.

    Returns
    -------
    BoxSet
        Boxes on chains of boxes that are infinite in both directions.

    References
    ----------
    Dellnitz, Froyland, Junge, *The algorithms behind GAIO*, in Fiedler (editor), *Ergodic Theory, Analysis, and
    Efficient Simulation of Dynamical Systems* (2001) 145.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> saddle = discrete_map(lambda x, p: (2 * x[0], x[1] / 2), {}, ("x", "y"))
    >>> maximal_invariant_set(saddle, CellGrid((-1, -1), (1.1, 1.1), (1, 1)), depth=6)
    BoxSet(9 of 64 x 64 boxes)
    """

    def select(boxes: BoxSet) -> BoxSet:
        return boxes.chosen(_lasting(box_transitions(boxes, point_map, samples, periods)))

    return subdivide(point_map, region, depth, select)


@checked
def chain_recurrent_set(
    point_map: PointMap, region: CellGrid | BoxSet, depth: Depth, samples: Samples = "adaptive", periods: int = 1
) -> BoxSet:
    """Compute a covering of the chain recurrent set: all points to which orbits with arbitrarily small errors return.

    It contains attractors and saddles, periodic or chaotic, but no transient points.

    Parameters
    ----------
    point_map, window, depth, samples, steps
        As for :func:`relative_attractor`.

    Returns
    -------
    BoxSet
        Boxes on closed chains of boxes.

    References
    ----------
    Dellnitz, Schütze, Rath, in *Conley Theory and set-oriented numerics*; Osipenko, *Dynamical Systems, Graphs, and
    Algorithms* (2007), chapter 4.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - x[0]**3 / 2,), {}, ("x",))
    >>> recurrent = chain_recurrent_set(cubic, CellGrid((-1.7,), (1.6,), (1,)), depth=10)
    >>> recurrent.contains([[-1.0], [0.0], [1.0], [0.5]])
    array([ True,  True,  True, False])
    """

    def select(boxes: BoxSet) -> BoxSet:
        return boxes.chosen(recurrent_parts(box_transitions(boxes, point_map, samples, periods)) >= 0)

    return subdivide(point_map, region, depth, select)


def subdivide(
    point_map: PointMap, window: CellGrid | BoxSet, depth: Depth, select: Callable[[BoxSet], BoxSet]
) -> BoxSet:
    """Bisect boxes along one axis after the other and select some of them each time."""
    boxes = boxes_to_begin_with(point_map, window)
    for axis in bisections(depth, boxes.grid):
        boxes = select(boxes.subdivided(axis))
    return boxes


def boxes_to_begin_with(point_map: PointMap, window: CellGrid | BoxSet) -> BoxSet:
    """Return the boxes of a window, wrapping where the map does."""
    if not isinstance(point_map, PointMap):
        raise TypeError(f"point_map={point_map!r}: give a PointMap, such as stroboscopic_map returns")
    if isinstance(window, BoxSet):
        return BoxSet(window.grid.on(point_map.coordinates, "region"), window.keys)
    if not isinstance(window, CellGrid):
        raise TypeError(f"region={window!r}: give a CellGrid, or a BoxSet to begin with")
    return BoxSet.full(window.on(point_map.coordinates, "region"))


def _lasting(graph: csr_array, backwards_only: bool = False) -> Bools:
    """Return which nodes lie on chains that have no beginning, and no end either unless only the first is asked for."""
    kept = np.ones(graph.shape[0], bool)
    onwards, back = graph > 0, (graph > 0).T.tocsr()
    while True:
        now = kept & ((back @ kept) > 0)
        if not backwards_only:
            now &= (onwards @ kept) > 0
        if (now == kept).all():
            return kept
        kept = now
