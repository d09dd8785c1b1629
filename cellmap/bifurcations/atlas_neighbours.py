"""Attractors of an atlas from point to neighbouring point: where each leads, and which continue each other."""

from __future__ import annotations

import numpy as np

from .._lib.arrays import Bools, Floats, Ints
from .._lib.stopping import check_stop
from .._lib.threads import progress_bar, run_over, slices
from .atlas_families import Attractors, Directory
from .coexistence import SAME_MEAN, AttractorSearch

_SLICE = 256
_KNOWN = 0.1  # distance of means over orbits, in extents or radians, within which a neighbour needs no search


def spread(
    job: AttractorSearch, values: Floats, shape: tuple[int, int], found: Attractors, progress: str | None
) -> Attractors:
    """Add attractors, counted 0 times, to which periodic attractors of neighbouring points lead.

    ``values`` (ny * nx, 2) are the parameters.  From where an attractor is known, Newton's method looks for it at the
    neighbours where nothing like it is known; what it finds there leads further.
    """
    front, kinds = np.flatnonzero(found.period > 0), Directory.of(found).species
    with progress_bar(sum(shape), progress) as tick:
        while len(front):
            check_stop()
            directory = Directory.of(found, kinds)
            fresh, source = _led(job, values, found, *_neighbours(found, directory, front, shape))
            species = directory.species[source]
            columns = np.column_stack([fresh.place, species, np.round(fresh.centre / SAME_MEAN)])
            once = np.unique(columns, axis=0, return_index=True)[1]
            fresh, species = fresh[once], species[once]
            kept = np.flatnonzero(directory.nearest(species, fresh.centre, fresh.place, SAME_MEAN) < 0)
            fresh, kinds = fresh[kept], np.concatenate([kinds, species[kept]])
            front = np.arange(len(found), len(found) + len(fresh))
            found = Attractors.joined(found, fresh)
            tick(1)
    return found


def _led(job: AttractorSearch, values: Floats, found: Attractors, source: Ints, there: Ints) -> tuple[Attractors, Ints]:
    """Return the periodic attractors to which others lead at places ``there``, and which others those are."""
    parts: dict[int, tuple[Attractors, Ints]] = {}

    def work(part: slice) -> None:
        origin, place = found[source[part]], there[part]
        parts[part.start] = job.continued(origin, values[origin.place], values[place], place)

    run_over(slices(len(source), _SLICE), work)
    led = [(attractors, source[begin + rows]) for begin, (attractors, rows) in sorted(parts.items())]
    nothing = Attractors.empty(len(job.extent)), np.empty(0, np.int64)
    attractors, rows = zip(nothing, *led, strict=True)
    return Attractors.joined(*attractors), np.concatenate(rows)


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


def links_between(job: AttractorSearch, values: Floats, shape: tuple[int, int], found: Attractors) -> tuple[Ints, Ints]:
    """Return, for both axes of the grid, pairs (2, n) of attractors that continue each other from a point to the next.

    Attractors of neighbouring points continue each other if they have kind, period and full rotations in common, and
    each is the nearest such neighbour of the other; or, where the nearest is not near, if each leads to the other.
    """
    directory = Directory.of(found)
    links = []
    for step, axis, n in ((1, found.place % shape[1], shape[1]), (shape[1], found.place // shape[1], shape[0])):
        ahead = (axis < n - 1, axis > 0)
        rows = np.flatnonzero(ahead[0])
        there = directory.nearest(directory.species[rows], found.centre[rows], found.place[rows] + step, _KNOWN)
        rows, there = rows[there >= 0], there[there >= 0]
        back = directory.nearest(directory.species[there], found.centre[there], found.place[rows], _KNOWN)
        near = np.stack([rows, there])[:, back == rows]
        free = [on & (found.period > 0) for on in ahead]
        for mine, ends in zip(free, near, strict=True):
            mine[ends] = False
        forth = _ends(job, values, found, directory, free[0], free[1], step)
        back = _ends(job, values, found, directory, free[1], free[0], -step)
        rows = np.flatnonzero(forth >= 0)
        rows = rows[back[forth[rows]] == rows]
        links.append(np.concatenate([near, np.stack([rows, forth[rows]])], axis=1))
    return links[0], links[1]


def _ends(
    job: AttractorSearch, values: Floats, found: Attractors, directory: Directory, free: Bools, others: Bools, step: int
) -> Ints:
    """Return to which of some attractors others that are free lead a step further on (n,); -1 for none."""
    keys = found.place * directory.width + directory.species
    rows = np.flatnonzero(free)
    rows = rows[np.isin(keys[rows] + step * directory.width, keys[others])]
    led, source = _led(job, values, found, rows, found.place[rows] + step)
    ends = np.full(len(found), -1)
    ends[source] = directory.nearest(directory.species[source], led.centre, led.place, SAME_MEAN)
    return ends
