"""Normal forms of bifurcations: closed forms of discrete maps, differences of independent integrations of flows."""

from math import gamma, hypot, sqrt

import numpy as np
import pytest
from branch_kinds import DOUBLING, FOLD, NEIMARK_SACKER
from cases import branch_of

from cellmap import discrete_map
from cellmap.bifurcations import Criticality, normal_form
from systems import logistic_map


def form(bifurcation):
    found = bifurcation.normal_form
    assert found is not None
    assert found.kind is bifurcation.kind
    return found


def assert_meets(found, expected, criticality):
    """Compare with a closed form, to the error that is stated, which is small."""
    coefficient = complex(found.coefficient, found.imaginary)
    assert abs(coefficient - expected) <= found.error
    assert found.error <= 1e-12 * (1.0 + abs(expected))
    assert found.criticality == criticality
    assert found.exact


# Discrete maps: the multilinear forms are those of polynomials, inserted into the formulas by hand.


def test_the_logistic_map():
    # f'' = -2 mu: a = f''/2 at 0, and b = f''^2/4 where f' = -1.
    transcritical, doubling = branch_of(logistic_map(2.0), [0.5], "mu", 0.5, 4.0).bifurcations
    assert_meets(form(transcritical), -1.0, "generic")
    assert_meets(form(doubling), 9.0, "supercritical")


def test_the_henon_map(henon):
    # q = (1, b)/n and p = (1, 1) n/(1 + b) at the fold, q = (1, -b)/n and p = (1, -1) n/(1 + b) at the doubling.
    fold, doubling = henon.bifurcations
    b, n = 0.3, sqrt(1.0 + 0.3**2)
    assert_meets(form(fold), 0.25 * (1.0 - b) ** 2 / ((1.0 + b) * n), "generic")
    assert_meets(form(doubling), (0.75 * (1.0 - b) ** 2) ** 2 / (n**2 * (1.0 - b**2)), "supercritical")


def test_the_delayed_logistic_map():
    # At r = 2 theta = pi/3 and d = -(1 + i sqrt(3)) 2 c^2/(1 + c^2).
    c = 0.7
    exact = discrete_map(lambda x, p: (p.r * x[0] * (1.0 - x[1]), p.c * x[0]), {"r": 1.7, "c": c}, ("x", "y"))
    (found,) = branch_of(exact, [0.4 / c, 0.4], "r", 1.5, 2.3).bifurcations
    assert_meets(form(found), -(1.0 + 1j * sqrt(3.0)) * 2.0 * c**2 / (1.0 + c**2), "supercritical")


def test_a_coefficient_that_vanishes_is_degenerate():
    # x -> -x + x^2 - x^3 + ...: b = f'''/6 + f''^2/4 = 0 where f = -x + s x^2 - s^2 x^3.
    for s in (0.5, 3.0):
        exact = discrete_map(lambda x, p: (-x[0] + p.s * x[0] ** 2 - p.s**2 * x[0] ** 3,), {"s": s}, ("x",))
        found = normal_form(exact, [0.0], DOUBLING)
        assert found.criticality is Criticality.DEGENERATE
        assert abs(found.coefficient) <= found.error < 1e-9


def test_a_double_multiplier_has_no_coefficient():
    sheared = discrete_map(lambda x, p: (x[0] + x[1], x[1] + x[0] ** 2), {"s": 1.0}, ("x", "y"))
    found = normal_form(sheared, [0.0, 0.0], FOLD)
    assert found.criticality is Criticality.DEGENERATE
    assert np.isnan(found.coefficient)


# Formulas that are unknown, and formulas with branches: differences of Jacobian matrices.


@pytest.mark.thorough
def test_differences_serve_where_no_formulas_are_known():
    # Known to be -1 - i sqrt(3); formulas know no gamma function.
    exact = discrete_map(
        lambda x, p: (p.r * hypot(x[0], 0.0) * (1.0 - x[1]), x[0] + 0.0 * gamma(2.0 + x[0])), {"r": 2.0}, ("x", "y")
    )
    found = normal_form(exact, [0.5, 0.5], NEIMARK_SACKER)
    assert not found.exact
    assert abs(complex(found.coefficient, found.imaginary) + 1.0 + 1j * sqrt(3.0)) <= found.error < 1e-6
    assert found.criticality is Criticality.SUPERCRITICAL


# Flows.
