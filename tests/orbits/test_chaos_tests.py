"""Tests for chaos: what is distinguished, and what must not be concluded."""

from collections import Counter
from math import pi, sqrt

import matplotlib.pyplot as plt
import numpy as np
import pytest

import systems
from cellmap import angle, discrete_map, plot, set_threads, stroboscopic_map
from cellmap.orbits import alignment_test, exponent_test, zero_one_test, zero_one_test_of_series

TESTS = [exponent_test, zero_one_test]

# Standard map, k = 1.2: circles around the elliptic fixed point (pi, 0) and its mirror image of period 2, and points
# beside the hyperbolic fixed point (0, 0) in the chaotic sea (Chirikov 1979).
REGULAR = [[pi, 0.05], [pi, 0.4], [pi + 0.5, 0.1], [0.0, 3.0]]
CHAOTIC = [[0.1, 0.0], [0.05, 0.1], [0.0, 2.0]]
CHAOS = 0.25, 0.55, 0.05  # of a pendulum


@pytest.mark.parametrize("test", TESTS)
def test_regular_and_chaotic_initial_conditions_of_the_standard_map(test):
    """Some of the regular orbits have a positive exponent for all finite times, as at rest on an unstable point."""
    found = test(systems.standard_map(1.2), [*REGULAR, [0.0, 0.0], *CHAOTIC], 2000, 0)
    assert found.verdict.tolist() == ["regular"] * 5 + ["chaotic"] * 3
    assert ((found.low <= found.value) & (found.value <= found.high)).all()


@pytest.mark.parametrize("test", TESTS)
def test_the_logistic_map(test):
    """Periods 2 and 4, the window of period 3, and bands (May 1976)."""
    for verdict, values in (("regular", (3.2, 3.5, 3.83)), ("chaotic", (3.7, 3.9, 4.0))):
        for mu in values:
            assert test(systems.logistic_map(mu), [[0.3], [0.4]], 2000, 1000).verdict.tolist() == [verdict] * 2


@pytest.mark.parametrize("test", TESTS)
def test_henon_and_flows(test):
    assert test(systems.henon_map(), [0.1, 0.1]).verdict == "chaotic"
    swinging, rotating = (stroboscopic_map(systems.dimensionless_pendulum(*p)) for p in (CHAOS, (-0.1, 0.545, 0.2)))
    assert test(swinging, [0.5, 0.1], 400).verdict == "chaotic"
    assert test(rotating, [2.18, 1.19], 400, 100).verdict == "regular"


@pytest.mark.parametrize("test", TESTS)
def test_quasiperiodic_motion_is_regular(test):
    """An attracting invariant circle (delayed logistic map, Aronson et al. 1982) and rotations by irrational turns."""
    circle = discrete_map(lambda x, p: (2.05 * x[0] * (1 - x[1]), x[0]), {}, ("x", "y"))
    assert test(circle, [0.5, 0.4], 4000).verdict == "regular"
    turns = [[0.0, pi * (sqrt(5.0) - 1.0)], [1.0, 1.0]]
    assert test(systems.standard_map(0.0), turns, 2000).verdict.tolist() == ["regular"] * 2


def test_at_the_onset_of_chaos_the_exponent_decides_nothing():
    """mu_infinity = 3.569945672 (Feigenbaum 1978): the exponent is 0, and the growth fluctuates without bound."""
    assert exponent_test(systems.logistic_map(3.569945672), [0.3], 2000, 1000).verdict == "undecided"


@pytest.mark.parametrize("test", TESTS)
def test_nothing_is_said_of_orbits_that_end(test):
    found = test(systems.henon_map(), [[0.1, 0.1], [9.0, 9.0]], 500)
    assert found.verdict.tolist() == ["chaotic", "undecided"]
    assert np.isnan([found.value[1], found.low[1], found.high[1]]).all()
    assert not (found.chaotic | found.regular)[1]
    assert repr(found).endswith("1 chaotic, 1 undecided)")


def test_short_orbits_of_weak_chaos_are_not_called_chaotic():
    """k = 0.3: the stochastic layer of the hyperbolic point is exponentially thin, and its exponents tiny."""
    found = exponent_test(systems.standard_map(0.3), [[1.0, 0.5], [2.0, 1.0], [3.0, 2.5]], 400, 0)
    assert not found.chaotic.any()


def test_noise_is_not_regular_and_tones_are_not_chaotic():
    """Independent numbers diffuse (K = 1), sums of tones do not (K = 0); a constant is at rest."""
    rng = np.random.default_rng(0)
    time = np.arange(2000.0)
    tones = np.cos(time * (sqrt(5.0) - 1.0)) + 0.5 * np.sin(time * sqrt(2.0) + 1.0)
    found = zero_one_test_of_series(np.stack([rng.normal(size=2000), tones, np.full(2000, 0.1), time * 0.0], axis=1))
    assert found.verdict.tolist() == ["chaotic", "regular", "regular", "regular"]
    assert found.value[0] == pytest.approx(1.0, abs=0.02)
    assert found.value[1:] == pytest.approx(0.0, abs=0.05)
    assert found.value[2:].tolist() == [0.0, 0.0]


def test_mean_square_displacements_are_those_of_their_definition():
    """Against sums as they are written by Gottwald and Melbourne (2009), equations 2.1 to 2.3."""
    from cellmap.orbits.zero_one import _correlations

    series = systems.logistic_map(3.9).orbit([0.3], 399).points[:, 0]
    swing = series - series.mean()
    n, cut = len(series), len(series) // 10
    for c in (0.7, 1.9):
        p = np.cumsum(swing * np.cos(c * np.arange(1, n + 1)))
        q = np.cumsum(swing * np.sin(c * np.arange(1, n + 1)))
        kept = np.arange(n - cut)
        moved = [np.mean((p[kept + m] - p[kept]) ** 2 + (q[kept + m] - q[kept]) ** 2) for m in range(1, cut + 1)]
        expected = np.corrcoef(np.arange(1, cut + 1), moved)[0, 1]
        assert _correlations(series, np.array([c]))[0] == pytest.approx(expected, abs=1e-9)


def test_the_same_bits_for_a_seed_and_any_number_of_threads():
    results = []
    for count in (1, 2):
        set_threads(count)
        results.append(zero_one_test(systems.henon_map(), [[0.1, 0.1], [0.0, 0.1]], 300, rng=3))
    assert np.array_equal(results[0].evidence, results[1].evidence)
    squares = zero_one_test(systems.henon_map(), [0.1, 0.1], 1000, observable=lambda x: x[..., 0] ** 2)
    assert squares.verdict == "chaotic"
    other = zero_one_test(systems.henon_map(), [[0.1, 0.1], [0.0, 0.1]], 300, rng=4)
    assert not np.array_equal(results[0].evidence, other.evidence)


def test_the_median_has_an_exact_interval():
    """Ranks 40 and 61 of 100 hold the median with 96.5 % (binomial): the smallest such interval of at least 95 %."""
    found = zero_one_test_of_series(np.random.default_rng(1).normal(size=400))
    assert found.low == found.evidence[39]
    assert found.high == found.evidence[60]


# --- alignment


def test_alignment_tells_islands_from_the_sea():
    found = alignment_test(systems.standard_map(1.2), REGULAR + CHAOTIC, 2000)
    assert found.verdict.tolist() == ["regular"] * 4 + ["chaotic"] * 3
    assert ((found.low <= found.value) & (found.value <= found.high)).all()
    # Two deviations beside a torus of one dimension: t^-2, which is ln(t) / t off no rate at all.
    assert (np.abs(found.evidence[-1, :4]) < 3.0 * np.log(2000) / 2000).all()
    assert plot.chaos_test(found).get_ylabel() == "rate of alignment per step"


@pytest.mark.parametrize("order", [2, 4])
def test_rates_of_alignment_are_differences_of_exponents(order):
    """Of two cat maps side by side: (order - 1) L1 - L2 - ... with +-0.9624 and +-1.7627 (Skokos et al. 2007)."""
    cats = discrete_map(
        lambda x, p: (2 * x[0] + x[1], x[0] + x[1], 5 * x[2] + 2 * x[3], 2 * x[2] + x[3]),
        {},
        tuple(angle(name, "", 1.0) for name in "abcd"),
    )
    exponents = np.array([np.log(3 + sqrt(8)), np.log(1.5 + sqrt(1.25))])
    spectrum = np.concatenate([exponents, -exponents[::-1]])
    found = alignment_test(cats, [[0.1, 0.2, 0.3, 0.4], [0.2, 0.1, 0.7, 0.3]], 300, order=order)
    assert found.verdict.tolist() == ["chaotic"] * 2
    assert found.value == pytest.approx(np.full(2, (order - 1) * spectrum[0] - spectrum[1:order].sum()), rel=1e-9)


def test_shear_and_resting_orbits_are_regular():
    """Plain shear aligns two deviations like 1/t; an unstable fixed point is no chaos."""
    shear = discrete_map(lambda x, p: (x[0] + x[1], x[1]), {}, (angle("a"), "b"))
    assert alignment_test(shear, [[0.3, 0.2], [0.1, 1.234]], 2000).verdict.tolist() == ["regular"] * 2
    assert alignment_test(systems.standard_map(1.2), [0.0, 0.0], 500).verdict == "regular"


def test_alignment_says_nothing_where_volumes_shrink_or_orbits_end():
    """Beside an attracting cycle deviations align as well, as fast as its exponents differ."""
    assert alignment_test(systems.henon_map(), [0.1, 0.1], 400).verdict == "undecided"
    node = discrete_map(lambda x, p: (x[0] / 2, x[1] / 4), {}, ("x", "y"))
    found = alignment_test(node, [0.1, 0.1], 400)
    assert found.value == pytest.approx(np.log(2.0))
    assert found.verdict == "undecided"
    thrown = alignment_test(systems.henon_map(), [[5.0, 5.0]], 100)
    assert thrown.verdict.tolist() == ["undecided"]
    assert np.isnan(thrown.value).all()


def test_the_figure():
    found = exponent_test(systems.standard_map(1.2), [[pi, 0.3], [0.1, 0.0]], 400, 0)
    ax = plot.chaos_test(found)
    # The verdict on one chaotic orbit depends on its last bits: a quarter of its neighbours stay undecided.
    verdicts = Counter(found.verdict.tolist())
    kinds = [kind for kind in ("chaotic", "regular", "undecided") if verdicts[kind]]
    assert [t.get_text() for t in ax.get_legend().get_texts()] == [f"{kind}: {verdicts[kind]}" for kind in kinds]
    assert verdicts["regular"] == 1
    assert len(kinds) == 2
    assert plot.chaos_test(zero_one_test(systems.henon_map(), [0.1, 0.1], 300)).get_ylabel() == "K"
    plt.close("all")
