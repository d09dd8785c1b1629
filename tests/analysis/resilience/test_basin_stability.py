"""Basin stability and settling times, and the intervals of both."""

from __future__ import annotations

from dataclasses import replace
from math import erf, log2, pi, sqrt
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from scipy.stats import binomtest

from cellmap import (
    Basins,
    CellGrid,
    PointMap,
    discrete_map,
    find_basins,
    plot,
    set_threads,
)
from cellmap.analysis import binomial_interval
from cellmap.analysis.resilience import (
    basin_stability,
    settling_statistics,
)

mpl.use("Agg")


# --- binomial intervals


@pytest.mark.parametrize(("name", "theirs"), [("exact", "exact"), ("Wilson", "wilson")])
@pytest.mark.parametrize(("k", "n"), [(0, 1), (0, 50), (7, 50), (50, 50), (481, 1000)])
def test_intervals_are_those_of_scipy(name: str, theirs: str, k: int, n: int) -> None:
    expected = binomtest(k, n).proportion_ci(0.99, method=theirs)
    low, high = binomial_interval(k, n, 0.99, name)
    assert (float(low), float(high)) == pytest.approx((expected.low, expected.high), abs=1e-12)


def test_interval_of_no_trials_says_nothing() -> None:
    assert [float(v) for v in binomial_interval(0, 0)] == [0.0, 1.0]
    assert [float(v) for v in binomial_interval(0, 0, method="Wilson")] == [0.0, 1.0]


@pytest.mark.parametrize(
    ("arguments", "match"),
    [((3, 2), "counts between"), ((1, 2, 1.5), "confidence"), ((1, 2, 0.9, "Wald"), "method='Wald'")],
)
def test_intervals_that_are_none(arguments: Any, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        binomial_interval(*arguments)


# --- basin stability


def test_intervals_cover_a_known_fraction_as_often_as_they_say(cubic: PointMap, line: Basins) -> None:
    """Of [-0.5, 1.5] three quarters belong to the right basin; 95 % of 200 intervals is 190 +- 3.1."""
    window = CellGrid((-0.5,), (1.5,), (1,))
    hits = 0
    for seed in range(200):
        right = basin_stability(line, window, n_samples=100, rng=seed).fractions[0]
        hits += right.low <= 0.75 <= right.high
    assert hits >= 184
    assert (
        basin_stability(line, window, n_samples=100, rng=5).labels.tolist()
        != basin_stability(line, window, n_samples=100, rng=6).labels.tolist()
    )


def test_normal_distribution_of_perturbations(line: Basins) -> None:
    """Of a normal law about 1 with spread 0.4, the right basin holds (0, sqrt 3) and what jumps over and back."""

    def below(x: float) -> float:
        return 0.5 * (1.0 + erf((x - 1.0) / 0.4 / sqrt(2.0)))

    back = float(np.roots([-0.5, 0.0, 1.5, sqrt(3.0)]).real.max())  # its image is -sqrt 3
    known = below(sqrt(3.0)) - below(0.0) + below(sqrt(5.0)) - below(back)
    found = basin_stability(line, lambda rng, n: rng.normal(1.0, 0.4, (n, 1)), n_samples=40_000, confidence=0.999)
    assert found.fractions[0].low < known < found.fractions[0].high
    assert found.fractions[0].standard_error == pytest.approx(sqrt(known * (1 - known) / 40_000), rel=0.02)


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


def test_a_map_with_attractors_will_do(cubic: PointMap, line: Basins) -> None:
    window = CellGrid((-0.5,), (1.5,), (1,))
    a = basin_stability(cubic, window, n_samples=500, attractors=line.attractors, rng=3)
    b = basin_stability(line, window, n_samples=500, rng=3)
    assert np.array_equal(a.labels, b.labels)


def test_states_that_diverge_have_a_fraction_of_their_own(disc: Basins) -> None:
    found = basin_stability(disc, n_samples=20_000, rng=1)
    assert found.fractions[0].low < pi / 9.0 < found.fractions[0].high
    assert found.fractions[-2].count + found.fractions[0].count == 20_000


def test_same_bits_for_any_number_of_threads(pendulum: Basins) -> None:
    results = []
    for threads in (1, 2):
        set_threads(threads)
        results.append(basin_stability(pendulum, n_samples=20_000, point_map=pendulum.point_map))
    assert np.array_equal(results[0].labels, results[1].labels)
    assert np.array_equal(results[0].settling_time, results[1].settling_time)


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        ({"n_samples": 0}, ValueError, "n_samples=0"),
        ({"distribution": 3}, TypeError, "distribution=3"),
        ({"distribution": lambda rng, n: np.zeros((n, 2))}, ValueError, "last axis"),
        ({"distribution": lambda rng, n: np.zeros((n - 1, 1))}, ValueError, "return 10000 states"),
        ({"distribution": CellGrid((0, 0), (1, 1), (1, 1))}, ValueError, "2 axes"),
        ({"confidence": 0.0}, ValueError, "confidence"),
        ({"method": "Wald"}, ValueError, "method"),
    ],
)
def test_what_basin_stability_refuses(line: Basins, change: Any, error: type[Exception], match: str) -> None:
    with pytest.raises(error, match=match):
        basin_stability(line, **change)


def test_a_map_without_attractors_or_basins_without_a_map_are_refused(cubic: PointMap, line: Basins) -> None:
    with pytest.raises(ValueError, match="attractors is empty"):
        basin_stability(cubic, CellGrid((0,), (1,), (1,)))
    with pytest.raises(ValueError, match="have no map"):
        basin_stability(replace(line, point_map=None))
    with pytest.raises(TypeError, match="give Basins"):
        basin_stability(np.zeros(3, int))  # type: ignore[arg-type]


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


def test_basin_without_initial_conditions_has_no_mean(line: Basins) -> None:
    none = replace(line, labels=np.full_like(line.labels, -3), settling_time=np.full_like(line.settling_time, -1))
    found = settling_statistics(none).basins[0]
    assert (found.count, found.longest) == (0, -1)
    assert np.isnan([found.mean, found.standard_error, *found.quantiles]).all()
    plot.settling_times(settling_statistics(none))


def test_what_settling_statistics_refuses(line: Basins) -> None:
    with pytest.raises(TypeError, match="give Basins"):
        settling_statistics(line.labels)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="levels"):
        settling_statistics(line, levels=(1.5,))
