"""Attractors of an atlas that no initial condition reached, found from those of neighbouring parameter points."""

from __future__ import annotations

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.stopping import check_stop
from .._lib.threads import progress_bar, run_over, slices
from .atlas_families import AtlasKind, Attractors, Directory
from .coexistence import SAME_MEAN, Explorer

_SLICE = 256
_KNOWN = 0.1  # distance of means over orbits, in extents or radians, within which a neighbour needs no search
_WEAK = -0.02  # exponent per step from which orbits that approach a periodic attractor look quasi-periodic


def spread(
    job: Explorer, values: Floats, shape: tuple[int, int], found: Attractors, progress: str | None
) -> Attractors:
    """Return the attractors with those, counted 0 times, to which periodic ones of neighbouring points lead.

    ``values`` (ny * nx, 2) are the parameters.  From where an attractor is known, Newton's method looks for it at the
    neighbours where nothing like it is known; what it finds there leads further.
    """
    front, kinds = np.flatnonzero(found.period > 0), Directory.of(found).species
    with progress_bar(sum(shape), progress) as tick:
        while len(front):
            check_stop()
            directory = Directory.of(found, kinds)
            source, there = _neighbours(found, directory, front, shape)
            parts: dict[int, tuple[Attractors, Ints]] = {}

            def work(part: slice) -> None:
                parts[part.start] = job.continued(found[source[part]], values, there[part])  # noqa: B023

            run_over(slices(len(there), _SLICE), work)
            new = [(attractors, source[begin + rows]) for begin, (attractors, rows) in sorted(parts.items())]
            front = np.empty(0, np.int64)
            if new:
                fresh = Attractors.joined(*(attractors for attractors, _ in new))
                species = directory.species[np.concatenate([rows for _, rows in new])]
                columns = np.column_stack([fresh.place, species, np.round(fresh.centre / SAME_MEAN)])
                once = np.unique(columns, axis=0, return_index=True)[1]
                fresh, species = fresh[once], species[once]
                kept = np.flatnonzero(directory.nearest(species, fresh.centre, fresh.place, SAME_MEAN) < 0)
                fresh, kinds = fresh[kept], np.concatenate([kinds, species[kept]])
                front = np.arange(len(found), len(found) + len(fresh))
                found = Attractors.joined(found, fresh)
            tick(1)
    return found


def _neighbours(found: Attractors, directory: Directory, front: Ints, shape: tuple[int, int]) -> tuple[Ints, Ints]:
    """Return attractors of a front, and neighbours of their parameter points where none like them is known."""
    ny, nx = shape
    row, column = found.place[front] // nx, found.place[front] % nx
    sources, places = [], []
    for down, right in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        inside = (row + down >= 0) & (row + down < ny) & (column + right >= 0) & (column + right < nx)
        sources.append(front[inside])
        places.append(found.place[front[inside]] + down * nx + right)
    source, there = np.concatenate(sources), np.concatenate(places)
    new = directory.nearest(directory.species[source], found.centre[source], there, _KNOWN) < 0
    return source[new], there[new]


def slow_ones(found: Attractors) -> Bools:
    """Return the rows counted as quasi-periodic whose orbits may approach a periodic attractor slowly."""
    with np.errstate(divide="ignore"):
        exponent = np.log(found.modulus) / np.maximum(found.period, 1)
    weak = (found.period > 0) & (exponent > _WEAK)
    return (found.kind == AtlasKind.QUASIPERIODIC) & np.isin(found.place, found.place[weak])
