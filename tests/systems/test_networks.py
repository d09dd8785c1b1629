"""Systems on networks: lines, buses, special cases with known equations, and what they leave unchanged."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import systems
from cellmap import ForcedSystem

RANDOM = np.random.default_rng(1)


def test_one_machine_at_the_bus_is_a_pendulum_with_a_torque() -> None:
    grid = systems.power_grid((0.5,), ((0, 1),), coupling=1.0, damping=0.1, forcing=0.2, frequency=2.0)
    for t, theta, omega in RANDOM.uniform(-3.0, 3.0, (5, 3)):
        torque = 0.5 - 0.1 * omega - np.sin(theta) + 0.2 * np.cos(2.0 * t)
        assert grid.derivative(t, (theta, omega)) == pytest.approx((omega, torque), rel=1e-14)


def test_lines_conserve_power_and_only_differences_of_phases_matter_without_a_bus() -> None:
    grid = systems.power_grid((1.0, -0.4, -0.6), ((1, 2), (3, 1), (2, 3)), damping=0.0)
    x = RANDOM.uniform(-3.0, 3.0, 6)
    change = np.array(grid.derivative(0.0, tuple(x)))
    assert change[3:].sum() == pytest.approx(0.0, abs=1e-14)
    turned = x + 0.7 * np.array([1, 1, 1, 0, 0, 0])
    assert grid.derivative(0.0, tuple(turned)) == pytest.approx(change, abs=1e-13)


def test_the_order_of_lines_and_of_their_ends_does_not_matter() -> None:
    one, other = (systems.power_grid((1.0, -1.0), lines) for lines in (((0, 1), (1, 2)), ((2, 1), (1, 0))))
    assert one.rhs is other.rhs


@pytest.mark.parametrize(
    ("system", "image"),
    [
        (systems.ring_of_wells(4), lambda x: np.roll(x.reshape(2, 4), 1, axis=1).ravel()),
        (systems.ring_of_wells(4), lambda x: x.reshape(2, 4)[:, ::-1].ravel()),
        (systems.ring_of_wells(4, forcing=0.0), lambda x: -x),
        (systems.lorenz_96(5), lambda x: np.roll(x, 1)),
        (systems.josephson_chain(3), lambda x: x.reshape(2, 3)[:, [1, 0, 2]].ravel()),
    ],
    ids=["turned ring", "reflected ring", "ring without force", "Lorenz 96", "junctions"],
)
def test_symmetries(system: ForcedSystem, image: Callable[[Any], Any]) -> None:
    x = RANDOM.uniform(-2.0, 2.0, system.dimension)
    after = image(np.array(system.derivative(0.3, tuple(x))))
    assert system.derivative(0.3, tuple(image(x))) == pytest.approx(after, rel=1e-13)


def test_the_energy_of_lorenz_96_changes_by_forcing_and_damping_alone() -> None:
    """The quadratic terms conserve the sum of squares (Lorenz 1996)."""
    x = RANDOM.uniform(-2.0, 2.0, 6)
    change = np.array(systems.lorenz_96(6, mean=3.0, forcing=0.0).derivative(0.0, tuple(x)))
    assert x @ change == pytest.approx(-x @ x + 3.0 * x.sum())


def test_the_load_takes_current_from_all_junctions() -> None:
    free, loaded = (systems.josephson_chain(2, load=load).derivative(0.0, (0.0, 1.0, 2.0, 4.0)) for load in (0.0, 1.5))
    assert np.subtract(free, loaded) == pytest.approx((0.0, 0.0, 4.5, 4.5))
