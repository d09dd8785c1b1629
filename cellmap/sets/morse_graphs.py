"""Morse graphs: the parts of the chain recurrent set, and which of them orbits lead from one to another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

from .._lib.signatures import checked
from ..maps.coordinates import Coordinate
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from .box_images import Samples, box_transitions
from .box_set import BoxSet
from .invariant_manifolds import forward_closure
from .invariant_sets import Depth, chain_recurrent_set, recurrent_parts


@dataclass(frozen=True, eq=False)
class MorseGraph:
    """Morse sets and the order that orbits give them.

    Parameters
    ----------
    sets : tuple of BoxSet
        Morse sets: boxes between any two of which chains of boxes that meet or touch lead both ways.  Each is before
        those that chains from it lead to.
    reaches : ndarray of bool, shape (m, m)
        Whether a chain of boxes leads from one set to another.
    coordinates : tuple of Coordinate
        State variables.
    """

    sets: tuple[BoxSet, ...]
    reaches: NDArray[np.bool_]
    coordinates: tuple[Coordinate, ...]

    def __repr__(self) -> str:
        return f"MorseGraph({len(self.sets)} sets, {len(self.sinks)} of them attracting, {len(self.edges)} edges)"

    @property
    def edges(self) -> NDArray[np.int64]:
        """Pairs of sets with a chain from the first to the second that need not pass through a third, shape (n, 2)."""
        paths = self.reaches.astype(np.int64)
        return np.argwhere(self.reaches & ~(paths @ paths > 0))

    @property
    def sinks(self) -> tuple[int, ...]:
        """Sets that no chain leaves for another set: each holds an attractor, or orbits leave the window from it."""
        return tuple(np.flatnonzero(~self.reaches.any(axis=1)).tolist())


@checked
def morse_graph(
    point_map: PointMap, window: CellGrid | BoxSet, depth: Depth, samples: Samples = "adaptive", steps: int = 1
) -> MorseGraph:
    """Return the Morse graph of a map in a window, at the resolution of the boxes.

    The chain recurrent set is found by subdivision; from it images are followed until they bring no new boxes, and the
    strongly connected parts of these boxes are the Morse sets.  Parts that touch count as one: beside a fixed point
    that repels by a factor below two, a box meets its own image although no orbit comes back to it.

    Parameters
    ----------
    point_map : PointMap
        The map.
    window : CellGrid or BoxSet
        The window in the cells, or the boxes, to begin with.
    depth : int or sequence of int
        Bisections of each axis.
    samples : int or "adaptive", optional
        Points in a box, as for :func:`box_image`.
    steps : int, optional
        Steps of the map at a time.

    Returns
    -------
    MorseGraph
        The sets and their order.  Boxes too large merge sets; finer ones part them.

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
    recurrent = chain_recurrent_set(point_map, window, depth, samples, steps)
    boxes = forward_closure(recurrent, point_map, samples, steps)
    graph = box_transitions(boxes, point_map, samples, steps)
    graph = graph + _touching(boxes, recurrent_parts(graph) >= 0)
    parts = recurrent_parts(graph)
    reaches = _reaches(graph, parts)
    order = np.lexsort((np.arange(len(reaches)), -reaches.sum(axis=1)))
    return MorseGraph(
        sets=tuple(boxes.chosen(parts == k) for k in order),
        reaches=reaches[np.ix_(order, order)],
        coordinates=point_map.coordinates,
    )


def _touching(boxes: BoxSet, which: NDArray[np.bool_]) -> csr_array:
    """Return links, both ways, between boxes that touch and are both marked."""
    first, second = boxes.touching()
    both = which[first] & which[second]
    links = (np.ones(np.count_nonzero(both), np.int64), (first[both], second[both]))
    return csr_array(links, shape=(len(boxes), len(boxes)))


def _reaches(graph: csr_array, parts: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tell from which part chains lead to which other one."""
    count = int(parts.max(initial=-1)) + 1
    reaches = np.zeros((count, count), bool)
    _, first = np.unique(parts, return_index=True)
    for k, node in enumerate(first[-count:] if count else ()):
        met = parts[breadth_first_order(graph, node, return_predecessors=False)]
        reaches[k, met[met >= 0]] = True
    np.fill_diagonal(reaches, False)
    return reaches
