"""The study of period doublings: known limits of stability, symmetry, universality, brute force against branches."""

from __future__ import annotations

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


@pytest.mark.slow
def test_gaps_shrink_by_feigenbaums_ratio(rod: dict[str, Cascade]) -> None:
    found = {**cascade.rod_cascades(8), **{f"weak {k}": v for k, v in cascade.weak_cascades(8).items()}}
    for each in found.values():
        assert each.ratios[-1] == pytest.approx(cascade.FEIGENBAUM, rel=2e-3)
    # The principal resonance (tests/REFERENCES.md).
    assert found["weak hanging"].values[0] == pytest.approx(0.050027335537, abs=1e-12)
    # Rotations are no mirror images of themselves and need no pitchfork.
    assert {b.kind for b in found["weak rotation"].bifurcations} == {DOUBLING}


@pytest.mark.slow
def test_it_runs_quickly(capsys: pytest.CaptureFixture[str]) -> None:
    result = cascade.compute(60, 100, 5)
    cascade.report(result)
    assert "is chaotic from" in capsys.readouterr().out
    # Beyond the swings all orbits rotate; with weak damping they tumble in the end.
    for route, last in ((result.rod, "rotations"), (result.weak, "tumbling")):
        parts = cascade.basin_fractions(route.basins)
        np.testing.assert_allclose(sum(parts.values()), 1.0, rtol=1e-12)
        assert parts[last][-1] == 1.0
    assert not cascade.basin_fractions(result.rod.basins)["tumbling"].any()
    first, gone, most = cascade.chaotic_end(result.end)
    assert result.rod.cascades["hanging"].accumulation < first < gone < result.end.values[-1]
    assert most > 0.0
    assert cascade.draw(result).axes
