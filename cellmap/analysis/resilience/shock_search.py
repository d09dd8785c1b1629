"""Search for minimal fatal shocks: candidates from labels, then rays, random trials and a bracket."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..._lib.arrays import Bools, Floats, Ints
from ...attractors.settling.labels import Label
from ...basins.classification import Labeller, places_of
from ...basins.record import Basins
from ...maps.coordinates import Coordinate, circular_tree, difference

_SHRINKING = 1.0 - 0.7 * 4.0 ** -np.arange(18)  # sizes that are tried on each ray, relative to the best size so far
_RAYS = 16
_PASSES = 2000  # largest number of passes of rays: a size that falls by 300 decades takes 600
_WIDEST, COARSE, FINE = 0.5, 1e-2, 2e-6  # spread of the rays, in radians: at first, of all candidates, of the best
_CANDIDATES = 4
_CLOSE = 1.5  # foreign cells within this many distances of the nearest one are candidates

Fatal = Callable[[Floats], Bools]


@dataclass(frozen=True, eq=False)
class Trials:
    """Trials of shocks (n, m) along the free coordinates, in units of length: which lead out of basin k.

    The numbers of shocks that were not decided, which count as not fatal, are kept.
    """

    label: Labeller
    k: int
    unit: Floats
    free: Ints
    undecided: list[int] = field(default_factory=list)

    def displacements(self, shocks: Floats) -> Floats:
        """Return shocks along all coordinates, in the units of these."""
        full = np.zeros((len(shocks), len(self.unit)))
        full[:, self.free] = shocks * self.unit[self.free]
        return full

    def at(self, origin: Floats) -> Fatal:
        """Return a function that says which shocks to a state are fatal."""

        def fatal(shocks: Floats) -> Bools:
            found = self.label(origin + self.displacements(shocks))
            self.undecided.append(int(np.count_nonzero(found == Label.UNDECIDED)))
            return np.asarray((found != self.k) & (found != Label.UNDECIDED))

        return fatal


def nearest_foreign(
    places: Floats, origins: Floats, unit: Floats, coordinates: Sequence[Coordinate]
) -> tuple[Floats, Ints]:
    """Return the scaled distance from each origin to the nearest of some places, angles as circles, and which it is."""
    tree, scaled = circular_tree(places, unit, coordinates)
    distance, nearest = tree.query(scaled(origins))
    return np.asarray(distance), np.asarray(nearest)


def candidates_of(basins: Basins, k: int, origins: Floats, unit: Floats, free: Ints) -> list[tuple[int, Floats]]:
    """Return an attractor's points with shocks to initial conditions outside the basin, in different directions."""
    labels = basins.labels.ravel()
    outside = places_of(basins)[(labels != k) & (labels != Label.UNDECIDED)]
    if not len(outside):
        raise ValueError(
            f"basins: no initial condition has another label than {k}; take a larger window, or a finer grid"
        )
    distance, _ = nearest_foreign(outside[:, free], origins[:, free], unit[free], [basins.coordinates[j] for j in free])
    frozen = np.setdiff1d(np.arange(len(unit)), free)
    found: list[tuple[float, int, Floats]] = []
    for row in np.argsort(distance, kind="stable")[:_CANDIDATES]:
        shifts = difference(outside, origins[row], basins.coordinates) / unit
        if len(frozen) and basins.grid is not None:
            # Along coordinates that a shock cannot change, only the nearest cells are considered.
            shifts = shifts[(np.abs(shifts[:, frozen]) <= 0.51 * basins.grid.widths[frozen] / unit[frozen]).all(axis=1)]
            if not len(shifts):
                continue
        shifts = shifts[:, free]
        sizes = np.linalg.norm(shifts, axis=1)
        near = shifts[np.argsort(sizes, kind="stable")[: max(1, np.count_nonzero(sizes <= _CLOSE * sizes.min()))]]
        chosen = [near[0]]
        for _ in range(_CANDIDATES - 1):
            apart = np.min([np.linalg.norm(near - c, axis=1) for c in chosen], axis=0)
            if apart.max() <= 0.1 * np.linalg.norm(near[0]):
                break
            chosen.append(near[int(np.argmax(apart))])
        # Rays through it at other lengths as well: a label of a cell is that of its centre alone.
        found += [(float(np.linalg.norm(c)), int(row), c) for c in chosen]
    if not found:
        raise ValueError(
            "along: no initial condition outside the basin differs in these coordinates alone; give all of them"
        )
    found.sort(key=lambda f: f[0])
    return [(row, shock) for _, row, shock in found]


def shortest_of(
    trials: Trials, origins: Floats, candidates: list[tuple[int, Floats]], rng: np.random.Generator
) -> tuple[float, int, Floats]:
    """Return the size of the smallest fatal candidate, and the shortest shock to which they lead, with its origin."""
    # A label of a table, which the exact map does not share, is no candidate.
    known = [(row, shock) for row, shock in candidates if trials.at(origins[row])(shock[None])[0]]
    if not known:
        raise ValueError(
            "basins: no labelled initial condition outside the basin is confirmed by the map; take a finer grid"
        )
    found = [(row, shortened(trials.at(origins[row]), shock, COARSE, rng)) for row, shock in known]
    row, best = min(found, key=lambda one: float(np.linalg.norm(one[1])))
    return min(float(np.linalg.norm(shock)) for _, shock in known), row, best


def shortened(fatal: Fatal, shock: Floats, finest: float, rng: np.random.Generator) -> Floats:
    """Shorten a fatal shock by trying rays about it, ever closer ones."""
    spread = _WIDEST
    d = len(shock)
    for _ in range(_PASSES):
        if spread < finest:
            break
        size = float(np.linalg.norm(shock))
        rays = shock / size + (spread * rng.standard_normal((_RAYS, d)) if d > 1 else np.zeros((1, 1)))
        rays[0] = shock / size
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        tries = (size * _SHRINKING)[:, None, None] * rays
        hit = fatal(tries.reshape(-1, d)).reshape(tries.shape[:2])
        if hit.any():
            rank, ray = np.unravel_index(int(np.argmax(hit)), hit.shape)
            shock = tries[rank, ray]
        gained = 1.0 - float(np.linalg.norm(shock)) / size
        if gained <= 0.1 * spread**2:
            spread *= 0.5
    return shock


def fatal_inside(fatal: Fatal, shock: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Return the fatal ones of some random shocks, uniform in the ball of a shock's size."""
    d = len(shock)
    rays = rng.standard_normal((count, d))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    shocks = rays * (float(np.linalg.norm(shock)) * (1.0 - 1e-6) * rng.uniform(size=(count, 1)) ** (1.0 / d))
    return shocks[fatal(shocks)]


def bracketed(fatal: Fatal, shock: Floats) -> tuple[Floats, tuple[float, float]]:
    """Return the shock shortened along its ray, with the sizes between which the basin ends on it."""
    size = float(np.linalg.norm(shock))
    factors = np.concatenate([[0.0], _SHRINKING, [1.0]])
    for _ in range(12):
        harmful = fatal(factors[:, None] * shock)
        harmful[0], harmful[-1] = False, True
        first = int(np.argmax(harmful))
        low, high = factors[first - 1], factors[first]
        if high - low <= 4e-16 * high:
            break
        factors = np.linspace(low, high, 33)
    return shock * high, (float(size * low), float(size * high))
