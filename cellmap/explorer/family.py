"""Families of basins in one HTML file: images over one or two parameters, to be scrubbed and pointed at offline."""

from __future__ import annotations

import base64
import itertools
import os
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from tqdm import tqdm

from .._lib.checks import finite_number, known_parameter, monotone_values, text
from .._lib.files import as_target, write_whole
from .._lib.signatures import checked
from ..maps.grid import CellGrid
from ..maps.point_map import PointMap
from ..maps.system import ForcedSystem
from .explored import Explored, explored_from
from .images import Images, basin_image, described
from .one_file import page_of_one_file
from .protocol import LOWEST, encoded
from .view import View

MOST_IMAGES = 2000

_POINTS = 64  # points of an attractor that are drawn


class Still(NamedTuple):
    """A view, its image of labels, and its attractors as the page is told of them."""

    view: View
    raster: NDArray[np.int16]
    attractors: Sequence[Mapping[str, Any]]


def file_of_family(explored: Explored, parameters: Sequence[str], stills: Sequence[Still], title: str = "") -> bytes:
    """Return the HTML file of images at all combinations of the values of some parameters."""
    values = {name: sorted({s.view.params[name] for s in stills}) for name in parameters}
    order = {combination: k for k, combination in enumerate(itertools.product(*values.values()))}
    ordered = sorted(stills, key=lambda s: order[tuple(s.view.params[name] for name in parameters)])
    codes = np.stack([s.raster for s in ordered]) - np.int16(LOWEST)
    kind = "uint8" if codes.max() < 256 else "uint16"
    codes = codes.astype(f"<{np.dtype(kind).str[1:]}")
    codes[1:] ^= codes[:-1].copy()  # neighbouring images differ in few places
    first, told = ordered[0].view, described(explored)
    facts = {
        "system": {key: value for key, value in told.items() if key not in ("view", "scene", "name")},
        "title": title,
        "parameters": [{"name": name, "values": values[name]} for name in parameters],
        "view": {name: getattr(first, name) for name in View.__dataclass_fields__},
        "codes": told["codes"],
        "lowest": LOWEST,
        "pixels": kind,
        "shape": codes.shape,
        "attractors": [
            [
                {"identity": a["identity"], "name": a["name"], "points": np.asarray(a["points"])[:_POINTS]}
                for a in s.attractors
            ]
            for s in ordered
        ],
        "labels": base64.b64encode(zlib.compress(codes.tobytes(), 9)).decode(),
    }
    head = f'<script type="application/json" id="family">{encoded(facts).replace("<", chr(92) + "u003c")}</script>\n'
    return page_of_one_file("family.html", head).encode()


@checked
def export_html(
    path: str | os.PathLike[str],
    system: ForcedSystem | PointMap,
    parameters: Mapping[str, ArrayLike],
    region: CellGrid | None = None,
    nodes: int = 0,
    *,
    phase: float = 0.0,
    tolerance: float = 1e-6,
    title: str = "",
    about: str = "",
    progress: bool = True,
) -> Path:
    """Write the basins of a system over one or two of its parameters as one HTML file, which needs no server.

    The page has a slider for each parameter, and names the attractor under the pointer.  Attractors keep their colours
    over all images; labels are those of :func:`find_basins` for the attractors that were followed.  They are kept
    without loss, each image as its differences from the one before, compressed.

    Parameters
    ----------
    path : path
        File to write, whole or not at all, as :func:`save_basins` does.
    system : ForcedSystem or PointMap
        The system, or a discrete map.
    parameters : mapping of str to array_like, shape (n_values,)
        Values of one or two parameters; the images are those of all combinations.
    region, nodes
        As in :func:`explore`; a system of more than two coordinates is shown as a slice through the region's centre.
    phase : float, optional
        Phase of the section of a forced system, as a fraction of its period.
    tolerance : float, optional
        Tolerance of the exact map.
    title, about : str, optional
        What stands above the image, by default the system's name, and a sentence below it.
    progress : bool, optional
        Show a progress bar.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range, or an image that is not complete after two minutes.
    OSError
        At once for a place where no file can be made; at the end for a full disk, which keeps an older file.

    Examples
    --------
    >>> from math import tanh
    >>> from cellmap import CellGrid, discrete_map
    >>> wells = discrete_map(lambda x, p: (tanh(p.a * x[0]), x[1] / 2), {"a": 0.5}, ("x", "y"), "wells")
    >>> path = getfixture("tmp_path") / "wells.html"
    >>> region = CellGrid((-1, -1), (1, 1), (100, 100))
    >>> file = export_html(path, wells, {"a": [0.5, 1.5, 2.0]}, region, progress=False)
    >>> file.stat().st_size < 100_000
    True
    """
    target = as_target("path", path)
    title, about = text("title", title), text("about", about)
    explored = replace(explored_from(system, region, nodes), about=about)
    first = View.first(explored)
    if not 1 <= len(parameters) <= 2:
        raise ValueError(f"parameters={sorted(parameters)}: give values of one or two parameters")
    values = {
        known_parameter("parameters", name, first.params): np.sort(monotone_values(f"parameters[{name!r}]", given))
        for name, given in parameters.items()
    }
    count = int(np.prod([len(v) for v in values.values()]))
    if not 0 < count <= MOST_IMAGES:
        raise ValueError(f"parameters: {count} combinations of values; give from 1 to {MOST_IMAGES}")
    tolerance = finite_number("tolerance", tolerance, at_least=1e-13, at_most=1e-2)
    first = replace(first, phase=None if first.phase is None else finite_number("phase", phase), tolerance=tolerance)
    views = to_and_fro(first, values)
    images, stills = Images(explored), []
    for view in tqdm(views, "images", disable=not progress):
        frame = None
        for frame in images.frames(view):  # noqa: B007
            pass
        if frame is None or not frame.complete:
            raise ValueError("image is not complete after two minutes: take fewer cells, or a looser tolerance")
        facts, _ = basin_image(view, frame)
        stills.append(Still(view, view.raster(frame.identity_image), facts["attractors"]))
    write_whole(target, file_of_family(explored, list(values), stills, title))
    return target


def to_and_fro(view: View, values: Mapping[str, Sequence[float] | NDArray[np.float64]]) -> tuple[View, ...]:
    """Return views at all combinations of values, each next to the one before, so that attractors are followed."""
    (first, along), *second = values.items()
    views = []
    for k, value in enumerate(along):
        rest = second[0] if second else (first, (value,))
        inner = rest[1] if k % 2 == 0 else rest[1][::-1]
        views += [replace(view, params={**view.params, first: float(value), rest[0]: float(v)}) for v in inner]
    return tuple(views)
