"""Larger and larger balls around attractors, all of whose points are proved to come into the smaller ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..._compiled.kernels.cell_covers import Place
from ..._compiled.kernels.parallelepipeds import GOING, find_sets
from ..._lib.arrays import Floats
from ..._lib.midpoint_radius import ROUNDING, inverse
from ...maps.coordinates import turns_of
from ...maps.point_map import PointMap
from ...orbits.contraction import ContractionBalls, cover_of_ball
from .orbits_of_sets import on_threads, orbits_of

_LARGEST = 0.5  # largest half-width of a ball, in extents
_FURTHER = 1.5  # ratio of the radius of a larger ball to that of the ball inside it
_PARTS = {1: (128,), 2: (32, 64), 3: (8, 16)}  # boxes along each axis; more where these fail
_MOST = 1 << 16  # boxes of all balls


def grown(
    exact: PointMap,
    balls: ContractionBalls,
    extent: Floats,
    max_periods: int,
    parameters: Mapping[str, Any] | None = None,
) -> tuple[ContractionBalls, int]:
    """Return balls with the largest reach that is found, and how many boxes were enclosed.

    The shell between two radii is covered by boxes, and each of these is followed until it lies in a ball of the
    smaller radius.  Near an attractor that shears its neighbourhood no norm decreases at each step, so that balls of
    contraction may be smaller than cells.
    """
    period, d = balls.centres.shape
    work = 0
    for parts in _PARTS.get(d, ()):
        while max_periods and _FURTHER * balls.reach <= _LARGEST and period * parts**d <= _MOST:
            come, more = _come(exact, balls, parts, extent, max_periods, parameters)
            work += more
            if not come:
                break
            balls = replace(balls, reach=_FURTHER * balls.reach)
    return balls, work


def _come(
    exact: PointMap,
    balls: ContractionBalls,
    parts: int,
    extent: Floats,
    max_periods: int,
    parameters: Mapping[str, Any] | None,
) -> tuple[bool, int]:
    """Tell whether all points of a shell around balls come into these, and how many boxes were enclosed."""
    period, d = balls.centres.shape
    inverses, further = inverse(balls.frames), _FURTHER * balls.reach
    covers = [
        cover_of_ball(balls.centres[k], balls.frames[k], inverses[k], further, parts, balls.reach)
        for k in range(period)
    ]
    centres = np.concatenate([c for c, _ in covers])
    orbits = orbits_of(exact, centres, np.concatenate([np.broadcast_to(h, c.shape) for c, h in covers]), parameters)
    known_balls = balls.centres, balls.frames, np.full(period, balls.reach)
    nowhere = np.zeros((d, 1)), np.zeros((d, 0)), *3 * (np.zeros(d, np.int64),)
    place = Place(*nowhere, turns_of(exact.coordinates)[1], *3 * (np.zeros(d),))
    no_cells = np.zeros(0, np.int16), np.zeros(0, np.int32)
    work, left = 0, len(centres)
    for _ in range(max_periods):
        work += left
        sets, known = orbits.next()
        outcome, reached = np.empty(left, np.int64), np.empty(left, np.int64)
        where = place, known_balls, np.ones(period, np.int64), extent, *no_cells, ROUNDING
        on_threads(left, find_sets, sets, known, *where, outcome, reached)
        if (outcome < 0).any():
            break
        orbits.keep(outcome == GOING)
        left = int(np.count_nonzero(outcome == GOING))
        if not left:
            return True, work
    return False, work
