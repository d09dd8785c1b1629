"""Tiles of an atlas that are kept in a folder, so that a run that was interrupted goes on where it ended."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.arrays import Ints
from .._lib.checkpoint import check_belongs, plain
from .._lib.files import StoreError, written_whole
from .atlas_families import Attractors

Result = tuple[Attractors, Ints, Ints]


@dataclass(frozen=True, eq=False)
class Tiles:
    """A folder with a file for each tile that is done, and one that says to which run they belong."""

    folder: Path

    @classmethod
    def of(cls, folder: Path, belongs: Mapping[str, Any]) -> Tiles:
        """Open or make a folder; one of another run is refused, by what differs."""
        if folder.exists() and not folder.is_dir():
            raise NotADirectoryError(f"checkpoint={str(folder)!r} is a file: give the name of a folder")
        folder.mkdir(parents=True, exist_ok=True)
        settings = folder / "atlas.json"
        if settings.exists():
            try:
                theirs = json.loads(settings.read_text(encoding="utf-8"))
            except (ValueError, OSError) as error:
                raise StoreError(f"checkpoint={str(folder)!r} holds a damaged atlas.json: delete the folder") from error
            check_belongs(folder, theirs, belongs)
        else:
            if any(folder.iterdir()):
                raise StoreError(f"checkpoint={str(folder)!r} is a folder with other files: give a new one")
            with written_whole(settings) as temporary:
                temporary.write_text(json.dumps(plain(belongs)), encoding="utf-8")
        return cls(folder)

    def remembering(self, work: Callable[[int], Result]) -> Callable[[int], Result]:
        """Return work on tiles that is done once: its results are kept, and read where they are there."""

        def remembered(number: int) -> Result:
            found = self._read(number)
            if found is None:
                found = work(number)
                self._write(number, found)
            return found

        return remembered

    def _place(self, number: int) -> Path:
        return self.folder / f"tile-{number:06d}.npz"

    def _write(self, number: int, result: Result) -> None:
        attractors, escaped, undecided = result
        columns = {f.name: getattr(attractors, f.name) for f in fields(attractors)}
        with written_whole(self._place(number)) as temporary:
            np.savez(temporary, escaped=escaped, undecided=undecided, **columns)

    def _read(self, number: int) -> Result | None:
        """Return a tile; None where it is not there, or damaged."""
        try:
            with np.load(self._place(number)) as file:
                attractors = Attractors(*(file[f.name] for f in fields(Attractors)))
                return attractors, file["escaped"], file["undecided"]
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None
