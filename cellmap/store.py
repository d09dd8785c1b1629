"""Basins in HDF5 files: self-describing, written whole or not at all, read without running code."""

from __future__ import annotations

import dataclasses
import json
import os
import platform
import tempfile
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from .attractor import Attractor, Cover, Kind, Neighbourhood
from .basins import LABEL_NAMES, Basins
from .coordinates import Coordinate
from .grid import CellGrid
from .pointmap import Cost

FORMAT = "cellmap basins"
SCHEMA = 1
"""Number of the layout; readers take their own and older ones."""


class StoreError(OSError):
    """A file that is not what it should be."""


def save_basins(basins: Basins, path: str | os.PathLike[str]) -> Path:
    """Write basins to an HDF5 file.

    The file is complete or it is not there: it is written beside its place and moved into it.

    Parameters
    ----------
    basins : Basins
        What to store.  Its map is stored as a recipe, not as a table: :func:`rebuild_map` makes it again.
    path : path-like
        Name of the file, such as ``"basins.h5"``; an older file of that name is replaced.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    FileNotFoundError
        For a folder that does not exist.

    Examples
    --------
    >>> import tempfile
    >>> from cellmap import CellGrid, discrete_map, find_basins
    >>> halves = find_basins(discrete_map(lambda x, p: (x[0] / 2,), {}, ("x",)), CellGrid((-1,), (1,), (8,)))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     same = load_basins(save_basins(halves, Path(folder) / "halves.h5"))
    >>> bool((same.labels == halves.labels).all())
    True
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"path={str(path)!r}: there is no folder {str(path.parent)!r}; make it first")
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    os.close(handle)
    try:
        with h5py.File(temporary, "w") as file:
            _write(file, basins)
        with open(temporary, "rb") as stream:
            os.fsync(stream.fileno())
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    return path


def load_basins(path: str | os.PathLike[str]) -> Basins:
    """Read basins from an HDF5 file.

    Parameters
    ----------
    path : path-like
        A file that :func:`save_basins` wrote.

    Returns
    -------
    Basins
        As stored, without the map: ``rebuild_map(system, basins.settings["map"])`` makes it again.

    Raises
    ------
    FileNotFoundError
        Where there is no such file.
    StoreError
        For a file that is truncated or damaged, that something else wrote, or that a newer cellmap wrote.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"path={str(path)!r}: there is no such file")
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("format") != FORMAT:
                raise StoreError(f"{str(path)!r} is an HDF5 file, but not one of basins that cellmap wrote")
            if int(file.attrs["schema"]) > SCHEMA:
                raise StoreError(
                    f"{str(path)!r} has layout {file.attrs['schema']} and this cellmap knows {SCHEMA}: update cellmap"
                )
            return _read(file)
    except StoreError:
        raise
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
        raise StoreError(f"{str(path)!r} is truncated, damaged or no HDF5 file: write it again ({error})") from error


def _umask() -> int:
    current = os.umask(0)
    os.umask(current)
    return current


def _write(file: h5py.File, basins: Basins) -> None:
    coordinates = basins.coordinates
    file.attrs["format"] = FORMAT
    file.attrs["schema"] = SCHEMA
    file.attrs["written"] = datetime.now(UTC).isoformat(timespec="seconds")
    file.attrs["versions"] = json.dumps({n: version(n) for n in ("cellmap", "numpy", "numba", "h5py")})
    file.attrs["machine"] = platform.machine()
    file.attrs["system"] = basins.name
    file.attrs["params"] = json.dumps(dict(basins.params))
    file.attrs["settings"] = json.dumps(_plain(basins.settings))
    file.attrs["coordinates"] = json.dumps([dataclasses.asdict(c) for c in coordinates])
    file.attrs["inaccurate"] = basins.inaccurate
    file.attrs["cost"] = json.dumps(dataclasses.asdict(basins.cost))
    labels = file.create_dataset("labels", data=basins.labels, compression="gzip", shuffle=True, fletcher32=True)
    labels.attrs["meaning"] = json.dumps({str(k): basins.label_name(k) for k in basins.fractions} | _codes())
    file.create_dataset(
        "settling_time", data=basins.settling_time, compression="gzip", shuffle=True, fletcher32=True
    ).attrs["unit"] = "periods"
    if basins.grid is not None:
        grid = file.create_group("grid")
        grid.attrs.update(
            lower=basins.grid.lower, upper=basins.grid.upper, shape=basins.grid.shape, wraps=basins.grid.wraps
        )
    if basins.starts is not None:
        file.create_dataset("starts", data=basins.starts, compression="gzip", shuffle=True, fletcher32=True)
    group = file.create_group("attractors")
    for k, attractor in enumerate(basins.attractors):
        _write_attractor(group.create_group(str(k)), attractor)


def _codes() -> dict[str, str]:
    return {str(k): name for k, name in LABEL_NAMES.items()}


def _write_attractor(group: h5py.Group, attractor: Attractor) -> None:
    group.attrs.update(kind=str(attractor.kind), period=attractor.period, turns=attractor.turns, name=attractor.name)
    for name in ("points", "multipliers", "exponents"):
        group[name] = getattr(attractor, name)
    for part in ("neighbourhood", "cover"):
        record = getattr(attractor, part)
        if record is not None:
            for field in dataclasses.fields(record):
                group[f"{part}/{field.name}"] = getattr(record, field.name)


def _read(file: h5py.File) -> Basins:
    coordinates = tuple(Coordinate(**c) for c in json.loads(file.attrs["coordinates"]))
    grid = None
    if "grid" in file:
        g = file["grid"].attrs
        grid = CellGrid(*(tuple(g[n].tolist()) for n in ("lower", "upper", "shape", "wraps")))
    group = file["attractors"]
    return Basins(
        labels=file["labels"][()],
        attractors=tuple(_read_attractor(group[str(k)], coordinates) for k in range(len(group))),
        settling_time=file["settling_time"][()],
        grid=grid,
        starts=file["starts"][()] if "starts" in file else None,
        name=str(file.attrs["system"]),
        params=json.loads(file.attrs["params"]),
        coordinates=coordinates,
        settings=json.loads(file.attrs["settings"]),
        inaccurate=int(file.attrs["inaccurate"]),
        cost=Cost(**json.loads(file.attrs["cost"])),
    )


def _read_attractor(group: h5py.Group, coordinates: tuple[Coordinate, ...]) -> Attractor:
    parts: dict[str, Any] = {}
    for part, record in (("neighbourhood", Neighbourhood), ("cover", Cover)):
        if part in group:
            parts[part] = record(**{f.name: group[part][f.name][()] for f in dataclasses.fields(record)})
    return Attractor(
        kind=Kind(group.attrs["kind"]),
        period=int(group.attrs["period"]),
        points=group["points"][()],
        turns=tuple(map(int, group.attrs["turns"])),
        multipliers=group["multipliers"][()],
        exponents=group["exponents"][()],
        coordinates=coordinates,
        **parts,
    )


def _plain(value: Any) -> Any:
    """Turn settings into what JSON holds."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return value.item() if isinstance(value, np.generic) else value
