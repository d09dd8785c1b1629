"""Checkpoints of proofs: the cells of each level, once it is done."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import DTypeLike

from ..._lib.checks import claim_disk
from ..._lib.files import as_checkpoint, locked
from ...maps.orbit_batch import Tally
from ..initial_conditions import InitialConditions
from ..record import Basins
from .regions import ProvedCells, Region

if TYPE_CHECKING:
    from ..._lib.checkpoint import Checkpoint

_TILES = "levels"


class Levels:
    """Levels of cells in a file, or nowhere."""

    def __init__(self, file: Checkpoint | None) -> None:
        self._file = file

    def found(self, level: int, proved: ProvedCells) -> int | None:
        """Read a level into cells, where it is in the file; return how many boxes were enclosed for it."""
        if self._file is None:
            return None
        kept = [self._file[f"{name} {level}"] for name in ("labels", "ranks")]
        if not self._file.is_done(_TILES, level, kept):
            return None
        proved.labels[...], proved.ranks[...] = kept
        return int(self._file[_TILES]["tally"][level, Tally._fields.index("evaluations")])

    def finish(self, level: int, proved: ProvedCells, boxes: int) -> None:
        """Keep a level that is done."""
        if self._file is not None:
            kept = [self._file[f"{name} {level}"] for name in ("labels", "ranks")]
            kept[0][...], kept[1][...] = proved.labels, proved.ranks
            self._file.finish(_TILES, level, Tally(evaluations=boxes), kept)


@contextmanager
def levels_kept(
    checkpoint: str | os.PathLike[str] | None,
    basins: Basins,
    region: Region,
    splits: int,
    max_periods: int,
    parameters: Mapping[str, tuple[float, float]],
) -> Iterator[Levels]:
    """Open the levels of a run, which are found again under the same arguments alone."""
    path = as_checkpoint(checkpoint)
    with locked(path):
        if path is None:
            yield Levels(None)
            return
        assert basins.point_map is not None
        settings = {
            "what": "proof",
            "splits": splits,
            "max_periods": max_periods,
            "intervals": dict(parameters),
            "region": [region.before, region.after],
            "labels": hashlib.sha256(np.ascontiguousarray(basins.labels).tobytes()).hexdigest(),
            **InitialConditions(basins.grid, None).fingerprint(basins.point_map),
        }
        yield Levels(_opened(path, settings, region, splits))


def _opened(path: Path, belongs: Mapping[str, object], region: Region, splits: int) -> Checkpoint:
    from ..._lib.checkpoint import TILE, made, resumed

    shapes = [replace(region, level=level).shape for level in range(splits + 1)]
    arrays: dict[str, tuple[tuple[int, ...], DTypeLike]] = {
        f"labels {k}": (shape, np.int16) for k, shape in enumerate(shapes)
    }
    arrays |= {f"ranks {k}": (shape, np.int32) for k, shape in enumerate(shapes)}
    arrays[_TILES] = ((splits + 1,), TILE)
    found = resumed(path, belongs, lambda _: arrays, lambda _: None)
    if found is not None:
        return found[0]
    needed = 6 * sum(int(np.prod(shape)) for shape in shapes)
    claim_disk(f"checkpoint={str(path)!r}", needed, path, "take fewer splits, or another disk")
    with made(path, belongs, arrays) as file:
        return file
