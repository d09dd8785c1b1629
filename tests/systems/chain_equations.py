"""The equation of a chain of pendulums with its mass matrix."""

import numpy as np
from numpy.typing import NDArray

LINKS = (0.11, 0.07, 0.05, 0.13, 0.09, 0.06, 0.1, 0.08)
MASSES = (0.3, 0.5, 0.2, 0.7, 0.4, 0.25, 0.35, 0.45)


def dense(system, links, up, aside, joints, x):
    """Accelerations by M q'' = F of REFERENCES.md, with the angular accelerations at the joints given."""
    length = np.array([system.params[f"length_{i + 1}"] for i in range(links)])
    mass = np.array([system.params[f"mass_{i + 1}"] for i in range(links)])
    carried = np.cumsum(mass[::-1])[::-1]
    angles, rates = x[:links], x[links:]
    i = np.arange(links)
    inertia = carried[np.maximum.outer(i, i)] * np.outer(length, length)
    apart = angles[:, None] - angles[None, :]
    torques = mass[0] * length[0] ** 2 * np.append(joints, 0.0)
    force = -(inertia * np.sin(apart)) @ rates**2
    force -= carried * length * (up * np.sin(angles) + aside * np.cos(angles))
    force += torques[:-1] - torques[1:]
    return np.linalg.solve(inertia * np.cos(apart), force)


def relative(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.diff(values, prepend=0.0)
