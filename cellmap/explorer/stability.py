"""The second pane over two parameters: where the attractors of an image are stable."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .._lib.arrays import Floats
from .._lib.checks import finite_number, known_parameter, shown
from ..basins.live import LiveFrame
from ..bifurcations.equilibrium_stability import stability_map
from .view import View

_POINTS = 72  # values along each axis
_MOST = 8  # attractors


def stability(view: View, frame: LiveFrame, x: Any, y: Any) -> tuple[dict[str, Any], bytes]:
    """Return the stability of the periodic attractors of an image over two parameters.

    ``x``, ``y``: objects with a `parameter`, its `lower` and its `upper` value.  The bytes are numbers of one byte with
    a sign, one for each attractor, value of y and value of x: of unstable multipliers, -1 where the orbit is not known.
    """
    point_map = frame.basins.point_map
    assert point_map is not None
    axes = [_axis(label, given, view.params) for label, given in (("x", x), ("y", y))]
    periodic = {k: a for k, a in frame.attractors.items() if a.period}
    if not periodic:
        raise ValueError("image has no periodic attractor: take another window or other parameters")
    chosen = dict(sorted(periodic.items())[:_MOST])
    found = {k: stability_map(point_map.without_table, a, axes[0], axes[1]) for k, a in chosen.items()}
    facts = {
        "parameters": [name for name, _ in axes],
        "x": axes[0][1],
        "y": axes[1][1],
        "identities": tuple(found),
        "omitted": len(periodic) - len(chosen),
        "curves": [
            {"identity": k, "crossing": curve.crossing.name, "x": curve.x, "y": curve.y}
            for k, plane in found.items()
            for curve in plane.curves
        ],
        "params": view.params,
    }
    return facts, np.stack([plane.unstable for plane in found.values()]).astype(np.int8).tobytes()


def _axis(label: str, given: Any, params: Mapping[str, float]) -> tuple[str, Floats]:
    if not isinstance(given, Mapping):
        raise TypeError(f"{label}={shown(given)}: give an object with a parameter, its lower and its upper value")
    name = known_parameter(f"{label}.parameter", given.get("parameter"), params)
    low, high = (finite_number(f"{label}.{end}", given.get(end)) for end in ("lower", "upper"))
    if not low < high:
        raise ValueError(
            f"{label}: lower={low:g}, upper={high:g}: the range is empty or inverted; exchange them or widen it"
        )
    return name, np.linspace(low, high, _POINTS)
