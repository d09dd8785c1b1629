"""Box-counting (capacity) dimension of sets of points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from ..._lib.arrays import Bools, Floats
from ..._lib.checks import finite_number, real_array
from ..._lib.fit import Fit, fit_line, scaling_fit, unseen_error
from ..._lib.randomness import Rng
from ..._lib.signatures import checked
from ...maps.coordinates import Coordinate
from .partitions import Partition, Space, distinct, dyadic_sizes, over_offsets

_FEWEST_BOXES = 10
_MISSED = 0.03
_MARGIN = 0.02  # counts of straight lines on oblique grids come as close to whole numbers as this
_LAST = 6
_AHEAD = 100.0
_EDGES = np.linspace(0.0, 4.0, 201)


@dataclass(frozen=True, eq=False)
class BoxCount:
    """Box counts of a set by box size, and the resulting box-counting dimension.

    Parameters
    ----------
    sizes : ndarray, shape (n,)
        Sides of the boxes in decreasing order: in cells for a boundary, in units of the scales for points.
    counts : ndarray, shape (n,)
        Number of boxes that intersect the set, mean over the offsets of the grid.
    errors : ndarray, shape (n,)
        Standard errors of these means; 0 for one grid.
    missed : ndarray, shape (n,)
        Estimated fraction of the boxes that intersect the set but are missed, as the set is known at some points only.
    usable : ndarray of bool, shape (n,)
        Sizes between the two ends at which counts saturate.
    fit : Fit
        Fit of ln counts against ln 1/size; its slope is the dimension, and its error includes the drift of the slope
        and the choice of the window.
    topological : int or None
        Dimension of the set if it is smooth, where that is known: one less than that of the space for a boundary.
    ignored : float
        Fraction of the cells that belong to no basin; 0 for points.
    isolated : ndarray, shape (n,), or None
        Fraction of the boxes with boundary that contain only that of isolated labels, before these are ignored; None
        for points.
    """

    sizes: Floats
    counts: Floats
    errors: Floats
    missed: Floats
    usable: Bools
    fit: Fit
    topological: int | None = None
    ignored: float = 0.0
    isolated: Floats | None = None

    def __repr__(self) -> str:
        first, last = self.sizes[self.fit.inside][[0, -1]]
        return f"BoxCount(dimension {self.dimension:.4g} +- {self.standard_error:.2g}, sizes {last:.3g} to {first:.3g})"

    @property
    def dimension(self) -> float:
        """Box-counting dimension: the slope in the window."""
        return self.fit.slope

    @property
    def standard_error(self) -> float:
        """Standard error of the dimension: scatter and drift of the slope, and the choice of the window."""
        return self.fit.standard_error

    @property
    def fractal(self) -> bool:
        """Whether the counts distinguish the set from a smooth one.

        True if the 95 % interval of the dimension lies above that of a smooth boundary by at least 0.02; for points, if
        it is as far from any integer.  A statement about ever smaller sizes requires two more tests.  The interval is
        widened to the slope to which the trend at the smallest usable sizes would lead two decades further on: the
        counts of a smooth boundary that is tightly wound reach their power law at small sizes only.  It is also widened
        to the 95 % interval for the slope of one more octave, from the scatter of all usable ones: near the onset of a
        fractal boundary slopes fluctuate, and those of a smooth one reach 1 below the resolution of the image.  False
        does not mean that a set is smooth.
        """
        # What less than a decade cannot show is no scatter, which Student's factor would be for.
        unseen = unseen_error(self.fit.x, *self.fit.fit_range)
        scatter = np.sqrt(max(self.standard_error**2 - unseen**2, 0.0))
        low, high = replace(self.fit, standard_error=float(scatter)).interval(0.95)
        low, high = low - 2.0 * unseen, high + 2.0 * unseen
        beyond = [self._ahead(), *self._next_octave()]
        low, high = min(low, *beyond) - _MARGIN, max(high, *beyond) + _MARGIN
        if self.topological is not None:
            return bool(low > self.topological)
        return bool(np.floor(low) == np.floor(high) and low > np.floor(low))

    def _ahead(self) -> float:
        """Slope that the smallest usable sizes lead to, if it goes on to change as it does there."""
        x, slopes = self._local_slopes()
        if len(slopes) < 3:
            return self.dimension
        x, slopes = x[1 - _LAST :], slopes[1 - _LAST :]
        return float(fit_line(x, slopes, (0, len(slopes) - 1))(x[-1] + np.log(_AHEAD)))

    def _next_octave(self) -> tuple[float, float]:
        """Interval in which the slope of a further size is expected, from the scatter of those of usable sizes."""
        slopes = self._local_slopes()[1]
        n = len(slopes)
        if n < 2:
            return self.dimension, self.dimension
        reach = float(stdtrit(n - 1, 0.975) * slopes.std(ddof=1) * np.sqrt(1.0 + 1.0 / n))
        return float(slopes.mean()) - reach, float(slopes.mean()) + reach

    def _local_slopes(self) -> tuple[Floats, Floats]:
        """Middles between neighbouring usable sizes, and slopes there."""
        x, y = self.fit.x[self.usable], self.fit.y[self.usable]
        return 0.5 * (x[1:] + x[:-1]), np.diff(y) / np.diff(x)


@checked
def box_dimension(
    points: ArrayLike,
    sizes: ArrayLike | None = None,
    *,
    coordinates: Sequence[str | Coordinate] | None = None,
    scale: ArrayLike | None = None,
    origin: ArrayLike | None = None,
    n_offsets: int = 8,
    rng: Rng = 0,
    fit_range: tuple[float, float] | None = None,
) -> BoxCount:
    r"""Compute the box-counting dimension of a set of points.

    It is :math:`D_0 = -\frac{d \ln N(s)}{d \ln s}`, where N boxes of side s contain points of the set.

    All dyadic sizes are counted with one sort of the points, and each other size with a sort of its own.  A size is
    usable if the set intersects at least 10 boxes, and if the points miss at most 2 % of the boxes, by Chao's estimate
    from those that contain one and two points.  Among the usable sizes the scaling window is the one in
    which scatter and drift of the slope are least.

    Parameters
    ----------
    points : array_like, shape (n, d)
        The set, such as an attractor's orbit.
    sizes : array_like, optional
        Sides of boxes in units of the scales; by default the extent of the set and its halves, quarters, ...
    coordinates : sequence of str or Coordinate, optional
        Coordinates of the columns; the period of an angle is divided into a whole number of boxes.
    scale : array_like, shape (d,), optional
        Lengths that count as one.  By default 1 for all if all have the same unit and none is an angle; else the period
        of an angle, or the extent of the set.
    origin : array_like, shape (d,), optional
        A corner of a box, for one grid at a given position (for non-periodic coordinates; the boxes of an angle begin
        at its branch cut).
    n_offsets : int, optional
        Number of grids at random positions over which the counts are averaged.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of these positions.
    fit_range : tuple of float, optional
        Smallest and largest size for the fit; by default they are chosen automatically.

    Returns
    -------
    BoxCount
        Counts, window, dimension and its error.

    Raises
    ------
    ValueError
        For points or sizes that leave fewer than three usable sizes, and for arguments out of bounds.

    References
    ----------
    Liebovitch, Toth, Physics Letters A 141 (1989) 386 (one sort); Chao, Scandinavian Journal of Statistics 11 (1984)
    265 (unseen boxes).

    Examples
    --------
    >>> line = np.linspace(0.0, 1.0, 100_001)[:, None] * [1.0, 0.3]
    >>> round(box_dimension(line).dimension, 2)
    1.0
    """
    space = distinct(Space.of(points, coordinates, scale))
    chosen = None if sizes is None else checked_sizes(sizes)
    counts = over_offsets(space, chosen, origin, n_offsets, rng, Partition.occupancy)  # offset, size, kind
    tried = dyadic_sizes(space) if chosen is None else chosen
    if chosen is None:
        tried, counts = _without_tail(tried, counts)
    mean, errors = averaged(counts[..., 0])
    missed = unseen(counts)
    usable = (mean >= _FEWEST_BOXES) & (missed <= _MISSED)
    # A grid in a given place has no mean over places, of which alone Steiner's formula speaks.
    raised = edge_boxes(tried, mean, usable, space) if origin is None else np.zeros(len(tried))
    return fitted("points", tried, mean, errors, missed, usable, -raised, fit_range)


def checked_sizes(sizes: ArrayLike, name: str = "sizes") -> Floats:
    """Return sizes in falling order, at least three different ones."""
    chosen = np.unique(real_array(name, sizes).ravel())[::-1]
    if len(chosen) < 3 or not (np.isfinite(chosen).all() and (chosen > 0.0).all()):
        raise ValueError(f"{name}={sizes!r}: give at least three different positive sizes")
    return chosen


def averaged(counts: Floats) -> tuple[Floats, Floats]:
    """Return means over the first axis and their standard errors, 0 for one entry."""
    n = len(counts)
    return counts.mean(axis=0), counts.std(axis=0, ddof=1) / np.sqrt(n) if n > 1 else np.zeros(counts.shape[1:])


def unseen(counts: Floats) -> Floats:
    """Return the estimated fraction of boxes that points miss (Chao 1984), from counts (offset, size, any | 1 | 2)."""
    boxes, ones, twos = counts.mean(axis=0).T
    lost = ones * np.maximum(ones - 1.0, 0.0) / (2.0 * (twos + 1.0))
    return np.asarray(lost / (boxes + lost))


def edge_boxes(sizes: Floats, counts: Floats, usable: Bools, space: Space) -> Floats:
    """Return by how much boxes that only touch the edges of a set raise the logarithms of counts.

    On grids at random places a brick with the sides a, b, ... meets (1 + a/s) (1 + b/s) ... boxes of the size s on
    average (Steiner's formula): more than a b .../s**d by factors like 1 + s/a, and other sets have ends and edges too.
    Of the factors (1 + c s)**d, with c from 0 to four over the extent, that one is taken with which the counts of the
    usable sizes are closest to a line.  It does not matter at small sizes, and bends the line at large ones.
    """
    parts, d = sizes / space.extent, space.dimension
    if np.count_nonzero(usable) < 4:
        return np.zeros(len(sizes))
    x = -np.log(parts[usable])
    raised = d * np.log1p(_EDGES[:, None] * parts)
    trials = np.log(counts[usable]) - raised[:, usable]
    design = np.stack([np.ones_like(x), x], axis=1)
    rest = np.linalg.lstsq(design, trials.T, rcond=None)[1]
    freedom = max(len(x) - 3, 1)
    needed = rest[0] > rest.min() * (1.0 + stdtrit(freedom, 0.975) ** 2 / freedom)
    return np.asarray(raised[np.argmin(rest)] if needed else raised[0])


def fitted(
    subject: str,
    sizes: Floats,
    counts: Floats,
    errors: Floats,
    missed: Floats,
    usable: Bools,
    correction: Floats,
    window: tuple[float, float] | None,
    **more: Any,
) -> BoxCount:
    """Fit the counts of boxes, with what is added to their logarithms."""
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y, sigma = -np.log(sizes), np.log(counts) + correction, errors / counts
    labels = (f"ln 1/size{' (cells)' if 'topological' in more else ''}", "ln boxes")
    fit = fit_sizes(subject, x, y, sizes, usable, window, labels, to_the_end="topological" in more)
    return BoxCount(sizes, counts, errors, missed, usable, replace(fit, errors=sigma), **more)


def fit_sizes(
    subject: str,
    x: Floats,
    y: Floats,
    sizes: Floats,
    usable: Bools,
    window: tuple[float, float] | None,
    labels: tuple[str, str],
    to_the_end: bool = False,
) -> Fit:
    """Fit a line among usable sizes, or between two given ones."""
    if window is None:
        if np.count_nonzero(usable) < 3:
            remedy = "cells, or samples=1" if subject == "basins" else "points"
            raise ValueError(
                f"{subject}: {np.count_nonzero(usable)} sizes of boxes lie between those that saturate at either end, "
                f"and a window needs 3; give more {remedy}, or choose sizes= and window="
            )
        fit = scaling_fit(x, np.where(usable, y, np.nan), labels=labels, to_the_end=to_the_end)
        return replace(fit, y=y)
    low, high = (finite_number(f"fit_range[{k}]", v, above=0.0) for k, v in enumerate(window))
    chosen = np.flatnonzero((sizes >= low * (1 - 1e-9)) & (sizes <= high * (1 + 1e-9)) & np.isfinite(y))
    if len(chosen) < 3:
        raise ValueError(f"fit_range={window!r} contains {len(chosen)} sizes with boxes: give a range with 3 or more")
    return scaling_fit(x, y, (int(chosen[0]), int(chosen[-1])), labels=labels)


def _without_tail(sizes: Floats, counts: Floats) -> tuple[Floats, Floats]:
    """Leave out small sizes at which nearly each point has a box of its own, all but one."""
    boxes = counts[..., 0].mean(axis=0)
    last = int(np.argmax(boxes >= 0.98 * boxes[-1]))
    kept = slice(0, max(min(last + 2, len(sizes)), 3))
    return sizes[kept], counts[:, kept]
