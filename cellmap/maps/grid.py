"""Grids of cells over a window of phase space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, ulp

import numpy as np
from numpy.typing import ArrayLike

from .._compiled.kernels.blocks import MOST_TURNS, product_rows
from .._compiled.kernels.box_images import locate_rows
from .._lib.arrays import Bools, Floats, Ints
from .._lib.checks import claim_memory, in_bytes, is_sequence, real_array, shown, whole_number
from .._lib.records import ShownAsHtml
from .._lib.signatures import checked
from .coordinates import Coordinate, turns_of


@dataclass(frozen=True)
class CellGrid(ShownAsHtml):
    """A box of equal cells.

    Cells are half-open: a cell contains its lower edges, not its upper ones.  A periodic axis covers one period of an
    angle, and every number lies in one of its cells.  Centres and edges are computed from the nearer end of an axis, so
    that in a window symmetric about 0 they are mirror images of one another to the last bit.

    Parameters
    ----------
    lower, upper : sequence of float
        Corners of the window, one number for each coordinate, ``lower < upper``.  An axis of one cell may have equal
        corners: a slice, whose initial conditions all have this value.  A slice has no volume, so that no map can be
        interpolated on it and no point located in it.
    shape : sequence of int
        Cells along each axis.
    wraps : sequence of bool, optional
        Which axes are periodic.  :func:`interpolated_map` and :func:`find_basins` set this for axes that cover one full
        period of an angle.

    Raises
    ------
    ValueError
        For an empty, inverted or non-finite window, or a number of cells below one.

    Examples
    --------
    >>> grid = CellGrid(lower=(-1, 0), upper=(1, 1), shape=(4, 2))
    >>> grid.centres().shape
    (4, 2, 2)
    >>> grid.locate([[-1.0, 1.0], [-1.0, 0.5]])
    array([-1,  1])
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    shape: tuple[int, ...]
    wraps: tuple[bool, ...] = ()

    def __post_init__(self) -> None:
        for name in ("lower", "upper"):
            values = real_array(name, getattr(self, name), "one number for each coordinate")
            if values.ndim > 1 or not np.isfinite(values).all():
                raise ValueError(
                    f"{name}={shown(getattr(self, name))}: a window has finite corners, one number for each axis"
                )
            object.__setattr__(self, name, tuple(np.atleast_1d(values).tolist()))
        counts = self.shape if is_sequence(self.shape) else (self.shape,)
        object.__setattr__(self, "shape", tuple(whole_number("shape", n, at_least=1) for n in counts))
        if not is_sequence(self.wraps) or not all(isinstance(w, bool | np.bool_) for w in self.wraps):
            raise TypeError(f"wraps={shown(self.wraps)}: give True or False for each coordinate")
        object.__setattr__(self, "wraps", tuple(map(bool, self.wraps)) or (False,) * len(self.lower))
        given = {name: getattr(self, name) for name in ("lower", "upper", "shape", "wraps")}
        if len(set(map(len, given.values()))) != 1 or not self.shape:
            entries = ", ".join(f"{name}={value}" for name, value in given.items())
            few = len(self.shape) == 1 < len(self.lower)
            cells = f", such as shape={self.shape * len(self.lower)}" if few else ""
            raise ValueError(f"{entries}: a grid needs one entry for each coordinate in each argument{cells}")
        for j, (a, b, n) in enumerate(zip(self.lower, self.upper, self.shape, strict=True)):
            if a == b and n == 1:
                continue
            if not a < b:
                raise ValueError(
                    f"lower={a!r}, upper={b!r} along axis {j}: the window is empty or inverted; exchange them or widen "
                    "it, or for a slice give one cell along this axis (lower has the lower ends of all axes, upper the "
                    "upper ends)"
                )
            if not ulp(max(abs(a), abs(b))) <= (b - a) / n < inf:
                raise ValueError(
                    f"lower={a!r}, upper={b!r}, shape={n} along axis {j}: no floating-point numbers separate cells of "
                    "this width; take fewer cells, or a window of another size"
                )

    @property
    def dimension(self) -> int:
        """Number of axes."""
        return len(self.shape)

    @property
    def size(self) -> int:
        """Number of cells."""
        return int(np.prod([int(n) for n in self.shape], dtype=object))

    @property
    def widths(self) -> Floats:
        """Width of a cell along each axis."""
        return (np.array(self.upper) - np.array(self.lower)) / np.array(self.shape)

    @checked
    def axis(self, axis: int) -> Floats:
        """Return the cell centres along axis `axis`."""
        self._own(axis)
        return self.along(axis, np.arange(self.shape[axis]) + 0.5)

    @checked
    def edges(self, axis: int) -> Floats:
        """Return the cell edges along axis `axis`, one more than cells."""
        self._own(axis)
        return self.along(axis, np.arange(self.shape[axis] + 1))

    @checked
    def along(self, axis: int, cells: ArrayLike) -> Floats:
        """Return the coordinates at a distance of `cells` cells from the lower end of axis `axis`."""
        self._own(axis)
        return between(self.lower[axis], self.upper[axis], self.shape[axis], real_array("cells", cells))

    def places(self, cells: ArrayLike) -> Floats:
        """Return the points at distances of `cells` (..., dimension) cells from the lower corner."""
        given = real_array("cells", cells)
        if given.shape[-1:] != (self.dimension,):
            raise ValueError(f"cells has shape {given.shape}: its last axis must hold {self.dimension} coordinates")
        return between(np.array(self.lower), np.array(self.upper), np.array(self.shape), given)

    def centres(self) -> Floats:
        """Return the centres of all cells, shape ``(*shape, dimension)``."""
        needed = 8 * self.size * self.dimension
        claim_memory(f"the centres of {self.size:,} cells", needed, "take fewer cells")
        return np.stack(np.meshgrid(*map(self.axis, range(self.dimension)), indexing="ij"), axis=-1)

    def locate(self, points: ArrayLike) -> Ints:
        """Return the flat (row-major) index of the cell of each point, -1 for a point outside the grid or NaN."""
        p = real_array("points", points)
        if p.ndim == 0 or p.shape[-1] != self.dimension:
            raise ValueError(f"points has shape {p.shape}: its last axis must hold {self.dimension} coordinates")
        return Locator.of(self)(p.reshape(-1, self.dimension)).reshape(p.shape[:-1])

    @checked
    def on(self, coordinates: Sequence[Coordinate], name: str = "grid") -> CellGrid:
        """Return this grid with periodic axes set: an axis is periodic if it covers one full period of an angle.

        Parameters
        ----------
        coordinates : sequence of Coordinate
            State variables of a system, one for each axis.
        name : str, optional
            Name of the grid in errors.

        Raises
        ------
        ValueError
            For a wrong number of axes, or an axis that is longer than one period of its angle.
        """
        if len(coordinates) != self.dimension:
            names = ", ".join(c.name for c in coordinates)
            raise ValueError(
                f"{name} has {self.dimension} {'axis' if self.dimension == 1 else 'axes'} and the system "
                f"{len(coordinates)} coordinates: {names}; {name}={shown(self)}: "
                "give one entry of lower, upper and shape for each; one cell for a slice"
            )
        wraps = []
        for a, b, c in zip(self.lower, self.upper, coordinates, strict=True):
            excess = (b - a) / c.period - 1.0 if c.period else -1.0
            if excess > 1e-9:
                raise ValueError(
                    f"{name} covers {b - a:g} of {c}, more than one period ({c.period:g}): shorten the axis"
                )
            if c.period is not None and max(-a, b) >= MOST_TURNS * c.period:
                raise ValueError(
                    f"{name} lies {max(-a, b) / c.period:.0e} periods away from 0 in {c}, where an angle has no phase "
                    "in double precision: shift it"
                )
            wraps.append(excess > -1e-9)
        return CellGrid(self.lower, self.upper, self.shape, tuple(wraps))

    def _own(self, j: int) -> None:
        if not 0 <= j < self.dimension:
            raise ValueError(f"axis={j}: the grid has the axes 0 to {self.dimension - 1}")

    def __str__(self) -> str:
        cells = " x ".join(map(str, self.shape))
        return f"{cells} cells ({in_bytes(8 * self.size)} for each number that is kept of a cell)"


@dataclass(frozen=True, eq=False)
class Locator:
    """Finds the cells of points whose angles may have their branch cut elsewhere than at the edge of the window."""

    lower: Floats
    upper: Floats
    widths: Floats
    shape: Ints
    turn: Floats
    wraps: Bools

    @classmethod
    def of(cls, grid: CellGrid, coordinates: Sequence[Coordinate] | None = None) -> Locator:
        """Prepare for the cells of a grid over some coordinates; without them only its periodic axes are angles."""
        check_volume(grid)
        lower, upper = np.array(grid.lower), np.array(grid.upper)
        wraps, turn = np.array(grid.wraps), np.zeros(grid.dimension)
        if coordinates is not None:
            turn = turns_of(coordinates)[1]
        turn = np.where(wraps, upper - lower, turn)
        return cls(lower, upper, grid.widths, np.array(grid.shape, np.int64), turn, wraps)

    def __call__(self, points: Floats) -> Ints:
        """Return the numbers of the cells of points (n, dimension), -1 outside."""
        keys = np.empty(len(points), np.int64)
        locate_rows(points, self.lower, self.upper, self.widths, self.shape, self.turn, self.wraps, keys)
        return keys


def check_volume(grid: CellGrid) -> None:
    """Refuse a slice where cells must have a volume."""
    for j, (a, b) in enumerate(zip(grid.lower, grid.upper, strict=True)):
        if a == b:
            raise ValueError(
                f"grid: lower and upper are both {a!r} along axis {j}, which is a slice, and its cells need a volume "
                "here: give different corners"
            )


def between(lower: ArrayLike, upper: ArrayLike, cells: ArrayLike, numbers: ArrayLike) -> Floats:
    """Return the coordinates that lie `cells` cells behind a lower end, counted from the end that is nearer.

    In a window that is symmetric about 0, ``cells - numbers`` gives the mirror image of ``numbers`` to the last bit.
    """
    first, last, n = np.asarray(lower, float), np.asarray(upper, float), np.asarray(cells)
    k, width = np.asarray(numbers), (last - first) / n
    side = np.sign(2 * k - n)
    near = np.where(side < 0, first + k * width, last - (n - k) * width)
    return np.where(side == 0, 0.5 * first + 0.5 * last, near)


def grid_points(axes: Sequence[Floats], part: slice | Ints) -> Floats:
    """Return some points of the product of axes, by their flat row-major numbers; shape (n, dimension)."""
    rows = np.empty(0, np.int64) if isinstance(part, slice) else np.require(part, np.int64, ("C", "A"))
    begin, count = (part.start, part.stop - part.start) if isinstance(part, slice) else (0, len(part))
    points = np.empty((count, len(axes)))
    product_rows(np.concatenate(axes), np.array([len(axis) for axis in axes], np.int64), begin, rows, points)
    return points
