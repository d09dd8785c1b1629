"""Distances to curves, segments and tori, surfaces beside these and boxes in tubes, against elementary geometry."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from cellmap import angle, discrete_map, find_attractors
from cellmap._compiled.kernels.capture import Regions, sifted
from cellmap.attractors.kinds.continua import Segment
from cellmap.attractors.regions.sieves import MANY, sieve_of
from cellmap.attractors.regions.tube import Curves, Tube, cover_of_tube
from cellmap.attractors.settling.settle import Catalogue
from cellmap.maps.coordinates import shortest
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
    assert points.shape[:3] == (2, 1, 64)
    for radius, beside in zip(radii, points, strict=True):
        np.testing.assert_allclose(curve.distances(beside.reshape(-1, exact.dimension)), radius, rtol=1e-3)
        # The places on the ring are its 64 phases, each once.
        phases = np.arctan2(beside[0, ..., 1] / size[1], beside[0, ..., 0] / size[0]) % (2 * pi)
        off = (phases - (2 * pi * np.arange(64) / 64)[:, None] + pi) % (2 * pi) - pi
        assert np.abs(off).max() < 1e-9
        both = beside[0].mean(axis=1) / size
        np.testing.assert_allclose(np.linalg.norm(both, axis=-1), 1.0, rtol=1e-9)


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


# --- ellipsoids found by their coordinates


def regions_of(number: int, turn: np.ndarray, width: float, seed: int) -> Regions:
    """Ellipsoids in random directions, some of them 30 times as long as wide."""
    rng, d = np.random.default_rng(seed), len(turn)
    frames = np.linalg.qr(rng.standard_normal((number, d, d)))[0]
    radii = width * 30.0 ** rng.uniform(0.0, 1.0, (number, d))
    metrics = np.einsum("nij,nj,nkj->nik", frames, radii**-2.0, frames)
    return Regions(rng.uniform(-pi, pi, (number, d)), metrics, rng.integers(0, 9, number), np.zeros(9, np.int64))


def owners_by_hand(points: np.ndarray, regions: Regions, turn: np.ndarray) -> np.ndarray:
    shift = shortest(points[:, None] - regions.centres, turn)
    held = np.einsum("nmi,mij,nmj->nm", shift, regions.metrics, shift) <= 1.0
    return np.where(held.any(axis=1), regions.owners[held.argmax(axis=1)], -1)


@pytest.mark.parametrize("turn", [(0.0,), (2 * pi,), (0.0, 0.0), (2 * pi, 0.0), (2 * pi, 2 * pi, 0.0)], ids=str)
@pytest.mark.parametrize(("number", "width"), [(32, 0.05), (200, 0.004), (200, 0.3)])
def test_the_first_ellipsoid_that_holds_a_point(turn, number, width):
    around = np.array(turn)
    regions = regions_of(number, around, width, seed=number)
    points = np.random.default_rng(1).uniform(-1.2 * pi, 1.2 * pi, (3000, len(turn)))
    # Half of them lie close to an edge of an ellipsoid.
    near = np.random.default_rng(2).integers(0, number, 1500)
    step = np.random.default_rng(3).standard_normal((1500, len(turn)))
    size = np.sqrt(np.einsum("ni,nij,nj->n", step, regions.metrics[near], step))
    factor = np.where(np.arange(1500) % 2, 1.0 - 1e-9, 1.0 + 1e-9)
    points[:1500] = regions.centres[near] + step * (factor / size)[:, None]
    found = np.empty(len(points), np.int64)
    sieve = sieve_of(regions, around)
    assert sieve.bits.shape[2] and not sieve_of(regions_of(MANY - 1, around, width, seed=0), around).bits.shape[2]
    sifted(points, 0, len(points), regions, sieve, around, found)
    assert np.array_equal(found, owners_by_hand(points, regions, around))
