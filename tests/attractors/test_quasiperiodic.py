"""Quasi-periodic attractors: invariant curves, rotation numbers, limit cycles of autonomous systems."""

from math import cos, pi, sin

import matplotlib as mpl
import numpy as np
import pytest
from scipy.spatial import cKDTree

from cellmap import (
    CellGrid,
    ForcedSystem,
    Label,
    angle,
    discrete_map,
    find_attractors,
    find_basins,
    plot,
    stroboscopic_map,
)
from cellmap.attractors import continue_attractors
from cellmap.basins import continue_basins
from cellmap.maps import flow_map
from cellmap.orbits import Kind

mpl.use("Agg")


def delayed_logistic(x, p):
    return p.a * x[0] * (1 - x[1]), x[0]


def van_der_pol(t, x, p):
    return x[1], p.mu * (1 - x[0] ** 2) * x[1] - x[0] + p.force * cos(p.omega * t)


def sine_circle(x, p):
    """Circle map of Arnold with a contracting coordinate."""
    return x[0] + p.shift - p.k / (2 * pi) * sin(2 * pi * x[0]), 0.5 * x[1] + 0.2 * cos(2 * pi * x[0])


LOGISTIC = discrete_map(delayed_logistic, {"a": 2.1}, ("x", "y"))
UNIT = CellGrid((0, 0), (1, 1), (40, 40))
VAN_DER_POL = ForcedSystem(van_der_pol, {"mu": 1.0, "force": 0.0, "omega": 1.6}, lambda p: 2 * pi / p.omega, ("x", "v"))
VAN_DER_POL_PERIOD = 6.6632868593231301897
"""At mu = 1, to 20 digits: Amore, Boyd, Fernandez, Physics Letters A 382 (2018) 3293 (and others before)."""
CIRCLE = discrete_map(sine_circle, {"shift": 0.6, "k": 0.9}, (angle("u", period=1.0), "r"))
STRIP = CellGrid((-0.5, -1), (0.5, 1), (12, 12))


def rotations_about_the_fixed_point(a: float, periods: int) -> np.ndarray:
    """Turns of the delayed logistic map's orbit about its fixed point, step by step, in plain Python."""
    x = y = 1 - 1 / a + 0.1
    centre, angles = 1 - 1 / a, []
    for n in range(periods + 2000):
        x, y = a * x * (1 - y), x
        if n >= 2000:
            angles.append(np.arctan2(y - centre, x - centre))
    steps = np.diff(angles) / (2 * pi)
    return steps - np.round(steps)


@pytest.fixture(scope="module")
def logistic_basins():
    return find_basins(LOGISTIC, UNIT)


# --- invariant curves


def test_rotation_number_of_the_delayed_logistic_map(logistic_basins):
    """To 8 digits, against the turns of a long orbit: their weighted mean, and the plain one, whose error is 1/n."""
    (attractor,) = logistic_basins.attractors
    assert attractor.kind is Kind.QUASIPERIODIC
    steps = rotations_about_the_fixed_point(2.1, 30_000)
    t = np.arange(1, len(steps) + 1) / (len(steps) + 1)
    weights = np.exp(-1 / (t * (1 - t)))
    witness = abs(weights @ steps / weights.sum())
    assert abs(abs(steps.mean()) - witness) < 1 / len(steps)
    frequency = attractor.circle.frequency
    assert min(abs(frequency - witness), abs(1 - frequency - witness)) < 1e-9 * witness
    assert attractor.circle.frequency_error < 1e-10


@pytest.mark.parametrize("a", [2.02, 2.1, 2.15])
def test_nothing_undecided_on_invariant_curves(a):
    """Beyond its Neimark-Sacker bifurcation at a = 2 every bounded orbit comes to the curve."""
    basins = find_basins(LOGISTIC.with_params(a=a), UNIT)
    assert [b.kind for b in basins.attractors] == [Kind.QUASIPERIODIC]
    assert not (basins.labels == Label.UNDECIDED).any()
    exponents = basins.attractors[0].exponents
    assert abs(exponents[0]) < 0.01
    assert exponents[1] < -0.01


# --- what is not quasi-periodic


@pytest.mark.thorough
def test_a_torus_whose_tube_does_not_cover_it_all_is_found_once():
    """Close to its tongue orbits are slow in one place; late points of orbits from four corners lie on one curve."""
    point_map = stroboscopic_map(VAN_DER_POL.with_params(force=1.0, omega=1.2), rtol=1e-6, atol=1e-6)
    basins = find_basins(point_map, CellGrid((-3, -3), (3, 3), (12, 12)), max_periods=500)
    (torus,) = basins.attractors
    assert torus.kind is Kind.QUASIPERIODIC
    assert (basins.labels == 0).all()
    late = [point_map.orbit([q, v], 2000).points[200:] for q in (-2.75, 2.75) for v in (-2.75, 2.75)]
    for points in late[1:]:
        assert cKDTree(late[0]).query(points)[0].max() < 0.1


def shift_of_cycle(rotations: int, period: int) -> float:
    """The parameter at which the critical circle map has a superstable cycle, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle, u = 0.5 * (low + high), 0.0
        for _ in range(period):
            u += middle - sin(2 * pi * u) / (2 * pi)
        low, high = (middle, high) if u < rotations else (low, middle)
    return middle


@pytest.mark.parametrize(("rotations", "period"), [(5, 8), (21, 89), pytest.param(13, 200, marks=pytest.mark.thorough)])
def test_locked_cycles_are_periodic(rotations, period):
    """Superstable cycles of the critical circle map, longer than the periods that are tried first."""
    locked = CIRCLE.with_params(shift=shift_of_cycle(rotations, period), k=1.0)
    (attractor,) = find_attractors(locked, [[0.1, 0.2], [0.3, -0.5]])
    assert (attractor.kind, attractor.period, attractor.rotations[0]) == (Kind.ROTATING, period, rotations)


def test_between_tongues_it_is_quasi_periodic():
    """An irrational rotation number, that of a long orbit."""
    (attractor,) = find_attractors(CIRCLE.with_params(shift=0.6066), [[0.1, 0.2]])
    steps, u = [], 0.1
    for _ in range(20_000):
        steps.append(0.6066 - 0.9 / (2 * pi) * sin(2 * pi * u))
        u += steps[-1]
    t = np.arange(1, len(steps) + 1) / (len(steps) + 1)
    weights = np.exp(-1 / (t * (1 - t)))
    assert attractor.rotation_number[0] == pytest.approx(weights @ np.array(steps) / weights.sum(), abs=1e-9)
    assert attractor.rotation_number[1] == 0.0


@pytest.mark.parametrize(
    "rule",
    [
        lambda x, p: (x[0] + x[1] + 0.5 * sin(x[0]), x[1] + 0.5 * sin(x[0])),  # islands, which attract nothing
        lambda x, p: (0.99999 * (0.6 * x[0] - 0.8 * x[1]), 0.99999 * (0.8 * x[0] + 0.6 * x[1])),  # a slow spiral
    ],
    ids=["conservative", "slow"],
)
def test_curves_that_do_not_attract(rule):
    """No attractor of this kind where orbits stay on curves of their own, or creep inwards."""
    found = find_attractors(discrete_map(rule, {}, ("x", "y")), [[0.5, 0.3], [-0.3, 0.9]], max_periods=300)
    assert all(a.kind is not Kind.QUASIPERIODIC for a in found)


# --- limit cycles of autonomous systems


@pytest.mark.parametrize("step", [2 * pi, VAN_DER_POL_PERIOD, VAN_DER_POL_PERIOD / 3, 5 * VAN_DER_POL_PERIOD / 7])
def test_limit_cycle_under_any_sampling_time(step):
    """The same cycle and its true period, also where the samples close after one, three or seven steps."""
    (attractor,) = find_basins(flow_map(VAN_DER_POL, step), CellGrid((-3, -4), (3, 4), (10, 10))).attractors
    assert attractor.kind is Kind.QUASIPERIODIC
    assert attractor.circle.cycle_period == pytest.approx(VAN_DER_POL_PERIOD, rel=1e-8)


# --- everything around


def test_followed_over_parameters(logistic_basins):
    """From one parameter to the next, by itself and with its basin; beyond a = 2 there is no such attractor."""
    (now,) = continue_attractors(LOGISTIC.with_params(a=2.11), logistic_basins.attractors)
    again = find_attractors(LOGISTIC.with_params(a=2.11), [[0.5, 0.4]])[0]
    assert now.circle.frequency == pytest.approx(again.circle.frequency, abs=1e-9)
    assert continue_attractors(LOGISTIC.with_params(a=1.95), logistic_basins.attractors) == ()
    followed = continue_basins(LOGISTIC, "a", [2.1, 2.11, 2.12], CellGrid((0, 0), (1, 1), (12, 12)))
    assert [list(a) for a in followed.attractors] == [[0]] * 3
    assert plot.draw(followed) is not None


# --- near resonances


def cogging(t, x, p):
    return x[1], p.torque - 0.05 * x[1] - 0.4 * sin(6 * x[0]) + 0.2 * cos(2 * t)


COGGING = ForcedSystem(cogging, {"torque": 0.15}, pi, (angle("theta"), "w"))


@pytest.mark.thorough
def test_a_resonance_that_is_too_close_is_named_and_the_remedy_helps() -> None:
    point_map = stroboscopic_map(COGGING.with_params(torque=0.150004))
    with pytest.warns(UserWarning, match=r"close to a resonance, 3/2 \(1.49999\d* full .* change a parameter a little"):
        basins = find_basins(point_map, [[0.1, 3.0]])
    assert basins.attractors == ()
    assert find_attractors(point_map.with_params(torque=0.15002), [[0.1, 3.0]])[0].kind is Kind.QUASIPERIODIC


@pytest.mark.parametrize("shift", [0.5, 0.5003])
def test_a_locked_circle_is_periodic_however_slowly_orbits_come_to_rest(shift: float) -> None:
    """At k = 0.1 the tongue of 1/2 reaches to 0.50040: its half-width is about k^2/(8 pi)."""
    (cycle,) = find_basins(CIRCLE.with_params(shift=shift, k=0.1), STRIP).attractors
    assert (cycle.kind, cycle.period) == (Kind.ROTATING, 2)


def ring(x, p):
    """A rotation whose invariant circle has waves, and attracts by a factor each step."""
    turned = x[0] + 2 * pi * p.turns
    return turned, p.factor * (x[1] - cos(p.waves * x[0])) + cos(p.waves * turned)


@pytest.mark.parametrize(("factor", "waves"), [(0.998, 1), (0.5, 30)], ids=["slow", "bent"])
def test_circles_to_which_orbits_come_slowly_or_that_bend_sharply(factor: float, waves: int) -> None:
    """Closed form: rotation number (sqrt(5) - 1) / 2, exponents whose sum is log(factor)."""
    turns = (5**0.5 - 1) / 2
    point_map = discrete_map(ring, {"turns": turns, "factor": factor, "waves": waves}, (angle("u"), "r"))
    (found,) = find_attractors(point_map, [[0.0, 1.1], [2.0, -0.9]], max_periods=3000)
    assert found.kind is Kind.QUASIPERIODIC and found.verified
    assert found.circle is not None and abs(found.circle.frequency - turns) < 1e-9
    assert abs(found.exponents.sum() - np.log(factor)) < 1e-9
