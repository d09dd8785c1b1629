"""Figures on pages of the reference: of the first program on a page of the guide that calls what is described.

What has examples in the gallery is left to them; builds that only check the pages have no such figures.
"""

from __future__ import annotations

from pathlib import Path

from docutils import nodes
from page_figures import STATED, drawn, known_figures
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from study_pages import GENERATED, computes

DOCS = GENERATED.parent


class ReferenceFigure(SphinxDirective):
    """``.. page-figure:: cellmap.plot.boxes`` shows a figure of a page that calls it, with a link to the page."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the figure; nothing where there is none, or where the gallery has one."""
        full = self.arguments[0]
        *_, room, name = full.split(".")
        figure = known_figures().get(f"plot.{name}" if room == "plot" else name)
        examples = DOCS / "auto" / "backreferences" / f"{full}.examples"
        if figure is None or not computes() or (examples.exists() and examples.stat().st_size):
            return []
        text = (DOCS / f"{figure.page}.md").read_text(encoding="utf-8")
        image = sorted(drawn(figure.page, text).glob("*.png"))[figure.number]
        uri = f"/{image.relative_to(DOCS).as_posix()}"
        content = f".. figure:: {uri}\n   :alt: {figure.alternative}\n   :class: program-figure\n\n"
        content += f"   {figure.alternative}. From :doc:`/{figure.page}`."
        return self.parse_text_to_nodes(content)


def draw_pages(app: Sphinx) -> None:
    """Draw the figures of all pages before the first is read, for pages of the reference show them too."""
    for path in sorted(Path(app.srcdir).glob("*.md")):
        if computes() and STATED.search(text := path.read_text(encoding="utf-8")):
            drawn(path.stem, text)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive, and the hook that follows the galleries."""
    app.add_directive("page-figure", ReferenceFigure)
    app.connect("builder-inited", draw_pages, priority=960)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
