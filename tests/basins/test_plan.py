"""Plans: the logic of the choice on made-up measurements, and the accuracy of what is chosen on real ones."""

import itertools
from dataclasses import replace
from math import pi, sin

import matplotlib as mpl
import numpy as np
import pytest

from cellmap import CellGrid, discrete_map, interpolated_map, plan, stroboscopic_map
from cellmap.basins import AccuracyWarning
from cellmap.basins.planning.predictions import (
    SAFETY,
    ExactProbe,
    Labelling,
    Measurements,
    TableProbe,
    choose,
    error_of,
    fallback_of,
    options_of,
    sized,
    table_grids,
)
from cellmap.maps.interpolation.interpolated import table_memory
from cellmap.maps.interpolation.spline_coefficients import number_of_nodes
from systems import dimensionless_pendulum, henon_map

mpl.use("Agg")

SQUARE = CellGrid((-1, -1), (1, 1), (256, 256))
EXACT = tuple(
    ExactProbe(method, 10.0**-k, 10.0 ** -(k + 1), seconds * k / 8)
    for method, seconds in (("Taylor", 1e-6), ("DOP853", 2e-6))
    for k in (4, 6, 8, 10, 12)
)


def table_probe(order, constant=1.0, periods=50.0, falls=None, **changes):
    """Tables whose error is constant * h^falls."""
    cells = (32, 64, 128)
    errors = tuple(constant * (1 / n) ** (order + 1 if falls is None else falls) for n in cells)
    lookup = {1: 1e-8, 3: 3e-8, 5: 8e-8}[order]
    known = {"surplus": 1e-7, "labelling": Labelling(0.0, periods * lookup)} | changes
    return TableProbe(order=order, cells=cells, errors=errors, raw=errors, **known)


def measurements(initial_conditions=250_000, periods=50.0, falls=None, **changes):
    known = {
        "initial_conditions": initial_conditions,
        "periods": periods,
        "window": SQUARE,
        "threads": 2,
        "exact": EXACT,
        "base": EXACT[2],
        "direct": Labelling(0.0, periods * EXACT[2].seconds),
        "tables": tuple(table_probe(order, periods=periods, falls=falls) for order in (1, 3, 5)),
        "free": 10**9,
    }
    return Measurements(**(known | changes))


def chosen(measured, accuracy=1e-6):
    option, met = choose(options_of(measured), accuracy)
    assert met
    return option


def test_errors_of_larger_tables():
    for order in (1, 3, 5):
        probe = table_probe(order, constant=7.0)
        for n in (32, 128, 1024):
            assert error_of(probe, sized(SQUARE, n)) == pytest.approx(7.0 * n ** -(order + 1.0), rel=1e-6)
    # On coarse grids errors may fall faster than they can in the limit: no more than the order is trusted.
    probe = table_probe(3, falls=9.0)
    assert error_of(probe, sized(SQUARE, 256)) == pytest.approx(probe.errors[-1] / 16)
    # Errors that rise are not carried on, and coarse grids are no better than finer ones.
    probe = replace(table_probe(3), errors=(1e-6, 1e-7, 2e-7), raw=(1e-6, 1e-7, 2e-7))
    assert [error_of(probe, sized(SQUARE, n)) for n in (1024, 64)] == pytest.approx([2e-7, 2e-7])
    # Beyond the last table errors without the exact map count.
    probe = replace(table_probe(5), errors=(1e-9, 1e-9, 1e-9), raw=(1e-3, 1e-4, 1e-5))
    assert error_of(probe, sized(SQUARE, 128)) == pytest.approx(1e-9)
    assert error_of(probe, sized(SQUARE, 256)) > 1e-7
    # What is not allowed is evaluated with the exact map: cells with a centre off by 1e-4 of their width, for order 5.
    assert error_of(table_probe(5, falls=0.0), sized(SQUARE, 1000)) == pytest.approx(1e-4 * 2 / 1000)
    for falls, ratio in ((1.0, 1 / 2), (None, 1 / 64)):  # across kinks, and where the map is smooth
        probe = table_probe(5, 1e-6, falls=falls)
        assert error_of(probe, sized(SQUARE, 512)) / error_of(probe, sized(SQUARE, 256)) == pytest.approx(ratio)


def test_fallback_falls_and_ends():
    """No faster than the order allows: an error of order 3 falls by 2^4 over a factor of 2 in size at the most."""
    probe = table_probe(3, fallback=((64, 4.0), (128, 2.0)))
    assert [fallback_of(probe, n) for n in (96, 512, 32)] == pytest.approx([4.0 * 64 / 96, 0.5, 4.0])
    assert fallback_of(table_probe(3, fallback=((64, 4.0), (128, 0.0))), 256) == fallback_of(table_probe(3), 256) == 0.0
    for order, cells in ((3, 256), (1, 512)):
        fast = table_probe(order, fallback=((64, 4.0), (128, 1e-3)))
        assert fallback_of(fast, cells) == pytest.approx(1e-3 / 16)


def test_costs_are_sums_of_their_parts():
    """Two threads; 250,000 points; 100 nanoseconds more for each image of a table."""
    assert measurements().outside == 0.0
    measured = measurements(
        direct=Labelling(0.5, 3e-5), tables=(table_probe(3, labelling=Labelling(0.25, 2e-6), fallback=((128, 0.5),)),)
    )
    options = options_of(measured)
    direct = next(o for o in options if o.kind == "direct" and (o.method, o.tolerance) == ("Taylor", 1e-4))
    source, base = EXACT[0].seconds, EXACT[2].seconds
    assert direct.iteration == pytest.approx(source / base * 3e-5 * 250_000 / 2)
    assert direct.search == pytest.approx(source / base * 0.5)
    assert direct.seconds == pytest.approx(direct.iteration + direct.search)
    table = next(o for o in options if o.kind == "table" and o.shape == (32, 32))
    exact = next(e for e in EXACT if (e.method, e.tolerance) == (table.method, table.tolerance))
    nodes = 32 * 32 + number_of_nodes(sized(SQUARE, 32), 3)
    assert table.tabulation == pytest.approx(nodes * (exact.seconds + 1e-7) / 2)
    assert table.iteration == pytest.approx((2e-6 + 0.5 * exact.seconds) * 250_000 / 2)
    assert table.search == 0.25
    assert table.seconds == pytest.approx(table.tabulation + table.iteration + 0.25)
    assert table.error == pytest.approx(error_of(measured.tables[0], sized(SQUARE, 32)) + 2.0 * exact.error)


def test_a_table_serves_many_periods_and_the_integrator_few_or_four_dimensions():
    """A table in four dimensions takes some million images and slow look-ups."""
    assert chosen(measurements(periods=100.0)).kind == "table"
    assert chosen(measurements(initial_conditions=500, periods=1.0), 1e-9).kind == "direct"
    window = CellGrid((-1,) * 4, (1,) * 4, (16,) * 4)
    slow = tuple(table_probe(o, labelling=Labelling(0.1, 20 * 5e-6)) for o in (3, 5))
    tables = tuple(
        replace(probe, cells=(8, 12, 16), errors=(1e-1, 3e-2, 1e-2), raw=(1e-1, 3e-2, 1e-2)) for probe in slow
    )
    measured = measurements(periods=20.0, window=window, tables=tables)
    assert chosen(measured, 1e-6).kind == "direct"


def test_smooth_maps_take_high_orders_and_kinked_ones_none():
    assert (chosen(measurements(), 1e-11).order, chosen(measurements(), 1e-3).order) == (5, 1)
    kinked = measurements(tables=tuple(table_probe(o, falls=1.0) for o in (1, 3, 5)))
    assert chosen(kinked, 1e-8).kind == "direct"
    # The table is made from a map that is accurate enough, by the method that is twice as fast here.
    option = chosen(measurements(), 1e-8)
    source = next(e for e in EXACT if (e.method, e.tolerance) == (option.method, option.tolerance))
    assert SAFETY * 2.0 * source.error <= 1e-8
    assert option.method == "Taylor"


def test_the_tolerance_is_the_measured_one():
    """The tolerance is a bound: one of 1e-6 serves for 2e-7 where its error is a tenth of it."""
    direct = measurements(tables=())
    assert chosen(direct, 2.1e-7).tolerance == pytest.approx(1e-6)
    assert chosen(direct, 1.9e-7).tolerance == pytest.approx(1e-8)


@pytest.mark.parametrize("falls", [None, 1.0, 0.0])
@pytest.mark.parametrize(
    ("initial_conditions", "periods"),
    [
        pytest.param(number, periods, marks=[] if (number, periods) == (10**4, 30.0) else pytest.mark.thorough)
        for number, periods in itertools.product([100, 10**4, 10**6], [1.0, 30.0, 1000.0])
    ],
)
def test_stricter_is_never_cheaper(falls, initial_conditions, periods):
    measured = measurements(initial_conditions=initial_conditions, periods=periods, falls=falls)
    options = options_of(measured)
    for better, worse in itertools.pairwise(options):
        if better.family == worse.family and better.obstacle == worse.obstacle:
            assert better.error > worse.error and better.seconds < worse.seconds
    seconds = [
        choose(options, 10.0 ** (-0.25 * k))[0].seconds for k in range(4, 48) if choose(options, 10.0 ** (-0.25 * k))[1]
    ]
    assert len(seconds) > 30
    assert (np.diff(seconds) >= 0.0).all()


def test_memory_closes_ways_and_says_so():
    needed = 2 * table_memory(CellGrid((-1, -1), (1, 1), (64, 64)), 5)
    measured = measurements(initial_conditions=10_000, free=needed)
    closed = [o for o in options_of(measured) if o.obstacle]
    assert closed
    assert all(o.memory > needed and "of memory" in o.obstacle for o in closed)
    assert not chosen(measured, 1e-10).obstacle
    with pytest.raises(MemoryError, match="take fewer initial conditions"):
        choose(options_of(measurements(initial_conditions=10_000, free=100)), 1e-6)


def test_tables_grow_to_the_first_that_memory_cannot_hold():
    measured = measurements(free=2 * 10**7)
    grids = table_grids(measured, measured.tables[1])
    assert [max(g.shape) for g in grids][:5] == [32, 48, 64, 96, 128]
    needs = [table_memory(g, 3) for g in grids]
    assert needs[-1] > 2 * 10**7 >= needs[-2]
    measured = measurements(window=CellGrid((-1, -3), (1, 3), (100, 50)))
    assert table_grids(measured, measured.tables[0])[0].shape == (32, 16)
    # Where none serves, the most accurate way is taken.
    option, met = choose(options_of(measurements()), 1e-20)
    assert not met
    assert option.error == min(o.error for o in options_of(measurements()))


GRIDS = {
    "pendulum": (lambda: dimensionless_pendulum(0.1, -0.545, 0.08), CellGrid((-pi, -2), (pi, 2), (60, 40))),
    "discrete": (lambda: henon_map(0.5), CellGrid((-1, -1), (1, 1), (60, 60))),
}


@pytest.fixture(scope="module", params=["discrete", pytest.param("pendulum", marks=pytest.mark.thorough)])
def planned(request):
    make, grid = GRIDS[request.param]
    return plan(make(), grid, accuracy=1e-6)


@pytest.mark.parametrize("accuracy", [1e-3, *(pytest.param(a, marks=pytest.mark.thorough) for a in (1e-6, 1e-9))])
def test_what_is_chosen_is_as_accurate_as_wanted(planned, accuracy):
    """At other places than those of the probes; predictions keep a margin of 2."""
    again = planned.at(accuracy)
    assert again.met
    outcome = again.outcome(again.map())
    assert outcome.error <= accuracy
    assert outcome.met


def test_every_order_is_as_accurate_as_predicted(planned):
    """Errors of tables larger than those that were measured, within a factor of 3."""
    measured = planned.measurements
    assert measured.tables
    for probe in measured.tables:
        grid = sized(measured.window, min(2 * probe.cells[-1], 384))
        actual = interpolated_map(planned.job.finest, grid, probe.order, "integrate").error().percentile_99
        predicted = error_of(probe, grid)
        assert predicted / 3.0 - 1e-13 <= actual <= 3.0 * predicted + 1e-13, probe.order


def test_the_way_up_and_down(planned):
    accuracies = [s.accuracy for s in planned.steps]
    assert accuracies == pytest.approx([1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9])
    assert [s.seconds for s in planned.steps] == sorted(s.seconds for s in planned.steps)
    text = str(planned)
    assert text.count("<- wanted") == 1
    assert len(text.splitlines()) >= 9
    assert "Plan(" in repr(planned)
    assert planned.memory == planned.chosen.memory


def test_an_image_by_plan(planned):
    basins = planned.basins(longest_period=16)
    assert basins.labels.shape == planned.job.grid.shape
    assert basins.settings["longest_period"] == 16
    outcome = planned.outcome(basins)
    assert outcome.seconds == pytest.approx(basins.cost.seconds + basins.point_map.cost.seconds)
    assert outcome.predicted_seconds == planned.seconds
    assert outcome.time_ratio == pytest.approx(planned.seconds / outcome.seconds)
    assert "ratio" in str(outcome)


@pytest.mark.parametrize("accuracy", [1e-5, *(pytest.param(a, marks=pytest.mark.thorough) for a in (1e-3, 1e-7))])
def test_kinks_are_seen(accuracy):
    """Across a line the map has a kink, which no order of splines can follow."""
    kinked = discrete_map(lambda x, p: (0.5 * abs(x[0] - 0.3) + 0.1 * x[1], 0.4 * sin(x[0])), {}, ("x", "y"))
    planned = plan(kinked, CellGrid((-1, -1), (1, 1), (50, 50)), accuracy=accuracy, periods=20)
    assert planned.outcome(planned.map()).error <= accuracy


def halves(x, p):
    return (x[0] / 2 + x[0] ** 3 / 9,)


def test_an_exact_map_is_used_as_it_is():
    strobe = stroboscopic_map(dimensionless_pendulum(0.1, -0.545, 0.08), rtol=1e-7, atol=1e-7)
    grid, given = CellGrid((-pi, -1), (pi, 1), (20, 20)), CellGrid((-pi, -2), (pi, 3), (2, 3))
    planned = plan(strobe, grid, accuracy=1e-4, periods=3, region=given)
    assert set(planned.job.sources.values()) == {strobe}
    assert planned.measurements.periods == 3.0 and planned.measurements.window.upper == (pi, 3.0)
    point_map = planned.map()
    assert point_map is strobe or point_map.exact is strobe
    assert planned.outcome(point_map, seconds=1.0).predicted_seconds == planned.seconds


def test_an_accuracy_out_of_reach_is_warned_of():
    exact = discrete_map(halves, {}, ("x",))
    with pytest.warns(AccuracyWarning, match="ask for less"):
        planned = plan(exact, CellGrid((-1,), (1,), (50,)), accuracy=1e-18)
    assert not planned.met
    assert "does not reach it" in str(planned)


def test_arguments_are_checked():
    exact, grid = discrete_map(halves, {}, ("x",)), CellGrid((-1,), (1,), (50,))
    with pytest.raises(TypeError, match="is an interpolated map"):
        plan(interpolated_map(exact, grid), grid)
    with pytest.raises(ValueError, match="2 axes"):
        plan(exact, CellGrid((-1, -1), (1, 1), (5, 5)))
    planned = plan(exact, grid, accuracy=1e-3)
    with pytest.raises(ValueError, match="have no map"):
        planned.outcome(replace(planned.basins(), point_map=None))
