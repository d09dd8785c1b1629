"""Basins in HDF5 files: self-describing, written atomically, read without running code."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import platform
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray

from .._lib.checkpoint import (
    SLACK,
    Checkpoint,
    add_unwritten,
    belongs_of,
    describe,
    digest_of,
    made_with_room,
    plain,
)
from .._lib.checks import claim_memory
from .._lib.files import PART, as_path, as_target, written_whole
from .._lib.files import StoreError as StoreError
from .._lib.records import Keyed
from .._lib.sealed import (
    ChangedError,
    UnsealedError,
    get_mapping,
    get_number,
    get_numbers,
    get_settings,
    get_text,
    group_of,
    image_of,
    opened,
    put_text,
    reserve,
    rows_of,
    seal,
    within,
    write_sealed,
)
from .._lib.signatures import checked
from ..attractors.settling.labels import LABEL_NAMES, label_type
from ..maps.coordinates import Coordinate
from ..maps.grid import CellGrid
from ..maps.orbit_batch import Cost
from .label_store import basins_memory
from .record import Basins
from .stored_attractors import read_attractors, write_attractors

FORMAT = "cellmap basins"
SCHEMA = 2
"""Number of the layout; readers take their own and older ones."""


_ONLY = "basins"  # name of basins that are alone in their file

Read = TypeVar("Read")


@checked
def save_basins(basins: Basins | Mapping[str, Basins], path: str | os.PathLike[str]) -> Path:
    """Write basins to an HDF5 file.

    The file is written atomically: under a temporary name in the same folder, and then renamed.  Links are followed to
    the file that they lead to; one that is there is replaced and keeps its permissions.

    Parameters
    ----------
    basins : Basins or mapping of str to Basins
        Basins to store, or several under names of their own.  Maps are stored as recipes, without interpolation
        coefficients: :func:`rebuild_map` rebuilds them.
    path : path-like
        Name of the file, such as ``"basins.h5"``; a file of that name is replaced, whatever it holds, and what is
        no file, such as a pipe or a device, is refused.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    FileNotFoundError, OSError
        For a folder that does not exist, and a place where no file can be made.
    ValueError
        For an empty mapping, or a name that is empty or contains a slash.

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
    images = basins if isinstance(basins, Mapping) else {_ONLY: basins}
    for image in images.values():
        if not isinstance(image, Basins):
            raise TypeError(
                f"basins={image!r}: give Basins, as find_basins returns them, or a mapping of names to them"
            )
    if not images or any(not name or "/" in name for name in images):
        raise ValueError(f"basins has the names {list(images)}: give at least one, none of them empty or with a slash")

    def fill(file: h5py.File) -> None:
        for key, image in images.items():
            _write(file.create_group(key), image)
        _describe(file)

    with written_whole(as_target("path", path)) as temporary:
        write_sealed(temporary, fill)
    return path


def save_with(basins: Basins, path: str | os.PathLike[str], write: Callable[[h5py.Group], None]) -> Path:
    """Write basins, and beside their arrays what `write` adds; :func:`load_basins` reads the basins alone."""
    path = as_path("path", path)

    def fill(file: h5py.File) -> None:
        group = file.create_group(_ONLY)
        _write(group, basins)
        write(group)
        _describe(file)

    with written_whole(as_target("path", path)) as temporary:
        write_sealed(temporary, fill)
    return path


def load_with(path: str | os.PathLike[str], read: Callable[[h5py.Group, Basins], Read]) -> Read:
    """Read what :func:`save_with` wrote."""
    return _checked(as_path("path", path), None, lambda group: read(group, _read(group)))


def add_array(group: h5py.Group, name: str, values: Any) -> h5py.Dataset:
    """Store an array compressed, a scalar as it is."""
    packed = {"compression": "gzip", "shuffle": True, "fletcher32": True} if np.ndim(values) else {}
    return group.create_dataset(name, data=values, **packed)


@contextmanager
def basins_file(
    path: Path, basins: Basins, belongs: Mapping[str, Any], shape: tuple[int, ...]
) -> Iterator[tuple[Checkpoint, NDArray[np.int16], NDArray[np.int32]]]:
    """Write basins whose labels need not fit into memory.

    What is yielded is a new file with its flat arrays of labels and settling times, to be filled; all else is that of
    `basins`.  `belongs` says which run they come from.
    """

    def describe_all(group: h5py.Group, some: Basins) -> None:
        _write(group, some)
        put_text(group, "belongs", json.dumps(plain(belongs)))
        _describe(group.file)

    with written_whole(path, kind=PART) as temporary:
        kind = label_type(len(basins.attractors))
        with made_with_room(temporary, (4 + kind().itemsize) * math.prod(shape), lambda file: None) as file:
            group = file.create_group(_ONLY)
            add_unwritten(group, "labels", shape, kind)
            add_unwritten(group, "settling_time", shape, np.int32)
        reserve(temporary)
        arrays = Checkpoint(temporary)
        yield arrays, arrays[f"{_ONLY}/labels"].reshape(-1), arrays[f"{_ONLY}/settling_time"].reshape(-1)
        small = _with_arrays(basins, np.zeros(1, np.int16), np.zeros(1, np.int32))
        reserve(temporary, SLACK + len(image_of(lambda file: describe_all(file.create_group(_ONLY), small))))
        with h5py.File(temporary, "r+") as file:
            describe_all(file[_ONLY], basins)
        seal(temporary)
        arrays.release()


def is_basins_file(path: Path) -> bool:
    """Tell whether there is a file of basins."""
    try:
        with opened(path) as file:
            return get_text(file, "format") == FORMAT
    except OSError:
        return False


def read_mapped(path: Path) -> tuple[Basins, dict[str, Any]]:
    """Read what :func:`basins_file` wrote, with labels that stay in the file; also return which run it comes from."""
    belongs: dict[str, Any] = {}

    def read(group: h5py.Group) -> Basins:
        belongs.update(belongs_of(group))
        return _read(group, in_file=True)

    basins = _checked(path, None, read)
    return (mapped_basins(Checkpoint(path, "c"), basins), belongs) if belongs else (basins, belongs)


def mapped_basins(arrays: Checkpoint, basins: Basins) -> Basins:
    """Return basins whose arrays are memory maps of a file."""
    return _with_arrays(basins, arrays[f"{_ONLY}/labels"], arrays[f"{_ONLY}/settling_time"])


def _with_arrays(basins: Basins, labels: NDArray[np.int16], times: NDArray[np.int32]) -> Basins:
    return dataclasses.replace(basins, labels=labels, settling_time=times)


def _describe(file: h5py.File) -> None:
    """Write what a file of basins is into it, once it holds them."""
    describe(file, FORMAT, SCHEMA)
    put_text(file, "written", datetime.now(UTC).isoformat(timespec="seconds"))
    put_text(file, "machine", platform.machine())


@checked
def load_basins(path: str | os.PathLike[str], name: str | None = None, unverified: bool = False) -> Basins:
    """Read basins from an HDF5 file.

    Parameters
    ----------
    path : path-like
        A file that :func:`save_basins` wrote.
    name : str, optional
        Name of the basins, in a file of several.
    unverified : bool, optional
        Read a file without a checksum, as older versions of cellmap wrote them, or one that another program has
        changed. Damage to such a file may be noticed late or not at all, and may make the HDF5 library hang.

    Returns
    -------
    Basins
        The stored basins, without their map: ``rebuild_map(system, basins.settings["map"])`` rebuilds it.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    KeyError
        For a name that is not in the file, or no name if the file holds several.
    StoreError
        For a file that is truncated or damaged, that another program or a newer cellmap wrote, or with contents that
        cellmap does not write, such as links to other files.
    """
    if name is not None and not isinstance(name, str):
        raise TypeError(f"name={name!r}: give a name that the file holds")
    return _checked(as_path("path", path), name, _read, unverified)


def _checked(path: Path, name: str | None, read: Callable[[h5py.Group], Read], unverified: bool = False) -> Read:
    """Read basins from a file whose contents are those that were written."""
    if not path.is_file():
        raise FileNotFoundError(f"path={str(path)!r}: there is no such file")
    try:
        with opened(path, unverified) as file:
            if "format" not in file.attrs or get_text(file, "format") != FORMAT:
                raise StoreError(f"{str(path)!r} is an HDF5 file, but not one of basins that cellmap wrote")
            if (schema := get_number(file, "schema")) > SCHEMA:
                raise StoreError(f"{str(path)!r} has layout {schema} and this cellmap knows {SCHEMA}: update cellmap")
            if "digest" in file.attrs and get_text(file, "digest") != digest_of(file):  # of an older cellmap
                raise ValueError("its contents are not those that were written")
            # What somebody else has put into the file is not looked at.
            own = ("system", "settings", "labels", "attractors")
            groups = {k: v for k, v in file.items() if isinstance(v, h5py.Group)}
            names = [k for k, v in groups.items() if any(n in v.attrs or n in v for n in own)] or list(groups)
            if not names:
                raise ValueError("it holds no basins")
            chosen = names[0] if name is None and len(names) == 1 else name
            if chosen in names:
                return read(file[chosen])
    except UnsealedError as error:
        raise StoreError(
            f"{str(path)!r} is an HDF5 file, but not one of basins that cellmap wrote, or one of an older cellmap, "
            "without a checksum: if you trust where it comes from, load_basins(path, unverified=True) reads it; then "
            "save it again"
        ) from error
    except ChangedError as error:
        raise StoreError(
            f"{error}. If you have added attributes or arrays of your own, load_basins(path, unverified=True) reads "
            "it; then save it again, for without its checksum damage is not noticed. Otherwise write it again"
        ) from error
    raise KeyError(f"name={name!r}: {str(path)!r} holds {', '.join(names)}; name one of them")


def _write(file: h5py.Group, basins: Basins) -> None:
    put_text(file, "system", basins.name)
    put_text(file, "params", json.dumps(dict(basins.params)))
    put_text(file, "settings", json.dumps(plain(basins.settings)))
    put_text(file, "coordinates", json.dumps([dataclasses.asdict(c) for c in basins.coordinates]))
    file.attrs["inaccurate"] = basins.inaccurate
    put_text(file, "undecided", json.dumps(dict(basins.undecided)))
    put_text(file, "cost", json.dumps(dataclasses.asdict(basins.cost)))
    for name in ("labels", "settling_time"):
        if name not in file:
            add_array(file, name, getattr(basins, name))
    put_text(file["labels"], "meaning", json.dumps(basins._meanings))
    put_text(file["settling_time"], "unit", "periods")
    if basins.grid is not None:
        grid = file.create_group("grid")
        grid.attrs.update(
            lower=basins.grid.lower, upper=basins.grid.upper, shape=basins.grid.shape, wraps=basins.grid.wraps
        )
    if basins.initial_conditions is not None:
        add_array(file, "starts", basins.initial_conditions)
    write_attractors(file.create_group("attractors"), basins.attractors)


def _read(file: h5py.Group, in_file: bool = False) -> Basins:
    """Read basins, with empty labels and settling times where these are to stay in the file."""
    coordinates = tuple(Coordinate(**c) for c in json.loads(get_text(file, "coordinates")))
    grid, initial_conditions = None, None
    if "grid" in file:
        kinds = {"lower": "if", "upper": "if", "shape": "i", "wraps": "b"}
        grid = CellGrid(*(tuple(get_numbers(group_of(file, "grid"), name, None, kind)) for name, kind in kinds.items()))
    if "starts" in file:
        initial_conditions = file["starts"][()]
        if (
            initial_conditions.dtype != np.float64
            or initial_conditions.shape[-1:] != (len(coordinates),)
            or not np.isfinite(initial_conditions).all()
        ):
            raise ValueError("its initial conditions are not states")
    if grid is not None and initial_conditions is None and grid.dimension == len(coordinates):
        shape = grid.shape
    elif initial_conditions is not None and grid is None:
        shape = initial_conditions.shape[:-1]
    else:
        raise ValueError("it has no initial conditions, or two kinds of them")
    attractors = read_attractors(group_of(file, "attractors"), coordinates)
    for name, kind, lowest, highest in (
        ("labels", label_type(len(attractors)), min(LABEL_NAMES), len(attractors) - 1),
        ("settling_time", np.int32, -1, np.iinfo(np.int32).max),
    ):
        if (file[name].dtype, file[name].shape) != (np.dtype(kind), shape):
            raise ValueError(f"{name} are {file[name].dtype} of shape {file[name].shape}")
        if not all(within(part, lowest, highest) for part in rows_of(file[name])):
            raise ValueError(f"{name} are not between {lowest} and {highest}")
    undecided = get_mapping(file, "undecided") if "undecided" in file.attrs else {}
    cost = Cost(**get_mapping(file, "cost"))
    if not all(type(count) is int and count >= 0 for count in (cost.steps, *undecided.values())):
        raise ValueError("its counts are no whole numbers")
    if not all(isinstance(value, float | int) and value >= 0 for value in dataclasses.astuple(cost)):
        raise ValueError(f"its cost is {cost}")
    if not in_file:
        claim_memory(f"labels of {file.file.filename}", basins_memory(math.prod(shape)), "close other programs")
    return Basins(
        labels=np.zeros(0, np.int16) if in_file else file["labels"][()],
        attractors=attractors,
        settling_time=np.zeros(0, np.int32) if in_file else file["settling_time"][()],
        grid=grid,
        initial_conditions=initial_conditions,
        name=get_text(file, "system"),
        params=Keyed({name: float(value) for name, value in get_mapping(file, "params").items()}, "params"),
        coordinates=coordinates,
        settings=get_settings(file, "settings"),
        inaccurate=get_number(file, "inaccurate"),
        undecided=undecided,
        cost=cost,
    )
