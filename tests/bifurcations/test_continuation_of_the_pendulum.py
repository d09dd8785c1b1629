"""Continuation of periodic orbits of the driven pendulum and other oscillators."""

from __future__ import annotations

from math import cos, pi
from typing import Any

import numpy as np
import pytest
from branch_kinds import DOUBLING, FOLD, NEIMARK_SACKER, PITCHFORK, kinds

from cellmap import (
    CellGrid,
    ForcedSystem,
    PointMap,
    continue_orbit,
    find_attractors,
    find_periodic_orbits,
    periodic_orbit,
    stroboscopic_map,
)
from cellmap.bifurcations import Branch, continue_bifurcation, critical_values, period_doubling_cascade, switch_branch
from systems import double_pendulum, driven_pendulum


def test_the_inverted_state(inverted: Branch) -> None:
    gained, lost = inverted.bifurcations
    assert (gained.kind, lost.kind) == (PITCHFORK, DOUBLING)
    assert 1e3 * gained.value == pytest.approx(2.329021135978, abs=1e-9)
    assert 1e3 * lost.value == pytest.approx(12.542910208, abs=1e-9)
    np.testing.assert_allclose(np.abs(inverted.points[:, 0]), pi, atol=1e-10)


def test_rotations_are_born_in_a_fold(pendulum: PointMap) -> None:
    for sign in (1.0, -1.0):
        rotation = periodic_orbit(pendulum, [sign * 2.52, sign * 320.4])
        branch = continue_orbit(pendulum, rotation, "amplitude", 0.001, 0.006)
        (fold,) = branch.bifurcations
        assert fold.kind is FOLD
        assert 1e3 * fold.value == pytest.approx(1.731758671939, abs=1e-9)
        saddle, focus = branch.orbits_at(0.003)
        assert (saddle.name, focus.name) == ("saddle", "stable focus")
        np.testing.assert_allclose(
            focus.points[0] / [1.0, 100 * pi], [sign * 2.520339579944, sign * 1.019933227842], rtol=1e-10
        )


def test_the_critical_angle_is_a_branch_of_saddles(pendulum: PointMap, inverted: Branch) -> None:
    arm = switch_branch(inverted, inverted.bifurcations[0], 0.001, 0.005)
    (saddle,) = arm.orbits_at(0.003)
    found = find_periodic_orbits(pendulum, CellGrid((1.5, -50.0), (3.0, 50.0), (30, 30)))
    assert saddle.kind == "saddle"
    place = saddle.points[0] * np.sign(saddle.points[0, 0])
    assert any(np.allclose(place, o.points[0], rtol=1e-9) for o in found)


def test_curves_of_the_inverted_state_are_those_of_floquet(inverted: Branch) -> None:
    for bifurcation in inverted.bifurcations:
        curve = continue_bifurcation(inverted, bifurcation, "frequency", (0.0005, 0.05), (20.0, 100.0), step=0.05)
        for amplitude, frequency in curve.values[:: max(1, len(curve.values) // 6)]:
            system = driven_pendulum(frequency=frequency)
            (expected,) = critical_values(system, [pi, 0.0], "amplitude", 0.9 * amplitude, 1.1 * amplitude)
            assert amplitude == pytest.approx(expected.value, rel=1e-10)


def test_symmetric_orbits_lose_their_symmetry_before_they_double(pendulum: PointMap) -> None:
    hanging = periodic_orbit(pendulum, [0.1, 0.0])
    cascade = period_doubling_cascade(pendulum, hanging, "amplitude", 0.016, doublings=4)
    assert [b.kind for b in cascade.bifurcations] == [DOUBLING, PITCHFORK, DOUBLING, DOUBLING, DOUBLING]
    assert 1e3 * cascade.values[0] == pytest.approx(12.210173235, abs=1e-9)
    # What the branches say is what orbits do: a little before the last doubling the attractor has half its period.
    value = cascade.values[2] + 0.3 * (cascade.values[3] - cascade.values[2])
    exact = pendulum.with_params(amplitude=float(value))
    (orbit,) = cascade.branches[-1].orbits_at(float(value))
    attractors = find_attractors(exact, orbit.points[:1] + np.array([1e-6, 0.0]))
    assert attractors[0].period == cascade.periods[2] == 8


def test_the_swing_of_period_four_loses_its_symmetry(pendulum: PointMap) -> None:
    """At 10.637657006 mm, by an independent program: one multiplier is 1 there, and the swing its own mirror image."""
    at_ten = pendulum.with_params(amplitude=0.010)
    branch = continue_orbit(at_ten, periodic_orbit(at_ten, [0.536, -10.731], 4), "amplitude", 0.0099, 0.0108, step=0.1)
    (pitchfork,) = branch.bifurcations
    assert (pitchfork.kind, pitchfork.before, pitchfork.after) == (PITCHFORK, 0, 1)
    assert 1e3 * pitchfork.value == pytest.approx(10.637657006, abs=1e-9)
    points = branch.orbits_at(0.0105)[0].points
    np.testing.assert_allclose(points[2:], -points[:2], atol=1e-9 * np.abs(points).max())


def test_a_fold_of_the_duffing_oscillator() -> None:
    # Weak damping and drive: amplitudes from harmonic balance with two harmonics are near; the folds are those between
    # which two responses are found by direct search.
    def rhs(t: float, x: Any, p: Any) -> tuple[float, float]:
        q, v = x
        return v, -q - 0.05 * q**3 - 0.2 * v + 2.5 * cos(p.omega * t)

    system = ForcedSystem(rhs, {"omega": 1.0}, lambda p: 2 * pi / p.omega, ("q", "v"))
    exact = stroboscopic_map(system, rtol=1e-12, atol=1e-12)
    branch = continue_orbit(exact, periodic_orbit(exact, [2.0, 4.0]), "omega", 0.8, 2.5)
    upper, lower = branch.bifurcations
    assert kinds(branch) == [FOLD, FOLD]
    assert lower.value < upper.value
    for value, count in (
        (lower.value - 1e-4, 1),
        (lower.value + 1e-4, 3),
        (upper.value - 1e-4, 3),
        (upper.value + 1e-4, 1),
    ):
        assert len(branch.orbits_at(value)) == count
        window = CellGrid((-9.0, -16.0), (9.0, 16.0), (80, 80))
        assert len(find_periodic_orbits(exact.with_params(omega=value), window)) == count


@pytest.mark.slow
def test_neimark_sacker_of_the_double_pendulum() -> None:
    exact = stroboscopic_map(double_pendulum(), rtol=1e-12, atol=1e-12)
    state = periodic_orbit(exact, [0.0, pi, 0.0, 0.0])
    branch = continue_orbit(exact, state, "amplitude", 0.005, 0.0128)
    (found,) = branch.of_kind(NEIMARK_SACKER)
    assert 1e3 * found.value == pytest.approx(12.532158062, abs=1e-9)
    assert (found.before, found.after) == (0, 2)
