"""Attractors of an atlas, a table of them by parameter point, and their families."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Floats, Ints


class AtlasKind(IntEnum):
    """Kinds of attractors in an atlas."""

    PERIODIC = 0
    """Fixed point or periodic orbit."""
    ROTATING = 1
    """Periodic up to full rotations of an angle."""
    QUASIPERIODIC = 2
    """Orbits with a largest Lyapunov exponent of zero within 0.01 per period, which are seen to stay on a torus."""
    CHAOTIC = 3
    """Orbits with a positive Lyapunov exponent; all of one parameter point are counted as one attractor."""


@dataclass(frozen=True, eq=False)
class Attractors:
    """Attractors of some parameter points, one a row; see :class:`AttractorAtlas` for the columns."""

    place: Ints
    kind: NDArray[np.int8]
    period: Ints
    rotations: Ints
    point: Floats
    centre: Floats
    modulus: Floats
    count: Ints

    @classmethod
    def empty(cls, d: int) -> Attractors:
        """Return no rows."""
        whole, states = np.empty(0, np.int64), np.empty((0, d))
        kinds, turns = np.empty(0, np.int8), np.empty((0, d), np.int64)
        return cls(whole, kinds, whole, turns, states, np.empty((0, 2 * d)), np.empty(0), whole)

    def __len__(self) -> int:
        return len(self.place)

    def __getitem__(self, rows: Ints) -> Attractors:
        return Attractors(*(getattr(self, f.name)[rows] for f in fields(self)))

    def shifted(self, by: int) -> Attractors:
        """Return the rows with other numbers of their parameter points."""
        return replace(self, place=self.place + by)

    @classmethod
    def joined(cls, *parts: Attractors) -> Attractors:
        """Put rows one behind the other."""
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))


@dataclass(frozen=True, eq=False)
class Directory:
    """Attractors sorted by parameter point and species, which is what kind, period and full rotations make up."""

    place: Ints
    species: Ints
    centre: Floats
    order: Ints
    keys: Ints
    width: int

    @classmethod
    def of(cls, attractors: Attractors, species: Ints | None = None, width: int | None = None) -> Directory:
        """Sort attractors, whose species, and the number of all species, may be known already."""
        if species is None:
            code = np.zeros(len(attractors), np.int64)
            for column in (attractors.kind.astype(np.int64), attractors.period, *attractors.rotations.T):
                code = np.unique(code * (np.ptp(column) + 1 if len(column) else 1) + column, return_inverse=True)[1]
            species = code.ravel()
        width = int(species.max(initial=0)) + 1 if width is None else width
        keys = attractors.place * width + species
        order = np.argsort(keys, kind="stable")
        return cls(attractors.place, species, attractors.centre, order, keys[order], width)

    def nearest(self, species: Ints, centre: Floats, places: Ints, within: float) -> Ints:
        """Return the nearest attractors of some species at places, to means (n, 2 d); -1 where there is none near."""
        best, found = np.full(len(species), within), np.full(len(species), -1)
        rows = np.arange(len(species) if len(self.keys) else 0)
        wanted = (places * self.width + species)[rows]
        at = np.searchsorted(self.keys, wanted)
        while len(rows):
            there = (at < len(self.keys)) & (self.keys[np.minimum(at, len(self.keys) - 1)] == wanted)
            rows, at, wanted = rows[there], at[there], wanted[there]
            other = self.order[at]
            apart = np.abs(centre[rows] - self.centre[other]).max(axis=-1, initial=0.0)
            closer = apart < best[rows]
            best[rows[closer]], found[rows[closer]] = apart[closer], other[closer]
            at = at + 1
        return found


def families_of(n: int, links: tuple[Ints, Ints]) -> Ints:
    """Return the number of the family of each of n attractors, the family at most parameter points first.

    Those that continue each other, from point to point, belong to one family.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    first, second = np.concatenate(links, axis=1)
    pairs = coo_array((np.ones(len(first), bool), (first, second)), shape=(n, n))
    number = connected_components(pairs, directed=False)[1]
    size = np.bincount(number)
    begin = np.full(len(size), n)
    np.minimum.at(begin, number, np.arange(n))
    rank = np.empty(len(size), np.int64)
    rank[np.lexsort((begin, -size))] = np.arange(len(size))
    return rank[number]
