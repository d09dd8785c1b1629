"""Chaotic saddles and the rate at which orbits leave them."""

from dataclasses import replace
from math import cos, log, pi
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cellmap import (
    Basins,
    CellGrid,
    Coordinate,
    PointMap,
    angle,
    discrete_map,
    find_attractors,
    find_basins,
    find_periodic_orbits,
    plot,
)
from cellmap.analysis.boundary import chaotic_saddle, edge_orbit, escape_rate
from cellmap.analysis.boundary.edge import _period
from cellmap.analysis.fractal import box_dimension
from cellmap.maps import jacobian
from cellmap.orbits import OrbitKind
from systems import henon_map, logistic_map

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


@pytest.mark.thorough
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


# --- straddle orbits and the edge states at their end


def _wells(x: Any, p: Any) -> tuple[float, float]:
    return 1.4 * x[0] - 0.4 * x[0] ** 3, (p.r + p.s * x[0] ** 2) * x[1] * (1.0 - x[1])


@pytest.fixture(scope="module")
def wells() -> Basins:
    """Two wells in x, bounded by x = 0 where the exponent is ln 1.4; y has a fixed point by itself."""
    return find_basins(
        discrete_map(_wells, {"r": 2.8, "s": 0.0}, ("x", "y")), CellGrid((-1.5, 0.01), (1.5, 0.99), (30, 20))
    )


def test_edge_between_hanging_and_inverted(pendulum: Basins) -> None:
    """It is the saddle at (2.130, 0.892) or its mirror image, found by Newton's method in all cells besides."""
    assert pendulum.point_map is not None
    orbits = find_periodic_orbits(pendulum.point_map, CellGrid((-pi, -500.0), (pi, 500.0), (60, 60)))
    known = [o for o in orbits if o.kind is OrbitKind.SADDLE and abs(o.points[0, 1]) < 10.0]
    assert len(known) == 2
    edge = edge_orbit(pendulum, 0, 1, periods=120)
    assert edge.orbit is not None
    assert abs(edge.orbit.points[0, 0]) == pytest.approx(2.13037047, abs=1e-8)
    assert min(np.abs(edge.orbit.points[0] - o.points[0]).max() for o in known) < 1e-9
    assert (edge.orbit.kind, edge.orbit.unstable, edge.returns) == (OrbitKind.SADDLE, 1, 1)
    assert edge.growth.slope == pytest.approx(log(edge.orbit.multipliers[0].real), abs=1e-5)
    assert (edge.widths < 2e-6).all()
    assert set(map(tuple, edge.sides.tolist())) == {(0, 1)}


def test_edge_of_smooth_wells(wells: Basins) -> None:
    edge = edge_orbit(wells, periods=60)
    assert edge.orbit is not None
    assert edge.orbit.points[0] == pytest.approx([0.0, 1.0 - 1.0 / 2.8], abs=1e-9)
    assert edge.growth.slope == pytest.approx(log(1.4), abs=1e-6)
    assert np.abs(edge.points[:, 0]).max() < 1e-5


def test_edge_of_period_two() -> None:
    r = 3.3
    basins = find_basins(
        discrete_map(_wells, {"r": r, "s": 0.0}, ("x", "y")), CellGrid((-1.5, 0.01), (1.5, 0.99), (30, 20))
    )
    edge = edge_orbit(basins, periods=120)
    assert edge.returns == 2
    assert edge.orbit is not None
    assert edge.orbit.period == 2
    known = (r + 1 + np.array([-1, 1]) * np.sqrt((r - 3) * (r + 1))) / (2 * r)
    assert np.sort(edge.orbit.points[:, 1]) == pytest.approx(known, abs=1e-9)


def test_chaotic_edge_is_not_called_periodic() -> None:
    """In the wells y rests, but along x = 0 its motion is chaotic, r = 3.9."""
    basins = find_basins(
        discrete_map(_wells, {"r": 3.9, "s": -1.1}, ("x", "y")), CellGrid((-1.5, 0.01), (1.5, 0.99), (30, 20))
    )
    edge = edge_orbit(basins, periods=300)
    assert edge.orbit is None
    assert edge.returns == 0
    assert "no periodic orbit" in repr(edge)
    assert np.ptp(edge.points[:, 1]) > 0.8
    # Along the boundary pairs separate faster than across it, so that ln 1.4 is not what is seen.
    along = np.log(np.abs(3.9 * (1.0 - 2.0 * edge.points[150:-1, 1]))).mean()
    assert along > log(1.4)
    assert edge.growth.slope == pytest.approx(along, abs=3.0 * edge.growth.standard_error)
    assert edge.growth.standard_error > 0.01


def test_edge_across_the_branch_cut_of_a_circle() -> None:
    """x' = x - 0.4 sin(2 x) rests at 0 and pi, with the edges between them at +-pi/2; the branch cut is next to one."""
    from math import sin

    circle = discrete_map(lambda x, p: (x[0] - 0.4 * sin(2.0 * x[0]), 0.5 * x[1]), {}, (angle("a", lower=1.57), "y"))
    basins = find_basins(circle, CellGrid((1.57, -1.0), (1.57 + 2 * pi, 1.0), (40, 10)))
    edge = edge_orbit(basins, [1.0, 0.3], [2.0, 0.3], periods=40)
    assert edge.orbit is not None
    assert edge.orbit.points[0] == pytest.approx([0.5 * pi, 0.0], abs=1e-9)
    assert edge.growth.slope == pytest.approx(log(1.8), abs=1e-6)


def test_what_bounds_against_infinity() -> None:
    """Labels of orbits that diverge are a side as well: the logistic map's basin ends at its fixed point 0."""
    logistic = discrete_map(lambda x, p: (2.8 * x[0] * (1.0 - x[0]),), {}, ("x",))
    edge = edge_orbit(find_basins(logistic, CellGrid((-0.5,), (1.5,), (40,))), 0, -2, periods=30)
    assert edge.orbit is not None
    assert edge.orbit.points[0] == pytest.approx([0.0], abs=1e-12)
    assert edge.sides[-1].tolist() == [0, -2]
    # In a window much narrower than 1.
    cubic = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))
    narrow = edge_orbit(find_basins(cubic, CellGrid((-0.05,), (0.05,), (10,))), periods=30)
    assert narrow.growth.slope == pytest.approx(log(1.5), abs=1e-6)


def test_figures_of_edges(pendulum: Basins, wells: Basins) -> None:
    edge = edge_orbit(pendulum, 0, 1, periods=40)
    ax = plot.edge_orbit(edge, basins=pendulum)
    clouds = [np.asarray(c.get_offsets()) for c in ax.collections if len(c.get_offsets()) == len(edge.points)]
    assert any(np.array_equal(cloud, edge.points) for cloud in clouds)
    assert ax.get_xlim() == pytest.approx((-pi, pi))
    assert plot.edge_orbit(edge, coordinates=("theta'", "theta")).get_ylabel().startswith(r"$\theta$")
    plot.fit(edge.growth)
    with pytest.raises(TypeError, match="edge_orbit"):
        plot.edge_orbit(wells)  # type: ignore[arg-type]


def test_without_an_attractor_it_says_so() -> None:
    """The fixed points 1 and -1 of 2 x - x**3 have the multiplier -1, and orbits approach them like 1/sqrt(n)."""
    cubic = discrete_map(lambda x, p: (2.0 * x[0] - x[0] ** 3,), {}, ("x",))
    with pytest.warns(UserWarning, match="undecided"):
        basins = find_basins(cubic, CellGrid((-1.4,), (1.4,), (10,)), max_periods=200)
    with pytest.raises(ValueError, match=r"basins=.*no attractor is verified.*edge_orbit\(outcome=\)"):
        edge_orbit(basins)
    edge = edge_orbit(basins, periods=20, outcome=lambda points: (points[:, 0] > 0.0).astype(int))
    assert edge.orbit is not None
    assert edge.orbit.points[0, 0] == pytest.approx(0.0, abs=1e-12)  # the slope of the map there is 2
    assert edge.orbit.multipliers[0] == pytest.approx(2.0, abs=1e-9)
    assert edge.sides[-1].tolist() == [0, 1]
    with pytest.raises(ValueError, match=r"outcome returns .* return one whole number"):
        edge_orbit(basins, outcome=lambda points: points)


def test_an_orbit_is_periodic_after_three_rounds() -> None:
    points = np.array([[5.0], *([[0.0], [1.0]] * 4)])[:-1]
    line = SimpleNamespace(coordinates=(Coordinate("x"),))
    found = [_period(points[-n:], line, longest, np.ones(1)) for n, longest in ((8, 5), (7, 2), (6, 2), (7, 1))]  # type: ignore[arg-type]
    assert found == [2, 2, 0, 0]
