"""Figures of the explorer: ``python docs/explorer_figure.py [screens] [thumbnails [names]]``, screens with Chromium."""

from __future__ import annotations

import io
import os
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from cellmap.explorer.explored import explored_of, load_gallery
from cellmap.explorer.images import Images
from cellmap.explorer.serving import serve
from cellmap.explorer.view import View
from cellmap.plot._colours import label_colours

HERE = Path(__file__).parent
PROGRAM = os.environ.get("CELLMAP_BROWSER") or shutil.which("chromium") or shutil.which("google-chrome")
COMPLETE = "document.getElementById('preview').hidden && document.querySelectorAll('#attractors td').length > 0"
THUMBNAIL = 64  # pixels


def main() -> None:
    """Make what is asked for, by default both."""
    asked = sys.argv[1:] or ["screens", "thumbnails"]
    if "thumbnails" in asked:
        thumbnails()
    if "screens" in asked:
        with (
            serve(load_gallery("systems.gallery"), open_page=False, views=HERE / "lecture.toml") as explorer,
            sync_playwright() as playwright,
        ):
            browser = playwright.chromium.launch(executable_path=PROGRAM, args=["--no-sandbox"])
            first = explorer.address + "#schema=1&system=driven_pendulum&cells=776,776"
            screen(browser, first, "explorer", (1400, 900), desk)
            screen(browser, explorer.address, "explorer_lecture", (1400, 900), lecture)
            screen(browser, first, "explorer_dark", (1400, 900), diagram, dark=True)
            screen(browser, first.replace("776", "374"), "explorer_phone", (390, 844), lambda page: None)
            browser.close()


def screen(
    browser: Browser, address: str, name: str, size: tuple[int, int], act: Callable[[Page], None], dark: bool = False
) -> None:
    """Open a page, do something, and keep the screen with 96 colours."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]}, color_scheme="dark" if dark else "light")
    page.goto(address)
    wait_for(page, COMPLETE)
    act(page)
    page.wait_for_timeout(500)
    shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    shot.quantize(96, dither=Image.Dither.NONE).save(HERE / "_static" / f"{name}.png", optimize=True)
    page.close()


def wait_for(page: Page, condition: str) -> None:
    """Wait for a condition; the page forbids what Playwright's own function for it needs."""
    while not page.evaluate(condition):
        page.wait_for_timeout(20)


def desk(page: Page) -> None:
    """Saddles with their manifolds, and an orbit that moves."""
    page.click("#saddles")
    page.wait_for_selector("#found li", state="attached")
    page.click("#image", position={"x": 250, "y": 150})
    page.wait_for_selector("#body:visible")
    page.wait_for_timeout(2500)
    page.click("#run")


def lecture(page: Page) -> None:
    """The third prepared view, with an orbit and the pointer at a basin."""
    page.keyboard.press("3")
    page.wait_for_timeout(500)
    wait_for(page, COMPLETE)
    page.keyboard.press("l")
    page.wait_for_timeout(1000)
    wait_for(page, COMPLETE)
    page.click("#image", position={"x": 300, "y": 300})
    page.wait_for_timeout(2000)
    page.mouse.move(250, 620)


def diagram(page: Page) -> None:
    """A bifurcation diagram."""
    page.select_option("#along", "amplitude")
    page.click("#diagram")
    page.wait_for_selector("#bifurcations:visible")


def thumbnails() -> None:
    """Draw each system of the gallery as it is shown first."""
    folder = HERE.parent / "systems" / "thumbnails"
    folder.mkdir(exist_ok=True)
    wanted = [name for name in sys.argv[1:] if name not in ("screens", "thumbnails")]
    for entry in load_gallery("systems.gallery"):
        if wanted and entry.name not in wanted:
            continue
        explored = explored_of(entry)
        view = View.first(explored)
        view = replace(view, cells=tuple(THUMBNAIL for _ in view.axes), nodes=min(view.nodes, 64))
        *_, frame = Images(explored).frames(view)
        raster = view.raster(frame.identity_image)
        raster = np.broadcast_to(raster, (THUMBNAIL, raster.shape[1]))
        colours = label_colours(np.unique(raster).tolist())
        pixels = np.array([to_rgb(colours[k]) for k in raster.ravel()]).reshape(*raster.shape, 3)
        pixels = np.rint(255 * pixels).astype(np.uint8)
        points = np.concatenate([a.points for a in frame.attractors.values()] or [np.empty((0, len(view.others)))])
        if len(view.axes) == 2:
            lower, upper = np.array(view.lower), np.array(view.upper)
            places = np.floor((points[:, view.axes] - lower) / (upper - lower) * THUMBNAIL).astype(int)
            across, up = places[((places >= 0) & (places < THUMBNAIL)).all(axis=1)].T
            pixels[THUMBNAIL - 1 - up, across] = 255
        Image.fromarray(pixels).quantize(64).save(folder / f"{entry.name}.png", optimize=True)
        print(entry.name, (folder / f"{entry.name}.png").stat().st_size, flush=True)


if __name__ == "__main__":
    main()
