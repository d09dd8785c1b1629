"""Attractors as variables over one dimension; their points one after another, after the CF conventions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..maps.coordinates import Coordinate
from ..orbits.attractor import Attractor, distinct_names
from .optional import xarray_package


def attractor_group(
    attractors: Sequence[Attractor], labels: Sequence[int], coordinates: Sequence[Coordinate], **columns: Any
) -> Any:
    """Return a Dataset of attractors over the dimension `attractor`.

    Attractors have different numbers of points: these stand one after another along `point`, with the place of their
    attractor in `point_attractor` (CF 1.11, section 9.3.3, contiguous ragged arrays).
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
        **{name: ("attractor", values) for name, values in columns.items()},
    }
    names = _texts(c.name for c in coordinates)
    return xarray_package().Dataset(
        variables, coords={"label": ("attractor", np.array(labels, np.int16)), "coordinate": names}
    )


def _padded(rows: Sequence[NDArray[Any]], width: int, dtype: Any) -> NDArray[Any]:
    """Return rows of at most `width` numbers as one array, with NaN where a row has none."""
    found = np.full((len(rows), width), complex(np.nan, np.nan) if dtype is np.complex128 else np.nan, dtype)
    for k, row in enumerate(rows):
        found[k, : len(row)] = row
    return found


def _texts(texts: Any) -> NDArray[np.object_]:
    return np.array(list(texts), object)
