"""What is announced is an upper bound of what is used, and what there is no memory for is refused before it begins."""

import tracemalloc
from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

import cellmap._lib.memory
from cellmap import CellGrid, certify, discrete_map, find_attractors, find_basins, interpolated_map
from cellmap._lib.memory import give_back_memory, memory_available, share_heaps
from cellmap.analysis.boundary import chaotic_saddle, edge_orbit, escape_rate
from cellmap.analysis.fractal import (
    basin_entropy,
    boundary_dimension,
    box_dimension,
    fractal_boundary_test,
    uncertainty_exponent,
)
from cellmap.analysis.resilience import basin_stability, minimal_fatal_shock
from cellmap.basins import continue_basins
from cellmap.basins.initial_conditions import InitialConditions
from cellmap.basins.label_store import basins_memory
from cellmap.maps.grid import grid_points
from cellmap.maps.interpolation.interpolated import table_memory
from cellmap.orbits import zero_one_test_of_series

GIGABYTE = 2**30


def cubic():
    return discrete_map(lambda x, p: (1.5 * x[0] - 0.5 * x[0] ** 3,), {}, ("x",))


# --- what is free


def test_what_was_freed_below_what_is_used_is_given_back() -> None:
    """The C library by itself gives back the end of its heap alone, and large arrays."""
    process = psutil.Process()
    pieces = [np.ones(8000) for _ in range(3000)]  # 64 kB each, 183 MiB together
    last, full = pieces[-1], process.memory_info().rss
    del pieces
    if give_back_memory():
        assert process.memory_info().rss < full - 150 * 2**20
    assert last[0] == 1.0


def test_a_library_that_gives_nothing_back_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cellmap._lib.memory.ctypes, "CDLL", lambda name: object())
    assert give_back_memory() is share_heaps() is False


def control_groups(monkeypatch: pytest.MonkeyPatch, folder: Path, own: str, files: dict[str, Any]) -> None:
    for name, content in {"cgroup": own, **files}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        more = f"anon 5\n{content[0]} {content[1]}" if isinstance(content, tuple) else content
        (folder / name).write_text(f"{more}\n")
    monkeypatch.setattr(cellmap._lib.memory, "_OWN", folder / "cgroup")
    monkeypatch.setattr(cellmap._lib.memory, "_GROUPS", folder)


def test_memory_that_files_take_is_free(monkeypatch, tmp_path):
    """The system keeps files in memory that nothing else needs, and gives it back: psutil's `available`."""
    control_groups(monkeypatch, tmp_path, "", {})
    before, found, after = psutil.virtual_memory().available, memory_available(), psutil.virtual_memory().available
    assert min(before, after) - GIGABYTE < found < max(before, after) + GIGABYTE


VERSION_2 = {"memory.max": GIGABYTE, "memory.current": GIGABYTE // 2, "memory.stat": ("inactive_file", GIGABYTE // 8)}
VERSION_1 = {
    **{"memory.limit_in_bytes": GIGABYTE, "memory.usage_in_bytes": GIGABYTE // 2},
    "memory.stat": ("total_inactive_file", GIGABYTE // 8),
}
PLACES = ("/", ""), ("/slice/job", "slice/"), ("/not/to/be/seen", "")
FREE = GIGABYTE // 2 + GIGABYTE // 8


@pytest.mark.parametrize(
    ("files", "controllers", "name", "place", "low", "high"),
    [
        *((VERSION_2, "", name, place, FREE, FREE) for name, place in PLACES),
        *((VERSION_1, "memory", name, place, FREE, FREE) for name, place in PLACES),
        (VERSION_2 | {"memory.max": "max"}, "", "/job", "job/", GIGABYTE, inf),
        (VERSION_2 | {"memory.current": 3 * GIGABYTE}, "", "/", "", 0, 0),
    ],
)
def test_the_limit_of_a_container_counts(files, controllers, name, place, low, high, monkeypatch, tmp_path):
    """At the root, in the group of the process or above it; one without a limit, and one that has more than that."""
    held = {f"{controllers}/{place}{file}".lstrip("/"): content for file, content in files.items()}
    control_groups(monkeypatch, tmp_path, f"3:cpu:{name}\n0:{controllers}:{name}\n", held)
    assert low <= memory_available() <= high


# --- what is announced


def peak(call: Callable[[], Any]) -> int:
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


LONG = CellGrid((-1.0,), (1.0,), (200_000,))


@pytest.mark.parametrize("order", [1, 3, 5])
def test_tables_of_one_dimension(order):
    exact = cubic()
    interpolated_map(exact, CellGrid((-1.0,), (1.0,), (50,)), order)
    used, announced = peak(lambda: interpolated_map(exact, LONG, order)), table_memory(LONG, order)
    assert 0.5 * announced < used < announced


def test_basins_of_one_dimension(monkeypatch):
    """As if there were more initial conditions than an axis may have."""
    monkeypatch.setattr("cellmap.basins.initial_conditions.BLOCK", 2**14)
    exact = cubic()
    find_basins(exact, LONG)  # compiles
    assert peak(lambda: find_basins(exact, LONG)) < basins_memory(LONG.size)


@pytest.mark.parametrize("shape", [(2**20 + 7,), (3, 2**20), (200, 300)])
def test_initial_conditions_of_long_axes_have_the_same_bits(shape):
    grid = CellGrid((-0.3,) * len(shape), (1.7,) * len(shape), shape)
    axes = [grid.axis(j) for j in range(grid.dimension)]
    for rows in (slice(grid.size - 1000, grid.size), np.arange(0, grid.size, grid.size // 500)):
        assert np.array_equal(InitialConditions(grid, None).points(rows), grid_points(axes, rows))


# --- numbers that nobody has the memory for

WINDOW = CellGrid((-1.5,), (1.5,), (60,))
TENT = CellGrid((0.0,), (1.0,), (1,))


def tent():
    return discrete_map(lambda x, p: (1.5 - 3 * abs(x[0] - 0.5),), {}, ("x",))


@pytest.fixture(scope="module")
def basins():
    return find_basins(cubic(), WINDOW)


def continued(basins, longest_period):
    slope = discrete_map(lambda x, p: (p.r * x[0] - 0.5 * x[0] ** 3,), {"r": 1.5}, ("x",))
    return continue_basins(slope, "r", [1.4, 1.5], WINDOW, longest_period=longest_period)


def certified(basins, audit):
    return certify(find_basins(interpolated_map(cubic(), WINDOW, order=1), WINDOW), audit=audit)


LABELS = np.arange(4096).reshape(64, 64) > 2000
CLOUD = np.random.default_rng(0).random((200, 2))

COUNTS: dict[str, Callable[[Any, int], Any]] = {
    "n_samples=": lambda basins, many: basins.verify(many),
    "n_samples= of stability": lambda basins, many: basin_stability(basins, n_samples=many),
    "trials=": lambda basins, many: minimal_fatal_shock(basins, 0, scale=1.0, n_trials=many),
    "n_samples= of escape": lambda basins, many: escape_rate(tent(), TENT, n_samples=many),
    "max_periods=": lambda basins, many: escape_rate(tent(), TENT, n_samples=500, max_periods=many),
    "periods=": lambda basins, many: edge_orbit(basins, periods=many),
    "n_points= of a saddle": lambda basins, many: chaotic_saddle(tent(), TENT, n_points=many),
    "transient=": lambda basins, many: chaotic_saddle(tent(), TENT, transient=many),
    "discs=": lambda basins, many: fractal_boundary_test(LABELS, n_discs=many),
    "audit=": certified,
    "longest_period=": lambda basins, many: find_basins(cubic(), WINDOW, longest_period=many),
    "longest_period= of attractors": lambda basins, many: find_attractors(cubic(), [[0.5]], longest_period=many),
    "longest_period= of a continuation": continued,
    "offsets=": lambda basins, many: box_dimension(CLOUD, n_offsets=many),
    "offsets= of a boundary": lambda basins, many: boundary_dimension(LABELS, n_offsets=many),
    "frequencies=": lambda basins, many: zero_one_test_of_series(np.arange(300.0) % 7.0, n_frequencies=many),
    "positions=": lambda basins, many: basin_entropy(basins, box_size=5, n_positions=many),
}


@pytest.mark.parametrize("many", [10**12, 2**62])
@pytest.mark.parametrize("argument", COUNTS)
def test_a_number_beyond_memory_is_refused_at_once(argument, many, basins):
    with pytest.raises(MemoryError, match=rf"{argument.split()[0]}{many} needs .* are free: give a smaller number"):
        COUNTS[argument](basins, many)


def test_numbers_that_need_no_memory_may_be_large(basins):
    """Pairs are drawn in parts, and an orbit of any length is followed point by point."""
    signs = discrete_map(lambda x, p: (x[0] / 2 + 1 / (2 * x[0]), x[1] / 2), {}, ("x", "y"))
    region = CellGrid((-3.0, -1.0), (3.0, 1.0), (10, 10))
    how = {"min_uncertain": 50, "distances": [1e-2, 5e-3]}
    some, most = (uncertainty_exponent(signs, region, max_pairs=many, **how).uncertain for many in (10**7, 2**62))
    np.testing.assert_array_equal(some, most)
    with pytest.raises(ValueError, match="lifetime=4611686018427387904"):
        chaotic_saddle(tent(), TENT, lifetime=2**62)
