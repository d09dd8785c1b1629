"""Record of what a search for attractors has tried."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from ..maps.coordinates import Coordinate, difference
from ..maps.point_map import PointMap
from ..orbits.newton import newton, resolution, return_distances
from .trapping import extent_of_motion


@dataclass(eq=False)
class Examined:
    """What a search has tried: ends that a look comes back to, and points to which many ends lead, again and again.

    ``points``: periodic points that belong to no attractor; ``ends``: what became of guesses, by their bits and period;
    ``distances``: how close the ends of the last look have come back to themselves, by their bits; ``lines``: points of
    segments of periodic points that do not attract; ``begun``: where orbits began.
    """

    coordinates: tuple[Coordinate, ...]
    extent: Floats
    points: Floats
    ends: dict[tuple[bytes, int], Floats | None]
    distances: dict[bytes, Floats] = field(default_factory=dict)
    lines: list[Floats] = field(default_factory=list)
    begun: Floats | None = None
    _motion: Floats | None = None

    @classmethod
    def nothing_yet(cls, point_map: PointMap, extent: Floats, states: Floats | None = None) -> Examined:
        """Begin a search in a region of some extent, from some states."""
        return cls(point_map.coordinates, extent, np.empty((0, point_map.dimension)), {}, begun=states)

    def motion(self, point_map: PointMap) -> Floats:
        """Return the extent of the motion, of which trapping regions take a quarter at most."""
        if self._motion is None:
            self._motion = self.extent if self.begun is None else extent_of_motion(point_map, self.begun, self.extent)
        return self._motion

    def __contains__(self, point: Floats) -> bool:
        apart = np.abs(difference(self.points, point, self.coordinates))
        return bool((apart <= 1e-8 * resolution(point, self.extent)).all(axis=-1).any())

    def refuse(self, points: Floats) -> None:
        """Remember the points of an orbit that is no attractor."""
        self.points = np.concatenate([self.points, points])

    def refined(self, point_map: PointMap, guesses: Floats, periods: Ints) -> tuple[Floats, Bools]:
        """Refine guesses by Newton's method, each once in a search; return solutions and which guesses led to one."""
        keys = [(guess.tobytes(), int(period)) for guess, period in zip(guesses, periods, strict=True)]
        new = [i for i, key in enumerate(keys) if key not in self.ends]
        if new:
            solutions, settled = newton(point_map, guesses[new], periods[new], self.extent, attracting=True)
            for i, solution, success in zip(new, solutions, settled, strict=True):
                self.ends[keys[i]] = solution if success else None
        known = [self.ends[key] for key in keys]
        failed = np.full(point_map.dimension, np.nan)
        return (
            np.array([failed if solution is None else solution for solution in known]),
            np.array([solution is not None for solution in known]),
        )

    def return_distances(self, point_map: PointMap, ends: Floats, longest_period: int) -> Floats:
        """Return what :func:`return_distances` does; ends that were looked at just before are not followed again."""
        keys = [end.tobytes() for end in ends]
        new = [i for i, key in enumerate(keys) if len(self.distances.get(key, ())) != longest_period]
        if new:
            found = return_distances(point_map, ends[new], longest_period, self.extent)
            self.distances |= {keys[i]: distances for i, distances in zip(new, found.T, strict=True)}
        self.distances = {key: self.distances[key] for key in keys}
        return np.array([self.distances[key] for key in keys]).T
