"""Kaplan-Yorke dimension of an attractor, from its Lyapunov exponents."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._lib.arrays import Floats
from ..._lib.checks import real_array
from ...orbits.lyapunov import LyapunovSpectrum


@dataclass(frozen=True, eq=False)
class KaplanYorke:
    """Kaplan-Yorke dimension, with the Lyapunov exponents from which it is computed.

    Parameters
    ----------
    dimension : float
        ``j + (l_1 + ... + l_j) / |l_(j+1)|``, with the largest j for which the sum is not negative.
    standard_error : float
        Propagated from the errors of the exponents, taken as independent; NaN without these.
    exponents, errors : ndarray, shape (d,)
        Lyapunov exponents in decreasing order, and their standard errors (NaN if they are not known).
    whole : int
        The number j.
    bounded : bool
        Whether volumes contract; if not, the dimension is that of the space and contains no information on the
        attractor.
    """

    dimension: float
    standard_error: float
    exponents: Floats
    errors: Floats
    whole: int
    bounded: bool

    def __repr__(self) -> str:
        return f"KaplanYorke(dimension {self.dimension:.5g} +- {self.standard_error:.2g})"


def kaplan_yorke_dimension(exponents: ArrayLike | LyapunovSpectrum, errors: ArrayLike | None = None) -> KaplanYorke:
    """Compute the Kaplan-Yorke (Lyapunov) dimension from Lyapunov exponents.

    By the conjecture of Kaplan and Yorke it is the information dimension D_1 of typical chaotic attractors; it is an
    upper bound of D_1 for any smooth map (Ledrappier 1981).  For two-dimensional smooth maps the two are equal (Young
    1982).

    Parameters
    ----------
    exponents : array_like, shape (d,), or LyapunovSpectrum
        All Lyapunov exponents, in any order, per step or per time; for a spectrum, the mean over its orbits is used.
    errors : array_like, shape (d,), optional
        Their standard errors.

    Returns
    -------
    KaplanYorke
        Dimension with its error.

    Raises
    ------
    ValueError
        For exponents that are not numbers.

    References
    ----------
    Kaplan, Yorke, Lecture Notes in Mathematics 730 (1979) 204; Frederickson, Kaplan, Yorke, Yorke, Journal of
    Differential Equations 49 (1983) 185.

    Examples
    --------
    >>> kaplan_yorke_dimension([0.4192, -1.6232], [0.0003, 0.0003])
    KaplanYorke(dimension 1.2583 +- 0.00019)
    """
    if isinstance(exponents, LyapunovSpectrum):
        exponents, known = exponents.pooled
        errors = known if errors is None else errors
    given = real_array("exponents", exponents)
    if given.ndim > 1 and given.size > given.shape[-1]:
        raise ValueError(f"exponents have the shape {given.shape}: give those of one orbit, such as their mean")
    given = given.ravel()
    sigma = np.full(given.shape, np.nan) if errors is None else real_array("errors", errors).ravel()
    if not len(given) or np.isnan(given).any() or (given == np.inf).any():
        raise ValueError(f"exponents={given.tolist()}: give all Lyapunov exponents as numbers")
    if sigma.shape != given.shape or (sigma < 0.0).any():
        raise ValueError(f"errors={sigma.tolist()}: give one error of at least 0 for each of {len(given)} exponents")
    order = np.argsort(-given, kind="stable")
    given, sigma = given[order], sigma[order]
    sums = np.cumsum(given)
    whole = int(np.flatnonzero(sums >= 0.0)[-1]) + 1 if (sums >= 0.0).any() else 0
    if whole in (0, len(given)):
        return KaplanYorke(float(whole), np.nan if whole else 0.0, given, sigma, whole, whole == 0)
    falling = abs(given[whole])
    rising = sums[whole - 1]
    dimension = whole + float(rising / falling)
    squares = (sigma[:whole] ** 2).sum() + (rising / falling * sigma[whole]) ** 2
    return KaplanYorke(dimension, float(np.sqrt(squares) / falling), given, sigma, whole, True)
