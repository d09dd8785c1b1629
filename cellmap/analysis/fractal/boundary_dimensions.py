"""Box-counting dimension of basin boundaries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._lib.arrays import Bools, Floats
from ..._lib.checks import affordable_number, whole_number
from ..._lib.randomness import Rng, random_numbers
from ..._lib.signatures import checked
from ...basins.record import Basins
from .box_counting import BoxCount, averaged, checked_sizes, fitted
from .label_images import NO_BASIN, LabelImage, boundary_boxes, count_boxes, label_image

_FEWEST_BOXES = 10
_MISSED = 0.1
_LEAST_SHOWN = 1e-3
_FULL = 0.95
_FEWEST_ACROSS = 4
_MOST_OFFSETS = 64
_SPECK = 4  # cells of a speck, which touch at least at their corners
_ALONE = 0.05  # fraction of the boxes that may hold specks alone without changing the result
_GROWTH = 1.2  # growth of the odds of such boxes with their size that rounding of a few counts does not explain


@checked
def boundary_dimension(
    basins: Basins | NDArray[np.integer],
    sizes: ArrayLike | None = None,
    *,
    lattice: int | None = None,
    include: Sequence[int] = (),
    wraps: Sequence[bool] | None = None,
    n_offsets: int = 4,
    rng: Rng = 0,
    fit_range: tuple[float, float] | None = None,
) -> BoxCount:
    r"""Compute the box-counting dimension of a basin boundary.

    It is :math:`D_0 = -\frac{d \ln N(s)}{d \ln s}`, where N boxes of side s contain boundary.

    A box of s cells a side contains boundary if the cell centres in it, those on its border included, have more than
    one label.  A box thus spans s steps from cell to cell, the border between neighbouring boxes belongs to both, and a
    boundary between two boxes is not missed.  Boxes that the edge of the window cuts count by the fraction inside it.

    A size is usable if at least 10 boxes contain boundary, there are at least four along each axis, no more than 95 %
    of them contain boundary (unless this is so at all sizes), and the cells miss at most 10 % of the boxes.  The missed
    boxes are estimated from those that every other cell along each axis would miss, and the counts are corrected for
    them before the fit.  Among the usable sizes the scaling window is the one in which the slope
    scatters and drifts least.

    Isolated labels, in groups of at most four cells, result from structure below the size of a cell, or are wrong.  The
    former lie next to other boundary, so that the larger the boxes, the fewer contain nothing else;
    ``BoxCount.isolated`` is their fraction.  Where it grows with the size of boxes and exceeds 5 %, the isolated
    labels are noise and are ignored.  This works for up to some percent of wrong labels, as long as there is other
    boundary.

    Parameters
    ----------
    basins : Basins, or ndarray of int
        Basins on a grid, or labels of the cells of one, of any dimension and shape.  Axes of one cell are ignored.
    sizes : array_like of int, optional
        Sides of boxes in cells; by default 1, 2, 4, ...
    lattice : int, optional
        Examine every box of every size through a lattice of ``lattice + 1`` cells along each axis, instead of all of
        its cells.  The probability of missing a thin strand is then the same at all sizes, and the resolution of the
        image does not bend the line; use it where the boundary has structure below one cell.  Sizes are multiples of
        it.
    include : sequence of int, optional
        Negative labels that count as a basin, such as -2 (diverged) where infinity attracts.  All other negative labels
        are not basins: they form no boundary, neither with each other nor with a basin.
    wraps : sequence of bool, optional
        Which axes are periodic; by default as in the grid.
    n_offsets : int, optional
        Number of grids over which the counts are averaged: the first begins at the first cell, the others at random
        positions.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of these positions.
    fit_range : tuple of float, optional
        Smallest and largest size for the fit; by default they are chosen automatically.

    Returns
    -------
    BoxCount
        Counts, window, dimension and its error; sizes are in cells.

    Raises
    ------
    TypeError, ValueError
        For labels that are not integers, without a boundary, or too few cells for three usable sizes.

    References
    ----------
    McDonald, Grebogi, Ott, Yorke, Physica D 17 (1985) 125.

    Examples
    --------
    >>> x, y = np.meshgrid(*[np.linspace(-1.0, 1.0, 400)] * 2)
    >>> disc = (x**2 + y**2 < 0.5).astype(int)
    >>> found = boundary_dimension(disc)
    >>> round(found.dimension, 1), found.fractal
    (1.0, False)
    """
    image = label_image(basins, include, wraps)
    boundary = boundary_boxes(image)
    if not boundary.any():
        raise ValueError("labels: no two basins meet, so that there is no boundary; choose another window, or include=")
    steps = 1 if lattice is None else whole_number("lattice", lattice, at_least=1)
    chosen = _sizes(sizes, min(boundary.shape), steps)
    lengths = np.array(chosen, dtype=float)
    cleaned = without_specks(image)
    rest = boundary_boxes(cleaned)
    isolated = isolated_fractions(boundary, rest, image.wraps, chosen)
    if rest.any() and are_noise(isolated[lengths * _FEWEST_ACROSS <= min(boundary.shape) + 1]):
        image, boundary = cleaned, rest
    n_offsets = affordable_number("n_offsets", n_offsets, 8 * (3 * len(chosen) + 2 * boundary.ndim), at_least=1)
    rng = random_numbers(rng)
    if lattice is None:
        places = rng.integers(0, chosen[-1], (n_offsets, boundary.ndim))
        places[0] = 0
        counts, errors = averaged(count_boxes(boundary, image.wraps, chosen, place) for place in places)
        first = count_boxes(boundary, image.wraps, chosen, places[0])
        missed = _missed(image, boundary, chosen, dict(zip(chosen, first, strict=True)))
    else:
        measured = [sampled(image, boundary.size, size, steps, n_offsets, rng) for size in chosen]
        counts, errors = (np.array(v) for v in zip(*measured, strict=True))
        missed = np.zeros(len(chosen))
    fraction = counts * lengths**boundary.ndim / boundary.size
    usable = (counts >= _FEWEST_BOXES) & (lengths * _FEWEST_ACROSS <= min(boundary.shape) + 1) & (missed <= _MISSED)
    if usable.any() and fraction[np.argmax(usable)] <= _FULL:
        usable &= fraction <= _FULL
    lengths, counts, errors, missed = (v[::-1] for v in (lengths, counts, errors, missed))
    correction = -np.log1p(-missed)
    return fitted(
        *("basins", lengths, counts, errors, missed, usable[::-1], correction, fit_range),
        topological=boundary.ndim - 1,
        ignored=image.ignored,
        isolated=isolated[::-1],
    )


def _sizes(sizes: ArrayLike | None, most: int, step: int) -> list[int]:
    """Return sizes in rising order, of at most half of the shortest side."""
    if sizes is None:
        chosen = [step * 2**k for k in range(max(1, most).bit_length()) if step * 2**k <= max(most // 2, step)]
    else:
        checked = checked_sizes(sizes)[::-1]
        chosen = [whole_number("sizes", int(s), at_least=1) for s in checked]
        if (np.array(chosen) != checked).any() or any(s % step for s in chosen):
            raise ValueError(f"sizes={sizes!r}: give whole numbers of cells, multiples of lattice={step}")
        if chosen[-1] > most:
            raise ValueError(f"sizes: a box of {chosen[-1]} cells is larger than the image; give sizes up to {most}")
    return chosen


def _missed(image: LabelImage, boundary: NDArray[np.uint8], sizes: Sequence[int], known: dict[int, float]) -> Floats:
    """Return the estimated fraction of boxes with boundary in which the cells do not show it.

    With every other cell along each axis, a fraction of the boxes of twice a size is lost.  To a boundary that is
    similar to itself as many boxes of this size are lost by the cells, as compared with cells of half their width; and
    so on.  The losses at all larger sizes, taken together, are therefore what is missed at one.

    Parameters
    ----------
    known : dict
        Numbers of boxes of some sizes on the grid that begins at the first cell.
    """
    none = [0] * boundary.ndim
    half = image.every(2, none)
    coarse = boundary_boxes(half)
    twice = [2 << k for k in range(max(min(boundary.shape).bit_length() - 2, 0))]
    if not coarse.size or not twice:
        return np.zeros(len(sizes))
    unknown = [s for s in twice if s not in known]
    known = known | dict(zip(unknown, count_boxes(boundary, image.wraps, unknown, none), strict=True))
    found = np.array([known[s] for s in twice]) / boundary.size
    seen = count_boxes(coarse, half.wraps, [s // 2 for s in twice], none) / (coarse.size * 2.0**boundary.ndim)
    kept = np.clip(seen / np.maximum(found, 1e-300), _LEAST_SHOWN, 1.0)
    shown = np.append(np.cumprod(kept[::-1])[::-1], 1.0).clip(_LEAST_SHOWN)  # at the sizes 1, 2, 4, ...
    return np.asarray(1.0 - np.interp(np.log2(sizes), np.arange(len(shown)), shown))


def sampled(
    image: LabelImage, cells: int, size: int, samples: int, offsets: int, rng: np.random.Generator
) -> tuple[float, float]:
    """Count the boxes of one size that show more than one label through a lattice of cells; mean and its error.

    The larger the boxes, the fewer there are, and the more lattices lie beside one another: as many more are looked at.
    """
    step = size // samples
    found = []
    for _ in range(min(offsets * step, _MOST_OFFSETS)):
        part = image.every(step, rng.integers(0, step, image.numbers.ndim).tolist())
        bits = boundary_boxes(part)
        inside = rng.integers(0, samples, bits.ndim)
        found.append(
            count_boxes(bits, part.wraps, [samples], inside.tolist())[0] * cells / (step**bits.ndim * bits.size)
        )
    mean, error = averaged(np.array(found))
    return float(mean), float(error)


def without_specks(image: LabelImage) -> LabelImage:
    """Return an image in which specks, of at most four cells, have a label of the cells around them."""
    small = np.zeros(image.numbers.shape, bool)
    for basin in range(len(image.names)):
        small |= _pieces_of_few_cells(image.numbers == basin)
    labels = image.numbers.copy()
    for _ in range(_SPECK):
        places = np.nonzero(small)
        for axis in range(labels.ndim):
            for step in (-1, 1):
                beside = list(places)
                beside[axis] = places[axis] + step
                n = labels.shape[axis]
                beside[axis] = beside[axis] % n if image.wraps[axis] else beside[axis].clip(0, n - 1)
                known = small[places] & ~small[tuple(beside)] & (labels[tuple(beside)] != NO_BASIN)
                chosen = tuple(p[known] for p in places)
                labels[chosen] = labels[tuple(b[known] for b in beside)]
                small[chosen] = False
    return replace(image, numbers=labels)


def _pieces_of_few_cells(inside: Bools) -> Bools:
    from scipy.ndimage import label

    numbers = label(inside, np.ones((3,) * inside.ndim))[0]
    few = np.bincount(numbers.ravel()) <= _SPECK
    few[0] = False
    return np.asarray(few[numbers])


def isolated_fractions(
    boundary: NDArray[np.uint8], rest: NDArray[np.uint8], wraps: Sequence[bool], sizes: Sequence[int]
) -> Floats:
    """Return the fraction of the boxes with boundary of each size that hold none of the rest, which specks leave."""
    found, left = (count_boxes(bits, wraps, sizes, [0] * bits.ndim) for bits in (boundary, rest))
    return np.asarray(np.clip(1.0 - left / np.maximum(found, 1e-300), 0.0, 1.0))


def are_noise(isolated: Floats) -> bool:
    """Return whether specks lie away from other boundary, by the fraction of boxes that hold them alone.

    Shares begin at the smallest size.  They fall with the size where specks are what cells show of finer structure.
    """
    odds = isolated / np.maximum(1.0 - isolated, 1e-300)
    return bool(isolated.max(initial=0.0) > _ALONE and odds.max() > _GROWTH * odds[0])
