"""Second and third derivatives of maps against closed forms, in natural sizes, by formulas and by differences."""

from dataclasses import replace
from math import comb, cos, pi, sin

import numpy as np
import pytest

from cellmap import ForcedSystem, angle, discrete_map, stroboscopic_map
from cellmap.maps import swept_map
from cellmap.maps.multilinear import directions_for, multilinear_forms
from cellmap.maps.stroboscopic import carried

POLYNOMIAL = discrete_map(
    lambda x, p: (p.a * x[0] + 0.5 * x[0] ** 2 + x[0] * x[1] - x[1] ** 3, x[0] ** 2 * x[1] + 0.2 * x[1]),
    {"a": 0.7},
    ("x", "y"),
)
POINTS = np.array([[0.3, -0.2], [1.0, 0.5]])


def tensors_of_the_polynomial(x, y, a=0.7):
    first = np.array([[a + x + y, x - 3 * y**2], [2 * x * y, x**2 + 0.2]])
    second, third = np.zeros((2, 2, 2)), np.zeros((2, 2, 2, 2))
    second[0] = [[1, 1], [1, -6 * y]]
    second[1] = [[2 * y, 2 * x], [2 * x, 0]]
    third[0, 1, 1, 1] = -6
    third[1, 0, 0, 1] = third[1, 0, 1, 0] = third[1, 1, 0, 0] = 2
    return first, second, third


@pytest.mark.parametrize("known", [True, False], ids=["formulas", "differences"])
def test_derivatives_of_a_polynomial(known):
    """In natural sizes s the derivative of component i by j, k, ... is multiplied by s_j s_k .../s_i."""
    sizes = np.array([2.0, 0.25])
    point_map = POLYNOMIAL if known else replace(POLYNOMIAL, name="without specification")
    forms = multilinear_forms(point_map, POINTS, 1, sizes)
    assert forms.exact == known and forms.linear is forms.tensors[0]
    for way in (0, 1):
        for number, point in enumerate(POINTS):
            for order, (found, tensor) in enumerate(
                zip(forms.at(way, number), tensors_of_the_polynomial(*point), strict=True), 1
            ):
                scaled = tensor / sizes.reshape((2,) + (1,) * order)
                for axis in range(1, order + 1):
                    scaled = np.moveaxis(np.moveaxis(scaled, axis, -1) * sizes, -1, axis)
                np.testing.assert_allclose(
                    found, scaled, rtol=0, atol=1e-11 if known else (1e-10, 1e-9, 1e-7)[order - 1]
                )


def test_differences_are_taken_so_near_that_higher_orders_vanish():
    """x -> sin(5 x): derivatives 5 cos, -25 sin, -125 cos, in sizes of 0.2 over the same."""
    waves = replace(discrete_map(lambda x, p: (sin(5 * x[0]),), {}, ("x",)), name="without specification")
    forms = multilinear_forms(waves, np.array([[0.3]]), 1, np.array([0.2]))
    assert not forms.exact
    for way in (0, 1):
        found = [float(t.ravel()[0]) for t in forms.at(way, 0)]
        assert found == pytest.approx([5 * cos(1.5), -5 * sin(1.5), -5 * cos(1.5)], abs=1e-7)


def test_derivatives_of_two_steps():
    """x -> x^2 twice is x^4."""
    square = discrete_map(lambda x, p: (x[0] ** 2,), {}, ("x",))
    forms = multilinear_forms(square, np.array([[0.9]]), 2, np.ones(1), once=True, order=4)
    assert len(forms.tensors) == 4 and forms.linear.shape == (1, 1, 1, 1)
    x = 0.9
    expected = [4 * x**3, 12 * x**2, 24 * x, 24.0]
    assert [float(t.ravel()[0]) for t in forms.tensors] == pytest.approx(expected, rel=1e-11)


def test_derivatives_of_a_flow():
    """x' = x^2 takes x to x/(1 - x) in the time 1; with derivatives 1/(1 - x)^2, 2/(1 - x)^3, 6/(1 - x)^4."""
    blow = stroboscopic_map(ForcedSystem(lambda t, x, p: (x[0] ** 2,), {}, 1.0, ("x",)))
    x = np.array([[-1.0], [0.2]])
    forms = multilinear_forms(blow, x, 1, np.array([0.5]))
    assert forms.exact
    for way in (0, 1):
        for number, u in enumerate(1 - x[:, 0]):
            found = [float(t.ravel()[0]) for t in forms.at(way, number)]
            assert found == pytest.approx([1 / u**2, 0.5 * 2 / u**3, 0.25 * 6 / u**4], rel=1e-9)


def test_derivatives_of_swept_maps():
    """By x alone, at two values of the parameter that is appended to the state."""
    swept = swept_map(POLYNOMIAL, "a")
    forms = multilinear_forms(swept, np.array([[0.3, -0.2, 0.7], [0.3, -0.2, 0.9]]), 1, np.ones(2))
    for number, a in enumerate((0.7, 0.9)):
        for found, expected in zip(forms.at(0, number), tensors_of_the_polynomial(0.3, -0.2, a), strict=True):
            np.testing.assert_allclose(found, expected, atol=1e-11)


@pytest.mark.parametrize(("d", "order"), [(1, 3), (2, 3), (3, 2), (3, 3), (4, 3), (2, 5)])
def test_a_form_is_determined_by_its_values_in_the_directions(d, order):
    """As many as a form has coefficients, of the length 1, and well conditioned."""
    directions = directions_for(d, order)
    assert directions.shape == (comb(d + order - 1, order), d)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    powers = np.array(np.meshgrid(*[range(order + 1)] * d)).reshape(d, -1).T
    powers = powers[powers.sum(axis=1) == order]
    assert np.linalg.cond(np.prod(directions[:, None] ** powers, axis=-1)) < 1e3


FREE = ForcedSystem(lambda t, x, p: (x[1], -p.k * x[0] + p.f * cos(t)), {"k": 2.25, "f": 0.0}, 2 * pi, ("q", "v"))


def rotation(time, w=1.5):
    return np.array([[np.cos(w * time), np.sin(w * time) / w], [-w * np.sin(w * time), np.cos(w * time)]])


@pytest.mark.parametrize(
    ("at", "to", "ahead"), [(0.0, 0.25, 0.25), (0.75, 0.25, 0.5), (0.25, 0.25, 0.0), (0.5, 0.25, 0.75)]
)
def test_points_are_carried_to_the_next_time_of_a_phase(at, to, ahead):
    point_map = stroboscopic_map(FREE, at)
    points = np.array([[1.0, 0.0], [0.3, -2.0]])
    np.testing.assert_allclose(carried(point_map, points, to), points @ rotation(ahead * 2 * pi).T, atol=1e-7)
    assert points.tolist() == [[1.0, 0.0], [0.3, -2.0]]
    with pytest.raises(ValueError, match=r"phase=0\.25: .* has none"):
        carried(POLYNOMIAL, points, 0.25)


def test_carried_points_see_the_forcing_at_their_phase():
    """v' = cos t from t = pi/2 to 3 pi/2: v falls by 2; the angle grows by 3 of its periods, and is wrapped."""
    driven = ForcedSystem(lambda t, x, p: (6.0, cos(t)), {}, 2 * pi, (angle("a"), "v"))
    found = carried(stroboscopic_map(driven, 0.25), np.array([[0.5, 1.0]]), 0.75)
    np.testing.assert_allclose(found, [[0.5, -1.0]], atol=1e-6)


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("swept", [False, True])
def test_parts_of_a_period_make_up_the_whole(count, swept):
    point_map = stroboscopic_map(FREE, 0.25)
    parts = (swept_map(point_map, "f") if swept else point_map).spec.parts(count)
    assert len(parts) == count
    state, product = np.array([[0.4, -0.1, *[0.0] * swept]]), np.eye(2)
    for number, part in enumerate(parts):
        if not swept:
            forms = multilinear_forms(point_map, state, 1, np.ones(2), once=True, order=1, part=(number, count))
            np.testing.assert_allclose(forms.linear[0, 0], rotation(2 * pi / count), atol=1e-8)
        state, matrices = part(state)
        np.testing.assert_allclose(matrices[0][:2, :2], rotation(2 * pi / count), atol=1e-8)
        product = matrices[0][:2, :2] @ product
    np.testing.assert_allclose(product, rotation(2 * pi), atol=1e-7)
    np.testing.assert_allclose(state[0, :2], rotation(2 * pi) @ [0.4, -0.1], atol=1e-7)


def test_a_step_of_a_discrete_map_has_one_part():
    assert POLYNOMIAL.spec.parts(2) is None
    (part,) = POLYNOMIAL.spec.parts(1)
    images, matrices = part(POINTS)
    np.testing.assert_allclose(images, POLYNOMIAL(POINTS))
    np.testing.assert_allclose(matrices[1], tensors_of_the_polynomial(*POINTS[1])[0], atol=1e-12)
