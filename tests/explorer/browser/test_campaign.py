"""Random changes of everything that an image depends on: pixels of the page against fresh basins of the library."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_pages import SWING, TURN, WELLS, WINDOW, after, choose, opened, pixels, put, until
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Browser, Page

from cellmap import CellGrid, find_basins, interpolated_map, stroboscopic_map
from cellmap.explorer import Explored

SYSTEMS = {"wells": Explored("wells", lambda: WELLS, WINDOW), "swing": Explored("swing", lambda: SWING, TURN)}


def state(page: Page) -> dict[str, Any]:
    """Return what the address says of the view."""
    page.wait_for_timeout(300)
    said = page.evaluate("Object.fromEntries(new URLSearchParams(location.hash.slice(1)))")
    listed = {key: tuple(map(float, said[key].split(","))) for key in ("lower", "upper", "cells")}
    params = {key[2:]: float(value) for key, value in said.items() if key.startswith("p.")}
    return {**said, **listed, "params": params}


def basins_of(said: dict[str, Any], **params: float) -> NDArray[np.int16]:
    """Return the labels of a view as the library finds them, as rows from top to bottom."""
    grid = CellGrid(said["lower"], said["upper"], tuple(map(int, said["cells"])))
    values = {**said["params"], **params}
    if said["system"] == "wells":
        point_map = WELLS.with_params(**values)
    else:
        tolerance = float(said["tolerance"])
        point_map = stroboscopic_map(
            SWING.with_params(**values), float(said["phase"]), rtol=tolerance, atol=tolerance, max_steps=4096
        )
        if nodes := int(said["nodes"]):
            point_map = interpolated_map(point_map, SYSTEMS["swing"].table_grid(nodes))
    return find_basins(point_map, grid).labels.T[::-1]


def differing(shown: NDArray[np.uint8], labels: NDArray[np.int16]) -> int:
    """Return how many pixels have another colour than most of their label; each label has a colour of its own."""
    codes = (shown.astype(int) @ [65536, 256, 1]).ravel()
    colours, different = set(), 0
    for label in np.unique(labels):
        found, counts = np.unique(codes[labels.ravel() == label], return_counts=True)
        colours.add(int(found[counts.argmax()]))
        different += int(counts.sum() - counts.max())
    assert len(colours) == len(np.unique(labels))
    return different


def changes(page: Page, draw: random.Random) -> list[Callable[[], Any]]:
    """Return what may be done in the present state."""
    some: list[Callable[[], Any]] = [lambda: page.click(draw.choice(("#in", "#out", "#reset")))]
    if page.input_value("#system") == "wells":
        some += 3 * [put(page, "keep", round(draw.uniform(0.45, 0.8), 3))]
    else:
        some += 2 * [put(page, "drive", round(draw.uniform(0.3, 0.6), 3))]
        some.append(put(page, "damping", round(draw.uniform(0.25, 0.4), 3)))
        some.append(put(page, "phase of the section", round(draw.random(), 3)))
        some.append(lambda: choose(page, "#nodes", draw.choice(("0", "64", "128"))))
        some.append(lambda: choose(page, "#tolerance", draw.choice(("0.000001", "1e-9"))))
    some.append(lambda: page.select_option("#system", draw.choice(("wells", "swing"))))
    some.append(lambda: page.click("#undo") if page.locator("#undo").is_enabled() else page.click("#reset"))
    return some


@pytest.mark.parametrize("number", [6, pytest.param(200, marks=pytest.mark.slow)])
def test_pixels_are_those_of_the_library(page: Page, browser: Browser, number: int, tmp_path: Path) -> None:
    draw, seen, different = random.Random(38), 0, 0
    for k in range(number):
        before = page.evaluate("window.asked")
        act = draw.choice(changes(page, draw))
        act()
        page.wait_for_timeout(100)
        if page.evaluate("window.asked") == before:
            continue  # nothing has changed
        until(page, "window.frames.some((f) => f.complete && f.request === window.asked)")
        until(page, "document.getElementById('preview').hidden")
        said = state(page)
        shown = pixels(page)
        labels = basins_of(said)
        different, seen = different + differing(shown, labels), seen + labels.size
        if k % 25 == 3:
            with opened(browser, page.url) as other:
                assert np.array_equal(pixels(other), shown)
                seen += labels.size
    after(page, lambda: page.evaluate("location.hash = '#schema=1&system=wells&cells=100,100'"))
    page.click("#tab-along")
    page.fill("#along-lower", "0.5")
    page.fill("#along-upper", "0.7")
    page.select_option("#stills", "20")
    with page.expect_download() as download:
        page.click("#film")
    download.value.save_as(tmp_path / "basins.gif")
    said = state(page)
    with Image.open(tmp_path / "basins.gif") as film:
        for still in range(0, 20, 1 if number > 100 else 10):
            film.seek(still)
            labels = basins_of(said, keep=float(np.linspace(0.5, 0.7, 20)[still]))
            different += differing(np.array(film.convert("RGB"))[:100], labels)
            seen += labels.size
    if number > 100:
        print(f"{different} of {seen:,} pixels differ after {number} changes")
    assert different == 0
    assert seen > 5000 * number
