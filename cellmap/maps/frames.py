"""Orbits of flows with frames of tangent vectors, for Lyapunov exponents."""

from __future__ import annotations

import numpy as np

from .._compiled.kernels.frames import carrying_along_flow
from .._lib.arrays import Floats
from .._lib.stopping import check_stop
from .._lib.threads import run_over
from .integration import Flow
from .orbit_batch import Orbits, portions
from .side_by_side import long_parts

_COSTLY = 4  # periods of orbits that take as long as one with a frame


def stretched_by_flow(
    motion: Flow, orbits: Orbits, frames: Floats, lower: Floats, turn: Floats, periods: int
) -> Floats:
    """Move orbits and their orthonormal frames on, in place; return the logarithms (n, d) of what the frames grow by.

    An orbit ends where its derivative does.
    """
    n, d = orbits.points.shape
    along = np.zeros(d * motion.vectors)
    edges = np.append(lower, along), np.append(turn, along)
    growth, carry = np.zeros((n, d)), carrying_along_flow(d)

    def work(part: slice) -> None:
        here, rotations, status = orbits.points[part], orbits.rotations[part], orbits.status[part]
        rows = np.concatenate([here, frames[part].swapaxes(1, 2).reshape(len(here), -1)], axis=1)
        wound = np.zeros(rows.shape, np.int64)
        for some in portions(periods, _COSTLY * len(here)):
            check_stop()
            carry(motion.numbers, rows, wound, status, *edges, some, growth[part])
        here[:] = rows[:, :d]
        rotations += wound[:, :d]
        frames[part] = rows[:, d:].reshape(-1, d, d).swapaxes(1, 2)

    run_over(long_parts(n, _COSTLY * periods), work)
    return growth
