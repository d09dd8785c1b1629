"""Families of basins that are moved by hand, in the gallery, and the views of the lecture, computed when pages are."""

from __future__ import annotations

import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.image import imsave
from study_pages import GENERATED, ROOT, computed, kept

import systems
from cellmap import CellGrid
from cellmap.explorer import export_html
from cellmap.explorer.equations import typed_system
from cellmap.explorer.explored import explored_of, load_gallery
from cellmap.explorer.images import Images
from cellmap.explorer.one_file import PAGE
from cellmap.explorer.view import View
from cellmap.explorer.views import load_views
from cellmap.plot._colours import label_colours

if TYPE_CHECKING:
    from sphinx.application import Sphinx

FAMILIES = "<!-- families of basins -->"
LECTURE = "<!-- the views of the lecture -->"
VIEWS = ROOT / "docs" / "lecture.toml"

_CELLS = 160  # of an image, along each axis
_TURN = np.pi


def families(folder: Path) -> None:
    """Write the files of the gallery."""
    pendulum, weak, duffing = systems.driven_pendulum(), systems.dimensionless_pendulum(), systems.duffing_oscillator()
    plane = partial(CellGrid, shape=(_CELLS, _CELLS))
    export_html(
        folder / "pendulum.html",
        pendulum,
        {"amplitude": np.linspace(0.0015, 0.0045, 21)},
        plane((-_TURN, -400.0), (_TURN, 400.0)),
        64,
        title="A pendulum on a shaken pivot",
        about="Below 2.3 mm it cannot stand; from there on it does, if it is begun in the orange basin.",
        progress=False,
    )
    export_html(
        folder / "duffing.html",
        duffing,
        {"forcing": np.linspace(0.5, 1.5, 13) * duffing.params["forcing"]},
        plane((-4.0, -4.0), (4.0, 4.0)),
        title="A stiffening spring",
        about="Small and large oscillations at the same force.",
        progress=False,
    )
    names = list(weak.params)[:2]
    export_html(
        folder / "two_parameters.html",
        weak,
        {name: np.linspace(0.7, 1.3, 5) * weak.params[name] for name in names},
        plane((-_TURN, -2.0), (_TURN, 2.0)),
        64,
        title="Two parameters",
        about="The pendulum with the time in units of its drive.",
        progress=False,
    )


def framed(app: Sphinx) -> str:
    """Return the families, each in a frame of its page."""
    folder = kept("families", sorted(PAGE.glob("*")), families)
    place = Path(app.outdir) / "families"
    place.mkdir(parents=True, exist_ok=True)
    parts = []
    for file in sorted(folder.glob("*.html")):
        shutil.copy(file, place)
        title = file.stem.replace("_", " ")
        frame = (
            f'<iframe src="families/{file.name}" title="Basins of attraction: {title}" loading="lazy" class="family">'
        )
        parts.append(f"```{{raw}} html\n{frame}</iframe>\n```")
    return "\n\n".join(parts)


def images(folder: Path) -> None:
    """Draw the views of the lecture."""
    gallery = {entry.name: entry for entry in load_gallery("systems.gallery")}
    for number, given in enumerate(load_views(VIEWS, gallery), 1):
        name = given["name"]
        explored = typed_system(given["text"]) if name is None else explored_of(gallery[name], given["parts"])
        view = View.of(given["view"], explored)
        *_, frame = Images(explored).frames(replace(view, cells=(_CELLS, _CELLS)))
        labels = view.raster(frame.basins.labels)
        colours = label_colours(np.unique(labels).tolist())
        imsave(
            folder / f"view_{number:02d}.png",
            np.array([to_rgb(colours[k]) for k in labels.ravel()]).reshape(*labels.shape, 3),
        )


def lecture() -> str:
    """Return the views of the lecture: a title, a sentence and an image each."""
    folder = kept("lecture", [VIEWS], images)
    parts = []
    for image, given in zip(sorted(folder.glob("*.png")), views(), strict=True):
        place = image.relative_to(GENERATED.parent).as_posix()
        shown = f"```{{image}} {place}\n:alt: Basins of this view\n:width: 45%\n```"
        parts += [f"## {given['title']}", given["sentence"], shown]
    return "\n\n".join(parts)


def views() -> list[dict[str, str]]:
    """Return the views of the lecture."""
    return load_views(VIEWS, {entry.name: entry for entry in load_gallery("systems.gallery")})


def fill(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put the families and views where pages ask for them."""
    for marker, text in ((FAMILIES, partial(framed, app)), (LECTURE, lecture)):
        if marker in source[0]:
            source[0] = source[0].replace(marker, computed(text)())


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the hooks."""
    app.connect("source-read", fill)
    app.connect("env-get-outdated", lambda app, *_: ["gallery", "lecture"])
    return {"parallel_read_safe": True, "parallel_write_safe": True}
