"""Images of one system, and what is asked about them: attractors, orbits, accuracy."""

from __future__ import annotations

import base64
import threading
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._lib.arrays import Floats
from .._lib.computed import computed_once
from .._lib.stopping import check_stop
from ..attractors.settling.labels import label_names, stored_names
from ..basins.live import LiveBasins, LiveFrame
from ..basins.record import label_counts
from ..basins.refining import refine_basins
from ..maps.stroboscopic import Stroboscopic
from ..maps.system import ForcedSystem
from ..maps.trajectories import trajectory
from ..orbits.attractor import Attractor, distinct_names
from .explored import USUAL_CELLS, Explored, ExploredScene
from .mathematics import equations, symbol
from .numbering import Numbering
from .protocol import LOWEST, pixels
from .view import View

MAX_PERIODS = 2000
LONGEST = 120.0
"""Seconds after which an image is given up."""

_DRAWN = 400  # periods of an orbit that are drawn
_SAMPLES = 4000  # states of its motion


class Images:
    """Images of a system at changing views, with attractors that keep their identities.

    Parameters
    ----------
    explored : Explored
        The system.
    """

    def __init__(self, explored: Explored) -> None:
        self.explored = explored
        self.shown: tuple[View, LiveFrame] | None = None
        self._live: tuple[tuple[int, float], LiveBasins, Numbering] | None = None
        self._guard = threading.Lock()

    @computed_once
    def described(self) -> dict[str, Any]:
        """Description of the system for the page."""
        return described(self.explored)

    def frames(
        self, view: View, near: ArrayLike | None = None, anchors: Mapping[int, Floats] | None = None
    ) -> Iterator[LiveFrame]:
        """Yield frames from coarse to fine; the last one stays in `shown`.

        ``anchors``: a point of each attractor that has a number already, where the first image is asked for.
        """
        check_stop()
        live, numbering = self._basins(view, anchors or {})
        request = live.frames(
            view.params,
            phase=view.phase,
            initial_conditions=view.initial_conditions(),
            near=None if near is None else view.state(near),
            max_seconds=LONGEST,
        )
        for found in request:
            frame = numbering.numbered(found)
            with self._guard:
                self.shown = view, frame
            yield frame

    def cancel(self) -> None:
        """End the image that is being computed, from any thread."""
        if self._live is not None:
            self._live[1].cancel()

    def _basins(self, view: View, anchors: Mapping[int, Floats]) -> tuple[LiveBasins, Numbering]:
        """Return the live basins of a map, and numbers that last when the kind of map changes."""
        key = view.nodes, view.tolerance
        if self._live is None or self._live[0] != key:
            if self.shown is not None:
                anchors = {k: a.points[0] for k, a in self.shown[1].attractors.items()}
            point_map, window = self.explored.point_map(*key), self.explored.window
            # The first window, however far into it the view is: distances between attractors are relative to it.
            live = LiveBasins(point_map, View.first(self.explored).initial_conditions(), MAX_PERIODS)
            check_stop()  # others may be wanted by now, of other live basins
            extent = np.subtract(window.upper, window.lower)
            self._live = key, live, Numbering(anchors, extent)
        return self._live[1:]

    def seen(self, complete: bool = True) -> tuple[View, LiveFrame]:
        """Return the last frame and its view.

        Raises
        ------
        ValueError
            If it is none that is complete, or whose attractors are verified.
        """
        with self._guard:
            shown = self.shown
        if shown is None or shown[1].preview or (complete and not shown[1].complete):
            raise ValueError("image is a preview: ask again when it is complete")
        return shown


def described(explored: Explored) -> dict[str, Any]:
    """Return the description of a system for the page."""
    system, first, scene = explored.system, View.first(explored), explored.scene
    return {
        "name": explored.name,
        "title": system.name,
        "about": explored.about,
        "equations": equations(system),
        "units": dict(explored.units),
        "codes": {name: code for code, name in label_names(tuple(system.ends)).items()},
        "forced": isinstance(system, ForcedSystem),
        "coordinates": [
            {"name": c.name, "symbol": symbol(c.name), "unit": c.unit, "period": c.period} for c in explored.coordinates
        ],
        "symbols": {name: symbol(name) for name in first.params},
        "drawnAs": explored.drawn_as or _drawn_as(explored),
        "fits": set(first.cells) == {USUAL_CELLS},
        "window": {"lower": explored.window.lower, "upper": explored.window.upper},
        "view": {name: getattr(first, name) for name in View.__dataclass_fields__},
        "scene": None if scene is None else {"bodies": scene.bodies, "effects": scene.effects, "parts": explored.parts},
    }


def listed(entry: Explored | ExploredScene) -> dict[str, Any]:
    """Return the entry of a system in the page's list."""
    image = entry.thumbnail
    data = None if image is None else f"data:image/png;base64,{base64.b64encode(image.read_bytes()).decode()}"
    return {"name": entry.name, "title": entry.title, "about": entry.about, "thumbnail": data}


def _drawn_as(explored: Explored) -> str:
    """Return how orbits of a system are shown, where it does not say so."""
    angles = sum(c.is_angle for c in explored.coordinates)
    if not isinstance(explored.system, ForcedSystem) or len(explored.coordinates) > 2 > angles:
        return "none"
    return ("mass", "chain", "rotors")[min(angles, 2)]


def basin_image(view: View, frame: LiveFrame) -> tuple[dict[str, Any], bytes]:
    """Return the description of a frame and its pixels; until it is complete, those of its coarse grid."""
    raster = view.raster(frame.identity_image if frame.complete else frame.identity_samples)
    kind, data = pixels(raster)
    height, width = view.raster(frame.basins.labels).shape
    attractors = dict(sorted(frame.attractors.items()))
    counts = label_counts(raster.ravel(), max(attractors, default=0) + 1)
    names, others = distinct_names(tuple(attractors.values())), stored_names(frame.basins.settings)
    return {
        "width": width,
        "height": height,
        "rows": raster.shape[0],
        "columns": raster.shape[1],
        "pixels": kind,
        "stride": frame.stride,
        "complete": frame.complete,
        "born": frame.born,
        "gone": frame.gone,
        "attractors": [
            {**_attractor(a, name), "identity": k, "fraction": counts[k - LOWEST] / raster.size}
            for (k, a), name in zip(attractors.items(), names, strict=True)
        ],
        "others": {name: counts[k - LOWEST] / raster.size for k, name in others.items() if counts[k - LOWEST]},
        "undecided": dict(frame.basins.undecided) if frame.complete else {},
        "inaccurate": frame.basins.inaccurate,
    }, data


def _attractor(attractor: Attractor, name: str) -> dict[str, Any]:
    return {
        "name": name,
        "kind": str(attractor.kind),
        "period": attractor.period,
        "rotations": attractor.rotations,
        "multipliers": [[z.real, z.imag] for z in attractor.multipliers.tolist()],
        "exponents": attractor.exponents,
        "points": attractor.points[:256],
    }


def orbit(explored: Explored, view: View, frame: LiveFrame, point: ArrayLike) -> dict[str, Any]:
    """Return the orbit of an initial condition under the map of a frame, and the attractor to which it converges."""
    point_map, start = frame.basins.point_map, view.state(point)
    assert point_map is not None
    known = tuple(frame.attractors.values())
    *_, last = refine_basins(point_map, start[None], MAX_PERIODS, attractors=known)
    alone = last.basins
    label, settled = int(alone.labels[0]), int(alone.settling_time[0])
    identity = next(
        (k for k, a in frame.attractors.items() if label >= 0 and a is alone.attractors[label]),
        label if label < 0 else None,
    )
    tail = alone.attractors[label].period if label >= 0 else 0
    periods = min(_DRAWN, max(settled, 0) + 2 * max(tail, 8) if label >= 0 else _DRAWN // 4)
    path = point_map.orbit(start, periods)
    return {
        "point": np.asarray(point, float),
        "identity": identity,
        "name": alone.label_name(label),
        "settled": settled if label >= 0 else None,
        "strobe": path.points,
        "motion": _motion(explored, frame, start, periods),
    }


def _motion(explored: Explored, frame: LiveFrame, start: Floats, periods: int) -> Mapping[str, Any] | None:
    """Return the states between the points of an orbit, for a forced system."""
    assert frame.basins.point_map is not None
    spec = frame.basins.point_map.without_table.spec
    if not isinstance(spec, Stroboscopic):
        return None
    samples = max(4, min(64, _SAMPLES // periods))
    path = trajectory(spec.system, start, periods, samples, spec.phase, spec.rtol, spec.atol, spec.method)
    pivot = explored.pivot
    places = None if pivot is None else [pivot(float(t), spec.system.params) for t in path.times]
    return {"times": path.times / spec.system.length, "states": path.wrapped, "samples": samples, "pivot": places}
