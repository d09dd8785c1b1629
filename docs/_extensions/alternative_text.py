"""Figures of executed pages with the alternative text that the program states in ``# sphinx_gallery_alt = "..."``."""

from __future__ import annotations

import re
from typing import Any

from sphinx_gallery.scrapers import matplotlib_scraper

STATED = re.compile(r'^# sphinx_gallery_alt = "(.*)"$', re.MULTILINE)


class FigureScraper:
    """Save the figures of a block of code, and fail where the number of figures is not that of alternative texts."""

    def __repr__(self) -> str:
        return "FigureScraper"

    def __call__(self, block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any], **kwargs: Any) -> str:
        """Return the figures as reStructuredText."""
        texts = iter(STATED.findall(block[1]))
        rst = matplotlib_scraper(block, block_vars, gallery_conf, bbox_inches="tight", dpi=120, **kwargs)
        rst = re.sub(r"(:alt: ).*", lambda found: found[1] + next(texts, "MISSING"), rst)
        if "MISSING" in rst or next(texts, None) is not None:
            raise ValueError(
                f"{block_vars['src_file']}: a text for each figure, and a figure for each text:\n{block[1]}"
            )
        return rst
