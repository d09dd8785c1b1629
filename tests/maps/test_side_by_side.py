"""Batches on all threads: the same bits, and the same count of work."""

from __future__ import annotations

import time
from threading import get_ident

import numpy as np

from cellmap import discrete_map, set_threads
from cellmap.maps.orbit_batch import Orbits
from cellmap.maps.side_by_side import advance_on_threads, parts_of

HENON = discrete_map(lambda x, p: (1 - 1.4 * x[0] ** 2 + x[1], 0.3 * x[0]), {}, ("x", "y"))
POINTS = np.random.default_rng(0).uniform(-0.5, 0.5, (203, 2))


def test_parts_have_the_bits_of_the_whole() -> None:
    """A map that takes long is applied by both threads, one that takes no time by one; the work is counted once."""
    whole = Orbits.starting(POINTS.copy())
    HENON.advance(whole, 5)
    for seconds, workers in ((0.0, 1), (1e-3, 2)):
        seen = set()

        def slowly(orbits: Orbits, periods: int, seconds: float = seconds, seen: set[int] = seen) -> None:
            seen.add(get_ident())
            time.sleep(seconds)
            HENON.advance(orbits, periods)

        set_threads(2)
        orbits = Orbits.starting(POINTS.copy())
        advance_on_threads(slowly, orbits, 5)
        set_threads(None)
        assert np.array_equal(orbits.points, whole.points, equal_nan=True)
        assert np.array_equal(orbits.status, whole.status)
        assert orbits.work.evaluations == whole.work.evaluations == 5 * len(POINTS)
        assert len(seen) >= workers


def test_a_single_batch_of_many_periods_is_iterated_by_all_threads() -> None:
    states = np.random.default_rng(1).uniform(-0.5, 0.5, (1000, 2))
    found = []
    for threads in (1, 3):
        set_threads(threads)
        assert len(parts_of(states.shape, 1)) == 1
        assert len(parts_of(states.shape, 100)) == (1 if threads == 1 else 4)
        found.append([HENON.iterate(states, 100), HENON.orbit(states, 100)])
    set_threads(None)
    for one, other in zip(*found, strict=True):
        assert one.points.tobytes() == other.points.tobytes()
        assert np.array_equal(one.status, other.status)
