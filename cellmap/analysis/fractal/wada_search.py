"""Grid method for Wada basins: search for further basins between any two neighbouring ones (Daza et al. 2015)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._lib.arrays import Bools, Floats, Ints, evenly
from ..._lib.checks import finite_number, whole_number
from ..._lib.signatures import checked
from ..._lib.threads import slices
from ...basins.classification import Outcome
from ...basins.final_states import FinalStates, final_states
from ...basins.finding import find_basins
from ...basins.record import Basins
from ...maps.grid import CellGrid, grid_points
from ...maps.orbit_batch import CHUNK, Cost
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor
from .label_images import NO_BASIN, LabelImage, included_labels, label_image
from .wada import NOT, PART, PARTIALLY, WADA

_FEWEST = 50  # boxes on the boundary below which basins are not called Wada
_CENTRES = 64 * CHUNK  # centres of boxes that are labelled together
_CLOSER = 8  # halvings of a segment before it is looked at again
_SAMPLE = 400  # boxes that are examined again
_AGREEING = 0.9  # fraction of these in which all basins must be found again


@dataclass(frozen=True, eq=False)
class WadaGrid:
    """Grid method for Wada basins: boundary boxes by the number of basins found around them, step by step.

    Parameters
    ----------
    basins : tuple of int
        Labels of the basins.
    boxes : ndarray of int, shape (steps + 1, k + 1)
        Number of boxes with m basins in column m, before the first step and after each.
    points : ndarray of int, shape (steps + 1,)
        Number of initial conditions labelled in each step.
    colours : ndarray of int8, shape of the grid
        Number of basins found around each box; 1 inside a basin, 0 for boxes without one.
    closer : ndarray of int, shape (k + 1,)
        Number of boxes with m basins in column m, of a sample that was examined again on segments 256 times shorter.
    tolerance : float
        Fraction of the boundary boxes that may lack a basin.
    region : CellGrid
        The boxes.
    attractors : tuple of Attractor
        Attractors whose basins were distinguished.
    cost : Cost
        Wall time and number of initial conditions.
    name : str
        Name of the system.
    """

    basins: tuple[int, ...]
    boxes: Ints
    points: Ints
    colours: NDArray[np.int8]
    closer: Ints
    tolerance: float
    region: CellGrid
    attractors: tuple[Attractor, ...] = ()
    cost: Cost = Cost()
    name: str = ""

    def __repr__(self) -> str:
        return (
            f"WadaGrid({self.verdict}: {len(self.basins)} basins, {self.boundary} boxes on the boundary, "
            f"{100 * self.fractions[-1, -1]:.4g} % with all after {len(self.points) - 1} steps)"
        )

    @property
    def boundary(self) -> int:
        """Number of boundary boxes."""
        return int(self.boxes[-1, 2:].sum())

    @property
    def fractions(self) -> Floats:
        """Fraction of the boundary boxes with m basins in column m, for each step; shape (steps + 1, k + 1)."""
        ratios = self.boxes / max(self.boundary, 1)
        ratios[:, :2] = 0.0
        return np.asarray(ratios)

    @property
    def verdict(self) -> str:
        """Verdict on the basins: "Wada", "partially" Wada or "not" Wada.

        Wada: three basins or more, and all of them were found around each box on the boundary, but for the tolerance;
        with fewer than 50 such boxes the verdict is never Wada.  Partially: at least a tenth of these boxes have three
        basins or more.  Both have to hold also on segments that are 256 times shorter (with all basins, for nine in ten
        of them): smooth basins as narrow as the boxes lie around each box, but not on such segments.  Two basins are
        not Wada.
        """
        if len(self.basins) < 3 or self.boundary < _FEWEST:
            return NOT
        again = self.closer / max(self.closer.sum(), 1)
        if self.fractions[-1, -1] >= 1.0 - self.tolerance and again[-1] >= _AGREEING:
            return WADA
        return PARTIALLY if min(self.fractions[-1, 3:].sum(), again[3:].sum()) >= PART else NOT


@checked
def wada_grid(
    source: Basins | PointMap,
    region: CellGrid | None = None,
    attractors: Sequence[Attractor] = (),
    outcome: Outcome | None = None,
    include: Sequence[int] = (),
    refinements: int = 10,
    tolerance: float = 0.01,
    max_points: int = 2_000_000,
    max_periods: int = 2000,
) -> WadaGrid:
    r"""Test basins for the Wada property by the grid method, with the map.

    Basins are Wada if :math:`W_k = \frac{N_k}{N_2 + \dots + N_k} \to 1` as steps become finer, where :math:`N_m` boxes
    have m of the k basins around them.

    The colour of a box is the basin of its centre.  A boundary box has a neighbour (across sides and corners) of
    another colour; the colours of all its neighbours count as found.  As long as some colours are missing, the segment
    from its centre to the nearest neighbour of another colour is sampled in ever finer steps: its midpoint, then its
    quarters, and so on.  On a Wada boundary all other colours are found eventually.  At the end, a sample of these
    segments is halved towards the boundary eight times, and sampled in the same way.

    Parameters
    ----------
    source : Basins or PointMap
        Basins on a grid with their map, or a map.
    region : CellGrid, optional
        Boxes; by default the grid of the basins, whose labels are used.
    attractors : sequence of Attractor, optional
        Known attractors; by default those of the basins, otherwise they are searched for first.
    outcome : callable, optional
        Classification of final states instead of attractors, see :func:`uncertainty_exponent`.
    include : sequence of int, optional
        Negative labels that count as basins: (-2,) for initial conditions that diverge.  Initial conditions of any
        other negative label (escaped, diverged, undecided) have no colour, and do not make neighbouring boxes boundary
        boxes.
    refinements : int, optional
        Largest number of steps; the last one samples 2**(steps - 1) new points for each box that still lacks a colour.
    tolerance : float, optional
        Fraction of the boundary boxes that may lack a basin at the end.
    max_points : int, optional
        Budget of initial conditions besides the centres, and again for the shorter segments.
    max_periods : int, optional
        Number of periods after which an initial condition is undecided.

    Returns
    -------
    WadaGrid
        Numbers of boxes by number of basins for each step, and a verdict.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, or a region without basins.

    References
    ----------
    Daza, Wagemakers, Sanjuan, Yorke, Scientific Reports 5 (2015) 16579.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> signs = discrete_map(lambda x, p: (x[0] / 2 + 1 / (2 * x[0]), x[1] / 2), {}, ("x", "y"))
    >>> wada_grid(signs, CellGrid((-3, -1), (3, 1), (60, 60))).verdict
    'not'
    """
    began = time.perf_counter()
    counted = included_labels(include)
    refinements = whole_number("refinements", refinements, at_most=24)
    max_points = whole_number("max_points", max_points)
    tolerated = finite_number("tolerance", tolerance, at_least=0.0, at_most=0.5)
    states, labels = _centres(source, region, attractors, outcome, max_periods)
    image = label_image(labels, counted, states.region.wraps)
    look = _Look(states, image.names)
    seen, partner = _neighbourhoods(image)
    edge = np.flatnonzero(partner >= 0)
    inside = _tally(np.delete(seen, edge, axis=0))
    segments = _segments(states.region, edge, partner[edge])
    around = seen[edge]
    boxes, used = look.refine(around, *segments, refinements, max_points)
    seen[edge] = around
    sample = evenly(len(edge), _SAMPLE)
    begin, way = (a[sample] for a in segments)
    begin, way, ends, halved = look.halve(begin, way, image.numbers.ravel()[edge[sample]])
    closer, more = look.refine(ends, begin, way, refinements, max_points)
    return WadaGrid(
        image.names,
        np.array(boxes) + inside,
        np.array([image.numbers.size, *used]),
        seen.sum(axis=1).reshape(labels.shape).astype(np.int8),
        closer[-1],
        tolerated,
        states.region,
        states.attractors,
        Cost(time.perf_counter() - began, image.numbers.size + sum(used) + halved + sum(more)),
        states.point_map.name,
    )


def _centres(
    source: Basins | PointMap,
    region: CellGrid | None,
    attractors: Sequence[Attractor],
    outcome: Outcome | None,
    max_periods: int,
) -> tuple[FinalStates, NDArray[Any]]:
    """Return the labeller, and the labels of the centres of all boxes."""
    if isinstance(source, Basins) and region is None and outcome is None and source.grid is not None:
        return final_states(source, None, (), None, max_periods), source.labels
    states = final_states(source, region, attractors, outcome, max_periods)
    if outcome is not None:
        return states, _by_states(states)
    # All centres may find attractors that a coarser search has missed.
    basins = find_basins(states.point_map, states.region, max_periods, attractors=states.attractors)
    return final_states(basins, None, (), None, max_periods), basins.labels


def _by_states(states: FinalStates) -> Ints:
    """Label the centres of all boxes."""
    region = states.region
    axes = [region.axis(j) for j in range(region.dimension)]
    parts = slices(region.size, _CENTRES)
    labels = np.concatenate([states.label(grid_points(axes, part)) for part in parts])
    return labels.reshape(region.shape)


def _neighbourhoods(image: LabelImage) -> tuple[Bools, Ints]:
    """Return which basins are seen in and around each box (boxes, basins), and a neighbour of another colour.

    The neighbour, the nearest one, is given by the number of its step, see :func:`_steps_to_neighbours`; -1 if there is
    none.
    """
    numbers = image.numbers
    offsets = _steps_to_neighbours(numbers.ndim)
    seen = np.zeros((numbers.size, len(image.names)), bool)
    partner = np.full(numbers.size, -1, np.int64)
    coloured = (numbers != NO_BASIN).ravel()
    seen[np.flatnonzero(coloured), numbers.ravel()[coloured]] = True
    pads = [(1, 1)] * numbers.ndim
    around = np.pad(numbers, pads, constant_values=NO_BASIN)
    for axis, wraps in enumerate(image.wraps):
        if wraps:
            ends = np.moveaxis(around, axis, 0)
            ends[0], ends[-1] = ends[-2], ends[1]
    for k, offset in enumerate(offsets):
        part = tuple(slice(1 + o, 1 + o + n) for o, n in zip(offset, numbers.shape, strict=True))
        other = around[part].ravel()
        rows = np.flatnonzero(coloured & (other != NO_BASIN))
        seen[rows, other[rows]] = True
        differs = rows[(other[rows] != numbers.ravel()[rows]) & (partner[rows] < 0)]
        partner[differs] = k
    return seen, partner


def _steps_to_neighbours(dimension: int) -> Ints:
    """Return the steps to all neighbours, the nearest ones first."""
    steps = np.array([s for s in product((-1, 0, 1), repeat=dimension) if any(s)], np.int64)
    return steps[np.argsort((steps**2).sum(axis=1), kind="stable")]


def _segments(region: CellGrid, boxes: Ints, partner: Ints) -> tuple[Floats, Floats]:
    """Return the centres of boxes, and the ways from there to their neighbours."""
    wide = [j for j, n in enumerate(region.shape) if n > 1]
    ways = np.zeros((len(boxes), region.dimension))
    ways[:, wide] = _steps_to_neighbours(len(wide))[partner] * region.widths[wide]
    return grid_points([region.axis(j) for j in range(region.dimension)], boxes), ways


@dataclass(frozen=True, eq=False)
class _Look:
    """Colours of points: the labeller, and the labels of the basins."""

    states: FinalStates
    names: tuple[int, ...]

    def colours(self, points: Floats) -> Ints:
        """Return the number of the basin of each point (n, d), -1 for one without."""
        labels = self.states.label(points)
        names = np.array(self.names)
        place = np.minimum(np.searchsorted(names, labels), len(names) - 1)
        return np.where(names[place] == labels, place, NO_BASIN)

    def refine(self, seen: Bools, begin: Floats, way: Floats, steps: int, points: int) -> tuple[list[Ints], list[int]]:
        """Look at segments in ever finer steps, and mark (segments, basins) what is seen.

        Returns the numbers of segments by the number of their basins, before the first step and after each, and how
        many points each step took.
        """
        tallies, used = [_tally(seen)], list[int]()
        for step in range(1, steps + 1):
            lacking = np.flatnonzero(~seen.all(axis=1))
            fractions = np.arange(1, 2**step, 2) / 2**step
            used.append(len(lacking) * len(fractions))
            if not len(lacking) or sum(used) > points:
                return tallies, used[:-1]
            for part in slices(len(lacking), max(1, 64 * CHUNK // len(fractions))):
                rows = np.repeat(lacking[part], len(fractions))
                found = self.colours(begin[rows] + np.tile(fractions, len(lacking[part]))[:, None] * way[rows])
                seen[rows[found >= 0], found[found >= 0]] = True
            tallies.append(_tally(seen))
        return tallies, used

    def halve(self, begin: Floats, way: Floats, colour: NDArray[np.int16]) -> tuple[Floats, Floats, Bools, int]:
        """Halve segments that begin with a colour and end with another one, so that they still do.

        Returns the short segments, the colours of their ends, and the number of points looked at.  A segment with a
        middle that has no colour is left out.
        """
        last = self.colours(begin + way)
        kept = (last >= 0) & (last != colour)
        looked = len(begin)
        for _ in range(_CLOSER):
            begin, way, colour, last = begin[kept], way[kept] / 2.0, colour[kept], last[kept]
            middle = self.colours(begin + way)
            looked += len(begin)
            same = middle == colour
            begin = np.where(same[:, None], begin + way, begin)
            last = np.where(same, last, middle)
            kept = middle >= 0
        seen = np.zeros((len(begin), len(self.names)), bool)
        seen[np.arange(len(begin)), colour] = True
        seen[np.flatnonzero(kept), last[kept]] = True
        return begin[kept], way[kept], seen[kept], looked


def _tally(seen: Bools) -> Ints:
    """Count rows (rows, basins) by the number of basins that they know."""
    return np.bincount(seen.sum(axis=1), minlength=seen.shape[1] + 1)
