"""Notebooks of executed pages without the roles of reStructuredText: names stay as code, titles as text."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx


TITLED = re.compile(r":(?:class|doc|func|meth):`([^`<]+?) <[^`>]*>`")
NAMED = re.compile(r":(?:class|doc|func|meth):`~?[^`]*?([\w-]+)`")
DOUBLE = re.compile(r"(?<!`)``([^`]+)``(?!`)")


def plain(text: str) -> str:
    """Return text, or the JSON of a notebook, with its references as Markdown.

    >>> plain("see :func:`~cellmap.basins.certify`, :doc:`/own-system` and :doc:`the report </the-report>`, ``a.b``")
    'see `certify`, `own-system` and the report, `a.b`'
    """
    return DOUBLE.sub(r"`\1`", NAMED.sub(r"`\1`", TITLED.sub(r"\1", text)))


def rewrite(app: Sphinx) -> None:
    """Rewrite the notebooks that the galleries have written."""
    for notebook in sorted(Path(app.srcdir, "auto").glob("*/*.ipynb")):
        notebook.write_text(plain(notebook.read_text(encoding="utf-8")), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the hook, which follows the execution of the pages."""
    app.connect("builder-inited", rewrite, priority=950)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
