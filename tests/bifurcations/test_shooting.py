"""Multiple shooting: multipliers known in closed form up to 1e32, and branches that single shooting knows as well."""

from math import cos, exp, pi, sin

import numpy as np
import pytest
from branch_kinds import DOUBLING, LEFT, PITCHFORK
from cases import branch_of

from cellmap import ForcedSystem, periodic_orbit, stroboscopic_map
from cellmap.bifurcations import orbit_continuation, switch_branch
from cellmap.orbits.multipliers import multipliers_of_product
from cellmap.orbits.shooting import ShootingProblem
from systems import driven_pendulum


def in_bases(factors, seed):
    """Return factors of a product in other orthonormal bases, the first of which is the last again."""
    rng, d = np.random.default_rng(seed), len(factors[0])
    bases = [np.linalg.qr(rng.normal(size=(d, d)))[0] for _ in factors]
    return np.array([bases[(k + 1) % len(factors)] @ f @ bases[k].T for k, f in enumerate(factors)])


def test_multipliers_of_very_different_size():
    found = multipliers_of_product(in_bases([np.diag([1e3, -2.0, 1e-3])] * 21, 1))
    np.testing.assert_allclose(found[:2], [1e63, -(2.0**21)], rtol=1e-12)
    # A factor of 1e-3 beside one of 1e3 is known to 1e-10 itself.
    assert found[2].real == pytest.approx(1e-63, rel=1e-8)
    # A complex pair between real multipliers.
    factor = np.diag([1e2, cos(0.1), cos(0.1), 1e-2])
    factor[1, 2], factor[2, 1] = -sin(0.1), sin(0.1)
    found = multipliers_of_product(in_bases([factor] * 10, 2))
    np.testing.assert_allclose(found, [1e20, np.exp(1j), np.exp(-1j), 1e-20], rtol=1e-12)
    assert np.isnan(multipliers_of_product(np.full((2, 2, 2), np.nan))).all()


def growing(t, x, p):
    """The orbit x = cos t, y = 0, with multipliers exp(2 pi rate) and exp(-2 pi)."""
    return p.rate * (x[0] - cos(t)) - sin(t) + x[1] ** 2, -x[1] + 0.3 * x[1] ** 2


@pytest.fixture(scope="module")
def saddle():
    return stroboscopic_map(ForcedSystem(growing, {"rate": 0.2}, 2 * pi, ("x", "y")))


def test_orbits_are_in_segments_before_deviations_become_large(saddle):
    """The multiplier is 286 at the end of one interval, where single steps serve, and 3,533 at that of the other."""
    ends = [branch_of(saddle, [1.0, 0.0], "rate", 0.1, last, step=0.3) for last in (0.9, 1.3)]
    assert [in_segments(branch) for branch in ends] == [False, True]
    place = ends[1]._parts[1].first + 1
    value = float(ends[1].values[place : place + 2].mean())
    (zero,) = ends[1].with_zeros({"here": lambda t, x, p: p.rate - value}).special_points
    assert zero.value == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("most", [1, 2, 3])
def test_the_last_point_of_a_branch_may_be_the_one_from_which_it_is_in_segments(saddle, most):
    branch = branch_of(saddle, [1.0, 0.0], "rate", 0.1, 12.0, step=0.1, max_points=most)
    assert branch.ends == ("left the interval", "most points")


def test_multipliers_up_to_1e32(saddle):
    branch = branch_of(saddle, [1.0, 0.0], "rate", 0.1, 12.0, step=0.1)
    assert branch.ends == LEFT
    np.testing.assert_allclose(branch.points, np.broadcast_to([1.0, 0.0], branch.points.shape), atol=1e-11)
    np.testing.assert_allclose(branch.multipliers[:, 0].real, np.exp(2 * pi * branch.values), rtol=1e-10)
    np.testing.assert_allclose(branch.multipliers[:, 1].real, exp(-2 * pi), rtol=1e-10)
    assert branch.multipliers[-1, 0].real > 1e32
    (orbit,) = branch.orbits_at(11.0)
    assert orbit.multipliers[0].real == pytest.approx(exp(22 * pi), rel=1e-10)
    np.testing.assert_allclose(orbit.points, [[1.0, 0.0]], atol=1e-11)


@pytest.fixture
def pendulum(monkeypatch):
    """Return the pendulum, whose orbits are divided into segments from the beginning."""
    monkeypatch.setattr(orbit_continuation, "LARGEST_GROWTH", 0.0)
    monkeypatch.setattr(orbit_continuation, "DIVISIONS", (3,))
    return stroboscopic_map(driven_pendulum(amplitude=0.003), rtol=1e-12, atol=1e-12)


def in_segments(branch):
    return isinstance(branch._parts[-1].problem, ShootingProblem)


def test_segments_change_no_bifurcation(pendulum):
    upright = branch_of(pendulum, [pi, 0.0], "amplitude", 0.001, 0.014, step=0.1)
    assert in_segments(upright)
    gained, lost = upright.bifurcations
    assert (gained.kind, lost.kind) == (PITCHFORK, DOUBLING)
    assert [1e3 * gained.value, 1e3 * lost.value] == pytest.approx([2.329021135978, 12.542910208], abs=1e-9)
    assert [str(b.normal_form.criticality) for b in (gained, lost) if b.normal_form] == ["subcritical", "supercritical"]
    saddles = switch_branch(upright, gained, 0.001, 0.004, step=0.2)
    (saddle,) = saddles.orbits_at(0.003)
    expected = periodic_orbit(pendulum, [2.1, 0.0])
    np.testing.assert_allclose(np.abs(saddle.points), np.abs(expected.points), rtol=1e-9)
    np.testing.assert_allclose(saddle.multipliers, expected.multipliers, rtol=1e-9)
    swing = switch_branch(upright, lost, 0.012, 0.014, step=0.2)
    assert (swing.period, in_segments(swing)) == (2, True)
    (orbit,) = swing.orbits_at(0.013)
    images = pendulum.with_params(amplitude=0.013).iterate(orbit.points[0], 2).points
    np.testing.assert_allclose(np.mod(images, 2 * pi), np.mod(orbit.points[0], 2 * pi), rtol=1e-8)
