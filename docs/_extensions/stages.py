"""What the build is doing, a line for each stage with the seconds so far; what a build that only checks leaves out."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from study_pages import computes

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.config import Config

BEGIN = time.monotonic()
LEFT_OUT = "This build only checks the pages: what studies print and figures of pages are left out."


def say(what: str) -> None:
    """Print a line."""
    print(f"{time.monotonic() - BEGIN:6.0f} s  {what}", file=sys.stderr, flush=True)


def configured(app: Sphinx, config: Config) -> None:
    """Say what comes first, and put a banner on the pages of an incomplete site."""
    programs = sum(len(list(Path(app.srcdir, folder).glob("*.py"))) for folder in ("tutorials", "examples"))
    say(f"tutorials and examples: {programs} programs, those that have changed")
    if not computes():
        config.html_theme_options["announcement"] = f"{LEFT_OUT} <code>make docs</code> has all."


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the lines."""
    figures = "figures of pages, and studies (minutes, once)" if computes() else LEFT_OUT
    app.connect("config-inited", configured)
    app.connect("builder-inited", lambda app: say(figures), priority=955)  # before the figures, behind the gallery
    app.connect("env-before-read-docs", lambda app, env, names: say(f"reading {len(names)} pages"))
    app.connect("env-updated", lambda app, env: say("writing pages"))
    app.connect("build-finished", lambda app, error: say("failed" if error else "done"))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
