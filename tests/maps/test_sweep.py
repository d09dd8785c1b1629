"""Maps with parameters as further state variables, against maps made for each value."""

from math import cos, pi
from typing import Any

import numpy as np
import pytest

from cellmap import CellGrid, ForcedSystem, PointMap, Status, angle, discrete_map, interpolated_map, stroboscopic_map
from cellmap.maps import jacobian, section_map, swept_map
from cellmap.maps.stroboscopic import method_of
from cellmap.maps.swept_orbits import SweptOrbits
from systems import driven_pendulum, henon_map, van_der_pol_oscillator


@pytest.fixture(scope="module")
def pendulum() -> PointMap:
    return stroboscopic_map(driven_pendulum(amplitude=0.003), rtol=1e-12, atol=1e-12)


def test_images_are_those_of_each_value(pendulum: PointMap) -> None:
    rng = np.random.default_rng(0)
    lower, upper = (-pi, -100.0, 0.0, 20.0, 0.02), (pi, 100.0, 0.01, 80.0, 0.04)
    states = rng.uniform(lower, upper, (40, 5))
    images = swept_map(pendulum, "amplitude", "frequency", "length")(states)
    for state, image in zip(states, images, strict=True):
        amplitude, frequency, length = state[2:]
        alone = pendulum.with_params(amplitude=amplitude, frequency=frequency, length=length)
        np.testing.assert_allclose(image[:2], alone(state[:2]), rtol=1e-10, atol=1e-10)
        assert (image[2:] == state[2:]).all()


def test_discrete_maps() -> None:
    henon = henon_map()
    swept = swept_map(henon, "b", "a")
    np.testing.assert_array_equal(swept([0.5, 0.2, 0.1, 1.2])[:2], henon.with_params(a=1.2, b=0.1)([0.5, 0.2]))
    np.testing.assert_allclose(jacobian(swept, [0.5, 0.2, 0.1, 1.2])[:2, 2:], [[0.0, -0.25], [0.5, 0.0]], rtol=1e-14)
    circle = swept_map(discrete_map(lambda x, p: (x[0] + p.x,), {"x": 1.0}, (angle("x"),)), "x")
    assert [c.name for c in circle.coordinates] == ["x", "parameter x"]
    np.testing.assert_array_equal(circle.iterate([[0.0, 7.0]], 3).rotations, [[3, 0]])


def test_the_method_is_that_of_the_map() -> None:
    """Some relaxation oscillations are stiff at this value, and none where a parameter among the state is tried."""
    system = van_der_pol_oscillator(mu=30.0)
    exact = stroboscopic_map(system)
    assert method_of(exact) == "mixed"
    assert exact.specified.swept(("mu",)).motion.method == "mixed"


def test_where_the_right_hand_side_cannot_be_traced() -> None:
    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        q, v = x
        stiffness = p.k if q != -100.0 else 2.0 * p.k
        return v, -stiffness * q - 0.1 * v + cos(t)

    exact = stroboscopic_map(ForcedSystem(rhs, {"k": 1.0}, 2 * pi, ("q", "v")))
    states = np.array([[0.1, 0.2, 1.0], [0.1, 0.2, 3.0], [-1.0, 0.0, 1.0]])
    swept = swept_map(exact, "k")
    for state, image in zip(states, swept(states), strict=True):
        np.testing.assert_array_equal(image[:2], exact.with_params(k=state[2])(state[:2]))
        assert image[2] == state[2]
    assert swept.iterate([[1e300, 0.0, 1.0]], 3).status[0] == Status.DIVERGED


def test_a_table_gives_the_exact_map(pendulum: PointMap) -> None:
    table = interpolated_map(pendulum, CellGrid((-pi, -100.0), (pi, 100.0), (32, 32)), outside="integrate")
    state = [1.0, 31.4, 0.003]
    np.testing.assert_array_equal(swept_map(table, "amplitude")(state), swept_map(pendulum, "amplitude")(state))
    other = table.with_params(amplitude=0.0)
    assert other.table is not None
    assert other.params["amplitude"] == 0.0
    assert other.recipe["shape"] == table.recipe["shape"]


def test_states_within_steps_and_quantities_that_depend_on_them() -> None:
    """q = q0 + w t, v = v0 exp(-t): over two periods of 2 pi/w from a quarter of one on, in closed form."""
    outputs = {"sum": lambda t, x, p: (x[0] + p.w * x[1],)}
    system = ForcedSystem(
        lambda t, x, p: (p.w + 0.0 * cos(p.w * t), -x[1]),
        {"w": 1.0},
        lambda p: 2 * pi / p.w,
        ("q", "v"),
        outputs=outputs,
    )
    values, points = np.array([[1.0], [2.0]]), np.array([[0.5, 1.0], [-0.5, 2.0]])
    orbits = SweptOrbits(stroboscopic_map(system, 0.25), ("w",), values, points, 2)
    times, states = orbits.motion(4)
    lengths, steps = 2 * pi / values[:, 0], np.arange(9)[:, None]
    assert orbits.is_flow and orbits.beginning[0] == pytest.approx(0.25 * lengths[None])
    assert times == pytest.approx((0.25 + steps / 4) * lengths)
    passed = times - 0.25 * lengths
    assert states[..., 0] == pytest.approx(points[:, 0] + values[:, 0] * passed, abs=1e-8)
    assert states[..., 1] == pytest.approx(points[:, 1] * np.exp(-passed), abs=1e-8)
    total = (states[..., 0] + values[:, 0] * states[..., 1]).T
    for quantity, expected in ((1, states[..., 1].T), (-2, states[..., 0].T), ("v", states[..., 1].T), ("sum", total)):
        assert orbits.quantity(quantity, times, states) == pytest.approx(expected)
    assert orbits.quantity(lambda t, x, p: t * p.w, times, states) == pytest.approx((times * values[:, 0]).T)
    for wrong in (2, -3, True, "u"):
        with pytest.raises(ValueError, match=r"quantity=.*: the coordinates"):
            orbits.quantity(wrong, times, states)


def test_motion_between_returns_and_orbits_of_discrete_maps() -> None:
    """A damped rotation comes back after 2 pi/w, w^2 = 1 - d^2, having shrunk by exp(-d t); and x -> a x."""
    spiral = ForcedSystem(lambda t, x, p: (x[1], -x[0] - 2 * p.d * x[1]), {"d": 0.1}, 6.0, ("q", "v"))
    back = SweptOrbits(section_map(spiral, ("q", 0.0, 1)), ("d",), np.array([[0.1], [0.3]]), np.ones((2, 1)), 2)
    times, states = back.motion(8)
    rates, d = back.rates(states), np.array([0.1, 0.3])
    w = np.sqrt(1 - d * d)
    assert times == pytest.approx(np.arange(9)[:, None] / 8 * 4 * pi / w)
    assert states[..., 0] == pytest.approx(np.exp(-d * times) * np.sin(w * times) / w, abs=1e-7)
    assert rates[..., 0] == pytest.approx(states[..., 1]) and back.beginning[1].tolist() == [[[0.0, 1.0], [0.0, 1.0]]]
    shrink = discrete_map(lambda x, p: (p.a * x[0],), {"a": 0.5}, ("x",))
    found = SweptOrbits(shrink, ("a",), np.array([[0.5], [2.0]]), np.array([[1.0], [3.0]]), 2)
    times, states = found.motion(4)
    assert times.tolist() == [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]] and not found.is_flow
    assert states[..., 0].tolist() == [[1.0, 3.0], [0.5, 6.0], [0.25, 12.0]]
