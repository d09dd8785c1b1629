"""Fingerprints of maps: plain values that identify a map."""

from __future__ import annotations

import dataclasses
import hashlib
from typing import Any

from .. import __version__
from .._lib.arrays import Floats
from .coordinates import wrap
from .orbit_batch import Orbits
from .point_map import PointMap

PROBES = 256
"""Points whose images are compared."""


def fingerprint(point_map: PointMap, probes: Floats) -> dict[str, Any]:
    """Return plain values that are those of a map alone, as far as some points can tell.

    Names and numbers say which map is meant.  The bits of images say that it is the same function, written in the same
    way, on a processor that gives the same results.

    Examples
    --------
    >>> import numpy as np
    >>> from cellmap import discrete_map
    >>> def halving(factor):
    ...     return discrete_map(lambda x, p: (factor * x[0],), {}, ("x",), name="halving")
    >>> points = np.array([[1.0], [2.0]])
    >>> fingerprint(halving(0.5), points) == fingerprint(halving(0.5), points)
    True
    >>> fingerprint(halving(0.5), points) == fingerprint(halving(0.51), points)
    False
    """
    digest = hashlib.sha256()
    for same in (point_map, point_map.exact):
        if same is not None:
            orbits = Orbits.starting(wrap(probes, point_map.coordinates))
            same.advance(orbits, 1)
            for part in (orbits.points, orbits.rotations, orbits.status):
                digest.update(part.tobytes())
    return {
        "system": point_map.name,
        "params": dict(point_map.params),
        "coordinates": [dataclasses.asdict(c) for c in point_map.coordinates],
        "map": dict(point_map.recipe),
        "bits of images": digest.hexdigest()[:16],
        "cellmap": __version__,
    }
