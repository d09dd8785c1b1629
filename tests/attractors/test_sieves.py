"""Of many ellipsoids those that hold a point are found by its coordinates."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from cellmap._compiled.kernels.capture import Regions, sifted
from cellmap.attractors.sieves import MANY, sieve_of
from cellmap.maps.coordinates import shortest


def regions_of(number: int, turn: np.ndarray, width: float, seed: int) -> Regions:
    """Ellipsoids in random directions, some of them 30 times as long as wide."""
    rng, d = np.random.default_rng(seed), len(turn)
    frames = np.linalg.qr(rng.standard_normal((number, d, d)))[0]
    radii = width * 30.0 ** rng.uniform(0.0, 1.0, (number, d))
    metrics = np.einsum("nij,nj,nkj->nik", frames, radii**-2.0, frames)
    return Regions(rng.uniform(-pi, pi, (number, d)), metrics, rng.integers(0, 9, number))


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
    assert sieve.bits.shape[2]
    sifted(points, 0, len(points), regions, sieve, around, found)
    assert np.array_equal(found, owners_by_hand(points, regions, around))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_no_ellipsoid_holds_what_has_no_place(bad):
    turn = np.array([2 * pi, 0.0])
    regions = regions_of(50, turn, 0.3, seed=0)
    points, found = np.array([[0.0, bad], [bad, 0.0]]), np.zeros(2, np.int64)
    sifted(points[:1], 0, 1, regions, sieve_of(regions, turn), turn, found)
    assert found[0] == -1
    if bad != 1e300:  # an angle of that size has no phase, and wrapping makes it NaN
        sifted(points, 1, 1, regions, sieve_of(regions, turn), turn, found)
        assert found[0] == -1


def test_no_sieve_for_few_ellipsoids_or_needles():
    turn = np.zeros(2)
    assert sieve_of(regions_of(MANY - 1, turn, 0.1, 0), turn).bits.shape[2] == 0
    needles = regions_of(MANY, turn, 0.1, 0)
    needles.metrics[3] = [[1.0, 1.0 - 1e-12], [1.0 - 1e-12, 1.0]]
    assert sieve_of(needles, turn).bits.shape[2] == 0
