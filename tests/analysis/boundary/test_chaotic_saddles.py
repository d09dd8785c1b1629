"""Chaotic saddles and the rate at which orbits leave them."""

from __future__ import annotations

from dataclasses import replace
from math import cos, log
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from numpy.typing import NDArray

from cellmap import CellGrid, PointMap, angle, discrete_map, find_attractors, find_periodic_orbits, plot, set_threads
from cellmap.analysis.boundary import chaotic_saddle, escape_rate
from cellmap.analysis.fractal import box_dimension
from cellmap.maps import jacobian
from systems import henon_map, logistic_map

mpl.use("Agg")


UNIT = CellGrid((0.0,), (1.0,), (1,))


def tent(slope: float) -> PointMap:
    """Of each interval between holes the fraction 2/slope stays: the escape rate is ln(slope/2)."""
    return discrete_map(lambda x, p: (0.5 * p.s - p.s * abs(x[0] - 0.5),), {"s": slope}, ("x",))


def cantor_distance(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance to the middle-third Cantor set, by folding the line onto [0, 1/3] and stretching."""
    scale, apart = np.ones_like(x), np.zeros_like(x)
    for _ in range(33):
        x = np.where(x > 0.5, 1.0 - x, x)
        outside = np.maximum(np.maximum(-x, x - 1.0 / 3.0), 0.0)
        apart = np.maximum(apart, outside / scale)
        x, scale = 3.0 * np.clip(x, 0.0, 1.0 / 3.0), 3.0 * scale
    return apart


# --- escape rates


@pytest.mark.parametrize("slope", [2.2, 3.0, 5.0])
def test_escape_from_open_tents(slope: float) -> None:
    found = escape_rate(tent(slope), UNIT, n_samples=400_000)
    known = log(slope / 2.0)
    assert abs(found.rate - known) < 3.0 * found.standard_error
    assert found.standard_error < 0.01 * known + 1e-3
    assert found.mean_lifetime == pytest.approx(1.0 / found.rate)
    assert found.survivors[0] == 400_000


def test_standard_error_is_that_of_repetitions() -> None:
    """Forty independent measurements scatter as their standard error says, within the error of that scatter."""
    runs = [escape_rate(tent(3.0), UNIT, n_samples=20_000, rng=s, fit_range=(1, 6)) for s in range(40)]
    scatter = np.std([r.rate for r in runs], ddof=1)
    assert np.mean([r.standard_error for r in runs]) == pytest.approx(scatter, rel=0.4)
    away = np.abs([(r.rate - log(1.5)) / r.standard_error for r in runs])
    assert np.mean(away < 2.0) >= 0.85


def test_escape_in_two_dimensions_with_a_circle() -> None:
    """A circle that turns beside the tent changes nothing, and an axis of a whole period is not left."""

    def both(x: Any, p: Any) -> tuple[float, float]:
        return x[0] + 0.7 + 0.1 * cos(x[0]), 1.5 - 3.0 * abs(x[1] - 0.5)

    rotating = discrete_map(both, {}, (angle("a"), "x"))
    found = escape_rate(rotating, CellGrid((-np.pi, 0.0), (np.pi, 1.0), (1, 1)), n_samples=100_000)
    assert abs(found.rate - log(1.5)) < 3.0 * found.standard_error


def test_escape_to_an_attractor_does_not_depend_on_how_it_is_left_out() -> None:
    """Beside the period-3 attractor of the logistic map, with its neighbourhood and with a smaller one."""
    logistic = logistic_map(3.84)
    (cycle,) = find_attractors(logistic, [[0.3], [0.7]])
    assert cycle.period == 3
    assert cycle.neighbourhood is not None
    smaller = replace(cycle, neighbourhood=replace(cycle.neighbourhood, metrics=100.0 * cycle.neighbourhood.metrics))
    window = CellGrid((0.01,), (0.99,), (1,))
    rates = [escape_rate(logistic, window, [a], n_samples=50_000, tolerance=0.02) for a in (cycle, smaller)]
    both = np.hypot(rates[0].standard_error, rates[1].standard_error)
    assert abs(rates[0].rate - rates[1].rate) < 4.0 * both
    with pytest.raises(ValueError, match="no orbit leaves"):
        escape_rate(logistic, UNIT, n_samples=1000, max_periods=50)


def test_same_bits_for_any_number_of_threads() -> None:
    rates = []
    for threads in (1, 2):
        set_threads(threads)
        rates.append(escape_rate(tent(3.0), UNIT, n_samples=50_000))
    assert rates[0].rate == rates[1].rate
    assert np.array_equal(rates[0].survivors, rates[1].survivors)


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        ({"n_samples": 100}, ValueError, "only 0 steps"),
        ({"n_samples": 0}, ValueError, "n_samples=0"),
        ({"max_periods": 2}, ValueError, "max_periods=2"),
        ({"region": 3}, TypeError, "region=3"),
        ({"region": CellGrid((0, 0), (1, 1), (1, 1))}, ValueError, "2 axes"),
    ],
)
def test_what_an_escape_rate_refuses(change: Any, error: type[Exception], match: str) -> None:
    arguments = {"point_map": tent(3.0), "region": UNIT, **change}
    with pytest.raises(error, match=match):
        escape_rate(**arguments)


# --- the stagger-and-step method


def test_saddle_of_the_open_tent_is_the_cantor_set() -> None:
    """Of slope 3: a point that stays for k steps is within 3^-(k+1) of the set."""
    saddle = chaotic_saddle(tent(3.0), UNIT, n_points=1000, lifetime=20, max_stagger=1e-6)
    assert saddle.points.shape == (1000, 1)
    apart = cantor_distance(saddle.points[:, 0])
    assert apart.max() < 3.0**-20
    assert saddle.largest_stagger <= 1e-6
    # Both thirds, and of these both thirds, are visited.
    for low, high in ((0.0, 1 / 9), (2 / 9, 1 / 3), (2 / 3, 7 / 9), (8 / 9, 1.0)):
        assert ((saddle.points >= low - 1e-6) & (saddle.points <= high + 1e-6)).mean() > 0.05


def test_each_point_is_the_image_of_the_one_before_but_for_its_stagger() -> None:
    saddle = chaotic_saddle(tent(3.0), UNIT, n_points=500, max_stagger=1e-8)
    images = tent(3.0)(saddle.points[:-1])
    jumps = np.abs(saddle.points[1:] - images)[:, 0]
    assert jumps == pytest.approx(saddle.staggers[1:], abs=1e-15)
    assert 0 < np.count_nonzero(saddle.staggers) < 250


def test_product_of_two_cantor_sets() -> None:
    """A baker that opens in the middle: x is stretched by 3 and loses its middle third, y is squeezed by 3."""

    def baker(x: Any, p: Any) -> tuple[float, float]:
        side = (x[0] - 0.5) / (abs(x[0] - 0.5) + 1e-300)
        return 1.5 - 3.0 * abs(x[0] - 0.5), x[1] / 3.0 + (1.0 + side) / 3.0

    square = CellGrid((0.0, 0.0), (1.0, 1.0), (1, 1))
    saddle = chaotic_saddle(discrete_map(baker, {}, ("x", "y")), square, n_points=600, lifetime=18, max_stagger=1e-7)
    assert cantor_distance(saddle.points[:, 0]).max() < 3.0**-18
    # Along y errors shrink, so that staggers of 1e-7 stay below their own size.
    assert cantor_distance(saddle.points[:, 1]).max() < 2e-7


@pytest.mark.slow
def test_horseshoe_of_henons_map() -> None:
    """At a = 6, b = 0.4 all that stays is a horseshoe in abs(x) <= R, x nowhere 0 (Devaney, Nitecki 1979)."""
    a, b = 6.0, 0.4
    henon = henon_map(a, b)
    size = (1.0 + b + np.sqrt((1.0 + b) ** 2 + 4.0 * a)) / (2.0 * a)
    window = CellGrid((-1.5, -0.6), (1.5, 0.6), (1, 1))
    saddle = chaotic_saddle(henon, window, n_points=3000, lifetime=15, max_stagger=1e-8)
    assert np.abs(saddle.points[:, 0]).max() <= size + 1e-9
    # The horseshoe's points keep away from the fold line x = 0, where its two strips meet.
    assert np.abs(saddle.points[:, 0]).min() > 0.2
    fixed = find_periodic_orbits(henon, CellGrid((-1.5, -0.6), (1.5, 0.6), (60, 60)))
    assert len(fixed) == 2
    for orbit in fixed:
        assert np.linalg.norm(saddle.points - orbit.points[0], axis=1).min() < 0.1


def test_saddle_beside_an_attractor() -> None:
    """Beside the period-3 attractor of the logistic map; the unstable fixed point 1 - 1/r is on the saddle."""
    logistic = logistic_map(3.832)
    (cycle,) = find_attractors(logistic, [[0.3]])
    window = CellGrid((0.01,), (0.99,), (1,))
    saddle = chaotic_saddle(logistic, window, [cycle], n_points=800, lifetime=60)
    assert np.abs(saddle.points[:, None] - cycle.points).min() > 1e-3
    assert np.abs(saddle.points - (1.0 - 1.0 / 3.832)).min() < 1e-2
    with pytest.raises(ValueError, match="on an attractor"):
        chaotic_saddle(logistic, window, n_points=200)


def test_same_seed_same_orbit() -> None:
    a, b, c = (chaotic_saddle(tent(3.0), UNIT, n_points=60, rng=s) for s in (1, 1, 2))
    assert np.array_equal(a.points, b.points)
    assert not np.array_equal(a.points, c.points)


def test_escape_rate_exponent_and_dimension_belong_together() -> None:
    """Kantz and Grassberger (1985): rate = (1 - D) exponent; on the open tent ln 3, D = ln 2/ln 3, rate ln(3/2)."""
    saddle = chaotic_saddle(tent(3.0), UNIT, n_points=1000)
    exponent = float(np.log(np.abs(jacobian(tent(3.0), saddle.points))).mean())
    assert exponent == pytest.approx(log(3.0), rel=1e-9)
    dimension = box_dimension(saddle.points)
    assert abs(dimension.dimension - log(2.0) / log(3.0)) < 3.0 * dimension.standard_error
    rate = escape_rate(tent(3.0), UNIT, n_samples=50_000)
    error = np.hypot(rate.standard_error, exponent * dimension.standard_error)
    assert abs(rate.rate - (1.0 - dimension.dimension) * exponent) < 3.0 * error < 0.1


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"n_points": 0}, "n_points=0"),
        ({"lifetime": 0}, "lifetime=0"),
        ({"max_stagger": 1.0}, "max_stagger"),
        ({"region": CellGrid((0.4,), (0.6,), (1,)), "lifetime": 5}, "stays longest"),
        ({"max_stagger": 2e-14, "lifetime": 15}, "no stagger"),
    ],
)
def test_what_it_refuses(change: Any, match: str) -> None:
    arguments = {"point_map": tent(3.0), "region": UNIT, "n_points": 200, **change}
    with pytest.raises(ValueError, match=match):
        chaotic_saddle(**arguments)


def test_figures() -> None:
    found = escape_rate(tent(3.0), UNIT, n_samples=20_000)
    line = plot.fit(found).get_lines()[0]
    assert np.array_equal(line.get_xdata(), found.fit.x[found.fit.inside])
    assert np.array_equal(line.get_ydata(), np.exp(found.fit.y[found.fit.inside]))
    alone = chaotic_saddle(tent(3.0), UNIT, n_points=100)
    ax = plot.chaotic_saddle(alone)
    assert ax.get_xlabel() == "$x$"
    assert np.array_equal(ax.get_lines()[0].get_xydata(), np.hstack([alone.points[:-1], alone.points[1:]]))
    horseshoe = chaotic_saddle(
        henon_map(6.0, 0.4), CellGrid((-1.5, -0.6), (1.5, 0.6), (1, 1)), n_points=100, lifetime=10
    )
    assert plot.chaotic_saddle(horseshoe, coordinates=("y", "x")).get_xlabel() == "$y$"
    assert "\n" not in repr(horseshoe) + repr(found)
    with pytest.raises(TypeError, match="chaotic_saddle"):
        plot.chaotic_saddle(found)  # type: ignore[arg-type]
