"""Lyapunov exponents of orbits that are carried on until the sign of the largest one is known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints
from ..._lib.stopping import check_stop
from ...maps.coordinates import difference, wrap
from ...maps.orbit_batch import Orbits, Status
from ...maps.point_map import PointMap
from ...maps.side_by_side import advance_on_threads
from ...maps.tangent import tangent
from ...orbits.lyapunov import stretched
from ...orbits.lyapunov_qr import BLOCKS, is_positive
from ..regions.tube import SAMPLED

FRAME, GROWING = 4, 256
"""Directions in which growth is seen in more than four dimensions where nobody asks for more, and the periods."""

AT_LEAST = 200_000
"""Images of the map that a search may take besides following orbits, however few these are."""

_APART = 1e-5  # distance of orbits beside one another, in units of the region
_VOLUMES = 8  # points of an orbit at which it is seen how volumes change, in more than four dimensions
_ALIGNING = 8  # one in so many of the first periods turns frames of a few directions into those of largest growth


@dataclass(frozen=True, eq=False)
class Growing:
    """How frames that orbits carry along have grown in ten blocks of equal length, from which they may be carried on.

    In up to four dimensions the frames have all directions, and are moved by derivatives; in more, where these cost
    too much, they have a few, seen in orbits that begin beside others.

    ``orbits``: where these are; ``frames`` (n, d, k); ``logs`` (10, n, k): logarithms of the growth in each block;
    ``length``: periods of a block; ``extent``: size of the region.
    """

    exact: PointMap
    orbits: Orbits
    frames: Floats
    logs: Floats
    length: int
    extent: Floats

    @classmethod
    def along(
        cls, exact: PointMap, points: Floats, periods: int, extent: Floats | None = None, directions: int | None = None
    ) -> Growing:
        """Begin at points (n, d) and go on for some periods; those in few directions are aligned meanwhile."""
        n, d = points.shape
        orbits = Orbits.starting(wrap(points, exact.coordinates))
        number = d if directions is None else min(directions, d)
        frame = (
            np.eye(d) if directions is None else np.linalg.qr(np.random.default_rng(0).standard_normal((d, number)))[0]
        )
        frames = np.tile(frame, (n, 1, 1))
        aligning = 0 if directions is None else periods // _ALIGNING
        length = max((periods - aligning) // BLOCKS, 1)
        begun = cls(exact, orbits, frames, np.empty((0, n, number)), length, np.ones(d) if extent is None else extent)
        if aligning:
            begun._grown(aligning)
        return replace(begun, logs=np.array([begun._grown(length) for _ in range(BLOCKS)]))

    def __getitem__(self, rows: Ints) -> Growing:
        return replace(self, orbits=self.orbits[rows], frames=self.frames[rows], logs=self.logs[:, rows])

    @property
    def periods(self) -> int:
        """Periods over which growth is known."""
        return self.length * len(self.logs)

    @property
    def exponents(self) -> Floats:
        """Exponents per step (n, k), in the order of the axes of the frames; NaN where an orbit has ended."""
        total = self.logs.sum(axis=0)
        total[~self.orbits.alive] = np.nan
        return np.asarray(total / self.periods)

    @property
    def errors(self) -> Floats:
        """Standard errors (n, k) of the exponents, from the means over the blocks."""
        with np.errstate(invalid="ignore"):  # a vanishing derivative has an infinite logarithm
            found = (self.logs / self.length).std(axis=0, ddof=1) / np.sqrt(BLOCKS)
        found[~self.orbits.alive] = np.nan
        return np.asarray(found)

    @property
    def zero(self) -> Bools:
        """Which exponents (n, k) are zero: within five standard errors, or a factor e over all periods."""
        return np.asarray(np.abs(self.exponents) <= np.maximum(5.0 * self.errors, 1.0 / self.periods))

    @property
    def largest(self) -> tuple[Floats, Floats]:
        """The largest exponent of each orbit (n,) and its standard error."""
        exponents, errors = self.exponents, self.errors
        first = np.argmax(np.where(np.isnan(exponents), -np.inf, exponents), axis=-1)
        return exponents[np.arange(len(first)), first], errors[np.arange(len(first)), first]

    @property
    def signs(self) -> Ints:
        """The sign of the largest exponent of each orbit (n,): 0 where it is not known by five standard errors.

        That of an orbit that creeps to rest, where displacements shrink like a power of time, is not.
        """
        return _signs(*self.largest, self.periods)

    def volumes(self, points: Floats) -> Floats:
        """Return the rates per step (n,) at which volumes grow along orbits that began at points (n, d).

        In more than four dimensions they are those at a few points: all would cost as much as hundreds of orbits.
        """
        if self.exact.dimension <= SAMPLED:
            return np.asarray(self.exponents.sum(axis=-1))
        rates, here = np.zeros(len(points)), Orbits.starting(wrap(points, self.exact.coordinates))
        for _ in range(_VOLUMES):
            places = np.where(here.alive[:, None], here.points, 0.0)
            with np.errstate(invalid="ignore", divide="ignore"):
                rates += np.linalg.slogdet(tangent(self.exact, places, coarse=True)[1])[1] / _VOLUMES
            self.exact.advance(here, 1)
        return rates

    @property
    def images(self) -> int:
        """Images, for each direction one, that it takes to follow the orbits for as many periods again."""
        return len(self.frames) * self.periods * (1 + self.frames.shape[-1])

    def carried_on(self) -> Growing:
        """Go on for as many periods again, with blocks of twice the length: they outgrow what correlates them."""
        more = [self._grown(2 * self.length) for _ in range(BLOCKS // 2)]
        return replace(self, logs=np.concatenate([self.logs[::2] + self.logs[1::2], more]), length=2 * self.length)

    def _grown(self, periods: int) -> Floats:
        check_stop()
        if self.frames.shape[1] == self.frames.shape[2] <= SAMPLED:
            return stretched(self.exact, self.orbits, self.frames, periods)
        return _stretched_beside(self.exact, self.orbits, self.frames, self.extent, periods)


def _stretched_beside(exact: PointMap, orbits: Orbits, frames: Floats, extent: Floats, periods: int) -> Floats:
    """Move orbits and their frames on, as seen from orbits beside them; return logarithms (n, k) of their growth."""
    n, d, number = frames.shape
    total = np.zeros((n, number))
    for _ in range(periods):
        check_stop()
        here = np.where(orbits.alive[:, None], orbits.points, 0.0)
        beside = here[:, None] + _APART * frames.transpose(0, 2, 1) * extent
        places = np.concatenate([here[:, None], beside], axis=1).reshape(-1, d)
        moved = Orbits.starting(wrap(places, exact.coordinates))
        advance_on_threads(exact.advance, moved, 1)
        orbits.end(orbits.alive & ~moved.alive.reshape(n, -1).all(axis=1), Status.DIVERGED)
        images = np.where(orbits.alive[:, None, None], moved.points.reshape(n, 1 + number, d), 0.0)
        orbits.points[orbits.alive] = images[orbits.alive, 0]
        growth = difference(images[:, 1:], images[:, :1], exact.coordinates) / extent / _APART
        growth[~orbits.alive] = np.eye(number, d)
        frames[:], upper = np.linalg.qr(growth.transpose(0, 2, 1))
        with np.errstate(divide="ignore"):
            total += np.log(np.abs(np.diagonal(upper, axis1=1, axis2=2)))
    return total


def _signs(largest: Floats, errors: Floats, periods: int) -> Ints:
    with np.errstate(invalid="ignore"):
        negative = largest < -np.maximum(5.0 * errors, 1.0 / periods)
        return is_positive(largest, errors, periods) - negative.astype(np.int64)


def pooled(growth: Growing, images: float, age: int) -> tuple[Floats, int]:
    """Return the mean exponents (k,) of orbits on one set, and the sign of the largest, 0 where it is not known.

    All orbits are carried on, for twice as long again and again, while an exponent is `unclear` at their age and there
    are images for it.
    """
    while True:
        means, cost = growth.logs.mean(axis=1) / growth.length, growth.images
        with np.errstate(invalid="ignore"):
            mean, error = means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(BLOCKS)
        if not unclear(mean, error, age).any() or cost > images:
            return mean, int(_signs(mean, error, growth.periods)[np.argmax(mean)])
        images, growth = images - cost, growth.carried_on()


def unclear(exponents: Floats, errors: Floats, age: int) -> Bools:
    """Tell which exponents may have either sign by five standard errors, and may be more than shear is at some age."""
    least = np.log(max(age, 2)) / max(age, 2)
    return np.asarray((np.abs(exponents) <= 5.0 * errors) & (np.abs(exponents) + 5.0 * errors > least))


def growth_along(point_map: PointMap, points: Floats, extent: Floats, periods: int) -> Growing:
    """Return how displacements grow along orbits: in more than four dimensions those in four directions."""
    exact = point_map.without_table
    return Growing.along(exact, points, periods, extent, None if exact.dimension <= SAMPLED else FRAME)


def mean_exponents(
    point_map: PointMap, exponents: Floats, ends: Floats, periods: int, extent: Floats, images: float
) -> Floats:
    """Return the exponents of an attractor, the largest first, from those (n, k) of orbits on it, and their ends.

    Where these, over some periods, do not tell the sign of one, orbits are followed on.  In more than four dimensions
    it is the largest exponent alone.
    """
    mean = exponents.mean(axis=0)
    with np.errstate(invalid="ignore"):  # a vanishing derivative has an infinite logarithm
        error = exponents.std(axis=0) / np.sqrt(len(exponents))
    if unclear(mean, error, periods).any():
        mean, _ = pooled(growth_along(point_map, ends, extent, 2 * periods), images, periods)
    mean = -np.sort(-mean)
    return np.asarray(mean if len(mean) == point_map.dimension else mean[:1])
