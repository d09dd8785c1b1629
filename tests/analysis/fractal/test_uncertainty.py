"""Uncertainty exponents: exact ones, published ones, and what is not said of a smooth boundary."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import log, pi

import matplotlib as mpl
import numpy as np
import pytest

import systems
from cellmap import CellGrid, discrete_map, find_basins, interpolated_map, plot, set_threads, stroboscopic_map
from cellmap.analysis.fractal import UncertaintyExponent, image_uncertainty_exponent, uncertainty_exponent
from cellmap.analysis.fractal.uncertainty import smallest_distance
from cellmap.analysis.fractal.uncertainty_fits import SMOOTH, with_fit
from cellmap.basins.final_states import final_states

mpl.use("Agg")


UNIT = CellGrid((0.0, -2.0), (1.0, 2.0), (10, 10))
WINDOW = CellGrid((-pi, -4.0), (pi, 4.0), (200, 200))
SIGNS = discrete_map(lambda x, p: (x[0] / 2 + 1 / (2 * x[0]), x[1] / 2), {}, ("x", "y"), name="signs")


def side(points):
    """McDonald's map: beyond 1/(growth - 1) = 2 an orbit escapes to the side where it is."""
    return np.where(points[:, 1] > 2.0, 1, np.where(points[:, 1] < -2.0, 0, -1))


def table(system, speed, cells=(512, 768)):
    return interpolated_map(stroboscopic_map(system), CellGrid((-pi, -speed), (pi, speed), cells), outside="integrate")


# --- exact and published values


@pytest.mark.parametrize(
    ("degree", "pairs", "seed"), [(3, 300_000, 0), (3, 300_000, 1), (2, 1_000_000, 0), (2, 1_000_000, 1)]
)
def test_mcdonalds_map(degree, pairs, seed):
    """ln 1.5/ln turns (McDonald et al. 1985), within two standard errors."""
    found = uncertainty_exponent(systems.mcdonald_map(degree, 1.5), UNIT, outcome=side, max_pairs=pairs, rng=seed)
    assert found.exponent == pytest.approx(log(1.5) / log(degree), abs=2 * found.standard_error)
    assert found.standard_error < 0.02
    assert found.boundary_dimension == pytest.approx(2.0 - found.exponent)
    assert found.verdict == "fractal"
    assert (found.left_out == 0).all()


@pytest.mark.slow
def test_errors_of_mcdonalds_map():
    """Over seeds, estimates scatter as their standard errors say: two of three within one, all but few within two."""
    exact = log(1.5) / log(2)
    pulls = []
    for seed in range(20):
        found = uncertainty_exponent(systems.mcdonald_map(2, 1.5), UNIT, outcome=side, rng=seed)
        pulls.append(abs(found.exponent - exact) / found.standard_error)
    assert np.mean(np.array(pulls) < 1.0) > 0.5
    assert np.mean(np.array(pulls) < 2.0) >= 0.85


def test_map_of_grebogi_ott_and_yorke():
    """About 0.2 (Grebogi, McDonald, Ott, Yorke 1983), over eight decades."""
    region = CellGrid((0.0, -0.5), (2 * pi, 0.5), (100, 100))
    found = uncertainty_exponent(systems.grebogi_ott_yorke_map(), region)
    assert 0.19 < found.exponent < 0.22
    assert found.decades > 7.0
    assert len(found.attractors) == 2
    assert found.verdict == "fractal"


@pytest.fixture(scope="module")
def forced():
    return find_basins(table(systems.forced_pendulum(), 9.0), WINDOW)


def test_forced_pendulum_by_table(forced):
    """0.308 +- 0.01 (REFERENCES.md)."""
    found = uncertainty_exponent(forced)
    assert found.exponent == pytest.approx(0.308, abs=0.01)
    assert found.verdict == "fractal"


def test_few_pairs_do_not_shift_the_exponent(forced):
    """With errors of 3 % the first distances, where fractions saturate, look like part of the law; 0.308 all the same.

    One run scatters by 0.01, so that a shift shows in the mean of several.
    """
    found = [uncertainty_exponent(forced, max_pairs=300_000, rng=seed) for seed in range(4)]
    assert np.mean([f.exponent for f in found]) == pytest.approx(0.308, abs=0.01)
    assert all(abs(f.exponent - 0.308) < 3.0 * f.standard_error for f in found)
    assert np.median([f.standard_error for f in found]) < 0.02


@cache
def moon_li(forcing):
    exact = stroboscopic_map(systems.moon_li_duffing(0.15, forcing, 0.8333))
    icm = interpolated_map(exact, CellGrid((-2.5, -2.5), (2.5, 2.5), (300, 300)))
    return find_basins(icm, CellGrid((-2.0, -2.0), (2.0, 2.0), (100, 100)))


@pytest.mark.parametrize(("forcing", "pairs"), [(0.06, 300_000), (0.088, 50_000), (0.088, 200_000)])
def test_smooth_boundary_near_its_onset_is_not_called_fractal(forcing, pairs):
    """Moon and Li's oscillator below Melnikov's 0.0881, whatever the number of pairs."""
    assert uncertainty_exponent(moon_li(forcing), max_pairs=pairs).verdict != "fractal"


def rising(fall, pairs=40_000):
    """Counts whose local slopes rise from 0.8 by `fall` a decade."""
    distances = 2.0 ** -np.arange(6.0, 13.0)
    x = np.log(distances / distances[0])
    fractions = 0.1 * np.exp(0.8 * x - 0.5 * fall / log(10.0) * x**2)
    zero = np.zeros(7, int)
    counts = np.round(pairs * fractions).astype(int)
    return with_fit(UncertaintyExponent(None, distances, np.full(7, pairs), counts, zero, zero, 2, 1e-9, ""))


def test_verdict_waits_for_pairs():
    """An exponent of 0.8 over 1.8 decades: with some hundred uncertain pairs each, its rise to 1 is not excluded."""
    assert rising(0.0).verdict == "undetermined"
    assert rising(0.0, 40_000_000).verdict == "fractal"
    assert rising(0.1, 40_000_000).verdict == "undetermined"


@pytest.mark.slow
def test_forced_pendulum_by_exact_map_and_by_table():
    """Both give 0.308 +- 0.01, and each other's exponent within two standard errors, at the same distances."""
    icm = table(systems.forced_pendulum(), 9.0)
    basins = find_basins(icm, WINDOW)
    scales = 2.0 ** -np.arange(8.0, 20.0)
    by_table = uncertainty_exponent(basins, distances=scales)
    direct = uncertainty_exponent(icm.exact, WINDOW, attractors=basins.attractors, distances=scales)
    for found in (by_table, direct):
        assert found.exponent == pytest.approx(0.308, abs=0.01)
    apart = np.hypot(by_table.standard_error, direct.standard_error)
    assert by_table.exponent == pytest.approx(direct.exponent, abs=2 * apart)


def test_vertically_driven_pendulum():
    """0.284 +- 0.01 (REFERENCES.md), down to 1e-7 of the window; farther down the slope rises to 0.31."""
    found = uncertainty_exponent(
        find_basins(table(systems.dimensionless_pendulum(0.5, 0.1, 0.03), 4.5, (256, 384)), WINDOW)
    )
    assert found.exponent == pytest.approx(0.284, abs=0.01)
    assert found.verdict == "fractal"


def test_inverted_pendulum_is_smooth():
    """Exponent 1 (REFERENCES.md)."""
    icm = table(systems.dimensionless_pendulum(-0.1, 0.545, 0.2), 5.0, (256, 384))
    found = uncertainty_exponent(find_basins(icm, WINDOW), max_pairs=500_000)
    assert found.exponent == pytest.approx(1.0, abs=2 * found.standard_error)
    assert found.standard_error < 0.03
    assert found.verdict == SMOOTH


def test_slices_and_lines():
    """Along a line of McDonald's map, the same exponent: the boundary's dimension falls as that of the region does."""
    line = CellGrid((0.0, 0.29), (1.0, 0.31), (100, 1))
    found = uncertainty_exponent(systems.mcdonald_map(3, 1.5), line, outcome=side, max_pairs=300_000)
    assert found.dimension == 1
    assert found.exponent == pytest.approx(log(1.5) / log(3), abs=max(3 * found.standard_error, 0.05))


# --- what is not said


def test_a_julia_set_of_dimension_near_one_is_not_called_smooth():
    """z^2 + 0.05: a fractal of dimension 1 + 0.05^2/(4 ln 2) = 1.0009 (Ruelle 1982), which pairs cannot tell from 1."""
    square = discrete_map(lambda x, p: (x[0] ** 2 - x[1] ** 2 + 0.05, 2 * x[0] * x[1]), {}, ("x", "y"))
    found = uncertainty_exponent(square, CellGrid((-1.3, -1.3), (1.3, 1.3), (10, 10)), include=(-2,), max_pairs=300_000)
    assert found.boundary_dimension == pytest.approx(1.0 + 0.05**2 / (4.0 * log(2.0)), abs=3.0 * found.standard_error)
    assert found.verdict == "consistent with smooth"


@pytest.mark.parametrize("seed", range(3))
def test_a_line_is_not_fractal(seed):
    found = uncertainty_exponent(SIGNS, CellGrid((-3, -1), (3, 1), (10, 10)), max_pairs=300_000, rng=seed)
    assert found.verdict == SMOOTH
    assert found.exponent == pytest.approx(1.0, abs=3 * found.standard_error)


def test_narrow_stripes_are_not_fractal():
    """Smooth basins that the larger distances do not resolve: the fraction rises from constant to proportional."""
    stripes = discrete_map(lambda x, p: (x[0], 0.0 * x[1]), {}, ("x", "y"))

    def stripe(points):
        return np.floor(points[:, 0] * 200.0).astype(int) % 2

    found = uncertainty_exponent(stripes, CellGrid((0, 0), (1, 1), (2, 2)), outcome=stripe)
    assert found.verdict != "fractal"


def test_no_boundary():
    halves = discrete_map(lambda x, p: (x[0] / 2, x[1] / 3), {}, ("x", "y"))
    found = uncertainty_exponent(halves, CellGrid((-1, -1), (1, 1), (9, 9)), max_pairs=10_000)
    assert found.verdict == "no boundary"
    assert found.fit is None
    assert np.isnan(found.exponent)
    assert "no boundary" in repr(found)


def test_undecided_initial_conditions_spoil_a_distance():
    """A fraction with too many undecided initial conditions is not fitted."""
    distances = 2.0 ** -np.arange(6.0, 12.0)
    counts = np.full(6, 10_000)
    hits = np.round(10_000 * distances**0.5).astype(int)

    def fitted(left_out):
        return with_fit(UncertaintyExponent(None, distances, counts, hits, left_out, left_out, 2, 1e-9, ""))

    assert fitted(0 * hits).exponent == pytest.approx(0.5, abs=0.01)
    spoilt = fitted(hits)
    assert (spoilt.fit, spoilt.verdict) == (None, "undetermined")


# --- labels that are no basins


def test_diverging_initial_conditions_count_on_demand():
    """Henon's map: the boundary between bounded and divergent orbits, fractal; without it there is one basin only."""
    henon, region = systems.henon_map(), CellGrid((-2.0, -2.0), (2.0, 2.0), (10, 10))
    basins = find_basins(henon, CellGrid((-2.0, -2.0), (2.0, 2.0), (64, 64)))
    alone = uncertainty_exponent(basins, region, max_pairs=5000)
    assert (alone.verdict, alone.uncertain.sum()) == ("no boundary", 0)
    assert alone.left_out.sum() > 2000
    both = uncertainty_exponent(basins, region, include=(-2,), max_pairs=20_000)
    assert both.left_out.sum() == 0
    assert both.uncertain[0] > 20


def test_one_basin_has_no_boundary_and_costs_nothing():
    """Of one attractor no pair can be uncertain; with orbits that diverge as a second state all pairs are drawn."""
    half = discrete_map(lambda x, p: (x[0] / 2 + 4 * x[0] ** 3, x[1] / 2), {}, ("x", "y"))
    alone = uncertainty_exponent(half, UNIT)
    assert (alone.verdict, alone.cost.steps) == ("no boundary", 2 * 4096)
    assert uncertainty_exponent(half, UNIT, include=(-2,), max_pairs=20_000).uncertain.sum() > 100


# --- distances, errors, determinism


def test_distances_stop_at_the_accuracy_of_the_map():
    exact = stroboscopic_map(systems.two_well_duffing(), rtol=1e-6, atol=1e-6)
    region = CellGrid((-2.2, -2.2), (2.2, 2.2), (10, 10))
    states = final_states(exact, region, (), side, 10)
    assert smallest_distance(states) == pytest.approx(10 * (1e-6 + 2.2e-6) / 4.4, rel=1e-6)
    icm = table(systems.dimensionless_pendulum(0.5, 0.1, 0.03), 4.5, (64, 96))
    coarse = final_states(icm, WINDOW, (), side, 10)
    assert smallest_distance(coarse) == pytest.approx(10 * icm.error().percentile_99 / (2 * pi), rel=0.01)
    with pytest.raises(ValueError, match=r"distances=.*at least"):
        uncertainty_exponent(exact, region, outcome=side, distances=[1e-3, 1e-9])


def test_same_bits_for_any_number_of_threads():
    tables = []
    for threads in (1, 3):
        set_threads(threads)
        found = uncertainty_exponent(systems.mcdonald_map(), UNIT, outcome=side, max_pairs=60_000, rng=4)
        tables.append((found.pairs.tolist(), found.uncertain.tolist(), found.exponent))
    assert tables[0] == tables[1]
    other = uncertainty_exponent(systems.mcdonald_map(), UNIT, outcome=side, max_pairs=60_000, rng=5)
    assert other.uncertain.tolist() != tables[0][1]


def test_intervals_are_wilsons():
    """0 of 10: 0 to 0.2775 (Wilson 1927)."""
    found = uncertainty_exponent(systems.mcdonald_map(), UNIT, outcome=side, max_pairs=20_000)
    low, high = replace(found, uncertain=np.array([0]), pairs=np.array([10])).intervals[0]
    assert (low, high) == (0.0, pytest.approx(0.2775, abs=1e-4))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"source": 3}, "source=3: give Basins or a PointMap"),
        ({"region": None}, "region=None: give the window"),
        ({"region": CellGrid((0, -2), (1, 2), (1, 1))}, "one cell"),
        ({"outcome": 3}, "outcome=3: give a function"),
        ({"outcome": lambda x: x}, "return one whole number for each"),
        ({"include": (3,)}, "include=3: give a whole number|include=3: give negative labels"),
        ({"max_pairs": 10}, "max_pairs=10"),
        ({"distances": [0.1, 0.2]}, "decreasing list"),
    ],
)
def test_errors_of_the_monte_carlo(change, message):
    given = {"source": systems.mcdonald_map(), "region": UNIT, "outcome": side} | change
    with pytest.raises((TypeError, ValueError), match=message):
        uncertainty_exponent(**given)


# --- from images


def test_basins_of_single_initial_conditions_are_no_image():
    basins = find_basins(SIGNS, [[1.0, 0.0], [-1.0, 0.0]])
    with pytest.raises(ValueError, match="no neighbours"):
        image_uncertainty_exponent(basins)


# --- figures of the result


def test_plot():
    found = uncertainty_exponent(systems.mcdonald_map(), UNIT, outcome=side, max_pairs=100_000)
    ax = plot.uncertainty_exponent(found)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert ax.get_title() == f"McDonald: {found.verdict}"
    bare = plot.uncertainty_exponent(replace(found, fit=None))
    assert bare.get_ylabel() == "fraction of uncertain pairs"
    mpl.pyplot.close("all")
