"""The second pane: where attractors go while a parameter changes."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._lib.checks import finite_number, known_parameter
from ..basins.live import LiveFrame
from ..bifurcations.diagram import bifurcation_diagram
from .view import View

_VALUES = 160  # values on each side of the present one
_TRANSIENT, _RECORDED = 200, 32  # periods


def diagram(view: View, frame: LiveFrame, parameter: Any, lower: Any, upper: Any) -> tuple[dict[str, Any], bytes]:
    """Return points of all attractors, followed from the present value of a parameter to both ends of a range.

    The bytes are numbers of four bytes, one for each attractor, value, period and coordinate.
    """
    point_map = frame.basins.point_map
    assert point_map is not None
    name = known_parameter("parameter", parameter, view.params)
    low, high = finite_number("lower", lower), finite_number("upper", upper)
    now = view.params[name]
    if not low < high:
        raise ValueError(f"lower={low:g}, upper={high:g}: the range is empty or inverted; exchange them or widen it")
    if not frame.attractors:
        raise ValueError("image has no attractor to follow: take another window or other parameters")
    identities = tuple(frame.attractors)
    points_now = np.stack([frame.attractors[k].points[0] for k in identities])
    sides = []
    for follow, end in (("down", low), ("up", high)):
        if (end - now) * (1 if follow == "up" else -1) <= 0.0:
            continue  # the present value lies outside of the range
        values = np.sort(np.linspace(now, end, _VALUES))
        found = bifurcation_diagram(
            point_map, name, values, points_now, follow, _TRANSIENT, _RECORDED, longest_period=16, exponents=False
        )
        sides.append((values, found.points))
    if not sides:
        raise ValueError(f"lower={low:g}, upper={high:g}: give a range around the present value {now:g}")
    points = np.concatenate([part for _, part in sides], axis=1)
    facts = {
        "parameter": name,
        "values": np.concatenate([values for values, _ in sides]),
        "identities": identities,
        "shape": points.shape,
        "params": view.params,
    }
    return facts, np.ascontiguousarray(points, "<f4").tobytes()
