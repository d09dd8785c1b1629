"""Morse graphs: components of the chain recurrent set, the connections between them, and the attractors in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

from .._lib.arrays import Bools, Floats, Ints, evenly
from .._lib.checks import whole_number
from .._lib.signatures import checked
from ..attractors.search import find_attractors
from ..maps.coordinates import Coordinate
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor
from .box_images import Samples, box_transitions
from .box_set import BoxSet
from .invariant_sets import Depth, chain_recurrent_set, forward_closure
from .markov import recurrent_parts


@dataclass(frozen=True, eq=False)
class MorseGraph:
    """Morse graph: Morse sets and their partial order.

    Parameters
    ----------
    sets : tuple of BoxSet
        Morse sets: boxes that are connected in both directions by chains of boxes that intersect or touch.  Each set
        precedes those that can be reached from it.
    reaches : ndarray of bool, shape (m, m)
        Whether a chain of boxes leads from one set (row) to another (column).
    coordinates : tuple of Coordinate
        State variables.
    """

    sets: tuple[BoxSet, ...]
    reaches: Bools
    coordinates: tuple[Coordinate, ...]

    def __repr__(self) -> str:
        return f"MorseGraph({len(self.sets)} sets, {len(self.sinks)} of them attracting, {len(self.edges)} edges)"

    @property
    def edges(self) -> Ints:
        """Edges of the transitive reduction, shape (n, 2): pairs with a direct connection from first to second."""
        paths = self.reaches.astype(np.int64)
        return np.argwhere(self.reaches & ~(paths @ paths > 0))

    @property
    def sinks(self) -> tuple[int, ...]:
        """Sets from which no other set can be reached: each contains an attractor, or orbits escape from it."""
        return tuple(np.flatnonzero(~self.reaches.any(axis=1)).tolist())


@checked
def morse_graph(
    point_map: PointMap, region: CellGrid | BoxSet, depth: Depth, samples: Samples = "adaptive", periods: int = 1
) -> MorseGraph:
    """Compute the Morse graph of a map in a window, at the resolution of the boxes.

    The chain recurrent set is found by subdivision; it is mapped until its images add no new boxes, and the strongly
    connected components of these boxes are the Morse sets.  Components that touch count as one: beside a fixed point
    that repels by a factor below two, a box intersects its own image although no orbit returns to it.

    Parameters
    ----------
    point_map : PointMap
        The map.
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
    MorseGraph
        The sets and their order.  Boxes that are too large merge sets; smaller ones separate them.

    References
    ----------
    Arai, Kalies, Kokubu, Mischaikow, Oka, Pilarczyk, SIAM Journal on Applied Dynamical Systems 8 (2009) 757.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - x[0]**3 / 2,), {}, ("x",))
    >>> graph = morse_graph(cubic, CellGrid((-1.7,), (1.6,), (1,)), depth=10)
    >>> graph, graph.edges.tolist()
    (MorseGraph(3 sets, 2 of them attracting, 2 edges), [[0, 1], [0, 2]])
    """
    recurrent = chain_recurrent_set(point_map, region, depth, samples, periods)
    boxes = forward_closure(recurrent, point_map, samples, periods)
    graph = box_transitions(boxes, point_map, samples, periods)
    graph = graph + _touching(boxes, recurrent_parts(graph) >= 0)
    parts = recurrent_parts(graph)
    reaches = _reaches(graph, parts)
    order = np.lexsort((np.arange(len(reaches)), -reaches.sum(axis=1)))
    return MorseGraph(
        sets=tuple(boxes.chosen(parts == k) for k in order),
        reaches=reaches[np.ix_(order, order)],
        coordinates=point_map.coordinates,
    )


def _touching(boxes: BoxSet, which: Bools) -> csr_array:
    """Return links, both ways, between boxes that touch and are both marked."""
    first, second = boxes.touching()
    both = which[first] & which[second]
    links = (np.ones(np.count_nonzero(both), np.int64), (first[both], second[both]))
    return csr_array(links, shape=(len(boxes), len(boxes)))


def _reaches(graph: csr_array, parts: Ints) -> Bools:
    """Return from which part chains lead to which other one."""
    count = int(parts.max(initial=-1)) + 1
    reaches = np.zeros((count, count), bool)
    _, first = np.unique(parts, return_index=True)
    for k, node in enumerate(first[-count:] if count else ()):
        met = parts[breadth_first_order(graph, node, return_predecessors=False)]
        reaches[k, met[met >= 0]] = True
    np.fill_diagonal(reaches, False)
    return reaches


@dataclass(frozen=True, eq=False)
class SubdivisionSearch:
    """Attractors and Morse sets in a window, found by subdivision.

    Parameters
    ----------
    attractors : tuple of Attractor
        Attractors, for :func:`find_basins`.
    graph : MorseGraph
        The Morse sets, which cover all recurrent dynamics.
    holders : tuple of tuple of int
        For each Morse set, the attractors with points in it.
    """

    attractors: tuple[Attractor, ...]
    graph: MorseGraph
    holders: tuple[tuple[int, ...], ...]

    def __repr__(self) -> str:
        return f"SubdivisionSearch({len(self.attractors)} attractors, {len(self.saddles)} Morse sets without one)"

    @property
    def saddles(self) -> tuple[BoxSet, ...]:
        """Morse sets without an attractor: saddles and repellers, chaotic or not."""
        return tuple(boxes for boxes, held in zip(self.graph.sets, self.holders, strict=True) if not held)


@checked
def find_attractors_by_subdivision(
    point_map: PointMap,
    region: CellGrid | BoxSet,
    depth: Depth,
    samples: Samples = "adaptive",
    periods: int = 1,
    max_periods: int = 2000,
    longest_period: int = 32,
    max_initial_conditions: int = 4096,
) -> SubdivisionSearch:
    """Find the attractors in a window from a covering of its recurrent sets by boxes.

    The Morse graph is computed by subdivision, which refines boxes only around recurrent sets; orbits from the boxes of
    each Morse set are then passed to :func:`find_attractors`.  This finds attractors whose basins are too small for a
    grid of initial conditions, in three and four dimensions too, unless the map varies so much in a box that its sample
    points miss them.  A basin image follows from ``find_basins(interpolated, grid, attractors=found.attractors)``.

    Parameters
    ----------
    point_map : PointMap
        The map.
    region : CellGrid or BoxSet
        Initial covering: the cells of a window, or boxes.
    depth : int or sequence of int
        Number of bisections of each axis.
    samples : int or "adaptive", optional
        Sample points in a box, as for :func:`box_image`.
    periods : int, optional
        Number of iterates of the map that are taken as one step of the boxes.
    max_periods, longest_period : int, optional
        Longest orbit, and longest period of an attractor, as for :func:`find_attractors`.
    max_initial_conditions : int, optional
        Largest number of initial conditions in a Morse set, evenly distributed over its boxes.

    Returns
    -------
    SubdivisionSearch
        Attractors, Morse sets, and the attractors in each Morse set.

    References
    ----------
    Xiong, Qin, Ding, Hernandez, Fernandez, Schütze, Sun, Journal of Applied Mechanics 82 (2015) 111010, on coarse cells
    first and subdivision where they find something.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> cubic = discrete_map(lambda x, p: (1.5 * x[0] - x[0]**3 / 2,), {}, ("x",))
    >>> found = find_attractors_by_subdivision(cubic, CellGrid((-1.7,), (1.6,), (1,)), depth=8)
    >>> found, sorted(float(a.points[0, 0].round(9)) for a in found.attractors)
    (SubdivisionSearch(2 attractors, 1 Morse sets without one), [-1.0, 1.0])
    """
    most = whole_number("max_initial_conditions", max_initial_conditions, at_least=1)
    graph = morse_graph(point_map, region, depth, samples, periods)
    if not graph.sets:
        return SubdivisionSearch((), graph, ())
    initial_conditions = np.concatenate([_spread(boxes, most) for boxes in graph.sets])
    attractors = find_attractors(point_map, initial_conditions, max_periods, longest_period)
    holders = tuple(
        tuple(k for k, a in enumerate(attractors) if boxes.contains(a.points).any()) for boxes in graph.sets
    )
    return SubdivisionSearch(attractors, graph, holders)


def _spread(boxes: BoxSet, most: int) -> Floats:
    """Return the centres of boxes, or of some of them at even distances in their order."""
    chosen = evenly(len(boxes), most)
    return BoxSet(boxes.grid, boxes.keys[chosen]).centres()
