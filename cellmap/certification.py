"""Pictures whose every label is either shown to stand against the table's errors or made again without the table."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .attractor import Cover
from .basins import Basins, Verification
from .checks import claim_memory, finite_number, whole_number
from .coordinates import turns_of, wrap
from .grid import CellGrid, grid_points
from .kernels.certainty import NONE, carry_rows, claim_within, judge, reach_ends, widening
from .pointmap import CHUNK, NOTHING, Cost, Orbits, PointMap, Status, Tally
from .settling import ESCAPED, UNDECIDED, Catalogue, inside_cover, settle
from .starts import Starts
from .threads import run_over, slices

_MOST_CELLS = 4096  # cells that the image of one may touch, if it is to be told by them
_ACROSS = 0.49  # step of differences over a cell, in widths of it
_STEP = 1e-4  # smallest step where the table has no derivatives
_WIDEST = 1.0  # widths of a cell that an error may reach, lest derivatives say nothing of it
_FARTHEST = 1e15
_SOON = 4  # periods within which errors at an equilibrium have to come to rest
_GRACE = 16  # periods for which orbits are followed beyond twice the time in which the table's settle
_UNKNOWN = 1 << 62  # an end of paths over cells: where they lead is not known


class Evidence(IntEnum):
    """Why a label stands."""

    CELL = 0
    """The whole cell of the table around the start goes to this attractor."""
    ORBIT = 1
    """The orbit goes there with all the error that it can have."""
    EXACT = 2
    """The table leaves it open; the exact map does not, whatever its tolerance adds."""
    OPEN = 3
    """The label of the exact map, which errors of the size of its tolerance could change, or its limit of periods."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """Basins with the evidence for each label.

    Parameters
    ----------
    basins : Basins
        The basins, with the labels that were made again.
    evidence : ndarray of uint8, shape of the labels
        An :class:`Evidence` for each start.
    redone : int
        Starts that were labelled again by the exact map: those with the evidence EXACT and OPEN.
    changed : int
        Starts among them whose label came out differently.
    audit : Verification
        Random starts that were *not* redone, against the exact map.
    wrong : tuple of float
        95 % interval of the share of all starts whose label differs from that of the exact map.
    cost : Cost
        Wall time, and periods of all orbits.
    """

    basins: Basins
    evidence: NDArray[np.uint8]
    redone: int
    changed: int
    audit: Verification
    wrong: tuple[float, float]
    cost: Cost

    @property
    def open(self) -> int:
        """Number of starts whose label even the tolerance of the exact map could change."""
        return int(np.count_nonzero(self.evidence == Evidence.OPEN))

    def __repr__(self) -> str:
        total = self.evidence.size
        return (
            f"Certificate({self.basins.name}, {total:,} starts: {self.redone:,} redone, {self.changed:,} of these "
            f"changed, {self.open:,} open; {self.audit.wrong} of {self.audit.starts:,} others wrong, so at most "
            f"{100 * self.wrong[1]:.2g} % of all)"
        )


def certify(
    basins: Basins, audit: int = 1000, safety: float = 4.0, seed: int = 0, progress: bool = False
) -> Certificate:
    """Make sure of every label of basins that were found with a table.

    A label is kept where the errors of the table cannot change it.  First whole cells of the table are shown to go to
    an attractor: those inside its verified neighbourhood, and then those whose image, with all errors, touches nothing
    but such cells.  Starts in other cells are followed with an ellipsoid that holds all errors made so far, carried
    along by the derivatives of the map, until a neighbourhood or cells that go to one attractor hold the whole of it.
    Where that does not come about the start is labelled again by the exact map, and followed with an ellipsoid there
    too, for the exact map has errors of the size of its tolerance.  At last some random starts that were kept are
    integrated.

    The error of a period in a cell is `safety` times the largest that the table's check found in the cell and its
    neighbours, plus the tolerance of the exact map.  This is an argument from measured errors and derivatives, not a
    proof in interval arithmetic; the audit tests it.

    Parameters
    ----------
    basins : Basins
        Found by :func:`find_basins` with an interpolated map.
    audit : int, optional
        Starts to integrate.
    safety : float, optional
        How many times larger than measured an error may be.
    seed : int, optional
        Seed of their draw.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.

    Returns
    -------
    Certificate
        Labels, the evidence for each, and an interval for the share that is still wrong.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, or basins without their map or of a map without a table.

    Notes
    -----
    On a fractal boundary some labels stay open: orbits separate faster than they settle, and two exact integrators
    differ there as well.  Orbits around a chaotic attractor separate for ever, so that starts on them are all redone.

    Examples
    --------
    >>> from math import pi
    >>> from cellmap import CellGrid, ForcedSystem, find_basins, interpolated_map, stroboscopic_map
    >>> wells = ForcedSystem(lambda t, x, p: (x[1], x[0] - x[0] ** 3 - 0.3 * x[1]), {}, 2 * pi, ("x", "v"))
    >>> grid = CellGrid((-1.5, -1.0), (1.5, 1.0), (60, 40))
    >>> icm = interpolated_map(stroboscopic_map(wells), CellGrid((-2, -2), (2, 2), (128, 128)))
    >>> certificate = certify(find_basins(icm, grid))
    >>> certificate.audit.wrong, certificate.open
    (0, 0)
    """
    if not isinstance(basins, Basins):
        raise TypeError(f"basins={basins!r}: give Basins, as find_basins returns them")
    point_map = basins.point_map
    if point_map is None:
        raise ValueError("these basins have no map: rebuild it with rebuild_map and find the basins again")
    if point_map.table is None or point_map.exact is None:
        raise ValueError(f"basins were found with {point_map!r}, which has no table whose errors could matter")
    audit = whole_number("audit", audit, at_least=1)
    safety = finite_number("safety", safety, at_least=1.0)
    began = time.perf_counter()
    total = basins.labels.size
    claim_memory(f"evidence for {total:,} starts", 6 * total, "take fewer starts")
    claim_memory(f"error bounds of {point_map.table}", _Bounds.memory(point_map.table.grid), "take a smaller table")
    run = _Run(basins, point_map, safety, progress)
    run.follow(point_map, np.arange(total), run.bounds.errors, Evidence.ORBIT)
    redone = np.flatnonzero(run.evidence == Evidence.OPEN)
    run.follow(run.exact, redone, run.bounds.tolerances, Evidence.EXACT)
    kept = np.flatnonzero(run.evidence <= Evidence.ORBIT)
    checked = run.audit(kept, audit, seed)
    share = len(kept) / total
    shape = basins.labels.shape
    return Certificate(
        basins=replace(basins, labels=run.labels.reshape(shape)),
        evidence=run.evidence.reshape(shape),
        redone=len(redone),
        changed=int(np.count_nonzero(run.labels[redone] != basins.labels.ravel()[redone])),
        audit=checked,
        wrong=(share * checked.low, share * checked.high),
        cost=Cost(
            seconds=time.perf_counter() - began,
            steps=run.tally.steps,
            evaluations=run.tally.evaluations,
            look_ups=run.tally.look_ups,
        ),
    )


@dataclass(frozen=True, eq=False)
class _Bounds:
    """What the table says about errors, in widths of its cells; all arrays are flat.

    ``slopes`` (n, d, d) derivatives at the centres, ``bends`` (n,) their change over a cell, ``errors`` (n,) of a
    period of the table, ``tolerances`` (n,) of the exact map; ``images`` (n, d) places of the centres' images in cells
    from the first edge, unwrapped.
    """

    slopes: NDArray[np.float64]
    bends: NDArray[np.float64]
    errors: NDArray[np.float64]
    tolerances: NDArray[np.float64]
    images: NDArray[np.float64]

    @staticmethod
    def memory(grid: CellGrid) -> int:
        """Return the bytes that the bounds of a table need."""
        d = grid.dimension
        return 8 * grid.size * (d * d + 3 * d + 6)

    @classmethod
    @np.errstate(over="ignore", invalid="ignore")  # images of maps that diverge
    def of(cls, point_map: PointMap, safety: float, progress: bool) -> _Bounds:
        """Measure derivatives at the centres of all cells, and take errors from the check of the table."""
        table, exact = point_map.table, point_map.exact
        assert table is not None and exact is not None
        grid, d = table.grid, point_map.dimension
        slopes, images = np.empty((grid.size, d, d)), np.empty((grid.size, d))
        axes = [grid.axis(j) for j in range(d)]

        def measure(part: slice) -> None:
            centres = grid_points(axes, part)
            images[part] = (_images(point_map, centres) - grid.lower) / grid.widths
            slopes[part] = _slopes(point_map, centres, grid.widths, np.full(len(centres), _ACROSS))[0]

        run_over(slices(grid.size, CHUNK), measure, f"derivatives of {point_map.name}" if progress else None)
        bends = np.zeros((grid.size, 2))
        for i, j in np.ndindex(d, d):
            for k, change in enumerate(_changes(slopes[:, i, j].reshape(grid.shape), grid)):
                bends[:, k] += change.ravel() ** 2
        errors = safety * _of_neighbours(np.maximum, np.where(table.rough, 0.0, table.indicator).astype(float), grid)
        errors = np.where(table.rough, np.inf, errors).ravel()
        relative, absolute = exact.tolerance
        sizes = np.abs(images * grid.widths + grid.lower)
        tolerances = ((absolute + relative * sizes) / grid.widths).max(axis=1)
        known = np.isfinite(slopes).all(axis=(1, 2)) & np.isfinite(tolerances)
        errors = np.where(known, errors + tolerances, np.inf)
        return cls(slopes, np.sqrt(bends), errors, np.where(known, tolerances, np.inf), images)


def _of_neighbours(combine: Any, values: NDArray[np.float64], grid: CellGrid) -> NDArray[np.float64]:
    """Combine for each cell its value with those of the cells around it, corners included."""
    for j in range(grid.dimension):
        before, after = _beside(values, j, grid)
        values = combine(combine(before, values), after)
    return values


def _beside(values: NDArray[np.float64], j: int, grid: CellGrid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return for each cell the values of the cells before and behind it along an axis; at an end its own."""
    n = grid.shape[j]
    steps = np.arange(n)
    sides = (steps - 1) % n, (steps + 1) % n
    if not grid.wraps[j]:
        sides = np.maximum(steps - 1, 0), np.minimum(steps + 1, n - 1)
    before, after = (np.take(values, side, axis=j) for side in sides)
    return before, after


def _changes(values: NDArray[np.float64], grid: CellGrid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how much values change from a cell to the next, at most, and how far a straight line is from them."""
    change = np.fmax(_of_neighbours(np.fmax, values, grid) - values, values - _of_neighbours(np.fmin, values, grid))
    curved = np.zeros_like(values)
    for j in range(grid.dimension):
        before, after = _beside(values, j, grid)
        curved += np.abs(before - 2.0 * values + after) / 8.0
    # Where a line bends, and it may bend more next to the centre: the largest around, twice.
    return change, 2.0 * _of_neighbours(np.fmax, curved, grid)


def _bit(number: Any) -> Any:
    """Return the bit of a label among the ends of paths; labels beyond the last bit are unknown."""
    return np.where(
        np.asarray(number) < 60, np.left_shift(1, np.clip(np.asarray(number, np.int64) + 1, 0, 62)), _UNKNOWN
    )


def _images(point_map: PointMap, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the images of points, both with whole turns put back."""
    wrapped = wrap(points, point_map.coordinates)
    orbits = Orbits.starting(wrapped.copy())
    point_map.advance(orbits, 1)
    return np.asarray(orbits.points + orbits.turns * turns_of(point_map.coordinates)[1] + (points - wrapped))


@np.errstate(over="ignore", invalid="ignore")  # images of maps that diverge
def _slopes(
    point_map: PointMap, points: NDArray[np.float64], widths: NDArray[np.float64], steps: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return derivatives (n, d, d) by differences to both sides, and by how much the two differ (n,), in cells."""
    n, d = points.shape
    slopes, bends = np.empty((n, d, d)), np.zeros(n)
    middle = _images(point_map, points)
    for j in range(d):
        shift = steps[:, None] * widths * (np.arange(d) == j)
        before, after = (_images(point_map, points + way * shift) for way in (-1.0, 1.0))
        slopes[:, :, j] = (after - before) / widths / (2.0 * steps[:, None])
        bends += (((after - 2.0 * middle + before) / widths / steps[:, None]) ** 2).sum(axis=1)
    return slopes, np.sqrt(bends)


def _within(grid: CellGrid, exact: PointMap) -> PointMap:
    """Return the exact map with the window of a table: orbits end where they are outside when a period begins."""
    turn = turns_of(exact.coordinates)[1]

    def advance(orbits: Orbits, periods: int) -> None:
        for _ in range(periods):
            for now in orbits.living():
                now.end(grid.locate(_from_edge(now.points, np.array(grid.lower), turn)) < 0, Status.ESCAPED)
                for inside in now.living():
                    exact.advance(inside, 1)

    return replace(exact, advance=advance)


def _from_edge(
    values: NDArray[np.float64], lower: NDArray[np.float64], turn: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return values with angles in the turn that begins at an edge."""
    around = np.where(turn > 0.0, turn, np.inf)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(turn > 0.0, values - turn * np.floor((values - lower) / around), values))


def _around(dimension: int, step: float) -> NDArray[np.float64]:
    """Return the corners of a cube around 0."""
    return step * (2.0 * np.array(list(np.ndindex((2,) * dimension))) - 1.0)


def _slow(basins: Basins) -> NDArray[np.bool_]:
    """Tell which starts come to no end with half of the periods to spare: another map may take longer than allowed."""
    late = basins.settling_time.ravel() > basins.settings["max_periods"] // 2
    return np.asarray(late | (basins.labels.ravel() == UNDECIDED))


@dataclass(frozen=True, eq=False)
class _Left:
    """Starts whose label is not certain, and where they are at an age in periods."""

    rows: NDArray[np.int64]
    orbits: Orbits
    age: int


class _Run:
    """Labels and the evidence for them, found in several ways one after the other."""

    def __init__(self, basins: Basins, point_map: PointMap, safety: float, progress: bool) -> None:
        table, exact = point_map.table, point_map.exact
        assert table is not None and exact is not None
        self.basins, self.grid, self.progress = basins, table.grid, progress
        self.starts = Starts(basins.grid, basins.starts)
        self.escapes = point_map.recipe.get("outside") == "escape"
        self.direct = exact
        self.exact = _within(table.grid, exact) if self.escapes else exact
        self.catalogue = Catalogue.of(basins.attractors, exact)
        self.periods = int(basins.settings["max_periods"])
        cells = np.array(table.grid.shape, np.int64)
        circle = np.where(table.grid.wraps, cells, self.catalogue.turn / table.grid.widths)
        self.place = (np.array(table.grid.lower), 1.0 / table.grid.widths, cells, circle)
        self.neighbourhoods = (self.catalogue.centres, self.catalogue.metrics, self.catalogue.owners)
        self.overhangs = self._overhangs()
        self.slow = _slow(basins)
        times = basins.settling_time.ravel()
        self.patience = np.where(times < 0, self.periods, np.minimum(2 * times + _GRACE, self.periods))
        self.bounds = _Bounds.of(point_map, safety, progress)
        self.owners = self._owners_of_cells()
        self.labels = basins.labels.ravel().copy()
        self.evidence = np.full(self.labels.size, Evidence.OPEN, np.uint8)
        self.tally = NOTHING

    def _owners_of_cells(self) -> NDArray[np.int16]:
        """Give an owner to the cells from which no path over images of cells leads to another one."""
        _, _, cells, circle = self.place
        held = np.full(self.grid.size, NONE, np.int16)
        claim_within(held, self.place, self.neighbourhoods, self.catalogue.turn)
        first, last, known = self._boxes_of_images(held)
        ends = np.where(held == NONE, self._ends_within(), _bit(held))
        ends[~known & (held == NONE)] |= _UNKNOWN
        beyond = int(_bit(ESCAPED)) if self.escapes else _UNKNOWN
        reach_ends(ends, held != NONE, first, last, cells, circle, beyond)
        owners = np.full(self.grid.size, NONE, np.int16)
        for number in range(ESCAPED, len(self.basins.attractors)):
            if _bit(number) != _UNKNOWN:
                owners[ends == _bit(number)] = number
        return owners

    def _ends_within(self) -> NDArray[np.int64]:
        """Return for each cell the bits of what orbits may come to within it for ever.

        These are attractors, whether they hold a cell as a whole or not, and sets that orbits leave late or never:
        paths lead out of these too, so that the starts that tell of them have to make them ends.
        """
        ends = np.zeros(self.grid.size, np.int64)
        for number, cover, _ in self.catalogue.covers:
            ends[self._cells_on(cover)] |= _bit(number)
        for centre, number in zip(self.catalogue.centres, self.catalogue.owners, strict=True):
            ends[self._cells_of(centre + self.grid.widths * _around(self.grid.dimension, _STEP))] |= _bit(number)
        for part in slices(len(self.slow), CHUNK):
            rows = np.flatnonzero(self.slow[part]) + part.start
            ends[self._cells_of(self.starts.wrapped(rows, self.direct))] |= _UNKNOWN
        return ends

    def _cells_of(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the cells of those points that have one, flat."""
        places = self.grid.locate(_from_edge(points, np.array(self.grid.lower), self.catalogue.turn))
        return places[places >= 0]

    def _overhangs(self) -> NDArray[np.int64]:
        """Return boxes of cells, first and last, that hold the attractors which reach out of the table's window.

        An orbit that leaves the window there is captured before it counts as escaped.  Along angles boxes have no ends.
        """
        grid, catalogue = self.grid, self.catalogue
        reach = np.sqrt(np.einsum("njj->nj", np.linalg.inv(catalogue.metrics)))
        corners = [catalogue.centres - reach, *(c.lower + c.boxes * c.widths for _, c, _ in catalogue.covers)]
        sizes = [2.0 * reach, *(np.broadcast_to(c.widths, c.boxes.shape) for _, c, _ in catalogue.covers)]
        low = _from_edge(np.concatenate(corners), np.array(grid.lower), catalogue.turn)
        high = low + np.concatenate(sizes)
        out = (((low < grid.lower) | (high > grid.upper)) & ~np.array(grid.wraps)).any(axis=1)
        ends = np.floor((np.stack([low, high], axis=1)[out] - grid.lower) / grid.widths)
        everywhere = np.multiply.outer((-_FARTHEST, _FARTHEST), np.ones(grid.dimension))
        return np.where(catalogue.turn > 0.0, everywhere, ends).astype(np.int64)

    def _boxes_of_images(
        self, held: NDArray[np.int16]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Return the first and the last of the cells that the image of each cell can touch, and where they are known.

        Cells across a kink that end on one attractor at once, as where dry friction holds the state, get it in `held`.
        """
        bounds, circle = self.bounds, self.place[3]
        reach = 0.5 * np.abs(bounds.slopes).sum(axis=2)
        reach += (0.25 * self.grid.dimension * bounds.bends[:, 0] + bounds.errors)[:, None]
        middle = bounds.images.copy()
        rough = np.flatnonzero(np.isinf(bounds.errors) & (held == NONE))
        for chunk in slices(len(rough), CHUNK // 3**self.grid.dimension + 1):
            some = rough[chunk]
            middle[some], reach[some], held[some] = self._sampled(some)
        middle = _from_edge(middle, np.zeros(len(circle)), circle)
        known = (np.abs(middle) + reach < _FARTHEST).all(axis=1)
        known &= np.prod(np.where(known[:, None], 2.0 * reach, 0.0) + 1.0, axis=1) < _MOST_CELLS
        # Part of a turn is outside of the window, and the window comes again behind it.
        cells, part = self.place[2], (circle > 0.0) & (circle != self.place[2])
        known &= ~(part & ((middle + reach >= circle) | (middle - reach <= cells - circle))).any(axis=1)
        first, last = (np.where(known[:, None], middle + way * reach, 0.0) for way in (-1.0, 1.0))
        first, last = np.floor(first).astype(np.int64), np.floor(last).astype(np.int64)
        leaves = (((first < 0) | (last >= cells)) & ~np.array(self.grid.wraps)).any(axis=1)
        for begin, end in self.overhangs:
            known &= ~(leaves & (first <= end).all(axis=1) & (last >= begin).all(axis=1))
        return first, last, known

    def _sampled(self, cells: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int16]]:
        """Return middles and reaches of the images of some cells, and labels that a period settles, from samples."""
        grid, d = self.grid, self.grid.dimension
        offsets = np.array(list(np.ndindex((3,) * d))) - 1.0
        centres = grid_points([grid.axis(j) for j in range(d)], cells)
        points = centres[:, None, :] + 0.5 * grid.widths * offsets
        images = (_images(self.direct, points.reshape(-1, d)).reshape(points.shape) - grid.lower) / grid.widths
        low, high = images.min(axis=1), images.max(axis=1)
        starts = Orbits.starting(wrap(points.reshape(-1, d), self.direct.coordinates))
        labels = settle(self.exact, starts, self.catalogue, 1).labels.reshape(len(cells), -1)
        agreed = (labels == labels[:, :1]).all(axis=1) & (labels[:, 0] >= ESCAPED)
        # Between the samples an image may reach as far again as from one sample to the next.
        reach = (0.5 + 0.25) * (high - low) + self.bounds.tolerances[cells, None]
        return 0.5 * (low + high), reach, np.where(agreed, labels[:, 0], NONE).astype(np.int16)

    def _cells_on(self, cover: Cover) -> NDArray[np.int64]:
        """Return the cells that touch boxes of a cover, some of them often."""
        grid = self.grid
        # A point for each box of half a cell at most, and some at its edges.
        parts = np.maximum(np.ceil(2.0 * cover.widths / grid.widths), 1.0).astype(int)
        offsets = np.array(list(np.ndindex(*(parts + 1)))) / parts
        corners = cover.lower + cover.boxes * cover.widths
        return self._cells_of((corners[:, None, :] + offsets * cover.widths).reshape(-1, grid.dimension))

    def follow(self, point_map: PointMap, rows: NDArray[np.int64], errors: NDArray[np.float64], mark: Evidence) -> None:
        """Follow starts with their errors, and label those that a region holds with all of it.

        The others keep their label if this is the map with the table; the exact map labels them too.
        """
        parts = slices(len(rows), CHUNK)
        tallies = np.zeros((len(parts), len(NOTHING)), np.int64)

        def work(number: int) -> None:
            mine = rows[parts[number]]
            left, tally = self._follow(point_map, mine, errors, mark)
            for part in left if mark is Evidence.EXACT else ():
                tally = tally.plus(self._settle(part))
            tallies[number] = tally

        run_over(range(len(parts)), work, f"certifying {self.basins.name}" if self.progress else None)
        self.tally = self.tally.plus(tallies.sum(axis=0))

    def _settle(self, left: _Left) -> Tally:
        """Label starts by the exact map, from the beginning where an attractor may have had them before."""
        orbits, age = left.orbits, left.age
        if self.catalogue.covers or len(self.overhangs):
            orbits, age = Orbits.starting(self.starts.wrapped(left.rows, self.exact)), 0
        settled = settle(self.exact, orbits, self.catalogue, self.periods - age, age)
        self.labels[left.rows] = settled.labels
        return settled.tally

    @np.errstate(invalid="ignore", over="ignore")  # errors that have grown too large may grow beyond all bounds
    def _follow(
        self, point_map: PointMap, rows: NDArray[np.int64], errors: NDArray[np.float64], mark: Evidence
    ) -> tuple[list[_Left], Tally]:
        """Follow starts until their label is certain; return those that stay open, and the work."""
        orbits = Orbits.starting(self.starts.wrapped(rows, point_map))
        spread = np.zeros((len(rows), point_map.dimension, point_map.dimension))
        left: list[_Left] = []
        pending, settled = ~self.slow[rows], np.zeros(len(rows), bool)
        steps = 0
        for k in range(self.periods + 1):
            found = np.empty(len(rows), np.int64)
            judge(
                orbits.points, spread, self.owners, self.place, self.escapes, ESCAPED, self.overhangs,
                self.neighbourhoods, self.catalogue.turn, found,
            )  # fmt: skip
            self._stopped(orbits, spread, found)
            held = pending & (found >= ESCAPED)
            self.labels[rows[held]] = found[held]
            self.evidence[rows[held]] = Evidence.CELL if k == 0 and mark is Evidence.ORBIT else mark
            settled |= held
            reach = sum(spread[:, j, j] for j in range(point_map.dimension))
            pending &= (found == NONE) & (orbits.status == Status.OK) & (reach < _WIDEST**2) & (k < self.patience[rows])
            remaining = int(np.count_nonzero(pending))
            if remaining * 4 < len(rows) * 3 or k == self.periods:
                lost, on = np.flatnonzero(~pending & ~settled), np.flatnonzero(pending)
                left.append(_Left(rows[lost], orbits[lost], k))
                rows, orbits, spread = rows[on], orbits[on], spread[on]
                pending, settled = np.ones(len(rows), bool), np.zeros(len(rows), bool)
            if not len(rows):
                break
            self._widen(orbits.points, spread, errors)
            point_map.advance(orbits, 1)
            steps += len(rows)
        return left, Tally(steps, 0, orbits.work.evaluations, orbits.work.look_ups)

    def _stopped(self, orbits: Orbits, spread: NDArray[np.float64], found: NDArray[np.int64]) -> None:
        """Find orbits that rest at equilibria, and write those with all of whose errors they would soon rest there too.

        Errors at an equilibrium of dry friction are tried at the ends of the axes of their ellipsoids' boxes.
        """
        for number, cover, keys in self.catalogue.covers:
            rows = np.flatnonzero((found == NONE) & orbits.alive) if cover.certain is not None else ()
            rows = rows[inside_cover(cover, orbits.points[rows], self.direct, keys)] if len(rows) else ()
            if len(rows):
                reach = np.sqrt(np.einsum("nii->ni", spread[rows])) * self.grid.widths
                sides = np.concatenate([np.eye(reach.shape[1]), -np.eye(reach.shape[1])])
                tried = orbits.points[rows][:, None, :] + reach[:, None, :] * sides
                tried = wrap(tried.reshape(-1, reach.shape[1]), self.direct.coordinates)
                labels = settle(self.direct, Orbits.starting(tried), self.catalogue, _SOON).labels
                found[rows[(labels.reshape(len(rows), -1) == number).all(axis=1)]] = number

    def _widen(self, points: NDArray[np.float64], spread: NDArray[np.float64], errors: NDArray[np.float64]) -> None:
        """Carry errors over a period; where the table has no derivatives, with differences of the exact map."""
        unknown = np.empty(len(points), bool)
        widening(points.shape[1])(points, spread, self.place, self.bounds.slopes, self.bounds.bends, errors, unknown)
        rest = np.flatnonzero(unknown)
        if not len(rest):
            return
        reach = np.sqrt(np.einsum("nii->n", spread[rest]))
        steps = np.clip(reach, _STEP, _WIDEST)
        slopes, bends = _slopes(self.direct, points[rest], self.grid.widths, steps)
        relative, absolute = self.direct.tolerance
        tolerances = ((absolute + relative * np.abs(points[rest])) / self.grid.widths).max(axis=1)
        wider = spread[rest]
        carry_rows(wider, slopes, tolerances + bends * reach)
        spread[rest] = wider

    def audit(self, rows: NDArray[np.int64], number: int, seed: int) -> Verification:
        """Compare labels of some starts among those of the rows with those that the exact map gives."""
        drawn = np.random.default_rng(seed).choice(rows, number) if len(rows) else rows
        wrong = int(np.count_nonzero(self._direct_labels(drawn) != self.labels[drawn]))
        return Verification.of(wrong, len(drawn))

    def _direct_labels(self, rows: NDArray[np.int64]) -> NDArray[np.int16]:
        labels = np.empty(len(rows), np.int16)
        parts = slices(len(rows), CHUNK // 8)
        tallies = np.zeros((len(parts), len(NOTHING)), np.int64)

        def label(number: int) -> None:
            starts = self.starts.wrapped(rows[parts[number]], self.exact)
            settled = settle(self.exact, Orbits.starting(starts), self.catalogue, self.periods)
            labels[parts[number]], tallies[number] = settled.labels, settled.tally

        run_over(range(len(parts)), label, f"integrating {self.basins.name}" if self.progress else None)
        self.tally = self.tally.plus(tallies.sum(axis=0))
        return labels
