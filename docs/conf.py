"""Configuration of the site."""

from __future__ import annotations

import hashlib
import inspect
import os
import re
import sys
from enum import Enum
from pathlib import Path

from sphinx.application import Sphinx

import cellmap
from studies import hard_cases

project = "cellmap"
author = "The cellmap developers"
project_copyright = "2026, The cellmap developers"
release = cellmap.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx.ext.napoleon"]
exclude_patterns = ["_build", "generated"]
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
HARD_CASES = "<!-- what came out of the hard cases -->"


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


def hard_case_results() -> str:
    """Return what came out of the hard cases; they run again only where code or reference values have changed."""
    root = Path(__file__).parents[1]
    sources = [p for room in ("cellmap", "systems", "studies/hard_cases") for p in sorted((root / room).rglob("*.py"))]
    code = hashlib.sha256(b"".join(p.read_bytes() for p in [*sources, hard_cases.TABLE])).hexdigest()
    kept = Path(__file__).parent / "generated" / f"hard_cases_{code[:16]}.md"
    if not kept.exists():
        # The tests have compiled the same kernels, if they have run.
        os.environ.setdefault("CELLMAP_CACHE_DIR", str(root / ".pytest_cache" / "d" / "kernels"))
        kept.parent.mkdir(exist_ok=True)
        for old in kept.parent.glob("hard_cases_*.md"):
            old.unlink()
        kept.write_text(hard_cases.page(hard_cases.compute()), encoding="utf-8")
    return kept.read_text(encoding="utf-8")


def fill_page(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put what is computed into the pages that ask for it."""
    for marker, text in ((EXPORTS, exports), (HARD_CASES, hard_case_results)):
        if marker in source[0]:
            source[0] = source[0].replace(marker, text())


def pages_that_are_computed(app: Sphinx, *_: object) -> list[str]:
    """Name the pages that change with the code, whether or not their own text has."""
    return ["hard-cases", "reference"]


def setup(app: Sphinx) -> None:
    """Register the hooks."""
    app.connect("source-read", fill_page)
    app.connect("env-get-outdated", pages_that_are_computed)
