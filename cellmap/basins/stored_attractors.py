"""Storage of attractors in HDF5 files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import NoneType
from typing import Any, get_args, get_type_hints

import h5py
import numpy as np

from .._lib.sealed import array_of, get_number, get_numbers, get_text, group_of, put_text
from ..maps.coordinates import Coordinate
from ..orbits.attractor import PARTS, Attractor, Kind

_SAMPLED = (Kind.CHAOTIC, Kind.EQUILIBRIA, Kind.CONTINUUM, Kind.QUASIPERIODIC)  # kinds of which the points are a sample


def write_attractors(group: h5py.Group, attractors: Sequence[Attractor]) -> None:
    """Write attractors under their numbers."""
    for k, attractor in enumerate(attractors):
        _write_attractor(group.create_group(str(k)), attractor)


def read_attractors(group: h5py.Group, coordinates: tuple[Coordinate, ...]) -> tuple[Attractor, ...]:
    """Read what :func:`write_attractors` wrote."""
    return tuple(_read_attractor(group_of(group, str(k)), coordinates) for k in range(len(group)))


def _write_attractor(group: h5py.Group, attractor: Attractor) -> None:
    put_text(group, "kind", str(attractor.kind))
    put_text(group, "name", attractor.name)
    group.attrs.update(period=attractor.period, turns=attractor.rotations, grazing=attractor.grazing_distance)
    for name in ("points", "multipliers", "exponents", "resolution", "symmetry"):
        if (value := getattr(attractor, name)) is not None:
            group[name] = value
    for part, (_, dims) in PARTS.items():
        for name in dims:
            if (value := getattr(getattr(attractor, part), name, None)) is not None:
                group[f"{part}/{name}"] = value


def _read_attractor(group: h5py.Group, coordinates: tuple[Coordinate, ...]) -> Attractor:
    d = len(coordinates)
    kind, period = Kind(get_text(group, "kind")), get_number(group, "period")
    points = array_of(group, "points", np.float64, (None if kind in _SAMPLED else period, d))
    if not len(points) or not np.isfinite(points).all():
        raise ValueError(f"{group.name} has no points")
    # Regions of attractors without a period are as many as they are.
    sizes = {"d": d, "two": 2} | ({"period": period} if period else {})
    parts = {part: _read_part(group, part, sizes) for part in PARTS if part in group}
    neighbourhood = parts.get("neighbourhood")
    if neighbourhood is not None and not all(np.isfinite(part).all() for part in vars(neighbourhood).values()):
        raise ValueError(f"{group.name} has no trapping region")
    cover = parts.get("cover")
    if cover is not None and cover.residence is not None and cover.residence < 1:
        raise ValueError(f"{group.name} asks for a residence of {cover.residence} periods")
    grazing = group.attrs.get("grazing", np.inf)
    multipliers = array_of(group, "multipliers", np.complex128, (None,))
    exponents = array_of(group, "exponents", np.float64, (None,))
    symmetry = array_of(group, "symmetry", np.float64, (None, d)) if "symmetry" in group else None
    size = d if symmetry is None else d - len(symmetry)
    if (
        not isinstance(grazing, float)
        or grazing < 0.0
        or len(multipliers) not in (0, size)
        or len(exponents) not in (0, 1, size)
    ):
        raise ValueError(f"{group.name} has {len(multipliers)} multipliers, {len(exponents)} exponents, {grazing=}")
    return Attractor(
        kind=kind,
        period=period,
        points=points,
        rotations=tuple(get_numbers(group, "turns", d)),
        multipliers=multipliers,
        exponents=exponents,
        coordinates=coordinates,
        **parts,
        grazing_distance=float(grazing),
        resolution=array_of(group, "resolution", np.float64, (d,)) if "resolution" in group else None,
        symmetry=symmetry,
    )


def _read_part(group: h5py.Group, part: str, sizes: Mapping[str, int]) -> Any:
    """Read a record of an attractor, whose arrays agree in the sizes of all dimensions of a name."""
    record, shapes = PARTS[part]
    hints, known, found = get_type_hints(record), dict(sizes), {}
    for name, dims in shapes.items():
        if NoneType not in get_args(hints[name]) or f"{part}/{name}" in group:
            hint = get_args(hints[name])[0] if NoneType in get_args(hints[name]) else hints[name]
            kind = {float: np.float64, int: np.int64}.get(hint) or get_args(get_args(hint)[1])[0]
            values = array_of(group, f"{part}/{name}", kind, tuple(known.get(dim) for dim in dims.split()))
            known |= dict(zip(dims.split(), values.shape, strict=True))
            if (
                values.shape != tuple(known[dim] for dim in dims.split())
                or not known.get("curves", 1)
                or known.get("harmonics", 1) % 2 == 0
            ):
                raise ValueError(f"{group.name} has Fourier coefficients of shape {values.shape}")
            found[name] = values if values.shape else values.item()
    return record(**found)
