"""Pages of the explorer in a browser of this machine, what is done with them, and what their canvas has to show."""

from __future__ import annotations

import base64
import contextlib
import io
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.image import imread
from numpy.typing import NDArray

from cellmap.plot._colours import COLOURS

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
PROGRAM = os.environ.get("CELLMAP_BROWSER") or next(filter(None, map(shutil.which, NAMES)), None)


LOG = """
window.frames = []; window.mistakes = [];
document.addEventListener("drawn", (event) => {
  const { data, ...facts } = event.detail;
  window.frames.push(facts);
});
const send = WebSocket.prototype.send;
WebSocket.prototype.send = function (text) {
  const { type, request } = JSON.parse(text);
  if (type === "view") window.asked = request;
  send.call(this, text);
};
"""
WHOLE = (
    "window.frames.some((f) => f.complete && f.request === window.asked) && document.getElementById('preview').hidden"
)


@contextlib.contextmanager
def launched() -> Iterator[Browser]:
    """Start a browser for tests, which are skipped where there is none."""
    from playwright.sync_api import sync_playwright

    if PROGRAM is None:
        pytest.skip("no Chromium on this machine: install one, or name it in CELLMAP_BROWSER")
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(
            executable_path=PROGRAM, args=["--no-sandbox", "--enable-precise-memory-info"]
        )
        yield running
        running.close()


@contextlib.contextmanager
def opened(browser: Browser, address: str, width: int = 1200, **options: Any) -> Iterator[Page]:
    """Open the page, and hold its console to silence."""
    context = browser.new_context(viewport={"width": width, "height": 1000}, **options)
    page = context.new_page()
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    page.add_init_script(LOG)
    page.goto(address)
    until(page, WHOLE)
    yield page
    assert said == []
    context.close()


def until(page: Page, condition: str, seconds: float = 20.0) -> None:
    """Wait for a condition; the page forbids what Playwright's own function for it needs."""
    for _ in range(int(seconds / 0.02)):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(20)
    raise AssertionError(f"{condition} is false after {seconds} s: {page.inner_text('body')}")


def after(page: Page, act: Callable[[], object]) -> None:
    """Do something, and wait until the image that it leads to is complete."""
    page.evaluate("window.frames = []")
    act()
    until(page, WHOLE)


def canvas(page: Page, name: str) -> NDArray[np.float64]:
    """Read a canvas as the file that the page would save."""
    file = page.evaluate(f"document.getElementById('{name}').toDataURL('image/png')")
    return np.asarray(imread(io.BytesIO(base64.b64decode(file.split(",")[1]))))


def pixels(page: Page) -> NDArray[np.uint8]:
    image = canvas(page, "image")
    assert (image[..., 3] == 1).all()
    return np.rint(255 * image[..., :3]).astype(np.uint8)


def drawn(page: Page, basins: Any) -> NDArray[np.uint8]:
    """Basins as the page has to draw them: each attractor in the colour of its identity."""
    frame = page.evaluate("window.frames.at(-1)")
    colours = []
    for attractor in basins.attractors:
        (identity,) = (
            a["identity"]
            for a in frame["attractors"]
            if np.shape(a["points"]) == attractor.points.shape and np.abs(a["points"] - attractor.points).max() < 1e-6
        )
        colours.append([int(COLOURS[identity][k : k + 2], 16) for k in (1, 3, 5)])
    assert (basins.labels >= 0).all()
    return np.array(colours, np.uint8)[basins.labels.T[::-1]]


def assert_shown(page: Page, basins: Any) -> None:
    assert np.array_equal(pixels(page), drawn(page, basins))


REVEAL = """(element) => {
  const panel = element.closest("[role=tabpanel]");
  if (panel?.hidden) document.getElementById(panel.getAttribute("aria-labelledby")).click();
}"""


def press(page: Page, button: str) -> None:
    """Press a button, in its tab."""
    page.eval_on_selector(button, REVEAL)
    page.click(button)


def choose(page: Page, select: str, value: str) -> None:
    """Choose in a list, in its tab."""
    page.eval_on_selector(select, REVEAL)
    page.select_option(select, value)


def put(page: Page, label: str, value: float) -> Callable[[], None]:
    """Return what types a number into a field, in its tab."""

    def act() -> None:
        field = page.get_by_label(label, exact=True)
        field.evaluate(REVEAL)
        field.fill(str(value))
        field.press("Enter")

    return act


def limits(page: Page) -> list[float]:
    return [float(page.input_value(f"[data-field='{end}-{k}']")) for k in (0, 1) for end in ("lower", "upper")]


def at(page: Page, x: float, y: float) -> tuple[float, float]:
    """Return a place in the window, by parts of the image from the left and from below."""
    box = page.locator("#image").bounding_box()
    assert box is not None
    return box["x"] + x * box["width"], box["y"] + (1 - y) * box["height"]


def write(page: Page, text: str) -> None:
    """Type equations, and wait for their image."""
    page.click("#type")
    page.fill("#text", text)
    after(page, lambda: page.click("#equations button"))


def along(page: Page, lower: float = 0.5, upper: float = 0.7, stills: str = "20") -> None:
    """Choose the values along which films and diagrams go."""
    page.fill("#along-lower", str(lower))
    page.fill("#along-upper", str(upper))
    page.select_option("#stills", stills)


def saved(page: Page, button: str, path: Path) -> Path:
    """Press a button, and keep the file that it has the browser download."""
    with page.expect_download() as download:
        press(page, button)
    download.value.save_as(path)
    return path
