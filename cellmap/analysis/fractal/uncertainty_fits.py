"""Uncertainty exponents from counts of uncertain pairs, with a verdict on the boundary."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints
from ..._lib.binomial import binomial_interval
from ..._lib.fit import Fit, fit_line, scaling_fit
from ...maps.orbit_batch import Cost
from ...orbits.attractor import Attractor

SMOOTH, FRACTAL, UNDETERMINED, NO_BOUNDARY = "consistent with smooth", "fractal", "undetermined", "no boundary"
"""Verdicts on a boundary.  Smoothness cannot be proved: the dimension may be larger by less than the error."""

_FEWEST = 20  # uncertain pairs at a distance that is used
_UNDECIDED = 0.1  # undecided pairs, relative to uncertain ones, from which a distance is not used
_RISE = 2.0  # times that from the coarser to the finer half of the distances: as far again as these reach
_VAGUE = 0.1  # standard error, and distance from 1, above which nothing is called consistent with smooth


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
