"""The pendulum above three magnets: its energy, its symmetry and its three basins."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from cellmap import find_basins, stroboscopic_map
from cellmap.maps import jacobian
from systems import magnetic_pendulum

C, S = cos(2.0 * pi / 3.0), sin(2.0 * pi / 3.0)
THIRD_OF_THE_CIRCLE = np.kron(np.eye(2), [[C, -S], [S, C]])  # of positions and of velocities


def random_initial_conditions(count: int) -> NDArray[np.float64]:
    return np.random.default_rng(0).uniform(-1.5, 1.5, (count, 4))


def test_the_equation() -> None:
    """Against the sum over the magnets, written with complex numbers."""
    system = magnetic_pendulum(damping=0.3, stiffness=0.4, strength=0.7, height=0.5, radius=1.2)
    for x, y, u, v in random_initial_conditions(5):
        z, w = complex(x, y), complex(u, v)
        magnets = 1.2 * np.exp(2j * pi * np.arange(3) / 3)
        a = -0.4 * z - 0.3 * w + sum(0.7 * (m - z) / (abs(m - z) ** 2 + 0.25) ** 1.5 for m in magnets)
        assert system.derivative(0.0, (x, y, u, v)) == pytest.approx((u, v, a.real, a.imag), rel=1e-12)


def test_the_bob_rests_near_each_magnet() -> None:
    """Where the forces on the axis through a magnet balance; every multiplier has the modulus exp(-damping/2)."""

    def force(x: float) -> float:
        pair = 2.0 * (-0.5 - x) / ((0.5 + x) ** 2 + 0.75 + 0.09) ** 1.5
        return -0.25 * x + (1.0 - x) / ((1.0 - x) ** 2 + 0.09) ** 1.5 + pair

    place = np.array([brentq(force, 0.9, 1.0, xtol=1e-14), 0.0, 0.0, 0.0])
    strobe = stroboscopic_map(magnetic_pendulum())
    for _ in range(3):
        assert strobe(place) == pytest.approx(place, abs=1e-10)
        moduli = np.abs(np.linalg.eigvals(jacobian(strobe, place)))
        assert moduli == pytest.approx(np.exp(-0.1), abs=1e-9)
        place = THIRD_OF_THE_CIRCLE @ place


def test_three_basins_of_equal_size() -> None:
    """Bobs released at rest on circles around the middle; the labels rotate with them."""
    radii, phases = np.meshgrid(np.linspace(0.1, 2.5, 8), 2.0 * pi * (np.arange(15) + 0.5) / 15.0)
    initial_conditions = np.zeros((*radii.shape, 4))
    initial_conditions[..., 0], initial_conditions[..., 1] = radii * np.cos(phases), radii * np.sin(phases)
    basins = find_basins(stroboscopic_map(magnetic_pendulum()), initial_conditions)
    assert [a.period for a in basins.attractors] == [1, 1, 1]
    assert [f.fraction for f in basins.fractions.values()] == pytest.approx([1.0 / 3.0] * 3, abs=0.01)
    places = np.array([a.points[0, :2] for a in basins.attractors])
    assert np.linalg.norm(places[:, None] - places, axis=-1).max() == pytest.approx(0.97805 * sqrt(3.0), abs=1e-4)
    rotated = places @ THIRD_OF_THE_CIRCLE[:2, :2].T
    successor = np.linalg.norm(rotated[:, None] - places, axis=-1).argmin(axis=1)
    assert np.mean(basins.labels == successor[np.roll(basins.labels, 5, axis=0)]) > 0.98


@pytest.mark.thorough
def test_fractions_of_another_program() -> None:
    """Attractors.jl 1.x finds these fractions from 1,000 initial conditions at rest in a square, in its own tests.

    Datseris, Wagemakers, Chaos 32 (2022) 023104; the file is test/mapping/attractor_mapping.jl of the package.
    """
    published = {(-0.5, 0.857): 0.377, (-0.5, -0.857): 0.314, (1.0, 0.0): 0.309}
    initial_conditions = np.zeros((2000, 4))
    initial_conditions[:, :2] = np.random.default_rng(1).uniform(-2.0, 2.0, (2000, 2))
    strobe = stroboscopic_map(magnetic_pendulum(damping=0.2, stiffness=0.64, height=0.2))
    basins = find_basins(strobe, initial_conditions)
    assert len(basins.attractors) == 3
    for place, theirs in published.items():
        apart = [np.linalg.norm(a.points[0] - [*place, 0.0, 0.0]) for a in basins.attractors]
        assert min(apart) < 0.02
        ours = basins.fractions[int(np.argmin(apart))]
        error = np.hypot(ours.standard_error, sqrt(theirs * (1.0 - theirs) / 1000))
        assert abs(ours.fraction - theirs) < 3.0 * error
