"""Basin stability and settling times, and the intervals of both."""

from dataclasses import replace
from math import log2, pi, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.stats import binomtest

from cellmap import Basins, CellGrid, PointMap, discrete_map, find_basins, plot
from cellmap.analysis import binomial_interval
from cellmap.analysis.resilience import (
    FatalShock,
    basin_stability,
    largest_ball,
    local_integrity,
    settling_statistics,
    tipping_probabilities,
)
from cellmap.basins import finding
from cellmap.basins.label_file import OnDisk

# --- binomial intervals


@pytest.mark.parametrize(("name", "theirs"), [("exact", "exact"), ("Wilson", "wilson")])
@pytest.mark.parametrize(("k", "n"), [(0, 1), (0, 50), (7, 50), (50, 50), (481, 1000)])
def test_intervals_are_those_of_scipy(name: str, theirs: str, k: int, n: int) -> None:
    expected = binomtest(k, n).proportion_ci(0.99, method=theirs)
    low, high = binomial_interval(k, n, 0.99, name)
    assert (float(low), float(high)) == pytest.approx((expected.low, expected.high), abs=1e-12)
    assert [float(v) for v in binomial_interval(0, 0, method=name)] == [0.0, 1.0]


# --- basin stability


def test_intervals_cover_a_known_fraction_as_often_as_they_say(cubic: PointMap, line: Basins) -> None:
    """Of [-0.5, 1.5] three quarters belong to the right basin; 95 % of 200 intervals is 190 +- 3.1."""
    window = CellGrid((-0.5,), (1.5,), (1,))
    hits = 0
    for seed in range(200):
        right = basin_stability(line, window, n_samples=100, rng=seed).fractions[0]
        hits += right.low <= 0.75 <= right.high
    assert hits >= 184


def test_undecided_states_belong_to_no_basin_and_widen_the_intervals(line: Basins) -> None:
    window = CellGrid((-0.5,), (1.5,), (1,))
    hasty = basin_stability(line, window, n_samples=4000, max_periods=6)
    assert hasty.undecided > 50
    assert sum(s.count for s in hasty.fractions.values()) == 4000
    assert hasty.fractions[-3].count == hasty.undecided
    assert hasty.fractions[0].low < 0.75 < hasty.fractions[0].high
    patient = basin_stability(line, window, n_samples=4000)
    assert patient.undecided == 0
    assert -3 not in patient.fractions
    width = [b.fractions[0].high - b.fractions[0].low for b in (hasty, patient)]
    assert width[0] > width[1] + 0.9 * hasty.undecided / 4000


def test_states_that_diverge_have_a_fraction_of_their_own(disc: Basins) -> None:
    found = basin_stability(disc, n_samples=20_000, rng=1)
    assert found.fractions[0].low < pi / 9.0 < found.fractions[0].high
    assert found.fractions[-2].count + found.fractions[0].count == 20_000


# --- settling times


def test_settling_times_of_a_linear_map() -> None:
    """From x the neighbourhood of half-width r about 0 is reached in the first k with |x| / 2^k <= r."""
    half = discrete_map(lambda x, p: (0.5 * x[0],), {}, ("x",))
    basins = find_basins(half, CellGrid((-64.0,), (64.0,), (1000,)))
    neighbourhood = basins.attractors[0].neighbourhood
    assert neighbourhood is not None
    reach = 1.0 / sqrt(neighbourhood.metrics[0, 0, 0])
    assert basins.grid is not None
    known = np.array([max(0, int(np.ceil(log2(abs(x) / reach)))) for x in basins.grid.axis(0)])
    found = settling_statistics(basins, levels=(0.0, 0.5, 1.0)).basins[0]
    assert found.count == 1000
    assert found.mean == pytest.approx(known.mean())
    assert found.standard_error == pytest.approx(known.std(ddof=1) / sqrt(1000))
    assert found.quantiles.tolist() == [known.min(), np.sort(known)[499], known.max()]
    assert found.times.tolist() == np.bincount(known).tolist()


def test_initial_conditions_that_do_not_settle_are_kept_apart(line: Basins) -> None:
    labels, times = line.labels.copy(), line.settling_time.copy()
    labels[:10], labels[10:14], labels[14:15] = -3, -2, -1
    times[:15] = -1
    found = settling_statistics(replace(line, labels=labels, settling_time=times))
    assert found.undecided == 10
    assert {name: count for name, count in found.others.items() if count} == {
        "escaped": 1,
        "diverged": 4,
        "undecided": 10,
    }
    assert sum(s.count for s in found.basins.values()) == 285
    assert min(s.quantiles.min() for s in found.basins.values()) >= 0.0


# --- checkpoints and clusters


def same(one, other):
    assert np.array_equal(one.labels, other.labels)
    assert np.array_equal(one.settling_time, other.settling_time)
    assert [vars(s) for s in one.fractions.values()] == [vars(s) for s in other.fractions.values()]


def test_a_run_that_is_interrupted_goes_on(line, tmp_path, monkeypatch):
    window = CellGrid((-2.5,), (2.5,), (1,))
    whole = basin_stability(line, window, 40_000)
    # Beyond sqrt(5) orbits diverge.
    assert whole.fractions[-2].fraction == pytest.approx(
        1.0 - np.sqrt(5.0) / 2.5, abs=4 * whole.fractions[-2].standard_error
    )
    put, done = OnDisk.put, []

    def stopped(self, number, rows, settled):
        if done:
            raise KeyboardInterrupt
        done.append(number)
        put(self, number, rows, settled)

    with monkeypatch.context() as patched:
        patched.setattr(OnDisk, "put", stopped)
        with pytest.raises(KeyboardInterrupt):
            basin_stability(line, window, 40_000, checkpoint=tmp_path / "run.h5")
    left = []
    again = OnDisk.put

    def counted(self, number, rows, settled):
        left.append(number)
        again(self, number, rows, settled)

    monkeypatch.setattr(OnDisk, "put", counted)
    same(basin_stability(line, window, 40_000, checkpoint=tmp_path / "run.h5"), whole)
    assert len(left) == 2  # of three tiles
    monkeypatch.setattr(finding, "Run", None)  # the file has it all
    same(basin_stability(line, window, 40_000, checkpoint=tmp_path / "run.h5"), whole)


# --- figures and summaries


def full_rotations_off(apart: Any, basins: Basins) -> Any:
    for j, c in enumerate(basins.coordinates):
        if c.period is not None:
            apart[:, j] -= c.period * np.round(apart[:, j] / c.period)
    return apart


def test_figures(disc: Basins, pendulum: Basins, line: Basins, shocks: list[FatalShock]) -> None:
    assert len(plot.basin_stability(basin_stability(disc, n_samples=50)).patches) == 2
    assert len(plot.settling_times(settling_statistics(pendulum)).get_lines()) == 4
    for ball, basins in ((local_integrity(pendulum, 1, refine=False), pendulum), (largest_ball(disc, 0), disc)):
        lines = [line.get_xydata() for line in plot.ball(ball, basins=basins).get_lines()]
        circles = [line[np.isfinite(line).all(axis=1)] - ball.centre for line in lines if len(line) > 300]
        away = [np.hypot(*(full_rotations_off(d, basins) / ball.scale).T) for d in circles]
        assert any(np.allclose(d, ball.radius, rtol=1e-6) for d in away)
        assert any(np.allclose(line, ball.centre) for line in lines)
    ax = plot.fatal_shock(shocks[1], basins=pendulum)
    (cross,) = (line for line in ax.get_lines() if line.get_marker() == "X")
    assert cross.get_xydata()[0] == pytest.approx(shocks[1].end)
    assert ax.get_xlim() == pytest.approx((-pi, pi))
    assert plot.tipping(tipping_probabilities(line, line)).get_ylabel() == "before"
    solid = find_basins(
        discrete_map(lambda x, p: tuple(v / 2 for v in x), {}, ("x", "y", "z")),
        CellGrid((-1.3,) * 3, (1.3,) * 3, (6,) * 3),
    )
    with pytest.raises(ValueError, match="two axes"):
        plot.ball(largest_ball(solid, 0), basins=solid)
    for draw in (plot.basin_stability, plot.settling_times, plot.tipping):
        with pytest.raises(TypeError, match=r"=3: give .*, made by"):
            draw(3)  # type: ignore[operator]
