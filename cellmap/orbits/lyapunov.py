"""Lyapunov exponents with standard errors and their convergence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._compiled.kernels.frames import ROUNDING
from .._lib.arrays import Bools, Floats, Ints
from .._lib.checks import claim_memory, finite_number, whole_number
from .._lib.fit import student_factor
from .._lib.signatures import checked
from .._lib.threads import progress_bar, run_over, slices
from ..maps.coordinates import Coordinate, state_points, wrap
from ..maps.orbit_batch import CHUNK, Orbits, Status
from ..maps.point_map import PointMap
from ..maps.tangent import NotDifferentiableError, tangent

STRETCHES = 100
"""Stretches of an orbit of which the growth is recorded, or as many as there are periods."""

GROUPS = 20
"""Groups of stretches whose means tell the standard error; an orbit has at least as many periods."""

_ALIGNING = 100  # periods at the end of the transient in which frames turn into their directions


@dataclass(frozen=True, eq=False)
class LyapunovSpectrum:
    """Lyapunov exponents along orbits, the largest first.

    Parameters
    ----------
    exponents : ndarray, shape (..., d)
        Exponents per step of the map, one row for each initial condition; NaN if the orbit terminated, minus infinity
        if a direction is mapped to zero, as in stick-slip motion, or shrinks in one step below the rounding of the
        others.
    standard_errors : ndarray, shape (..., d)
        Standard errors, from the spread of the means over 20 parts of the orbit, which must be longer than its
        correlation time.
    growth : ndarray, shape (m, ..., d)
        Logarithm of the growth along each direction in each recorded interval.
    steps : ndarray of int, shape (m,)
        Period at which each interval ends; the first one begins at 0.
    ends : ndarray, shape (..., d)
        Last points of the orbits, angles wrapped.
    directions : ndarray, shape (..., d, d)
        Orthonormal columns at `ends`: the first k span the directions of largest growth (Gram-Schmidt vectors).
    status : ndarray of uint8, shape (...)
        :class:`Status` of each orbit.
    period : float
        Time of one step; 1 for a discrete map.
    transient : int
        Periods of the transient, before the first one that counts.
    name : str
        Name of the system.
    coordinates : tuple of Coordinate
        State variables.
    """

    exponents: Floats
    standard_errors: Floats
    growth: Floats
    steps: Ints
    ends: Floats
    directions: Floats
    status: NDArray[np.uint8]
    period: float
    transient: int
    name: str
    coordinates: tuple[Coordinate, ...]

    def __repr__(self) -> str:
        mean, error = self.pooled
        values = ", ".join(f"{m:.4g} +- {e:.1g}" for m, e in zip(mean, error, strict=True))
        ended = np.count_nonzero(self.ended)
        lost = f", {ended} terminated" if ended else ""
        return f"LyapunovSpectrum({self.name}: {values} per step; {self.ended.size} orbits{lost} of {self.steps[-1]})"

    @property
    def ended(self) -> Bools:
        """Whether each orbit terminated before its last period, shape (...)."""
        return self.status >= Status.ESCAPED

    @property
    def per_time(self) -> Floats:
        """Exponents per unit of time, shape (..., d): those per step divided by the period."""
        return self.exponents / self.period

    @property
    def per_time_errors(self) -> Floats:
        """Standard errors per unit of time, shape (..., d)."""
        return self.standard_errors / self.period

    @property
    def convergence(self) -> Floats:
        """Exponents per step over the first ``steps`` periods, shape (m, ..., d)."""
        total: Floats = np.cumsum(self.growth, axis=0)
        return total / self.steps.reshape(-1, *(1,) * (total.ndim - 1))

    @property
    def sums(self) -> Floats:
        """Sums of the exponents per step, shape (...): the mean logarithm of the growth factor of volumes."""
        return np.asarray(self.exponents.sum(axis=-1))

    @property
    def lyapunov_time(self) -> Floats:
        """Lyapunov time, in which small errors grow by a factor e, shape (...); infinite if no exponent is above 0."""
        largest = self.per_time[..., 0]
        with np.errstate(divide="ignore"):
            times = np.where(largest > 0.0, 1.0 / np.where(largest > 0.0, largest, 1.0), np.inf)
        return np.where(np.isnan(largest), np.nan, times)

    @property
    def pooled(self) -> tuple[Floats, Floats]:
        """Mean exponents per step over all orbits that did not terminate, and their standard errors, shape (d,) each.

        The standard error is that between orbits or that within them, whichever is larger.  The mean is meaningful only
        if all orbits are on one attractor, or in one chaotic sea.
        """
        d = self.exponents.shape[-1]
        rows = self.exponents.reshape(-1, d)[~self.ended.ravel()]
        within = self.standard_errors.reshape(-1, d)[~self.ended.ravel()]
        n = len(rows)
        if not n:
            return np.full(d, np.nan), np.full(d, np.nan)
        with np.errstate(invalid="ignore"):
            inner = np.sqrt((within**2).sum(axis=0)) / n
            between = rows.std(axis=0, ddof=1) / np.sqrt(n) if n > 1 else np.zeros(d)
        return rows.mean(axis=0), np.maximum(inner, between)

    @checked
    def interval(self, confidence: float = 0.95) -> tuple[Floats, Floats]:
        """Return confidence intervals of the exponents per step (Student's distribution), shape (..., d) each."""
        confidence = finite_number("confidence", confidence, above=0.0, at_most=1.0 - 1e-12)
        reach = student_factor(confidence, GROUPS - 1) * self.standard_errors
        return self.exponents - reach, self.exponents + reach


@checked
def lyapunov_spectrum(
    point_map: PointMap,
    initial_conditions: ArrayLike,
    periods: int = 2000,
    transient: int = 500,
    progress: bool = False,
) -> LyapunovSpectrum:
    r"""Return the spectrum of Lyapunov exponents along one or many orbits.

    They are :math:`\lambda_i = \lim_{n \to \infty} \frac{1}{n} \ln \sigma_i(D P^n(x))` for the singular values
    :math:`\sigma_i` of the derivative.

    The derivative of each period, from the variational equation, is applied to an orthonormal frame, which is
    orthonormalised again by a QR factorisation; the growth is the diagonal of R.  Frames are iterated for at most 100
    periods before the first one that counts, so that exponents do not depend on the initial frame.

    Parameters
    ----------
    point_map : PointMap
        Stroboscopic or discrete map, in any dimension; for an interpolated map, the exact map behind it is used.
    initial_conditions : array_like, shape (..., d)
        Initial conditions of the orbits.
    periods : int, optional
        Periods that count, at least 20.
    transient : int, optional
        Periods of the transient, in which the orbit approaches its attractor.
    progress : bool, optional
        Show a bar on a terminal for work of more than two seconds.

    Returns
    -------
    LyapunovSpectrum
        Exponents per step and per time, standard errors, convergence, directions.

    Raises
    ------
    TypeError, ValueError
        For something that is not a map, initial conditions that are empty or not finite, or too few periods.

    Notes
    -----
    If the exponents differ, the mean over n periods has an error of order 1/n from bounded fluctuations, as along a
    periodic orbit, and of order 1/sqrt(n) from chaos.  On an invariant torus displacements grow by shear, and the
    largest exponent converges to 0 like ln(n)/n.

    Orbits and derivatives have the tolerance of the map, at most 1e-8 (see :func:`~cellmap.maps.jacobian`): sums of
    exponents of conservative systems, up to 1.5 per step, were off by less than 1e-10.

    References
    ----------
    Benettin, Galgani, Giorgilli, Strelcyn, Meccanica 15 (1980) 9 and 21; Shimada, Nagashima, Progress of Theoretical
    Physics 61 (1979) 1605; Eckmann, Ruelle, Reviews of Modern Physics 57 (1985) 617.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> cat = discrete_map(lambda x, p: (2 * x[0] + x[1], x[0] + x[1]), {}, ("x", "y"))
    >>> lyapunov_spectrum(cat, [[0.0, 0.0]], periods=100).exponents
    array([[ 0.9624, -0.9624]])
    """
    exact = point_map.without_table
    points = state_points("initial_conditions", initial_conditions, exact.coordinates, some=True)
    periods = whole_number("periods", periods, at_least=GROUPS)
    transient = whole_number("transient", transient)
    shape, d = points.shape[:-1], exact.dimension
    states = points.reshape(-1, d)
    n = len(states)
    steps = np.linspace(0, periods, min(periods, STRETCHES) + 1).round().astype(np.int64)[1:]
    claim_memory(f"growth along {n:,} orbits", 8 * n * d * (len(steps) + d + 4), "take fewer initial conditions")
    growth = np.empty((len(steps), n, d))
    frames = np.empty((n, d, d))
    status = np.zeros(n, np.uint8)
    parts = slices(n, CHUNK // 16)
    label = f"Lyapunov exponents of {exact.name}" if progress else None
    with progress_bar(len(parts) * len(steps), label) as tick:

        def work(part: slice) -> None:
            states[part], frames[part], status[part] = _along(exact, states[part], transient, steps, growth, part, tick)

        run_over(parts, work)
    growth[:, status >= Status.ESCAPED] = np.nan
    order = np.argsort(-growth.sum(axis=0), axis=-1, kind="stable")
    growth = np.take_along_axis(growth, order[None], axis=-1)
    frames = np.take_along_axis(frames, order[:, None, :], axis=-1)
    states[status >= Status.ESCAPED] = np.nan
    frames[status >= Status.ESCAPED] = np.nan
    return LyapunovSpectrum(
        exponents=(growth.sum(axis=0) / periods).reshape(*shape, d),
        standard_errors=_errors(growth, steps).reshape(*shape, d),
        growth=growth.reshape(-1, *shape, d),
        steps=steps,
        ends=states.reshape(*shape, d),
        directions=frames.reshape(*shape, d, d),
        status=status.reshape(shape),
        period=exact.period,
        transient=transient,
        name=exact.name,
        coordinates=exact.coordinates,
    )


def _along(
    exact: PointMap,
    begin: Floats,
    transient: int,
    steps: Ints,
    growth: Floats,
    part: slice,
    tick: Callable[[int], object],
) -> tuple[Floats, Floats, NDArray[np.uint8]]:
    """Fill in the growth along some orbits; return their last points, their frames and their statuses."""
    d, aligning = exact.dimension, min(transient, _ALIGNING)
    orbits = Orbits.starting(wrap(begin, exact.coordinates))
    frames = np.empty((len(begin), d, d))
    frames[:] = np.eye(d)
    if exact.stretch is None or exact.is_flow:  # derivatives cost much more than the orbit
        exact.advance(orbits, transient - aligning)
    else:
        stretched(exact, orbits, frames, transient - aligning)
        frames[:] = np.eye(d)
    stretched(exact, orbits, frames, aligning)
    for number, count in enumerate(np.diff(steps, prepend=0).tolist()):
        growth[number, part] = stretched(exact, orbits, frames, count)
        tick(1)
    return orbits.points, frames, orbits.status


def stretched(exact: PointMap, orbits: Orbits, frames: Floats, periods: int) -> Floats:
    """Move orbits and their frames on; return the logarithms (n, d) of what the frames have grown by.

    Orbits and derivatives have the tolerance of the map.
    """
    if exact.stretch is None:
        return _stretched_by_matrices(exact, orbits, frames, periods)
    before, first, alive = orbits[np.arange(len(orbits))], frames.copy(), orbits.alive
    try:
        total = exact.stretch(orbits, frames, periods)
    except NotDifferentiableError:
        return _stretched_by_matrices(exact, orbits, frames, periods)
    lost = np.flatnonzero(alive & ~orbits.alive) if exact.is_flow else alive[:0]
    if len(lost):  # it may be the derivative that has no value
        again, turned = before[lost], first[lost]
        total[lost] = _stretched_by_matrices(exact, again, turned, periods)
        orbits[lost], frames[lost] = again, turned
    return total


def _stretched_by_matrices(exact: PointMap, orbits: Orbits, frames: Floats, periods: int) -> Floats:
    total = np.zeros(orbits.points.shape)
    for _ in range(periods):
        alive = orbits.alive
        if not alive.any():
            break
        places = np.where(alive[:, None], orbits.points, 0.0)
        images, matrices = tangent(exact, places, coarse=True)
        gone = alive & ~np.asarray(np.isfinite(images).all(axis=-1))
        orbits.points[:] = wrap(images, exact.coordinates)
        orbits.end(gone, Status.DIVERGED)
        usable = np.asarray(np.isfinite(matrices).all(axis=(-2, -1)))
        moved: Floats = np.where(usable[:, None, None], matrices, np.eye(exact.dimension)) @ frames
        frames[:], upper = np.linalg.qr(moved)
        sizes = np.abs(np.diagonal(upper, axis1=-2, axis2=-1))
        noise = ROUNDING * np.abs(moved).max(axis=(-2, -1))[:, None]
        with np.errstate(divide="ignore"):
            total += np.log(np.where(sizes > noise, sizes, 0.0))
        total[~usable] = np.nan
    return total


def _errors(growth: Floats, steps: Ints) -> Floats:
    """Standard errors of mean growth per step (n, d), from the spread of the means over groups of stretches."""
    lengths = np.diff(steps, prepend=0)
    first = np.linspace(0, len(steps), GROUPS + 1).round().astype(np.int64)[:-1]
    fraction = (np.add.reduceat(lengths, first) / steps[-1])[:, None, None]
    with np.errstate(invalid="ignore"):  # a direction that vanishes has an infinite exponent and no error
        means = np.add.reduceat(growth, first, axis=0) / steps[-1] / fraction
        spread = (fraction * (means - growth.sum(axis=0) / steps[-1]) ** 2).sum(axis=0)
    return np.asarray(np.sqrt(spread / (GROUPS - 1)))
