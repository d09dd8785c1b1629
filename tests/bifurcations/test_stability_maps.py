"""Stability of orbits that move with the parameters, and boundaries as curves."""

from math import pi

import numpy as np
import pytest

from cellmap import discrete_map, periodic_orbit, stability_map
from cellmap.bifurcations import Crossing, critical_values
from cellmap.bifurcations.crossings import linked
from systems import driven_pendulum, henon_map


def test_a_doubled_orbit_ends_where_it_is_born():
    exact = henon_map(0.6, 0.3)
    axes = ("a", np.linspace(0.103, 1.6, 47)), ("b", np.linspace(-0.8, 0.8, 31))
    found = stability_map(exact, periodic_orbit(exact, [1.0, -0.1], 2), *axes)
    a, b = np.meshgrid(found.x, found.y)
    born, doubles = 0.75 * (1.0 - b) ** 2, (1.0 - b) ** 2 + 0.25 * (1.0 + b) ** 2
    np.testing.assert_array_equal(np.isfinite(found.largest), a > born)
    np.testing.assert_array_equal(found.unstable == 0, (a > born) & (a < doubles))
    assert {c.crossing for c in found.curves} == {Crossing.MINUS_ONE}


def test_a_neimark_sacker_boundary_that_does_not_depend_on_one_parameter():
    exact = discrete_map(lambda x, p: (p.r * x[0] * (1.0 - x[1]), p.c * x[0]), {"r": 1.7, "c": 1.0}, ("x", "y"))
    orbit = periodic_orbit(exact, [0.4, 0.4])
    found = stability_map(exact, orbit, ("r", np.linspace(1.5, 2.3, 20)), ("c", np.linspace(0.5, 2.0, 10)))
    np.testing.assert_allclose(found.rows.x, 2.0, rtol=1e-12)
    assert set(found.rows.crossing) == {Crossing.NEIMARK_SACKER}
    assert len(found.columns) == 0


def test_curves_of_equilibria_join_rows_and_columns():
    system = driven_pendulum(damping=0.0)
    axes = ("frequency", np.linspace(20.0, 80.0, 31)), ("amplitude", np.linspace(0.0005, 0.014, 28))
    found = stability_map(system, [pi, 0.0], *axes)
    gained, lost = sorted(found.curves, key=lambda c: c.crossing)
    assert (gained.crossing, lost.crossing) == (Crossing.PLUS_ONE, Crossing.MINUS_ONE)
    assert len(gained) + len(lost) == len(found.rows) + len(found.columns)
    assert (np.diff(gained.x) * np.sign(gained.x[-1] - gained.x[0]) >= 0).all()
    for x, y in zip(gained.x[::9], gained.y[::9], strict=True):
        (value,) = critical_values(system.with_params(frequency=x), [pi, 0.0], "amplitude", 0.9 * y, 1.1 * y)
        assert y == pytest.approx(value.value, rel=1e-11)


def test_a_closed_curve_ends_where_it_begins():
    # A circle cut by the lines of a grid.
    axis = np.linspace(-1.5, 1.5, 13)
    axis += 0.013
    rows = [(s * np.sqrt(1 - v**2), v) for v in axis if abs(v) < 1 for s in (1, -1)]
    columns = [(v, s * np.sqrt(1 - v**2)) for v in axis if abs(v) < 1 for s in (1, -1)]

    def side(points):
        x, y = np.array(points).T
        return x, y, np.zeros(len(x), np.int64)

    (circle,) = linked(axis, axis, side(rows), side(columns))
    assert len(circle) == len(rows) + len(columns) + 1
    assert circle.x[0] == circle.x[-1] and circle.y[0] == circle.y[-1]
    angles = np.unwrap(np.arctan2(circle.y, circle.x))
    assert abs(angles[-1] - angles[0]) == pytest.approx(2 * pi)


def test_the_way_to_the_grid_is_found(pendulum):
    rotation = periodic_orbit(pendulum, [2.52, 320.4])
    x = ("amplitude", np.linspace(0.008, 0.009, 3))
    found = stability_map(pendulum, rotation, x, ("frequency", np.linspace(70.0, 75.0, 3)))
    assert (found.unstable == 0).all()
    np.testing.assert_allclose(
        found.largest**2, np.repeat(np.exp(-10.0 / found.y)[:, None], 3, axis=1), rtol=1e-9
    )  # foci: Liouville
    with pytest.raises(ValueError, match="it ceases to exist between"):
        stability_map(pendulum, rotation, ("amplitude", [0.0001, 0.0002, 0.0003]), ("frequency", [50.0, 51.0, 52.0]))
