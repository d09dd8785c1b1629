"""Names of attractors in legends."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import Attractor, CellGrid, Coordinate, angle, discrete_map, find_basins, plot
from cellmap.maps.coordinates import as_coordinates
from cellmap.orbits import Kind
from cellmap.orbits.attractor import distinct_names

mpl.use("Agg")
from legends import legend_of


def test_mirror_images_have_names_of_their_own():
    """In each half of the plane x stays and y goes to and fro, on the right from -1.31 to 1.69."""
    from math import tanh

    def rhs(x, p):
        return 2.0 * tanh(2.0 * x[0]), -1.5 * tanh(3.0 * x[1]) + 0.2 * tanh(x[0])

    basins = find_basins(discrete_map(rhs, {}, ("x", "y")), CellGrid((-3, -3), (3, 3), (20, 20)))
    assert [a.name for a in basins.attractors] == ["periodic, period 2"] * 2
    names = [entry.rpartition(":")[0] for entry in legend_of(plot.basins(basins))]
    assert names == ["periodic, period 2, through (2, -1.31)", "periodic, period 2, through (-2, 1.31)"]


CYLINDER = (angle("theta"), Coordinate("v"))


def fixed_point(*place, coordinates=CYLINDER):
    points = np.array([place])
    return Attractor(Kind.FIXED_POINT, 1, points, (0, 0), np.zeros(2, complex), np.zeros(2), coordinates)


@pytest.mark.parametrize(
    ("attractor", "name"),
    [
        (fixed_point(-pi, 0.0), "fixed point (π, 0)"),
        (fixed_point(pi - 1e-9, 1e-12), "fixed point (π, 0)"),
        (fixed_point(1e-12, -1.5), "fixed point (0, -1.5)"),
        (fixed_point(3.14, pi), "fixed point (3.14, 3.14)"),
        (fixed_point(1e-9, 0.0, coordinates=(angle("theta", lower=0.0), "v")), "fixed point (0, 0)"),
        (fixed_point(pi, 0.0, coordinates=(angle("theta", lower=0.0), "v")), "fixed point (π, 0)"),
        (fixed_point(-180.0, 0.0, coordinates=(angle("theta", "deg", 360.0), "v")), "fixed point (180, 0)"),
    ],
)
def test_angles_of_fixed_points_are_readable(attractor, name):
    assert replace(attractor, coordinates=as_coordinates(attractor.coordinates)).name == name


def test_close_fixed_points_are_told_apart_by_more_digits():
    close = [fixed_point(1.0001, 0.0), fixed_point(1.0002, 0.0), fixed_point(0.5, 0.0)]
    assert [a.name for a in close[:2]] == ["fixed point (1, 0)"] * 2
    assert distinct_names(close) == ("fixed point (1.0001, 0)", "fixed point (1.0002, 0)", "fixed point (0.5, 0)")
    assert distinct_names(close[:1] * 2) == ("fixed point (1.0001, 0)",) * 2
