"""Preimages of points and curves: inverse maps in closed form, branches of maps that have several, gaps."""

from math import cos, pi, sin

import numpy as np
import pytest

from cellmap import ForcedSystem, angle, discrete_map, stroboscopic_map
from cellmap.maps import inverse_stroboscopic_map
from cellmap.maps.inverse import LiftedMap, extra_turns, preimages, preimages_along
from systems import driven_pendulum

A, B = 1.4, 0.3
HENON = discrete_map(lambda x, p: (1 - A * x[0] ** 2 + x[1], B * x[0]), {}, ("x", "y"))
CAT = discrete_map(lambda x, p: (2 * x[0] + x[1], x[0] + x[1]), {}, (angle("a"), angle("b")))
SQUARE = discrete_map(lambda x, p: (x[0] ** 2, 0.5 * x[1]), {}, ("x", "y"))
NONE = np.zeros((2, 2))
ON_SQUARE, ON_TORUS = LiftedMap(SQUARE, NONE), LiftedMap(CAT, extra_turns(CAT, NONE[0]))
RNG = np.random.default_rng(4)


def before_henon(images):
    x = images[:, 1] / B
    return np.stack([x, images[:, 0] - 1 + A * x**2], axis=-1)


def test_full_rotations_that_images_gain():
    """The cat map less the identity; none for a rotation, a flow, or where there is no angle."""
    assert np.allclose(extra_turns(CAT, np.zeros(2)), [[1, 1], [1, 0]])
    turned = discrete_map(lambda x, p: (x[0] + 0.3 + 0.2 * sin(x[0]), 0.5 * x[1]), {}, (angle("a"), "r"))
    assert (extra_turns(turned, np.zeros(2)) == 0).all()
    assert (extra_turns(HENON, np.zeros(2)) == 0).all()
    double = discrete_map(lambda x, p: (2 * x[0] + 0.1 * sin(x[0]),), {}, (angle("a"),))
    assert np.allclose(extra_turns(double, np.zeros(1)), [[1]])
    pendulum = stroboscopic_map(ForcedSystem(lambda t, x, p: (x[1], -sin(x[0])), {}, 1.0, (angle("q"), "v")))
    assert (extra_turns(pendulum, np.zeros(2)) == 0).all()


def test_rotations_of_angles_with_other_periods():
    """b has the period 1: where a has turned once, 2 pi, the image of b has turned twice, by 2."""
    both = discrete_map(lambda x, p: (x[0], x[1] + x[0] / pi), {}, (angle("a"), angle("b", period=1.0)))
    assert np.allclose(extra_turns(both, np.zeros(2)), [[0, 0], [1 / pi, 0]])
    step = LiftedMap(both, extra_turns(both, np.zeros(2)))
    points = RNG.uniform(-20, 20, (30, 2))
    assert np.allclose(step(points), np.stack([points[:, 0], points[:, 1] + points[:, 0] / pi], axis=-1), atol=1e-12)


def test_steps_are_continuous_across_branch_cuts():
    """On the plane the cat map is linear."""
    step = ON_TORUS
    points = np.vstack([RNG.uniform(-30, 30, (50, 2)), [[np.nan, 0.0]]])
    matrix = np.array([[2.0, 1.0], [1.0, 1.0]])
    np.testing.assert_allclose(step(points)[:-1], points[:-1] @ matrix.T, atol=1e-11)
    assert np.isnan(step(points)[-1]).all()
    images, derivatives = step.tangent(points[:-1])
    np.testing.assert_allclose(images, points[:-1] @ matrix.T, atol=1e-11)
    np.testing.assert_allclose(derivatives, np.broadcast_to(matrix, (50, 2, 2)), atol=1e-12)
    assert step.exact is CAT


def test_preimages_are_those_of_the_inverse():
    step, places = LiftedMap(HENON, NONE), RNG.uniform(-1, 1, (40, 2))
    targets = np.vstack([step(places), [[np.inf, 0.0]], step(places[:1])])
    guesses = np.vstack([places + 0.3 * RNG.uniform(-1, 1, (40, 2)), [[0.0, 0.0], [np.nan, 0.0]]])
    found, derivatives, settled = preimages(step, targets, guesses)
    assert settled.tolist() == [True] * 40 + [False] * 2
    np.testing.assert_allclose(found[:40], before_henon(targets[:40]), rtol=1e-12, atol=1e-12)
    expected = np.zeros((40, 2, 2))
    expected[:, 0, 0], expected[:, 0, 1], expected[:, 1, 0] = -2 * A * places[:, 0], 1.0, B
    np.testing.assert_allclose(derivatives[:40], expected, rtol=1e-9, atol=1e-9)


def test_long_steps_are_halved():
    """Newton's method alone leaves the preimage 0 of arctan(x) from 1.4 on for ever farther places."""
    bent = discrete_map(lambda x, p: (np.arctan(x[0]),), {}, ("x",))
    step = LiftedMap(bent, np.zeros((1, 1)))
    guesses = np.array([[1.3], [1.5], [3.0], [20.0]])
    found, _, settled = preimages(step, np.zeros((4, 1)), guesses)
    assert settled.all()
    assert np.abs(found).max() < 1e-12


def test_where_nothing_is_mapped_there_is_no_preimage():
    """x^2 = -1; y/2 = 3 has the preimage 6, and the derivative at x = 0 is singular."""
    found, _, settled = preimages(ON_SQUARE, np.array([[-1.0, 0.0], [4.0, 3.0]]), np.array([[1.0, 0.0], [1.0, 0.0]]))
    assert settled.tolist() == [False, True]
    np.testing.assert_allclose(found[1], [2.0, 6.0], rtol=1e-12)
    assert not preimages(ON_SQUARE, np.array([[1.0, 0.0]]), np.array([[0.0, 0.0]]))[2].any()


def along(step, targets, guess):
    return preimages_along(step, targets, np.array(guess), (targets[:1], targets[:1]))


@pytest.mark.parametrize("side", [-1, 1])
def test_of_two_preimages_the_one_on_the_same_side(side):
    """The preimages of a line from x = 4 to 0.01 have the signs of the first guess."""
    targets = np.stack([np.linspace(4.0, 0.01, 300), np.linspace(-1, 1, 300)], axis=-1)
    found = along(ON_SQUARE, targets, [side * 1.9, -2.0])
    np.testing.assert_allclose(found, np.stack([side * np.sqrt(targets[:, 0]), 2 * targets[:, 1]], axis=-1), rtol=1e-9)


def test_a_coarse_curve_is_followed_by_shorter_steps():
    """Neighbours are so far apart that the derivative foresees nothing of the next preimage."""
    targets = np.array([[4.0, 0.0], [0.04, 0.1], [9.0, 0.0], [0.25, 0.0]])
    found = along(ON_SQUARE, targets, [-2.0, 0.0])
    np.testing.assert_allclose(found, [[-2.0, 0.0], [-0.2, 0.2], [-3.0, 0.0], [-0.5, 0.0]], atol=1e-9)


def test_behind_a_gap_the_nearest_known_pair_is_the_guess():
    x = np.linspace(1.0, 4.0, 40)
    targets = np.stack([x, 0 * x], axis=-1)
    targets[15:20] = np.nan
    known = np.array([[1.0, 0.0], [x[20], 0.0], [4.0, 0.0]]), np.array([[1.0, 0.0], [-1.5, 0.0], [2.0, 0.0]])
    found = preimages_along(ON_SQUARE, targets, np.array([1.0, 0.0]), known)
    expected = np.where(np.arange(40) < 17, 1, -1) * np.sqrt(x)
    expected[15:20] = np.nan
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-9)


def test_a_curve_ends_where_it_has_no_preimage():
    """From x = 1 to -1: the preimage ends at 0, and what lies beyond has none; nothing at all has none either."""
    targets = np.stack([np.linspace(1.0, -1.0, 41), np.zeros(41)], axis=-1)
    found = along(ON_SQUARE, targets, [1.0, 0.0])
    np.testing.assert_allclose(found[:19, 0], np.sqrt(targets[:19, 0]), rtol=1e-9)
    assert np.isnan(found[21:]).all()
    assert np.isnan(along(ON_SQUARE, np.full((5, 2), np.nan), [1.0, 0.0])).all()


def test_preimages_across_branch_cuts_form_one_curve():
    """Of the cat map, whose inverse is linear: (a - b, 2 b - a)."""
    targets = np.linspace([0.0, 0.0], [30.0, -11.0], 200)
    found = along(ON_TORUS, targets, [0.0, 0.0])
    a, b = targets.T
    np.testing.assert_allclose(found, np.stack([a - b, 2 * b - a], axis=-1), atol=1e-9)
    assert cos(found[-1, 0]) == pytest.approx(cos(41.0), abs=1e-8)


def test_inverse_of_the_stroboscopic_map() -> None:
    system = driven_pendulum(amplitude=0.004)
    for phase in (0.0, 0.3):
        forward = stroboscopic_map(system, phase=phase, rtol=1e-12, atol=1e-12)
        initial_conditions = np.random.default_rng(0).uniform((-3.0, -400.0), (3.0, 400.0), (500, 2))
        there = forward.iterate(initial_conditions, 1)
        back = inverse_stroboscopic_map(system, phase).iterate(there.points, 1)
        assert back.points == pytest.approx(initial_conditions, rel=1e-9, abs=1e-9)
        assert np.array_equal(back.rotations[:, 0] + there.rotations[:, 0], np.zeros(500))
