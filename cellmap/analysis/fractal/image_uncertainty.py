"""Uncertainty exponent of a basin boundary, from a basin image."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..._lib.arrays import Floats, Ints
from ..._lib.checks import whole_number
from ..._lib.fit import fit_line, scaling_fit
from ..._lib.signatures import checked
from ...basins.record import Basins
from ...maps.orbit_batch import Cost
from .label_images import NO_BASIN, LabelImage, label_image
from .uncertainty_fits import UncertaintyExponent, logarithms, usable_distances

_BLOCKS = 8  # along each axis: parts of an image whose scatter gives the errors
_COARSEST = 8  # largest distance, as a part of the shorter side


@checked
def image_uncertainty_exponent(
    basins: Basins | ArrayLike,
    distances: ArrayLike | None = None,
    include: Sequence[int] = (),
    wraps: Sequence[bool] | None = None,
    fit_range: tuple[int, int] | None = None,
) -> UncertaintyExponent:
    """Compute the uncertainty exponent of a basin boundary from a basin image.

    All pairs of cells that are k cells apart along an axis are compared, for all axes together, across the branch cut
    of periodic axes too.  For the meaning of the exponent see :func:`uncertainty_exponent`.  Neighbouring pairs are not
    independent: standard errors are computed by leaving out each of 8 blocks of the image along each axis (jackknife;
    Tukey 1958).

    Parameters
    ----------
    basins : Basins or array_like of int
        Basins on a grid, or labels of cells in any number of dimensions.  Pairs with a cell of a negative label
        (escaped, diverged, undecided), or of a missing one, are excluded.
    distances : array_like of int, optional
        Distances k in cells, decreasing; by default about four in an octave, from an eighth of the shorter side.
    include : sequence of int, optional
        Negative labels that count as basins: (-2,) for initial conditions that diverge.
    wraps : sequence of bool, optional
        Which axes of an array are periodic; for basins the grid determines it.
    fit_range : tuple of int, optional
        Numbers of the first and last distance of the fit.  By default it ends at the smallest distance, and begins
        where scatter and drift of the slope are least: fractions saturate at large distances.

    Returns
    -------
    UncertaintyExponent
        Counts at each distance, the fitted exponent and a verdict on the boundary at the scales of the image.

    Raises
    ------
    TypeError, ValueError
        For something that is not a basin image, or distances beyond half of it.

    References
    ----------
    Grebogi, McDonald, Ott, Yorke, Physics Letters A 99 (1983) 415.

    Examples
    --------
    >>> import numpy as np
    >>> halves = np.add.outer(np.arange(200), np.arange(300)) > 250
    >>> image_uncertainty_exponent(halves)
    UncertaintyExponent(1.0065 +- 0.014 from 1.0 decades, 1,616,000 pairs: consistent with smooth)
    """
    began = time.perf_counter()
    image = label_image(basins, include, wraps)
    distances = _steps(image, distances)
    blocks = np.array([_compare(image, int(k)) for k in distances])  # distance, block, kind
    drawn, hits, without = blocks.sum(axis=1).T
    found = UncertaintyExponent(
        fit=None,
        distances=distances.astype(float),
        pairs=drawn - without,
        uncertain=hits,
        left_out=without,
        undecided=np.zeros_like(without),
        dimension=image.numbers.ndim,
        floor=1.0,
        unit="cells",
        attractors=basins.attractors if isinstance(basins, Basins) else (),
        cost=Cost(time.perf_counter() - began, image.numbers.size),
        name=image.source,
    )
    if not usable_distances(found).any():
        return found
    x, y, labels = logarithms(found)
    samples = _jackknife(blocks)
    scale = (len(samples) - 1) / np.sqrt(len(samples))
    errors = np.maximum(scale * samples.std(axis=0), 1e-6)
    # Shares at different distances are made of the same boundary, so that their errors are no weights.
    line = scaling_fit(x, np.where(found.uncertain > 0, y, np.nan), fit_range, labels=labels, to_the_end=True)
    slopes = [fit_line(x, s, line.fit_range).slope for s in samples]
    error = float(np.hypot(line.standard_error, scale * np.std(slopes)))
    return replace(found, fit=replace(line, errors=errors, standard_error=error))


def finest_exponent(image: LabelImage) -> tuple[float, float]:
    """Return the exponent between distances of two cells and of one, with its standard error; NaN without a boundary.

    It is 1 for a smooth boundary that the cells resolve, however wide the smooth basins are compared with anything
    else: a guard against taking narrow smooth basins for a fractal.
    """
    if min(image.numbers.shape) < 4:
        return np.nan, np.nan
    blocks = np.array([_compare(image, k) for k in (2, 1)])
    if not (blocks.sum(axis=1)[:, 1] > 0).all():
        return np.nan, np.nan
    samples = -np.diff(_jackknife(blocks), axis=1)[:, 0] / np.log(2.0)
    fractions = blocks.sum(axis=1)[:, 1] / (blocks.sum(axis=1)[:, 0] - blocks.sum(axis=1)[:, 2])
    scale = (len(samples) - 1) / np.sqrt(len(samples))
    return float(np.log2(fractions[0] / fractions[1])), float(scale * samples.std())


def is_rough(finest: tuple[float, float]) -> bool:
    """Return whether a finest exponent is below 1 beyond doubt: by three standard errors, and by 0.05."""
    return bool(finest[0] + 3.0 * finest[1] < 1.0 and finest[0] < 0.95)


def _steps(image: LabelImage, steps: ArrayLike | None) -> Ints:
    shortest = min(image.numbers.shape)
    if steps is not None:
        given = np.asarray(steps)
        if given.ndim != 1 or not len(given) or not (np.diff(given) < 0).all():
            raise ValueError(f"distances={steps!r}: give a decreasing list of distances in cells")
        return np.array([whole_number("distances", k, at_least=1, at_most=max(1, shortest // 2)) for k in given])
    largest = max(1, shortest // _COARSEST)
    octaves = np.log2(largest)
    return np.unique(np.round(2.0 ** np.arange(0.0, octaves + 1e-9, 0.25)).astype(np.int64))[::-1]


def _compare(image: LabelImage, step: int) -> Ints:
    """Return for each block how many pairs there are, how many are uncertain, how many are left out."""
    counts = np.zeros((_BLOCKS**image.numbers.ndim, 3), np.int64)
    complete = image.complete
    for axis in range(image.numbers.ndim):
        for one, other in image.neighbours(axis, step):
            differ = one != other
            if not complete:
                missing = (one == NO_BASIN) | (other == NO_BASIN)
                differ &= ~missing
            for k, block in enumerate(_blocks(one.shape)):
                counts[k, 0] += one[block].size
                counts[k, 1] += np.count_nonzero(differ[block])
                if not complete:
                    counts[k, 2] += np.count_nonzero(missing[block])
    return counts


def _blocks(shape: tuple[int, ...]) -> Iterator[tuple[slice, ...]]:
    """Divide an image into blocks, as many along each axis."""
    for place in np.ndindex(*(_BLOCKS,) * len(shape)):
        yield tuple(slice(k * n // _BLOCKS, (k + 1) * n // _BLOCKS) for k, n in zip(place, shape, strict=True))


def _jackknife(blocks: Ints) -> Floats:
    """Return the logarithms of fractions without one block each, shape (blocks, distances)."""
    rest = blocks.sum(axis=1)[:, None] - blocks
    pairs, hits = rest[..., 0] - rest[..., 2], rest[..., 1]
    # Half a pair where the only uncertain ones are in one block: the error is then as large as it has to be.
    return np.asarray(np.log(np.maximum(hits, 0.5) / np.maximum(pairs, 1)).T)
