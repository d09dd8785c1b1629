"""Chaotic saddles by the stagger-and-step method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..._lib.arrays import Floats
from ..._lib.checks import affordable_number, finite_number, whole_number
from ..._lib.randomness import Rng, random_numbers
from ..._lib.signatures import checked
from ...maps.coordinates import Coordinate, wrap
from ...maps.grid import CellGrid
from ...maps.orbit_batch import Orbits
from ...maps.point_map import PointMap
from ...orbits.attractor import Attractor
from .escape import Restraint, restraint

_TRIALS = 256  # staggers that are tried together
_BATCHES = 400  # batches of staggers after which the search is given up
_SMALLEST = -15.0  # decimal exponent of the smallest stagger


@dataclass(frozen=True, eq=False)
class ChaoticSaddle:
    """Chaotic saddle, represented by a long pseudo-orbit that stays in a region which almost all orbits leave.

    Parameters
    ----------
    points : ndarray, shape (n, dimension)
        The pseudo-orbit, angles within their period.
    staggers : ndarray, shape (n,)
        Distance by which each point was perturbed before it was mapped to the next one, in units of the window; mostly
        0.
    lifetime : int
        Number of steps for which the orbit of every point stays in the region.
    largest_stagger : float
        Largest stagger.
    region : CellGrid
        The region.
    coordinates : tuple of Coordinate
        State variables.
    """

    points: Floats
    staggers: Floats
    lifetime: int
    largest_stagger: float
    region: CellGrid
    coordinates: tuple[Coordinate, ...]

    def __repr__(self) -> str:
        return (
            f"ChaoticSaddle({len(self.points)} points that stay for {self.lifetime} steps, "
            f"{np.count_nonzero(self.staggers)} staggers of at most {self.largest_stagger:.2g})"
        )


@checked
def chaotic_saddle(
    point_map: PointMap,
    region: CellGrid,
    attractors: Sequence[Attractor] = (),
    n_points: int = 5000,
    lifetime: int = 30,
    max_stagger: float = 1e-6,
    transient: int = 100,
    *,
    rng: Rng = 0,
) -> ChaoticSaddle:
    r"""Compute a pseudo-orbit on the chaotic saddle in a region by the stagger-and-step method.

    The saddle is :math:`\bigcap_{n=-\infty}^{\infty} f^n(R)`, the points of the region R whose orbits under the map f
    stay there for all time, forwards and backwards.

    A point whose orbit stays in the region for more than `lifetime` steps is mapped (a step); another one is first
    perturbed by a small random vector to a point whose orbit does (a stagger), with sizes that are distributed evenly
    over all orders of magnitude up to `max_stagger`.

    Parameters
    ----------
    point_map : PointMap
        The map.
    region : CellGrid
        The region; its sizes are the units of staggers, its cells are not used.
    attractors : sequence of Attractor, optional
        Attractors in the window, whose neighbourhoods are excluded from the region.
    n_points : int, optional
        Number of points.
    lifetime : int, optional
        Number of steps for which the orbit of each point has to stay in the region.  A point whose orbit does is about
        ``exp(-lifetime * exponent)`` away from the saddle, and staggers find it again only if that is below
        `max_stagger`; in double precision, lifetimes beyond about ``36 / exponent`` cannot be reached.
    max_stagger : float, optional
        Largest stagger.
    transient : int, optional
        Number of points that are discarded at the beginning.
    rng : int, numpy.random.Generator or None, optional
        Seed or generator of the first point and of the staggers.

    Returns
    -------
    ChaoticSaddle
        The pseudo-orbit.  Its points are near the saddle: perturbations along stable directions of the map decay, and
        those along unstable ones remain small for `lifetime` steps.  Their density is not the natural measure.

    Raises
    ------
    ValueError
        If no orbit stays so long, or no stagger of that size leads to one.

    References
    ----------
    Sweet, Nusse, Yorke, Physical Review Letters 86 (2001) 2261.

    Examples
    --------
    >>> from cellmap import discrete_map
    >>> tent = discrete_map(lambda x, p: (1.5 - 3 * abs(x[0] - 0.5),), {}, ("x",))
    >>> saddle = chaotic_saddle(tent, CellGrid((0,), (1,), (1,)), n_points=300)
    >>> bool(((saddle.points < 1 / 3 + 1e-6) | (saddle.points > 2 / 3 - 1e-6)).all())
    True
    """
    inside = restraint(point_map, region, attractors)
    wanted = affordable_number("n_points", n_points, 8 * (3 * region.dimension + 6), at_least=1)
    steps = whole_number("lifetime", lifetime, at_least=1, at_most=2**60)
    farthest = finite_number("max_stagger", max_stagger, above=1e-14, at_most=0.5)
    dropped = affordable_number("transient", transient, 8 * (3 * region.dimension + 6))
    rng = random_numbers(rng)
    point = _first(inside, steps, rng)
    total = wanted + dropped
    points, staggers = np.empty((total, len(point))), np.zeros(total)
    done, moved = 0, 0.0
    while True:
        orbit = _orbit(inside, point, steps + total - done)
        # As long as the rest of the orbit stays for more steps, it goes on without a stagger.
        count = len(orbit) - steps
        points[done : done + count] = orbit[:count]
        staggers[done] = moved
        done += count
        if done == total:
            break
        point, moved = _stagger(inside, orbit[count], steps, farthest, rng)
    if not staggers.any():
        raise ValueError(
            f"region={region!r}: an orbit stays for {total + steps} steps without a stagger, on an attractor it seems; "
            "give the attractors in the window, or another window"
        )
    kept = slice(dropped, total)
    return ChaoticSaddle(
        points[kept], staggers[kept], steps, float(staggers[kept].max()), inside.window, point_map.coordinates
    )


def _orbit(region: Restraint, point: Floats, most: int) -> Floats:
    """Return the orbit of a point as long as it stays in the region, at most some points of it."""
    now = Orbits.starting(wrap(point[None], region.point_map.coordinates))
    found: list[Floats] = []
    while len(found) < most and region(now.points)[0]:
        found.append(now.points[0].copy())
        region.point_map.advance(now, 1)
    return np.array(found)


def _first(region: Restraint, steps: int, rng: np.random.Generator) -> Floats:
    """Return a point that stays for more than some steps, found by staggers about the one that stays longest."""
    grid = region.window
    span = np.array(grid.upper) - np.array(grid.lower)
    best, stays = np.array(grid.lower), 0
    for _ in range(_BATCHES):
        if stays == 0:
            tries = rng.uniform(grid.lower, grid.upper, (16 * _TRIALS, grid.dimension))
        else:
            tries = wrap(best + _small(rng, 16 * _TRIALS, grid.dimension, 0.5) * span, region.point_map.coordinates)
        times = region.lifetimes(tries, steps + 1)
        row = int(np.argmax(times))
        if times[row] > stays:
            best, stays = tries[row], int(times[row])
        if stays > steps:
            return best
    raise ValueError(
        f"region={grid!r}: the orbit that stays longest does so for {stays} steps, not for {steps + 1}; take a smaller "
        "lifetime, or another window"
    )


def _stagger(
    region: Restraint, point: Floats, steps: int, farthest: float, rng: np.random.Generator
) -> tuple[Floats, float]:
    """Move a point to one near by that stays for more than some steps; return it and how far it is."""
    grid = region.window
    span = np.array(grid.upper) - np.array(grid.lower)
    for _ in range(_BATCHES):
        moves = _small(rng, _TRIALS, grid.dimension, farthest)
        tries = wrap(point + moves * span, region.point_map.coordinates)
        hit = np.flatnonzero(region.lifetimes(tries, steps + 1) > steps)
        if len(hit):
            return tries[hit[0]], float(np.linalg.norm(moves[hit[0]]))
    raise ValueError(
        f"max_stagger={farthest!r}: no stagger of that size leads to an orbit that stays for {steps + 1} steps; take "
        "larger staggers, or a longer lifetime, whose orbits come nearer to the saddle"
    )


def _small(rng: np.random.Generator, count: int, dimension: int, largest: float) -> Floats:
    """Return random vectors whose lengths are spread evenly over all orders of magnitude."""
    rays = rng.standard_normal((count, dimension))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    sizes = 10.0 ** rng.uniform(_SMALLEST, np.log10(largest), (count, 1))
    return np.asarray(rays * sizes)
