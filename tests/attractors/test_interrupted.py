"""A search whose end is asked for ends after the step of the map that is under way, whatever it is doing."""

from collections.abc import Callable
from dataclasses import replace
from math import pi, sin
from typing import Any

import numpy as np
import pytest
from small_maps import ends_of

from cellmap import PointMap, angle, discrete_map, find_attractors
from cellmap._lib.stopping import Stop, Stopped, heeding
from cellmap.attractors.kinds.chaos import examine
from cellmap.attractors.kinds.quasiperiodic import quasiperiodic_attractors
from cellmap.maps.orbit_batch import Orbits

CIRCLE = discrete_map(
    lambda x, p: (x[0] + 2.0 + 0.3 * sin(x[0]) + 0.1 * x[1], 0.3 * x[1] + 0.1 * sin(x[0])), {}, (angle("q"), "v")
)
HENON = discrete_map(lambda x, p: (1 - 1.4 * x[0] ** 2 + x[1], 0.3 * x[0]), {}, ("x", "y"))
POINTS = np.random.default_rng(0).uniform(-0.1, 0.1, (4, 2))
EXTENT = np.array([2 * pi, 1.0])


def interrupted(point_map: PointMap, stop: Stop, after: int) -> tuple[PointMap, list[int]]:
    """Return the map with Python's calls of it counted; after some the end is asked for."""
    calls: list[int] = []

    def advance(orbits: Orbits, periods: int) -> None:
        calls.append(periods)
        if len(calls) == after:
            stop.request()
        point_map.advance(orbits, periods)

    return replace(point_map, advance=advance), calls


WORK: dict[str, tuple[PointMap, Callable[[PointMap], Any], int]] = {
    "orbit before the fit": (CIRCLE, lambda m: quasiperiodic_attractors(m, POINTS, EXTENT, 10**7), 2),
    "orbit that is fitted": (CIRCLE, lambda m: quasiperiodic_attractors(m, POINTS, EXTENT, 64), 100),
    "returns of chaotic orbits": (HENON, lambda m: examine(ends_of(m, POINTS, 64)), 100),
    "sample of a chaotic attractor": (HENON, lambda m: examine(ends_of(m, POINTS, 64)), 600),
    "returns of ends": (HENON, lambda m: find_attractors(m, POINTS), 20),
}


@pytest.mark.parametrize("name", WORK)
def test_a_search_ends_when_it_is_asked_to(name: str) -> None:
    point_map, work, after = WORK[name]
    stop = Stop()
    counted, calls = interrupted(point_map, stop, after)
    with heeding(stop), pytest.raises(Stopped):
        work(counted)
    assert len(calls) == after
    assert sum(calls) < 10**5
