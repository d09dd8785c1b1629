"""Attractors as variables over one dimension; their points one after another, after the CF conventions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._lib.arrays import Complexes, Floats
from ..attractors.settling.labels import label_type
from ..maps.coordinates import Coordinate
from ..orbits.attractor import PARTS, Attractor, Kind, distinct_names
from .optional import xarray_package


def attractor_group(
    attractors: Sequence[Attractor], labels: Sequence[int], coordinates: Sequence[Coordinate], **columns: Any
) -> Any:
    """Return a Dataset of attractors over the dimension `attractor`.

    Attractors have different numbers of points: these stand one after another along `point`, with the place of their
    attractor in `point_attractor` (CF 1.11, section 9.3.3, contiguous ragged arrays).  So do the arrays of their
    trapping regions and invariant curves, row after row, with the shape of each, which is -1 where an attractor has
    none.
    """
    counts = np.array([len(a.points) for a in attractors], np.int64)
    d = len(coordinates)
    multipliers = _padded([a.multipliers for a in attractors], d, np.complex128)
    points = np.concatenate([np.empty((0, d)), *(a.points for a in attractors)])
    variables = {
        "name": ("attractor", _texts(distinct_names(attractors))),
        "kind": ("attractor", _texts(str(a.kind) for a in attractors)),
        "orbit_period": (
            "attractor",
            np.array([a.period for a in attractors], np.int64),
            {"long_name": "period in steps of the map; 0 without one"},
        ),
        "rotations": (
            ("attractor", "coordinate"),
            np.array([a.rotations for a in attractors], np.int64).reshape(-1, d),
            {"long_name": "full rotations in one period of the attractor"},
        ),
        "verified": (
            "attractor",
            np.array([a.verified for a in attractors], bool),
            {"long_name": "no orbit leaves the trapping region"},
        ),
        "multipliers_real": (("attractor", "multiplier"), multipliers.real),
        "multipliers_imaginary": (("attractor", "multiplier"), multipliers.imag),
        "exponents": (
            ("attractor", "multiplier"),
            _padded([a.exponents for a in attractors], d, np.float64),
            {"long_name": "Lyapunov exponents per step of the map"},
        ),
        "points": (("point", "coordinate"), points),
        "number_of_points": ("attractor", counts, {"sample_dimension": "point"}),
        "point_attractor": ("point", np.repeat(np.arange(len(counts)), counts), {"instance_dimension": "attractor"}),
        "units": ("coordinate", _texts(c.unit or "1" for c in coordinates)),
        "grazing_distance": ("attractor", np.array([a.grazing_distance for a in attractors])),
        "resolution": (
            ("attractor", "coordinate"),
            np.array([np.full(d, np.nan) if a.resolution is None else a.resolution for a in attractors]).reshape(-1, d),
            {"long_name": "distance below which a chaotic attractor is not distinguished from another one"},
        ),
        "number_of_multipliers": ("attractor", np.array([len(a.multipliers) for a in attractors], np.int64)),
        "number_of_exponents": ("attractor", np.array([len(a.exponents) for a in attractors], np.int64)),
        **_parts(attractors),
        **_symmetry(attractors),
        **{name: ("attractor", values) for name, values in columns.items()},
    }
    names = _texts(c.name for c in coordinates)
    return xarray_package().Dataset(
        variables,
        coords={"label": ("attractor", np.array(labels, label_type(max(labels, default=0) + 1))), "coordinate": names},
    )


def attractors_of(group: Any, coordinates: tuple[Coordinate, ...]) -> Iterator[Attractor]:
    """Yield the attractors of a Dataset that :func:`attractor_group` has made."""
    found = {str(name): variable.values for name, variable in group.variables.items()}
    ends = np.cumsum(found["number_of_points"])
    multipliers = _complex(found["multipliers_real"], found["multipliers_imaginary"])
    parts = {name: _records(found, name, record) for name, (record, _) in PARTS.items()}
    for k, end in enumerate(ends.tolist()):
        yield Attractor(
            kind=Kind(str(found["kind"][k])),
            period=int(found["orbit_period"][k]),
            points=found["points"][end - int(found["number_of_points"][k]) : end].copy(),
            rotations=tuple(found["rotations"][k].tolist()),
            multipliers=multipliers[k, : found["number_of_multipliers"][k]],
            exponents=found["exponents"][k, : found["number_of_exponents"][k]].copy(),
            coordinates=coordinates,
            grazing_distance=float(found["grazing_distance"][k]),
            resolution=None if np.isnan(found["resolution"][k]).any() else found["resolution"][k].copy(),
            symmetry=found["symmetry"].copy() if "symmetry" in found else None,
            **{name: records[k] for name, records in parts.items() if k in records},
        )


def _symmetry(attractors: Sequence[Attractor]) -> dict[str, Any]:
    """Return the directions of shifts under which all attractors are the same, if there are any."""
    found = next((a.symmetry for a in attractors if a.symmetry is not None), None)
    return {} if found is None else {"symmetry": (("direction", "coordinate"), found)}


def _parts(attractors: Sequence[Attractor]) -> dict[str, Any]:
    """Return the arrays of all records of attractors, those of which at least one attractor has one."""
    found: dict[str, Any] = {}
    for part, (record, _) in PARTS.items():
        for field in fields(record):
            owners = [getattr(a, part) for a in attractors]
            values = [None if owner is None else getattr(owner, field.name) for owner in owners]
            arrays = [None if value is None else np.atleast_1d(value) for value in values]
            given = [array for array in arrays if array is not None]
            if not given:
                continue
            name, axes = f"{part}_{field.name}", given[0].ndim
            shapes = np.array([[-1] * axes if array is None else array.shape for array in arrays], np.int64)
            flat = np.concatenate([array.ravel() for array in given])
            found[f"{name}_shape"] = (("attractor", f"{name}_axis"), shapes)
            if flat.dtype.kind == "c":
                found[f"{name}_imaginary"] = (f"{name}_element", flat.imag)
                found[f"{name}_real"] = (f"{name}_element", flat.real)
            else:
                found[name] = (f"{name}_element", flat)
    return found


def _records(found: dict[str, NDArray[Any]], part: str, record: Any) -> dict[int, Any]:
    """Return the records of one kind by the number of their attractor."""
    values: dict[int, dict[str, Any]] = {}
    for field in fields(record):
        name = f"{part}_{field.name}"
        if f"{name}_shape" not in found:
            continue
        flat = found[name] if name in found else _complex(found[f"{name}_real"], found[f"{name}_imaginary"])
        start = 0
        for k, shape in enumerate(found[f"{name}_shape"].tolist()):
            if shape[0] >= 0:
                size = int(np.prod(shape))
                array = flat[start : start + size].reshape(shape).copy()
                values.setdefault(k, {})[field.name] = array.item() if field.type in ("float", "int | None") else array
                start += size
    return {k: record(**given) for k, given in values.items()}


def _complex(real: Floats, imaginary: Floats) -> Complexes:
    """Put complex numbers together, with the signs of zeros."""
    found = np.empty(real.shape, np.complex128)
    found.real, found.imag = real, imaginary
    return found


def _padded(rows: Sequence[NDArray[Any]], width: int, dtype: Any) -> NDArray[Any]:
    """Return rows of at most `width` numbers as one array, with NaN where a row has none."""
    found = np.full((len(rows), width), complex(np.nan, np.nan) if dtype is np.complex128 else np.nan, dtype)
    for k, row in enumerate(rows):
        found[k, : len(row)] = row
    return found


def _texts(texts: Any) -> NDArray[np.object_]:
    return np.array(list(texts), object)
