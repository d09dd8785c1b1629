"""Parameters of a system by least squares of its simulated against its measured motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import OptimizeResult, least_squares
from scipy.special import stdtrit

from cellmap import ForcedSystem
from cellmap.utils import finite_number, finite_points

from ..arrays import Floats
from ..time_series import (
    akaike_criterion,
    measured_series,
    neighbour_correlation,
    real_numbers,
    undetermined,
    warn_of_undetermined,
    widening,
)
from .simulation import Simulation, clear_of_noise

Bounds = Mapping[str, tuple[float, float]]

_ROUGH = {"xtol": 1e-4, "ftol": 1e-5, "max_nfev": 20}
_FINE = {"xtol": 1e-8, "ftol": 1e-10, "max_nfev": 100}
_NEAR = 1e-4  # of the size of a parameter, from its bound
_DOUBLINGS = 8  # of the part that is fitted, from the first swing to the whole series, so that no phase slips
_BEFORE = (0.95, 0.85, 0.7)  # fractions of the time until a motion stops
_UNTOLD = 1e-6  # of the largest singular value, what is nothing
_FOLLOWING = 0.5  # correlation of neighbouring residuals from which on a fit says that they follow each other
KNOWN_ALREADY = "fit fewer parameters, with what is known as it is, or measure a longer and wider motion"
"""What to do where parameters are undetermined."""


@dataclass(frozen=True, eq=False)
class MotionFit:
    """A system whose motion is that of a measurement, with the errors of what was fitted.

    Parameters
    ----------
    system : ForcedSystem
        The system with the fitted parameters.
    estimates : mapping of str to float
        Fitted parameters, then the state at the first sample as ``"start NAME"``, then the zeros of the scales as
        ``"zero NAME"``, measured less true angle.
    standard_errors : mapping of str to float
        Of the estimates, by the scatter of the residuals, widened for residuals that follow each other.
    times : ndarray, shape (n,)
        Times of the samples (s).
    measured, simulated : ndarray, shape (n, m)
        Observed coordinates; NaN in `measured` is a gap.
    correlation : float
        Correlation of neighbouring residuals: near 0 if noise is all that is left, near 1 if the model is wrong.
    aicc : float
        Akaike's information criterion for small samples; comparable between fits of one measurement.
    at_bound : tuple of str
        Parameters that ended on a bound: their intervals are one-sided, and zero means that there is none of it.
    converged : bool
        Whether the least squares converged.

    A parameter whose standard error exceeds its value is `undetermined`: the measurement does not tell it from zero.
    """

    system: ForcedSystem
    estimates: Mapping[str, float]
    standard_errors: Mapping[str, float]
    times: Floats
    measured: Floats
    simulated: Floats
    correlation: float
    aicc: float
    at_bound: tuple[str, ...]
    converged: bool

    def __repr__(self) -> str:
        values = ", ".join(
            f"{n} {self.estimates[n]:.5g} +- {self.standard_errors[n]:.2g}"
            for n in self.estimates
            if n in self.system.params
        )
        flaws = [f"{n} on its bound" for n in self.at_bound] + ([] if self.converged else ["not converged"])
        flaws += [f"{n} undetermined" for n in self.undetermined]
        if self.correlation > _FOLLOWING:
            flaws.append(f"residuals follow each other, {self.correlation:.2f}")
        return f"MotionFit({'; '.join([values, f'RMSE {self.rmse:.3g}', *flaws])})"

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Fitted parameters whose standard errors exceed their values, but for those on a bound."""
        free = self.system.params.keys() - self.at_bound
        return undetermined({n: v for n, v in self.estimates.items() if n in free}, self.standard_errors)

    @property
    def residuals(self) -> Floats:
        """Measured less simulated values, shape (n, m)."""
        return self.measured - self.simulated

    @property
    def rmse(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.nanmean(self.residuals**2)))

    def interval(self, name: str, confidence: float = 0.95) -> tuple[float, float]:
        """Return an interval for one of the estimates (Student's distribution)."""
        if name not in self.estimates:
            raise ValueError(f"name={name!r}: the estimates are {', '.join(self.estimates)}")
        fraction = finite_number("confidence", confidence, above=0.0, at_most=1.0 - 1e-12)
        freedom = int(np.isfinite(self.measured).sum()) - len(self.estimates)
        reach = float(stdtrit(freedom, 0.5 + 0.5 * fraction)) * self.standard_errors[name]
        low = self.estimates[name] - reach
        return max(low, 0.0) if name in self.at_bound else low, self.estimates[name] + reach


def fit_motion(
    system: ForcedSystem,
    times: ArrayLike,
    measured: ArrayLike,
    vary: Sequence[str],
    initial_condition: Sequence[float] | None = None,
    zero: bool = False,
    bounds: Bounds | None = None,
    tolerance: float = 1e-8,
) -> MotionFit:
    """Fit parameters of a system, and the state it starts from, to a measured motion.

    Simulations with all changed parameters run side by side in the lanes of one integrator, for a parameter that
    changes is a further state that rests.  The beginning of the series is fitted first, then longer and longer parts,
    so that the phase of the simulated motion never slips by a period.

    Parameters
    ----------
    system : ForcedSystem
        The system, with first guesses of the parameters.
    times : array_like, shape (n,)
        Times (s), increasing; the forcing counts from 0.
    measured : array_like, shape (n,) or (n, m)
        The first m coordinates of the state, angles continuous; NaN marks a gap.
    vary : sequence of str
        Names of the parameters to fit.
    initial_condition : sequence of float, optional
        First guess of the state at the first time.  By default it is taken from the data, for which the state must be m
        coordinates and their m rates.
    zero : bool, optional
        Fit the zero of each scale too: measured = true + zero.
    bounds : mapping of str to tuple of float, optional
        Least and largest value of parameters.  By default a positive parameter remains positive.
    tolerance : float, optional
        Tolerance of a period of the simulation.

    Returns
    -------
    MotionFit
        The system with its fitted parameters, and their errors.

    Raises
    ------
    TypeError, ValueError
        For unknown parameters, series that are none or too short, a right-hand side that cannot be traced, and an
        initial condition whose motion ends in a failure of the integration.

    Warns
    -----
    UserWarning
        For parameters that are undetermined.

    Examples
    --------
    >>> from systems import Gravity, ViscousDamping
    >>> from systems import Pendulum
    >>> from systems import scene
    >>> from cellmap import trajectory
    >>> rod = scene(Pendulum(0.07), Gravity(9.8), ViscousDamping(0.3), period=0.5)
    >>> film = trajectory(rod.with_params(length=0.069, damping=0.4), [0.5, 0.0], periods=6, samples_per_period=50)
    >>> fit = fit_motion(rod, film.times, film.states[:, 0], ["length", "damping"])
    >>> round(fit.estimates["length"], 5), round(fit.estimates["damping"], 4)
    (0.069, 0.4)
    """
    found = fitted_motion(system, times, measured, vary, initial_condition, zero, bounds, tolerance)
    warn_of_undetermined(found.estimates, found.standard_errors, found.undetermined, KNOWN_ALREADY)
    return found


def fitted_motion(
    system: ForcedSystem,
    times: ArrayLike,
    measured: ArrayLike,
    vary: Sequence[str],
    initial_condition: Sequence[float] | None = None,
    zero: bool = False,
    bounds: Bounds | None = None,
    tolerance: float = 1e-8,
) -> MotionFit:
    """Fit as :func:`fit_motion` does, without a warning."""
    if not isinstance(system, ForcedSystem):
        raise TypeError(f"system={system!r}: give a ForcedSystem")
    t, x = _measured(times, measured)
    names = (vary,) if isinstance(vary, str) else tuple(vary)
    for name in names:
        if name not in system.params:
            raise ValueError(f"vary has {name!r}: the parameters of {system.name} are {', '.join(system.params)}")
    if not names or len(set(names)) < len(names):
        raise ValueError(f"vary={vary!r}: give names of parameters, each once")
    if x.shape[1] > system.dimension:
        raise ValueError(f"measured has {x.shape[1]} columns: {system.name} has {system.dimension} coordinates")
    fine = finite_number("tolerance", tolerance, at_least=1e-13, at_most=1e-3)
    job = Simulation(system, names, t, x, zero, fine, clear_of_noise(t, x))
    zeros = np.zeros(x.shape[1] if zero else 0)
    begin = np.concatenate([[system.params[n] for n in names], _start(t, x, system, initial_condition), zeros])
    limits = _bounds(names, begin, bounds or {})
    if job.seen.sum() <= begin.size + 2:
        raise ValueError(f"measured has {job.seen.sum()} values besides gaps for {begin.size} unknowns: give more")
    for doublings in range(_DOUBLINGS, 0, -1):
        part = job.until(0.5**doublings)
        if part.seen.sum() >= 5 * begin.size and part.swings >= 1.0:
            begin = _least_squares(part, begin, limits, _ROUGH).x
    found = _least_squares(job, begin, limits, _FINE)
    return _record(job, found if system.switches is None else _past_stops(job, found, limits), limits)


def _least_squares(job: Simulation, begin: Floats, bounds: tuple[Floats, Floats], ends: Mapping[str, float]) -> Any:
    slopes = partial(job.slopes, low=bounds[0], high=bounds[1])
    start = np.clip(begin, *bounds)
    return least_squares(job.residuals, start, slopes, bounds, x_scale=job.sizes, gtol=None, **ends)


def _past_stops(job: Simulation, found: OptimizeResult, bounds: tuple[Floats, Floats]) -> OptimizeResult:
    """Fit again from what the motion says before it stops, and keep the best.

    Where friction may stop it a half swing earlier or later, the sum of squares jumps and has many minima; the part
    before has one.
    """
    for fraction in _BEFORE:
        path = job(found.x[None])[0]
        moving = np.flatnonzero((np.diff(path, axis=0) != 0.0).any(axis=1))
        if not moving.size or moving[-1] + 2 >= len(path):  # it never rests
            break
        last, begun = job.times[moving[-1] + 1], job.times[0]
        part = job.until(fraction * float((last - begun) / (job.times[-1] - begun)))
        if part.seen.sum() >= 5 * found.x.size and part.swings >= 1.0:
            again = _least_squares(job, _least_squares(part, found.x, bounds, _FINE).x, bounds, _FINE)
            found = min(found, again, key=lambda f: float(f.cost))
    return found


def _record(job: Simulation, found: OptimizeResult, bounds: tuple[Floats, Floats]) -> MotionFit:
    q, simulated = found.x, job(found.x[None])[0]
    if not np.isfinite(simulated).all():
        raise ValueError(
            f"system={job.system!r}: its motion ends in a failure of the integration; change initial_condition="
        )
    rest = job.measured - simulated
    count, free = int(job.seen.sum()), q.size
    total = float(np.nansum(rest**2))
    # What the motion does not tell, such as length and gravity but for their ratio, has an error without bound.
    _, stretches, axes = np.linalg.svd(found.jac * job.sizes, full_matrices=False)
    reaches = axes / np.maximum(stretches, max(_UNTOLD * stretches[0], 1e-300))[:, None]
    errors = widening(rest) * job.sizes * np.sqrt((reaches**2).sum(axis=0) * total / (count - free))
    on_bound = np.minimum(q - bounds[0], bounds[1] - q) <= _NEAR * job.sizes
    return MotionFit(
        system=job.system.with_params(**dict(zip(job.names, q.tolist(), strict=False))),
        estimates=dict(zip(job.labels, q.tolist(), strict=True)),
        standard_errors=dict(zip(job.labels, errors.tolist(), strict=True)),
        times=job.times,
        measured=job.measured,
        simulated=simulated,
        correlation=neighbour_correlation(rest),
        aicc=akaike_criterion(count, total, free + 1),
        at_bound=tuple(label for label, on in zip(job.labels, on_bound, strict=True) if on),
        converged=found.status > 0,
    )


def _bounds(names: tuple[str, ...], begin: Floats, given: Bounds) -> tuple[Floats, Floats]:
    low, high = np.full(begin.size, -inf), np.full(begin.size, inf)
    low[: len(names)][begin[: len(names)] > 0.0] = 0.0
    for name, (least, most) in given.items():
        if name not in names:
            raise ValueError(f"bounds has {name!r}: the parameters to fit are {', '.join(names)}")
        if not least < most:
            raise ValueError(f"bounds[{name!r}]=({least!r}, {most!r}): give the smaller one first")
        low[names.index(name)], high[names.index(name)] = least, most
    return low, high


def _measured(times: ArrayLike, measured: ArrayLike) -> tuple[Floats, Floats]:
    """Times (n,) and columns (n, m), checked."""
    columns = real_numbers("measured", measured, " in an array of shape (n,) or (n, m)")
    if columns.ndim not in (1, 2) or not columns.size:
        raise ValueError(f"measured has the shape {columns.shape}: give (n,) or (n, m)")
    columns = columns.reshape(len(columns), -1)
    checked = [measured_series(times, column, f"measured[:, {j}]") for j, column in enumerate(columns.T)]
    return checked[0][0], np.stack([values for _, values in checked], axis=-1)


def _start(t: Floats, x: Floats, system: ForcedSystem, start: Sequence[float] | None) -> Floats:
    """First guess of the state at the first time: a parabola through the first samples of each column."""
    if start is not None:
        return finite_points("initial_condition", start, system.dimension).reshape(system.dimension)
    if system.dimension != 2 * x.shape[1]:
        raise ValueError(
            f"initial_condition=None: of the {system.dimension} coordinates of {system.name} {x.shape[1]} are "
            "measured; give a first guess of the state at the first time"
        )
    lines = []
    for column in x.T:
        seen = np.flatnonzero(np.isfinite(column))
        rotations = np.flatnonzero(np.diff(np.signbit(column[seen] - np.nanmedian(column)))) + 1
        first = seen[: max(5, int(rotations[0]) // 2 if rotations.size else 5)]
        lines.append(np.polynomial.polynomial.polyfit(t[first] - t[0], column[first], 2)[:2])
    return np.transpose(lines).ravel()
