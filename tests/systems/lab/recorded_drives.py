"""Records of drives, and how far what was recovered is from the truth."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems import Effect, HarmonicDrive, VerticalDrive
from systems.lab import RecoveredDrive

Array = NDArray[np.float64]

TIMES = np.arange(2000) / 2000.0
SHORT = np.arange(500) / 1000.0
SINE = VerticalDrive(0.003, 47.37, 3.1)
TWO = HarmonicDrive((0.003, 0.0005), (3.1, -1.0), 23.37)


def wrapped(angle: Any) -> Any:
    return np.angle(np.exp(1j * np.asarray(angle)))


def deviations(drive: Effect, found: RecoveredDrive) -> Array:
    """Errors of frequency, amplitudes and phases, in standard errors."""
    if isinstance(drive, HarmonicDrive):
        amplitudes, phases = np.array(drive.amplitudes), np.array(drive.phases)
    else:
        amplitudes, phases = np.array([drive.parameters["amplitude"]]), np.array([drive.parameters["phase"]])
    return np.concatenate(
        [
            [(found.frequency - drive.parameters["frequency"]) / found.frequency_error],
            (found.amplitudes - amplitudes) / found.amplitude_errors,
            wrapped(found.phases - phases) / found.phase_errors,
        ]
    )
