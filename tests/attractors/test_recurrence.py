"""Quasi-periodic attractors in many dimensions, found by recurrence."""

from dataclasses import replace
from math import cos, exp, pi, sin

import numpy as np
import pytest

from cellmap import angle, discrete_map, find_attractors, find_basins, load_basins, save_basins
from cellmap.attractors.kinds import examined
from cellmap.attractors.kinds.exponents import FRAME, Growing
from cellmap.attractors.kinds.mixing import unmixed
from cellmap.attractors.kinds.recurrence import recurrent_attractors
from cellmap.attractors.regions.trapping import trapping_neighbourhood
from cellmap.attractors.settling.settle import Catalogue
from cellmap.maps.orbit_batch import Orbits
from cellmap.maps.paths import moved_on

GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
RADIUS = 0.7


def normal_forms(x, p):
    """Two mirror images of z -> exp(2 pi i w) z (1 + s - s |z|^2 / r^2) about u = +-1, and damped coordinates.

    The circle |z| = r is invariant, its rotation number is w, and the factor across it 1 - 2 s.
    """
    z, y, u = x[0], x[1], x[2]
    growth = 1.0 + 0.2 - 0.2 * (z * z + y * y) / (RADIUS * RADIUS)
    c, s = cos(2 * pi * p.w), sin(2 * pi * p.w)
    side = u + 0.3 * (u - u * u * u)
    return growth * (c * z - s * y), growth * (s * z + c * y), side, *(0.5 * v + 0.1 * z * y for v in x[3:])


def rotating(x, p):
    """Return the step of a rigid rotation of one angle, another one bound to it, and four damped coordinates."""
    return (
        x[0] + 2 * pi * p.w,
        x[1] + 2 * pi * p.w - 0.4 * sin(x[1] - x[0]),
        *(0.5 * v + 0.1 * cos(x[0]) for v in x[2:]),
    )


def torus(x, p):
    """Return the step of five circles, each as above, with a coordinate that sees the beat of the first two."""
    moved = []
    for k in range(5):
        z, y = x[2 * k], x[2 * k + 1]
        growth = 1.2 - 0.2 * (z * z + y * y) / (RADIUS * RADIUS)
        c, s = cos(2 * pi * p[k]), sin(2 * pi * p[k])
        moved += [growth * (c * z - s * y), growth * (s * z + c * y)]
    return *moved, 0.5 * x[10] + x[0] * x[2]


@pytest.fixture(scope="module")
def circles():
    return discrete_map(normal_forms, {"w": GOLDEN}, tuple(f"x{i}" for i in range(6)))


@pytest.fixture(scope="module")
def initial_conditions():
    return np.random.default_rng(0).uniform(-0.9, 0.9, (40, 6))


def test_circles_are_found_by_recurrence_with_rotation_number_and_residual(circles, initial_conditions, tmp_path):
    with pytest.warns(UserWarning, match="2 of 2 attractors are not verified"):
        basins = find_basins(circles, initial_conditions, max_periods=300)
    assert [str(a.kind) for a in basins.attractors] == ["quasi-periodic"] * 2
    for a in basins.attractors:
        assert not a.verified
        assert abs(a.exponents[0]) < 0.01
        assert a.circle.invariance_error < 1e-3
        assert min(a.circle.frequency, 1 - a.circle.frequency) == pytest.approx(1 - GOLDEN, abs=1e-9)
        assert np.hypot(a.points[:, 0], a.points[:, 1]) == pytest.approx(RADIUS, abs=1e-9)
    # The sign of u is kept, and decides.
    assert np.array_equal(basins.labels == basins.labels[initial_conditions[:, 2] > 0][0], initial_conditions[:, 2] > 0)
    assert (basins.labels >= 0).all()
    save_basins(basins, tmp_path / "basins.h5")
    assert not load_basins(tmp_path / "basins.h5").attractors[0].verified
    assert basins.verify(40).wrong == 0


def test_orbits_that_pass_through_an_ellipsoid_around_a_circle_are_not_on_it():
    """From the middle of a circle they spiral outwards for a hundred steps, and u is pushed to another circle there."""

    def step(x, p):
        z, y, u = x[0], x[1], x[2]
        square = z * z + y * y
        growth, c, s = 1.02 - 0.02 * square / RADIUS**2, cos(2 * pi * GOLDEN), sin(2 * pi * GOLDEN)
        pushed = u + 0.3 * u * (u - 0.5) * (1.0 - u) + 0.1 * exp(-20.0 * square)
        return growth * (c * z - s * y), growth * (s * z + c * y), pushed, *(0.5 * v + 0.1 * z * y for v in x[3:])

    two_circles = discrete_map(step, {}, tuple(f"x{i}" for i in range(6)))
    start = np.random.default_rng(6).uniform(-0.6, 0.6, (60, 6))
    start[::2] *= 0.02
    with pytest.warns(UserWarning, match="2 of 2 attractors are not verified"):
        basins = find_basins(two_circles, start)
    pushed = two_circles.iterate(start, 3000).points[:, 2] > 0.5
    upper = int(np.argmax([a.points[0, 2] for a in basins.attractors]))
    assert np.array_equal(basins.labels == upper, pushed) and 5 < pushed.sum() < 55


@pytest.mark.thorough
def test_a_torus_of_five_frequencies_two_of_which_nearly_agree():
    """Five exponents are zero, more than are seen at first, and averages take 1,500 steps, the length of a beat."""
    frequencies = [GOLDEN, GOLDEN + 1 / 1500, np.sqrt(2) - 1, np.sqrt(3) - 1, np.sqrt(5) / 7]
    point_map = discrete_map(torus, dict(zip("abcde", frequencies, strict=True)), tuple(f"x{i}" for i in range(11)))
    start = np.random.default_rng(0).uniform(-0.9, 0.9, (12, 11))
    with pytest.warns(UserWarning, match="1 of 1 attractors are not verified"):
        basins = find_basins(point_map, start, max_periods=300)
    assert (basins.labels == 0).all()
    points = basins.attractors[0].points.reshape(-1, 11)[:, :10].reshape(-1, 5, 2)
    assert np.linalg.norm(points, axis=2) == pytest.approx(RADIUS, abs=1e-9)


def test_balls_lie_along_an_angle_that_turns_and_others_are_bound_to_it():
    coordinates = (angle("a"), angle("b"), "u", "v", "w", "x")
    point_map = discrete_map(rotating, {"w": GOLDEN}, coordinates)
    start = np.random.default_rng(1).uniform(-1, 1, (20, 6))
    (attractor,) = find_attractors(point_map, start, max_periods=300)
    assert attractor.circle.rotation_numbers[:2] == pytest.approx([GOLDEN, GOLDEN], abs=1e-9)
    catalogue = Catalogue.of([attractor], point_map)
    on, off = np.zeros((2, 50, 6))
    on[:, 0] = on[:, 1] = np.linspace(-3, 3, 50)
    on[:, 2:] = point_at(on[:, 0])[:, None]
    off[:] = on
    off[:, 1] += 1.5
    assert (catalogue.owners_of(on) == 0).all()
    assert (catalogue.owners_of(off) < 0).all()


def point_at(phases):
    """Return the damped coordinate on the attractor: u' = u / 2 + cos(a) / 10 along a' = a + 2 pi w."""
    step = np.exp(2j * pi * GOLDEN)
    return (0.1 / (step - 0.5) * np.exp(1j * phases)).real


def test_chaos_in_many_dimensions_has_few_boxes_and_the_exponent_of_its_map():
    """Two mirror images of the Hénon map about u = +-1, the first coordinates of twelve."""

    def step(x, p):
        y, z, u = x[0], x[1], x[2]
        side = u + 0.3 * (u - u * u * u)
        return 1.0 - 1.4 * y * y + z, 0.3 * y, side, *(0.5 * v + 0.1 * w for v, w in zip(x[3:], x[:9], strict=True))

    pair = discrete_map(step, {}, tuple(f"x{i}" for i in range(12)))
    start = np.random.default_rng(4).uniform(-0.1, 0.1, (24, 12))
    basins = find_basins(pair, start, max_periods=300)
    assert [str(a.kind) for a in basins.attractors] == ["chaotic"] * 2
    for a in basins.attractors:
        assert a.exponents[0] == pytest.approx(0.419, abs=0.01)
        assert len(a.cover.boxes) < 1e5
    assert np.array_equal(basins.labels == basins.labels[start[:, 2] > 0][0], start[:, 2] > 0)


def test_without_images_for_proofs_there_are_the_same_attractors_and_labels(monkeypatch):
    """Eight wells of three coordinates u -> u + 0.3 (u - u^3), whose signs are kept and decide."""

    def step(x, p):
        return (
            *(u + 0.3 * (u - u * u * u) for u in x[:3]),
            *(0.5 * v + 0.1 * u for u, v in zip(x[:3], x[3:], strict=True)),
        )

    wells = discrete_map(step, {}, tuple(f"x{i}" for i in range(6)))
    start = np.random.default_rng(5).uniform(-1.2, 1.2, (100, 6))
    proved = find_basins(wells, start, max_periods=300)
    assert len(proved.attractors) == 8 and all(a.verified for a in proved.attractors)
    monkeypatch.setattr(examined, "_IMAGES", 0)
    monkeypatch.setattr(examined, "AT_LEAST", 0)
    with pytest.warns(UserWarning, match="8 of 8 attractors are not verified, and 100.0%"):
        seen = find_basins(wells, start, max_periods=300)
    assert np.isnan(seen.attractors[0].multipliers).all()
    for k, a in enumerate(seen.attractors):
        signs = np.sign(a.points[0, :3])
        assert a.points[0, :3] == pytest.approx(signs, abs=1e-5)
        assert np.array_equal(seen.labels == k, (np.sign(start[:, :3]) == signs).all(axis=1))


def test_what_cannot_be_afforded_is_not_verified(circles):
    def step(x, p):
        return tuple(0.5 * v + 0.3 * w * w for v, w in zip(x, (*x[1:], *x[:1]), strict=True))

    wells = discrete_map(step, {}, tuple(f"x{i}" for i in range(6)))
    (origin,) = find_attractors(wells, np.random.default_rng(3).uniform(-0.4, 0.4, (8, 6)))
    region = trapping_neighbourhood(wells, origin, np.ones(6), lambda images: False)
    assert origin.verified and not replace(origin, neighbourhood=region).verified
    assert recurrent_attractors(circles, np.ones((3, 6)), np.ones(6), 10, [], afford=lambda images: False) == ([], [])


def test_circles_that_keep_their_distance_do_not_attract():
    """A rotation of the first two of six coordinates; the others see the radius, and settle to twice its square."""

    def step(x, p):
        c, s = cos(2 * pi * GOLDEN), sin(2 * pi * GOLDEN)
        return c * x[0] - s * x[1], s * x[0] + c * x[1], *(0.5 * v + x[0] ** 2 + x[1] ** 2 for v in x[2:])

    neutral = discrete_map(step, {}, tuple(f"x{i}" for i in range(6)))
    assert recurrent_attractors(neutral, np.array([[1.0, 0.0, 2.0, 2.0, 2.0, 2.0]]), np.ones(6), 100, []) == ([], [])


def test_orbits_are_followed_step_by_step_and_no_further():
    """Averages over every step of x -> -x, whatever its phase; and 100 steps of x -> x + 1."""
    flip, count = (discrete_map(f, {}, ("x",)) for f in (lambda x, p: (-x[0],), lambda x, p: (x[0] + 1.0,)))
    assert not unmixed(flip, np.array([[1.0], [-1.0]]), np.ones(2, bool), 16).any()
    orbits = Orbits.starting(np.zeros((1, 1)))
    moved_on(count, orbits, 100)
    assert orbits.points == 100.0


def test_chaos_is_not_taken_for_quasi_periodic():
    def step(x, p):
        return 1.0 - 1.4 * x[0] * x[0] + x[1], 0.3 * x[0], *(0.5 * v for v in x[2:])

    henon = discrete_map(step, {}, tuple(f"x{i}" for i in range(6)))
    start = np.random.default_rng(2).uniform(-0.1, 0.1, (8, 6))
    assert recurrent_attractors(henon, start, np.ones(6), 100, []) == ([], [])
    # The exponents of the Hénon map are 0.419 and -1.62 (Sprott, Chaos and Time-Series Analysis (2003)).
    growth = Growing.along(henon, np.zeros((1, 6)), 2000, directions=FRAME)
    assert growth.exponents[0, 0] == pytest.approx(0.419, abs=3 * growth.errors[0, 0])
