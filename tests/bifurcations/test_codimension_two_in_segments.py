"""Points of codimension two of orbits with large multipliers, and of two pairs of multipliers, in closed form."""

from math import cos, pi, sin

import numpy as np
import pytest
from branch_kinds import DOUBLING, NEIMARK_SACKER, POINT
from cases import branch_at_rest, branch_of, thorough

from cellmap import discrete_map
from cellmap.bifurcations import continue_bifurcation, switch_curve

BOX = (-0.4, 0.6), (-0.5, 0.5)


def curve_in_segments(exact, start, period, kind):
    """Return the curve of a bifurcation of an orbit with a large multiplier, over p and q."""
    branch = branch_of(exact, start, "p", *BOX[0], period, step=0.1)
    curve = continue_bifurcation(branch, branch.of_kind(kind)[0], "q", *BOX, step=0.1)
    assert curve._problem.orbits.nodes > 1
    assert np.abs(curve.multipliers).max() > 1e7
    return curve


def assert_form(point, expected, rtol):
    assert point.normal_form is not None
    for name, value in expected.items():
        assert point.normal_form.coefficients[name] == pytest.approx(value, rel=rtol), name


def alternating(function, growth=1e4, **more):
    """Return (x, y, s) -> (growth x + y, s F(y), -s (6 - s^2)/5): of period 2 at s = 1, with y -> -F(F(y))."""
    return discrete_map(
        lambda x, p: (growth * x[0] + x[1], x[2] * function(x[1], p), -x[2] * (6.0 - x[2] ** 2) / 5.0),
        {"p": -0.1, "q": 0.3, **more},
        ("x", "y", "s"),
    )


def test_a_generalised_flip_beside_a_multiplier_of_1e8():
    """F(y) = (1 + p) y + q y^3 + y^5: -F(F(y)) has the multiplier -(1 + p)^2 and is -y - 2 y^5 for p = q = 0."""
    exact = alternating(lambda y, p: (1.0 + p.p) * y + p.q * y**3 + y**5)
    curve = curve_in_segments(exact, [0.0, 0.0, 1.0], 2, DOUBLING)
    np.testing.assert_allclose(curve.values[:, 0], 0.0, atol=1e-11)
    np.testing.assert_allclose(curve.multipliers[:, 0], 1e8, rtol=1e-6)
    (point,) = curve.codimension_two()
    assert point.kind is POINT.GENERALISED_FLIP
    np.testing.assert_allclose(point.values, 0.0, atol=1e-11)
    size = np.linalg.norm([1.0 / (1e8 + 1.0) * (1e4 + 1.0), 1.0])  # of the eigenvector with y = 1
    assert_form(point, {"e": -2.0 * float(size) ** 4}, 1e-6)
    with pytest.raises(ValueError, match=r"new_curve=.*segments"):
        switch_curve(curve, point, *BOX)


# Two Neimark-Sacker maps z -> mu z (1 + g + a abs(z)^2 + b abs(w)^2), coupled by b, in coordinates that mix both.

ANGLES = 0.37 * pi, 0.61 * pi
COEFFICIENTS = (-1.0 + 0.3j, 0.4 - 0.2j), (-0.7 + 0.5j, -0.6 + 0.1j)
MIXED = np.array([[1.0, 0.2, -0.3, 0.1], [0.0, 1.0, 0.4, 0.2], [0.3, -0.2, 1.0, 0.0], [0.1, 0.1, 0.2, 1.0]])


def coupled(x, p):
    inner = [sum(float(c) * v for c, v in zip(row, x, strict=True)) for row in np.linalg.inv(MIXED)]
    sizes = inner[0] ** 2 + inner[1] ** 2, inner[2] ** 2 + inner[3] ** 2
    images = []
    for k, (angle, (own, other)) in enumerate(zip(ANGLES, COEFFICIENTS, strict=True)):
        u, v = inner[2 * k : 2 * k + 2]
        growth = (p.p + 0.5 * p.q, p.q - 0.2 * p.p)[k]
        c = 1.0 + growth + own.real * sizes[k] + other.real * sizes[1 - k]
        e = own.imag * sizes[k] + other.imag * sizes[1 - k]
        u, v = c * u - e * v, c * v + e * u
        images += [cos(angle) * u - sin(angle) * v, sin(angle) * u + cos(angle) * v]
    return tuple(sum(float(c) * v for c, v in zip(row, images, strict=True)) for row in MIXED)


@pytest.mark.parametrize(("first", "start"), [thorough(0, {"p": -0.2, "q": -0.3}), (1, {"p": -0.4, "q": -0.2})])
def test_two_curves_of_neimark_sacker_bifurcations_intersect(first, start):
    """The curves are p = -q/2 and q = p/5, with both pairs on the unit circle at p = q = 0."""
    exact = discrete_map(coupled, start, ("x", "y", "u", "v"))
    names, box = ("p", "q")[:: 1 - 2 * first], ((-0.5, 0.4), (-0.5, 0.4))
    branch = branch_at_rest(exact, names[0], *box[0], step=0.03)
    curve = continue_bifurcation(branch, branch.bifurcations[0], names[1], *box, step=0.07)
    p, q = curve.values.T if first == 0 else curve.values.T[::-1]
    np.testing.assert_allclose(p if first == 0 else q, -q / 2.0 if first == 0 else p / 5.0, atol=1e-11)
    (point,) = curve.codimension_two()
    assert point.kind is POINT.DOUBLE_NEIMARK_SACKER
    assert point.new_curves == ()
    np.testing.assert_allclose(point.values, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(point.multipliers), 1.0, atol=1e-12)
    # The eigenvectors are (1, -i) in the inner plane, of length 1 as they are seen.
    sizes = [2.0 / np.linalg.norm(MIXED[:, 2 * k] - 1j * MIXED[:, 2 * k + 1]) ** 2 * 2.0 for k in (0, 1)]
    (a, b), (d, c) = COEFFICIENTS
    expected = {"a": a * sizes[0], "b": b * sizes[1], "c": c * sizes[0], "d": d * sizes[1]}
    assert_form(point, expected, 1e-10)


@pytest.mark.thorough
def test_a_neimark_sacker_curve_beside_a_multiplier_of_1e8():
    """r -> r (1 + p + q r^2 - r^4) and an angle 0.3 + q/2 in each of two steps, of which one has the other sign."""

    def image(x, p):
        r, angle = x[1] ** 2 + x[2] ** 2, 0.3 + 0.5 * p.q
        factor = x[3] * (1.0 + p.p + p.q * r - r * r)
        u, v = cos(angle) * x[1] - sin(angle) * x[2], sin(angle) * x[1] + cos(angle) * x[2]
        return 1e4 * x[0] + x[1], factor * u, factor * v, -x[3] * (6.0 - x[3] ** 2) / 5.0

    exact = discrete_map(image, {"p": -0.25, "q": 0.33}, ("g", "u", "v", "s"))
    curve = curve_in_segments(exact, [0.0, 0.0, 0.0, 1.0], 2, NEIMARK_SACKER)
    np.testing.assert_allclose(curve.values[:, 0], 0.0, atol=1e-11)
    points = {point.kind: point for point in curve.codimension_two()}
    # Two angles and half a circle make two thirds of a circle.
    expected = {POINT.CHENCINER: 0.0, POINT.RESONANCE_1_3: pi / 3.0 - 0.6}
    assert {kind: pytest.approx(float(point.values[1]), abs=1e-10) for kind, point in points.items()} == expected
    assert_form(points[POINT.CHENCINER], {"l2": -8.0}, 1e-6)
