"""Draw the figure of the explorer on the pages: ``python docs/explorer_figure.py``, with Chromium on this machine."""

from __future__ import annotations

import io
import os
import shutil
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

from cellmap.explorer.explored import load_gallery
from cellmap.explorer.serving import serve

TARGET = Path(__file__).parent / "_static" / "explorer.png"
PROGRAM = os.environ.get("CELLMAP_BROWSER") or shutil.which("chromium") or shutil.which("google-chrome")
WAITING = "!document.getElementById('preview').hidden"


def main() -> None:
    """Open the explorer at its first system, click a point, draw a bifurcation diagram, and keep the screen."""
    with serve(load_gallery("systems.gallery"), open_page=False) as explorer, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=PROGRAM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1200, "height": 900})
        page.goto(explorer.address)
        page.wait_for_timeout(1000)
        while page.evaluate(WAITING):
            page.wait_for_timeout(100)
        page.select_option("#along", "amplitude")
        page.click("#diagram")
        page.wait_for_selector("#bifurcations:visible")
        page.click("#image", position={"x": 200, "y": 120})
        page.wait_for_selector("#ends li")
        screen = Image.open(io.BytesIO(page.screenshot()))
        screen.convert("P", palette=Image.Palette.ADAPTIVE, colors=64).save(TARGET, optimize=True)
        browser.close()


if __name__ == "__main__":
    main()
