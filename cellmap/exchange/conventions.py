"""Names and attributes of variables after the CF conventions for netCDF (Eaton et al., version 1.11)."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from .._lib.checkpoint import plain
from ..maps.coordinates import Coordinate

CONVENTIONS = "CF-1.11"

_OWN = (
    "labels settling_time evidence forward backward initial_condition attractor attractors point coordinate multiplier "
    "counts fractions standard_errors present inaccurate label branch step direction restarted status period "
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
    """Return attributes of a whole file: what it holds, of which system, with which parameters and settings."""
    from .. import __version__

    found: dict[str, Any] = {"Conventions": CONVENTIONS, "title": title, "source": f"cellmap {__version__}"}
    found["record"] = type(record).__name__
    system = getattr(record, "system", getattr(record, "name", None))
    if isinstance(system, str):
        found["system"] = system
    for name in ("params", "settings", "undecided"):
        value = getattr(record, name, None)
        if value is not None and not isinstance(value, np.ndarray):
            found[name] = json.dumps(plain(value))
    if hasattr(record, "coordinates"):  # a name that netCDF has taken
        found["state_variables"] = json.dumps([asdict(c) for c in record.coordinates])
    for name in ("grid", "cost"):
        if getattr(record, name, None) is not None:
            found[name] = json.dumps(plain(asdict(getattr(record, name))))
    return found | more
