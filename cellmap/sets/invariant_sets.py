"""Coverings of invariant sets and their manifolds, by subdivision and by continuation.

Subdivision bisects boxes, and discards those that cannot intersect the set.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from .._lib.arrays import Bools, Ints
from .._lib.checks import whole_number
from .._lib.signatures import checked
from ..maps.coordinates import state_points
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from .box_images import Samples, bisections, box_image, box_transitions
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
    if isinstance(window, BoxSet):
        return BoxSet(window.grid.on(point_map.coordinates, "region"), window.keys)
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


@checked
def unstable_set(
    point_map: PointMap,
    points: ArrayLike,
    grid: CellGrid,
    samples: Samples = "adaptive",
    periods: int = 1,
    max_iterations: int | None = None,
) -> BoxSet:
    """Compute a covering of the unstable manifold of an invariant set by continuation, in any dimension.

    The boxes around the set are mapped, then the boxes that their images intersect, and so on.  Only these boxes take
    memory, however fine the grid.

    Parameters
    ----------
    point_map : PointMap
        The map.
    points : array_like, shape (..., dimension)
        Points of the set: a saddle, all points of a periodic orbit, an orbit on a chaotic saddle.
    grid : CellGrid
        Window and resolution.
    samples : int or "adaptive", optional
        Sample points in a box, as for :func:`box_image`.
    periods : int, optional
        Number of iterates of the map that are taken as one step; for a periodic orbit, its period is a good choice.
    max_iterations : int, optional
        Largest number of images; by default, iteration ends when an image adds no new box.

    Returns
    -------
    BoxSet
        Boxes that cover the part of the manifold that orbits reach without leaving the window, and the attractors at
        its ends.  Where the map contracts weakly, the covering is thicker than the manifold by the width of boxes.

    Raises
    ------
    TypeError, ValueError
        For points outside the window, or arguments out of range.

    References
    ----------
    Dellnitz, Hohmann, in *Nonlinear Dynamical Systems and Chaos* (1996) 449.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> saddle = discrete_map(lambda x, p: (2 * x[0], x[1] / 4), {}, ("x", "y"))
    >>> axis = unstable_set(saddle, [0.0, 0.0], CellGrid((-1, -1), (1.1, 1.1), (64, 64)))
    >>> axis.contains([[0.7, 0.0], [-1.0, 0.0], [0.0, 0.2]])
    array([ True,  True, False])
    """
    boxes = boxes_around(point_map, points, BoxSet(grid.on(point_map.coordinates), np.empty(0, np.int64)))
    return forward_closure(boxes, point_map, samples, periods, max_iterations)


@checked
def stable_set(
    point_map: PointMap,
    points: ArrayLike,
    region: CellGrid | BoxSet,
    depth: Depth,
    samples: Samples = "adaptive",
    periods: int = 1,
) -> BoxSet:
    """Compute a covering of the stable manifold of an invariant set by subdivision, without the inverse of the map.

    Boxes are bisected, one axis after the other, and those from which no chain of boxes leads to the set are discarded.

    Parameters
    ----------
    point_map : PointMap
        The map; it need not be invertible.
    points : array_like, shape (..., dimension)
        Points of the set, as for :func:`unstable_set`.
    region : CellGrid or BoxSet
        Initial covering: the cells of a window, or boxes.
    depth : int or sequence of int
        Number of bisections of each axis.
    samples : int or "adaptive", optional
        Sample points in a box, as for :func:`box_image`.
    periods : int, optional
        Number of iterates of the map that are taken as one step.

    Returns
    -------
    BoxSet
        Boxes that cover the initial conditions whose orbits converge to the set without leaving the window; for an
        attractor, its basin.

    Raises
    ------
    TypeError, ValueError
        For points outside the window, or arguments out of range.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> saddle = discrete_map(lambda x, p: (4 * x[0], x[1] / 2), {}, ("x", "y"))
    >>> axis = stable_set(saddle, [0.0, 0.0], CellGrid((-1, -1), (1.1, 1.1), (1, 1)), depth=6)
    >>> axis.contains([[0.0, 0.7], [0.0, -1.0], [0.2, 0.0]])
    array([ True,  True, False])
    """
    boxes = boxes_to_begin_with(point_map, region)
    for axis in bisections(depth, boxes.grid):
        boxes = boxes.subdivided(axis)
        goal = boxes_around(point_map, points, boxes)
        boxes |= goal
        links = box_transitions(boxes, point_map, samples, periods)
        boxes = boxes.chosen(_leading_to(links, boxes.indices(goal.keys)))
    return boxes


def forward_closure(
    boxes: BoxSet, point_map: PointMap, samples: Samples = "adaptive", steps: int = 1, max_rounds: int | None = None
) -> BoxSet:
    """Return a set with all boxes of the window that chains of images lead to."""
    rounds = 2**62 if max_rounds is None else whole_number("max_iterations", max_rounds)
    fresh = boxes
    while len(fresh) and rounds:
        fresh = box_image(fresh, point_map, samples, steps) - boxes
        boxes |= fresh
        rounds -= 1
    logging.getLogger("cellmap").info("forward closure: %s", boxes)
    return boxes


def boxes_around(point_map: PointMap, points: ArrayLike, boxes: BoxSet) -> BoxSet:
    """Return the boxes of a grid that hold points, with those that touch them: a manifold may leave on any side."""
    places = state_points("points", points, point_map.coordinates)
    held = BoxSet.of_points(boxes.grid, places)
    if not places.size or (boxes.grid.locate(places) < 0).any():
        raise ValueError(
            f"points={np.asarray(points).tolist()!r}: give at least one point, all in the region of the grid"
        )
    return held | held.neighbours()


def _leading_to(links: csr_array, goal: Ints) -> Bools:
    """Return which nodes chains lead from to a goal, the goal among them."""
    back = links.T.tocsr()
    reached = np.zeros(links.shape[0], bool)
    reached[goal] = True
    now = goal
    while len(now):
        now = np.unique(back[now].indices)
        now = now[~reached[now]]
        reached[now] = True
    return reached
