"""Distances to curves, segments and tori, surfaces beside these and boxes in tubes, against elementary geometry."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from cellmap import angle, discrete_map, find_attractors
from cellmap.attractors.continua import Segment
from cellmap.attractors.settling import Catalogue
from cellmap.attractors.tube import Curves, Tube, cover_of_tube
from cellmap.orbits.attractor import Neighbourhood

PLANE = discrete_map(lambda x, p: (0.5 * x[0], 0.5 * x[1]), {}, ("x", "y"))
SPACE = discrete_map(lambda x, p: (0.5 * x[0], 0.5 * x[1], 0.5 * x[2]), {}, ("x", "y", "z"))
CYLINDER = discrete_map(lambda x, p: (x[0], 0.5 * x[1]), {}, (angle("a"), "r"))
RNG = np.random.default_rng(5)


def ring(exact, size, n=2048):
    """The unit circle in the first two coordinates, stretched by the sizes."""
    phases = 2 * pi * np.arange(n) / n
    points = np.zeros((1, n, exact.dimension))
    points[0, :, :2] = np.stack([np.cos(phases), np.sin(phases)], axis=-1)
    return Curves(exact, points * size, np.asarray(size, float))


@pytest.mark.parametrize(("exact", "size"), [(PLANE, [1.0, 1.0]), (PLANE, [3.0, 0.2]), (SPACE, [1.0, 2.0, 0.5])])
def test_distances_to_a_ring(exact, size):
    """In units of the sizes the ring is a circle: its distance is the root of (r - 1)^2 + z^2."""
    curve = ring(exact, size)
    points = RNG.uniform(-2, 2, (200, exact.dimension))
    radius, height = np.hypot(*points.T[:2]), np.linalg.norm(points[:, 2:], axis=1)
    found = curve.distances(np.vstack([points * size, np.full(exact.dimension, np.nan)]))
    np.testing.assert_allclose(found[:-1], np.hypot(radius - 1, height), rtol=0, atol=2e-6)
    assert np.isinf(found[-1])


@pytest.mark.parametrize(("exact", "size"), [(PLANE, [3.0, 0.2]), (SPACE, [1.0, 2.0, 0.5])])
def test_surfaces_lie_across_a_ring_at_their_radii(exact, size):
    curve, radii = ring(exact, size), np.array([0.05, 0.2])
    points = curve.surface(radii)
    assert points.shape[:3] == (2, 1, 128)
    for radius, beside in zip(radii, points, strict=True):
        np.testing.assert_allclose(curve.distances(beside.reshape(-1, exact.dimension)), radius, rtol=1e-3)
        # The places on the ring are its 128 phases, each once.
        phases = np.arctan2(beside[0, ..., 1] / size[1], beside[0, ..., 0] / size[0]) % (2 * pi)
        off = (phases - (2 * pi * np.arange(128) / 128)[:, None] + pi) % (2 * pi) - pi
        assert np.abs(off).max() < 1e-9
        both = beside[0].mean(axis=1) / size
        np.testing.assert_allclose(np.linalg.norm(both, axis=-1), 1.0, rtol=1e-9)


def test_between_points_of_a_surface_distances_change_half_as_much():
    """By hand: of 0.3 beside 0.1 half the difference of 0.2 more."""
    distances = np.full((1, 128), 0.1)
    distances[0, 40] = 0.3
    assert ring(PLANE, [1.0, 1.0]).between(distances) == pytest.approx([0.4])
    distances[0, 40] = np.nan
    assert ring(PLANE, [1.0, 1.0]).between(distances) == [np.inf]


@pytest.mark.parametrize(("exact", "size"), [(PLANE, [1.0, 1.0]), (PLANE, [3.0, 0.2])])
def test_boxes_of_a_tube_lie_in_it_and_hold_what_is_near(exact, size):
    curve, radius = ring(exact, size), 0.1
    cover = cover_of_tube(curve, Tube(radius, 1, 0.5))
    assert np.array_equal(cover.boxes, np.unique(cover.boxes, axis=0))
    assert cover.certain.all()
    corners = np.stack(np.meshgrid([0, 1], [0, 1]), axis=-1).reshape(-1, 2)
    places = (cover.lower + (cover.boxes[:, None] + corners) * cover.widths).reshape(-1, 2)
    assert curve.distances(places).max() <= radius + 1e-9
    diagonal = np.linalg.norm(cover.widths / size)
    assert diagonal <= 0.5 * radius + 1e-12
    phases, off = RNG.uniform(0, 2 * pi, 2000), RNG.uniform(-1, 1, 2000) * (radius - diagonal)
    near = np.stack([np.cos(phases), np.sin(phases)], axis=-1) * (1 + off[:, None]) * size
    known = {tuple(box) for box in cover.boxes}
    assert all(tuple(box) in known for box in np.floor((near - cover.lower) / cover.widths).astype(int))


def test_a_curve_around_an_angle_is_covered_around_it():
    """r = 0 for every angle: boxes of all places around, from -radius to radius."""
    angles = 2 * pi * np.arange(2048) / 2048 - pi
    curve = Curves(CYLINDER, np.stack([angles, 0 * angles], axis=-1)[None], np.array([2 * pi, 1.0]))
    cover = cover_of_tube(curve, Tube(0.1, 1, 0.5))
    around = 2 * pi / cover.widths[0]
    assert around == pytest.approx(round(around))
    assert set(cover.boxes[:, 0]) == set(range(round(around)))
    ends = cover.lower[1] + cover.boxes[:, 1] * cover.widths[1]
    assert -0.1 <= ends.min() < -0.05 and 0.05 < ends.max() + cover.widths[1] <= 0.1
    np.testing.assert_allclose(curve.distances(np.array([[pi - 1e-3, 0.3], [-pi, -0.2]])), [0.3, 0.2], rtol=1e-9)


SLANTED = Segment(PLANE, np.linspace([0.0, 0.0], [4.0, 3.0], 501), np.ones(2))  # of length 5, a point each 0.01


def test_distances_and_feet_of_a_segment():
    """Across the line the distance to it, beyond the ends that to the end; feet count points from the begin."""
    along, across = np.array([0.8, 0.6]), np.array([-0.6, 0.8])
    places = np.array([-1.0, 0.0, 0.3, 1.2345, 4.999, 5.0, 6.0])
    offsets = np.array([0.5, -0.2, 0.1, 0.7, -0.3, 0.2, 0.0])
    points = places[:, None] * along + offsets[:, None] * across
    apart, where = SLANTED.feet(np.vstack([points, [np.inf, 0.0]]))
    beyond = np.maximum(np.maximum(-places, places - 5.0), 0.0)
    np.testing.assert_allclose(apart[:-1], np.hypot(offsets, beyond), rtol=1e-12)
    np.testing.assert_allclose(where[:-1], 100.0 * np.clip(places, 0.0, 5.0), rtol=1e-9, atol=1e-9)
    assert np.isinf(apart[-1])
    assert np.array_equal(SLANTED.distances(points), apart[:-1])


def test_surface_of_a_segment_is_at_its_radii_from_end_to_end():
    points = SLANTED.surface(np.array([0.0, 0.25]))
    ends = points[0, :, 0]
    np.testing.assert_allclose(ends, np.linspace([0.0, 0.0], [4.0, 3.0], 17), atol=0.005)
    np.testing.assert_allclose(np.linalg.norm(points[1] - ends[:, None], axis=-1), 0.25, rtol=1e-12)
    directions = (points[1] - ends[:, None])[0] / 0.25
    for axis in np.eye(2):
        for side in (-1, 1):
            assert np.abs(directions - side * axis).max(axis=1).min() < 1e-12


def test_distances_to_attractors_are_in_radii_of_their_regions():
    """Two ellipsoids on a cylinder, beside the branch cut: (x - c) M (x - c) by hand."""
    (sink,) = find_attractors(PLANE, [[0.5, 0.5]])
    assert np.isinf(Catalogue.of((), CYLINDER).distances_of(np.zeros((3, 2)))).all()
    region = Neighbourhood(np.array([[3.0, 0.0], [0.0, 1.0]]), np.array([np.diag([4.0, 1.0]), np.eye(2)]), 0.5)
    known = Catalogue.of([replace(sink, coordinates=CYLINDER.coordinates, neighbourhood=region)], CYLINDER)
    points = np.array([[-3.0, 0.5], [0.5, 1.0], [3.25, 0.0]])
    expected = [np.hypot(2 * (2 * pi - 6.0), 0.5), 0.5, 0.5]
    np.testing.assert_allclose(known.distances_of(points), expected, rtol=1e-12)
    np.testing.assert_allclose(known.shrunk(0.5).distances_of(points), np.multiply(expected, 2), rtol=1e-12)
    assert known.owners_of(points).tolist() == [0, 0, 0]
    assert known.shrunk(0.4).owners_of(points).tolist() == [-1, -1, -1]
