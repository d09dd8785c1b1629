"""Analyses of a complete image on demand: measures of its boundary, and certificates."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any

import numpy as np

from .._lib.fit import Fit
from ..analysis.fractal.boundary_dimensions import boundary_dimension
from ..analysis.fractal.entropy import basin_entropy
from ..analysis.fractal.uncertainty_fits import image_uncertainty_exponent
from ..basins.certification.certificate import Evidence
from ..basins.certification.certifying import certify
from ..basins.live import LiveFrame
from ..basins.record import Basins
from .view import View


def measures(frame: LiveFrame) -> dict[str, Any]:
    """Return basin entropy, boundary dimension and uncertainty exponent, each with its error, or why there is none."""
    return {"measures": [_measured(name, measure, frame.basins) for name, measure in _MEASURES.items()]}


def _measured(name: str, measure: Callable[[Basins], dict[str, Any]], basins: Basins) -> dict[str, Any]:
    try:
        return {"name": name, **measure(basins)}
    except (ValueError, TypeError) as error:
        return {"name": name, "reason": str(error)}


def _entropy(basins: Basins) -> dict[str, Any]:
    found = basin_entropy(basins)
    return {"value": found.entropy, "error": found.standard_error}


def _boundary_entropy(basins: Basins) -> dict[str, Any]:
    found = basin_entropy(basins)
    return {"value": found.boundary_entropy, "error": found.boundary_error}


def _dimension(basins: Basins) -> dict[str, Any]:
    return _line(boundary_dimension(basins).fit)


def _exponent(basins: Basins) -> dict[str, Any]:
    found = image_uncertainty_exponent(basins)
    if found.fit is None:
        raise ValueError("fewer than three distances have pairs with different labels: take more cells")
    return _line(found.fit)


def _line(fit: Fit) -> dict[str, Any]:
    return {
        "value": fit.slope,
        "error": fit.standard_error,
        "fit": {
            "x": fit.x,
            "y": fit.y,
            "labels": fit.labels,
            "window": fit.fit_range,
            "slope": fit.slope,
            "intercept": fit.intercept,
        },
    }


_MEASURES = {
    "basin entropy": _entropy,
    "boundary basin entropy": _boundary_entropy,
    "boundary dimension": _dimension,
    "uncertainty exponent": _exponent,
}


def certificate(view: View, frame: LiveFrame) -> tuple[dict[str, Any], bytes]:
    """Return a certificate of the labels, and as bytes which pixels stay open: 1, others 0."""
    if len(view.axes) != 2 or len(view.others) != 2:
        raise ValueError("certificates are for maps of two coordinates: use Verify")
    found = certify(frame.basins, max_cost=inf)
    open_cells = (found.evidence == Evidence.OPEN).astype(np.int16)
    raster = view.raster(open_cells)
    facts = {
        "redone": found.redone,
        "changed": found.changed,
        "wrong": found.wrong,
        "open": int(open_cells.sum()),
        "height": raster.shape[0],
        "width": raster.shape[1],
    }
    return facts, np.ascontiguousarray(raster, np.uint8).tobytes()
