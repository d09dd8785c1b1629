"""Random use of the page in a browser, beside pages that send garbage: a silent console, no leak, true images."""

from __future__ import annotations

import gc
import random
import threading
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import psutil
import pytest
from browser_pages import PROGRAM, SCENE, WELLS, after, assert_shown, opened, put
from playwright.sync_api import Page, sync_playwright
from test_random_use import GALLERY, TYPED, used

from cellmap import find_basins
from cellmap.explorer.serving import serve

pytestmark = pytest.mark.skipif(
    PROGRAM is None, reason="no Chromium on this machine: install one, or name it in CELLMAP_BROWSER"
)

MEBIBYTE = 2**20
WINDOW = next(e.region for e in GALLERY if e.name == "wells")
BUTTONS = (
    "back forward reset in out clear type verify measure saddles stability diagram film script svg keep certify".split()
)

SLIDE = """([k, value]) => {
  const sliders = document.querySelectorAll("input[type=range]");
  if (!sliders.length) return;
  const slider = sliders[k % sliders.length];
  slider.valueAsNumber = Number(slider.min) + value * (slider.max - slider.min);
  slider.dispatchEvent(new Event("input"));
}"""
CHOOSE = """([k, n]) => {
  const selects = document.querySelectorAll("select");
  const select = selects[k % selects.length];
  if (select.id === "cells" || select.disabled || !select.options.length) return;
  select.selectedIndex = n % select.options.length;
  select.dispatchEvent(new Event("change"));
}"""
TICK = """(k) => {
  const boxes = document.querySelectorAll("input[type=checkbox]");
  boxes[k % boxes.length].click();
}"""


def press(page: Page, draw: random.Random) -> None:
    page.evaluate("(id) => document.getElementById(id).click()", draw.choice(BUTTONS))


def write(page: Page, draw: random.Random) -> None:
    text = draw.choice(TYPED)
    page.evaluate("(t) => { document.getElementById('text').value = t; }", text)
    page.evaluate("document.querySelector('#equations button').click()")


def storm(page: Page, draw: random.Random) -> None:
    k = draw.randrange(8)
    for _ in range(30):
        page.evaluate(SLIDE, [k, draw.random()])


def point(page: Page, draw: random.Random) -> None:
    for name, what in (("pointerdown", 1), ("pointermove", 1), ("pointerup", draw.random())):
        page.evaluate(
            "([name, x, y]) => { const c = document.getElementById('image'), r = c.getBoundingClientRect();"
            "c.setPointerCapture = () => {};"
            "c.dispatchEvent(new PointerEvent(name, { clientX: r.left + x * r.width,"
            "clientY: r.top + y * r.height })); }",
            [name, draw.random() * what, draw.random() * what],
        )


def wheel(page: Page, draw: random.Random) -> None:
    page.evaluate(
        "(d) => document.getElementById('image')"
        ".dispatchEvent(new WheelEvent('wheel', { deltaY: d, cancelable: true }))",
        draw.choice((-3000, -100, 100, 3000)),
    )


ACTS: tuple[Callable[[Page, random.Random], Any], ...] = (
    storm,
    press,
    press,
    write,
    point,
    wheel,
    lambda page, draw: page.evaluate(CHOOSE, [draw.randrange(20), draw.randrange(20)]),
    lambda page, draw: page.evaluate(TICK, draw.randrange(20)),
    lambda page, draw: page.evaluate(
        "(h) => { location.hash = h; }", draw.choice(("", "#schema=9", "#schema=1&system=x"))
    ),
)


def use(page: Page, seconds: float, draw: random.Random) -> Counter[str]:
    done: Counter[str] = Counter()
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        act = draw.choice(ACTS)
        act(page, draw)
        done[act.__name__] += 1
        page.wait_for_timeout(draw.choice((0, 10, 50, 300)))
    return done


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("seconds", [4.0, pytest.param(600.0, marks=pytest.mark.slow)])
def test_random_use_of_the_page(seconds: float, capsys: pytest.CaptureFixture[str]) -> None:
    """Memory is compared after three tenths of the time, when everything has been loaded and compiled once."""
    process, draw = psutil.Process(), random.Random(0)

    def memory() -> float:
        gc.collect()
        return process.memory_info().rss / MEBIBYTE

    def heap(page: Page) -> float:
        return float(page.evaluate("performance.memory.usedJSHeapSize")) / MEBIBYTE

    with serve((*GALLERY, SCENE), open_page=False) as explorer, sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=PROGRAM, args=["--no-sandbox", "--enable-precise-memory-info"]
        )
        with opened(browser, explorer.address, accept_downloads=False) as page:
            several = 2 if seconds < 60 else 9
            others = [
                threading.Thread(target=used, args=(explorer.address, several, part * seconds, seed))
                for seed, part in enumerate((0.3, 0.7))
            ]
            told, seen = [], []
            for part, other in zip((0.3, 0.7), others, strict=True):
                other.start()
                told.append(use(page, part * seconds, draw))
                other.join()
                page.wait_for_timeout(1000)
                seen.append((memory(), heap(page)))
            assert sum(sum(done.values()) for done in told) > 10
            page.evaluate("location.hash = ''")
            page.uncheck("#hatched")
            after(page, lambda: page.select_option("#system", "duffing"))
            after(page, lambda: page.select_option("#system", "wells"))
            after(page, put(page, "keep", 0.65))
            assert_shown(page, find_basins(WELLS.with_params(keep=0.65), WINDOW))
        browser.close()
    with capsys.disabled():
        if seconds > 60:
            print(f"memory and page's heap after three tenths and at the end (MiB): {seen}; {told[0] + told[1]}")
    assert seconds < 60.0 or seen[1][0] < seen[0][0] + 20.0
    assert seconds < 60.0 or seen[1][1] < seen[0][1] + 20.0
