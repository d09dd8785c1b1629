"""Timings behind plans, on a clock that goes on only by known work."""

from types import SimpleNamespace

import numpy as np
import pytest

from cellmap import CellGrid, discrete_map, set_threads
from cellmap.basins.planning import probes
from cellmap.basins.planning.predictions import Labelling
from cellmap.basins.planning.probes import Job, Trial, some_initial_conditions

HALVES = discrete_map(lambda x, p: (0.5 * x[0], 0.5 * x[1]), {}, ("x", "y"))
SQUARE = CellGrid((-1.0, -1.0), (1.0, 1.0), (512, 512))


def job(grid=SQUARE, periods=None, point_map=HALVES):
    return Job({("discrete", 1e-16): point_map}, point_map, grid, periods, "integrate", 0)


@pytest.fixture
def clock(monkeypatch):
    now = SimpleNamespace(seconds=100.0)
    monkeypatch.setattr(probes.time, "perf_counter", lambda: now.seconds)
    return now


@pytest.mark.parametrize(
    ("durations", "median"), [([0.1, 0.05, 0.4], 0.1), ([0.2, 0.3], 0.25), ([0.5], 0.5), ([0.0, 0.0, 0.0], 1e-9)]
)
def test_median_of_three_timings_or_of_those_that_fit_into_a_third_of_a_second(clock, durations, median):
    left = [*durations, 9.0]

    def work():
        clock.seconds += left.pop(0)

    assert probes.median_seconds(work) == pytest.approx(median)
    assert left == [9.0]


@pytest.mark.parametrize("threads", [1, 2])
def test_seconds_for_an_image(monkeypatch, threads):
    """A median of 0.1 s for 16,384 initial conditions on some threads."""
    set_threads(threads)
    made = []

    def median(work):
        work()
        return 0.1

    def advance(orbits, periods):
        made.append((len(orbits), periods))

    monkeypatch.setattr(probes, "median_seconds", median)
    found = probes.seconds_per_image(SimpleNamespace(advance=advance), SQUARE)
    assert found == pytest.approx(0.1 * threads / 16384)
    assert sorted(made) == sorted([(16, 1), *[(16384 // threads, 1)] * threads])


def test_grids_are_thinned_to_about_a_number_of_cells():
    assert probes.thinned(SQUARE, 1600).shape == (40, 40)
    assert probes.thinned(SQUARE, 512 * 512) is SQUARE
    slab = CellGrid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (400, 1, 100))
    assert probes.thinned(slab, 400).shape == (40, 1, 10)
    long = CellGrid((0.0, 0.0), (1.0, 1.0), (100_000, 2))
    assert probes.thinned(long, 100).shape == (2236, 1)


def test_trials_label_or_iterate(clock):
    counts = iter([5, 905])
    found = probes.label(
        job(CellGrid((-1.0, -1.0), (1.0, 1.0), (10, 10)), periods=7), HALVES, 100, lambda: next(counts)
    )
    assert (found.initial_conditions, found.periods, found.images) == (100, 7.0, 900)
    set_threads(2)
    assert Trial(100_000, 1.0, 1.0, 0).effort == 50_000
    assert Trial(100, 1.0, 1.0, 0).effort == 100
    basins = probes.label(job(CellGrid((-1.0, -1.0), (1.0, 1.0), (10, 10))), HALVES, 100, int)
    assert 1.0 < basins.periods < 100.0


@pytest.mark.parametrize("fixed", [0.0, 0.2, 2.0])
def test_time_of_labelling_is_fixed_and_for_each_point(monkeypatch, fixed):
    """Seconds are fixed + 2e-5 for each initial condition of a thread, images 3 for each: both are found again."""
    set_threads(2)
    asked = []

    def label(job, point_map, number, count):
        asked.append(number)
        number -= number > 1600  # a thinned grid has about so many cells
        effort = Trial(number, 0.0, 0.0, 0).effort
        return Trial(number, fixed + 2e-5 * effort, 12.5, 3 * number)

    monkeypatch.setattr(probes, "label", label)
    found, periods, images = probes.time_labelling(job(), HALVES, int)
    assert found.fixed == pytest.approx(fixed, abs=1e-12)
    assert found.per_point == pytest.approx(2e-5)
    assert (periods, images) == (12.5, pytest.approx(3.0))
    # From 1,600 on four times as many each, up to eight slices of work, until the search is the smaller part.
    assert asked == {0.0: [1600, 1600, 6400, 25600, 102400], 0.2: [1600, 1600, 6400, 25600, 102400],
                     2.0: [1600, 6400, 25600, 102400, 131072]}[fixed]  # fmt: skip
    followed = probes.time_labelling(job(periods=9), HALVES, int)[0]
    assert followed.per_point == pytest.approx(2e-5 + fixed / Trial(asked[-1] - 1, 0, 0, 0).effort)
    assert followed.fixed == pytest.approx(max(0.0, fixed - 1600 * (followed.per_point - 2e-5)), abs=1e-9)


# --- windows and tables


def test_the_window_is_that_of_the_orbits():
    """x' = 2 y, y' = x/4: from abs(x) <= 1, abs(y) <= 1 orbits reach x = 2 and no more than y = 1."""
    stretch = discrete_map(lambda x, p: (2.0 * x[1], 0.25 * x[0]), {}, ("x", "y"))
    grid = CellGrid((-1.0, -1.0), (1.0, 1.0), (100, 100))
    window, beyond = probes.window_of_orbits(job(grid, point_map=stretch))
    points = stretch.orbit(some_initial_conditions(grid, 1024), 32).points.reshape(-1, 2)
    low, high = np.quantile(points[:, 0], (0.002, 0.998))
    room = 0.05 * (high - low)
    assert window.lower == pytest.approx((low - room, -1.0)) and window.upper == pytest.approx((high + room, 1.0))
    assert window.shape == (256, round(256 * 2.0 / (high - low + 2 * room)))
    held = ((points >= window.lower) & (points <= window.upper)).all(axis=1)
    assert beyond == pytest.approx(1.0 - held.mean(), abs=1e-12)


def test_what_a_table_costs_besides_the_exact_map(monkeypatch):
    """Labels take 1e-6 s each, of which 0.25 images of 1e-6 s are the exact map's; a sixteenth of that near the end."""
    sample = probes._Sample
    samples = [sample(32, HALVES, 1e-3, 1e-2, 0.5), sample(64, HALVES, 1e-4, 1e-3, 0.25)]
    monkeypatch.setattr(probes, "seconds_per_image", lambda *_: 1e-6)
    monkeypatch.setattr(probes, "_samples", lambda *_: (samples, 3e-7))
    monkeypatch.setattr(probes, "_lookup_times", lambda *_: ((1000, 1e-8), (4000, 2e-8)))
    timed = [Labelling(0.4, 1e-6), 20.0, 0.25]
    monkeypatch.setattr(probes, "time_labelling", lambda *_: tuple(timed))
    found = probes.table_probe(job(), SQUARE, 3)
    assert (found.order, found.cells, found.errors, found.raw) == (3, (32, 64), (1e-3, 1e-4), (1e-2, 1e-3))
    assert found.surplus == 3e-7
    assert found.labelling.fixed == 0.4 and found.labelling.per_point == pytest.approx(0.75e-6)
    assert found.fallback == ((32, pytest.approx(0.5)), (64, pytest.approx(0.25)))
    timed[2] = 0.99  # no more than nine tenths of a label are taken for the exact map's,
    assert probes.table_probe(job(), SQUARE, 3).labelling.per_point == pytest.approx(1e-7)
    timed[1] = 40.0  # and half of the time of its look-ups remains
    assert probes.table_probe(job(), SQUARE, 3).labelling.per_point == pytest.approx(2e-7)
    samples[:] = [sample(32, HALVES, 1e-3, 1e-2, 0.0), sample(64, HALVES, 1e-4, 1e-3, 0.0)]
    assert probes.table_probe(job(), SQUARE, 3).fallback == ((32, pytest.approx(0.99)), (64, pytest.approx(0.99)))
    samples.clear()
    assert probes.table_probe(job(), SQUARE, 3) is None
