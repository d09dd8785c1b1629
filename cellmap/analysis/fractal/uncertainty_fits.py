"""Uncertainty exponents from counts of uncertain pairs, those of basin images too, with a verdict on the boundary."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..._lib.arrays import Bools, Floats, Ints
from ..._lib.binomial import binomial_interval
from ..._lib.checks import shown, whole_array, whole_number
from ..._lib.fit import Fit, fit_line, scaling_fit
from ..._lib.signatures import checked
from ...basins.record import Basins
from ...maps.orbit_batch import Cost
from ...orbits.attractor import Attractor
from .label_images import NO_BASIN, LabelImage, label_image

SMOOTH, FRACTAL, UNDETERMINED, NO_BOUNDARY = "consistent with smooth", "fractal", "undetermined", "no boundary"
"""Verdicts on a boundary.  Smoothness cannot be proved: the dimension may be larger by less than the error."""

_FEWEST = 20  # uncertain pairs at a distance that is used
_UNDECIDED = 0.1  # undecided pairs, relative to uncertain ones, from which a distance is not used
_RISE = 2.0  # the slope is extrapolated by its change between the halves of the distances, times this
_VAGUE = 0.1  # standard error, and distance from 1, above which nothing is called consistent with smooth
_BLOCKS = 8  # blocks of an image along each axis whose scatter gives the errors
_COARSEST = 8  # largest distance, as a part of the shorter side


@dataclass(frozen=True, eq=False)
class UncertaintyExponent:
    """Uncertainty exponent, with the counts of uncertain pairs of initial conditions at several distances.

    Parameters
    ----------
    fit : Fit or None
        Fit of the logarithm of the fraction against that of the distance; None if fewer than three distances have
        uncertain pairs.
    distances : ndarray, shape (n,)
        Distances of the pairs, decreasing.
    pairs, uncertain : ndarray of int, shape (n,)
        Number of pairs in which both initial conditions have a basin, and of those in which the basins differ.
    left_out, undecided : ndarray of int, shape (n,)
        Number of pairs that were excluded because an initial condition has no basin, and of those among them with an
        undecided one.
    dimension : int
        Dimension D of the region of the initial conditions.
    floor : float
        Smallest distance that the accuracy of the map, or the resolution of the image, allows.
    unit : str
        Unit of the distances.
    attractors : tuple of Attractor
        Attractors whose basins were distinguished.
    cost : Cost
        Wall time and number of initial conditions.
    name : str
        Name of the system.
    """

    fit: Fit | None
    distances: Floats
    pairs: Ints
    uncertain: Ints
    left_out: Ints
    undecided: Ints
    dimension: int
    floor: float
    unit: str
    attractors: tuple[Attractor, ...] = ()
    cost: Cost = Cost()
    name: str = ""

    def __repr__(self) -> str:
        if self.fit is None:
            return (
                f"UncertaintyExponent({self.verdict}, {self.uncertain.sum()} of {self.pairs.sum():,} pairs uncertain)"
            )
        return (
            f"UncertaintyExponent({self.exponent:.4f} +- {self.standard_error:.2g} from {self.decades:.1f} decades, "
            f"{self.pairs.sum():,} pairs: {self.verdict})"
        )

    @property
    def exponent(self) -> float:
        """Uncertainty exponent: slope of the fit, NaN without one."""
        return self.fit.slope if self.fit is not None else np.nan

    @property
    def standard_error(self) -> float:
        """Standard error of the exponent, NaN without a fit."""
        return self.fit.standard_error if self.fit is not None else np.nan

    @property
    def boundary_dimension(self) -> float:
        """Box-counting dimension of the boundary, D - exponent; its standard error is that of the exponent."""
        return self.dimension - self.exponent

    @property
    def fractions(self) -> Floats:
        """Fraction of uncertain pairs at each distance."""
        return np.asarray(self.uncertain / np.maximum(self.pairs, 1))

    @property
    def intervals(self) -> Floats:
        """95 % confidence interval of each fraction (Wilson 1927), shape (n, 2); pairs are taken as independent."""
        return np.stack(binomial_interval(self.uncertain, self.pairs, method="Wilson"), axis=-1)

    @property
    def decades(self) -> float:
        """Number of decades between the largest and the smallest distance of the fit."""
        return 0.0 if self.fit is None else float(np.ptp(self.fit.x[self.fit.inside]) / np.log(10.0))

    @property
    def spans_a_decade(self) -> bool:
        """Whether the fit spans a decade of distances, below which nothing is said of a boundary."""
        return self.decades >= 1.0 - 1e-9

    @property
    def verdict(self) -> str:
        """Verdict on the boundary: "fractal", "consistent with smooth", "undetermined" or "no boundary".

        Nothing is said of less than a decade of distances.  Consistent with smooth: 1 lies within two standard errors
        of the exponent, and within 0.1, to which it is known.  This includes fractal boundaries whose dimension is as
        close to that of a smooth one, such as many Julia sets, and sets that repeat themselves over more than the
        distances of the fit.  Fractal: the exponent is more than three standard errors below 1, and so is that of the
        finer half of the distances, even if it continued to rise by twice as much as it has risen from the coarser
        half, as it does where adjacent smooth pieces begin to be resolved.  The statistical uncertainty of that rise
        counts as error.  Everything else is undetermined.
        """
        if self.fit is None:
            return UNDETERMINED if self.uncertain.any() or not self.pairs.any() else NO_BOUNDARY
        slope, error = self.exponent, self.standard_error
        if not self.spans_a_decade:
            return UNDETERMINED
        if slope > 1.0 - 2.0 * error:
            return SMOOTH if error <= _VAGUE and abs(slope - 1.0) <= _VAGUE else UNDETERMINED
        halves = _halves(self.fit)
        if slope > 1.0 - 3.0 * error or halves is None:
            return UNDETERMINED
        (coarse, coarse_error), (fine, fine_error) = halves
        ahead = fine + _RISE * max(fine - coarse, 0.0)
        doubt = float(np.hypot((1.0 + _RISE) * fine_error, _RISE * coarse_error))
        return FRACTAL if ahead < 1.0 - 3.0 * doubt else UNDETERMINED


def with_fit(found: UncertaintyExponent, window: tuple[int, int] | None = None) -> UncertaintyExponent:
    """Fit the exponent to counts of independent pairs, where there are enough of them."""
    usable = usable_distances(found)
    if window is None and not usable.any():
        return found
    x, y, labels = logarithms(found)
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = np.sqrt((found.pairs - found.uncertain) / (1.0 * found.pairs * found.uncertain))
    # The law holds in the limit of small distances, and at large ones the fraction saturates.
    fit = scaling_fit(x, np.where(usable, y, np.nan) if window is None else y, window, errors, labels, to_the_end=True)
    return replace(found, fit=replace(fit, y=y))


def logarithms(found: UncertaintyExponent) -> tuple[Floats, Floats, tuple[str, str]]:
    """Return the logarithms of distances and of fractions, and what they are."""
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = np.log(found.distances), np.log(found.uncertain / found.pairs)
    return x, y, (f"ln distance ({found.unit})", "ln fraction of uncertain pairs")


def usable_distances(found: UncertaintyExponent) -> Bools:
    """Return at which distances there are pairs enough; at none where fewer than three of them lead to the smallest."""
    usable = (found.uncertain >= _FEWEST) & (found.uncertain < found.pairs)
    usable &= found.undecided <= _UNDECIDED * found.uncertain
    places = np.flatnonzero(usable)
    if len(places) < 3 or not usable[places[-1] - 2 : places[-1]].all():
        usable[:] = False
    return np.asarray(usable)


def _halves(fit: Fit) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Return slope and error of the coarser and of the finer half of a window."""
    order = np.argsort(-fit.x[fit.inside]) + fit.fit_range[0]
    if len(order) < 6:
        return None
    parts = []
    for part in (order[: len(order) // 2], order[len(order) // 2 :]):
        errors = None if fit.errors is None else fit.errors[part]
        line = fit_line(fit.x[part], fit.y[part], (0, len(part) - 1), errors)
        parts.append((line.slope, line.standard_error))
    return parts[0], parts[1]


@checked
def image_uncertainty_exponent(
    basins: Basins | ArrayLike,
    distances: ArrayLike | None = None,
    include: Sequence[int] = (),
    wraps: Sequence[bool] | None = None,
    fit_range: tuple[int, int] | None = None,
) -> UncertaintyExponent:
    r"""Compute the uncertainty exponent of a basin boundary from a basin image.

    It is the :math:`\alpha` of :math:`f(k) \propto k^{\alpha}`, the fraction of pairs with different labels.

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
        given = whole_array("distances", steps, "a decreasing list of whole numbers")
        if given.ndim != 1 or not len(given) or not (np.diff(given) < 0).all():
            raise ValueError(f"distances={shown(steps)}: give a decreasing list of distances in cells")
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
