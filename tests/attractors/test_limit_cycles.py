"""Limit cycles of autonomous systems: the same ones with the same regions, however often they are sampled."""

from math import exp, pi

import numpy as np
import pytest

from cellmap import CellGrid, ForcedSystem, Label, find_attractors, find_basins, stroboscopic_map
from cellmap.orbits import Kind
from cellmap.orbits.ellipsoids import half_widths


def van_der_pol(t, x, p):
    return x[1], p.mu * (1 - x[0] ** 2) * x[1] - x[0]


def brusselator(t, x, p):
    return 1 + x[0] ** 2 * x[1] - (p.b + 1) * x[0], p.b * x[0] - x[0] ** 2 * x[1]


def roessler(t, x, p):
    return -x[1] - x[2], x[0] + 0.2 * x[1], 0.2 + x[2] * (x[0] - p.c)


def predator(t, x, p):
    return x[0] * (1 - x[0] / p.k - x[1] / (1 + x[0])), x[1] * (x[0] / (1 + x[0]) - 0.5)


def lorenz84(t, x, p):
    return (
        -(x[1] ** 2) - x[2] ** 2 - 0.255 * (x[0] - p.f),
        x[0] * x[1] - x[1] - 4 * x[0] * x[2] + 1.347,
        4 * x[0] * x[1] + x[0] * x[2] - x[2],
    )


def sampled(rhs, time, names="xy", **parameters):
    return stroboscopic_map(ForcedSystem(rhs, parameters, time, tuple(names)))


@pytest.mark.parametrize("time", [0.02, 1.0, 30.0])
def test_multipliers_and_exponents_in_closed_form(time):
    """With r' = r (1 - r^2), three turns in 2 pi: multipliers 1 and exp(-4 pi/3), exponents 0 and -2 in unit time."""

    def turning(t, x, p):
        gain = 1 - x[0] ** 2 - x[1] ** 2
        return gain * x[0] - 3 * x[1], gain * x[1] + 3 * x[0]

    (cycle,) = find_attractors(sampled(turning, time), [[0.3, 0.2]])
    assert cycle.kind is Kind.QUASIPERIODIC and cycle.verified
    assert cycle.circle.cycle_period == pytest.approx(2 * pi / 3, rel=1e-11)
    assert np.abs(cycle.multipliers) == pytest.approx([1.0, exp(-4 * pi / 3)], rel=1e-8)
    assert cycle.exponents == pytest.approx([0.0, -2.0 * time], rel=1e-6)
    assert cycle.circle.frequency == pytest.approx(1.5 * time / pi % 1.0, abs=1e-10)


@pytest.mark.parametrize(
    ("rhs", "parameters", "period"),
    [
        (van_der_pol, {"mu": 6.0}, 13.061874742545),
        pytest.param(brusselator, {"b": 6.0}, 14.862937480, marks=pytest.mark.thorough),
    ],
)
def test_relaxation_oscillations_at_any_sampling_time(rhs, parameters, period):
    """Periods by SciPy's DOP853 with 1e-11 between crossings of a line."""
    found = []
    for time in (0.1, period, 50.0):
        basins = find_basins(sampled(rhs, time, **parameters), CellGrid((0.0, 0.0), (4, 4), (6, 6)))
        (cycle,) = basins.attractors
        assert not (basins.labels == Label.UNDECIDED).any()
        assert cycle.circle.cycle_period == pytest.approx(period, rel=1e-8)
        found.append(cycle.neighbourhood.centres)
    assert all(len(other) == len(found[0]) for other in found)


def test_a_cycle_of_many_periods_of_the_map():
    """At mu = 100 the map is sampled 1,628 times in a cycle, most of which is slow; its period by SciPy's Radau."""
    (cycle,) = find_attractors(sampled(van_der_pol, 0.1, mu=100.0), [[1.0, 0.5]], 200)
    assert cycle.circle.cycle_period == pytest.approx(162.837071, rel=1e-7)


def test_no_region_reaches_across_an_axis_that_orbits_do_not_cross():
    """The prey falls below a hundredth of its greatest number; without it predators die out."""
    basins = find_basins(sampled(predator, 5.0, k=6.0), CellGrid((0.01, 0.01), (6, 4), (8, 8)))
    (cycle,) = basins.attractors
    assert (basins.labels == 0).all()
    region = cycle.neighbourhood
    assert (region.centres - half_widths(region.metrics) > 0.0).all()
    assert region.centres[:, 0].min() < 0.02


def test_before_a_doubling_a_cycle_is_closed_once():
    """Its multiplier is near -1, so that orbits come closest to themselves after two periods: 5.748991 by sections."""
    (cycle,) = find_attractors(sampled(roessler, 1.0, "xyz", c=2.5), [[1.0, 1.0, 0.0]])
    assert cycle.circle.cycle_period == pytest.approx(5.748991, abs=1e-6)
    assert cycle.multipliers[1].real < 0.0


def test_attractors_that_are_handed_in_are_of_the_map():
    cycle = find_attractors(sampled(van_der_pol, 1.0, mu=1.0), [[1.0, 0.0]])
    assert find_attractors(sampled(van_der_pol, 3.0, mu=1.0), [[1.0, 0.0]], attractors=cycle)[0] is cycle[0]
    with pytest.raises(ValueError, match="no attractor of this map"):
        find_attractors(sampled(van_der_pol, 1.0, mu=4.0), [[1.0, 0.0]], attractors=cycle)


@pytest.mark.thorough
def test_three_attractors_of_lorenz_1984():
    """Point .60, chaos .19 and a cycle .21 of the states, as of Attractors.jl; its period 9.2042925 by SciPy."""
    basins = find_basins(sampled(lorenz84, 1.0, "xyz", f=6.886), CellGrid((-1, -1, -1), (1, 1, 1), (12, 12, 12)))
    point, cycle, chaos = basins.attractors
    assert (point.kind, chaos.kind) == (Kind.FIXED_POINT, Kind.CHAOTIC)
    assert cycle.circle.cycle_period == pytest.approx(9.2042925, abs=1e-6)
    fractions = [basins.fractions[k].fraction for k in range(3)]
    assert fractions == pytest.approx([0.60, 0.21, 0.19], abs=0.05)
    assert (basins.labels == Label.UNDECIDED).mean() <= 0.01
