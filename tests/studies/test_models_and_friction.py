"""Small runs of the studies of figures 5, 6, 11 and 13 of the report."""

from __future__ import annotations

from math import asin, pi

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest

from studies import figure_5, figure_11, figure_13
from studies._dry_friction import resting_bound, turning_angles
from systems import SHORT_ROD

mpl.use("Agg")


def test_models_after_one_period():
    """Two independent programs agree on these states (tests/REFERENCES.md)."""
    result = figure_5.compute(1)
    for name, found in result.items():
        assert found.after == pytest.approx(figure_5.AFTER[name], abs=5e-12)
        assert len(figure_5.draw(found, name).axes) == 6
    assert result["double"].lengths == pytest.approx(0.032)
    plt.close("all")


def test_halts_of_a_harmonic_swing_are_those_of_coulomb_friction():
    """Small swings lose 2 friction l/g from one halt to the next, and end within friction l/g."""
    loss = 2e-6
    friction = loss * 9.8 / (2 * SHORT_ROD)
    found = turning_angles(10.5e-6, friction, SHORT_ROD)
    assert found == pytest.approx(np.array([10.5, -8.5, 6.5, -4.5, 2.5, -0.5]) * 1e-6, rel=1e-6)


def test_bounds_of_rest():
    """Of the rod of figure 19 at 3 mm, with 10 rad/s^2 (tests/REFERENCES.md)."""
    assert resting_bound(10.0, 0.0272, 0.003 * (100 * pi) ** 2) == pytest.approx(0.000889214, abs=5e-10)
    assert resting_bound(2.5, SHORT_ROD) == asin(2.5 * SHORT_ROD / 9.8)


def test_rods_settle_beside_the_vertical():
    result = figure_11.compute(12, 250)
    np.testing.assert_allclose(result.rest, result.by_energy, atol=1e-9)
    assert result.known.bound == pytest.approx(figure_11.KNOWN[0], abs=5e-10)
    assert result.known.cycle == pytest.approx(figure_11.KNOWN[1], abs=5e-9)
    assert np.abs(result.known.ends[~result.known.moving]).max(initial=0.0) <= result.known.bound
    assert len(figure_11.draw(result).axes) == 2
    plt.close("all")


def test_the_short_rod_halts_where_its_energy_says():
    result = figure_13.compute(14.0)
    *dry, viscous = result.values()
    for found in dry:
        np.testing.assert_allclose(found.halts, found.by_energy, atol=2e-6)
        assert (np.diff(found.times) > 0).all()
    assert viscous.motion.states[-1, 1] != 0
    assert len(figure_13.draw(result).axes) == 3
    plt.close("all")
