"""Simulations of a measurement: many rows of unknowns side by side, at the times of its samples."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import ceil, pi

import numpy as np
from scipy.interpolate import CubicSpline

from cellmap import ForcedSystem, trajectory
from cellmap.maps import swept_system

from ..arrays import Bools, Floats
from ..time_series import noise_level

_STEP = 1e-4  # of a difference quotient, relative to the size of what changes
_FINE = 100  # samples of a swing between which a spline is as good as the motion, for any measurement
_WIDE = 100.0  # factor by which a period that is fitted may differ from its first guess
_FINER = 8  # samples between two measured ones, at most
_SWING_FRACTION = 0.2  # of the widest swing, what counts as one
_CLEAR = 4.0  # standard deviations of the noise, but no more than
_CLEAR_FRACTION = 0.5  # of the widest swing of all
_NEIGHBOURS = 13  # that tell noise from a motion with few samples in a swing


@dataclass(frozen=True, eq=False)
class Simulation:
    """A measurement and the motions that might explain it.

    A row of unknowns q has the varied parameters, the state at the first time, and the zeros of the scales.

    Parameters
    ----------
    system : ForcedSystem
        The system.
    names : tuple of str
        Parameters that vary.
    times : ndarray, shape (n,)
        Times of the samples, in the unit of the period.
    measured : ndarray, shape (n, m)
        The first m coordinates; NaN marks a gap.
    zero : bool
        Whether there are zeros, one for each measured coordinate.
    tolerance : float
        Tolerance of a period.
    clear : ndarray, shape (m,)
        Distance from the middle beyond which a swing is no noise, as :func:`clear_of_noise` returns it.
    """

    system: ForcedSystem
    names: tuple[str, ...]
    times: Floats
    measured: Floats
    zero: bool
    tolerance: float
    clear: Floats
    _swept: dict[str, ForcedSystem] = field(default_factory=dict)

    @property
    def labels(self) -> list[str]:
        """Names of the unknowns."""
        axes = [c.name for c in self.system.axes]
        zeros = axes[: self.measured.shape[1]] if self.zero else []
        return [*self.names, *(f"start {name}" for name in axes), *(f"zero {name}" for name in zeros)]

    @property
    def seen(self) -> Bools:
        """Where there is a value, shape (n, m)."""
        return np.isfinite(self.measured)

    @property
    def swings(self) -> float:
        """Number of swings of the coordinate that swings most often, clear of the noise."""
        crossings = []
        for column, least in zip(self.measured.T, self.clear.tolist(), strict=True):
            values = column[np.isfinite(column)]
            values = values - np.median(values) if values.size else values
            clear = values[np.abs(values) > max(_SWING_FRACTION * np.abs(values).max(initial=0.0), least)]
            crossings.append(np.count_nonzero(np.diff(np.signbit(clear))))
        return 0.5 * max(crossings)

    @property
    def sizes(self) -> Floats:
        """Sizes of the unknowns: of parameters their first guess, of states and zeros the range of what is measured."""
        wide = [float(np.nanmax(c) - np.nanmin(c)) for c in self.measured.T]
        rate = 2.0 * pi * max(self.swings, 0.5) / float(self.times[-1] - self.times[0])
        states = [*wide, *(w * rate for w in wide)]
        states = [*states, *[max(states)] * self.system.dimension][: self.system.dimension]
        return np.array(
            [*(abs(self.system.params[n]) or 1.0 for n in self.names), *states, *(wide if self.zero else ())]
        )

    def until(self, part: float) -> Simulation:
        """Return the simulation of the first part of the measurement."""
        end = self.times[0] + part * (self.times[-1] - self.times[0])
        stop = int(np.searchsorted(self.times, end, side="right"))
        return replace(self, times=self.times[:stop], measured=self.measured[:stop])

    def __call__(self, rows: Floats) -> Floats:
        """Return the measured coordinates of rows of unknowns, shape (rows, n, m); NaN where the integration failed."""
        p, d, m = len(self.names), self.system.dimension, self.measured.shape[1]
        initial_conditions = np.concatenate([rows[:, p : p + d], rows[:, :p]], axis=1)
        values = np.full((len(rows), len(self.times), m), np.nan)
        lengths = np.array([self._length(row[:p]) for row in rows])
        # Where the period is itself a function of parameters, rows of one period run together.
        for length in np.unique(lengths[lengths > 0.0]).tolist():
            mine = np.flatnonzero(lengths == length)
            values[mine] = self._motions(initial_conditions[mine], length)
        return values + rows[:, None, p + d :] if self.zero else values

    def _length(self, parameters: Floats) -> float:
        """Return the period at values of the varied parameters; 0 where it is out of all proportion."""
        period, usual = self.system.period, self.system.length
        if not callable(period):
            return usual
        changes = {n: v for n, v in zip(self.names, parameters.tolist(), strict=True) if v != self.system.params[n]}
        try:
            length = float(period(self.system.parameters._replace(**changes)))
        except ArithmeticError:
            return 0.0
        return length if usual / _WIDE < length < usual * _WIDE else 0.0

    def _motions(self, initial_conditions: Floats, length: float) -> Floats:
        """Return the measured coordinates of initial conditions with one period; NaN where the integration failed."""
        periods, samples = self._sampling(length)
        # The forcing repeats itself, so that whole periods before the first time do not matter.
        phase = float(np.remainder(self.times[0] / length, 1.0))
        motion = trajectory(
            self._swept_system(), initial_conditions, periods, samples, phase, self.tolerance, self.tolerance
        )
        states = np.moveaxis(motion.states[:, :, : self.measured.shape[1]], 1, 0)
        good = np.isfinite(states).all(axis=(1, 2))
        values = np.full((len(initial_conditions), len(self.times), self.measured.shape[1]), np.nan)
        moments = np.arange(states.shape[1]) * (length / samples)
        values[good] = CubicSpline(moments, states[good], axis=1)(self.times - self.times[0])
        return values

    def residuals(self, q: Floats) -> Floats:
        """Return simulated less measured values where there are any; huge ones for a motion that ends nowhere."""
        rest = (self(q[None])[0] - self.measured)[self.seen]
        return np.where(np.isfinite(rest), rest, 1e3 * float(np.ptp(self.measured[self.seen])))

    def slopes(self, q: Floats, low: Floats, high: Floats) -> Floats:
        """Return the derivatives of the residuals, all difference quotients from one batch within the bounds."""
        step = np.diag(_STEP * np.maximum(np.abs(q), self.sizes))
        up, down = np.minimum(q + step, high), np.maximum(q - step, low)
        values = self(np.concatenate([up, down]))[:, self.seen]
        return np.nan_to_num(((values[: q.size] - values[q.size :]) / np.diag(up - down)[:, None]).T)

    def _swept_system(self) -> ForcedSystem:
        """Return the system with the varied parameters as states, built once for all parts of the measurement."""
        if not self._swept:
            self._swept["made"] = swept_system(self.system, *self.names)
        return self._swept["made"]

    def _sampling(self, length: float) -> tuple[int, int]:
        """Return periods, and samples in each that are fine enough for a spline through them."""
        spacing, span = float(np.median(np.diff(self.times))), float(self.times[-1] - self.times[0])
        fine = max(min(spacing, span / max(self.swings, 1.0) / _FINE), spacing / _FINER)
        return max(1, ceil(span / length - 1e-9)), max(4, ceil(length / fine - 1e-9))


def clear_of_noise(times: Floats, measured: Floats) -> Floats:
    """Return the distance from the middle beyond which each coordinate swings, and does not merely scatter.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Times of the samples.
    measured : ndarray, shape (n, m)
        Coordinates; NaN marks a gap.

    Returns
    -------
    ndarray, shape (m,)
        Distances.
    """
    noise = np.nan_to_num([noise_level(times, column, _NEIGHBOURS) for column in measured.T])
    widest = np.nanmax(np.abs(measured - np.nanmedian(measured, axis=0)), axis=0)
    return np.minimum(_CLEAR * noise, _CLEAR_FRACTION * widest)
