"""Invariant tori of two frequencies: rotation vectors, closed forms, what is none, labels and files."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest

from cellmap import CellGrid, angle, discrete_map, find_attractors, find_basins
from cellmap.attractors import continue_attractors
from cellmap.attractors.regions.tube import DenseTorus
from cellmap.basins import load_basins, save_basins
from cellmap.orbits import Kind
from cellmap.orbits.invariant_torus import fitted_torus

GOLDEN, SILVER = (sqrt(5) - 1) / 2, sqrt(2) - 1
AROUND = (angle("a"), angle("b"), "r")


def turning(x, p):
    """Two rotations, and a coordinate that follows them: r = Im sum of 2^-k exp(i(a - k w1)) cos(b - k w2)."""
    a, b, r = x
    return a + 2 * pi * p.first, b + 2 * pi * p.second, 0.5 * r + sin(a) * cos(b)


def coupled(x, p):
    a, b, r = x
    return (a + 2 * pi * p.first + 0.3 * sin(b), b + 2 * pi * p.second + 0.2 * sin(a), 0.5 * r + 0.2 * cos(a) * sin(b))


TURNING = discrete_map(turning, {"first": GOLDEN, "second": SILVER}, AROUND)
COUPLED = discrete_map(coupled, {"first": GOLDEN, "second": SILVER}, AROUND)


def same_up_to_signs(found, expected) -> bool:
    """Frequencies mod 1, in any order and with either sense of each phase."""
    apart = np.abs(np.array(found)[:, None] - np.concatenate([expected, 1 - np.array(expected)]))
    return bool((apart.min(axis=1) < 1e-9).all()) and abs(found[0] - found[1]) > 1e-6


def test_rotation_vector_and_torus_in_closed_form():
    torus = fitted_torus(TURNING, TURNING.iterate([0.3, 0.2, 0.0], 200).points)
    assert torus.rotation_numbers == pytest.approx((GOLDEN, SILVER, 0.0), abs=1e-12)
    assert np.abs(torus.rotation_errors).max() < 1e-12
    assert same_up_to_signs(torus.frequencies, [GOLDEN, SILVER])
    a, b, r = torus.points(np.random.default_rng(0).uniform(size=(100, 2)), TURNING.coordinates).T
    k = np.arange(1, 60)[:, None]
    expected = (0.5 ** (k - 1) * np.sin(a - 2 * pi * k * GOLDEN) * np.cos(b - 2 * pi * k * SILVER)).sum(axis=0)
    assert r == pytest.approx(expected, abs=1e-6)


def test_basins_of_a_torus_and_files(tmp_path):
    """All orbits come to it; what is read is what was written."""
    basins = find_basins(COUPLED, CellGrid((-3, -3, -1), (3, 3, 1), (2, 2, 2)), max_periods=600)
    (attractor,) = basins.attractors
    assert (basins.labels == 0).all()
    assert attractor.kind is Kind.QUASIPERIODIC and attractor.verified
    assert attractor.torus.invariance_error < 1e-6
    assert len(np.unique(attractor.points[:, :2].round(6), axis=0)) == 22 * 22  # all of it is shown
    assert attractor.exponents == pytest.approx([0.0, 0.0, np.log(0.5)], abs=2e-3)
    assert attractor.name.startswith("quasi-periodic, rotation vector (0.")
    save_basins(basins, tmp_path / "torus.h5")
    (again,) = load_basins(tmp_path / "torus.h5").attractors
    assert (again.torus.coefficients == attractor.torus.coefficients).all()
    assert (again.torus.frequencies == attractor.torus.frequencies).all()
    assert again.name == attractor.name


# --- what is no torus of two frequencies


@pytest.mark.parametrize(
    ("first", "second"), [(GOLDEN, 2 * GOLDEN - 1), (GOLDEN, 0.2), (0.25, SILVER), (GOLDEN, 0.5 - GOLDEN / 3)]
)
def test_commensurate_frequencies_make_no_torus(first, second):
    """The orbit fills a curve, or several."""
    exact = TURNING.with_params(first=first, second=second)
    assert fitted_torus(exact, exact.iterate([0.3, 0.2, 0.0], 200).points) is None


def test_chaos_makes_no_torus():
    chaotic = discrete_map(
        lambda x, p: (x[0] + x[1], x[1] + 2.5 * sin(x[0] + x[1]), 0.5 * x[2] + 0.1 * cos(x[0])),
        {},
        (angle("a"), angle("b"), "r"),
    )
    assert fitted_torus(chaotic, chaotic.iterate([0.3, 0.2, 0.0], 200).points) is None


def test_a_torus_that_does_not_attract_is_none():
    """Volumes are kept: orbits are quasi-periodic, and undecided."""
    neutral = discrete_map(lambda x, p: (x[0] + 2 * pi * GOLDEN, x[1] + 2 * pi * SILVER, x[2]), {}, AROUND)
    assert find_attractors(neutral, [[0.1, 0.2, 0.3]], max_periods=600) == ()


# --- distances


def test_distance_from_a_torus():
    """That of points beside the ring torus, at known heights above it."""
    ring = discrete_map(
        lambda x, p: (0.5 * x[0] + 0.5 * (2 + cos(x[1])), x[1] + 2 * pi * GOLDEN, x[2] + 2 * pi * SILVER), {},
        ("r", angle("a"), angle("b")),
    )  # fmt: skip
    torus = fitted_torus(ring, ring.iterate([2.0, 0.3, 0.2], 200).points)
    dense = DenseTorus(ring, torus, np.ones(3))
    assert np.abs(dense._patches[2][:, 1:]).max() < 1e-9  # its angles grow evenly with the phases
    for radius in (1e-4, 1e-2):
        beside = dense.surface(np.array([radius])).reshape(-1, 3)
        assert dense.distances(beside) == pytest.approx(radius, rel=1e-2)
    assert dense.distances(np.array([[np.nan, 0.0, 0.0]])) == np.inf


@pytest.mark.thorough
def test_a_torus_is_followed_to_another_parameter():
    (before,) = find_attractors(COUPLED, [[0.1, 0.2, 0.3]])
    (after,) = continue_attractors(COUPLED.with_params(first=GOLDEN + 0.001), [before])
    assert after.torus is not None and after.rotation_number != before.rotation_number
