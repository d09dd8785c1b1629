"""Equations of an invariant circle: values at equally spaced phases, rotation number and parameter."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .._lib.arrays import Floats
from ..maps.coordinates import shortest, turns_of, wrap
from ..maps.point_map import PointMap
from ..maps.tangent import tangent
from ..orbits.invariant_circle import InvariantCircle, bump, measured, oriented
from ..orbits.lyapunov_qr import stretching

_EXPONENT_STEPS, _SETTLING = 512, 128  # steps along the circle for exponents across it, and steps before those


@dataclass(frozen=True, eq=False)
class CircleProblem:
    """The equation f(K(t)) = K(t + rho) at M phases t, for unknowns (K(t_1), ..., K(t_M), rho, q) in units of `scale`.

    K is a trigonometric polynomial, f some periods of a map.  Units of states are larger by the square root of M, so
    that lengths are means over the circle.  The phase is fixed by the condition that K - K' is orthogonal to the
    derivative of another circle, `reference`, along it.

    References
    ----------
    Castella, Jorba, Celestial Mechanics and Dynamical Astronomy 76 (2000) 35; Schilder, Osinga, Vogt, SIAM Journal on
    Applied Dynamical Systems 4 (2005) 459.
    """

    swept: PointMap
    period: int
    scale: Floats
    reference: Floats

    @property
    def dimension(self) -> int:
        """Number of state variables."""
        return self.swept.dimension - 1

    @property
    def phases(self) -> int:
        """Number of phases."""
        return len(self.reference)

    def curve(self, unknowns: Floats) -> Floats:
        """Return the points (M, d) of a circle, angles unwrapped."""
        return np.asarray((unknowns * self.scale)[:-2].reshape(self.phases, self.dimension))

    def __call__(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Return residuals (M d + 1,) and their derivatives (M d + 1, M d + 2)."""
        m, d = self.phases, self.dimension
        points, (rho, value) = self.curve(unknowns), unknowns[-2:] * self.scale[-2:]
        unit, turn = self.scale[: m * d].reshape(m, d), turns_of(self.swept.coordinates)[1][:d]
        images, matrices = tangent(self.swept, np.column_stack([points, np.full(m, value)]), self.period)
        shift = shift_matrix(m, rho)
        apart = shortest(images[:, :d] - shift @ points, turn)
        slopes = np.zeros((m, d, m, d))
        rows = np.arange(m)
        slopes[rows, :, rows] = matrices[:, :d, :d] * unit[:, None, :] / unit[:, :, None]
        for j in range(d):
            slopes[:, j, :, j] -= shift
        by_rho = -(shift @ derivative(points)) / unit
        by_value = matrices[:, :d, d] * self.scale[-1] / unit
        whole = np.column_stack([slopes.reshape(m * d, m * d), by_rho.ravel(), by_value.ravel()])
        across = (derivative(self.reference) / unit).ravel()
        across /= np.linalg.norm(across)
        fixed = np.append(across, [0.0, 0.0])
        residual = np.append((apart / unit).ravel(), across @ ((points - self.reference) / unit).ravel())
        return residual, np.vstack([whole, fixed])

    def finer(self, unknowns: Floats, phases: int) -> tuple[CircleProblem, Floats]:
        """Return the equations with more phases, and the circle as their unknowns."""
        d, ratio = self.dimension, np.sqrt(phases / self.phases)
        unit = np.tile(self.scale[:d] * ratio, phases)
        finer = replace(self, scale=np.append(unit, self.scale[-2:]), reference=resampled(self.reference, phases))
        values = np.append(resampled(self.curve(unknowns), phases).ravel() / unit, unknowns[-2:])
        return finer, values

    def tail(self, unknowns: Floats) -> float:
        """Return the size of the last harmonics in units of the largest one."""
        sizes = np.abs(np.fft.rfft(self.curve(unknowns) / self.scale[: self.dimension], axis=0)).max(axis=1)
        return float(sizes[-(len(sizes) // 4) :].max() / sizes[1:].max())

    def circle(self, exact: PointMap, unknowns: Floats) -> InvariantCircle:
        """Return the circle of the map, as many curves as periods."""
        turn = turns_of(exact.coordinates)[1]
        points, curves = self.curve(unknowns), []
        for _ in range(self.period):
            waves = np.exp(2j * np.pi * points / np.where(turn > 0.0, turn, 1.0))
            values = np.where(turn > 0.0, waves, points)
            curves.append(np.fft.fftshift(np.fft.fft(values, axis=0) / self.phases, axes=0).T)
            points = tangent(exact, wrap(points, exact.coordinates))[0]
        none = np.zeros(self.dimension)
        rho = float(unknowns[-2] * self.scale[-2] % 1.0)
        found = measured(exact, oriented(InvariantCircle(rho, 0.0, none, none, np.array(curves), np.inf), exact))
        return replace(found, frequency_error=found.invariance_error)


def across_exponent(exact: PointMap, circle: InvariantCircle) -> float:
    """Return the largest Lyapunov exponent per step across a circle; negative where it attracts.

    In the plane it is the mean of the logarithm of the determinant, as the exponent along the circle is 0; in more
    dimensions a mean of derivatives between planes normal to the circle, to about 1e-5, or 1e-3 where two exponents
    across the circle are nearly equal.
    """
    curves, d, axes = len(circle.coefficients), exact.dimension, exact.coordinates
    if d == 2:
        phases = np.arange(circle.coefficients.shape[-1]) / circle.coefficients.shape[-1]
        return float(np.log(np.abs(np.linalg.det(tangent(exact, circle.points(phases, axes))[1]))).mean())
    phases = np.mod(np.arange(_SETTLING + _EXPONENT_STEPS + 1) * circle.frequency, 1.0)
    slopes = tangent(exact, circle.points(phases[:-1], axes)[0], curves)[1]
    directions = _along(circle, phases, turns_of(axes)[1])
    normal = np.linalg.svd(directions[:, None])[2][:, 1:]
    logs = stretching((normal[1:] @ slopes @ normal[:-1].swapaxes(-1, -2))[None])[_SETTLING:, 0]
    return float((bump(len(logs)) @ logs).max() / curves)


def _along(circle: InvariantCircle, phases: Floats, turn: Floats) -> Floats:
    """Return derivatives (n, d) of the first curve by the phase; `turn` has the periods of angles, 0 for others."""
    coefficients = circle.coefficients[0]
    harmonics = np.arange(coefficients.shape[-1]) - coefficients.shape[-1] // 2
    waves = np.exp(2j * np.pi * np.outer(harmonics, phases))
    values, rates = (coefficients @ waves).T, ((2j * np.pi * harmonics * coefficients) @ waves).T
    turns = np.imag(rates / np.where(turn > 0.0, values, 1.0)) * turn / (2.0 * np.pi)
    return np.asarray(np.where(turn > 0.0, turns, rates.real))


def shift_matrix(phases: int, rho: float) -> Floats:
    """Return the matrix (M, M) that takes values of a trigonometric polynomial at M phases to those at phases + rho."""
    offsets = np.arange(phases) / phases + rho
    harmonics = np.arange(1, phases // 2 + 1)
    kernel = (1.0 + 2.0 * np.cos(2.0 * np.pi * np.outer(offsets, harmonics)).sum(axis=1)) / phases
    rows = np.arange(phases)
    return np.asarray(kernel[(rows[:, None] - rows) % phases])


def derivative(points: Floats) -> Floats:
    """Return the derivative by the phase of values (M, d) at an odd number of phases."""
    waves = np.fft.rfft(points, axis=0)
    return np.fft.irfft(2j * np.pi * np.arange(len(waves))[:, None] * waves, len(points), axis=0)


def resampled(points: Floats, phases: int) -> Floats:
    """Return the values (M, d) of the same trigonometric polynomial at more phases."""
    waves = np.fft.rfft(points, axis=0)
    return np.fft.irfft(waves, phases, axis=0) * (phases / len(points))
