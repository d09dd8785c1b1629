"""What maps do at edges: far angles, ended orbits, surfaces that are not there, cells beside those without images."""

from dataclasses import asdict
from math import cos, log, pi
from types import SimpleNamespace

import numpy as np
import pytest

from cellmap import CellGrid, ForcedSystem, Status, discrete_map, interpolated_map, stroboscopic_map
from cellmap.maps import grazing_distance, inverse_stroboscopic_map, section_map, swept_map
from cellmap.maps.coordinates import in_turn
from cellmap.maps.fingerprint import fingerprint
from cellmap.maps.interpolation import table_making
from cellmap.maps.misread import lacking
from cellmap.maps.orbit_batch import Cost, Orbits


def test_values_in_the_turn_from_an_edge():
    lower, turn = np.array([1.0, 0.0, -pi]), np.array([2.0, 0.0, 2 * pi])
    values = np.array([[0.5, 9.0, pi], [1.0, -9.0, -4 * pi], [-7.2, 0.0, 3.0], [np.nan, 1.0, 0.0]])
    found = in_turn(values, lower, turn)
    np.testing.assert_allclose(
        found, [[2.5, 9.0, -pi], [1.0, -9.0, 0.0], [2.8, 0.0, 3.0], [np.nan, 1.0, 0.0]], atol=1e-12
    )


def test_orbits_without_a_phase_have_diverged():
    orbits = Orbits.starting(np.array([[0.3, 1.0], [1e300, 1.0], [7.0, 2.0]]))
    orbits.wrap(np.array([-pi, -np.inf]), np.array([2 * pi, 0.0]))
    assert orbits.status.tolist() == [Status.OK, Status.DIVERGED, Status.OK]
    assert np.isnan(orbits.points[1]).all()
    assert orbits.points[2, 0] == pytest.approx(7.0 - 2 * pi) and orbits.rotations[:, 0].tolist() == [0, 0, 1]


def test_distances_to_grazing_have_the_shape_of_the_points():
    """Infinite where there are no surfaces, and so for a swept map."""
    discrete = discrete_map(lambda x, p: (0.5 * x[0], 0.5 * x[1]), {}, ("x", "y"))
    free = ForcedSystem(lambda t, x, p: (x[1], -x[0]), {}, 1.0, ("q", "v"))
    smooth = stroboscopic_map(free)
    swept = swept_map(discrete_map(lambda x, p: (p.a * x[0],), {"a": 0.5}, ("x",)), "a")
    for point_map in (discrete, smooth, swept):
        assert np.array_equal(grazing_distance(point_map, np.zeros((3, 4, 2))), np.full((3, 4), np.inf))
    assert np.isnan(grazing_distance(section_map(free, ("v", 0.0, -1)), [1.0]))


def test_fingerprints_name_the_images_in_sixteen_digits():
    probes = np.array([[0.1], [0.7], [9.0]])
    marks = [
        fingerprint(discrete_map(f, {}, ("x",), name="same"), probes)["bits of images"]
        for f in (lambda x, p: (0.5 * x[0],), lambda x, p: (x[0] / 2,), lambda x, p: (0.5 * x[0] + 1e-16,))
    ]
    assert marks[0] == marks[1] != marks[2]
    assert all(len(mark) == 16 for mark in marks)


def test_a_table_at_another_phase():
    """Of a forced oscillator at the same phase the table is kept; at another one it is computed from that map."""
    driven = ForcedSystem(lambda t, x, p: (x[1], -x[0] - 0.3 * x[1] + cos(t)), {}, 2 * pi, ("q", "v"))
    window = CellGrid((-2.0, -2.0), (2.0, 2.0), (16, 16))
    table = interpolated_map(stroboscopic_map(driven), window)
    spec = table.specified
    assert spec.with_phase(0.0) is spec
    other = spec.with_phase(0.25).build()
    point = np.array([[0.3, -0.2]])
    np.testing.assert_allclose(other(point), stroboscopic_map(driven, 0.25)(point), atol=1e-6)
    assert np.abs(other(point) - table(point)).max() > 0.1


def test_an_inverse_with_parameters_in_the_state():
    """q' = k q backwards for one period: q exp(-k)."""
    growth = inverse_stroboscopic_map(ForcedSystem(lambda t, x, p: (p.k * x[0],), {"k": 1.0}, 1.0, ("q",)))
    found = swept_map(growth, "k")(np.array([[1.0, log(2.0)], [3.0, log(3.0)]]))
    np.testing.assert_allclose(found, [[0.5, log(2.0)], [1.0, log(3.0)]], rtol=1e-6)


def test_the_cells_around_those_that_orbits_leave_are_left_to_the_exact_map():
    """Doubling of x in a window: what leaves it in two periods spoils its own cell and one on either side."""
    stretch = discrete_map(lambda x, p: (2.0 * x[0], 0.5 * x[1]), {}, ("x", "y"))
    grid = CellGrid((-1.0, -1.0), (1.0, 1.0), (32, 4))
    single = interpolated_map(stretch, grid, 1, outside="escape").table
    doubled = table_making.doubled_table(stretch, [single], "escape", np.full(2, np.inf), False)
    x = grid.axis(0)
    edge = np.flatnonzero(~doubled.fallback[:, 1])
    # Corners beyond 1/2 leave before the second period; cells that touch these, and their neighbours, are spoilt.
    inside = np.abs(x) + 1.5 / 16 <= 0.5 + 1e-12
    assert np.array_equal(edge, np.flatnonzero(inside))


def test_what_is_lacking_is_said_of_parameters_and_of_modules():
    class Record(SimpleNamespace):
        _fields = ("mass", "drag")

    with pytest.raises(AttributeError) as missing:
        _ = Record().masss
    assert "mass, drag" in str(lacking("rhs", missing.value))
    with pytest.raises(AttributeError) as other:
        _ = np.nothing_like_it
    said = str(lacking("rhs", other.value))
    assert "nothing_like_it" in said and "mass" not in said


def test_nothing_done_costs_nothing():
    assert set(asdict(Cost()).values()) == {0}
