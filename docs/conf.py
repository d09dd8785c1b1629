"""Configuration of the site."""

from __future__ import annotations

import inspect
import re
import sys
from enum import Enum

from sphinx.application import Sphinx

import cellmap

project = "cellmap"
author = "The cellmap developers"
project_copyright = "2026, The cellmap developers"
release = cellmap.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_param = False
napoleon_use_rtype = False

html_theme = "pydata_sphinx_theme"
html_title = "cellmap"
html_static_path = ["_static"]
html_show_sourcelink = False
html_theme_options = {"show_prev_next": True, "secondary_sidebar_items": ["page-toc"]}

EXPORTS = "<!-- everything that cellmap exports -->"


def exported_names() -> list[str]:
    """Return the public names of the library, in the order of its ``__init__``."""
    names = getattr(cellmap, "__all__", None) or [n for n in vars(cellmap) if not n.startswith("_")]
    return [n for n in names if not inspect.ismodule(getattr(cellmap, n))]


def exports() -> str:
    """Return the reference as text: a section for each module, an entry for each name that it exports."""
    by_module: dict[str, list[str]] = {}
    for name in exported_names():
        by_module.setdefault(getattr(cellmap, name).__module__, []).append(name)
    parts = []
    for module, names in by_module.items():
        sentence = (inspect.getdoc(sys.modules[module]) or module).split("\n\n")[0].replace("\n", " ")
        title = re.split("[.:,]", sentence)[0]
        parts += [f"## {title}", *([sentence] if len(sentence) > len(title) + 1 else [])]
        parts += [f"```{{eval-rst}}\n{directive(name)}\n```" for name in names]
    return "\n\n".join(parts)


def directive(name: str) -> str:
    """Return the directive that documents one name."""
    thing = getattr(cellmap, name)
    if not inspect.isclass(thing):
        return f".. autofunction:: cellmap.{name}"
    members = [":members:", *([":undoc-members:"] if issubclass(thing, Enum) else [])]
    return "\n".join([f".. autoclass:: cellmap.{name}", *(f"   {line}" for line in members)])


def fill_reference(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put the exports into the page that asks for them."""
    source[0] = source[0].replace(EXPORTS, exports())


def setup(app: Sphinx) -> None:
    """Register the hook."""
    app.connect("source-read", fill_reference)
