"""Cells of an interpolated map all of whose orbits converge to one attractor, whatever the interpolation error."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..._compiled.kernels.capture import Regions
from ..._compiled.kernels.cell_images import SEVERAL, boxes_of, claim_within, reach_ends, reaches_of
from ..._compiled.kernels.certainty import FARTHEST, NONE
from ..._lib.arrays import Floats, Ints
from ..._lib.threads import run_over, slices
from ...attractors.settling.labels import Label, label_type
from ...attractors.settling.settle import Catalogue, settle
from ...maps.coordinates import in_turn, wrap
from ...maps.grid import CellGrid, Locator, grid_points
from ...maps.orbit_batch import CHUNK, Orbits, Status
from ...maps.point_map import PointMap
from ...orbits.attractor import Cover
from ...orbits.ellipsoids import half_widths
from ..record import Basins
from .table_errors import UNRESOLVED, TableErrors, images_of

SMALLEST = 1e-4  # smallest step of differences where the table has no derivatives, in widths of a cell
_MOST_CELLS = 4096  # cells that the image of one may touch, if it is to be told by them
_LESS = 0.4  # an image reaches this fraction of the sum of its cell's slopes to both sides of its middle at least
_SAMPLED = 256  # cells that are sampled together
_FIRST = 1 - int(Label.ESCAPED)  # ends of paths over cells are labels and this, so that they are positive


@dataclass(frozen=True, eq=False)
class Setting:
    """The cells of a table, the attractors, and the maps that labels are made with.

    ``attractors`` is their number, ``direct`` the exact map, ``exact`` the same with the window of the table if orbits
    end there (``escapes``); ``place`` has the first edges of the cells, their inverse widths, their numbers and those
    around a circle, ``neighbourhoods`` the verified ellipsoids and ``reaches`` (n, d) their extents.  ``overhangs``
    (n, 2, d) are boxes of cells, first and last, that hold the attractors which reach out of the window: an orbit that
    leaves there is captured before it counts as escaped.
    """

    grid: CellGrid
    attractors: int
    catalogue: Catalogue
    direct: PointMap
    exact: PointMap
    escapes: bool
    place: tuple[Floats, Floats, Ints, Floats]
    neighbourhoods: Regions
    reaches: Floats
    overhangs: Ints

    @property
    def kind(self) -> Any:
        """Type of arrays of labels, and of ends of paths."""
        return label_type(self.attractors + _FIRST)

    @classmethod
    def of(cls, basins: Basins, point_map: PointMap) -> Setting:
        """Return the setting of basins that were found with a table."""
        table, exact = point_map.table, point_map.exact
        assert table is not None and exact is not None
        grid, catalogue = table.grid, Catalogue.of(basins.attractors, exact)
        cells = np.array(grid.shape, np.int64)
        circle = np.where(grid.wraps, cells, catalogue.turn / grid.widths)
        return cls(
            grid=grid,
            attractors=len(basins.attractors),
            catalogue=catalogue,
            direct=exact,
            exact=exact_within(point_map),
            escapes=point_map.escapes,
            place=(np.array(grid.lower), 1.0 / grid.widths, cells, circle),
            neighbourhoods=catalogue.regions,
            reaches=half_widths(catalogue.regions.metrics) * (1.0 + 1e-9),
            overhangs=_overhangs(grid, catalogue),
        )

    def cells_of(self, points: Floats) -> Ints:
        """Return the cells of those points that have one, flat."""
        places = Locator.of(self.grid, self.direct.coordinates)(points)
        return places[places >= 0]


def exact_within(point_map: PointMap) -> PointMap:
    """Return the exact map of a table, with the window of the table if orbits end there."""
    table, exact = point_map.table, point_map.exact
    assert table is not None and exact is not None
    return within(table.grid, exact) if point_map.escapes else exact


def within(grid: CellGrid, exact: PointMap) -> PointMap:
    """Return the exact map with the window of a table: orbits end where they are outside when a period begins."""
    locate = Locator.of(grid, exact.coordinates)

    def advance(orbits: Orbits, periods: int) -> None:
        for _ in range(periods):
            for now in orbits.living():
                now.end(locate(now.points) < 0, Status.ESCAPED)
                for inside in now.living():
                    exact.advance(inside, 1)

    return replace(exact, advance=advance)


def owners_of_cells(setting: Setting, errors: TableErrors, late: Iterable[Floats]) -> NDArray[np.int16]:
    """Return the attractor of each cell from which no path over images of cells leads to another one, or none.

    Orbits from the points in `late`, batches (n, d), come to no end in time, or late.
    """
    held = np.full(setting.grid.size, NONE, setting.kind)

    def claim(part: slice) -> None:
        claim_within(held, setting.place, setting.neighbourhoods, setting.catalogue.turn, part.start, part.stop)

    run_over(slices(setting.grid.size, CHUNK), claim)
    within, (middle, reach) = _ends_within(setting, late), _images(setting, errors)
    rough = np.flatnonzero(np.isinf(errors.errors) & (held == NONE) & (errors.estimates <= UNRESOLVED))
    if len(rough):
        # Samples are dear: they are taken where smaller images go to one end, and where the centre comes to one soon.
        middle = middle.copy()
        reach[rough] = _LESS * np.abs(errors.slopes[rough]).sum(axis=2)
        open_ = _ends(setting, held, within, middle, reach)[rough] != SEVERAL
        reach[rough] = np.inf

        def sample(part: slice) -> None:
            some = rough[part]
            centres = grid_points([setting.grid.axis(j) for j in range(setting.grid.dimension)], some)
            soon = _labels_soon(setting, centres) >= Label.ESCAPED
            held[some[soon]] = _agreed(setting, centres[soon])
            chosen = open_[part] | soon
            some, centres = some[chosen], centres[chosen]
            middle[some], reach[some] = _sampled(setting, centres, errors.tolerances[some] + errors.estimates[some])

        run_over(slices(len(rough), _SAMPLED), sample)
    ends = _ends(setting, held, within, middle, reach)
    return np.where(ends > 0, ends - _FIRST, NONE).astype(setting.kind)


def _ends(
    setting: Setting, held: NDArray[np.int16], within: NDArray[np.int16], middle: Floats, reach: Floats
) -> NDArray[np.int16]:
    """Return the ends of all paths over images of cells, which reach so far from their middles."""
    _, _, cells, circle = setting.place
    first, last = np.empty(middle.shape, np.int32), np.empty(middle.shape, np.int32)

    def enclose(part: slice) -> None:
        images, boxes = (middle, reach), (first, last)
        boxes_of(images, setting.place, _MOST_CELLS, setting.overhangs, part.start, part.stop, boxes)

    run_over(slices(setting.grid.size, CHUNK), enclose)
    ends = np.where(held == NONE, within, held + _FIRST).astype(setting.kind)
    ends[(last[:, 0] < first[:, 0]) & (held == NONE)] = SEVERAL
    beyond = Label.ESCAPED + _FIRST if setting.escapes else SEVERAL
    reach_ends(ends, held != NONE, first, last, cells, circle, beyond)
    return ends


def _ends_within(setting: Setting, late: Iterable[Floats]) -> NDArray[np.int16]:
    """Return for each cell the number of the set in which orbits may stay within it for ever, from 1 on.

    These are attractors, whether they hold a cell as a whole or not, and sets that orbits leave late or never: paths
    lead out of these too, so that they are found from the initial conditions that settle late.
    """
    ends = np.zeros(setting.grid.size, setting.kind)

    def meet(here: Ints, number: int) -> None:
        met = ends[here]
        ends[here] = np.where((met == 0) | (met == number + _FIRST), number + _FIRST, SEVERAL)

    for number, cover, _ in setting.catalogue.covers:
        meet(_cells_on(setting, cover), number)
    for centre, number in zip(setting.catalogue.regions.centres, setting.catalogue.regions.owners, strict=True):
        meet(setting.cells_of(centre + setting.grid.widths * _around(setting.grid.dimension, SMALLEST)), number)
    for points in late:
        ends[setting.cells_of(points)] = SEVERAL
    return ends


def _around(dimension: int, step: float) -> Floats:
    """Return the corners of a cube around 0."""
    return step * (2.0 * np.array(list(np.ndindex((2,) * dimension))) - 1.0)


def _overhangs(grid: CellGrid, catalogue: Catalogue) -> Ints:
    """Return boxes of cells, first and last, that hold the attractors which reach out of the table's window.

    An orbit that leaves the window there is captured before it counts as escaped.  Along angles boxes have no ends.
    """
    reach = half_widths(catalogue.regions.metrics)
    corners = [catalogue.regions.centres - reach, *(c.lower + c.boxes * c.widths for _, c, _ in catalogue.covers)]
    sizes = [2.0 * reach, *(np.broadcast_to(c.widths, c.boxes.shape) for _, c, _ in catalogue.covers)]
    low = in_turn(np.concatenate(corners), np.array(grid.lower), catalogue.turn)
    high = low + np.concatenate(sizes)
    out = (((low < grid.lower) | (high > grid.upper)) & ~np.array(grid.wraps)).any(axis=1)
    ends = np.floor((np.stack([low, high], axis=1)[out] - grid.lower) / grid.widths)
    everywhere = np.multiply.outer((-FARTHEST, FARTHEST), np.ones(grid.dimension))
    return np.where(catalogue.turn > 0.0, everywhere, ends).astype(np.int64)


def _images(setting: Setting, errors: TableErrors) -> tuple[Floats, Floats]:
    """Return the middles of the images of cells, and how far these reach from there; inf where that is not known."""
    reach = np.empty(errors.images.shape)

    def measure(part: slice) -> None:
        reaches_of(errors.slopes, errors.bends, errors.errors, part.start, part.stop, reach)

    run_over(slices(setting.grid.size, CHUNK), measure)
    return errors.images, reach


def _sampled(setting: Setting, centres: Floats, errors: Floats) -> tuple[Floats, Floats]:
    """Return middles and reaches of the images of some cells, from samples."""
    points = _samples(setting, centres)
    images = images_of(setting.direct, points.reshape(-1, setting.grid.dimension)).reshape(points.shape)
    images = (images - setting.grid.lower) / setting.grid.widths
    low, high = images.min(axis=1), images.max(axis=1)
    # Between the samples an image may reach as far again as from one sample to the next, and as far as the spline errs.
    return 0.5 * (low + high), (0.5 + 0.25) * (high - low) + errors[:, None]


def _agreed(setting: Setting, centres: Floats) -> NDArray[np.int16]:
    """Return the label that all samples of a cell have after a period, or none: dry friction may hold all of them."""
    points = _samples(setting, centres)
    labels = _labels_soon(setting, points.reshape(-1, setting.grid.dimension)).reshape(points.shape[:2])
    agreed = (labels == labels[:, :1]).all(axis=1) & (labels[:, 0] >= Label.ESCAPED)
    return np.where(agreed, labels[:, 0], NONE).astype(setting.kind)


def _samples(setting: Setting, centres: Floats) -> Floats:
    """Return points of cells, shape (n, samples, d), up to their edges."""
    d = setting.grid.dimension
    sides = _samples_along(d)
    offsets = np.array(list(np.ndindex((sides,) * d))) * (2.0 / (sides - 1)) - 1.0
    return np.asarray(centres[:, None, :] + 0.5 * setting.grid.widths * offsets)


def _labels_soon(setting: Setting, points: Floats) -> NDArray[np.int16]:
    """Return the labels of points after a period."""
    orbits = Orbits.starting(wrap(points, setting.direct.coordinates))
    return np.asarray(settle(setting.exact, orbits, setting.catalogue, 1).labels, setting.kind)


def _samples_along(dimension: int) -> int:
    """Return the number of samples along each edge of a cell."""
    return 5 if dimension < 3 else 3


def _cells_on(setting: Setting, cover: Cover) -> Ints:
    """Return the cells that touch boxes of a cover, some of them often."""
    grid = setting.grid
    # A point for each box of half a cell at most, and some at its edges.
    parts = np.maximum(np.ceil(2.0 * cover.widths / grid.widths), 1.0).astype(int)
    offsets = np.array(list(np.ndindex(*(parts + 1)))) / parts
    corners = cover.lower + cover.boxes * cover.widths
    return setting.cells_of((corners[:, None, :] + offsets * cover.widths).reshape(-1, grid.dimension))
