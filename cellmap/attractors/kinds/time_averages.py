"""Time averages of orbits, by which those on one attractor are known in any number of dimensions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints
from ...maps.coordinates import turns_of
from ...maps.orbit_batch import Orbits
from ...maps.paths import history_of
from ...maps.point_map import PointMap
from ...orbits.invariant_circle import bump, signals_of
from ..regions.lyapunov_regions import Afford, always

PERIODS, LONGEST = 512, 4096
"""Periods over which orbits are averaged, and those over which they are where averages of fewer still change."""

_MOST_NUMBERS = 2**24  # of all places of orbits that are averaged for longer
_REGULAR = 1e-2  # difference of the averages of both halves, in units of an orbit's size, of one that is regular
_SMALL = 0.01  # least size of an orbit, in units of the region


@dataclass(frozen=True, eq=False)
class Averages:
    """Time averages (n, k) of orbits, by the weights of Das and others (2017), the error of each, and sizes (n, k)."""

    values: Floats
    errors: Floats
    sizes: Floats

    @classmethod
    def of(cls, history: Floats, point_map: PointMap, extent: Floats) -> Averages:
        """Average the coordinates of orbits (periods, n, d), and their squares about the mean."""
        turn = turns_of(point_map.coordinates)[1]
        unit = np.where(turn > 0, 1.0, extent)
        periods, d = len(history), history.shape[-1]
        signals = signals_of(history.reshape(-1, d), point_map.coordinates).reshape(history.shape) / unit
        signals = np.concatenate([signals.real, signals.imag[..., turn > 0]], axis=-1)
        sizes = np.maximum(np.ptp(signals, axis=0), _SMALL)
        centred = (signals - signals.mean(axis=0)) / sizes
        half = periods // 2
        early, late = (
            np.concatenate([np.tensordot(bump(half), part, 1), np.tensordot(bump(half), part**2, 1)], axis=-1)
            for part in (centred[:half], centred[half : 2 * half])
        )
        mean = signals.mean(axis=0) / sizes
        whole = np.tensordot(bump(periods), centred, 1) + mean
        return cls(whole * sizes, np.abs(early - late), sizes)

    @property
    def regular(self) -> Bools:
        """Which orbits are regular: the averages of both halves are the same."""
        return np.asarray((self.errors <= _REGULAR).all(axis=1))

    def apart(self, other: Averages, k: int) -> Floats:
        """Return the differences (n,) of the averages of other orbits from those of orbit k."""
        return np.asarray((np.abs(other.values - self.values[k]) / self.sizes[k]).max(axis=1))

    def with_orbit(self, k: int, other: Averages) -> None:
        """Put the averages of one other orbit in the place of those of orbit k."""
        for part in ("values", "errors", "sizes"):
            getattr(self, part)[k] = getattr(other, part)[0]


@dataclass(frozen=True, eq=False)
class Paths:
    """Where orbits were, points and full rotations (periods, d) of each, and their averages over that."""

    points: list[Floats]
    rotations: list[Ints]
    averages: Averages


def paths_of(exact: PointMap, orbits: Orbits, extent: Floats, longest: int = PERIODS, afford: Afford = always) -> Paths:
    """Follow orbits for 512 periods; those that are not regular then for twice as long, again up to the `longest`.

    On tori two of whose frequencies, or multiples of them, nearly agree, averages take as long as the beat lasts.
    Those that end are not followed for longer, and not regular.
    """
    history, rotations = history_of(exact, orbits, PERIODS)
    with np.errstate(invalid="ignore"):
        found = Paths(list(history.swapaxes(0, 1)), list(rotations.swapaxes(0, 1)), Averages.of(history, exact, extent))
    periods = PERIODS
    while 2 * periods <= longest:
        rows = np.flatnonzero(~found.averages.regular & orbits.alive)
        if (
            not len(rows)
            or 2 * periods * len(rows) * exact.dimension > _MOST_NUMBERS
            or not afford(len(rows) * periods)
        ):
            break
        some = orbits[rows]
        history, rotations = history_of(exact, some, periods)
        orbits[rows] = some
        for k, more, turned in zip(rows.tolist(), history.swapaxes(0, 1), rotations.swapaxes(0, 1), strict=True):
            found.points[k] = np.concatenate([found.points[k], more])
            found.rotations[k] = np.concatenate([found.rotations[k], turned])
            with np.errstate(invalid="ignore"):
                found.averages.with_orbit(k, Averages.of(found.points[k][:, None], exact, extent))
        periods *= 2
    return found


def spread_of(path: Floats, exact: PointMap, extent: Floats, periods: int) -> float:
    """Return the largest difference of an orbit's averages over as many periods in a row from those over all (n, d)."""
    parts = path[: len(path) // periods * periods].reshape(-1, periods, path.shape[1]).swapaxes(0, 1)
    return float(Averages.of(path[:, None], exact, extent).apart(Averages.of(parts, exact, extent), 0).max())
