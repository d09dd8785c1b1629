"""Multipliers, critical values and maps of stability of equilibria."""

from math import exp, pi, sin

import numpy as np
import pytest
from cases import HANGING, INVERTED, mathieu
from scipy.special import mathieu_a, mathieu_b

from cellmap import ForcedSystem, Status, set_threads, stability_map
from cellmap.bifurcations import Crossing, critical_values, floquet_multipliers
from systems import double_pendulum, driven_pendulum


def _limits(system, state, name, lower, upper, **options):
    found = critical_values(system, state, name, lower, upper, **options)
    return {"at": [c.value for c in found], "through": [c.crossing for c in found], "gains": [c.gains for c in found]}


def test_multipliers_of_the_driven_pendulum():
    """The report's rod at 2 and 3 mm, by SciPy (tests/REFERENCES.md)."""
    result = floquet_multipliers(driven_pendulum(), INVERTED, {"amplitude": [0.002, 0.003]}, rtol=1e-13)
    pair = 0.865837958746 + 0.262783907940j
    expected = [[1.126883285335, 0.726544411238], [pair, pair.conjugate()]]
    assert result.multipliers == pytest.approx(np.array(expected), abs=1e-12)
    assert result.unstable.tolist() == [1, 0]
    assert result.determinant == pytest.approx(exp(-0.2), rel=1e-14)
    assert result.error.max() < 1e-13
    assert "2 parameter points, 1 without" in repr(result)


def test_limits_of_the_driven_pendulum():
    inverted = _limits(driven_pendulum(), INVERTED, "amplitude", 1e-4, 0.11)
    assert inverted["at"][:2] == pytest.approx([2.329021135978e-3, 12.542910208e-3], rel=1e-10)
    assert inverted["at"][0] == pytest.approx(2.329021135978e-3, rel=1e-12)
    assert inverted["through"] == [Crossing.PLUS_ONE, Crossing.MINUS_ONE, Crossing.MINUS_ONE, Crossing.PLUS_ONE]
    assert inverted["gains"] == [True, False, True, False]
    # Stability comes back near 103 mm, in a window of 0.9 mm.
    assert inverted["at"][2] == pytest.approx(0.103, abs=1e-3)
    assert inverted["at"][3] - inverted["at"][2] == pytest.approx(0.9e-3, abs=1e-5)
    hanging = _limits(driven_pendulum(), HANGING, "amplitude", 1e-4, 0.02)
    assert hanging["at"] == pytest.approx([12.210173235e-3], rel=1e-10)
    undamped = critical_values(driven_pendulum(damping=0.0), INVERTED, "amplitude", 1e-4, 0.012)
    assert [c.value for c in undamped] == pytest.approx([2.327849487651e-3], rel=1e-12)


def test_principal_resonance():
    (lost,) = critical_values(mathieu(gamma=0.05), HANGING, "beta", 0.0, 0.2)
    assert lost.value == pytest.approx(0.050027335537, abs=1e-12)
    assert (lost.crossing, lost.below, lost.above, lost.loses) == (Crossing.MINUS_ONE, 0, 1, True)


def test_curves_are_those_of_mathieu():
    """Every characteristic value, in tongues that are down to 1e-5 wide."""
    plane = stability_map(mathieu(), HANGING, ("alpha", np.linspace(-0.4, 2.6, 60)), ("beta", [0.05, 0.3, 0.5, 1.0]))
    for beta in plane.y:
        row = plane.rows.y == beta
        known = [mathieu_a(k, 2.0 * beta) / 4.0 for k in range(5)]
        known += [mathieu_b(k, 2.0 * beta) / 4.0 for k in range(1, 5)]
        inside = sorted(v for v in known if -0.4 < v < 2.6)
        assert plane.rows.x[row] == pytest.approx(inside, abs=1e-11 if beta > 0.1 else 1e-10)
    # Of solutions of the period 2 pi the multiplier is +1, of those of twice the period -1.
    first = plane.rows.crossing[plane.rows.y == 0.3]
    assert first.tolist() == [0, 1, 1, 0, 0, 1, 1]
    for alpha, beta in zip(plane.columns.x, plane.columns.y, strict=True):
        values = [mathieu_a(k, 2.0 * beta) / 4.0 for k in range(5)] + [
            mathieu_b(k, 2.0 * beta) / 4 for k in range(1, 5)
        ]
        assert np.abs(np.array(values) - alpha).min() < 1e-10
    assert plane.unstable.shape == plane.largest.shape == (4, 60)
    assert np.array_equal(plane.unstable > 0, plane.largest > 1.0 + 1e-8)
    assert not plane.status.any()


def test_neimark_sacker_of_the_double_pendulum():
    found = critical_values(double_pendulum(), (0.0, pi, 0.0, 0.0), "amplitude", 0.006, 0.02)
    assert [c.value for c in found] == pytest.approx([12.532158062e-3], rel=1e-10)
    assert (found[0].crossing, found[0].below, found[0].above) == (Crossing.NEIMARK_SACKER, 0, 2)


@pytest.mark.thorough
def test_fast_drives_without_cancellation():
    """A w fixed: slow frequencies are those of Hill's determinant, by mpmath in 40 digits; the trace is nearly 2."""
    frequencies = np.array([500.0, 5e3, 5e4])
    swept = {"frequency": frequencies, "amplitude": 0.15 / frequencies}
    result = floquet_multipliers(driven_pendulum(damping=0.0), INVERTED, swept, rtol=1e-13)
    slow = np.angle(result.multipliers[:, 0]) * frequencies / (2.0 * pi)
    assert slow == pytest.approx([2.46582720951445, 2.46569271571222, 2.46569137090865], rel=1e-11)
    assert slow[2] == pytest.approx(2.465691357, rel=1e-8)  # Kapitza's
    # Least amplitude: 4 alpha = a_0(q) = -q^2/2 + 7 q^4/128 - ..., alpha = -g/(l w^2), q = 2 A/l.
    system = driven_pendulum(damping=0.0, frequency=5e4)
    (gained,) = critical_values(system, INVERTED, "amplitude", 1e-6, 4e-6)
    square = 8.0 * 9.8 / 0.0272 / (1e5 * pi) ** 2
    assert gained.value == pytest.approx(0.5 * 0.0272 * np.sqrt(square * (1.0 + 7.0 * square / 64.0)), rel=1e-11)


def test_a_map_is_what_its_parts_are():
    system = driven_pendulum()
    frequencies, amplitudes = np.linspace(30.0, 60.0, 7), np.linspace(0.001, 0.015, 9)
    plane = stability_map(system, INVERTED, ("frequency", frequencies), ("amplitude", amplitudes), progress=True)
    swept = {"frequency": frequencies, "amplitude": amplitudes[:, None]}
    result = floquet_multipliers(system, INVERTED, swept, rtol=1e-13)
    assert np.array_equal(plane.unstable, result.unstable)
    assert plane.largest == pytest.approx(result.largest, rel=1e-12)
    for frequency in frequencies:
        alone = _limits(system.with_params(frequency=frequency), INVERTED, "amplitude", 0.001, 0.015)
        here = plane.columns.x == frequency
        assert plane.columns.y[here] == pytest.approx(alone["at"], rel=1e-11)
        assert plane.columns.crossing[here].tolist() == alone["through"]
    assert "frequency x amplitude: 7 x 9" in repr(plane)
    assert len(plane.columns) == 14
    assert repr(plane.columns) == "Boundary(7 PLUS_ONE, 7 MINUS_ONE)"


def test_threads_change_no_bit():
    swept = {"beta": np.linspace(0.0, 1.0, 9000)}
    results = []
    for threads in (1, 3):
        set_threads(threads)
        results.append(floquet_multipliers(mathieu(gamma=0.05), HANGING, swept))
    set_threads(None)
    assert np.array_equal(results[0].monodromy, results[1].monodromy)
    # Nor does the company of a point.
    alone = floquet_multipliers(mathieu(gamma=0.05), HANGING, {"beta": swept["beta"][[0, 4321, 8999]]})
    assert np.array_equal(alone.monodromy, results[0].monodromy[[0, 4321, 8999]])


def test_shapes_and_points_without_a_matrix():
    system = mathieu(gamma=0.05)
    assert floquet_multipliers(system, HANGING).multipliers.shape == (2,)
    assert floquet_multipliers(system, HANGING, {"beta": np.empty((0, 3))}).multipliers.shape == (0, 3, 2)
    result = floquet_multipliers(system, HANGING, {"alpha": [0.1, -1e6], "beta": [[0.1], [0.2], [0.3]]})
    assert result.monodromy.shape == (3, 2, 2, 2)
    assert (result.status == [Status.OK, Status.DIVERGED]).all()
    assert np.isnan(result.multipliers[:, 1]).all()
    assert (result.unstable[:, 1] == -1).all()


def test_two_real_multipliers_that_cross_together_are_no_pair():
    system = ForcedSystem(lambda t, x, p: (p.q * x[0], (p.q + 0.1 * sin(t)) * x[1]), {"q": 0.1}, 2 * pi, ("x", "y"))
    (lost,) = critical_values(system, [0.0, 0.0], "q", -0.13, 0.2)
    assert lost.value == pytest.approx(0.0, abs=1e-11)
    assert (lost.crossing, lost.below, lost.above) == (Crossing.PLUS_ONE, 0, 2)
