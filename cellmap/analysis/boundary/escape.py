"""Escape from a region without an attractor: lifetimes and escape rates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints
from ..._lib.checks import affordable_number, finite_number
from ..._lib.computed import computed_once
from ..._lib.fit import Fit, fit_line
from ..._lib.randomness import Rng, random_numbers
from ..._lib.signatures import checked
from ..._lib.threads import progress_bar, run_over, slices
from ...attractors.given import check_attractors
from ...attractors.regions.boxes import inside_cover
from ...attractors.settling.settle import Catalogue
from ...maps.coordinates import Coordinate, wrap
from ...maps.grid import CellGrid
from ...maps.orbit_batch import CHUNK, Orbits
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor

_RESAMPLES = 200
_FEWEST = 400  # survivors, below which chance bends the line by more than its window allows


@dataclass(frozen=True, eq=False)
class Restraint:
    """A region in which orbits are transient: a window, without neighbourhoods of attractors.

    Parameters
    ----------
    point_map : PointMap
        The map.
    window : CellGrid
        The window; its cells do not matter, and along an angle whose whole period it covers it has no ends.
    attractors : tuple of Attractor
        Attractors whose verified neighbourhoods, or boxes, are no part of the region.
    catalogue : Catalogue
        These neighbourhoods.
    """

    point_map: PointMap
    window: CellGrid
    attractors: tuple[Attractor, ...]
    catalogue: Catalogue

    def __repr__(self) -> str:
        return f"Restraint({self.point_map.name}, {self.window}, {len(self.attractors)} attractors left out)"

    def __call__(self, points: Floats) -> Bools:
        """Return which points (n, dimension), with angles within their period, are in the region."""
        lower, upper, wraps = self._edges
        with np.errstate(invalid="ignore"):
            within = (points >= lower) & (points <= upper)
        if wraps.any():
            within |= wraps & np.isfinite(points)
        inside: Bools = np.logical_and.reduce(within, axis=1)
        if self.attractors and inside.any():
            rows = np.flatnonzero(inside)
            caught = self.catalogue.owners_of(np.ascontiguousarray(points[rows])) >= 0
            for _, cover, keys in self.catalogue.covers:
                caught |= inside_cover(cover, points[rows], self.point_map, keys)
            inside[rows[caught]] = False
        return inside

    @computed_once
    def _edges(self) -> tuple[Floats, Floats, Bools]:
        return np.array(self.window.lower), np.array(self.window.upper), np.array(self.window.wraps)

    def lifetimes(self, points: Floats, most: int) -> Ints:
        """Return for points (n, dimension) how many points of their orbits are in the region before the first outside.

        0 for a point that is outside itself, at most `most`.
        """
        times = np.empty(len(points), np.int64)

        def work(part: slice) -> None:
            orbits = Orbits.starting(wrap(points[part], self.point_map.coordinates))
            rows = np.arange(len(orbits))
            found = np.full(len(orbits), most, np.int64)
            for k in range(most):
                inside = self(orbits.points)
                if not inside.all():
                    found[rows[~inside]] = k
                    rows, orbits = rows[inside], orbits[inside]
                    if not len(rows):
                        break
                self.point_map.advance(orbits, 1)
                tick(len(orbits))
            times[part] = found

        with progress_bar(len(points) * most, f"lifetimes of {len(points):,} orbits, {most:,} steps at most") as tick:
            run_over(slices(len(points), CHUNK), work)
        return times


def restraint(point_map: PointMap, region: CellGrid, attractors: Sequence[Attractor] = ()) -> Restraint:
    """Return a region less the neighbourhoods of some attractors."""
    check_attractors(attractors, point_map, "attractors")
    return Restraint(
        point_map, region.on(point_map.coordinates, "region"), tuple(attractors), Catalogue.of(attractors, point_map)
    )


@dataclass(frozen=True, eq=False)
class EscapeRate:
    """Escape rate: exponential decay of the number of orbits in a region.

    Parameters
    ----------
    fit : Fit
        Fit of the logarithm of the surviving fraction against the step, from step 0 on.
    rate : float
        Escape rate per step: minus the slope.
    standard_error : float
        Standard error of the rate: that from resampling the initial conditions or that of the fit, whichever is larger.
    survivors : ndarray of int, shape (n,)
        Number of orbits in the region after 0, 1, ... steps.
    region : CellGrid
        Window of the initial conditions.
    coordinates : tuple of Coordinate
        State variables.
    """

    fit: Fit
    rate: float
    standard_error: float
    survivors: Ints
    region: CellGrid
    coordinates: tuple[Coordinate, ...]

    def __repr__(self) -> str:
        return f"EscapeRate({self.rate:.6g} +- {self.standard_error:.2g} per step, {self.survivors[0]} orbits)"

    @property
    def mean_lifetime(self) -> float:
        """Mean lifetime of orbits near the saddle, in steps: the inverse of the rate."""
        return 1.0 / self.rate if self.rate > 0.0 else np.inf


@checked
def escape_rate(
    point_map: PointMap,
    region: CellGrid,
    attractors: Sequence[Attractor] = (),
    n_samples: int = 100_000,
    max_periods: int = 1000,
    *,
    rng: Rng = 0,
    fit_range: tuple[int, int] | None = None,
    tolerance: float = 0.05,
) -> EscapeRate:
    r"""Compute the escape rate from a region.

    It is the :math:`\kappa` of :math:`N(n) \propto e^{-\kappa n}`, the number of orbits that are still in the
    region after n steps.

    Random initial conditions, uniform in the window, are iterated until they leave the region.  The line is fitted by
    :func:`fit_line` in the largest window of steps in which it is straight, among those that at least 400 orbits
    survive.

    Parameters
    ----------
    point_map : PointMap
        The map.
    region : CellGrid
        The region.
    attractors : sequence of Attractor, optional
        Attractors in the window, whose neighbourhoods are excluded from the region.
    n_samples : int, optional
        Number of initial conditions.
    max_periods : int, optional
        Largest number of steps; orbits that remain longer are not followed.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the initial conditions and of their resampling.
    fit_range : tuple of int, optional
        First and last step of the fit.
    tolerance : float, optional
        Largest difference between neighbouring slopes in the window and that of the line, relative where above 1.

    Returns
    -------
    EscapeRate
        The escape rate with its fit.

    Raises
    ------
    ValueError
        If fewer than 3 steps are survived by at least 400 orbits, or if no orbit leaves.

    References
    ----------
    Kantz, Grassberger, Physica D 17 (1985) 75; Lai, Tel, *Transient Chaos* (2011), section 1.2.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> tent = discrete_map(lambda x, p: (1.5 - 3 * abs(x[0] - 0.5),), {}, ("x",))
    >>> escape_rate(tent, CellGrid((0,), (1,), (1,)), n_samples=20_000).rate
    0.41
    """
    inside = restraint(point_map, region, attractors)
    number = affordable_number("n_samples", n_samples, 8 * (3 * region.dimension + 6), at_least=1)
    last = affordable_number("max_periods", max_periods, 8 * 12, at_least=3)
    allowed = finite_number("tolerance", tolerance, above=0.0)
    rng = random_numbers(rng)
    grid = inside.window
    initial_conditions = rng.uniform(grid.lower, grid.upper, (number, grid.dimension))
    times = inside.lifetimes(initial_conditions, last)
    times = times[times > 0]
    if not len(times):
        raise ValueError(
            f"region={region!r}: no initial condition is in the region, which the neighbourhoods of the attractors fill"
        )
    survivors = _survivors(times, last)
    if survivors[-1] == survivors[0]:
        raise ValueError(f"region={region!r}: no orbit leaves it within {last} steps; it has no escape rate")
    usable = np.flatnonzero(survivors >= _FEWEST)
    if len(usable) < 3 and fit_range is None:
        raise ValueError(
            f"n_samples={n_samples!r}: only {len(usable)} steps are survived by {_FEWEST} orbits or more; "
            "take more initial conditions"
        )
    survivors = survivors[: int(np.count_nonzero(survivors))]
    steps = np.arange(len(survivors))
    fraction = survivors / survivors[0]
    height = np.log(fraction)
    # At the first step nothing is left to chance; its weight must stay finite.
    errors = np.maximum(np.sqrt((1.0 - fraction) / survivors), 1.0 / survivors[0])
    within = fit_range
    if within is None:
        try:
            within = fit_line(steps[usable], height[usable], tolerance=allowed).fit_range
        except ValueError as reason:
            raise ValueError(f"tolerance={allowed!r}: no part of the decay is as straight as that ({reason})") from None
    fit = fit_line(steps, height, within, errors, labels=("step", "ln fraction of surviving orbits"))
    part = slice(within[0], within[1] + 1)
    slopes = []
    counts = np.bincount(times, minlength=last + 1)
    for _ in range(_RESAMPLES):
        drawn = rng.multinomial(len(times), counts / len(times))
        left = drawn.sum() - np.cumsum(drawn)[:last]
        if left[within[1]] > 0:
            again = fit_line(steps[part], np.log(left[part] / left[0]), (0, len(steps[part]) - 1), errors[part])
            slopes.append(again.slope)
    spread = float(np.std(slopes, ddof=1)) if len(slopes) > 1 else np.nan
    # Survivors at different steps are the same orbits, while a fit assumes independent fractions.
    error = float(np.nanmax([spread, fit.standard_error]))
    fit = replace(fit, standard_error=error)
    return EscapeRate(fit, -fit.slope, error, survivors, grid, point_map.coordinates)


def _survivors(times: Ints, last: int) -> Ints:
    """Return how many orbits are in the region after 0, 1, ..., last - 1 steps."""
    counts = np.bincount(times, minlength=last + 1)
    return np.asarray(len(times) - np.cumsum(counts)[:last])
