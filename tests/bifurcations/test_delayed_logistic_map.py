"""Bifurcations of codimension two of the delayed logistic map with a second parameter, in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np

from cellmap import PointMap, continue_orbit, discrete_map, periodic_orbit
from cellmap.bifurcations import BifurcationCurve, BifurcationKind, CodimensionTwoKind, continue_bifurcation

FOLD, DOUBLING = BifurcationKind.FOLD, BifurcationKind.PERIOD_DOUBLING
NEIMARK_SACKER = BifurcationKind.NEIMARK_SACKER
POINT = CodimensionTwoKind


def curve(exact: PointMap, state: float, kind: BifurcationKind, first: Any, second: Any) -> BifurcationCurve:
    (name, *low_high), (other, *interval) = first, second
    branch = continue_orbit(exact, periodic_orbit(exact, [state, state]), name, *low_high, step=0.03)
    return continue_bifurcation(branch, branch.of_kind(kind)[0], other, tuple(low_high), tuple(interval), step=0.03)


def assert_points(found: BifurcationCurve, expected: dict[CodimensionTwoKind, tuple[float, float, float]]) -> None:
    """Compare the points on a curve with the parameters and the state x that are expected."""
    assert {p.kind for p in found.codimension_two()} == set(expected)
    assert len(found.codimension_two()) == len(expected)
    for point in found.codimension_two():
        np.testing.assert_allclose([*point.values, point.point[0]], expected[point.kind], atol=1e-10)


# With immigration, (x, y) -> (r x (1 - y) + eps, x): trace r (1 - x) and determinant r x.  Neimark-Sacker where
# r x = 1, period doubling where r = -1, fold where x = (r - 1)/(2 r).


def with_immigration(r: float, eps: float) -> PointMap:
    return discrete_map(lambda x, p: (p.r * x[0] * (1 - x[1]) + p.eps, x[0]), {"r": r, "eps": eps}, ("x", "y"))


R = "r", -3.0, 4.0
EPS = "eps", -4.0, 3.0


def test_immigration_and_neimark_sacker() -> None:
    found = curve(with_immigration(1.5, 0.0), 1 / 3, NEIMARK_SACKER, ("r", 0.1, 4.0), EPS)
    assert_points(found, {POINT.RESONANCE_1_1: (3.0, -1 / 3, 1 / 3), POINT.RESONANCE_1_4: (1.0, 1.0, 1.0)})
    r, eps = found.values.T
    np.testing.assert_allclose(eps, 2.0 / r - 1.0, atol=1e-10)


def test_immigration_and_folds() -> None:
    # At r = -1/2 and eps = 1 the fixed points are 1 and 2.
    found = curve(with_immigration(-0.5, 1.0), 1.0, FOLD, EPS, R)
    assert_points(found, {POINT.FOLD_FLIP: (1.0, -1.0, 1.0)})
    eps, r = found.values.T
    np.testing.assert_allclose(eps, -((r - 1.0) ** 2) / (4.0 * r), atol=1e-10)


def test_immigration_and_period_doublings() -> None:
    # At r = -1/2 and eps = 5/8 the fixed points are 1/2 and 5/2.
    found = curve(with_immigration(-0.5, 0.625), 0.5, DOUBLING, ("r", -3.0, -0.1), EPS)
    assert_points(found, {POINT.FOLD_FLIP: (-1.0, 1.0, 1.0), POINT.RESONANCE_1_2: (-1.0, -3.0, -1.0)})


# With the delay in a part c only, (x, y) -> (r x (1 - (1 - c) x - c y), x): at x = 1 - 1/r, with s = r - 1, the
# trace is 1 - (1 - c) s and the determinant c s.


def test_resonances_of_a_partial_delay() -> None:
    exact = discrete_map(
        lambda x, p: (p.r * x[0] * (1 - (1 - p.c) * x[0] - p.c * x[1]), x[0]), {"r": 2.5, "c": 0.4}, ("x", "y")
    )
    found = curve(exact, 0.6, NEIMARK_SACKER, ("r", 1.2, 8.0), ("c", 0.0, 1.2))
    expected = {
        POINT.RESONANCE_1_2: (5.0, 1 / 4, 4 / 5),
        POINT.RESONANCE_1_3: (4.0, 1 / 3, 3 / 4),
        POINT.RESONANCE_1_4: (3.0, 1 / 2, 2 / 3),
    }
    assert_points(found, expected)
    flips = curve(exact.with_params(c=0.1), 0.6, DOUBLING, ("r", 1.2, 8.0), ("c", 0.0, 0.9))
    assert_points(flips, {kind: at for kind, at in expected.items() if kind is POINT.RESONANCE_1_2})
    r, c = flips.values.T
    np.testing.assert_allclose((r - 1.0) * (1.0 - 2.0 * c), 2.0, atol=1e-10)
