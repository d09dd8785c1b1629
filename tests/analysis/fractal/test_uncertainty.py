"""Uncertainty exponents: exact ones, published ones, and what is not said of a smooth boundary."""

from dataclasses import replace
from math import log, pi

import numpy as np
import pytest
from scipy.optimize import brentq

import systems
from cellmap import CellGrid, discrete_map, find_basins, interpolated_map, plot, stroboscopic_map
from cellmap.analysis.fractal import (
    UncertaintyExponent,
    fractal_boundary_test,
    image_uncertainty_exponent,
    uncertainty_exponent,
)
from cellmap.analysis.fractal.uncertainty import smallest_distance
from cellmap.analysis.fractal.uncertainty_fits import SMOOTH, with_fit
from cellmap.basins.final_states import final_states

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
    ("degree", "pairs", "seed"),
    [
        (3, 300_000, 1),
        *(
            pytest.param(*v, marks=pytest.mark.thorough)
            for v in ((3, 300_000, 0), (2, 1_000_000, 0), (2, 1_000_000, 1))
        ),
    ],
)
def test_mcdonalds_map(degree, pairs, seed):
    """ln 1.5/ln turns (McDonald et al. 1985), within two standard errors."""
    found = uncertainty_exponent(systems.mcdonald_map(degree, 1.5), UNIT, outcome=side, max_pairs=pairs, rng=seed)
    assert found.exponent == pytest.approx(log(1.5) / log(degree), abs=2 * found.standard_error)
    assert found.standard_error < 0.02
    assert found.boundary_dimension == pytest.approx(2.0 - found.exponent)
    assert found.verdict == "fractal"
    assert (found.left_out == 0).all()


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


# --- what is not said


def test_a_julia_set_of_dimension_near_one_is_not_called_smooth():
    """z^2 + 0.05: a fractal of dimension 1 + 0.05^2/(4 ln 2) = 1.0009 (Ruelle 1982), which pairs cannot tell from 1."""
    square = discrete_map(lambda x, p: (x[0] ** 2 - x[1] ** 2 + 0.05, 2 * x[0] * x[1]), {}, ("x", "y"))
    found = uncertainty_exponent(square, CellGrid((-1.3, -1.3), (1.3, 1.3), (10, 10)), include=(-2,), max_pairs=300_000)
    assert found.boundary_dimension == pytest.approx(1.0 + 0.05**2 / (4.0 * log(2.0)), abs=3.0 * found.standard_error)
    assert found.verdict == "consistent with smooth"


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in (1, 2))])
def test_a_line_is_not_fractal(seed):
    found = uncertainty_exponent(SIGNS, CellGrid((-3, -1), (3, 1), (10, 10)), max_pairs=300_000, rng=seed)
    assert found.verdict == SMOOTH
    assert found.exponent == pytest.approx(1.0, abs=3 * found.standard_error)


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


def test_one_basin_has_no_boundary_and_costs_nothing():
    """Of one attractor no pair can be uncertain; with orbits that diverge, or end, as a second state all are drawn."""

    def step(x, p):
        return x[0] / 2 + 4 * x[0] ** 3, x[1] / 2

    half = discrete_map(step, {}, ("x", "y"))
    alone = uncertainty_exponent(half, UNIT)
    assert (alone.verdict, alone.cost.steps) == ("no boundary", 2 * 4096)
    assert uncertainty_exponent(half, UNIT, include=(-2,), max_pairs=20_000).uncertain.sum() > 100
    ended = discrete_map(step, {}, ("x", "y"), ends={"out": lambda x, p: abs(x[0]) - 2})
    assert uncertainty_exponent(ended, UNIT, max_pairs=20_000).uncertain.sum() > 100


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


def test_intervals_are_wilsons():
    """0 of 10: 0 to 0.2775 (Wilson 1927)."""
    found = uncertainty_exponent(systems.mcdonald_map(), UNIT, outcome=side, max_pairs=20_000)
    low, high = replace(found, uncertain=np.array([0]), pairs=np.array([10])).intervals[0]
    assert (low, high) == (0.0, pytest.approx(0.2775, abs=1e-4))


# --- figures of the result


def test_plot():
    found = uncertainty_exponent(systems.mcdonald_map(), UNIT, outcome=side, max_pairs=100_000)
    ax = plot.uncertainty_exponent(found)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert ax.get_title() == f"McDonald: {found.verdict}"
    bare = plot.uncertainty_exponent(replace(found, fit=None))
    assert bare.get_ylabel() == "fraction of uncertain pairs"


# --- label images


def disc(cells):
    x = (np.arange(cells) + 0.5) / cells - 0.5
    return np.hypot(*np.meshgrid(x, x)) < 0.3


def stripes(width, basins=2):
    return np.arange(400)[:, None] // width % basins + np.zeros((400, 300), int)


@pytest.mark.parametrize(
    "labels",
    [disc(400), np.add.outer(np.arange(200), np.arange(300)) > 250, stripes(50, 3), stripes(20), stripes(12, 3)],
)
def test_smooth_images(labels):
    found = image_uncertainty_exponent(labels)
    assert found.exponent == pytest.approx(1.0, abs=0.03)
    assert found.verdict == SMOOTH


def cantor_labels(slopes, width, height, centre=0.5):
    """Labels of a piecewise linear map with branches of these slopes at the ends of [0, 1], times a contraction.

    An orbit ends where it leaves: in one of the two parts of the gap, which belong to two attractors.
    """
    left, right = (1.0 / s for s in slopes)
    x = (np.arange(width) + 0.5) / width
    labels = np.full(width, -1)
    for _ in range(40):
        inside = labels < 0
        gap = inside & (x > left) & (x < 1.0 - right)
        labels[gap] = x[gap] > left + centre * (1.0 - left - right)
        x = np.where(x <= left, x / left, 1.0 - (1.0 - x) / right)
    return np.repeat(np.maximum(labels, 0)[:, None], height, axis=1)


SLOPES = [(10.0, 10.0), (20.0, 20.0), (8.0, 6.0)]


@pytest.mark.parametrize("slopes", SLOPES)
@pytest.mark.parametrize(("width", "height"), [(300, 100), (1000, 300)])
def test_cantor_boundaries_are_not_called_smooth(slopes, width, height):
    """1 - D with left**D + right**D = 1 (Moran 1946); the scales of one gap look like those of a smooth boundary."""
    exact = 1.0 - brentq(lambda d: sum(s**-d for s in slopes) - 1.0, 0.0, 1.0)
    labels = cantor_labels(slopes, width, height)
    found = image_uncertainty_exponent(labels)
    assert found.verdict != SMOOTH
    assert abs(found.exponent - exact) < 2.0 * found.standard_error
    assert fractal_boundary_test(labels, n_discs=200).verdict != SMOOTH


def test_less_than_a_decade_has_no_verdict():
    """A straight boundary in 60 cells, and the part of a Cantor boundary that looks like one."""
    for labels in (np.add.outer(np.arange(60), np.arange(80)) > 70, cantor_labels((10.0, 10.0), 1000, 300)):
        found = image_uncertainty_exponent(labels)
        part = image_uncertainty_exponent(labels, fit_range=(len(found.distances) - 7, len(found.distances) - 1))
        assert part.decades < 1.0
        assert part.verdict == "undetermined"
        assert part.standard_error > 12.0**-0.5 * (1.0 - part.decades)


def test_a_mixed_image_has_exponent_zero():
    found = image_uncertainty_exponent(np.random.default_rng(0).integers(0, 2, (300, 200)))
    assert found.exponent == pytest.approx(0.0, abs=0.01)
    assert found.fractions == pytest.approx(0.5, abs=0.01)


def test_pairs_reach_round_circles():
    """On a circle of 12 cells a half has two ends, on a line one."""
    labels = np.arange(12) // 6
    line = image_uncertainty_exponent(labels, distances=[1])
    circle = image_uncertainty_exponent(labels, distances=[1], wraps=(True,))
    assert (line.uncertain.tolist(), line.pairs.tolist()) == ([1], [11])
    assert (circle.uncertain.tolist(), circle.pairs.tolist()) == ([2], [12])


def test_labels_without_a_basin_are_left_out():
    labels = np.array([[0, 0, -1, 1], [0, -2, 1, 1]])
    found = image_uncertainty_exponent(labels, distances=[1])
    # Along columns 0 1 | -1 1, ...: pairs 0-0, 0|-1, -1|1; 0|-2, -2|1, 1-1; and 0-0, 0|-2, -1|1, 1-1 across.
    assert (found.pairs.sum(), found.uncertain.sum(), found.left_out.sum()) == (4, 0, 6)
    both = image_uncertainty_exponent(labels, distances=[1], include=(-2,))
    assert (both.pairs.sum(), both.uncertain.sum()) == (7, 3)
    missing = image_uncertainty_exponent(np.where(labels < 0, np.nan, labels), distances=[1])
    assert missing.pairs.sum() == 4
    masked = image_uncertainty_exponent(np.ma.masked_less(labels, 0), distances=[1])
    assert masked.pairs.sum() == 4


def test_distances_are_halved_down_to_the_smallest_and_not_beyond():
    """Ten errors of the map of 2^-10, in a region that is 2 wide along y."""
    less_exact, floor = replace(SIGNS, tolerance=(0.0, 2.0**-10)), 5 * 2.0**-10
    found = uncertainty_exponent(less_exact, CellGrid((-3, -1), (3, 1), (10, 10)), max_pairs=60_000)
    assert floor <= found.distances.min() < 2 * floor
