"""Uncertainty exponent of a basin boundary, by Monte Carlo with the map (Grebogi, McDonald, Ott, Yorke 1983)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from math import ceil, log2

import numpy as np
from numpy.typing import ArrayLike

from ..._lib.arrays import Floats, Ints
from ..._lib.checks import finite_number, real_array, whole_number
from ..._lib.randomness import Rng, random_seed
from ..._lib.signatures import checked
from ..._lib.threads import progress_bar, run_over, slices
from ...attractors.settling.labels import Label
from ...basins.classification import Outcome
from ...basins.final_states import FinalStates, final_states
from ...basins.record import Basins
from ...maps.grid import CellGrid
from ...maps.orbit_batch import CHUNK, Cost
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor
from .label_images import included_labels
from .uncertainty_fits import UncertaintyExponent, with_fit

_LARGEST = 2.0**-6  # distance, relative to the window
_SAFETY = 10.0  # smallest distance of a pair, in errors of the map
_FIRST = 4096  # pairs in the first estimate of the uncertain fraction
_HALF = CHUNK // 2  # pairs in a slice
_AT_ONCE = 2**30  # pairs that are drawn before they are counted, at most
_SMOOTH_COST = 31.0  # pairs for five distances, in those for the first one, where the boundary is smooth
_SPARSE = 50  # uncertain pairs that are wanted at least
_POOR = 0.25  # a further distance is begun if at least this fraction of the wanted uncertain pairs can be drawn


@checked
def uncertainty_exponent(
    source: Basins | PointMap,
    region: CellGrid | None = None,
    attractors: Sequence[Attractor] = (),
    outcome: Outcome | None = None,
    include: Sequence[int] = (),
    distances: ArrayLike | None = None,
    max_pairs: int = 1_000_000,
    min_uncertain: int = 1000,
    max_periods: int = 2000,
    fit_range: tuple[int, int] | None = None,
    *,
    rng: Rng = 0,
    progress: bool = False,
) -> UncertaintyExponent:
    r"""Compute the uncertainty exponent of a basin boundary by Monte Carlo sampling with the map.

    The fraction of uncertain pairs is :math:`f(\varepsilon) \propto \varepsilon^{\alpha}`, and :math:`D_0 = D -
    \alpha`.

    Two initial conditions at a small distance are an uncertain pair if they converge to different attractors.  The
    fraction of uncertain pairs decreases as distance^exponent; in a region of dimension D, the box-counting dimension
    of the boundary is D - exponent.  An exponent of 1 means a smooth boundary, 0 a boundary that fills the region.

    Initial conditions are uniform in the region, and their partners lie in random directions; distances are fractions
    of the size of the region along each axis.  They are halved, from 1/64 on, down to ten times the error of the map
    (its tolerance, and for an interpolated map the 99th percentile of its measured error), or until the budget of pairs
    is spent.  At each distance pairs are drawn until the requested number of uncertain ones is reached, or fewer of
    them if the boundary is so short that the budget would not suffice for five distances.  With one final state alone,
    of which no pair can be uncertain, 4096 pairs are drawn.

    Parameters
    ----------
    source : Basins or PointMap
        Basins, whose map, grid and attractors are used to draw and label pairs; or a map.
    region : CellGrid, optional
        Window of the initial conditions; the number of its cells is not used, but an axis of one cell is fixed at its
        centre, so that lines and slices can be examined.  By default the grid of the basins.
    attractors : sequence of Attractor, optional
        Known attractors; by default those of the basins, otherwise they are searched for first.
    outcome : callable, optional
        Classification of final states instead of attractors: ``outcome(points)`` returns for each of the points (n, d)
        the number of its final state, or -1 as long as it has reached none.
    include : sequence of int, optional
        Negative labels that count as basins: (-2,) for initial conditions that diverge.  Pairs with an initial
        condition of any other negative label (escaped, diverged, undecided, not returned) are excluded.
    distances : array_like, optional
        Distances instead of those above, as fractions of the size of the region, decreasing.
    max_pairs : int, optional
        Budget of pairs for all distances together.
    min_uncertain : int, optional
        Requested number of uncertain pairs at each distance.
    max_periods : int, optional
        Number of periods after which an initial condition is undecided.
    fit_range : tuple of int, optional
        Numbers of the first and last distance of the fit; by default those down to the
        smallest usable one, without the largest ones, at which the fraction saturates.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the pairs: with a seed, the default included, each call draws the same.
    progress : bool, optional
        Show a progress bar on a terminal if the work takes more than two seconds.

    Returns
    -------
    UncertaintyExponent
        Counts at each distance, the fitted exponent and a verdict on the boundary.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, or a region without attractors.

    References
    ----------
    Grebogi, McDonald, Ott, Yorke, Physics Letters A 99 (1983) 415; McDonald, Grebogi, Ott, Yorke, Physica D 17 (1985)
    125.

    Examples
    --------
    >>> from cellmap import CellGrid, discrete_map
    >>> signs = discrete_map(lambda x, p: (x[0] / 2 + 1 / (2 * x[0]), x[1] / 2), {}, ("x", "y"))
    >>> uncertainty_exponent(signs, CellGrid((-3, -1), (3, 1), (10, 10)), max_pairs=300_000).verdict
    'consistent with smooth'
    """
    began = time.perf_counter()
    counted = included_labels(include)
    max_pairs = whole_number("max_pairs", max_pairs, at_least=_FIRST)
    min_uncertain = whole_number("min_uncertain", min_uncertain, at_least=1)
    seed = random_seed(rng)
    states = final_states(source, region, attractors, outcome, max_periods)
    others = sum(label > Label.ENDED - len(states.point_map.ends) for label in counted)
    if outcome is None and len(states.attractors) + others == 1:
        max_pairs = _FIRST  # no pair can be uncertain
    floor = smallest_distance(states)
    wanted = None if distances is None else _decreasing(distances, floor)
    levels = max(1, int(log2(_LARGEST / floor)) + 1) if wanted is None else len(wanted)
    scales = np.asarray(_LARGEST * 0.5 ** np.arange(levels) if wanted is None else wanted, np.float64)
    rows: list[Ints] = []
    with progress_bar(max_pairs, "uncertain pairs" if progress else None) as tick:
        left = max_pairs
        for level, distance in enumerate(scales):
            known = np.zeros(4, np.int64)
            planned = _expected(rows, scales, min_uncertain)
            if planned * _POOR > left:
                break
            while known[1] < min_uncertain and left > 0:
                number = int(min(max(planned, _FIRST), left, _AT_ONCE))
                known += _count(states, float(distance), number, counted, (seed, level, int(known[0])))
                left -= number
                tick(number)
                if not rows and known[0] == number:
                    min_uncertain = min(min_uncertain, max(_SPARSE, int(known[1] / number * max_pairs / _SMOOTH_COST)))
                planned = ceil(1.05 * (min_uncertain - known[1]) * known[0] / max(int(known[1]), 1))
                if planned * _POOR > left:
                    break
            rows.append(known)
            if not known[1]:
                break  # there will be none at smaller distances either
    table = np.array(rows).reshape(-1, 4)
    drawn, hits, without, undecided = table.T
    found = UncertaintyExponent(
        fit=None,
        distances=scales[: len(table)],
        pairs=drawn - without,
        uncertain=hits,
        left_out=without,
        undecided=undecided,
        dimension=sum(n > 1 for n in states.region.shape),
        floor=floor,
        unit="fraction of the window",
        attractors=states.attractors,
        cost=Cost(time.perf_counter() - began, 2 * int(drawn.sum())),
        name=states.point_map.name,
    )
    return with_fit(found, fit_range)


def smallest_distance(states: FinalStates) -> float:
    """Return the smallest distance that the accuracy of a map allows, as a fraction of the region.

    An error in the first period shifts the initial condition by as much, later ones by less, since distances across a
    boundary grow from period to period; ten times the error of one period is therefore safe.
    """
    point_map, region = states.point_map, states.region
    lower, upper = np.array(region.lower), np.array(region.upper)
    wide = np.array(region.shape) > 1
    size = np.maximum(np.abs(lower), np.abs(upper))
    rtol, atol = point_map.tolerance
    error = atol + rtol * size + np.spacing(size)
    if point_map.table is not None:
        measured = point_map.error().percentile_99
        error = error + (measured if np.isfinite(measured) else 0.0)
    return float((_SAFETY * error[wide] / (upper - lower)[wide]).max())


def _decreasing(distances: ArrayLike, floor: float) -> Floats:
    values = real_array("distances", distances)
    if values.ndim != 1 or not len(values) or not (np.diff(values) < 0.0).all():
        raise ValueError(f"distances={distances!r}: give a decreasing list of distances")
    for v in values:
        finite_number("distances", v, at_least=floor, at_most=0.5)
    return values


def _expected(rows: list[Ints], scales: Floats, uncertain: int) -> int:
    """Return how many pairs the next distance needs, as far as the last two tell."""
    if not rows:
        return _FIRST
    fractions = [max(int(r[1]), 1) / int(r[0]) for r in rows[-2:]]
    ratio = scales[len(rows)] / scales[len(rows) - 1]
    fall = 0.5
    if len(fractions) == 2:
        before = scales[len(rows) - 1] / scales[len(rows) - 2]
        fall = float(np.clip(np.log(fractions[1] / fractions[0]) / np.log(before), 0.0, 1.0))
    return ceil(uncertain / (fractions[-1] * ratio**fall))


def _count(
    states: FinalStates, distance: float, number: int, counted: tuple[int, ...], seed: tuple[int, int, int]
) -> Ints:
    """Draw pairs; return how many there are, are uncertain, are left out, and hold an undecided initial condition."""

    def draw(part: slice) -> Ints:
        n, rng = part.stop - part.start, np.random.default_rng((*seed, part.start // _HALF))
        labels = states.label(_pairs(states.region, distance, n, rng)).reshape(2, n)
        valid = ((labels >= 0) | np.isin(labels, counted)).all(axis=0)
        undecided = (labels == Label.UNDECIDED).any(axis=0) & ~valid
        uncertain = valid & (labels[0] != labels[1])
        return np.array([n, uncertain.sum(), n - valid.sum(), undecided.sum()], np.int64)

    return np.asarray(np.sum(run_over(slices(number, _HALF), draw), axis=0))


def _pairs(region: CellGrid, distance: float, n: int, rng: np.random.Generator) -> Floats:
    """Return n initial conditions followed by their partners, shape (2 n, d)."""
    wide = np.flatnonzero(np.array(region.shape) > 1)
    first = rng.random((n, len(wide)))
    direction = rng.standard_normal((n, len(wide)))
    step = distance * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    second = first + step
    straight = ~np.array(region.wraps)[wide]
    turned = straight & ((second < 0.0) | (second > 1.0))
    second = np.where(turned, first - step, second)
    lower, upper = np.array(region.lower), np.array(region.upper)
    points = np.empty((2 * n, len(lower)))
    points[:] = 0.5 * (lower + upper)
    points[:, wide] = lower[wide] + np.concatenate([first, second]) * (upper - lower)[wide]
    return points
