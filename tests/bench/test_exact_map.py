"""The exact map of the pendulum against other programs: one thread, equal error."""

from __future__ import annotations

import numpy as np
import pytest
from peers import (
    best_time,
    best_times,
    diffrax_vmap,
    heyoka_batches,
    ours,
    pendulum,
    pynamicalsys_loop,
    scipy_stacked,
)

import cellmap

INITIAL_CONDITIONS = np.random.default_rng(0).uniform((-np.pi, -4.0), (np.pi, 4.0), (20_000, 2))
LONG = 25  # periods a call of heyoka, so that the overhead of its calls from Python does not count


@pytest.fixture(scope="module")
def reference():
    return cellmap.stroboscopic_map(pendulum(), rtol=1e-14, atol=1e-14).iterate(INITIAL_CONDITIONS, 1).unwrapped


@pytest.mark.benchmark(group="exact map, one period of 20,000 starts")
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("method", ["auto", "DOP853"])
def test_our_map(benchmark, say, one_thread, reference, method, tolerance):
    step = ours(tolerance, method)
    images = benchmark.pedantic(step, args=(INITIAL_CONDITIONS,), rounds=5, warmup_rounds=1)
    rate = len(INITIAL_CONDITIONS) / benchmark.stats.stats.min
    say(f"cellmap {method} {tolerance:g}: {rate:,.0f} periods/s, largest error {np.abs(images - reference).max():.1e}")


def test_ratio_to_heyoka(say, one_thread, reference):
    """Of our tolerances the loosest whose largest error is no larger than heyoka's."""
    pytest.importorskip("heyoka")

    def error_of(run) -> float:
        return float(np.abs(run(INITIAL_CONDITIONS) - reference).max())

    steps = [ours(tolerance) for tolerance in 1e-10 * 2.0 ** np.arange(12)]
    errors, count = [error_of(step) for step in steps], len(INITIAL_CONDITIONS)
    for tolerance in (1e-9, 1e-10, 1e-15):
        error, long = error_of(heyoka_batches(tolerance)), heyoka_batches(tolerance, periods=LONG)
        able = [k for k, own in enumerate(errors) if own <= error]
        works = [
            lambda run=long: run(INITIAL_CONDITIONS),
            *(lambda k=k: steps[k](INITIAL_CONDITIONS) for k in able[-1:]),
        ]
        times = best_times(works, seconds=3.0)
        say(f"heyoka batch {tolerance:g}: {LONG * count / times[0]:,.0f} periods/s, largest error {error:.1e}")
        if able:
            ratio = times[0] / LONG / times[1]
            say(f"  cellmap with an error of {errors[able[-1]]:.1e}: {ratio:.2f} times as fast")
    tight = ours(1e-14)
    say(f"cellmap 1e-14: {count / best_time(lambda: tight(INITIAL_CONDITIONS)):,.0f} periods/s")


@pytest.mark.parametrize(
    ("peer", "module", "count", "tolerances"),
    [
        (scipy_stacked, "scipy", 10_000, (1e-9, 1e-10, 3e-11)),
        (diffrax_vmap, "diffrax", 10_000, (1e-9, 1e-10)),
        (pynamicalsys_loop, "pynamicalsys", 1000, (1e-9,)),
    ],
)
def test_ratio_to_others(say, one_thread, reference, peer, module, count, tolerances):
    pytest.importorskip(module)
    initial_conditions, mine = INITIAL_CONDITIONS[:count], ours(4e-9)
    seconds = best_time(lambda: mine(INITIAL_CONDITIONS)) / len(INITIAL_CONDITIONS)
    own_error = np.abs(mine(INITIAL_CONDITIONS) - reference).max()
    for tolerance in tolerances:
        step = peer(tolerance)
        error = np.abs(step(initial_conditions) - reference[:count]).max()
        ratio = best_time(lambda run=step: run(initial_conditions), rounds=2) / count / seconds
        say(f"{module} {tolerance:g}: largest error {error:.1e}; cellmap at {own_error:.1e}: {ratio:.1f} times as fast")
