"""Configuration of the site; what is computed for its pages is in ``_extensions``."""

from __future__ import annotations

import functools
import gc
import os
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_extensions"), str(HERE.parent)]
os.environ.setdefault("MPLBACKEND", "Agg")
# The tests have compiled the same kernels, if they have run.
os.environ.setdefault("CELLMAP_CACHE_DIR", str(HERE.parent / ".pytest_cache" / "d" / "kernels"))

import inventories
import reference_tables
from alternative_text import FigureScraper
from sphinx.search.en import SearchEnglish

import cellmap

project = "cellmap"
author = "The cellmap developers"
project_copyright = "2026, The cellmap developers"
release = version = cellmap.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.intersphinx",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "live_pages",
    "page_figures",
    "plain_notebooks",
    "printed_output",
    "reference_figures",
    "reference_tables",
    "short_names",
    "stages",
    "study_pages",
]
exclude_patterns = ["_build", "paper.md", "_extensions", "generated", "examples", "tutorials", "auto/backreferences"]
templates_path = ["_templates"]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

nitpicky = True
# Words that describe a value where numpydoc has its type.
nitpick_ignore_regex = [(r"py:class", r"[^.]*|.*\s.*")]

autodoc_member_order = "bysource"
autodoc_typehints = "none"
autosummary_generate = reference_tables.names_for_autosummary()
autosummary_ignore_module_all = False
napoleon_google_docstring = False
napoleon_use_param = False
napoleon_use_rtype = False
intersphinx_mapping = inventories.written(HERE / "generated")
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

sphinx_gallery_conf = {
    "examples_dirs": ["tutorials", "examples"],
    "gallery_dirs": ["auto/tutorials", "auto/examples"],
    "filename_pattern": r"\.py$",
    "within_subsection_order": "FileNameSortKey",
    "backreferences_dir": "auto/backreferences",
    "doc_module": ("cellmap", "systems"),
    "image_scrapers": (FigureScraper(),),
    "capture_repr": (),
    "remove_config_comments": True,
    "abort_on_example_error": True,
    "show_signature": False,
    "min_reported_time": 1000,
    "write_computation_times": False,
    "reset_modules": ("matplotlib",),
}

# What is loaded by now stays: the collections of garbage, one after each program of the gallery, need not look at it.
gc.freeze()
gc.set_threshold(100_000, 20, 100)

html_math_renderer = "mathml"

html_theme = "pydata_sphinx_theme"
html_title = f"cellmap {release}"
html_static_path = ["_static"]
# For the index of the search each word is stemmed once, and not on each of its pages.
SearchEnglish.stem = functools.cache(SearchEnglish.stem)
html_search_scorer = str(HERE / "_static" / "search_scorer.js")
html_css_files = ["site.css"]
html_show_sourcelink = False
html_theme_options = {
    "show_prev_next": True,
    "secondary_sidebar_items": ["page-toc"],
    "header_links_before_dropdown": 6,
    "footer_start": ["copyright"],
    "footer_end": ["theme-version"],
}
html_sidebars = {page: [] for page in ("index", "how-to", "auto/*/*")}
