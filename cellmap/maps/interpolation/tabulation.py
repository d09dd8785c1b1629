"""Exact images of the points of an interpolation grid, in tiles that a checkpoint can store."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..._lib.arrays import Floats
from ..._lib.checks import claim_disk
from ..._lib.threads import slices
from ..._lib.tiles import completed
from ..coordinates import turns_of
from ..fingerprint import PROBES, fingerprint
from ..grid import CellGrid, grid_points
from ..orbit_batch import CHUNK, Orbits, Tally, Work
from ..point_map import PointMap

if TYPE_CHECKING:
    from ..._lib.checkpoint import Checkpoint

Axes = Sequence[Floats]

_IN_A_TILE = 2048  # images in a tile that is neither sent nor sealed: even small tables keep all threads busy


@dataclass(frozen=True, eq=False)
class ExactImages:
    """Work of a tile: unwrapped images of some points of the product of axes, and the evaluations they took."""

    exact: PointMap
    axes: Axes

    def __call__(self, part: slice) -> tuple[Floats, int]:
        """Return the images of some points, by their flat numbers."""
        orbits = Orbits.starting(grid_points(self.axes, part))
        self.exact.advance(orbits, 1)
        return orbits.points + orbits.rotations * turns_of(self.exact.coordinates)[1], orbits.work.evaluations


@dataclass(frozen=True, eq=False)
class TableTiles:
    """Where the tiles of a table are computed, the file that keeps them until all are done, and what they took."""

    client: Any = None
    file: Checkpoint | None = None
    work: Work = field(default_factory=Work)

    def fill(
        self,
        exact: PointMap,
        axes: Axes,
        results: Mapping[str, NDArray[Any]],
        values: Callable[[slice, Floats], Iterable[NDArray[Any]]],
        progress: str | None,
    ) -> None:
        """Fill arrays that have a number or row for each point of a product of axes, tile by tile.

        ``values(part, images)`` returns a slice of each of them, from the unwrapped images of these points.
        """
        size = _IN_A_TILE if self.client is None and self.file is None else CHUNK
        parts = slices(int(np.prod([len(axis) for axis in axes])), size)
        tiles = tiles_of(next(iter(results)))
        file = self.file
        arrays = results if file is None else {name: file[name] for name in results}

        def contents(number: int) -> list[NDArray[Any]]:
            return [array[parts[number]] for array in arrays.values()]

        def put(number: int, images: Floats) -> None:
            for mine, value in zip(contents(number), values(parts[number], images), strict=True):
                mine[...] = value

        evaluations = np.zeros(len(parts), np.int64)
        missing = [k for k in range(len(parts)) if file is None or not file.is_done(tiles, k, contents(k))]
        images_of = ExactImages(exact, axes)

        def done(number: int) -> int:
            images, taken = images_of(parts[number])
            put(number, images)
            return taken

        if self.client is None and file is None:
            for number, taken in completed(missing, lambda number: number, done, progress=progress):
                evaluations[number] = taken
        else:
            for number, (images, taken) in completed(missing, parts.__getitem__, images_of, self.client, progress):
                evaluations[number] = taken
                put(number, images)
                if file is not None:
                    file.finish(tiles, number, Tally(evaluations=taken), contents(number))
        if file is not None:
            for name, array in results.items():
                array[...] = file[name]
            evaluations[:] = file[tiles]["tally"][:, Tally._fields.index("evaluations")]
            file.release()
        self.work.evaluations += int(evaluations.sum())


def tiles_of(array: str) -> str:
    """Name in a file for the entries of the tiles of an array."""
    return f"tiles of {array}"


def table_checkpoint(
    path: Path, exact: PointMap, grid: CellGrid, settings: Mapping[str, Any], nodes: int
) -> Checkpoint:
    """Open the file of a table, or make it."""
    from ..._lib.checkpoint import TILE, made, resumed

    cells = grid.size
    d = grid.dimension
    arrays: dict[str, tuple[tuple[int, ...], DTypeLike]] = {
        "displacement": ((nodes, d), np.float64),
        "indicator": ((cells,), np.float32),
        "rough": ((cells,), np.bool_),  # the fallback cells
        tiles_of("displacement"): ((len(slices(nodes, CHUNK)),), TILE),
        tiles_of("indicator"): ((len(slices(cells, CHUNK)),), TILE),
    }
    axes = [grid.axis(j) for j in range(d)]
    probes = grid_points(axes, np.unique(np.linspace(0, cells - 1, PROBES).astype(np.int64)))
    window = {"lower": grid.lower, "upper": grid.upper, "shape": grid.shape}
    belongs = {"what": "table", **window, **settings, **fingerprint(exact, probes)}
    found = resumed(path, belongs, lambda _: arrays, lambda _: None)
    if found is not None:
        return found[0]
    claim_disk(f"checkpoint={str(path)!r}", 8 * d * nodes + 5 * cells, path, "take fewer cells, or another disk")
    with made(path, belongs, arrays) as file:
        return file
