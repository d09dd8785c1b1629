"""Names and attributes of variables after the CF conventions for netCDF (Eaton et al., version 1.11)."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from functools import cache
from types import NoneType
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from .._lib.checkpoint import plain
from .._lib.records import Array, Layout
from ..maps.coordinates import Coordinate
from ..maps.grid import CellGrid
from ..maps.orbit_batch import Cost

CONVENTIONS = "CF-1.11"

_PLAIN = (str, bool, int, float, Coordinate, CellGrid, Cost)  # types of fields that are attributes

_OWN = (
    "labels settling_time evidence forward backward initial_condition attractor attractors point coordinate multiplier "
    "counts fractions standard_errors present inaccurate audited label branch step direction restarted status period "
    "orbit_period chaotic rotation_numbers exponents exponent_errors exponent largest unstable boundary crossing below "
    "above refined initial_conditions state"
)
"""Names of variables and dimensions that are always the same."""


def variable_names(names: Iterable[str], fixed: str = _OWN) -> list[str]:
    """Return names for variables: letters, digits and underscores, all different and none of those that are fixed.

    Examples
    --------
    >>> variable_names(["theta", "theta'", "labels", "m/s"])
    ['theta', 'theta_', 'labels_', 'm_s']
    """
    taken, found = set(fixed.split()), []
    for name in names:
        candidate = re.sub(r"\W", "_", name)
        while candidate in taken:
            candidate += "_"
        taken.add(candidate)
        found.append(candidate)
    return found


def coordinate_attributes(coordinate: Coordinate) -> dict[str, Any]:
    """Return name and unit of a state variable; of an angle its period and its branch cut too."""
    found: dict[str, Any] = {"long_name": coordinate.name, "units": coordinate.unit or "1"}
    if coordinate.period is not None:
        found |= {"period": coordinate.period, "branch_cut": coordinate.lower}
    return found


def flags(meanings: Mapping[int, str], dtype: Any) -> dict[str, Any]:
    """Return `flag_values` and `flag_meanings` of a variable of whole numbers.

    The meanings are single words, all different; a number is appended to one that occurs before.

    Examples
    --------
    >>> flags({0: "fixed point (π, 0)", -1: "escaped"}, "int8")
    {'flag_values': array([ 0, -1], dtype=int8), 'flag_meanings': 'fixed_point_pi_0 escaped'}
    """
    words: list[str] = []
    for value, meaning in meanings.items():
        word = re.sub(r"[^A-Za-z0-9_.+@-]+", "_", meaning.replace("π", "pi")).strip("_")
        words.append(word if word and word not in words else f"{word}_{value}")
    return {"flag_values": np.array(list(meanings), dtype), "flag_meanings": " ".join(words)}


def enum_flags(kind: Any, dtype: Any) -> dict[str, Any]:
    """Return the flags of a variable whose values are those of an IntEnum."""
    return flags({int(member): member.name.lower() for member in kind}, dtype)


def about(record: Any, title: str, /, **more: Any) -> dict[str, Any]:
    """Return attributes of a whole file: what it holds, and by what it was written."""
    from .. import __version__

    whole = {"Conventions": CONVENTIONS, "title": title, "source": f"cellmap {__version__}"}
    return whole | {"record": type(record).__name__} | more


def encoded(value: Any) -> Any:
    """Return a value as an attribute: text and numbers as they are, all else as JSON, truth too."""
    simple = isinstance(value, str | int | float) and not isinstance(value, bool)
    return value if simple else json.dumps(plain(value))


def decoded(hint: Any, value: Any) -> Any:
    """Return the value of a field of a type from its attribute."""
    kind = without_none(hint)
    if kind in (str, int, float):
        return kind(value)
    found, inner = json.loads(value), get_args(kind)
    if get_origin(kind) is tuple:
        return tuple(inner[0](**one) if isinstance(one, dict) else one for one in found)
    if get_origin(kind) is Mapping:
        if inner[1] is float:
            return {name: float(number) for name, number in found.items()}
        return Counter(found) if inner[1] is int else found
    return bool(found) if kind is bool else kind(**found)


@cache
def attribute_fields(record: type) -> Mapping[str, tuple[str, Any]]:
    """Return the attributes that fields of a record are, and their types, by the fields' names."""
    layout: Layout = record._layout  # type: ignore[attr-defined]
    names = {"name": "system", "coordinates": "state_variables", **layout.attributes}
    found = {}
    for field, hint in get_type_hints(record).items():
        kind = without_none(hint)
        within = get_args(kind)[0] if get_origin(kind) is tuple else kind
        name = names.get(field, field if field not in {**layout.coords, **layout.variables} else "")
        if name and (get_origin(kind) is Mapping or within in _PLAIN):
            found[field] = (name, hint)
    return found


def without_none(hint: Any) -> Any:
    """Return the type of a field where it is not None."""
    return get_args(hint)[0] if NoneType in get_args(hint) else hint


class Variable(NamedTuple):
    """A variable of a record: the field that it is, its place on the field's last axis or None, dimensions."""

    field: str
    place: int | None
    dims: tuple[str, ...]
    about: Array


def variables_of(arrays: Mapping[str, Array], record: Any) -> dict[str, Variable]:
    """Return variables by their names; of the record its parameters, coordinates and cells have to be known."""
    names = names_of(record)
    found = {}
    for field, array in arrays.items():
        dims = tuple(array.dims.format(**names).split())
        if "{state}" in array.name:
            for j, state in enumerate(names["states"]):
                found[array.name.format(state=state)] = Variable(field, j, dims, array)
        else:
            found[array.name.format(**names) or field] = Variable(field, None, dims, array)
    return found


def names_of(record: Any) -> dict[str, Any]:
    """Return the names of dimensions that a record gives, by what layouts call them."""
    parameters = [record.parameter] if hasattr(record, "parameter") else list(getattr(record, "parameters", ()))
    found = variable_names([*parameters, *(c.name for c in getattr(record, "coordinates", ()))])
    own, states = found[: len(parameters)], found[len(parameters) :]
    cells = states
    if getattr(record, "grid", None) is None and hasattr(record, "initial_conditions"):
        axes = np.ndim(record.initial_conditions) - 1
        cells = ["initial_condition"] if axes == 1 else [f"initial_condition_{j}" for j in range(axes)]
    return {
        "states": states,
        "cells": " ".join(cells),
        **dict(zip(("x", "y"), own, strict=False)),
        "parameter": "".join(own[:1]),
    }


def values_of(record: Any, variable: Variable) -> Any:
    """Return the values of a variable."""
    values = getattr(record, variable.field)
    if isinstance(values, tuple):
        return np.array(values, object if any(isinstance(value, str) for value in values) else None)
    return values if variable.place is None else values[..., variable.place]
