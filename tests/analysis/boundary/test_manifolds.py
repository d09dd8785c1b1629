"""Stable and unstable manifolds, and boundaries that follow them."""

from math import pi, sqrt
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from cellmap import (
    Basins,
    CellGrid,
    PointMap,
    angle,
    discrete_map,
    find_basins,
    find_periodic_orbits,
    periodic_orbit,
    plot,
)
from cellmap.analysis.boundary import boundary_distance, saddle_manifold
from cellmap.maps import inverse_stroboscopic_map
from cellmap.orbits import OrbitKind
from systems import driven_pendulum, henon_map

SQUARE = CellGrid((-1.0, -1.0), (1.0, 1.0), (1, 1))


def _bent(x: Any, p: Any) -> tuple[float, float]:
    return p.l * x[0], p.m * (x[1] - x[0] ** 2) + p.l**2 * x[0] ** 2


def bent(l: float, m: float) -> PointMap:  # noqa: E741 (the letter of the eigenvalue)
    """The parabola y = x^2 is invariant with the multiplier l, the line x = 0 with m."""
    return discrete_map(_bent, {"l": l, "m": m}, ("x", "y"))


def finite(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return points[np.isfinite(points).all(axis=1)]


# --- known curves


@pytest.mark.parametrize(
    ("l", "m", "kind"), [(2.0, 0.5, "unstable"), (0.4, 3.0, "stable"), (-1.7, 0.3, "unstable"), (-0.5, 2.0, "stable")]
)
def test_parabola(l: float, m: float, kind: str) -> None:  # noqa: E741
    curved = bent(l, m)
    found = saddle_manifold(curved, periodic_orbit(curved, [0.1, 0.1]), kind, SQUARE, length=3.0)
    assert found.multiplier == pytest.approx(l)
    sides = set()
    for branch in found.branches:
        points = finite(branch.points)
        assert np.abs(points[:, 1] - points[:, 0] ** 2).max() < 1e-9
        sides.add(np.sign(points[-1, 0]))
        assert np.abs(points[:, 0]).max() > 1.0  # across the whole window
        inside = np.abs(points[:, 0]) <= 1.0
        # Arclength of the parabola in units of the window, both sides of which are 2 long.
        u = 2.0 * np.abs(points[inside, 0])
        known = 0.5 * (0.5 * u * np.sqrt(1.0 + u**2) + 0.5 * np.arcsinh(u)) * 0.5
        lengths = branch.arclength[np.isfinite(branch.arclength)][inside]
        assert lengths == pytest.approx(known, abs=2e-4)
        assert (np.diff(lengths) > 0).all()
    assert sides == {-1.0, 1.0}


def test_neighbours_are_close_and_angles_small() -> None:
    henon = henon_map()
    saddle = periodic_orbit(henon, [0.6, 0.2])
    window = CellGrid((-2.0, -1.0), (2.0, 1.0), (1, 1))
    found = saddle_manifold(henon, saddle, "unstable", window, length=6.0, spacing=0.01)
    for branch in found.branches:
        steps = np.diff(branch.points, axis=0) / found.scale
        sizes = np.linalg.norm(steps, axis=1)
        assert np.nanmax(sizes) <= 0.01 * (1 + 1e-12)
        rotated = np.abs(np.angle((steps[1:, 0] + 1j * steps[1:, 1]) / (steps[:-1, 0] + 1j * steps[:-1, 1])))
        long = np.minimum(sizes[1:], sizes[:-1]) > 1e-5
        assert np.nanmax(rotated[long]) <= 0.2 + 1e-9
        assert branch.length == pytest.approx(6.0, abs=0.02)
        assert branch.ended == "length"


# --- Henon


@pytest.fixture(scope="module")
def henon_basin() -> Basins:
    """One basin; all other orbits diverge."""
    return find_basins(henon_map(), CellGrid((-2.0, -2.0), (2.0, 2.0), (200, 150)))


def test_henons_stable_manifold_bounds_the_basin(henon_basin: Basins) -> None:
    henon, basins, grid = henon_map(), henon_basin, henon_basin.grid
    assert grid is not None
    saddle = periodic_orbit(henon, [-1.1, -0.3])
    found = saddle_manifold(henon, saddle, "stable", grid, length=30.0)
    followed = boundary_distance(found, basins, (0, -2))
    assert followed.fraction > 0.999
    # That of the saddle on the attractor fills the basin and does not bound it.
    inner = saddle_manifold(henon, periodic_orbit(henon, [0.6, 0.2]), "stable", grid, length=3.0)
    assert boundary_distance(inner, basins, (0, -2)).fraction < 0.5


def _dense(points: NDArray[np.float64]) -> NDArray[np.float64]:
    parts = np.linspace(0.0, 1.0, 40)[:, None, None]
    pieces = points[:-1] + parts * np.diff(points, axis=0)
    return finite(pieces.reshape(-1, 2))


def test_manifold_of_a_cycle_has_two_branches_at_each_point() -> None:
    henon = henon_map()
    window = CellGrid((-2.0, -1.0), (2.0, 1.0), (1, 1))
    cycle = next(o for o in find_periodic_orbits(henon, CellGrid((-2, -1), (2, 1), (40, 40)), 2) if o.period == 2)
    found = saddle_manifold(henon, cycle, "unstable", window, length=2.0)
    assert len(found.branches) == 4
    initial_conditions = np.array([b.points[0] for b in found.branches])
    assert initial_conditions[::2] == pytest.approx(cycle.points)
    # The map carries branches at one point onto those at the other.
    dense = np.concatenate([_dense(b.points) for b in found.branches[2:]])
    images = henon(finite(found.branches[0].points)[:40])
    # A chord is off a circle by its length times the angle to the next one, by 8.
    assert cKDTree(dense).query(images)[0].max() < 0.01 * 4.0 * 0.2 / 8.0


# --- angles and flows


@pytest.mark.thorough
def test_boundary_of_the_pendulum_follows_the_stable_manifolds(pendulum: Basins) -> None:
    exact, basins = pendulum.point_map.exact, pendulum
    inverse = inverse_stroboscopic_map(driven_pendulum(amplitude=0.003))
    saddles = [o for o in find_periodic_orbits(exact, basins.grid) if o.kind is OrbitKind.SADDLE]
    assert len(saddles) == 4
    curves = [saddle_manifold(exact, o, "stable", basins.grid, 30.0, inverse=inverse) for o in saddles]
    everything = boundary_distance(curves, basins)
    assert everything.fraction == 1.0
    assert everything.distances.max() < 0.75
    slow = [c for c in curves if abs(c.orbit.points[0, 1]) < 10.0]
    between = boundary_distance(slow, basins, (0, 1))
    assert between.fraction == 1.0
    # One saddle's manifold is not all of the boundary, and this is not said.
    assert boundary_distance(slow[:1], basins).fraction < 0.8
    rotating = [c for c in curves if c not in slow]
    assert boundary_distance(rotating, basins, (0, 1)).fraction < 0.3


def test_a_manifold_ends_where_there_is_no_preimage() -> None:
    """y' = -y/4 + ..., x' = 1 - x^2/... : beyond its fold a non-invertible map has no preimages."""
    fold = discrete_map(lambda x, p: (3.0 * x[0], 0.4 * x[1] - 0.4 * x[1] ** 2), {}, ("x", "y"))
    found = saddle_manifold(fold, periodic_orbit(fold, [0.01, 0.01]), "stable", SQUARE)
    # y = 0.4 (y_0 - y_0^2) has its maximum 0.1 at 1/2: on the way up the curve ends there.
    up = max(found.branches, key=lambda b: float(finite(b.points)[:, 1].max()))
    assert up.ended == "no image"
    last = finite(up.points)[:, 1].max()
    assert last < 0.5
    assert 0.4 * (last - last**2) == pytest.approx(0.1, abs=5e-4)
    assert np.abs(found.points[:, 0]).max() < 1e-9


# --- refusals


@pytest.mark.parametrize("kind", ["stable", "unstable"])
@pytest.mark.parametrize("by_inverse", [False, True])
def test_the_cat_map_winds_its_manifolds_round_the_torus(kind: str, by_inverse: bool) -> None:
    """Straight lines along the eigenvectors of [[2, 1], [1, 1]], of slopes (sqrt 5 - 1)/2 and -(sqrt 5 + 1)/2."""
    torus = (angle("x", "", 1.0), angle("y", "", 1.0))
    cat = discrete_map(lambda x, p: (2 * x[0] + x[1], x[0] + x[1]), {}, torus)
    back = discrete_map(lambda x, p: (x[0] - x[1], 2 * x[1] - x[0]), {}, torus)
    window = CellGrid((-0.5, -0.5), (0.5, 0.5), (1, 1))
    slope = 0.5 * (sqrt(5.0) - 1.0) if kind == "unstable" else -0.5 * (sqrt(5.0) + 1.0)
    orbits = [periodic_orbit(cat, [0.0, 0.0])]
    if by_inverse or kind == "unstable":
        orbits.append(periodic_orbit(cat, [0.2, 0.4], 2))
    for orbit in orbits:
        found = saddle_manifold(cat, orbit, kind, window, length=8.0, inverse=back if by_inverse else None)
        for k, branch in enumerate(found.branches):
            away = branch.points - orbit.points[k // 2]
            assert branch.ended == "length"
            assert branch.length == pytest.approx(8.0, abs=0.02)
            assert np.abs(away[:, 1] - slope * away[:, 0]).max() < 1e-9
    if kind == "stable" and not by_inverse:
        with pytest.raises(ValueError, match="give the inverse map"):
            saddle_manifold(cat, periodic_orbit(cat, [0.2, 0.4], 2), kind, window)


def test_figures(pendulum: Basins) -> None:
    exact, basins = pendulum.point_map.exact, pendulum
    inverse = inverse_stroboscopic_map(driven_pendulum(amplitude=0.003))
    saddle = periodic_orbit(exact, [2.13, 0.9])
    curves = [
        saddle_manifold(exact, saddle, kind, basins.grid, 2.0, 0.02, inverse if kind == "stable" else None)
        for kind in ("stable", "unstable")
    ]
    ax = plot.manifolds(curves, basins=basins)
    drawn = finite(np.concatenate([line.get_xydata() for line in ax.get_lines()]))
    for curve in curves:  # angles are wrapped where they are drawn
        wrapped = [np.remainder(finite(b.points)[:, 0] + pi, 2 * pi) - pi for b in curve.branches]
        speeds = [finite(b.points)[:, 1] for b in curve.branches]
        places = np.stack([np.concatenate(wrapped), np.concatenate(speeds)], axis=1)[::50]
        assert cKDTree(drawn).query(places)[0].max() < 1e-9
    assert ax.get_xlim() == pytest.approx((-pi, pi))
    alone = plot.manifolds(curves)
    assert [t.get_text() for t in alone.get_legend().get_texts()] == ["stable manifold", "unstable manifold"]
    plot.boundary_distance(boundary_distance(curves[0], basins))
    plot.boundary_distance(boundary_distance([], basins))
    assert "\n" not in repr(curves[0])
    with pytest.raises(TypeError, match="saddle_manifold"):
        plot.manifolds([])


def test_a_curve_ends_where_the_map_jumps():
    """x doubles, and beyond 0.3 jumps by 0.7 as well, which no points in between resolve."""
    torn = discrete_map(lambda x, p: (2 * x[0] + (0.7 if x[0] > 0.3 else 0.0), 0.5 * x[1]), {}, ("x", "y"))
    found = saddle_manifold(torn, periodic_orbit(torn, [0.0, 0.0]), "unstable", CellGrid((-2, -1), (2, 1), (1, 1)))
    assert {np.sign(finite(b.points)[-1, 0]): b.ended for b in found.branches} == {1.0: "resolution", -1.0: "window"}
    assert -2.45 < np.nanmin(found.points[:, 0]) < -2.35  # a tenth of the window beyond it, by default


@pytest.mark.parametrize("mu", [1.2, 2.0, 3.0])
@pytest.mark.parametrize("kind", ["unstable", "stable"])
def test_a_separatrix_that_returns_to_its_saddle_ends_there(mu, kind):
    """McMillan's map (1971): x = sinh(h) / cosh(n h), cosh(h) = mu, on x^2 + y^2 + x^2 y^2 = 2 mu x y."""
    mcmillan = discrete_map(lambda x, p: (x[1], -x[0] + 2 * p.mu * x[1] / (1 + x[1] ** 2)), {"mu": mu}, ("x", "y"))
    saddle = periodic_orbit(mcmillan, [0.0, 0.0])
    found = saddle_manifold(mcmillan, saddle, kind, CellGrid((-3, -3), (3, 3), (1, 1)), length=5.0)
    h, s = np.arccosh(mu), np.linspace(-30.0, 30.0, 200_001)
    x, y = np.sinh(h) / np.cosh(s), np.sinh(h) / np.cosh(s + h)
    loop = np.hypot(np.diff(x), np.diff(y)).sum() / 6.0
    for branch in found.branches:
        assert branch.ended == "point"
        assert loop * (1 - 1e-3) < branch.length < loop
    x, y = found.points.T
    assert np.abs(x * x + y * y + x * x * y * y - 2 * mu * x * y).max() < 1e-12


def test_a_boundary_that_is_a_line_is_as_near_as_points_on_the_curve():
    """Between the basins of -1 and 1 it is x = 0, on which the curve has ten points for each cell."""
    wells = discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3, 0.5 * x[1]), {}, ("x", "y"))
    basins = find_basins(wells, CellGrid((-1.2, -1.0), (1.2, 1.0), (40, 30)))
    line = saddle_manifold(wells, periodic_orbit(wells, [0.01, 0.01]), "stable", basins.grid)
    followed = boundary_distance(line, basins)
    assert followed.fraction == 1.0 and followed.distances.max() < 0.06
