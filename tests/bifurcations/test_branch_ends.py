"""Ends of branches of limit cycles: Hopf points, homoclinic orbits, saddle-nodes on circles, and edges of sections."""

from math import exp, pi, sin, sqrt

import numpy as np
import pytest
from branch_kinds import DEGENERATE, FOLD, values
from cases import branch_of, thorough

from cellmap import ForcedSystem, angle, discrete_map, periodic_orbit, section_map
from cellmap.bifurcations import OrbitFunction


def circles(sign):
    """Normal form of a Hopf bifurcation at mu = 0, with a fold of cycles at mu = -1/4 where it is subcritical."""

    def rhs(t, x, p):
        square = x[0] ** 2 + x[1] ** 2
        grows = p.mu + sign * square - (square * square if sign > 0 else 0.0)
        return x[0] * grows - x[1], x[1] * grows + x[0]

    section = section_map(ForcedSystem(rhs, {"mu": 0.1}, 3.0, ("x", "y")), ("y", 0.0, 1))
    first = sqrt(0.1) if sign < 0 else sqrt(0.5 + sqrt(0.35))
    return branch_of(section, [first], "mu", -0.5, 0.2, step=0.1)


@pytest.mark.parametrize(
    ("branch_of", "folds"),
    [(lambda: circles(-1.0), []), thorough(lambda: circles(1.0), [-0.25])],
    ids=["supercritical", "subcritical"],
)
def test_a_cycle_that_shrinks_ends_at_the_hopf_point(branch_of, folds):
    branch = branch_of()
    (end,) = (e for e in branch.ends if e != "left the interval")
    reason, value = end.split("=")
    assert reason.startswith("the orbit shrinks to an equilibrium at ")
    assert abs(float(value)) < 2e-9
    np.testing.assert_allclose(values(branch, FOLD), folds, atol=1e-9)
    assert not branch.of_kind(DEGENERATE)


def test_a_running_state_ends_at_a_homoclinic_orbit():
    """Josephson junction, beta = 4: by SciPy (DOP853, 1e-11) the retrapping current is 0.597383 to 0.597385."""
    junction = ForcedSystem(lambda t, x, p: (x[1], (p.i - sin(x[0]) - x[1]) / 4.0), {"i": 0.65}, 5.0, (angle("f"), "v"))
    section = section_map(junction, ("f", 0.0, 1))
    branch = branch_of(section, section.iterate([1.0], 30).points, "i", 0.3, 0.66, step=0.1)
    assert branch.ends[0] == f"the period grows without bound at i={branch.values[0]:.10g}: homoclinic orbit"
    assert 0.5973831 < branch.values[0] < 0.5973846


@pytest.mark.parametrize("parameters", [thorough({"r": 20.0}), {}])
def test_an_equilibrium_on_a_section_is_no_periodic_orbit(parameters: dict[str, float]) -> None:
    """Those of Lorenz's system have x = y = sqrt(8 (r - 1) / 3), z = r - 1; cycles cross where one rate is 0."""

    def rhs(t, x, p):  # type: ignore[no-untyped-def]
        return 10.0 * (x[1] - x[0]), x[0] * (20.0 - x[2]) - x[1], x[0] * x[1] - 8.0 * x[2] / 3.0

    section = section_map(ForcedSystem(rhs, parameters, 1.0, ("x", "y", "z")), ("z", 19.0, -1))
    with pytest.raises(ValueError, match=r"an equilibrium through which the section passes; give"):
        periodic_orbit(section, [sqrt(152.0 / 3.0) + 1e-3, sqrt(152.0 / 3.0)])
    circle = ForcedSystem(lambda t, x, p: (-x[1] + x[0] * (1.0 - x[0] ** 2 - x[1] ** 2), x[0]), {}, 1.0, ("x", "y"))
    assert periodic_orbit(section_map(circle, ("y", 0.0, 1)), [0.9]).points[0, 0] > 0.5


def on_a_circle(max_time):
    """On the unit circle the angle has the rate w - sin(angle): the period is 2 pi / sqrt(w^2 - 1)."""

    def rhs(t, x, p):
        inwards = 1.0 - x[0] ** 2 - x[1] ** 2
        return x[0] * inwards - x[1] * (p.w - x[1]), x[1] * inwards + x[0] * (p.w - x[1])

    section = section_map(ForcedSystem(rhs, {"w": 1.2}, 6.0, ("x", "y")), ("x", 0.0, 1), max_time)
    return branch_of(section, [-1.0], "w", 0.5, 1.4, step=0.1)


@pytest.mark.thorough
def test_a_cycle_ends_at_a_saddle_node_on_it():
    branch = on_a_circle(None)
    assert branch.ends[0].startswith("the period grows without bound at w=1.00005")
    assert branch.ends[0].endswith(": saddle-node on an invariant circle")


@pytest.mark.thorough
def test_a_period_that_reaches_the_longest_time_is_told():
    branch = on_a_circle(20.0)
    assert branch.ends[0] == "the return time reaches max_time=20"
    assert abs(branch.values[0] - sqrt(1.0 + (2.0 * pi / 20.0) ** 2)) < 1e-4


def test_a_branch_whose_parameter_is_known_to_few_digits_is_followed():
    """Fixed points a = 10001 - exp(-20 x), where the rounding of a moves the image by 4e-12 exp(20 x)."""
    steep = discrete_map(
        lambda x, p: (x[0] + 0.05 - 0.05 * (10001.0 - p.a) * exp(20.0 * x[0]),), {"a": 10000.0}, ("x",)
    )
    branch = branch_of(steep, [0.0], "a", 9999.9, 10001.1, step=0.05, until={"top": OrbitFunction("x", value=1.0)})
    assert branch.ends == ("left the interval", "top")
    a = 10001.0 - np.exp(-20.0 * branch.points[1:, 0])  # the edge is within 1e-13 of its value
    np.testing.assert_allclose(branch.values[1:], a, rtol=1e-15)


# Van der Pol's equation through the canard explosion, against the asymptotic canard value.


def shifted(t, x, p):
    """epsilon x' = y - x^3 / 3 + x, y' = a - x, with u = x - a: the equilibrium is on the section u = 0."""
    u = x[0] + p.a
    return (x[1] - u**3 / 3 + u) / p.epsilon, -x[0]


def canard_value(epsilon):
    """Return a at the maximal canard (Zvonkin, Shubin 1984), without terms of order 4."""
    return 1.0 - epsilon / 8.0 - 3.0 * epsilon**2 / 32.0 - 173.0 * epsilon**3 / 1024.0


def cycles(epsilon, begin, max_points):
    system = ForcedSystem(shifted, {"a": begin + 1e-3, "epsilon": epsilon}, 1.0, ("u", "y"))
    section = section_map(system, ("u", 0.0, 1), rtol=1e-12, atol=1e-12)
    start = section.iterate([0.5], 20).points
    return branch_of(section, start, "a", begin, 1.0, step=0.05, max_points=max_points)


@pytest.mark.slow
def test_the_canard_explosion():
    large, small = cycles(0.1, 0.98, 300), cycles(0.05, 0.99, 200)
    y = large.points[:, 0]
    canards = (y > 0.2) & (y < 1.1)
    assert canards.sum() >= 10
    assert np.ptp(large.values[canards]) < 3e-5  # in which the cycle shrinks by most of its size
    assert y.min() < 0.1
    errors = [abs(large.values[canards].mean() - canard_value(0.1))]
    canards = (small.points[:, 0] > 0.6) & (small.points[:, 0] < 1.0)
    errors.append(abs(small.values[canards].mean() - canard_value(0.05)))
    assert errors[0] < 1e-4
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.8)  # the order of what is left out
