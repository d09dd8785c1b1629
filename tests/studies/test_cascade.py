"""The study of period doublings: known limits of stability, symmetry, universality, brute force against branches."""

from math import pi

import numpy as np
import pytest

from cellmap import stroboscopic_map
from cellmap.bifurcations import BifurcationKind, Cascade
from studies import cascade

DOUBLING, PITCHFORK = BifurcationKind.PERIOD_DOUBLING, BifurcationKind.PITCHFORK


@pytest.fixture(scope="module")
def rod() -> dict[str, Cascade]:
    return cascade.rod_cascades(3)


@pytest.mark.thorough
def test_equilibria_double_where_they_must(rod: dict[str, Cascade]) -> None:
    """To ten digits (tests/REFERENCES.md)."""
    for state, limit in (("hanging", 12.210173235), ("inverted", 12.542910208)):
        assert 1e3 * rod[state].values[0] == pytest.approx(limit, abs=1e-9)
        assert [b.kind for b in rod[state].bifurcations] == [DOUBLING, PITCHFORK, DOUBLING, DOUBLING]


@pytest.mark.thorough
@pytest.mark.parametrize("state", ["hanging", "inverted"])
def test_swings_are_their_own_mirror_image_up_to_the_pitchfork(rod: dict[str, Cascade], state: str) -> None:
    _, symmetric, skew, _ = rod[state].branches
    for branch, mirrored in ((symmetric, True), (skew, False)):
        middle = 0.5 * (branch.values[0] + branch.values[-1])
        first, second = branch.orbits_at(float(middle))[0].points
        # The mirror image has opposite angles and velocities; the inverted state is its own image on the circle.
        apart = np.abs(np.exp(1j * second[0]) - np.exp(-1j * first[0])) + abs(second[1] + first[1])
        assert (apart < 1e-6) == mirrored


def test_what_fractions_count() -> None:
    rod = stroboscopic_map(cascade.ROD)
    initial_conditions = [[0.01, 0.0], [pi - 0.01, 0.0], [3.0, 350.0], [-3.0, -350.0], [-3.0, -350.1]]
    parts = cascade.basin_fractions(cascade.continue_basins(rod, "amplitude", [0.010, 0.012], initial_conditions))
    np.testing.assert_allclose(parts["rest and swings"], [0.4, 0.4])
    np.testing.assert_allclose(parts["rotations"], [0.6, 0.6])
    assert not parts["tumbling"].any()
    assert not parts["undecided"].any()
