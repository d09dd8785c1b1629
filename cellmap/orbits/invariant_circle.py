"""Invariant circles: their Fourier series and rotation numbers from an orbit, by weighted Birkhoff averages."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import gcd

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Complexes, Floats, Ints
from ..maps.compiled_advance import recorded
from ..maps.coordinates import Coordinate, difference, turns_of, wrap
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap

_STAGES = ((512, 16), (2048, 64), (8192, 256))  # points of the orbit, and harmonics, one attempt after the other
_SLOW_STAGES = tuple((1 << k, 64) for k in range(10, 18))  # stages for orbits that drift slowly, near a resonance
_SLOW_FITS = 32768  # least number of points of which curves of slow orbits are fitted
_AT_REST = 1e-3  # way in the last quarter, in units of that in the first, of an orbit that comes to rest after all
_RESONANCES = 64  # denominators up to which resonances are tried
_DRIFT = 0.02  # largest drift in that many steps, in units of the region, of an orbit that drifts slowly
_LASTING = 0.1  # least mean drift in the last quarter, in units of that in the first
_UNIFORM = 0.5  # the least such mean where nothing but the drift tells that the orbit comes round
_SEEN = 1e-12  # least way that is no rounding
_ROUNDS = 1.5  # circuits in which an orbit passes all of the curve, however unevenly it drifts
_GOOD = 1e-8  # invariance error that needs no further attempt
_SUFFICIENT = 1e-3  # largest invariance error that is accepted
_PRECISE = 1e-11  # error of a rotation number that needs no longer orbit
_HOPELESS = 0.1  # largest invariance error after which another attempt is made
_MOST_CIRCLES = 8
_LARGEST_JUMP = 0.3  # largest distance between neighbours on a curve, in units of its size
_DENSITY = 0.1  # length of a curve through n points, in units of n times its size: chaotic orbits have longer ones
_PROBES = 128  # phases at which the invariance is measured
_LOCKED = 512  # denominators up to which a rotation number is compared with rational numbers at least
_BY_CHANCE = 1e-3  # part of the rotation numbers that are taken for rational ones by chance


@dataclass(frozen=True, eq=False)
class InvariantCircle:
    """Closed curves on which the motion is quasi-periodic: ``f(K(phase)) = K(phase + frequency)``.

    Where the attractor consists of several curves that the map permutes, each is an invariant circle of the iterated
    map.

    Parameters
    ----------
    frequency, frequency_error : float
        Rotation number: turns along the curve in one step of the map, or in as many steps as there are curves, between
        0 and 1; and its error, the difference from the value of half of the orbit.
    rotation_numbers, rotation_errors : ndarray, shape (dimension,)
        Full rotations of each angle per step of the map, and their errors; 0 for other coordinates.
    coefficients : ndarray of complex, shape (curves, dimension, 2 * harmonics + 1)
        Fourier coefficients of each coordinate, or of ``exp(2j * pi * angle / turn)`` for angles, from the lowest
        harmonic to the highest.
    invariance_error : float
        Largest distance seen between the image of a point of a curve and the curve at the next phase, in units of the
        curve's size.
    cycle_period : float
        Period of the limit cycle in units of time if the system is autonomous, else NaN.

    References
    ----------
    Das, Saiki, Sander, Yorke, Nonlinearity 30 (2017) 4111.
    """

    frequency: float
    frequency_error: float
    rotation_numbers: Floats
    rotation_errors: Floats
    coefficients: Complexes
    invariance_error: float
    cycle_period: float = np.nan

    def points(self, phases: ArrayLike, coordinates: Sequence[Coordinate]) -> Floats:
        """Return points of the curves at some phases (n,) between 0 and 1, shape (curves, n, dimension)."""
        harmonics = np.arange(self.coefficients.shape[-1]) - self.coefficients.shape[-1] // 2
        waves = np.exp(2j * np.pi * np.outer(harmonics, np.asarray(phases, dtype=float)))
        values = np.einsum("cdk,kn->cnd", self.coefficients, waves)
        turn = turns_of(coordinates)[1]
        angles = np.angle(values) * (turn / (2 * np.pi))
        return wrap(np.where(turn > 0, angles, values.real), coordinates)


@dataclass(frozen=True, eq=False)
class FittedCircle:
    """A circle, with the orbit that it was fitted to: points (n, dimension) one step after the other."""

    circle: InvariantCircle
    orbit: Floats


def fitted_circle(
    point_map: PointMap, state: Floats, extent: Floats, age: int, slow: bool = True
) -> tuple[FittedCircle | None, int]:
    """Return the invariant circle to which an orbit comes; else None, and a period after which it all but closes.

    An orbit of 512 points, or more if it is older than that, is ordered by their phases, with the rotation number that
    follows from its closest returns.  If this makes a curve, it gets a Fourier series, which has to satisfy the
    equation of invariance at phases between those of the orbit.  Four and sixteen times as many points follow, from
    where the orbit is then, as long as the error falls.  Near a resonance, where the orbit is on small parts of the
    curve along which it drifts slowly, orbits are as long as it takes to come round, up to 131,072 points, if `slow`
    orbits are wanted.  The period is 0 where nothing hints at one.
    """
    orbits = Orbits.starting(state[None].copy())
    best: FittedCircle | None = None
    longest = min(1 << max(age - 1, 1).bit_length(), _STAGES[-1][0])
    stages, near = list(_STAGES), None
    while stages:
        least, harmonics = stages.pop(0)
        if near is None:
            history, rotations = recorded_orbit(point_map, orbits, max(least, longest))
        elif least <= len(history):
            continue
        else:
            more = recorded_orbit(point_map, orbits, least - len(history))
            history, rotations = np.concatenate([history, more[0]]), np.concatenate([rotations, more[1]])
        if not orbits.alive.all():
            return None, 0
        # On a longer orbit points come as close by chance.
        period = closed_after(history[-_STAGES[-1][0] :], point_map, extent)
        if period:
            return None, period
        if near is not None:
            near = near.later(history, point_map, extent)
            if near is None or _ROUNDS * near.round > _SLOW_STAGES[-1][0]:
                break
            if len(history) < max(_SLOW_FITS, _ROUNDS * near.round):
                continue
        fitted, coarse = _fit(point_map, history, rotations, harmonics)
        if fitted is None:
            if near is None and (not coarse or not stages):
                near = resonance_of(history, point_map, extent) if slow else None
                far = near is None or _ROUNDS * near.round > _SLOW_STAGES[-1][0]
                stages = [] if far else list(_SLOW_STAGES)
            continue
        if best is not None and fitted.circle.invariance_error > 0.5 * best.circle.invariance_error:
            break
        best = fitted
        if fitted.circle.invariance_error <= _GOOD:
            break
    if best is None or best.circle.invariance_error > _SUFFICIENT:
        return None, 0
    if best.circle.frequency_error > _PRECISE and len(best.orbit) < _STAGES[-1][0]:
        best = replace(best, circle=_sharpened(point_map, orbits, best.circle))
    locked = rational_within(best.circle.frequency, 10.0 * best.circle.frequency_error + 1e-13)
    if locked:
        return None, locked * len(best.circle.coefficients)
    return best, 0


def circle_through(point_map: PointMap, history: Floats, rotations: Ints) -> InvariantCircle | None:
    """Return the invariant circle on which an orbit (n, dimension) moves, None where it is on none, or locked."""
    fitted, _ = _fit(point_map, history, rotations, _STAGES[0][1])
    if fitted is None or fitted.circle.invariance_error > _SUFFICIENT:
        return None
    locked = rational_within(fitted.circle.frequency, 10.0 * fitted.circle.frequency_error + 1e-13)
    return None if locked else fitted.circle


def recorded_orbit(point_map: PointMap, orbits: Orbits, number: int) -> tuple[Floats, Ints]:
    """Move one orbit on by a number of steps; return where it has been, and its full rotations there."""
    points, rotations = [orbits.points.copy()], [orbits.rotations.copy()]
    for places, turned, _ in recorded(point_map.advance, orbits, number):
        points.append(places[:, 0])
        rotations.append(turned[:, 0])
    return np.concatenate(points)[:-1], np.concatenate(rotations)[:-1]


def _sharpened(point_map: PointMap, orbits: Orbits, circle: InvariantCircle) -> InvariantCircle:
    """Return a circle with the rotation numbers of a longer orbit that begins where the others have ended."""
    history, rotations = recorded_orbit(point_map, orbits, _STAGES[-1][0])
    if not orbits.alive.all():
        return circle
    signals = signals_of(history, point_map.coordinates)[:: len(circle.coefficients)]
    frequency, error = _refined(signals, circle.frequency)
    rho, rho_error = rotation_numbers_of(point_map, history, rotations)
    return replace(circle, frequency=frequency, frequency_error=error, rotation_numbers=rho, rotation_errors=rho_error)


def rational_within(number: float, error: float) -> int:
    """Return the least denominator of a rational number that is this close; 0 for none.

    Denominators beyond 512 are so small that one number in a thousand is as close to such a rational number by chance,
    at most, and no larger than an orbit is long.
    """
    q = np.arange(1, max(_LOCKED, int(min(np.sqrt(_BY_CHANCE / error), _STAGES[-1][0]))) + 1)
    close = np.abs(number * q - np.round(number * q)) <= error * q
    return int(q[close][0]) if close.any() else 0


@dataclass(frozen=True)
class Resonance:
    """A slow and steady drift of an orbit that all but comes back after some steps.

    ``denominator``: those steps; ``round``: about how many steps it takes to come round on the whole curve; ``numbers``
    (dimension,): full rotations per step of each coordinate, 0 for those that are no angles.
    """

    denominator: int
    round: float
    numbers: tuple[float, ...] = ()

    def later(self, history: Floats, point_map: PointMap, extent: Floats) -> Resonance | None:
        """Return the resonance seen by a longer orbit, which may pass parts of the curve quickly; None at rest."""
        ways = np.linalg.norm(_shift(history, self.denominator, point_map, extent), axis=1)
        return _drifting(self.denominator, ways, history, point_map, extent, _AT_REST)


def resonance_of(history: Floats, point_map: PointMap, extent: Floats, lasting: float = _LASTING) -> Resonance | None:
    """Return the resonance near which an orbit (n, dimension) drifts along a closed curve, None where it does not.

    It may drift unevenly, but must not slow down as an orbit does that comes to rest.
    """
    for q in range(1, min(_RESONANCES, len(history) // 8) + 1):
        shift = _shift(history, q, point_map, extent)
        ways = np.linalg.norm(shift, axis=1)
        if ways.max() <= _DRIFT:
            steady = ((shift[q:] * shift[:-q]).sum(axis=1) > 0.0).all()
            return _drifting(q, ways, history, point_map, extent, lasting) if steady else None
    return None


def _shift(history: Floats, q: int, point_map: PointMap, extent: Floats) -> Floats:
    """Return where each point of an orbit is q steps later, as seen from it."""
    return np.asarray(difference(history[q:], history[:-q], point_map.coordinates) / extent)


def _drifting(
    q: int, ways: Floats, history: Floats, point_map: PointMap, extent: Floats, lasting: float
) -> Resonance | None:
    quarter, mean = len(ways) // 4, float(ways.mean())
    if not (ways[-quarter:].mean() > lasting * ways[:quarter].mean() and mean > _SEEN):
        return None
    # Each of q parts of the orbit drifts over as much of the curve until it comes to where the next one was.
    return Resonance(q, 2.0 * float((curve_size(history, point_map.coordinates) / extent).max()) / mean)


def drift(point_map: PointMap, state: Floats, extent: Floats) -> Resonance | None:
    """Return the resonance near which the orbit of a state drifts slowly, with its rotation numbers; None for none."""
    orbits = Orbits.starting(state[None].copy())
    history, rotations = recorded_orbit(point_map, orbits, _STAGES[-1][0])
    found = resonance_of(history, point_map, extent, _UNIFORM) if orbits.alive.all() else None
    if found is None:
        return None
    # Whole rounds of all parts of the orbit weigh the same.
    whole = (len(history) - 1) // found.denominator * found.denominator
    turn = turns_of(point_map.coordinates)[1]
    moved = difference(history[whole], history[0], point_map.coordinates) / np.where(turn > 0, turn, 1.0)
    full = (
        np.round((history[whole] - history[0]) / np.where(turn > 0, turn, 1.0) - moved)
        + rotations[whole]
        - rotations[0]
    )
    return replace(found, numbers=tuple(np.where(turn > 0, (full + moved) / whole, 0.0).tolist()))


@functools.lru_cache(maxsize=16)
def bump(number: int) -> Floats:
    """Return weights of a number of points, smooth and flat at both ends, whose sum is 1, not to be changed."""
    t = np.arange(1.0, number + 1.0) / (number + 1.0)
    weights = np.exp(-1.0 / (t * (1.0 - t)))
    weights /= weights.sum()
    weights.flags.writeable = False
    return weights


def closed_after(history: Floats, point_map: PointMap, extent: Floats) -> int:
    """Return the number of steps after which the orbit's end is where it was, to a part of 1e-6; 0 for none."""
    apart = np.abs(difference(history[-2::-1], history[-1], point_map.coordinates) / extent).max(axis=-1)
    closest = np.flatnonzero(apart <= 1e-6 * np.minimum(apart.max(), 1.0))
    return int(closest[0]) + 1 if len(closest) else 0


def signals_of(points: Floats, coordinates: Sequence[Coordinate]) -> Complexes:
    """Return signals that are continuous along an orbit: points on the unit circle for angles."""
    turn = turns_of(coordinates)[1]
    signals, angles = points.astype(complex), turn > 0
    signals[..., angles] = np.exp(2j * np.pi * points[..., angles] / turn[angles])
    return signals


def _fit(point_map: PointMap, history: Floats, rotations: Ints, harmonics: int) -> tuple[FittedCircle | None, bool]:
    """Fit one curve, or as few as possible, to an orbit; else tell whether a longer orbit may succeed."""
    signals = signals_of(history, point_map.coordinates)
    places = np.concatenate([signals.real, signals.imag], axis=1)
    size = np.ptp(places, axis=0)
    moving = size > 1e-9 * (1e-3 + np.abs(places).max(axis=0))
    if not moving.any():
        return None, False
    places = places[:, moving] / size[moving]
    coarse = False
    for curves in range(1, _MOST_CIRCLES + 1):
        first, smooth = _order(places[::curves])
        coarse |= smooth
        if np.isnan(first):
            continue
        parts = [signals[k::curves][: len(signals) // curves] for k in range(curves)]
        frequency, error = _refined(parts[0], first)
        coefficients = np.array([_series(part, frequency, harmonics) for part in parts])
        rho, rho_error = rotation_numbers_of(point_map, history, rotations)
        circle = oriented(InvariantCircle(frequency, error, rho, rho_error, coefficients, np.inf), point_map)
        circle = measured(point_map, circle)
        if circle.invariance_error <= _HOPELESS:
            return FittedCircle(circle, history), True
    return None, coarse


def _order(places: Floats) -> tuple[float, bool]:
    """Return the rotation number for which phases order the points on a curve, NaN if none does; and if that is near.

    The closest returns from either side of the first point happen after denominators q of neighbours p/q in a Farey
    sequence, between which the rotation number lies; neighbours satisfy ``p1 q2 - p2 q1 = 1``.
    """
    number = len(places)
    shift = places[1:] - places[0]
    apart = np.linalg.norm(shift, axis=1)
    one = int(np.argmin(apart)) + 1
    behind = shift @ shift[one - 1] < 0.0
    if not behind.any():
        return np.nan, False
    other = int(np.argmin(np.where(behind, apart, np.inf))) + 1
    if gcd(one, other) != 1:
        return np.nan, False
    p = pow(other, -1, one)
    frequency = ((p + (p * other - 1) // one) / (one + other)) % 1.0
    ordered = places[np.argsort((np.arange(number) * frequency) % 1.0)]
    jumps = np.linalg.norm(np.roll(ordered, -1, axis=0) - ordered, axis=1)
    if jumps.sum() > _DENSITY * number:
        return np.nan, False
    return (frequency if jumps.max() <= _LARGEST_JUMP else np.nan), True


def _refined(signals: Complexes, first: float) -> tuple[float, float]:
    """Refine a rotation number by the drift of a phase from one half of the orbit to the other; also its error."""
    number = len(signals)
    centred = signals - signals.mean(axis=0)
    weights = bump(number)[:, None]
    best = (0.0, 1, 0)
    for k in (*range(1, 9), *range(-8, 0)):
        wave = np.exp(-2j * np.pi * ((k * first * np.arange(number)) % 1.0))
        scaled = np.abs((wave[:, None] * (weights * centred)).sum(axis=0)) / np.maximum(
            np.abs(centred).max(axis=0), 1e-300
        )
        if scaled.max() > 1.5 * best[0]:
            best = float(scaled.max()), k, int(scaled.argmax())
    _, k, j = best
    return frequency_beside(centred[:, j], first, k)


def frequency_beside(signal: Complexes, first: float, multiple: int = 1) -> tuple[float, float]:
    """Return the frequency of a line of a signal, and its error, the difference from that of half of the signal.

    The line is at a multiple of the frequency, which is corrected by the drift of its phase from one half to the other.
    """

    def drifted(signal: Complexes, frequency: float) -> float:
        half = len(signal) // 2
        carrier = np.exp(-2j * np.pi * ((multiple * frequency * np.arange(2 * half)) % 1.0)) * signal[: 2 * half]
        early, late = bump(half) @ carrier[:half], bump(half) @ carrier[half:]
        return frequency + float(np.angle(late * early.conjugate())) / (2 * np.pi * multiple * half)

    value, rough = first, first
    for _ in range(3):
        rough, value = drifted(signal[: len(signal) // 2], rough), drifted(signal, value)
    return value % 1.0, abs(value - rough) + 1e-15


def _series(signals: Complexes, frequency: float, harmonics: int) -> Complexes:
    """Return the Fourier coefficients (dimension, 2 harmonics + 1) of signals (n, dimension) along an orbit."""
    from scipy.linalg import solve_toeplitz

    number = len(signals)
    harmonics = min(harmonics, number // 16)
    weights = bump(number)
    base = np.exp(-2j * np.pi * ((frequency * np.arange(number)) % 1.0))
    gram, right = np.empty(2 * harmonics + 1, complex), np.empty((2 * harmonics + 1, signals.shape[1]), complex)
    wave, signals = weights.astype(complex), np.ascontiguousarray(signals.T)
    for k in range(2 * harmonics + 1):
        gram[k] = wave.sum()
        if k <= harmonics:
            right[harmonics + k] = (wave * signals).sum(axis=1)
            right[harmonics - k] = (wave.conj() * signals).sum(axis=1)
        wave *= base
    return np.asarray(solve_toeplitz((gram, gram.conj()), right)).T


def rotation_numbers_of(point_map: PointMap, history: Floats, rotations: Ints) -> tuple[Floats, Floats]:
    """Return the mean full rotations of each angle per step, and their errors; 0 for other coordinates."""
    turn = turns_of(point_map.coordinates)[1]
    around = np.where(turn > 0, turn, 1.0)
    steps = np.where(turn > 0, np.diff(history, axis=0) / around + np.diff(rotations, axis=0), 0.0)
    whole = bump(len(steps)) @ steps
    half = bump(len(steps) // 2) @ steps[: len(steps) // 2]
    return np.asarray(whole), np.abs(whole - half) + np.where(turn > 0, 1e-15, 0.0)


def oriented(circle: InvariantCircle, point_map: PointMap) -> InvariantCircle:
    """Choose the sense of the phase: with the first angle that makes full rotations, else counterclockwise."""
    coordinates = point_map.coordinates
    points = circle.points(np.arange(256) / 256, coordinates)[0]
    steps = difference(np.roll(points, -1, axis=0), points, coordinates)
    winding = steps.sum(axis=0)
    turning = np.flatnonzero(np.abs(winding) > 1e-6 * np.maximum(turns_of(coordinates)[1], 1e-300))
    turning = turning[turns_of(coordinates)[1][turning] > 0]
    if len(turning):
        forward = winding[turning[0]] > 0.0
    elif len(coordinates) > 1:
        path = points[0] + np.cumsum(steps, axis=0)
        forward = float((path[:, 0] * steps[:, 1] - path[:, 1] * steps[:, 0]).sum()) >= 0.0
    else:
        forward = True
    if forward:
        return circle
    return replace(circle, frequency=(1.0 - circle.frequency) % 1.0, coefficients=circle.coefficients[..., ::-1])


def measured(point_map: PointMap, circle: InvariantCircle) -> InvariantCircle:
    """Return the circle with its invariance error, seen at phases between those of the orbit."""
    coordinates = point_map.coordinates
    phases = (np.arange(_PROBES) + 0.5) / _PROBES
    here = circle.points(phases, coordinates)
    there = np.concatenate([here[1:], circle.points((phases + circle.frequency) % 1.0, coordinates)[:1]])
    images = Orbits.starting(here.reshape(-1, len(coordinates)).copy())
    point_map.advance(images, 1)
    apart = np.abs(difference(images.points.reshape(here.shape), there, coordinates))
    size = curve_size(here.reshape(-1, len(coordinates)), coordinates)
    error = float((apart / size).max())
    return replace(circle, invariance_error=error if np.isfinite(error) else np.inf)


def curve_size(points: Floats, coordinates: Sequence[Coordinate]) -> Floats:
    """Return the extent of points (n, dimension) of a curve; along an angle no more than its period."""
    turn = turns_of(coordinates)[1]
    shift = difference(points, points[0], coordinates)
    span = np.maximum(np.ptp(shift, axis=0), 1e-12 * (1e-3 + np.abs(points).max(axis=0)))
    return np.asarray(np.where(turn > 0, np.minimum(span, turn), span))
