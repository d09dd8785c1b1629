"""What an accelerometer on a shaken pivot would record: acceleration with the faults of sensor and converter."""

from __future__ import annotations

from math import exp
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cellmap import ForcedSystem
from cellmap.utils import Rng, finite_number, over_arrays, random_numbers, whole_number

from ..effects import Effect
from ..lab.shaker.voltage_conversion import STANDARD_GRAVITY, volts_from_acceleration

_SIXTH_ORDER = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / 180.0
_FRACTION = 256  # of a period, over which the height is differenced


def pivot_acceleration(source: Effect | ForcedSystem, times: ArrayLike) -> NDArray[np.float64]:
    """Return the upward acceleration of a pivot.

    Parameters
    ----------
    source : Effect or ForcedSystem
        A drive that moves the pivot up and down, or a scene with one.
    times : array_like, shape (n,)
        Times (s).

    Returns
    -------
    ndarray, shape (n,)
        Acceleration (m/s^2).  Of a drive it is its term in the equation of motion; of a scene the second difference of
        the pivot's place, with a relative error of 1e-12 for a sine, and not near the edges of a sharp wave.

    Raises
    ------
    TypeError, ValueError
        For something else, or a drive or scene whose pivot does not move up and down.

    Examples
    --------
    >>> from systems import VerticalDrive
    >>> pivot_acceleration(VerticalDrive(0.003, 50.0), [0.0, 0.01]).round(6).tolist()
    [-296.088132, 296.088132]
    """
    t = np.asarray(times, dtype=np.float64)
    if isinstance(source, ForcedSystem):
        return _of_scene(source, t)
    if not isinstance(source, Effect):
        raise TypeError(f"source={source!r}: give a drive, such as VerticalDrive(0.003, 50.0), or a scene")
    terms = source.terms
    if terms.vertical is None or terms.period is None:
        raise ValueError(f"source={source!r}: give a drive that moves the pivot up and down")
    p = SimpleNamespace(**source.parameters)
    signs = [np.sign(over_arrays(clock)(t, p)) for clock in terms.clocks]
    return np.broadcast_to(np.asarray(over_arrays(terms.vertical)(t, p, *signs), dtype=float), t.shape).copy()


def _of_scene(system: ForcedSystem, t: NDArray[np.float64]) -> NDArray[np.float64]:
    if "positions" not in system.outputs:
        raise ValueError(f"source={system!r}: it does not tell where its pivot is; give the drive")
    step = system.length / _FRACTION
    states = np.zeros((*t.shape, system.dimension))
    heights = [system.output("positions", t + k * step, states)[..., 1] for k in range(-3, 4)]
    if not any(np.ptp(h) > 0.0 for h in heights):
        raise ValueError(f"source={system!r}: its pivot does not move up and down")
    return np.tensordot(_SIXTH_ORDER, np.array(heights), axes=1) / step**2


def record_acceleration(
    source: Effect | ForcedSystem,
    times: ArrayLike,
    noise: float = 0.0,
    noise_time: float = 0.0,
    offset: float = 0.0,
    drift: float = 0.0,
    full_scale: float | None = None,
    bits: int | None = None,
    missing: float = 0.0,
    volts_per_g: float | None = None,
    standard_gravity: float = STANDARD_GRAVITY,
    *,
    rng: Rng = 0,
) -> NDArray[np.float64]:
    """Return a synthetic record of an accelerometer on a pivot.

    The record is in m/s^2, or in volts where `volts_per_g` is given; `noise`, `offset`, `drift` and `full_scale` are in
    the unit of the record.

    Parameters
    ----------
    source : Effect or ForcedSystem
        A drive that moves the pivot up and down, or a scene with one.
    times : array_like, shape (n,)
        Increasing times (s).
    noise : float, optional
        Standard deviation of Gaussian noise, at least 0.
    noise_time : float, optional
        Time (s) over which the noise forgets itself exponentially; 0 for white noise.
    offset, drift : float, optional
        Offset at the time 0, and its change per second.
    full_scale : float, optional
        Reading beyond which the sensor is cut off, to both sides; above 0.
    bits : int, optional
        Bits of the converter, 1 to 32, over the full scale.
    missing : float, optional
        Fraction of samples lost at random, which become NaN; at least 0 and at most 1.
    volts_per_g, standard_gravity : float, optional
        Calibration, as for :func:`systems.lab.shaker.voltage_conversion.displacement_amplitude`.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of noise and losses.

    Returns
    -------
    ndarray, shape (n,)
        Record.

    Raises
    ------
    TypeError, ValueError
        For arguments out of bounds, bits without a full scale, times that do not increase, and as
        :func:`pivot_acceleration`.

    Examples
    --------
    >>> from systems import VerticalDrive
    >>> drive = VerticalDrive(0.003, 50.0)
    >>> record_acceleration(drive, [0.0, 0.005, 0.01], volts_per_g=0.1, full_scale=2.5, bits=8).tolist()
    [-2.5, 0.0, 2.48046875]
    """
    t = np.asarray(times, dtype=np.float64)
    if t.ndim != 1 or not np.isfinite(t).all() or not (np.diff(t) > 0.0).all():
        raise ValueError(f"times have the shape {t.shape}: give finite, increasing ones, in one row")
    spread = finite_number("noise", noise, at_least=0.0)
    memory = finite_number("noise_time", noise_time, at_least=0.0)
    lost = finite_number("missing", missing, at_least=0.0, at_most=1.0)
    top = None if full_scale is None else finite_number("full_scale", full_scale, above=0.0)
    rng = random_numbers(rng)
    record: Any = pivot_acceleration(source, t)
    if volts_per_g is not None:
        record = volts_from_acceleration(record, volts_per_g, standard_gravity)
    record = record + finite_number("offset", offset) + finite_number("drift", drift) * t
    record = record + spread * _coloured(rng.standard_normal(len(t)), t, memory)
    if bits is not None:
        if top is None:
            raise ValueError(f"bits={bits!r}: give the full_scale that they cover")
        levels = 2 ** (whole_number("bits", bits, 1, 32) - 1)
        record = np.clip(np.rint(record / top * levels), -levels, levels - 1) * (top / levels)
    elif top is not None:
        record = np.clip(record, -top, top)
    record[rng.random(len(t)) < lost] = np.nan
    return record


def _coloured(white: NDArray[np.float64], t: NDArray[np.float64], memory: float) -> NDArray[np.float64]:
    """Make an Ornstein-Uhlenbeck process of unit variance from independent numbers."""
    if memory == 0.0 or len(white) == 0:
        return white
    made = [float(white[0])]
    for step, fresh in zip(np.diff(t).tolist(), white[1:].tolist(), strict=True):
        kept = exp(-step / memory)
        made.append(kept * made[-1] + (1.0 - kept * kept) ** 0.5 * fresh)
    return np.array(made)
