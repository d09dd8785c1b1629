"""Basins in HDF5 files: self-describing, written whole or not at all, read without running code."""

from __future__ import annotations

import dataclasses
import hashlib
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


_ONLY = "basins"  # name of a picture that is alone in its file


class StoreError(OSError):
    """A file that is not what it should be."""


def save_basins(basins: Basins | Mapping[str, Basins], path: str | os.PathLike[str]) -> Path:
    """Write basins to an HDF5 file.

    The file is complete or it is not there: it is written beside its place and moved into it.

    Parameters
    ----------
    basins : Basins or mapping of str to Basins
        What to store, several pictures under names of their own.  Maps are stored as recipes, not as tables:
        :func:`rebuild_map` makes them again.
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
    ValueError
        For an empty mapping, or a name that is empty or holds a slash.

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
    path = _as_path(path)
    pictures = basins if isinstance(basins, Mapping) else {_ONLY: basins}
    for picture in pictures.values():
        if not isinstance(picture, Basins):
            raise TypeError(
                f"basins={picture!r}: give Basins, as find_basins returns them, or a mapping of names to them"
            )
    if not pictures or any(not name or "/" in name for name in pictures):
        raise ValueError(
            f"basins has the names {list(pictures)}: give at least one, none of them empty or with a slash"
        )
    if not path.parent.is_dir():
        raise FileNotFoundError(f"path={str(path)!r}: there is no folder {str(path.parent)!r}; make it first")
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    os.close(handle)
    temporary = Path(name)
    try:
        with h5py.File(temporary, "w") as file:
            file.attrs.update(format=FORMAT, schema=SCHEMA, written=datetime.now(UTC).isoformat(timespec="seconds"))
            file.attrs["versions"] = json.dumps({n: version(n) for n in ("cellmap", "numpy", "numba", "h5py")})
            file.attrs["machine"] = platform.machine()
            for key, picture in pictures.items():
                _write(file.create_group(key), picture)
            file.attrs["digest"] = _digest(file)
        with temporary.open("rb") as stream:
            os.fsync(stream.fileno())
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    return path


def load_basins(path: str | os.PathLike[str], name: str | None = None) -> Basins:
    """Read basins from an HDF5 file.

    Parameters
    ----------
    path : path-like
        A file that :func:`save_basins` wrote.
    name : str, optional
        Which picture, in a file of several.

    Returns
    -------
    Basins
        As stored, without the map: ``rebuild_map(system, basins.settings["map"])`` makes it again.

    Raises
    ------
    FileNotFoundError
        Where there is no such file.
    KeyError
        For a name that the file does not hold, or none where it holds several.
    StoreError
        For a file that is truncated or damaged, that something else wrote, or that a newer cellmap wrote.
    """
    path = _as_path(path)
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
            if file.attrs["digest"] != _digest(file):
                raise StoreError(
                    f"{str(path)!r} is damaged: its contents are not those that were written; write it again"
                )
            names = list(file)
            chosen = names[0] if name is None and len(names) == 1 else name
            if chosen in names:
                return _read(file[chosen])
    except StoreError:
        raise
    except (OSError, KeyError, ValueError, TypeError, RuntimeError, UnicodeDecodeError) as error:
        raise StoreError(f"{str(path)!r} is truncated, damaged or no HDF5 file: write it again ({error})") from error
    raise KeyError(f"name={name!r}: {str(path)!r} holds {', '.join(names)}; name one of them")


def _as_path(path: Any) -> Path:
    try:
        return Path(path)
    except TypeError:
        raise TypeError(f"path={path!r}: give the name of a file") from None


def _digest(file: h5py.File) -> str:
    """Hash of all that a file holds: names, attributes and arrays."""
    digest = hashlib.sha256()

    def add(name: str, item: h5py.Group | h5py.Dataset) -> None:
        digest.update(name.encode())
        for key in sorted(set(item.attrs) - {"digest"}):
            digest.update(f"{key}={np.asarray(item.attrs[key]).tolist()!r}".encode())
        if isinstance(item, h5py.Dataset):
            values = np.asarray(item[()])
            digest.update(f"{values.dtype.str}{values.shape}".encode() + values.tobytes())

    add("/", file)
    file.visititems(add)
    return digest.hexdigest()


def _add_array(group: h5py.Group, name: str, values: Any) -> h5py.Dataset:
    """Store an array compressed, a scalar as it is."""
    packed = {"compression": "gzip", "shuffle": True, "fletcher32": True} if np.ndim(values) else {}
    return group.create_dataset(name, data=values, **packed)


def _umask() -> int:
    current = os.umask(0)
    os.umask(current)
    return current


def _write(file: h5py.Group, basins: Basins) -> None:
    file.attrs["system"] = basins.name
    file.attrs["params"] = json.dumps(dict(basins.params))
    file.attrs["settings"] = json.dumps(_plain(basins.settings))
    file.attrs["coordinates"] = json.dumps([dataclasses.asdict(c) for c in basins.coordinates])
    file.attrs["inaccurate"] = basins.inaccurate
    file.attrs["cost"] = json.dumps(dataclasses.asdict(basins.cost))
    labels = _add_array(file, "labels", basins.labels)
    labels.attrs["meaning"] = json.dumps({str(k): basins.label_name(k) for k in basins.fractions} | _codes())
    _add_array(file, "settling_time", basins.settling_time).attrs["unit"] = "periods"
    if basins.grid is not None:
        grid = file.create_group("grid")
        grid.attrs.update(
            lower=basins.grid.lower, upper=basins.grid.upper, shape=basins.grid.shape, wraps=basins.grid.wraps
        )
    if basins.starts is not None:
        _add_array(file, "starts", basins.starts)
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
                if (value := getattr(record, field.name)) is not None:
                    group[f"{part}/{field.name}"] = value


def _read(file: h5py.Group) -> Basins:
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
            parts[part] = record(**{name: values[()] for name, values in group[part].items()})
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
