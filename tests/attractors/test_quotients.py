"""Continuous symmetries: found in the right-hand side, and attractors that are orbits of their group."""

from math import cos, pi, sin

import numpy as np
import pytest

from cellmap import ForcedSystem, angle, discrete_map, find_attractors, find_basins, load_basins, save_basins
from cellmap.analysis.resilience import basin_stability
from cellmap.attractors.settling.quotients import quotient_of
from cellmap.basins import continue_basins
from cellmap.exchange import to_xarray
from cellmap.maps import stroboscopic_map
from cellmap.maps.coordinates import difference

N, K = 6, 0.2


def ring_step(x, p):
    """Return a step of phase oscillators on a ring, which turn by the golden mean of a full rotation."""
    return tuple(x[i] + p.w + p.K * (sin(x[i - 1] - x[i]) + sin(x[(i + 1) % N] - x[i])) for i in range(N))


@pytest.fixture(scope="module")
def ring():
    params = {"w": pi * (np.sqrt(5.0) - 1.0), "K": K}
    return discrete_map(ring_step, params, [angle(f"phi{i}") for i in range(N)])


@pytest.fixture(scope="module")
def ring_basins(ring):
    return find_basins(ring, np.random.default_rng(0).uniform(-pi, pi, (300, N)), max_periods=300)


def test_twisted_states_of_a_ring_are_one_attractor_each_whatever_their_common_phase(ring_basins):
    """Of states whose neighbours differ by 2 pi q / 6 those with |q| < 6/4 attract (Wiley, Strogatz, Girvan 2006)."""
    assert len(ring_basins.attractors) == 3
    assert (ring_basins.labels >= 0).all()
    for a in ring_basins.attractors:
        assert a.verified and a.period == 1
        assert np.array_equal(a.symmetry, np.ones((1, N)))
        steps = np.angle(np.exp(1j * (np.roll(a.points[0], -1) - a.points[0])))
        q = round(steps.sum() / (2 * pi))
        assert steps == pytest.approx(np.full(N, 2 * pi * q / N), abs=1e-9)
        growth = 1.0 - 2.0 * K * np.cos(2 * pi * q / N) * (1.0 - np.cos(2 * pi * np.arange(1, N) / N))
        assert np.sort(a.multipliers.real) == pytest.approx(np.sort(growth), abs=1e-9)
    # All shifts of the initial conditions have the same labels.
    shifted = ring_basins.initial_conditions + np.random.default_rng(1).uniform(-pi, pi, (300, 1))
    again = find_basins(ring_basins.point_map, shifted, max_periods=300, attractors=ring_basins.attractors)
    assert np.array_equal(again.labels, ring_basins.labels)
    assert ring_basins.verify(50).wrong == 0


def test_twisted_states_are_continued_over_a_parameter(ring):
    """Each keeps its label and its winding number, and counts are those of basins at each value."""
    states, values = np.random.default_rng(0).uniform(-pi, pi, (100, N)), [K, 0.22]
    swept = continue_basins(ring, "K", values, states, max_periods=300)
    assert len(swept.labels) == 3
    windings = [
        {
            label: round(np.angle(np.exp(1j * (np.roll(a.points[0], -1) - a.points[0]))).sum() / (2 * pi))
            for label, a in found.items()
        }
        for found in swept.attractors
    ]
    assert windings[0] == windings[1]
    for value, counts in zip(values, swept.counts, strict=True):
        alone = find_basins(ring.with_params(K=value), states, max_periods=300)
        assert sorted(np.bincount(alone.labels)) == sorted(counts[:3])


def test_attractors_with_a_symmetry_are_stored_and_label_other_points(ring_basins, tmp_path):
    save_basins(ring_basins, tmp_path / "basins.h5")
    stored = load_basins(tmp_path / "basins.h5")
    table = to_xarray(ring_basins)
    assert table is not None
    for one, other in zip(stored.attractors, ring_basins.attractors, strict=True):
        assert np.array_equal(one.symmetry, other.symmetry)
        assert np.array_equal(one.points, other.points) and one.verified
    stable = basin_stability(
        ring_basins.point_map, lambda rng, n: rng.uniform(-pi, pi, (n, N)), 200, stored.attractors, max_periods=300
    )
    assert stable.undecided == 0
    assert abs(stable.fractions[0].fraction - ring_basins.fractions[0].fraction) < 0.15


def moving(t, x, p):
    """Return a cart whose place does not occur, with a damped pendulum, another oscillator, and a clock of its own."""
    _, v, theta, w, u, s = x
    force = p.a * cos(t) - 0.5 * v
    return v, force, w, -0.3 * w - sin(theta) - force * cos(theta), s, -0.4 * s - u + 0.1 * v


def test_a_coordinate_that_does_not_occur_is_left_out():
    cart = ForcedSystem(moving, {"a": 0.2}, 2 * pi, ("place", "v", angle("theta"), "w", "u", "s"))
    exact = stroboscopic_map(cart)
    points = np.random.default_rng(2).uniform(-1, 1, (40, 6))
    quotient = quotient_of(exact, points)
    assert np.array_equal(quotient.directions, np.eye(6)[:1])
    both = quotient.projected(exact(points)), quotient.point_map(quotient.projected(points))
    assert np.abs(difference(*both, quotient.point_map.coordinates)).max() < 1e-8
    (hanging,) = find_attractors(exact, points, max_periods=300)
    assert hanging.verified and len(hanging.multipliers) == 5 and hanging.points[0, 0] == 0.0
