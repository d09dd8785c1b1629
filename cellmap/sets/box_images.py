"""Images of boxes and cells under a map, from the images of sample points."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.sparse import csr_array

from .._compiled.kernels.box_images import points_of_cells, tally_rows
from .._lib.arrays import Floats, Ints
from .._lib.checks import claim_memory, warn_caller, whole_number
from .._lib.signatures import checked
from .._lib.threads import run_over, slices
from ..attractors.settling.labels import Label
from ..maps.coordinates import difference, turns_of, wrap
from ..maps.grid import CellGrid, Locator, between, grid_points
from ..maps.orbit_batch import CHUNK, Orbits, Status
from ..maps.point_map import PointMap, ToleranceWarning, remedy_for_missed
from ..orbits.exponent_fields import growth
from .box_set import BoxSet, finer

Samples = int | Literal["adaptive"]
"""Sampling of boxes: a number of points along each axis, or adaptive."""

LEFT, DIVERGED = int(Label.ESCAPED), int(Label.DIVERGED)
"""Sink cells for images outside the window, and for images that do not exist.

An image does not exist where the orbit diverges or does not return to the Poincaré section of a map.
"""

Kick = Callable[[int], Floats]
"""Returns the noise that is added to n points in one period, shape (n, dimension)."""

_BATCH = 1024  # boxes in a slice of adaptive work
_FEWEST = 3  # points along an axis of an adaptive lattice: the middle tells a fold that the ends cannot
_MOST = CHUNK // 4  # points of an adaptive lattice
_CLAIMED = 16  # boxes that the image of a box is taken to meet when memory is claimed


@dataclass(frozen=True, eq=False)
class Hits:
    """Which cells some boxes meet: ``rows`` of the boxes, ``targets`` that each meets, how often, and points lost."""

    rows: Ints
    targets: Ints
    counts: Ints
    lost: Ints


@checked
def box_image(boxes: BoxSet, point_map: PointMap, samples: Samples = "adaptive", periods: int = 1) -> BoxSet:
    """Return the boxes that the image of a set of boxes intersects.

    Parameters
    ----------
    boxes : BoxSet
        The set.
    point_map : PointMap
        The map.
    samples : int or "adaptive", optional
        A number n: a box is sampled by the n**dimension centres of its equal parts; boxes that its image intersects
        only at an edge may be missed.  "adaptive": the lattice of centres is refined until the images of neighbours are
        closer than the width of a box, and each image covers half the distance to its neighbours.  This misses only
        folds of the map between lattice points, and includes some boxes that are near the image.
    periods : int, optional
        Steps of the map.

    Returns
    -------
    BoxSet
        Boxes of the same grid.

    Raises
    ------
    TypeError, ValueError
        For a map of another dimension, or other arguments out of range.

    References
    ----------
    Dellnitz, Hohmann, Numerische Mathematik 75 (1997) 293; Junge, *Mengenorientierte Methoden zur numerischen
    Untersuchung dynamischer Systeme* (1999), on the choice of points.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> half = discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",))
    >>> box_image(BoxSet.full(CellGrid((0,), (1,), (8,))), half, samples=2)
    BoxSet(4 of 8 boxes)
    """
    found = [hits.targets for hits in _hits(boxes, point_map, samples, periods)]
    return BoxSet(boxes.grid, _distinct(np.concatenate([np.empty(0, np.int64), *found]), boxes.grid.size))


@checked
def box_transitions(boxes: BoxSet, point_map: PointMap, samples: Samples = "adaptive", periods: int = 1) -> csr_array:
    """Return the transition graph of a set of boxes, on which set-oriented methods are based.

    Parameters
    ----------
    boxes : BoxSet
        The set, of n boxes.
    point_map, samples, steps
        As for :func:`box_image`.

    Returns
    -------
    csr_array of int64, shape (n, n)
        Number of sample points of box i (row) that are mapped into box j (column); points that leave the set are not
        counted.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> double = discrete_map(lambda x, p: (2 * x[0] % 1,), {}, ("x",))
    >>> box_transitions(BoxSet.full(CellGrid((0,), (1,), (4,))), double, samples=4).toarray()
    array([[2, 2, 0, 0],
           [0, 0, 2, 2],
           [2, 2, 0, 0],
           [0, 0, 2, 2]])
    """
    n = len(boxes)
    claim_memory(f"transitions of {n:,} boxes", 20 * _CLAIMED * n, "take fewer boxes")
    rows, columns, counts = [np.empty(0, np.int64)], [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for hits in _hits(boxes, point_map, samples, periods):
        places = boxes.indices(hits.targets)
        kept = places >= 0
        rows.append(hits.rows[kept])
        columns.append(places[kept])
        counts.append(hits.counts[kept])
    entries = (np.concatenate(counts), (np.concatenate(rows), np.concatenate(columns)))
    return csr_array(entries, shape=(n, n), dtype=np.int64)


def _distinct(keys: Ints, cells: int) -> Ints:
    """Return each of some numbers below `cells` once, by marking them, where there are few to choose from."""
    if cells > 8 * len(keys):
        return keys
    marks = np.zeros(cells, bool)
    marks[keys] = True
    return np.flatnonzero(marks)


def points_in(samples: Samples, dimension: int) -> int:
    """Return how many points there are in a box for a number along each axis."""
    return int(whole_number("samples", samples, at_least=1, at_most=int(CHUNK ** (1 / dimension)))) ** dimension


def _hits(boxes: BoxSet, point_map: PointMap, samples: Samples, steps: int) -> list[Hits]:
    """Return the boxes that images meet, slice after slice, rows numbered through."""
    check_boxes(boxes, point_map)
    steps = whole_number("periods", steps, at_least=1)
    adaptive = isinstance(samples, str)
    if adaptive and samples != "adaptive":
        raise ValueError(f"samples={samples!r}: give a number of points along each axis, or 'adaptive'")
    size = _BATCH if adaptive else max(1, CHUNK // points_in(samples, boxes.grid.dimension))
    parts = slices(len(boxes), size)
    work = _Work(point_map, boxes, Locator.of(boxes.grid, point_map.coordinates), steps)
    return run_over(parts, work.adaptive if adaptive else lambda part: work.regular(part, int(samples)))


def check_boxes(boxes: BoxSet, point_map: PointMap) -> None:
    """Refuse boxes that are not in the space of the map."""
    if boxes.grid.on(point_map.coordinates, "boxes") != boxes.grid:
        raise ValueError(
            f"boxes do not wrap as the angles of {point_map!r} do: give them grid.on(point_map.coordinates)"
        )


@dataclass(frozen=True, eq=False)
class _Work:
    """Images of the boxes of a set, slice by slice."""

    point_map: PointMap
    boxes: BoxSet
    locate: Locator
    steps: int

    def regular(self, part: slice, samples: int) -> Hits:
        """Return the boxes that the images of the middles of equal parts of boxes hit."""
        d = self.boxes.grid.dimension
        lattice = middles((samples,) * d)
        images = self._images(self.boxes.keys[part], lattice)
        return tallied(self.locate(images), np.arange(part.start, part.stop), len(lattice))

    def adaptive(self, part: slice) -> Hits:
        """Return the boxes that images meet, with lattices as fine as the distances of the images ask for."""
        keys, d = self.boxes.keys[part], self.boxes.grid.dimension
        found = []
        waiting = {(_FEWEST,) * d: np.arange(len(keys))}
        while waiting:
            counts, rows = waiting.popitem()
            finer: dict[tuple[int, ...], list[Ints]] = {}
            lattice = middles(counts)
            for some in slices(len(rows), max(1, CHUNK // len(lattice))):
                mine = rows[some]
                images = self._images(keys[mine], lattice).reshape(len(mine), *counts, -1)
                wider, reach = self._gaps(images)
                more = self._refined(counts, wider, reach)
                for new in np.unique(more, axis=0).tolist() if len(more) else ():
                    if tuple(new) != counts:
                        finer.setdefault(tuple(new), []).append(mine[(more == new).all(axis=1)])
                done = (more == counts).all(axis=1)
                found.append(self._covered(images[done], reach[done], part.start + mine[done]))
            for new_counts, more_rows in finer.items():
                waiting[new_counts] = np.concatenate([waiting.get(new_counts, rows[:0]), *more_rows])
        return Hits(
            *(np.concatenate([getattr(f, name) for f in found]) for name in ("rows", "targets", "counts", "lost"))
        )

    def _images(self, keys: Ints, lattice: Floats) -> Floats:
        """Return the images of points (n, d) in widths of a box from the centre of each, shape (boxes * n, d)."""
        where = self.locate
        points = np.empty((len(keys) * len(lattice), lattice.shape[1]))
        points_of_cells(keys, where.shape, where.lower, where.upper, where.widths, lattice, points)
        orbits = Orbits.starting(points)
        lower, turn = turns_of(self.point_map.coordinates)
        orbits.wrap(lower, turn)
        for part in slices(len(points), CHUNK):
            self.point_map.advance(orbits[part], self.steps)
        return points

    def _gaps(self, images: Floats) -> tuple[Floats, Floats]:
        """Return the widest gap between images along each axis of the lattices, and how far points have to reach.

        Gaps are in widths of a box, the widest of all components, shape (boxes, d); reaches are lengths.
        """
        b, d = len(images), images.shape[-1]
        widths = self.boxes.grid.widths
        wider, reach = np.zeros((b, d)), np.zeros((b, d))
        for j in range(d):
            along = np.moveaxis(images, j + 1, 1)
            apart = np.abs(difference(along[:, 1:], along[:, :-1], self.point_map.coordinates))
            widest = np.nan_to_num(apart).max(axis=tuple(range(1, d + 1)))
            wider[:, j] = (widest / widths).max(axis=1)
            reach += 0.5 * widest
        return wider, reach

    def _refined(self, counts: tuple[int, ...], wider: Floats, reach: Floats) -> Ints:
        """Return the points along each axis that lattices with such gaps need, shape (boxes, d)."""
        d = len(counts)
        close = (reach <= 0.5 * self.locate.widths).all(axis=1, keepdims=True)
        wanted = np.where(close, 1.0, np.maximum(wider * d - 1e-9, 1.0))
        more = np.array(counts) * 2.0 ** np.ceil(np.log2(wanted))
        # Too many for a box: axis by axis, the longest gives way, but never to less than there is.
        while (over := more.prod(axis=1) > _MOST).any():
            spare = np.where(more > counts, more, 0.0)
            rows = np.flatnonzero(over & (spare.max(axis=1) > 0.0))
            if not len(rows):
                break
            more[rows, np.argmax(spare[rows], axis=1)] /= 2.0
        return more.astype(np.int64)

    def _covered(self, images: Floats, reach: Floats, rows: Ints) -> Hits:
        """Return the cells within reach of points, which is no more than half a cell."""
        d = images.shape[-1]
        ends = np.array(list(itertools.product((-1.0, 1.0), repeat=d)))
        reach = np.minimum(reach, 0.5 * self.locate.widths)
        points = images.reshape(len(images), int(np.prod(images.shape[1:-1])), 1, d) + ends * reach[:, None, None, :]
        return tallied(self.locate(points.reshape(-1, d)), rows, points.shape[1] * len(ends))


def tallied(keys: Ints, rows: Ints, points: int) -> Hits:
    """Count the cells that equally many points of each box lie in."""
    begins = np.arange(len(rows) + 1) * points
    which, targets, counts = (np.empty(len(keys), np.int64) for _ in range(3))
    lost = np.empty(len(rows), np.int64)
    n = tally_rows(keys, begins, which, targets, counts, lost)
    return Hits(rows[which[:n]], targets[:n].copy(), counts[:n].copy(), lost)


def middles(counts: tuple[int, ...]) -> Floats:
    """Return the middles of the equal parts of a unit cube around 0, shape (product of the counts, d)."""
    axes = [between(-0.5, 0.5, n, np.arange(n) + 0.5) for n in counts]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


@checked
def box_ftle(boxes: BoxSet, point_map: PointMap, periods: int = 10) -> Floats:
    r"""Compute the finite-time Lyapunov exponent of the centre of each box.

    It is :math:`\frac{1}{n} \ln \sigma_1(D P^n)` at the centre, after n periods.

    It is the logarithm of the largest singular value of the derivative of `periods` steps, divided by their number, as
    in :func:`finite_time_exponents` for whole grids; here only the boxes of the set are evaluated.

    Parameters
    ----------
    boxes : BoxSet
        Boxes at whose centres the exponent is computed.
    point_map : PointMap
        Stroboscopic or discrete map, in any dimension; for an interpolated map, its exact map is used.
    periods : int, optional
        Steps of the map, at least 1.

    Returns
    -------
    ndarray, shape (n,)
        Exponents per step of the map; NaN where the orbit terminated.

    References
    ----------
    Haller, Physica D 149 (2001) 248; Padberg, Thiere, Preis, Dellnitz, Communications in Nonlinear Science and
    Numerical Simulation 14 (2009) 4176.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> saddle = discrete_map(lambda x, p: (2 * x[0], x[1] / 4), {}, ("x", "y"))
    >>> boxes = BoxSet.of_points(CellGrid((-1, -1), (1, 1), (8, 8)), [[0.1, 0.1], [0.3, 0.9]])
    >>> (box_ftle(boxes, saddle) / np.log(2.0)).round(12).tolist()
    [1.0, 1.0]
    """
    check_boxes(boxes, point_map)
    periods = whole_number("periods", periods, at_least=1)
    exact = point_map.without_table
    claim_memory(f"exponents of {len(boxes):,} boxes", 8 * (2 * boxes.grid.dimension + 1) * len(boxes), "take fewer")
    initial_conditions, exponents = wrap(boxes.centres(), exact.coordinates), np.empty(len(boxes))

    def work(part: slice) -> None:
        exponents[part] = growth(exact, initial_conditions[part], periods)[0]

    run_over(slices(len(boxes), CHUNK // 16), work)
    return exponents / periods


def bisections(depth: int | Sequence[int], grid: CellGrid) -> list[int]:
    """Return the axes to bisect, one after the other in turn, until each cell has been cut as often as asked for."""
    depths = list(depth) if isinstance(depth, Sequence) else [depth] * grid.dimension
    if len(depths) != grid.dimension:
        raise ValueError(f"depth={depth!r}: give one number, or one for each of the {grid.dimension} coordinates")
    depths = [whole_number("depth", n, at_most=60) for n in depths]
    finer(grid, [n << k for n, k in zip(grid.shape, depths, strict=True)], f"depth={depth!r}")
    return [j for k in range(max(depths)) for j, n in enumerate(depths) if k < n]


def centres_of(grid: CellGrid, cells: Ints) -> Floats:
    """Return the centres of some cells, shape (n, dimension)."""
    return grid_points([grid.axis(j) for j in range(grid.dimension)], cells)


def images_of(point_map: PointMap, points: Floats, periods: int, kick: Kick | None = None) -> Orbits:
    """Return points (n, dimension) after some periods, and after noise has acted in each of them."""
    orbits = Orbits.starting(wrap(points, point_map.coordinates))
    if kick is None:
        point_map.advance(orbits, periods)
        return orbits
    for _ in range(periods):
        point_map.advance(orbits, 1)
        orbits.points = wrap(orbits.points + kick(len(orbits)), point_map.coordinates)
    return orbits


def cells_of(point_map: PointMap, grid: CellGrid, orbits: Orbits) -> Ints:
    """Return the flat numbers of the cells in which orbits are, LEFT or DIVERGED for those in none."""
    cells = Locator.of(grid, point_map.coordinates)(orbits.points)
    return np.where(orbits.status >= Status.DIVERGED, DIVERGED, cells)


def warn_of_inaccurate(missed: int, total: int, diverge: bool = False) -> None:
    """Warn where the integrator missed its tolerance for some points; others may `diverge`."""
    if missed:
        warn_caller(
            f"the integrator missed its tolerance for {missed} of {total} points; {remedy_for_missed(diverge)}",
            ToleranceWarning,
        )
