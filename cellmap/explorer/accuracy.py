"""How far an image can be relied on: the accuracy of its map, seen from its pixels, and what became of lost orbits."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from .._lib.arrays import Floats
from ..attractors.settling.labels import Label
from ..basins.live import LiveFrame
from ..maps.coordinates import difference
from ..maps.orbit_batch import Status
from ..maps.point_map import PointMap, history
from ..maps.stroboscopic import Stroboscopic
from .view import View

TOLERANCES = (1e-3, 1e-4, 1e-6, 1e-9, 1e-12)
"""Tolerances that the page offers."""

_ERROR_SAMPLES = 2000
_PLACES = 64  # places of the image at which its pixels are compared with the error of the map
_FINER = 1e-2  # tolerance of the map that is taken for exact, in tolerances of the map of the image
_FINEST = 1e-13
_LOST, _PERIODS = 16, 64  # orbits without steps that are followed, and for how long
_FAR = 4.0  # sizes of the first window, beyond which an orbit has grown


def quality(view: View, frame: LiveFrame) -> dict[str, Any]:
    """Return how accurate the map of a frame is."""
    point_map = frame.basins.point_map
    assert point_map is not None
    found: dict[str, Any] = {"map": point_map.recipe["kind"], "tolerance": view.tolerance, "nodes": view.nodes}
    error = 10.0 * view.tolerance
    if point_map.table is not None:
        measured = point_map.error(_ERROR_SAMPLES)
        found["fallback"] = float(point_map.table.fallback.mean())
        found["error"] = {
            "median": measured.median,
            "percentile_99": measured.percentile_99,
            "largest": measured.largest,
        }
        error = measured.percentile_99
    if point_map.without_table.unknown_formulas:
        found["unknown_formulas"] = point_map.without_table.unknown_formulas
    found["noise"] = _noise(view, point_map, error)
    found["grown"] = _grown(view, frame, point_map.without_table)
    return found


def verification(frame: LiveFrame, n_samples: int) -> dict[str, Any]:
    """Compare labels of random initial conditions with those of the exact map."""
    found = frame.basins.verify(n_samples)
    return {name: getattr(found, name) for name in ("compared", "wrong", "low", "high", "excluded", "undecided")}


def _noise(view: View, point_map: PointMap, error: float) -> dict[str, Any] | None:
    """Return how many pixels an error of the map is wide, where it is more than half a one, and what helps.

    The image of a place after one period is compared with that of a finer tolerance, and with those of the places one
    pixel further along each axis.  ``error``: about that of one period, by which wide pixels are left alone.
    """
    spec = point_map.without_table.spec
    lower, upper = np.array(view.lower), np.array(view.upper)
    pixels = (upper - lower) / view.cells
    if (
        not isinstance(spec, Stroboscopic)
        or (pixels > 1e2 * error * np.maximum(1.0, np.abs([lower, upper]).max(0))).all()
    ):
        return None
    finer = max(_FINEST, _FINER * view.tolerance)
    exact = replace(spec, rtol=finer, atol=finer).build()
    places = lower + (upper - lower) * np.random.default_rng(0).random((_PLACES, len(pixels)))
    initial_conditions = np.array([view.state(place) for place in places])
    shifted = [np.array([view.state(place + shift) for place in places]) for shift in np.diag(pixels)]
    images = history(exact, np.stack([initial_conditions, *shifted]), 1).points[-1]
    given = history(point_map, initial_conditions, 1).points[-1]
    sizes = np.abs(np.nan_to_num(images)).max(axis=(0, 1)) + 1e-300

    def lengths(ends: Floats) -> Floats:
        return np.asarray(np.sqrt(((difference(ends, images[0], exact.coordinates) / sizes) ** 2).sum(axis=-1)))

    wrong = lengths(given)
    ratios = [wrong / np.maximum(lengths(image), 1e-300) for image in images[1:]]
    known = [ratio[np.isfinite(ratio)] for ratio in ratios]
    wide = max((float(np.median(ratio)) for ratio in known if ratio.size), default=0.0)
    if not wide > 0.5:
        return None
    enough = [t for t in TOLERANCES if t <= 0.2 * view.tolerance / wide] if point_map.table is None else []
    return {"pixels": wide, "tolerance": max(enough, default=None), "exact": point_map.table is None}


def _grown(view: View, frame: LiveFrame, exact: PointMap) -> dict[str, Any] | None:
    """Return of some orbits that had no steps left how many had grown far beyond the window, and how far."""
    labels = frame.basins.labels
    lost = np.argwhere(labels == Label.OUT_OF_STEPS)
    if not frame.complete or len(lost) < 0.01 * labels.size:
        return None
    lost = lost[np.linspace(0, len(lost) - 1, _LOST).round().astype(int)]
    lower, upper = np.array(view.lower), np.array(view.upper)
    order = np.argsort(view.axes) if len(view.axes) == len(view.others) else np.arange(len(view.axes))
    cells = np.empty(lost.shape)
    cells[:, order] = lost
    initial_conditions = np.array([view.state(place) for place in lower + (cells + 0.5) / view.cells * (upper - lower)])
    orbits = history(exact, initial_conditions, _PERIODS)
    straight = [j for j, c in enumerate(exact.coordinates) if c.period is None] or list(range(len(view.others)))
    reached = np.abs(np.nan_to_num(orbits.points[..., straight])).max(axis=0)
    size = np.maximum(np.abs(initial_conditions[:, straight]), 1e-300).max(axis=0)
    ended = orbits.status[-1] >= Status.ESCAPED
    far = (reached > _FAR * size).any(axis=-1) & ended
    return {"followed": len(lost), "grown": int(far.sum()), "reached": float(reached[far].max(initial=0.0))}
