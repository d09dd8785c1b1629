"""Passes over cells: those in balls, those whose images meet proved cells only, and those whose orbits come to them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._compiled.kernels.cell_covers import Place, cells_in_balls, list_met, prove_cells
from ..._compiled.kernels.parallelepipeds import GOING, find_sets
from ..._lib.arrays import Floats, Ints
from ..._lib.midpoint_radius import ROUNDING, Rounding
from ..._lib.threads import progress_bar, slices
from ...maps.point_map import PointMap
from ...orbits.contraction import ContractionBalls
from .orbits_of_sets import forms_of, on_threads, orbits_of
from .regions import ProvedCells, centres_of

_ROWS = 2**16  # boxes that are enclosed together, for which memory is taken
_MOST = {1: 64, 2: 40, 3: 160}  # cells that the image of a provable one may meet
_WIDEST = 0.12  # largest half-width of a set that is followed, in extents of the region


@dataclass(frozen=True, eq=False)
class Machine:
    """What encloses images, and where they have to come."""

    point_map: PointMap
    parameters: Mapping[str, Any] | None
    balls: tuple[Floats, Floats, Floats]
    numbers: Ints
    extent: Floats
    progress: bool = False
    rounding: Rounding = ROUNDING

    @classmethod
    def of(
        cls,
        point_map: PointMap,
        parameters: Mapping[str, Any] | None,
        attractors: Mapping[int, ContractionBalls],
        extent: Floats,
        progress: bool,
    ) -> Machine:
        """Collect the balls of all attractors."""
        d, each = point_map.dimension, list(attractors.items())
        centres = np.concatenate([np.empty((0, d)), *(b.centres for _, b in each)])
        frames = np.concatenate([np.empty((0, d, d)), *(b.frames for _, b in each)])
        counts = [len(b.centres) for _, b in each]
        radii = np.repeat([b.reach for _, b in each], counts).astype(float)
        numbers = np.repeat(np.array([k + 1 for k, _ in each], np.int64), counts)
        return cls(point_map, parameters, (centres, frames, radii), numbers, extent, progress)

    def claim_balls(self, proved: ProvedCells, place: Place) -> None:
        """Prove the cells that lie in balls."""
        if len(self.numbers):
            cells_in_balls(place, self.balls, self.numbers, self.rounding, proved.labels.ravel(), proved.ranks.ravel())

    def claim_images(self, proved: ProvedCells, place: Place) -> tuple[Met, int]:
        """Prove cells whose images meet proved cells only; return what the others meet, and how many were enclosed.

        What meets a cell that is HOPELESS is not looked at further.
        """
        labels, half = proved.labels.ravel(), place.half
        cells, found = np.flatnonzero(labels == 0), []
        for part in self._parts(len(cells), "enclosing cells"):
            mine = cells[part]
            forms = forms_of(self.point_map, centres_of(place, mine), half, self.parameters)
            met, counts = np.empty((len(mine), _MOST[len(half)]), np.int32), np.empty(len(mine), np.int64)
            on_threads(len(mine), list_met, forms, half, place, self.rounding, labels, met, counts)
            some = counts > 0
            found.append((mine[some], counts[some], met[some][np.arange(met.shape[1]) < counts[some, None]]))
        joined = Met.joined(found)
        joined.prove(proved)
        return joined, len(cells)

    def claim_orbits(self, proved: ProvedCells, place: Place, cells: Ints, most: int) -> int:
        """Prove cells that come to proved cells of one label, or into a ball, within some periods.

        Returns the number of boxes that were enclosed.
        """
        labels, ranks = proved.labels.ravel(), proved.ranks.ravel()
        frozen, total = (labels.copy(), ranks.copy()), 0
        for part in self._parts(len(cells), "orbits of cells"):
            mine = cells[part]
            found, rank, count = self._followed(centres_of(place, mine), place, *frozen, most)
            some = found > 0
            labels[mine[some]], ranks[mine[some]] = found[some], rank[some]
            total += count
        return total

    def _followed(self, centres: Floats, place: Place, labels: Any, ranks: Any, most: int) -> tuple[Ints, Ints, int]:
        """Follow boxes as parallelepipeds; return their labels, 0 where nothing is proved, ranks, and the work."""
        n = len(centres)
        found, rank, rows, count = np.zeros(n, np.int64), np.zeros(n, np.int64), np.arange(n), 0
        orbits = orbits_of(self.point_map, centres, np.broadcast_to(place.half, centres.shape), self.parameters)
        for _ in range(most):
            if not len(rows):
                break
            count += len(rows)
            sets, known = orbits.next()
            outcome, reached = np.empty(len(rows), np.int64), np.empty(len(rows), np.int64)
            where = place, self.balls, self.numbers, _WIDEST * self.extent, labels, ranks, self.rounding
            on_threads(len(rows), find_sets, sets, known, *where, outcome, reached)
            done, going = outcome > 0, outcome == GOING
            found[rows[done]], rank[rows[done]] = outcome[done], reached[done]
            orbits.keep(going)
            rows = rows[going]
        return found, rank, count

    def _parts(self, total: int, what: str) -> Iterator[slice]:
        """Yield parts of the work, shown by a bar."""
        with progress_bar(total, f"{what} of {self.point_map.name}" if self.progress else None) as advance:
            for part in slices(total, _ROWS):
                yield part
                advance(part.stop - part.start)


@dataclass(frozen=True, eq=False)
class Met:
    """Cells whose images are enclosed, and the cells that these meet."""

    cells: Ints
    bounds: Ints
    met: Any

    @classmethod
    def joined(cls, parts: list[tuple[Any, Any, Any]]) -> Met:
        """Join those of several parts."""
        cells, counts, met = zip(*parts, strict=True) if parts else ((), (), ())
        bounds = np.concatenate([[0], np.cumsum(np.concatenate([np.empty(0, np.int64), *counts]))])
        none = np.empty(0, np.int64), np.empty(0, np.int32)
        return cls(np.concatenate([none[0], *cells]), bounds, np.concatenate([none[1], *met]))

    def prove(self, proved: ProvedCells) -> int:
        """Prove what follows from the cells that are proved; return how many cells are new."""
        return int(prove_cells(self.cells, self.bounds, self.met, proved.labels.ravel(), proved.ranks.ravel()))
