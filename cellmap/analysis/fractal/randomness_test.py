"""Test for fractal basin boundaries at a given scale, by the entropy of random discs (Puy et al. 2021)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import quad
from scipy.special import betainc, xlogy

from ..._lib.arrays import Floats, Ints
from ..._lib.checks import affordable_number, finite_number, whole_array, whole_number
from ..._lib.randomness import Rng, random_numbers
from ..._lib.signatures import checked
from ...basins.record import Basins
from .entropy import box_entropies, count_at
from .label_images import LabelImage, label_image
from .uncertainty_fits import (
    FRACTAL,
    NO_BOUNDARY,
    SMOOTH,
    UNDETERMINED,
    UncertaintyExponent,
    finest_exponent,
    image_uncertainty_exponent,
    is_rough,
)

_BATCH = 4096  # discs that are drawn together
_PATIENCE = 500  # largest number of discs that are drawn for each disc wanted on the boundary
_FEWEST = 100  # discs on the boundary below which nothing is concluded
_TILES = 16  # parts of the image along each axis that count as independent
_SIGNIFICANT = 3.0  # standard errors
_DIRECTIONS = 720


@dataclass(frozen=True, eq=False)
class FractalTest:
    """Entropy of random discs on a basin boundary, compared with that of a smooth boundary.

    Parameters
    ----------
    entropy, standard_error : float
        Mean over discs with several basins, and its standard error.  Discs in one part of the image, a sixteenth of
        each side, count as dependent.
    smooth : float
        Entropy of a straight boundary in discs of the same cells, mean over its directions.
    smooth_range : tuple of float
        Smallest and largest entropy of a straight boundary over its directions, which differ because of the cells.
    radius : float
        Radius of the discs, in cells.
    cells : int
        Number of cells in a disc.
    discs, drawn : int
        Number of discs on the boundary, and of all discs drawn.
    entropies : ndarray, shape (discs,)
        Entropy of each disc on the boundary.
    finest : tuple of float
        Local uncertainty exponent between distances of two cells and one, and its standard error.
    exponent : UncertaintyExponent
        Uncertainty exponent of the image: what it shows at the other scales.
    name : str
        Name of the system.
    """

    entropy: float
    standard_error: float
    smooth: float
    smooth_range: tuple[float, float]
    radius: float
    cells: int
    discs: int
    drawn: int
    entropies: Floats
    finest: tuple[float, float]
    exponent: UncertaintyExponent
    name: str = ""

    def __repr__(self) -> str:
        return (
            f"FractalTest({self.entropy:.4g} +- {self.standard_error:.2g}, smooth {self.smooth:.4g}, "
            f"{self.discs} discs of radius {self.radius:g} cells: {self.verdict})"
        )

    @property
    def verdict(self) -> str:
        """Verdict on the boundary: "fractal", "consistent with smooth", "undetermined" or "no boundary".

        Discs of one radius show one scale, at which sparse fractals look smooth and narrow smooth basins mixed; so the
        uncertainty exponent of the image has to agree, over a decade of distances at least.  Fractal: the mean is more
        than three standard errors above the range of a straight boundary, the exponent is as far below 1, and the cells
        themselves show no smooth boundary: next to one the fraction of pairs of cells that differ doubles with
        their distance, even where it is too curved for the discs or its basins are narrower than these.  Consistent
        with smooth: the mean is within the range, or no more than two standard errors away, and the exponent is
        consistent with a smooth boundary.  In between, and with fewer than 100 discs on the boundary, it is
        undetermined; so is a mean far below the range, where discs contain little of a second basin: this results from
        thin strands of a fractal as well as from a few wrong labels beside a smooth boundary.
        """
        if not self.discs:
            return NO_BOUNDARY
        if self.discs < _FEWEST or not np.isfinite(self.standard_error):
            return UNDETERMINED
        away = max(self.smooth_range[0] - self.entropy, self.entropy - self.smooth_range[1], 0.0)
        pairs = self.exponent
        if away > _SIGNIFICANT * self.standard_error + 1e-9:
            mixed = self.entropy > self.smooth_range[1] and is_rough(self.finest)
            below = pairs.exponent + _SIGNIFICANT * pairs.standard_error < 1.0
            return FRACTAL if mixed and below and pairs.spans_a_decade else UNDETERMINED
        return SMOOTH if away <= 2.0 * self.standard_error and pairs.verdict == SMOOTH else UNDETERMINED


@checked
def fractal_boundary_test(
    basins: Basins | ArrayLike,
    radius: float | None = None,
    n_discs: int = 2000,
    include: Sequence[int] = (),
    wraps: Sequence[bool] | None = None,
    *,
    rng: Rng = 0,
) -> FractalTest:
    r"""Test whether a basin boundary is smooth in discs of a given radius.

    The boundary is consistent with a smooth one if the mean of :math:`-\sum_j p_j \ln p_j` over discs is that of
    straight cuts.

    Discs (balls) around random cells are drawn, and the entropy of the basins in those that contain more than one is
    compared with that of discs cut by a straight boundary, see
    :func:`~cellmap.analysis.fractal.smooth_boundary_entropy`.

    Parameters
    ----------
    basins : Basins or array_like of int
        Basins on a grid, or labels of cells in any number of dimensions.  Cells of a negative label (escaped, diverged,
        undecided), or of a missing one, do not count; a disc of which less than half has a basin is excluded.
    radius : float, optional
        Radius in cells, by default a fiftieth of the shorter side, and at least 4.
    n_discs : int, optional
        Number of discs on the boundary to draw.
    include : sequence of int, optional
        Negative labels that count as basins: (-2,) for initial conditions that diverge.
    wraps : sequence of bool, optional
        Which axes of an array are periodic; for basins the grid determines it.  Discs extend across their branch cuts,
        and nowhere else beyond the image.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the discs.

    Returns
    -------
    FractalTest
        Entropy with standard error, that of a smooth boundary, and a verdict.

    Raises
    ------
    TypeError, ValueError
        For something that is not a basin image, or discs that do not fit into it.

    Notes
    -----
    The entropy applies to the scale of the disc: a fractal boundary whose structure is sparse at that scale appears
    smooth.  The verdict therefore also needs the uncertainty exponent of the image,
    :func:`image_uncertainty_exponent`, from a decade of distances at least.  A corner or a point where three basins
    meet changes the entropy of the few discs around it.  Use the largest image that is available, and several radii.

    References
    ----------
    Puy, Daza, Wagemakers, Sanjuan, Communications in Nonlinear Science and Numerical Simulation 95 (2021) 105588.

    Examples
    --------
    >>> import numpy as np
    >>> halves = np.add.outer(np.arange(300), np.arange(200)) > 250
    >>> fractal_boundary_test(halves).verdict
    'consistent with smooth'
    """
    image = label_image(basins, include, wraps)
    shape = image.numbers.shape
    wanted = affordable_number("n_discs", n_discs, 8 * (4 * len(shape) + 6), at_least=_FEWEST)
    r = max(4.0, min(shape) / 50) if radius is None else finite_number("radius", radius, at_least=1.0)
    if any(2 * floor(r) + 1 > n for n in shape):
        raise ValueError(f"radius={r:g}: discs are wider than the image of {shape} cells; give a smaller radius")
    offsets = ball(len(shape), r)
    places, entropies, drawn = _draw(image, offsets, floor(r), wanted, rng)
    mean = float(entropies.mean()) if len(entropies) else np.nan
    smooth, low, high = straight_cuts(offsets)
    return FractalTest(
        entropy=mean,
        standard_error=_clustered_error(places, entropies, shape, r),
        smooth=smooth,
        smooth_range=(low, high),
        radius=r,
        cells=len(offsets),
        discs=len(entropies),
        drawn=drawn,
        entropies=entropies,
        finest=finest_exponent(image),
        exponent=image_uncertainty_exponent(basins, include=include, wraps=wraps),
        name=image.source,
    )


def _draw(image: LabelImage, offsets: Ints, reach: int, wanted: int, rng: Rng) -> tuple[Ints, Floats, int]:
    """Draw discs until enough of them are on the boundary; return places and entropies of these, and how many all."""
    rng = random_numbers(rng)
    places: list[Ints] = []
    entropies: list[Floats] = []
    found = drawn = 0
    while found < wanted and drawn < _PATIENCE * wanted:
        batch = np.stack(
            [
                rng.integers(0, n, _BATCH) if wraps else rng.integers(reach, n - reach, _BATCH)
                for n, wraps in zip(image.numbers.shape, image.wraps, strict=True)
            ],
            axis=-1,
        )
        entropy = box_entropies(count_at(image, batch, offsets), len(offsets))
        hit = np.flatnonzero(entropy > 0.0)[: wanted - found]
        places.append(batch[hit])
        entropies.append(entropy[hit])
        found += len(hit)
        drawn += _BATCH
    return np.concatenate(places), np.concatenate(entropies), drawn


def _clustered_error(places: Ints, values: Floats, shape: tuple[int, ...], radius: float) -> float:
    """Return the standard error of a mean of values that depend on each other within a part of the image.

    Parts are wider than discs.  The error is that of a ratio of sums over parts, none smaller than that of independent
    values.
    """
    n = len(values)
    if n < 2:
        return np.nan
    parts = [max(1, min(_TILES, floor(m / (2.0 * radius)))) for m in shape]
    keys = np.ravel_multi_index(
        tuple(places[:, j] * p // m for j, (p, m) in enumerate(zip(parts, shape, strict=True))), tuple(parts)
    )
    number = np.bincount(keys)
    sums = np.bincount(keys, values - values.mean())
    occupied = int(np.count_nonzero(number))
    independent = float(values.std(ddof=1) / np.sqrt(n))
    if occupied < 2:
        return np.nan
    return max(independent, float(np.sqrt((sums**2).sum() * occupied / (occupied - 1)) / n))


@checked
def smooth_boundary_entropy(dimension: int, cells: ArrayLike | None = None) -> float:
    r"""Compute the mean entropy of balls cut by a plane at uniformly distributed distances from the centre.

    Of the unit ball a plane at the distance x cuts off the fraction p(x), and the mean entropy is
    :math:`-\int_0^1 [p \ln p + (1 - p) \ln(1 - p)]\, dx`.

    Parameters
    ----------
    dimension : int
        Dimension of the space.
    cells : array_like of int, shape (n, dimension), optional
        Positions of the cells of the "ball", in any shape, such as those of a square box; the mean is then also over
        all directions of the plane.  By default a ball in the limit of many cells.

    Returns
    -------
    float
        Mean entropy; for balls 1/2, 0.4395, 0.3961, 0.3632, 0.3372 in one to five dimensions.

    References
    ----------
    Puy, Daza, Wagemakers, Sanjuan, Communications in Nonlinear Science and Numerical Simulation 95 (2021) 105588.

    Examples
    --------
    >>> round(smooth_boundary_entropy(2), 4)
    0.4395
    """
    d = whole_number("dimension", dimension, at_least=1)
    if cells is None:
        return float(quad(lambda t: float(_two(0.5 * betainc(0.5 * (d + 1), 0.5, 1.0 - t * t))), 0.0, 1.0)[0])
    offsets = whole_array("cells", cells, "places of cells in whole numbers, one in each row")
    if offsets.ndim != 2 or offsets.shape[1] != d or len(np.unique(offsets, axis=0)) < 2:
        raise ValueError(f"cells has the shape {offsets.shape}: give two different places of {d} coordinates or more")
    return straight_cuts(offsets)[0]


def ball(dimension: int, radius: float) -> Ints:
    """Return the cells whose centres are within a radius of that of a cell, shape (n, dimension)."""
    reach = np.arange(-floor(radius), floor(radius) + 1)
    cube = np.stack(np.meshgrid(*(reach,) * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
    return np.asarray(cube[(cube**2).sum(axis=1) <= radius * radius * (1 + 1e-12)])


def _two(fraction: ArrayLike) -> Floats:
    """Return the entropy of two basins of which one has this fraction."""
    p = np.asarray(fraction, dtype=float)
    return np.asarray(-xlogy(p, p) - xlogy(1.0 - p, 1.0 - p))


def straight_cuts(offsets: Ints) -> tuple[float, float, float]:
    """Return the mean entropy of cells that are cut by a plane, and its smallest and largest value over directions.

    A plane cuts wherever its distance lies between those of two cells next to each other in its direction; all these
    distances are equally likely.
    """
    n, d = offsets.shape
    if d == 1:
        directions = np.ones((1, 1))
    elif d == 2:
        turned = (np.arange(_DIRECTIONS) + 0.5) * (np.pi / _DIRECTIONS)
        directions = np.stack([np.cos(turned), np.sin(turned)], axis=-1)
    else:
        directions = np.random.default_rng(0).standard_normal((_DIRECTIONS, d))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    count = len(directions)
    if d == 2:
        # Directions along the axes, where many cells are at one distance, are the extremes.
        directions = np.append(directions, [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]], axis=0)
    gaps = np.diff(np.sort(directions @ offsets.T.astype(float), axis=1), axis=1)
    sums, weights = gaps @ _two(np.arange(1, n) / n), gaps.sum(axis=1)
    each = sums / weights
    return float(sums[:count].sum() / weights[:count].sum()), float(each.min()), float(each.max())
