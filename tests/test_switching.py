"""Right-hand sides that jump: sliding and sticking, crossings, events in time; against exact solutions and SciPy."""

from __future__ import annotations

from math import pi

import numpy as np

from cellmap import stroboscopic_map
from cellmap.kernels.options import LANES
from cellmap.pointmap import CHUNK
from cellmap.threads import set_threads
from systems import dimensionless_pendulum

# Purity


def test_an_image_does_not_depend_on_its_neighbours() -> None:
    """Bit by bit, whether or not others stick: order and number of the starts, and the number of threads."""
    strobe = stroboscopic_map(dimensionless_pendulum(0.5, 0.3, 0.03, 0.4))
    starts = np.random.default_rng(0).uniform(-1.0, 1.0, (CHUNK + 777, 2)) * (pi, 3.0)
    images = strobe.iterate(starts, 2).points
    order = np.random.default_rng(1).permutation(len(starts))
    assert np.array_equal(strobe.iterate(starts[order], 2).points, images[order])
    for count in (1, 2, LANES - 1, LANES + 1):
        for first in range(0, 3 * LANES, 7):
            part = slice(first, first + count)
            assert np.array_equal(strobe.iterate(starts[part], 2).points, images[part])
    for threads in (1, 2):
        set_threads(threads)
        assert np.array_equal(strobe.iterate(starts, 2).points, images)
