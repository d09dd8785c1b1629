"""Attractors by subdivision: boxes cover the recurrent sets, exact orbits from them identify attractors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._lib.arrays import Floats
from .._lib.checks import whole_number
from .._lib.signatures import checked
from ..attractors.search import find_attractors
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor
from .box_images import Samples
from .box_set import BoxSet
from .invariant_sets import Depth
from .morse_graphs import MorseGraph, morse_graph


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
    chosen = np.unique(np.linspace(0, len(boxes) - 1, min(most, len(boxes))).round().astype(np.int64))
    return BoxSet(boxes.grid, boxes.keys[chosen]).centres()
