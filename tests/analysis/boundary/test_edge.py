"""Straddle orbits and the edge states at their end."""

from __future__ import annotations

from dataclasses import replace
from math import log, pi
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import (
    Basins,
    CellGrid,
    angle,
    discrete_map,
    find_basins,
    find_periodic_orbits,
    interpolated_map,
    plot,
    stroboscopic_map,
)
from cellmap.analysis.boundary import edge_orbit
from cellmap.orbits import OrbitKind
from systems import driven_pendulum, two_well_duffing

mpl.use("Agg")


def _wells(x: Any, p: Any) -> tuple[float, float]:
    return 1.4 * x[0] - 0.4 * x[0] ** 3, (p.r + p.s * x[0] ** 2) * x[1] * (1.0 - x[1])


@pytest.fixture(scope="module")
def pendulum() -> Basins:
    exact = stroboscopic_map(driven_pendulum(amplitude=0.003), rtol=1e-12, atol=1e-12)
    table = interpolated_map(exact, CellGrid((-pi, -1000.0), (pi, 1000.0), (128, 256)), outside="integrate")
    return find_basins(table, CellGrid((-pi, -500.0), (pi, 500.0), (100, 100)))


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


def test_edge_of_a_rotation_is_another_saddle(pendulum: Basins) -> None:
    edge = edge_orbit(pendulum, 2, 0, periods=80)
    assert edge.orbit is not None
    assert edge.orbit.rotations == pendulum.attractors[2].rotations
    assert abs(edge.orbit.points[0, 1]) == pytest.approx(308.148167, abs=1e-5)


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


def test_straddled_saddle_of_the_duffing_oscillator() -> None:
    """Forced below Melnikov's value, 0.113: a saddle, whose multipliers' product is exp(-0.15 * 2 pi) by Liouville.

    The value is 4 delta cosh(pi/2) / (3 sqrt(2) pi) for this equation (Guckenheimer, Holmes 1983, section 4.5).
    """
    exact = stroboscopic_map(two_well_duffing().with_params(forcing=0.05), rtol=1e-12, atol=1e-12)
    grid = CellGrid((-2.2, -2.2), (2.2, 2.2), (60, 60))
    basins = find_basins(interpolated_map(exact, CellGrid((-3, -3), (3, 3), (200, 200)), outside="integrate"), grid)
    edge = edge_orbit(basins, periods=60)
    assert edge.orbit is not None
    product = np.prod(edge.orbit.multipliers).real
    assert product == pytest.approx(np.exp(-0.3 * pi), rel=1e-9)
    assert edge.orbit.unstable == 1


def test_what_bounds_against_infinity() -> None:
    """Labels of orbits that diverge are a side as well: the logistic map's basin ends at its fixed point 0."""
    logistic = discrete_map(lambda x, p: (2.8 * x[0] * (1.0 - x[0]),), {}, ("x",))
    edge = edge_orbit(find_basins(logistic, CellGrid((-0.5,), (1.5,), (40,))), 0, -2, periods=30)
    assert edge.orbit is not None
    assert edge.orbit.points[0] == pytest.approx([0.0], abs=1e-12)
    assert edge.sides[-1].tolist() == [0, -2]


def test_same_result_again(wells: Basins) -> None:
    a, b = (edge_orbit(wells, periods=30) for _ in range(2))
    assert np.array_equal(a.points, b.points)


@pytest.mark.parametrize(
    ("inside", "outside", "change", "error", "match"),
    [
        (0, 0, {}, ValueError, "lies beside"),
        (0, -3, {}, ValueError, "lies beside"),
        (5, 0, {}, ValueError, "inside=5"),
        (0, 4, {}, ValueError, "no initial condition has the label 4"),
        (0, [1.0, 0.5], {}, TypeError, "two labels, or two states"),
        ([1.0, 0.5], [1.2, 0.5], {}, ValueError, "labels"),
        ([1.0, 0.5, 0.0], [1.2, 0.5, 0.0], {}, ValueError, "last axis"),
        (0, 1, {"periods": 2}, ValueError, "periods=2"),
        (0, 1, {"min_separation": 1e-3, "max_separation": 1e-4}, ValueError, "max_separation"),
        (0, 1, {"max_periods": 5}, ValueError, "max_periods"),
    ],
)
def test_what_it_refuses(
    wells: Basins, inside: Any, outside: Any, change: Any, error: type[Exception], match: str
) -> None:
    with pytest.raises(error, match=match):
        edge_orbit(wells, inside, outside, **change)


def test_basins_from_a_file_need_a_map(wells: Basins) -> None:
    with pytest.raises(ValueError, match="have no map"):
        edge_orbit(replace(wells, point_map=None))
    assert edge_orbit(replace(wells, point_map=None), periods=60, point_map=wells.point_map).orbit is not None


def test_figures(pendulum: Basins, wells: Basins) -> None:
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
