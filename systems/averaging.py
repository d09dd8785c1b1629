"""Effective potentials of fast drives, by averaging."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cellmap import ForcedSystem
from cellmap.utils import check_length, finite_number, over_arrays

_LOOKS = 2**15  # looks at the accelerations of a period
_FEWEST = 16  # samples of a period
_NEGLIGIBLE = 1e-12  # strength of a harmonic that rounding explains, relative to the accelerations
_AT_ONCE = 2**18  # samples evaluated at a time
_IMAGINARY = 1e-30  # step of derivatives along the imaginary axis: no difference is taken, so none cancels
_STENCIL = np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0
_STEP = 2e-3  # (rad) of the stencil: error and rounding both below 1e-13
_STEADY = 1e-9  # variation of a steady torque that rounding explains


@dataclass(frozen=True, eq=False)
class EffectivePotential:
    """Effective potential of the slow part of a motion with a fast drive; call it with an angle for each joint.

    Parameters
    ----------
    system : ForcedSystem
        The system.
    samples : int
        Number of times in a period over which averages are taken: exact for the harmonics of the drive.
    torque : ndarray, shape (joints,)
        Steady torques that are not included in its energy, such as that of a :class:`~systems.effects.ConstantTorque`;
        in the unit of the energy.
    """

    system: ForcedSystem
    samples: int
    torque: NDArray[np.float64]

    def __repr__(self) -> str:
        return f"EffectivePotential({self.system.name}, {self.samples} samples)"

    @property
    def joints(self) -> int:
        """Number of joints."""
        return self.system.dimension // 2

    def __call__(self, *angles: ArrayLike) -> NDArray[np.float64]:
        """Return the potential at angles (rad), one array for each joint; they broadcast against each other.

        It is in the unit of the output "energy": m^2/s^2 for a :class:`~systems.pendulum.Pendulum`, otherwise J.
        """
        return self._at(self._places(angles))

    def gradient(self, *angles: ArrayLike) -> NDArray[np.float64]:
        """Return the derivatives by the angles, to rounding; their axis is the last one."""
        places = self._places(angles)
        steps = 1j * _IMAGINARY * np.eye(self.joints)
        return np.stack([self._at(places + step).imag / _IMAGINARY for step in steps], axis=-1)

    def hessian(self, *angles: float) -> NDArray[np.float64]:
        """Return the second derivatives by the angles at one place, shape (joints, joints), to about 1e-12."""
        place = np.array([finite_number(f"angles[{i}]", a) for i, a in enumerate(angles)])
        shifts = _STEP * np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])[:, None, None] * np.eye(self.joints)
        slopes = self.gradient(*np.moveaxis(place + shifts, -1, 0))
        matrix: NDArray[np.float64] = np.tensordot(_STENCIL, slopes, 1) / _STEP
        return 0.5 * (matrix + matrix.T)

    def inertia(self, *angles: float) -> NDArray[np.float64]:
        """Return the mass matrix at one place, shape (joints, joints): kinetic energy is half its quadratic form."""
        places = self._places([[a] for a in angles])
        return _inertia(self._functions, places)[0]

    def _places(self, angles: Sequence[ArrayLike]) -> NDArray[np.float64]:
        if len(angles) != self.joints:
            raise ValueError(f"angles: give {self.joints}, one array for each joint, and not {len(angles)}")
        check_length("angles", angles)
        try:
            arrays = [np.asarray(a, dtype=float) for a in angles]
        except (OverflowError, TypeError, ValueError):
            raise TypeError("angles: give real numbers (rad)") from None
        places = np.stack(np.broadcast_arrays(*arrays), axis=-1)
        if not np.isfinite(places).all():
            raise ValueError("angles: give finite numbers (rad)")
        return places

    @property
    def _functions(self) -> _Functions:
        return _Functions.of(self.system)

    def _at(self, places: NDArray[Any]) -> NDArray[Any]:
        rows = places.reshape(-1, self.joints)
        slices = np.array_split(rows, max(1, ceil(len(rows) * self.samples / _AT_ONCE)))
        values = [_averaged(self._functions, part, self.samples) - part @ self.torque for part in slices]
        result = np.concatenate(values).reshape(places.shape[:-1])
        return result if np.iscomplexobj(places) else result.real


def effective_potential(system: ForcedSystem) -> EffectivePotential:
    """Compute the effective potential of the slow motion of a system with a fast drive.

    The motion is a slow one plus a fast one xi, whose acceleration is the oscillating part of that of the system at
    zero velocity.  Averaged over a period, xi contributes its kinetic energy: V_eff = V + <T(q, xi')>, with the steady
    part V of the potential.  This holds for accelerated pivots and for torques, in any number of joints, to leading
    order in the ratio of amplitude to length at fixed speed of the pivot; friction does not enter.

    Parameters
    ----------
    system : ForcedSystem
        A scene without dry friction, drag and sharp waves: its state is angles, then angular velocities, and its output
        "energy" has kinetic and potential energy in the frame of the pivot.  The energy need not include steady
        torques.

    Returns
    -------
    EffectivePotential
        Function of one angle for each joint.

    Raises
    ------
    TypeError
        For something that is not a system, for a discontinuous right-hand side, and for an energy that is not analytic.
    ValueError
        For a system without an energy or with other states, for a steady force that the energy does not include, and
        for a drive of more than 8,192 harmonics.

    References
    ----------
    Kapitza, Soviet Physics JETP 21 (1951) 588; Landau, Lifshitz, *Mechanics* (1976), section 30.

    Examples
    --------
    >>> from systems import driven_pendulum
    >>> potential = effective_potential(driven_pendulum())
    >>> float(potential(pi / 2)) / (0.003 * 2 * pi * 50) ** 2
    0.25
    """
    functions = _Functions.of(system)
    probes = np.random.default_rng(0).uniform(-pi, pi, (4, functions.joints))
    strengths = np.abs(np.fft.rfft(functions.accelerations(probes, _LOOKS), axis=-1))
    present = strengths > _NEGLIGIBLE * strengths.max(axis=-1, keepdims=True)
    highest = int(np.flatnonzero(present.any(axis=(0, 1))).max(initial=0))
    if highest > _LOOKS // 4:
        raise ValueError(
            f"system={system!r}: its drive has more than {_LOOKS // 4} harmonics; give its waves more smoothing"
        )
    samples = max(_FEWEST, 2 * highest + 2)
    means = functions.accelerations(probes, samples).mean(axis=-1)
    forces = np.einsum("mij,jm->mi", _inertia(functions, probes), means)
    slopes = _slopes_of_energy(functions, probes, samples)
    rest = forces + slopes
    torque = rest.mean(axis=0)
    scale = max(1e-300, float(np.abs(forces).max()), float(np.abs(slopes).max()))
    if np.abs(rest - torque).max() > _STEADY * scale:
        raise ValueError(
            f"system={system!r}: a steady force that changes with the angles is not in its energy; give the effect "
            "the term `stored`, or a drive without a mean"
        )
    potential = EffectivePotential(system, samples, np.where(np.abs(torque) > _STEADY * scale, torque, 0.0))
    _check_derivatives(potential, probes)
    return potential


@dataclass(frozen=True, eq=False)
class _Functions:
    """Right-hand side and energy of a system, over arrays of angles (m, joints), real or complex."""

    system: ForcedSystem
    rhs: Callable[..., Any]
    energy: Callable[..., Any]

    @property
    def joints(self) -> int:
        return self.system.dimension // 2

    @classmethod
    def of(cls, system: ForcedSystem) -> _Functions:
        if not isinstance(system, ForcedSystem):
            raise TypeError(f"system={system!r}: give a ForcedSystem, such as a scene")
        if system.switches is not None:
            raise TypeError(
                f"system={system!r}: its right-hand side is discontinuous; leave out dry friction and drag, "
                "and smooth its waves"
            )
        if "energy" not in system.outputs or system.dimension % 2:
            raise ValueError(
                f"system={system!r}: give a scene, with the angles and angular velocities of joints, and its energy"
            )
        joints = system.dimension // 2
        trial = [0.1 + 0.7 * j for j in range(system.dimension)]
        moved, energies = system.derivative(0.0, trial), system.output("energy", 0.0, trial)
        if list(moved[:joints]) != trial[joints:] or energies.shape != (2,):
            raise ValueError(
                f"system={system!r}: give a scene, with the angles and angular velocities of joints, and its energy"
            )
        return cls(system, over_arrays(system.rhs), over_arrays(system.outputs["energy"]))

    def times(self, samples: int) -> NDArray[np.float64]:
        return np.arange(samples, dtype=np.float64) * float(self.system.length / samples)

    def accelerations(self, angles: NDArray[Any], samples: int) -> NDArray[Any]:
        """Accelerations at rest over a period, shape (joints, m, samples)."""
        at_rest = np.zeros((len(angles), 1))
        columns = (*angles.T[:, :, None], *[at_rest] * self.joints)
        rates = self.rhs(self.times(samples), columns, self.system.parameters)[self.joints :]
        return np.stack([np.broadcast_to(r, (len(angles), samples)) for r in rates])

    def energies(self, angles: NDArray[Any], rates: NDArray[Any]) -> tuple[Any, Any]:
        """Kinetic and potential energy of angles (m, joints) with rates (joints, m, samples)."""
        columns = (*angles.T[:, :, None], *rates)
        kinetic, potential = self.energy(self.times(rates.shape[-1]), columns, self.system.parameters)
        return kinetic, potential


def _averaged(functions: _Functions, angles: NDArray[Any], samples: int) -> NDArray[Any]:
    """Mean kinetic energy of the fast motion plus mean potential, shape (m,); real and complex parts apart."""
    fast = functions.accelerations(angles, samples)
    length = functions.system.length
    rates = _oscillation(fast.real, length)
    if np.iscomplexobj(fast):
        rates = rates + 1j * _oscillation(fast.imag, length)
    kinetic, potential = functions.energies(angles, rates)
    return np.asarray(np.broadcast_to(kinetic + potential, rates.shape[1:]).mean(axis=-1))


def _oscillation(values: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    """Integrate the part of zero mean of samples of a period, to zero mean."""
    count = values.shape[-1]
    spectrum = np.fft.rfft(values, axis=-1)
    harmonics = np.arange(1, spectrum.shape[-1])
    spectrum[..., 1:] /= 2j * pi * harmonics / length
    spectrum[..., 0] = 0.0
    if count % 2 == 0:
        spectrum[..., -1] = 0.0
    return np.asarray(np.fft.irfft(spectrum, count, axis=-1))


def _slopes_of_energy(functions: _Functions, angles: NDArray[np.float64], samples: int) -> NDArray[np.float64]:
    """Derivatives of the mean potential energy by the angles, shape (m, joints)."""
    slopes = np.empty(angles.shape)
    at_rest = np.zeros((functions.joints, len(angles), samples))
    for j, step in enumerate(1j * _IMAGINARY * np.eye(functions.joints)):
        potential = functions.energies(angles + step, at_rest)[1]
        slopes[:, j] = np.broadcast_to(np.imag(potential), at_rest.shape[1:]).mean(axis=-1) / _IMAGINARY
    return slopes


def _inertia(functions: _Functions, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mass matrices, shape (m, joints, joints), from the kinetic energies of sums of unit rates."""
    n = functions.joints
    unit = np.eye(n)

    def kinetic(rates: NDArray[np.float64]) -> NDArray[np.float64]:
        columns = np.broadcast_to(rates[:, None, None], (n, len(angles), 1))
        return np.broadcast_to(functions.energies(angles, columns)[0], (len(angles), 1))[:, 0]

    single = [kinetic(unit[i]) for i in range(n)]
    matrices = np.empty((len(angles), n, n))
    for i in range(n):
        matrices[:, i, i] = 2.0 * single[i]
        for j in range(i):
            matrices[:, i, j] = matrices[:, j, i] = kinetic(unit[i] + unit[j]) - single[i] - single[j]
    return matrices


def _check_derivatives(potential: EffectivePotential, probes: NDArray[np.float64]) -> None:
    """Refuse functions that do without the imaginary part of a number, as abs does."""
    slopes = potential.gradient(*probes.T)
    steps = 1e-4 * np.eye(potential.joints)
    sides = [potential(*(probes + step).T) - potential(*(probes - step).T) for step in steps]
    rough = np.stack(sides, axis=-1) / 2e-4
    if np.abs(rough - slopes).max() > 1e-5 * max(np.abs(rough).max(), np.abs(potential(*probes.T)).max()):
        raise TypeError(
            f"system={potential.system!r}: its accelerations or its energy are not analytic; write them without abs, "
            "min, max and branches"
        )
