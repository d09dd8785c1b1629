"""Results as notebooks show them: a heading, a table of a few numbers, and of basins a small image."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from ..basins.certification.certificate import Certificate, Evidence
from ..basins.record import Basins
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from ..orbits.attractor import Attractor

_ROWS_SHOWN = 12
_CHARACTERS = 120  # longest text in a cell of a table; the rest is cut off


def html(record: Any) -> str:
    """Return the HTML of a record: no scripts, nothing from elsewhere, all text escaped."""
    for kind, rows in _ROWS.items():
        if isinstance(record, kind):
            return _card(type(record).__name__, rows(record), _image_of(record))
    return f"<pre>{escape(repr(record))}</pre>"


def _card(heading: str, rows: Mapping[str, str], image: str) -> str:
    """Put HTML together; names and texts of rows are escaped here."""
    lines = [f"<tr><th>{escape(_short(k))}</th><td>{escape(_short(v))}</td></tr>" for k, v in rows.items()]
    hidden = len(lines) - _ROWS_SHOWN
    if hidden > 1:
        lines = [*lines[:_ROWS_SHOWN], f'<tr><td colspan="2">{hidden} more</td></tr>']
    return f"<div><strong>{escape(heading)}</strong>{image}<table>{''.join(lines)}</table></div>"


def _short(text: str) -> str:
    return text if len(text) <= _CHARACTERS else text[:_CHARACTERS] + "…"


def _image_of(record: Any) -> str:
    if isinstance(record, Certificate):
        record = record.basins
    if not isinstance(record, Basins):
        return ""
    from ..plot._basins import thumbnail

    png = thumbnail(record)
    if png is None:
        return ""
    text = escape(f"Basins of {_short(record.name)}")
    return f'<br><img alt="{text}" src="data:image/png;base64,{b64encode(png).decode()}">'


def _basins(basins: Basins) -> dict[str, str]:
    window = f"{basins.labels.size:,}"
    if basins.grid is not None:
        window += f" on {_window(basins.grid, [str(c) for c in basins.coordinates])}"
    fractions = {basins.label_name(k): f"{100 * f.fraction:.4g} %" for k, f in basins.fractions.items()}
    return {"system": _of_system(basins.name, basins.params), "initial conditions": window, **fractions}


def _certificate(certificate: Certificate) -> dict[str, str]:
    counts = np.bincount(certificate.evidence.ravel(), minlength=len(Evidence))
    return {
        **{f"evidence {e.name.lower()}": f"{counts[e]:,}" for e in Evidence},
        "changed": f"{certificate.changed:,}",
        "wrong, 95 %": f"{100 * certificate.wrong[0]:.2g} to {100 * certificate.wrong[1]:.2g} %",
        **_basins(certificate.basins),
    }


def _attractor(attractor: Attractor) -> dict[str, str]:
    names = ", ".join(str(c) for c in attractor.coordinates)
    place = ", ".join(f"{v:.6g}" for v in attractor.points[0])
    found = {"name": attractor.name, f"first point: {names}": place, "points": str(len(attractor.points))}
    if attractor.multipliers.size:
        found["|multipliers|"] = ", ".join(f"{m:.4g}" for m in np.abs(attractor.multipliers))
    found["exponents per step"] = ", ".join(f"{e:.4g}" for e in attractor.exponents)
    return found | {"trapping region": "verified" if attractor.verified else "not verified"}


def _point_map(point_map: PointMap) -> dict[str, str]:
    found = {
        "kind": str(point_map.recipe["kind"]),
        "system": _of_system(point_map.name, point_map.params),
        "coordinates": ", ".join(str(c) for c in point_map.coordinates),
        "period": f"{point_map.period:.6g}",
    }
    if point_map.table is not None:
        found["cells"] = " x ".join(map(str, point_map.table.grid.shape))
    return found


def _cell_grid(grid: CellGrid) -> dict[str, str]:
    return {
        f"axis {j}": f"{n} cells from {a:.6g} to {b:.6g}" + ", periodic" * wraps
        for j, (a, b, n, wraps) in enumerate(zip(grid.lower, grid.upper, grid.shape, grid.wraps, strict=True))
    }


def _window(grid: CellGrid, names: Sequence[str]) -> str:
    axes = zip(names, grid.lower, grid.upper, grid.shape, strict=True)
    return "; ".join(f"{name} {a:.4g} to {b:.4g} ({n})" for name, a, b, n in axes)


def _of_system(name: str, params: Mapping[str, float]) -> str:
    return f"{name}: " + ", ".join(f"{k}={v:g}" for k, v in params.items()) if params else name


_ROWS: Mapping[type, Any] = {
    Attractor: _attractor,
    Basins: _basins,
    CellGrid: _cell_grid,
    Certificate: _certificate,
    PointMap: _point_map,
}
"""What is told of a record, in the order of its rows."""
