"""Measures of basins and their boundaries: by table and by integration, and against naive ways."""

from __future__ import annotations

import time
from collections.abc import Callable
from math import pi

import numpy as np
from numpy.typing import NDArray
from peers import best_time, scipy_stacked

import cellmap
from cellmap import CellGrid, find_basins, interpolated_map, stroboscopic_map
from cellmap.analysis.fractal import boundary_dimension, image_uncertainty_exponent, uncertainty_exponent
from cellmap.analysis.fractal.label_images import boundary_boxes, count_boxes, label_image
from systems import dimensionless_pendulum, forced_pendulum, two_well_duffing

DISTANCES = 2.0 ** -np.arange(8.0, 19.0)


def test_uncertainty_exponent(say: Callable[[str], None]) -> None:
    region = CellGrid((-pi, -4.0), (pi, 4.0), (200, 200))
    cases = [
        ("vertically driven pendulum", dimensionless_pendulum(0.5, 0.1, 0.03), 4.5),
        ("forced pendulum", forced_pendulum(), 9.0),
    ]
    for name, system, speed in cases:
        exact = stroboscopic_map(system)
        began = time.process_time()
        icm = interpolated_map(exact, CellGrid((-pi, -speed), (pi, speed), (512, 768)), outside="integrate")
        interpolated = time.process_time() - began
        basins = find_basins(icm, region)
        lines = {}
        for label, point_map in (
            ("table", icm),
            ("exact map at 1e-9", exact),
            ("exact map at 1e-13", stroboscopic_map(system, rtol=1e-13, atol=1e-13)),
        ):
            point_map(np.zeros((100, 2)))
            # Time of the processor: what other programs take in between does not count.
            began = time.process_time()
            found = uncertainty_exponent(point_map, region, attractors=basins.attractors, distances=DISTANCES)
            lines[label] = found, (time.process_time() - began) / found.pairs.sum() * 1e6
        by_table = lines["table"][1]
        say(f"uncertainty exponent of the {name}; CPU time for 10^6 pairs (tabulation {interpolated:.1f} s, once)")
        for label, (found, seconds) in lines.items():
            say(
                f"  {label}: exponent {found.exponent:.4f} +- {found.standard_error:.4f}, {seconds:.2f} s, "
                f"{seconds / by_table:.1f} times that by table"
            )
        if "vertically" in name:
            initial_conditions = region.centres().reshape(-1, 2)[:: region.size // 10_000]
            peer = scipy_stacked(1e-9)
            began = time.process_time()
            peer(initial_conditions)
            each = (time.process_time() - began) / len(initial_conditions)
            seconds = each * 2e6 * basins.cost.steps / basins.labels.size
            say(f"  SciPy's DOP853 at 1e-9, 10^4 starts as one system: {seconds / by_table:.0f} times (extrapolated)")
        began = time.perf_counter()
        many = uncertainty_exponent(basins, max_pairs=1_000_000, min_uncertain=4000)
        say(f"  {many.pairs.sum():,} pairs by table on {cellmap.thread_count()} threads: {many.cost.seconds:.1f} s")


def test_uncertainty_exponent_of_an_image(say: Callable[[str], None]) -> None:
    labels = np.random.default_rng(0).integers(0, 2, (4096, 4096), dtype=np.int16)
    began = time.process_time()
    found = image_uncertainty_exponent(labels)
    say(
        f"uncertainty exponent of 4096 x 4096 labels, {len(found.distances)} distances: "
        f"{time.process_time() - began:.1f} s of CPU time"
    )


def naive_box_counts(labels: NDArray[np.int16], sizes: list[int]) -> list[int]:
    """Count boxes by unique numbers of the boxes of all smallest boxes whose corners differ, size by size."""
    low, high = labels, labels
    for part in ((slice(1, None), slice(None)), (slice(None), slice(1, None))):
        other = (slice(None, -1), slice(None)) if part[0].start else (slice(None), slice(None, -1))
        low, high = np.minimum(low[part], low[other]), np.maximum(high[part], high[other])
    i, j = np.nonzero(low != high)
    return [len(np.unique((i // size) * len(labels) + j // size)) for size in sizes]


def test_box_counting(say: Callable[[str], None], one_thread: None) -> None:
    """All dyadic sizes of 4096 x 4096 labels on one grid, on one thread like numpy."""
    x = (np.arange(4096) + 0.5) / 4096 - 0.5
    icm = interpolated_map(stroboscopic_map(two_well_duffing()), CellGrid((-2.9, -2.9), (2.9, 2.9), (400, 400)))
    duffing = find_basins(icm, CellGrid((-2.2, -2.2), (2.2, 2.2), (1024, 1024))).labels
    images = {
        "two-well Duffing": np.kron(duffing, np.ones((4, 4), np.int16)),
        "labels at random": np.random.default_rng(0).integers(0, 2, (4096, 4096), dtype=np.int16),
        "disc": (x[:, None] ** 2 + x**2 < 0.1).astype(np.int16),
    }
    sizes = [2**k for k in range(12)]
    for name, labels in images.items():
        image = label_image(labels, (), None)
        ours = best_time(lambda: count_boxes(boundary_boxes(image), image.wraps, sizes, (0, 0)), rounds=5)  # noqa: B023
        naive = best_time(lambda: naive_box_counts(labels, sizes), rounds=1)  # noqa: B023
        whole = best_time(lambda: boundary_dimension(labels, n_offsets=1), rounds=3)  # noqa: B023
        say(
            f"box counting of 4096 x 4096 labels ({name}): {1e3 * ours:.1f} ms, {ours / naive:.4f} of the time of "
            f"numpy.unique ({naive:.2f} s); with checks, saturation and fit {1e3 * whole:.0f} ms, {whole / naive:.4f}"
        )
