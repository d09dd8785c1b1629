"""Coverings of stable and unstable manifolds by boxes."""

from __future__ import annotations

import logging

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
from .invariant_sets import Depth, boxes_to_begin_with


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
