"""Orbits at many parameter values, from given initial conditions or the final state at the neighbouring value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Bools, Floats, Ints
from .._lib.threads import progress_bar, run_over, slices
from ..maps.coordinates import wrap
from ..maps.orbit_batch import CHUNK, Orbits
from ..maps.point_map import PointMap

_SLICE = CHUNK // 16


@dataclass(frozen=True, eq=False)
class Recorded:
    """Orbits at values of a parameter: points and full rotations (branches, n, periods, d), the rest (branches, n)."""

    points: Floats
    rotations: Ints
    status: NDArray[np.uint8]
    restarted: Bools

    @classmethod
    def empty(cls, branches: int, n: int, periods: int, d: int) -> Recorded:
        """Begin with nothing recorded."""
        shape = (branches, n, periods, d)
        return cls(
            np.full(shape, np.nan), np.zeros(shape, np.int64), *(np.zeros((branches, n), t) for t in (np.uint8, bool))
        )

    def run(self, swept: PointMap, states: Floats, rows: Ints, columns: Ints, transient: int) -> Floats:
        """Run orbits from states (m, d + 1), keep them at places (row, column), and return where they end."""
        d = self.points.shape[-1]
        orbits = Orbits.starting(states.copy())
        swept.advance(orbits, transient)
        orbits.rotations[:] = 0
        for k in range(self.points.shape[2]):
            swept.advance(orbits, 1)
            self.points[rows, columns, k] = orbits.points[:, :d]
            self.rotations[rows, columns, k] = orbits.rotations[:, :d]
        self.points[rows[~orbits.alive], columns[~orbits.alive]] = np.nan
        self.status[rows, columns] = orbits.status
        return orbits.points


def record_each(
    swept: PointMap, axis: Floats, initial_conditions: Floats, transient: int, recorded: Recorded, label: str | None
) -> None:
    """Run every initial condition at every parameter value."""
    rows, columns = (index.ravel() for index in np.indices((len(initial_conditions), axis.size)))
    states = np.column_stack([initial_conditions[rows], axis[columns]])

    def work(part: slice) -> None:
        recorded.run(swept, states[part], rows[part], columns[part], transient)

    run_over(slices(len(states), _SLICE), work, label)


def record_followed(
    swept: PointMap,
    axis: Floats,
    initial_conditions: Floats,
    directions: tuple[str, ...],
    shift: Floats,
    transient: int,
    recorded: Recorded,
    label: str | None,
) -> None:
    """Run every branch from value to value."""
    branches, coordinates = len(initial_conditions), swept.coordinates[:-1]
    rows = np.arange(branches)
    upwards = np.array([way == "up" for way in directions])
    now, followed = initial_conditions, np.zeros(branches, bool)
    with progress_bar(axis.size, label) as tick:
        for step in range(axis.size):
            columns = np.where(upwards, step, axis.size - 1 - step)
            begin = np.where(followed[:, None], wrap(now + shift, coordinates), initial_conditions)
            states = np.column_stack([begin, axis[columns]])
            ends = np.empty(states.shape)
            for part in slices(branches, _SLICE):
                ends[part] = recorded.run(swept, states[part], rows[part], columns[part], transient)
            ended = np.asarray(np.isnan(ends).any(axis=-1))
            again = np.flatnonzero(ended & followed)
            if len(again):
                states[again, :-1] = initial_conditions[again]
                ends[again] = recorded.run(swept, states[again], rows[again], columns[again], transient)
            recorded.restarted[rows, columns] = (ended | ~followed) & (step > 0)
            now, followed = ends[:, :-1], np.asarray(np.isfinite(ends).all(axis=-1))
            tick(1)
