"""Numbers of the report's pendulum by SciPy alone; ``python -m tests.reference.report_numbers`` prints them.

The right-hand sides are written out here, the integrator is DOP853 at 1e-13, and roots are found by Brent's method and
by SciPy's hybrid of Newton's: nothing is shared with cellmap.
"""

from math import acos, asin, cos, pi, sin, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve
from scipy.special import ellipk

LENGTH, GRAVITY, DAMPING = 0.0272, 9.8, 10.0
W = 2.0 * pi * 50.0


class Rod(NamedTuple):
    """Length (m), frequency of the drive (Hz) and viscous damping (1/s) of a pendulum."""

    length: float = LENGTH
    frequency: float = 50.0
    damping: float = DAMPING


REPORT = Rod()


def period_matrix(amplitude: float, side: float, rod: Rod = REPORT) -> NDArray[np.float64]:
    """Return the monodromy matrix of the hanging (side 1) or the inverted (side -1) state, in (theta, theta'/w)."""
    w = 2.0 * pi * rod.frequency

    def linear(t: float, y: Any) -> list[float]:
        pull = side * (GRAVITY - amplitude * w * w * cos(t)) / (rod.length * w * w)
        drag = rod.damping / w
        return [y[1], -drag * y[1] - pull * y[0], y[3], -drag * y[3] - pull * y[2]]

    end = solve_ivp(linear, (0.0, 2.0 * pi), [1.0, 0.0, 0.0, 1.0], "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    return np.array([[end[0], end[2]], [end[1], end[3]]])


def stability_limit(low: float, high: float, side: float, multiplier: float, rod: Rod = REPORT) -> float:
    """Return the amplitude (m) at which a multiplier of the state is 1 or -1."""

    def distance(amplitude: float) -> float:
        return float(np.linalg.det(period_matrix(amplitude, side, rod) - multiplier * np.eye(2)))

    return float(brentq(distance, low, high, xtol=1e-18))


def image(amplitude: float, theta: float, v: float) -> NDArray[np.float64]:
    """Return the state after a period, in (theta, theta'/w), full rotations included, with its Jacobian behind."""

    def motion(t: float, y: Any) -> list[float]:
        pull = (GRAVITY - amplitude * W * W * cos(t)) / (LENGTH * W * W)
        slope, drag = pull * cos(y[0]), DAMPING / W
        first, second = (y[3], -drag * y[3] - slope * y[2]), (y[5], -drag * y[5] - slope * y[4])
        return [y[1], -drag * y[1] - pull * sin(y[0]), *first, *second]

    ic = [theta, v, 1.0, 0.0, 0.0, 1.0]
    return np.asarray(solve_ivp(motion, (0.0, 2.0 * pi), ic, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1])


def rotation(amplitude: float) -> NDArray[np.float64]:
    """Return the point (theta, theta'/w) of the rotation, once in a period."""
    rotated = np.array([2.0 * pi, 0.0])
    return np.asarray(fsolve(lambda z: image(amplitude, *z)[:2] - z - rotated, [2.52, 1.02], xtol=1e-13))


def birth_of_rotations() -> float:
    """Return the amplitude (m) at which the rotation and its saddle meet, with a multiplier of 1."""

    def fold(z: Any) -> list[float]:
        end = image(1e-3 * z[2], z[0], z[1])
        matrix = np.array([[end[2], end[4]], [end[3], end[5]]])
        return [end[0] - z[0] - 2.0 * pi, end[1] - z[1], float(np.linalg.det(matrix - np.eye(2)))]

    return 1e-3 * float(fsolve(fold, [2.4, 1.0, 1.75], xtol=1e-13)[2])


def numbers() -> dict[str, float]:
    """Return the numbers by their names in tests/REFERENCES.md; lengths in mm."""
    at_3 = np.linalg.eigvals(period_matrix(0.003, -1.0))[0]
    # Modes of two equal links of 3.2 cm move like single pendulums: Landau, Lifshitz, Mechanics (1976), section 5.
    both_down, mixed = Rod(0.032 / (2.0 + sqrt(2.0)), 24.0, 0.0), Rod(0.032 / sqrt(2.0), 24.0, 0.0)
    peak = (GRAVITY + 0.003 * W * W) / LENGTH
    return {
        "the inverted state gains stability": 1e3 * stability_limit(2e-3, 2.5e-3, -1.0, 1.0),
        "the inverted state loses it": 1e3 * stability_limit(12.3e-3, 12.8e-3, -1.0, -1.0),
        "the hanging state loses it": 1e3 * stability_limit(12.0e-3, 12.4e-3, 1.0, -1.0),
        "largest multiplier at 2 mm": float(max(np.linalg.eigvals(period_matrix(0.002, -1.0)).real)),
        "real part of a multiplier at 3 mm": float(at_3.real),
        "imaginary part of a multiplier at 3 mm": abs(float(at_3.imag)),
        "angle of the rotation at 3 mm": float(rotation(0.003)[0]),
        "birth of rotations": 1e3 * birth_of_rotations(),
        "angle of the image at 3 mm": float(image(0.003, 1.0, 0.1)[0]),
        "period from 3 rad": 4.0 * float(ellipk(sin(1.5) ** 2)) * sqrt(LENGTH / GRAVITY),
        "critical angle at 3 mm": acos(2.0 * GRAVITY * LENGTH / (0.003 * W) ** 2),
        "critical angle at 4 mm": acos(2.0 * GRAVITY * LENGTH / (0.004 * W) ** 2),
        "slow frequency": sqrt((0.003 * W) ** 2 / (2.0 * LENGTH**2) - GRAVITY / LENGTH) / (2.0 * pi),
        "sticking set": asin(10.0 / peak),
        "double pendulum, both links down": 1e3 * stability_limit(3e-3, 4e-3, 1.0, -1.0, both_down),
        "double pendulum, one link up, from": 1e3 * stability_limit(4e-3, 5e-3, -1.0, 1.0, mixed),
        "double pendulum, one link up, to": 1e3 * stability_limit(9e-3, 10e-3, 1.0, -1.0, mixed),
    }


def basin_counts(basin_image: str) -> list[int]:
    """Return how many of 200 x 200 cells belong to each attractor, by the method of the reference images."""
    from .basin_images import BASIN_IMAGES, labels

    return np.bincount(labels(BASIN_IMAGES[basin_image]._replace(cells=200))).tolist()


if __name__ == "__main__":
    for name, value in numbers().items():
        print(f"{name}: {value:.13g}")
    for basin_image in ("pendulum_3mm", "pendulum_3mm_wide"):
        print(f"cells of {basin_image}: {basin_counts(basin_image)}", flush=True)
