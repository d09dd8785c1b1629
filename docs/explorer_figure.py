"""Figure and film of the explorer on the pages: ``python docs/explorer_figure.py``, with Chromium on this machine.

The film is what the browser has shown, in real time.
"""

from __future__ import annotations

import base64
import io
import os
import shutil
import time
from collections.abc import Callable
from fractions import Fraction
from math import sin
from pathlib import Path
from typing import Any

import av
import numpy as np
from PIL import Image
from playwright.sync_api import Page, sync_playwright

from cellmap.explorer.explored import load_gallery
from cellmap.explorer.serving import serve

STATIC = Path(__file__).parent / "_static"
PROGRAM = os.environ.get("CELLMAP_BROWSER") or shutil.which("chromium") or shutil.which("google-chrome")
COMPLETE = "document.getElementById('preview').hidden && document.querySelectorAll('#attractors td').length > 0"
SIZE = {"width": 1200, "height": 900}
TICKS = 1000  # of the film's clock in a second

SLIDE = """([label, share]) => {
  const slider = document.querySelector(`input[aria-label="${label}, slider"]`);
  slider.valueAsNumber = Number(slider.min) + share * (slider.max - slider.min);
  slider.dispatchEvent(new Event("input"));
}"""


def main() -> None:
    """Make the figure, then the film."""
    with serve(load_gallery("systems.gallery"), open_page=False) as explorer, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=PROGRAM, args=["--no-sandbox"])
        for make in (figure, film):
            page = browser.new_page(viewport=SIZE)
            page.goto(explorer.address)
            wait_for(page, COMPLETE)
            make(page)
            page.close()
        browser.close()


def wait_for(page: Page, condition: str) -> None:
    """Wait for a condition; the page forbids what Playwright's own function for it needs."""
    while not page.evaluate(condition):
        page.wait_for_timeout(20)


def figure(page: Page) -> None:
    """Click a point, search for the saddles, draw a bifurcation diagram, and keep the screen."""
    page.select_option("#along", "amplitude")
    page.click("#saddles")
    page.wait_for_selector("#found li")
    page.click("#diagram")
    page.wait_for_selector("#bifurcations:visible")
    page.evaluate("scrollTo(0, 0)")
    page.click("#image", position={"x": 200, "y": 120})
    page.wait_for_selector("#ends li")
    page.evaluate("scrollTo(0, 0)")
    screen = Image.open(io.BytesIO(page.screenshot()))
    screen.convert("P", palette=Image.Palette.ADAPTIVE, colors=64).save(STATIC / "explorer.png", optimize=True)


def film(page: Page) -> None:
    """Record half a minute: a parameter, the window, an orbit, saddles, both panes, and the parts of a scene."""
    shots: list[tuple[float, bytes]] = []
    session = page.context.new_cdp_session(page)

    def shot(event: dict[str, Any]) -> None:
        shots.append((event["metadata"]["timestamp"], base64.b64decode(event["data"])))
        session.send("Page.screencastFrameAck", {"sessionId": event["sessionId"]})

    session.on("Page.screencastFrame", shot)
    session.send("Page.startScreencast", {"format": "jpeg", "quality": 92})
    drag(page, "amplitude", 8.0)
    page.mouse.move(330, 300)
    during(page, 3.0, lambda _: page.mouse.wheel(0, -25))
    page.wait_for_timeout(800)
    page.mouse.click(250, 420)
    page.wait_for_timeout(1500)
    page.click("#reset")
    wait_for(page, COMPLETE)
    page.click("#saddles")
    page.wait_for_timeout(2500)
    page.select_option("#along", "amplitude")
    page.select_option("#across", "damping")
    page.evaluate("document.getElementById('along').scrollIntoView()")
    page.click("#diagram")
    page.wait_for_selector("#bifurcations:visible")
    page.wait_for_timeout(800)
    for x in (330, 250, 170, 90):
        page.click("#bifurcations", position={"x": x, "y": 60})
        page.wait_for_timeout(700)
    page.evaluate("document.getElementById('across').scrollIntoView()")
    page.click("#stability")
    page.wait_for_selector("#plane:visible")
    for x, y in ((200, 60), (300, 160), (120, 200)):
        page.click("#plane", position={"x": x, "y": y})
        page.wait_for_timeout(700)
    page.select_option("#system", "scene")
    page.evaluate("scrollTo(0, 0)")
    wait_for(page, COMPLETE)
    for effect in ("horizontal drive", "constant torque"):
        page.check(f"#parts input[value='{effect}']")
        page.wait_for_timeout(200)
        wait_for(page, f"document.querySelector('[for*={effect.split()[0]}]') !== null")  # a parameter of its own
        wait_for(page, COMPLETE)
        page.wait_for_timeout(1200)
    session.send("Page.stopScreencast")
    encode(shots, STATIC / "explorer.mp4")


def during(page: Page, seconds: float, act: Callable[[float], object]) -> None:
    """Do something again and again, with the time since the beginning."""
    begin = time.monotonic()
    while (passed := time.monotonic() - begin) < seconds:
        act(passed)
        page.wait_for_timeout(15)


def drag(page: Page, parameter: str, seconds: float) -> None:
    """Move a slider to and fro."""
    during(page, seconds, lambda t: page.evaluate(SLIDE, [parameter, 0.5 + 0.3 * sin(0.8 * t)]))


def encode(shots: list[tuple[float, bytes]], path: Path) -> None:
    """Write screens with their times as a video."""
    begin = shots[0][0]
    with av.open(str(path), "w", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", rate=30, options={"crf": "27", "preset": "medium"})
        stream.width, stream.height, stream.pix_fmt = SIZE["width"], SIZE["height"], "yuv420p"
        stream.time_base = stream.codec_context.time_base = Fraction(1, TICKS)
        before = -1
        for when, data in shots:
            screen = Image.open(io.BytesIO(data)).convert("RGB").resize(tuple(SIZE.values()))
            frame = av.VideoFrame.from_ndarray(np.asarray(screen), format="rgb24")
            frame.pts = before = max(before + 1, round(TICKS * (when - begin)))
            frame.time_base = Fraction(1, TICKS)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    print(f"{path}: {len(shots)} screens, {shots[-1][0] - begin:.1f} s, {path.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
