"""Box-counting (capacity) dimension of sets of points."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from ..._lib.arrays import Bools, Floats
from ..._lib.checks import finite_number, real_array
from ..._lib.fit import Fit, fit_line, scaling_fit, unseen_error
from ..._lib.randomness import Rng, random_numbers
from ..._lib.signatures import checked
from ...maps.coordinates import Coordinate
from .edge_laws import EDGES, best_law, edge_laws, edges_of_sets, law_weights, slopes_of
from .partitions import TOGETHER, Partition, Space, distinct, dyadic_sizes, over_offsets

_FEWEST_BOXES = 10
_MISSED = 0.03
_TOLD = 0.1  # fraction of missed boxes, as a logarithm, up to which its estimate helps to choose a law of edges
_FEWEST_POINTS = 4  # mean number of points in a box for that: a lattice fills boxes evenly until it suddenly does not
_MARGIN = 0.02  # counts of straight lines on oblique grids come as close to whole numbers as this
_LAST = 6
_AHEAD = 100.0
_STRETCH = 64.0  # ratio of the sides of stretched boxes, to the power d: a larger one leaves them too few sizes


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
    stretched : tuple of Fit
        The same for boxes of equal volume that are shorter along one axis, for each axis where enough sizes are usable;
        none for a boundary, on a line, and for a grid at a given place.
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
    stretched: tuple[Fit, ...] = ()

    def __repr__(self) -> str:
        first, last = self.sizes[self.fit.inside][[0, -1]]
        found = f"dimension {self.dimension:.4g} +- {self.standard_error:.2g}, sizes {last:.3g} to {first:.3g}"
        return f"BoxCount({found}{', scales do not agree' if self.scales_agree is False else ''})"

    @property
    def dimension(self) -> float:
        """Box-counting dimension: the slope in the window."""
        return self.fit.slope

    @property
    def standard_error(self) -> float:
        """Standard error of the dimension: scatter and drift of the slope, and the choice of the window."""
        return self.fit.standard_error

    @property
    def scales_agree(self) -> bool | None:
        """Whether boxes that are shorter along one axis or another give the same dimension.

        A linear map leaves the dimension of a set as it is, so that they must.  While the slope of a self-affine set is
        still on the way to its dimension, they do not.  False if the largest and the least of these dimensions
        (`stretched`) are apart by more than two standard errors of their difference: then the slope changes below the
        sizes in the window, and the stated error may be too small.  True does not exclude that: where
        the boundary of a set has nearly its dimension, all boxes tell the same too small one.  None where there are
        less than two of them.
        """
        if len(self.stretched) < 2:
            return None
        low, *_, high = sorted(self.stretched, key=lambda fit: fit.slope)
        return bool(high.slope - low.slope <= 2.0 * np.hypot(low.standard_error, high.standard_error))

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
    usable if the set intersects at least 10 boxes, and if the points miss at most 3 % of the boxes, by Chao's estimate
    from those that contain one and two points.  Among the usable sizes the scaling window is the one in
    which scatter and drift of the slope are least.

    The standard error counts, in squares, scatter and drift of the slope, the choice of the window, the most that the
    points may miss, and by how much laws of edges that fit the counts differ in the dimension: the slope of a
    self-affine set reaches its dimension slowly.  Boxes that are shorter along one axis are counted as well, for each
    axis; where they tell another dimension, ``BoxCount.scales_agree`` is False.

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
    generator, d = random_numbers(rng), space.dimension

    def counted(space: Space) -> tuple[Floats, Floats, Floats]:
        counts, errors = averaged(over_offsets(space, chosen, origin, n_offsets, generator, Partition.occupancy))
        if chosen is not None:
            return chosen, counts, errors[:, 0]
        kept = _without_tail(counts[:, 0])
        return dyadic_sizes(space)[kept], counts[kept], errors[kept, 0]

    found = count_of(*counted(space), space, fit_range, placed=origin is not None)
    if d == 1 or origin is not None:
        return found
    stretched = list[Fit]()
    for sides in _STRETCH ** ((1.0 / d - np.eye(d)) / d):
        with suppress(ValueError):  # too few sizes are usable
            tried, counts, errors = counted(space.stretched(sides))
            laws = edges_of_sets(tried[:, None] * sides / space.extent)
            stretched.append(straightened(tried, counts, errors, laws, d, fit_range)[0].fit)
    return replace(found, stretched=tuple(stretched))


def count_of(
    tried: Floats,
    counts: Floats,
    errors: Floats,
    space: Space,
    fit_range: tuple[float, float] | None,
    placed: bool,
) -> BoxCount:
    """Fit mean counts (size, any | 1 | 2) of boxes on grids at random places, or on one at a given place."""
    # A grid in a given place has no mean over places, of which alone Steiner's formula speaks.
    edges, likely = edge_laws(tried / space.extent, 0 if placed else space.dimension)
    found, raised = straightened(tried, counts, errors, edges[: len(EDGES)], space.dimension, fit_range)
    part, mean, x = found.fit.inside, found.counts, -np.log(tried)
    slopes = slopes_of(x[part], edges[:, part])
    # Laws are distinguished at further sizes as well, where what is missed is taken as midway between its bounds.
    lost = -0.5 * np.log1p(-np.stack(unseen(counts, space.dimension))).sum(axis=0)
    told = np.append(((lost > _TOLD) | (_FEWEST_POINTS * mean > len(space.points)))[part.stop :], True)
    part = slice(part.start, part.stop + int(np.argmax(told)))
    logs = (np.log(mean) + lost - edges)[:, part]
    weights = law_weights(x[part], logs, (errors / mean)[part], likely, space.dimension)
    spread = np.sqrt(weights @ (slopes - slopes[raised]) ** 2)
    error = float(np.hypot(found.standard_error, spread))
    return replace(found, fit=replace(found.fit, standard_error=error))


def straightened(
    tried: Floats,
    counts: Floats,
    errors: Floats,
    laws: Floats,
    dimension: int,
    fit_range: tuple[float, float] | None,
) -> tuple[BoxCount, int]:
    """Fit mean counts less what edges add by one of some laws; return the number of the law as well.

    The error includes the most that the points may miss.
    """
    mean, (missed, most) = counts[:, 0], unseen(counts, dimension)
    usable = (mean >= _FEWEST_BOXES) & (missed <= _MISSED)
    x = -np.log(tried)
    raised = best_law(x[usable], np.log(mean[usable]), laws[:, usable]) if np.count_nonzero(usable) > 3 else 0
    found = fitted("points", tried, mean, errors, missed, usable, -laws[raised], fit_range)
    part = found.fit.inside
    unsure = slopes_of(x[part], -np.log1p(-most)[part])
    return replace(found, fit=replace(found.fit, standard_error=float(np.hypot(found.standard_error, unsure)))), raised


def checked_sizes(sizes: ArrayLike, name: str = "sizes") -> Floats:
    """Return sizes in falling order, at least three different ones."""
    chosen = np.unique(real_array(name, sizes).ravel())[::-1]
    if len(chosen) < 3 or not (np.isfinite(chosen).all() and (chosen > 0.0).all()):
        raise ValueError(f"{name}={sizes!r}: give at least three different positive sizes")
    return chosen


def averaged(found: Iterable[NDArray[Any]]) -> tuple[Floats, Floats]:
    """Return means and their standard errors, 0 for one entry; of many arrays few are kept (Chan et al. 1979)."""
    count, mean, squares, rest = 0, np.zeros(()), np.zeros(()), iter(found)
    while part := list(islice(rest, TOGETHER)):
        block = np.asarray(part, dtype=np.float64)
        count += len(block)
        away = block.mean(axis=0) - mean
        squares = squares + ((block - block.mean(axis=0)) ** 2).sum(axis=0)
        squares = squares + away**2 * (len(block) * (count - len(block)) / count)
        mean = mean + away * (len(block) / count)
    return mean, np.sqrt(squares / max(count - 1, 1) / count)


def unseen(counts: Floats, dimension: int) -> tuple[Floats, Floats]:
    """Return the least and the most that points may miss of the boxes, from mean counts (size, any | 1 | 2).

    With f1 and f2 boxes that contain one and two points, Chao's lower bound (1984) of the boxes missed is f1**2/(2 f2),
    exact for boxes of equal weight.  But a grid cuts boxes that hold arbitrarily little of the set: of a tip that
    reaches a distance t into a box, the weight goes like t to the power of a dimension, and t is uniform, so that a
    number like p**(1/dimension) of boxes weigh less than p.  Then the number missed by n points goes like n**-b with b
    of at least 1/dimension, of which f1 and f2 are derivatives: f1/b boxes are missed, and b is 2 f2/f1 - 1.
    """
    boxes, ones, twos = counts[:, :3].T
    least = ones * np.maximum(ones - 1.0, 0.0) / (2.0 * (twos + 1.0))
    most = ones**2 / np.maximum(np.maximum(2.0 * twos - ones, ones / dimension), 1e-9)
    return np.asarray(least / (boxes + least)), np.asarray(most / (boxes + most))


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
    argument: str = "sizes",
) -> Fit:
    """Fit a line among usable sizes, or between two given ones."""
    if window is None:
        if not (usable[:-2] & usable[1:-1] & usable[2:]).any():
            remedy = "cells, or lattice=1" if subject == "basins" else "points"
            raise ValueError(
                f"{subject}: {np.count_nonzero(usable)} sizes of boxes lie between those that saturate at either end, "
                f"and a window needs 3 neighbours; give more {remedy}, or choose {argument}= and fit_range="
            )
        fit = scaling_fit(x, np.where(usable, y, np.nan), labels=labels, to_the_end=to_the_end)
        return replace(fit, y=y)
    low, high = (finite_number(f"fit_range[{k}]", v, above=0.0) for k, v in enumerate(window))
    chosen = np.flatnonzero((sizes >= low * (1 - 1e-9)) & (sizes <= high * (1 + 1e-9)) & np.isfinite(y))
    if len(chosen) < 3:
        raise ValueError(f"fit_range={window!r} contains {len(chosen)} sizes with boxes: give a range with 3 or more")
    return scaling_fit(x, y, (int(chosen[0]), int(chosen[-1])), labels=labels)


def _without_tail(boxes: Floats) -> slice:
    """Leave out small sizes at which nearly each point has a box of its own, all but one."""
    last = int(np.argmax(boxes >= 0.98 * boxes[-1]))
    return slice(0, max(min(last + 2, len(boxes)), 3))
