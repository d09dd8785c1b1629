"""Intervals of arrays against exact arithmetic of fractions, with each term of their radii left out in turn."""

from fractions import Fraction

import numpy as np
import pytest

from cellmap._lib import midpoint_radius
from cellmap._lib.midpoint_radius import ROUNDING, Intervals, inverse, length_above, stretch_above


def ends(x: Intervals, signs) -> list[Fraction]:
    """Return numbers of intervals, at one end or the other, exactly."""
    return [Fraction(m) + int(s) * Fraction(r) for m, r, s in zip(x.mid.ravel(), x.rad.ravel(), signs, strict=True)]


def outside(rng: np.random.Generator) -> int:
    """Return how many sums and products of random intervals are not among the numbers that the result holds."""
    found = 0
    for trial in range(400):
        # Midpoints that cancel, radii far smaller than midpoints, exact numbers, and products below normal ones.
        small = (0.0, 1.0, 1e-12, 1e-17)[trial % 4]
        scale = (1.0, 1e-170, 1e-140)[trial % 3]
        a = Intervals(scale * rng.normal(size=(1, 3)), small * scale * rng.random((1, 3)))
        b = Intervals(scale * rng.normal(size=(3, 1)), small * scale * rng.random((3, 1)))
        c = Intervals(-a.mid if trial % 2 else b.mid.T, small * scale * rng.random((1, 3)))
        signs = rng.choice([-1, 1], (3, 3))
        x, y, z = ends(a, signs[0]), ends(b, signs[1]), ends(c, signs[2])
        total, dot = a + c, a @ b
        for k in range(3):
            found += abs(x[k] + z[k] - Fraction(total.mid[0, k])) > Fraction(total.rad[0, k])
        exact = sum(p * q for p, q in zip(x, y, strict=True))
        found += abs(exact - Fraction(dot.mid[0, 0])) > Fraction(dot.rad[0, 0])
    return found


@pytest.mark.parametrize("term", [{}, {"unit": 0.0}, {"wider": 1.0}, {"tiny": 0.0}], ids=str)
def test_sums_and_products_hold_every_exact_result_unless_a_term_is_left_out(term, monkeypatch):
    monkeypatch.setattr(midpoint_radius, "ROUNDING", ROUNDING._replace(**term))
    assert (outside(np.random.default_rng(1)) > 0) == bool(term)


def test_inverses_hold_the_exact_ones():
    rng = np.random.default_rng(2)
    for _ in range(50):
        a = rng.normal(size=(2, 2))
        a[1] = a[0] * rng.normal() + 10.0 ** rng.uniform(-6, 0) * a[1]
        p, q, r, s = (Fraction(v) for v in a.ravel())
        found = inverse(a)
        for e, m, radius in zip((s, -q, -r, p), found.mid.ravel(), found.rad.ravel(), strict=True):
            assert abs(e / (p * s - q * r) - Fraction(m)) <= Fraction(radius)
    assert np.isnan(inverse(np.array([[1.0, 1.0], [1.0, 1.0 + 2e-16]])).rad).all()


def test_stretches_are_bounds_and_hardly_more():
    rng = np.random.default_rng(3)
    matrices = Intervals(rng.normal(size=(40, 3, 3)), 1e-3 * rng.random((40, 3, 3)))
    bound = stretch_above(matrices)
    largest = np.linalg.svd(matrices.mid)[1][:, 0]
    assert (bound >= largest).all() and (bound <= largest + 6e-3).all()
    for _ in range(50):
        some = matrices.mid + rng.uniform(-1, 1, matrices.mid.shape) * matrices.rad
        vector = rng.normal(size=3)
        assert (np.linalg.norm(some @ vector, axis=-1) <= bound * np.linalg.norm(vector)).all()
    assert length_above(np.array([3.0, 4.0])) >= 5.0


def test_what_is_not_known_is_never_below_a_limit():
    unknown = Intervals(np.array([[np.nan, 0.0], [0.0, 0.1]]), np.zeros((2, 2)))
    assert not stretch_above(unknown) < 1.0
    assert not stretch_above(Intervals(np.eye(2) / 2, np.full((2, 2), np.nan))) < 1.0
