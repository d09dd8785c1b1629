"""Invariant tori of two frequencies: their Fourier series and rotation vectors from an orbit."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Complexes, Floats
from ..maps.coordinates import Coordinate, difference, turns_of, wrap
from ..maps.orbit_batch import Orbits
from ..maps.point_map import PointMap
from .invariant_circle import bump, curve_size, frequency_beside, recorded_orbit, rotation_numbers_of, signals_of

_STAGES = (
    (4096, 5),
    (16384, 10),
    (16384, 16),
)  # points of the orbit, and harmonics in each phase, one attempt after the other
_GOOD = 1e-6  # invariance error that needs no further attempt
_SUFFICIENT = 1e-3  # largest invariance error that is accepted
_PEAKS = 10  # lines of the spectrum that the two frequencies have to explain
_APART = 16.0  # least distance of two lines, in units of one over the number of points
_WEAK = 1e-3  # strength of a line, relative to the strongest, below which it is left unexplained
_ORDERS = 12  # largest order of combinations that explain spectral lines
_SAME = 1e-5  # distance of a line from its combination
_LONGEST_RELATION = 24  # whole numbers k1, k2, k0 with k1 w1 + k2 w2 = k0 that make the torus a curve, at most
_PROBES = 12  # phases in each direction at which the invariance is measured


@dataclass(frozen=True, eq=False)
class InvariantTorus:
    """A torus on which the motion is quasi-periodic with two frequencies: ``f(K(phases)) = K(phases + frequencies)``.

    Parameters
    ----------
    frequencies, frequency_errors : ndarray, shape (2,)
        Rotation vector: turns along the torus in one step of the map, between 0 and 1, up to a choice of its two phases
        (whole-number combinations of them serve as well); and the errors, differences from the values of half of the
        orbit.
    rotation_numbers, rotation_errors : ndarray, shape (dimension,)
        Full rotations of each angle per step of the map, and their errors; 0 for other coordinates.
    coefficients : ndarray of complex, shape (dimension, 2 * harmonics + 1, 2 * harmonics + 1)
        Fourier coefficients of each coordinate, or of ``exp(2j * pi * angle / turn)`` for angles, from the lowest
        harmonics to the highest.
    invariance_error : float
        Largest distance seen between the image of a point of the torus and the point at the next phases, in units of
        the torus' size.

    References
    ----------
    Laskar, Physica D 67 (1993) 257; Das, Saiki, Sander, Yorke, Nonlinearity 30 (2017) 4111.
    """

    frequencies: Floats
    frequency_errors: Floats
    rotation_numbers: Floats
    rotation_errors: Floats
    coefficients: Complexes
    invariance_error: float

    def points(self, phases: ArrayLike, coordinates: Sequence[Coordinate]) -> Floats:
        """Return points of the torus at some phases (n, 2) between 0 and 1, shape (n, dimension)."""
        first, second = np.asarray(phases, dtype=float).T
        values = np.einsum("dkl,kn,ln->nd", self.coefficients, self.waves(first), self.waves(second), optimize=True)
        return places_of(values, coordinates)

    def waves(self, phases: Floats) -> Complexes:
        """Return all harmonics (2 * harmonics + 1, n) of one of the phases (n,)."""
        harmonics = np.arange(self.coefficients.shape[-1]) - self.coefficients.shape[-1] // 2
        return np.asarray(np.exp(2j * np.pi * np.outer(harmonics, phases)))


def places_of(values: Complexes, coordinates: Sequence[Coordinate]) -> Floats:
    """Return the coordinates (..., dimension) that values of the series stand for."""
    turn = turns_of(coordinates)[1]
    return wrap(np.where(turn > 0, np.angle(values) * (turn / (2 * np.pi)), values.real), coordinates)


def fitted_torus(point_map: PointMap, state: Floats) -> InvariantTorus | None:
    """Return the invariant torus of two frequencies on which an orbit moves; None where there is none.

    Two lines of the spectrum of an orbit of 4096 points have to explain all strong ones as their combinations, without
    being commensurate with each other and with the step of the map.  The Fourier series with these frequencies has to
    satisfy the equation of invariance; else more points and harmonics are tried.
    """
    orbits = Orbits.starting(state[None].copy())
    for number, harmonics in _STAGES:
        history, rotations = recorded_orbit(point_map, orbits, number)
        if not orbits.alive.all():
            return None
        signals = signals_of(history, point_map.coordinates)
        lines, sharp = _lines(signals)
        if len(lines) < 2:  # the orbit is on a curve, or comes to rest
            return None
        frequencies, errors = _basis(lines, sharp)
        if frequencies is None or _related(frequencies, errors):
            continue
        rho, rho_errors = rotation_numbers_of(point_map, history, rotations)
        coefficients = _series(signals, frequencies, harmonics)
        torus = InvariantTorus(frequencies, errors, rho, rho_errors, coefficients, np.inf)
        error = _invariance(point_map, torus)
        if error <= _GOOD or (error <= _SUFFICIENT and number == _STAGES[-1][0]):
            return InvariantTorus(frequencies, errors, rho, rho_errors, coefficients, error)
    return None


def _basis(lines: Floats, errors: Floats) -> tuple[Floats | None, Floats]:
    """Return two lines of a spectrum of which all are combinations, and their errors; else None."""
    for i, j in itertools.combinations(range(len(lines)), 2):
        a, b = lines[i], lines[j]
        k = np.arange(-_ORDERS, _ORDERS + 1)
        made = (k[:, None] * a + k * b).ravel()
        apart = (lines[:, None] - made + 0.5) % 1.0 - 0.5
        if (np.abs(apart).min(axis=1) <= _SAME).all():
            return np.array([a, b]), np.array([errors[i], errors[j]])
    return None, np.zeros(2)


def _lines(signals: Complexes) -> tuple[Floats, Floats]:
    """Return the frequencies of the strongest lines, mirror images left out, and their errors, the strongest first."""
    number = len(signals)
    weights = bump(number)[:, None]
    centred = signals - (weights * signals).sum(axis=0)
    spectrum = np.fft.fft(weights * centred / np.maximum(np.abs(centred).max(axis=0), 1e-300), axis=0)
    strength = np.abs(spectrum)
    total = strength.max(axis=1)
    peaks = np.flatnonzero((total >= np.roll(total, 1)) & (total > np.roll(total, -1)))
    peaks = peaks[np.argsort(-total[peaks])]
    lines: list[float] = []
    errors: list[float] = []
    for peak in peaks[: 8 * _PEAKS]:
        if total[peak] < _WEAK * total[peaks[0]] or len(lines) == _PEAKS:
            break
        signal = centred[:, int(strength[peak].argmax())]
        frequency, error = frequency_beside(signal, peak / number)
        if not lines and error > _SAME:  # a spectrum without lines
            break
        known = np.array([*lines, 0.0])
        near = np.minimum(*(np.abs((known - sign * frequency + 0.5) % 1.0 - 0.5) for sign in (1, -1)))
        if near.min() > _APART / number:
            lines.append(frequency)
            errors.append(error)
    return np.array(lines), np.array(errors)


def _related(frequencies: Floats, errors: Floats) -> bool:
    """Tell whether a combination of both frequencies with small whole numbers is a whole number."""
    k = np.arange(-_LONGEST_RELATION, _LONGEST_RELATION + 1)
    first, second = (grid.ravel() for grid in np.meshgrid(k, k, indexing="ij"))
    moved = (first != 0) | (second != 0)
    total = first * frequencies[0] + second * frequencies[1]
    allowed = 1e-9 + 10.0 * (np.abs(first) * errors[0] + np.abs(second) * errors[1])
    return bool((moved & (np.abs(total - np.round(total)) <= allowed)).any())


def _series(signals: Complexes, frequencies: Floats, harmonics: int) -> Complexes:
    """Return the Fourier coefficients (d, 2 h + 1, 2 h + 1) of signals (n, d) that fit best along an orbit."""
    number, d = signals.shape
    size, times = 2 * harmonics + 1, np.arange(number)
    weights = bump(number)

    def waves(most: int, frequency: float) -> Complexes:
        return np.asarray(np.exp(-2j * np.pi * ((np.outer(np.arange(-most, most + 1), times) * frequency) % 1.0)))

    first, second = waves(2 * harmonics, frequencies[0]), waves(2 * harmonics, frequencies[1])
    moments = (first * weights) @ second.T
    k = np.arange(size)
    shift = k[:, None] - k + 2 * harmonics
    gram = moments[shift[:, None, :, None], shift[None, :, None, :]].reshape(size**2, size**2)
    inner = slice(harmonics, 3 * harmonics + 1)
    right = np.stack([(first[inner] * (weights * s)) @ second[inner].T for s in signals.T], axis=-1)
    found = np.linalg.lstsq(gram, right.reshape(size**2, d), rcond=1e-13)[0]
    return np.asarray(found.T.reshape(d, size, size))


def _invariance(point_map: PointMap, torus: InvariantTorus) -> float:
    """Return the invariance error of a torus, seen at some phases."""
    coordinates = point_map.coordinates
    steps = (np.arange(_PROBES) + 0.5) / _PROBES
    phases = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    here, there = (torus.points(p % 1.0, coordinates) for p in (phases, phases + torus.frequencies))
    images = Orbits.starting(here.copy())
    point_map.advance(images, 1)
    apart = np.abs(difference(images.points, there, coordinates))
    error = float((apart / curve_size(here, coordinates)).max())
    return error if np.isfinite(error) else np.inf
