"""Basins in HDF5 files: self-describing, written whole or not at all, read without running code."""

from __future__ import annotations

import dataclasses
import json
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from .attractor import Attractor, Cover, Kind, Neighbourhood
from .basins import LABEL_NAMES, Basins
from .checkpoint import PART, Checkpoint, add_unwritten, digest_of, plain, reserve
from .coordinates import Coordinate
from .files import StoreError as StoreError
from .files import as_path, as_target, written_whole
from .grid import CellGrid
from .orbit_batch import Cost
from .signatures import checked

FORMAT = "cellmap basins"
SCHEMA = 1
"""Number of the layout; readers take their own and older ones."""


_ONLY = "basins"  # name of a picture that is alone in its file


@checked
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
    path = as_path("path", path)
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
    with written_whole(as_target("path", path)) as temporary, h5py.File(temporary, "w") as file:
        for key, picture in pictures.items():
            _write(file.create_group(key), picture)
        _describe(file)
    return path


def write_picture(
    path: Path,
    shape: tuple[int, ...],
    fill: Callable[[Checkpoint, NDArray[np.int16], NDArray[np.int32]], Basins],
    belongs: Mapping[str, Any],
) -> Basins:
    """Write basins whose labels need not fit into memory, and return them with labels that stay in the file.

    ``fill(file, labels, times)`` fills flat arrays of a file, and returns the basins that are made of them; `belongs`
    says which run they come from.
    """
    with written_whole(path, kind=PART) as temporary:
        with h5py.File(temporary, "w") as file:
            group = file.create_group(_ONLY)
            add_unwritten(group, "labels", shape, np.int16)
            add_unwritten(group, "settling_time", shape, np.int32)
        reserve(temporary)
        arrays = Checkpoint(temporary)
        basins = fill(arrays, *(arrays[f"{_ONLY}/{name}"].reshape(-1) for name in ("labels", "settling_time")))
        with h5py.File(temporary, "r+") as file:
            _write(file[_ONLY], basins)
            file[_ONLY].attrs["belongs"] = json.dumps(plain(belongs))
            _describe(file)
        arrays.release()
    return _with_arrays_of(path, basins)


def is_picture(path: Path) -> bool:
    """Tell whether there is a file of basins."""
    try:
        with h5py.File(path, "r") as file:
            return file.attrs.get("format") == FORMAT
    except OSError:
        return False


def mapped_picture(path: Path) -> tuple[Basins, dict[str, Any]]:
    """Read what :func:`write_picture` wrote, with labels that stay in the file; also return which run it comes from."""
    belongs: dict[str, Any] = {}

    def read(group: h5py.Group) -> Basins:
        belongs.update(json.loads(group.attrs["belongs"]) if "belongs" in group.attrs else {})
        return _read(group, np.zeros(0, np.int16), np.zeros(0, np.int32))

    basins = _checked(path, None, read)
    return (_with_arrays_of(path, basins), belongs) if belongs else (basins, belongs)


def _with_arrays_of(path: Path, basins: Basins) -> Basins:
    """Return basins whose arrays are those of a file; changes of them are not written there."""
    arrays = Checkpoint(path, "c")
    labels, times = (arrays[f"{_ONLY}/{name}"] for name in ("labels", "settling_time"))
    return dataclasses.replace(basins, labels=labels, settling_time=times)


def _describe(file: h5py.File) -> None:
    """Say what a file is that holds its pictures already."""
    file.attrs.update(format=FORMAT, schema=SCHEMA, written=datetime.now(UTC).isoformat(timespec="seconds"))
    file.attrs["versions"] = json.dumps({n: version(n) for n in ("cellmap", "numpy", "numba", "h5py")})
    file.attrs["machine"] = platform.machine()
    file.attrs["digest"] = digest_of(file)


@checked
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
    return _checked(as_path("path", path), name, _read)


def _checked(path: Path, name: str | None, read: Callable[[h5py.Group], Basins]) -> Basins:
    """Read a picture of a file whose contents are those that were written."""
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
            if file.attrs["digest"] != digest_of(file):
                raise StoreError(
                    f"{str(path)!r} is damaged: its contents are not those that were written; write it again"
                )
            names = list(file)
            chosen = names[0] if name is None and len(names) == 1 else name
            if chosen in names:
                return read(file[chosen])
    except StoreError:
        raise
    except (OSError, KeyError, ValueError, TypeError, RuntimeError, UnicodeDecodeError) as error:
        raise StoreError(f"{str(path)!r} is truncated, damaged or no HDF5 file: write it again ({error})") from error
    raise KeyError(f"name={name!r}: {str(path)!r} holds {', '.join(names)}; name one of them")


def _add_array(group: h5py.Group, name: str, values: Any) -> h5py.Dataset:
    """Store an array compressed, a scalar as it is."""
    packed = {"compression": "gzip", "shuffle": True, "fletcher32": True} if np.ndim(values) else {}
    return group.create_dataset(name, data=values, **packed)


def _write(file: h5py.Group, basins: Basins) -> None:
    file.attrs["system"] = basins.name
    file.attrs["params"] = json.dumps(dict(basins.params))
    file.attrs["settings"] = json.dumps(plain(basins.settings))
    file.attrs["coordinates"] = json.dumps([dataclasses.asdict(c) for c in basins.coordinates])
    file.attrs["inaccurate"] = basins.inaccurate
    file.attrs["cost"] = json.dumps(dataclasses.asdict(basins.cost))
    for name in ("labels", "settling_time"):
        if name not in file:
            _add_array(file, name, getattr(basins, name))
    names = {str(k): basins.label_name(k) for k in range(len(basins.attractors))}
    file["labels"].attrs["meaning"] = json.dumps(names | _codes())
    file["settling_time"].attrs["unit"] = "periods"
    if basins.grid is not None:
        grid = file.create_group("grid")
        grid.attrs.update(
            lower=basins.grid.lower, upper=basins.grid.upper, shape=basins.grid.shape, wraps=basins.grid.wraps
        )
    if basins.starts is not None:
        _add_array(file, "starts", basins.starts)
    write_attractors(file.create_group("attractors"), basins.attractors)


def write_attractors(group: h5py.Group, attractors: Sequence[Attractor]) -> None:
    """Write attractors under their numbers."""
    for k, attractor in enumerate(attractors):
        _write_attractor(group.create_group(str(k)), attractor)


def read_attractors(group: h5py.Group, coordinates: tuple[Coordinate, ...]) -> tuple[Attractor, ...]:
    """Read what :func:`write_attractors` wrote."""
    return tuple(_read_attractor(group[str(k)], coordinates) for k in range(len(group)))


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


def _read(file: h5py.Group, labels: NDArray[np.int16] | None = None, times: NDArray[np.int32] | None = None) -> Basins:
    """Read a picture, and its arrays if they are not given."""
    coordinates = tuple(Coordinate(**c) for c in json.loads(file.attrs["coordinates"]))
    grid = None
    if "grid" in file:
        g = file["grid"].attrs
        grid = CellGrid(*(tuple(g[n].tolist()) for n in ("lower", "upper", "shape", "wraps")))
    return Basins(
        labels=file["labels"][()] if labels is None else labels,
        attractors=read_attractors(file["attractors"], coordinates),
        settling_time=file["settling_time"][()] if times is None else times,
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
