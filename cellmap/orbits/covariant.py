"""Covariant Lyapunov vectors: the directions that grow at each exponent, and the angles between them (Ginelli 2007)."""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._lib.checks import claim_memory, whole_number
from .._lib.signatures import checked
from ..maps.coordinates import Coordinate, state_points, wrap
from ..maps.point_map import PointMap
from ..maps.tangent import tangent
from .lyapunov import GROUPS

_FACTOR = 100.0  # by which eigenvectors that are far from orthogonal let growth differ for a while
_VANISHING = 1e-14  # growth in one step, of the largest, below which a direction is lost to rounding


@dataclass(frozen=True, eq=False)
class CovariantVectors:
    """Directions along an orbit that the derivative maps to each other.

    Parameters
    ----------
    points : ndarray, shape (n, d)
        The orbit, angles in their turn.
    vectors : ndarray, shape (n, d, d)
        At each point unit columns, in the order of the exponents.  The derivative takes column j to a multiple of
        column j at the next point.  Where exponents cannot be told from equal ones, the columns that belong to them are
        an orthonormal basis of one subspace, which the derivative takes to that at the next point.
    growth : ndarray, shape (n, d)
        Logarithm of that multiple's size; in a subspace of several dimensions, that of its volume over its dimension.
    exponents, standard_errors : ndarray, shape (d,)
        Mean growth per step, the largest first, and its error from the spread between 20 parts of the orbit; in a
        subspace of several dimensions with the spread between the exponents that a frame gives for it.
    dimensions : tuple of int
        Dimensions of the subspaces, in the order of the exponents; all 1 where these differ.
    transient : int
        Steps in which directions turned, on either side of these points.
    name : str
        Name of the system.
    coordinates : tuple of Coordinate
        State variables.
    """

    points: NDArray[np.float64]
    vectors: NDArray[np.float64]
    growth: NDArray[np.float64]
    exponents: NDArray[np.float64]
    standard_errors: NDArray[np.float64]
    dimensions: tuple[int, ...]
    transient: int
    name: str
    coordinates: tuple[Coordinate, ...]

    def __repr__(self) -> str:
        values = [
            f"{self.exponents[k]:.4g} +- {self.standard_errors[k]:.1g}"
            + (f" (one subspace of dimension {n})" if n > 1 else "")
            for k, n in zip(self._begins, self.dimensions, strict=True)
        ]
        return f"CovariantVectors({self.name}, {len(self.points)} points: {', '.join(values)} per step)"

    @property
    def _begins(self) -> list[int]:
        """Number of the first direction of each subspace."""
        return (np.cumsum(self.dimensions) - self.dimensions).tolist()

    @property
    def expanding(self) -> int:
        """Number of positive exponents."""
        return int(np.count_nonzero(self.exponents > 0.0))

    @checked
    def angles(self, first: int | None = None) -> NDArray[np.float64]:
        """Return at each point the smallest angle between the span of the first directions and that of the others.

        Parameters
        ----------
        first : int, optional
            How many directions come first; by default those that expand.

        Returns
        -------
        ndarray, shape (n,)
            Between 0 and pi/2.  Where the set is hyperbolic, angles between what expands and what contracts stay away
            from 0; tangencies of stable and unstable manifolds bring them as near to 0 as the orbit is long.

        Raises
        ------
        ValueError
            Where no direction is left on one of the sides, or `first` divides a subspace.
        """
        d = self.points.shape[1]
        k = self.expanding if first is None else whole_number("first", first)
        if not 0 < k < d:
            raise ValueError(f"first={k}: of {d} directions one at least has to be on each side")
        if k not in self._begins:
            raise ValueError(
                f"first={k} divides a subspace whose directions grow alike: give one of {self._begins[1:]}, or take "
                "more periods to tell them apart"
            )
        one, other = (np.linalg.qr(part)[0] for part in (self.vectors[..., :k], self.vectors[..., k:]))
        # Sines, as cosines do not tell small angles apart; of two spaces the smaller one's.
        small, large = (one, other) if k <= d - k else (other, one)
        rest = small - large @ (large.swapaxes(-1, -2) @ small)
        return np.asarray(np.arcsin(np.linalg.svd(rest, compute_uv=False)[..., -1].clip(0.0, 1.0)))


@checked
def covariant_vectors(
    point_map: PointMap, start: ArrayLike, periods: int = 1000, transient: int = 200
) -> CovariantVectors:
    """Return the covariant Lyapunov vectors along an orbit.

    A frame that is carried along and kept orthonormal spans what grows most; what is in the span of its first j columns
    and grows least on the way back is direction j (Ginelli et al. 2007).  Directions of equal exponents, as of a
    complex pair of multipliers or of one without a second eigenvector, have no meaning of their own: neighbours whose
    growth over n steps differs by less than a factor of 100 n^2, or by less than three standard errors, are taken
    together as one subspace.

    Parameters
    ----------
    point_map : PointMap
        Stroboscopic or discrete map whose derivative can be inverted; of an interpolated map the exact map behind it
        is taken.
    start : array_like, shape (d,)
        Start of the orbit.
    periods : int, optional
        Points at which vectors are wanted, at least 20.
    transient : int, optional
        Steps from the start to these points, and after them, in which directions turn.  They are off by about
        ``exp(-transient * gap)``, where the gap is that between neighbouring exponents.

    Returns
    -------
    CovariantVectors
        Directions, their growth and exponents.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, an orbit that ends, or a derivative without an inverse.

    References
    ----------
    Ginelli, Poggi, Turchi, Chate, Livi, Politi, Physical Review Letters 99 (2007) 130601.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> bent = discrete_map(lambda x, p: (2 * x[0] + x[1], x[1] / 2), {}, ("x", "y"))
    >>> found = covariant_vectors(bent, [0.0, 0.0], periods=20)
    >>> np.abs(found.vectors[0].T * np.sqrt([[1], [13]])).round(9)
    array([[1., 0.],
           [2., 3.]])
    """
    exact = point_map.exact or point_map
    begin = state_points("start", start, exact.coordinates)
    if begin.ndim != 1:
        raise ValueError(f"start has the shape {begin.shape}: give one point of {exact.dimension} coordinates")
    periods = whole_number("periods", periods, at_least=GROUPS)
    transient = whole_number("transient", transient)
    d = exact.dimension
    total = periods + transient
    claim_memory(f"frames along {total:,} steps", 24 * total * d * d, "take fewer periods")
    points, frames, factors = _forward(exact, wrap(begin, exact.coordinates), transient, total)
    logs = np.log(np.abs(np.diagonal(factors, axis1=1, axis2=2)))
    groups = _alike(logs)
    bases = [np.eye(d)[:, group] for group in groups]
    vectors, growth = np.empty((periods, d, d)), np.empty((periods, d))
    for k in reversed(range(total)):
        for number, group in enumerate(groups):
            basis, upper = np.linalg.qr(np.linalg.solve(factors[k], bases[number]))
            sizes = np.diagonal(upper)
            bases[number] = basis * np.sign(sizes)
            if k < periods:
                vectors[k][:, group] = frames[k] @ bases[number]
                growth[k, group] = -np.log(np.abs(sizes)).mean()
    spread = np.concatenate([np.full(g.stop - g.start, 0.5 * np.ptp(logs[:, g].mean(axis=0))) for g in groups])
    groups.sort(key=lambda g: -float(growth[:, g.start].mean()))
    order = np.concatenate([np.arange(g.start, g.stop) for g in groups])
    return CovariantVectors(
        points=points[:periods],
        vectors=vectors[..., order],
        growth=growth[:, order],
        exponents=growth.mean(axis=0)[order],
        standard_errors=np.hypot(_errors(growth), spread)[order],
        dimensions=tuple(g.stop - g.start for g in groups),
        transient=transient,
        name=exact.name,
        coordinates=exact.coordinates,
    )


def _errors(growth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return standard errors of mean growth (n, d), from the spread between parts of the orbit."""
    parts = np.array([part.mean(axis=0) for part in np.array_split(growth, GROUPS)])
    return np.asarray(parts.std(axis=0, ddof=1) / np.sqrt(GROUPS))


def _alike(logs: NDArray[np.float64]) -> list[slice]:
    """Return the neighbouring directions of a frame whose growth (n, d) cannot be told apart.

    Of two vectors that a matrix without a second eigenvector carries, one grows n^2 times as much as the other that is
    kept orthogonal to it; those of a complex pair take turns.
    """
    n, d = logs.shape
    apart = logs[:, :-1] - logs[:, 1:]
    told = (apart.sum(axis=0) > log(_FACTOR * n**2)) & (apart.mean(axis=0) > 3.0 * _errors(apart))
    ends = [*(np.flatnonzero(told) + 1).tolist(), d]
    return [slice(begin, end) for begin, end in zip([0, *ends[:-1]], ends, strict=True)]


def _forward(
    exact: PointMap, place: NDArray[np.float64], turning: int, total: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return points (n, d), frames there and triangular factors (n, d, d) of so many steps, after some others."""
    d = len(place)
    points, frames, factors = np.empty((total, d)), np.empty((total, d, d)), np.empty((total, d, d))
    # Not the axes, of which a map may keep some.
    frame = np.linalg.qr(np.random.default_rng(0).standard_normal((d, d)))[0]
    for k in range(-turning, total):
        image, matrix = tangent(exact, place)
        if not (np.isfinite(image).all() and np.isfinite(matrix).all()):
            raise ValueError(f"start: the orbit ends at {place.tolist()} after {turning + k} periods")
        turned, upper = np.linalg.qr(matrix @ frame)
        sizes = np.abs(np.diagonal(upper))
        if not sizes.min() > _VANISHING * sizes.max():
            raise ValueError(
                f"start: the orbit comes to {place.tolist()}, where the derivative has no inverse in machine numbers: "
                "a direction vanishes there"
            )
        if k >= 0:
            points[k], frames[k], factors[k] = place, frame, upper
        place, frame = wrap(image, exact.coordinates), turned
    return points, frames, factors
