"""The experiment of a stability curve on a model: the drive is raised at each frequency until a release stays up.

What is read is the first amplitude that holds, off the accelerometer, known to the step by which the drive was raised.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cellmap import ForcedSystem, PointMap, stroboscopic_map
from cellmap.maps import swept_map
from cellmap.utils import Rng, finite_number, monotone_values, random_numbers, whole_number

from ..drives import VerticalDrive
from ..lab.shaker.drive_recovery import recover_drive
from ..lab.shaker.stability_points import StabilityPoints
from .records import record_acceleration

_MOST_STEPS = 4096


def stays_up(
    strobe: PointMap,
    amplitudes: ArrayLike,
    frequencies: ArrayLike,
    cycles: int,
    release: float = 0.05,
    fallen: float = 0.5 * pi,
) -> NDArray[np.bool_]:
    """Tell which releases at rest near upright have not fallen at the end of any of so many cycles.

    Parameters
    ----------
    strobe : PointMap
        Stroboscopic map of a pendulum, swept over "amplitude" and "frequency".
    amplitudes, frequencies : array_like, shape (...)
        Drives, which broadcast against each other (m, Hz).
    cycles : int
        Periods of the drive.
    release : float, optional
        Angle of the release from upright (rad).
    fallen : float, optional
        Angle from upright that counts as fallen (rad), at most 2 pi in a cycle; full rotations are falls.

    Returns
    -------
    ndarray of bool, shape (...)
        Whether each stayed.
    """
    drives = np.broadcast_arrays(pi - release, 0.0, amplitudes, frequencies)
    states = np.stack(drives, axis=-1).reshape(-1, 4)
    rows = np.arange(len(states))
    for _ in range(cycles):
        # From the tilt before: full rotations at the branch cut pi do not add up.
        tilt = np.remainder(states[:, 0], 2.0 * pi) - pi
        images = strobe.iterate(states, 1)
        up = np.abs(tilt + images.unwrapped[:, 0] - states[:, 0]) < fallen
        states, rows = images.points[up], rows[up]
    return np.isin(np.arange(drives[0].size), rows).reshape(drives[0].shape)


def measure_least_amplitudes(
    system: ForcedSystem,
    frequencies: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    step: float = 0.01,
    release: float = 0.05,
    cycles: int = 500,
    noise: float = 3.0,
    sampling: float = 5000.0,
    duration: float = 1.0,
    *,
    rng: Rng = 0,
    rod: str = "",
) -> StabilityPoints:
    """Do the experiment on a model: raise the drive until a release stays up, and read the accelerometer.

    Each frequency begins a random part of a step above `lower`, and the drive is raised by a factor of 1 + `step`.  The
    first amplitude that holds is recovered from a noisy record.  The true limit lies anywhere in the last step, so half
    a step is taken off, and its spread, step / sqrt(12), joins the error of the record.

    Parameters
    ----------
    system : ForcedSystem
        Pendulum with the parameters amplitude (m) and frequency (Hz), such as
        :func:`systems.pendulum.driven_pendulum` gives.
    frequencies : array_like, shape (n,)
        Frequencies (Hz), above 0.
    lower, upper : array_like, shape (n,) or ()
        Amplitudes to begin with and not to go beyond (m).
    step : float, optional
        Relative step of the drive, above 0 and at most 1.
    release : float, optional
        Angle of the release from upright (rad).
    cycles : int, optional
        Periods for which the rod has to stay up.
    noise : float, optional
        Standard deviation of the accelerometer's noise (m/s^2).
    sampling, duration : float, optional
        Samples a second (Hz), and length of a record (s).
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the beginnings and of the noise.
    rod : str, optional
        Name of the rod.

    Returns
    -------
    StabilityPoints
        Amplitudes with standard errors.  They hold the error of one record and one step, and not what a finite angle
        and a finite time shift.

    Raises
    ------
    TypeError, ValueError
        For arguments out of bounds, a drive that holds at once, and one that does not hold up to `upper`.

    Examples
    --------
    >>> from systems import driven_pendulum
    >>> rod = driven_pendulum(length=0.031, damping=2.5)
    >>> points = measure_least_amplitudes(rod, [25.0], 0.0045, 0.0055, cycles=200)
    >>> bool(abs(points.amplitudes[0] - 0.00496) < 3 * points.amplitude_errors[0])
    True
    """
    rates = monotone_values("frequencies", frequencies)
    low, high = (np.broadcast_to(np.asarray(v, dtype=float), rates.shape) for v in (lower, upper))
    if not ((low > 0.0) & (high > low) & (rates > 0.0)).all():
        raise ValueError("frequencies, lower and upper: give numbers above 0, and upper above lower")
    ratio = finite_number("step", step, above=0.0, at_most=1.0)
    held_for = whole_number("cycles", cycles, at_least=1)
    rng = random_numbers(rng)
    count = int(np.ceil(np.log((high / low).max()) / np.log1p(ratio))) + 1
    if count > _MOST_STEPS:
        raise ValueError(f"step={step!r}: {count} steps from lower to upper; give a larger one")
    first = low * (1.0 + ratio) ** rng.random(len(rates))
    amplitudes = first * (1.0 + ratio) ** np.arange(count)[:, None]
    strobe = swept_map(stroboscopic_map(system), "amplitude", "frequency")
    held = stays_up(strobe, amplitudes, rates, held_for, finite_number("release", release)) & (amplitudes <= high)
    for k, rate in enumerate(rates):
        if held[0, k]:
            raise ValueError(f"lower={low[k]:g}: at {rate:g} Hz this amplitude holds the rod already; begin lower")
        if not held[:, k].any():
            raise ValueError(f"upper={high[k]:g}: at {rate:g} Hz no amplitude up to this one holds the rod; go on")
    true = np.take_along_axis(amplitudes, np.argmax(held, axis=0)[None], axis=0)[0]
    times = np.arange(int(finite_number("sampling", sampling, above=0.0) * duration)) / sampling
    read, spread = np.empty(len(rates)), np.empty(len(rates))
    for k, rate in enumerate(rates):
        drive = VerticalDrive(float(true[k]), float(rate), float(rng.uniform(-pi, pi)))
        record = record_acceleration(drive, times, noise, offset=9.8, rng=int(rng.integers(2**31)))
        found = recover_drive(times, record, frequency=float(rate), harmonics=1)
        read[k], spread[k] = found.amplitudes[0], found.amplitude_errors[0]
    middle = read * (1.0 - 0.5 * ratio / (1.0 + ratio))
    part = read * ratio / (1.0 + ratio) / sqrt(12.0)
    return StabilityPoints(rates, middle, np.hypot(spread, part), rod)
