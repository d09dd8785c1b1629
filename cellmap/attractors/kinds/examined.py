"""What a search for attractors has tried, and what became of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints, evenly
from ...maps.coordinates import Coordinate, difference
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor
from ...orbits.newton import newton, resolution, return_distances
from ..regions.extents import extent_of_motion, region_extent, ways_of
from ..regions.tube import SAMPLED
from ..settling.escape import escape_on, far_bound
from .exponents import AT_LEAST

_IMAGES = 1500  # of the map, for each state where orbits begin, that a search may take besides following them
_ATTRACTORS = 2**32  # more than there are
_REFINING = 4  # derivatives, a direction like an image, that take an end to the multipliers of its orbit
_FOLLOWED = 256, 2**15  # orbits, and coordinates of all of them, along which curves are looked for in one look


@dataclass(eq=False)
class Examined:
    """What a search has tried: ends that a look comes back to, and points to which many ends lead, again and again.

    ``points``: periodic points that belong to no attractor; ``ends``: what became of guesses, by their bits and period,
    and of looks for curves, by the states, or their sum, and a negative number;
    ``distances``: how close the ends of the last look have come back to themselves, by their bits; ``lines``: points of
    segments of periodic points that do not attract; ``ways``: how far orbits go; ``bound``: beyond which
    orbits were seen to escape; ``images``: images of the map that Newton's method, regions of attractors and looks for
    curves may still take in more than four dimensions; ``so_far``: attractors, labels and times of a search that goes
    on; ``verified``: periodic attractors since its beginning.
    """

    coordinates: tuple[Coordinate, ...]
    extent: Floats
    points: Floats
    ends: dict[tuple[bytes, int], Floats | None]
    distances: dict[bytes, Floats] = field(default_factory=dict)
    lines: list[Floats] = field(default_factory=list)
    ways: Floats | None = None
    bound: Floats | None = None
    images: float = np.inf
    so_far: tuple[list[Attractor], Ints, Ints] | None = None
    verified: list[Attractor] = field(default_factory=list)

    @classmethod
    def nothing_yet(cls, point_map: PointMap, extent: Floats) -> Examined:
        """Begin a search in a region of some extent."""
        return cls(point_map.coordinates, extent, np.empty((0, point_map.dimension)), {})

    @classmethod
    def of_region(cls, point_map: PointMap, region: Floats, states: Floats) -> Examined:
        """Begin a search in a region, shown by some of its points, from some states."""
        ways, path = ways_of(point_map, states)
        empty = cls.nothing_yet(point_map, region_extent(point_map, region, ways))
        bound, images = far_bound(point_map, region), float(max(_IMAGES * len(states), AT_LEAST))
        return replace(empty, ways=ways, images=images, bound=bound if escape_on(path, bound) else None)

    def of_sample(self, point_map: PointMap, states: Floats) -> Examined:
        """Return what has been tried for a sample of states: nothing, where it has an extent of its own."""
        own = region_extent(point_map, states, self.ways)
        if np.array_equal(own, self.extent):
            return self
        return replace(self.nothing_yet(point_map, own), ways=self.ways, images=self.images, bound=self.bound)

    def afford(self, images: int) -> bool:
        """Take some of the images that are left; False where these are too few."""
        if images > self.images:
            return False
        self.images -= images
        return True

    @property
    def reach(self) -> Floats:
        """The extent of the motion, of which trapping regions take a quarter at most."""
        return self.extent if self.ways is None else extent_of_motion(self.extent, self.ways)

    def __contains__(self, point: Floats) -> bool:
        apart = np.abs(difference(self.points, point, self.coordinates))
        return bool((apart <= 1e-8 * resolution(point, self.extent)).all(axis=-1).any())

    def looked_along(self, states: Floats, age: int, known: int, slow: bool) -> Floats:
        """Return those of the orbits of an age along which curves are to be looked for, and remember them.

        None where the same look was made with as many known attractors; in more than four dimensions some of those
        that were not followed at this age, so many that many move on together.
        """
        look = -(2 * age + int(slow)) * _ATTRACTORS
        if states.shape[1] <= SAMPLED:
            # A look at slow orbits as well sees all that another one would.
            keys = [(states.sum(axis=0).tobytes(), k - known) for k in (look, -2 * age * _ATTRACTORS)]
            chosen = states[:0] if keys[0] in self.ends else states
        else:
            left = [k for k, state in enumerate(states) if (state.tobytes(), look) not in self.ends]
            most = min(_FOLLOWED[0], _FOLLOWED[1] // states.shape[1])
            chosen = states[np.array(left, int)[evenly(len(left), most)]]
            keys = [(state.tobytes(), look) for state in chosen]
        self.ends |= dict.fromkeys(keys)
        return chosen

    def refuse(self, points: Floats) -> None:
        """Remember the points of an orbit that is no attractor."""
        self.points = np.concatenate([self.points, points])

    def may_refine(self, guesses: Floats, periods: Ints) -> bool:
        """Tell whether Newton's method can be afforded for guesses (n, d), which it is in few dimensions."""
        d = guesses.shape[1]
        new = [(guess.tobytes(), int(q)) not in self.ends for guess, q in zip(guesses, periods, strict=True)]
        return d <= SAMPLED or self.afford(_REFINING * d * int(periods[new].sum()))

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
