"""Random use of the page in a browser, beside pages that send garbage: true pixels, a silent console, no leak."""

from __future__ import annotations

import gc
import random
import threading
import time
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import psutil
import pytest
from browser_pages import WHOLE, after, along, choose, launched, opened, pixels, put, saved, until
from browser_systems import GALLERY, SWING, WELLS
from numpy.typing import NDArray
from PIL import Image
from test_random_use import TYPED, used

from cellmap import CellGrid, find_basins, interpolated_map, stroboscopic_map
from cellmap.explorer.serving import serve

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

MEBIBYTE = 2**20
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
POINT = """([name, x, y]) => {
  const c = document.getElementById("image"), r = c.getBoundingClientRect();
  c.setPointerCapture = () => {};
  c.dispatchEvent(new PointerEvent(name, { clientX: r.left + x * r.width, clientY: r.top + y * r.height }));
}"""
WHEEL = (
    "(d) => document.getElementById('image').dispatchEvent(new WheelEvent('wheel', { deltaY: d, cancelable: true }))"
)


def press(page: Page, draw: random.Random) -> None:
    page.evaluate("(id) => document.getElementById(id).click()", draw.choice(BUTTONS))


def write(page: Page, draw: random.Random) -> None:
    page.evaluate("(t) => { document.getElementById('text').value = t; }", draw.choice(TYPED))
    page.evaluate("document.querySelector('#equations button').click()")


def storm(page: Page, draw: random.Random) -> None:
    k = draw.randrange(8)
    for _ in range(30):
        page.evaluate(SLIDE, [k, draw.random()])


def point(page: Page, draw: random.Random) -> None:
    for name, what in (("pointerdown", 1), ("pointermove", 1), ("pointerup", draw.random())):
        page.evaluate(POINT, [name, draw.random() * what, draw.random() * what])


ACTS: tuple[Callable[[Page, random.Random], Any], ...] = (
    *(storm, press, press, write, point),
    lambda page, draw: page.evaluate(WHEEL, draw.choice((-3000, -100, 100, 3000))),
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


def basins_of(page: Page, **params: float) -> NDArray[np.int16]:
    """Return the labels of the view in the address as the library finds them, as rows from top to bottom."""
    page.wait_for_timeout(300)
    said = page.evaluate("Object.fromEntries(new URLSearchParams(location.hash.slice(1)))")
    lower, upper, cells = (tuple(map(float, said[key].split(","))) for key in ("lower", "upper", "cells"))
    values = {key[2:]: float(value) for key, value in said.items() if key.startswith("p.")} | params
    if said["system"] == "wells":
        point_map = WELLS.with_params(**values)
    else:
        tolerance = float(said["tolerance"])
        point_map = stroboscopic_map(
            SWING.with_params(**values), float(said["phase"]), rtol=tolerance, atol=tolerance, max_steps=4096
        )
        if nodes := int(said["nodes"]):
            point_map = interpolated_map(point_map, GALLERY[1].table_grid(nodes))
    return find_basins(point_map, CellGrid(lower, upper, tuple(map(int, cells)))).labels.T[::-1]


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


def compared(page: Page, browser: Browser, number: int, draw: random.Random) -> tuple[int, int]:
    """Change the view so many times; return how many pixels of how many differ from fresh basins of the library."""
    different, seen = 0, 0
    for k in range(number):
        before = page.evaluate("window.asked")
        draw.choice(changes(page, draw))()
        page.wait_for_timeout(100)
        if page.evaluate("window.asked") == before:
            continue  # nothing has changed
        until(page, WHOLE)
        labels, shown = basins_of(page), pixels(page)
        different, seen = different + differing(shown, labels), seen + labels.size
        if k % 25 == 3:
            with opened(browser, page.url) as other:
                assert np.array_equal(pixels(other), shown)
                seen += labels.size
    return different, seen


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize(
    ("seconds", "number"),
    [pytest.param(4.0, 6, marks=pytest.mark.thorough), pytest.param(600.0, 200, marks=pytest.mark.slow)],
)
def test_random_use_of_the_page(seconds, number, tmp_path, capsys):
    """Memory is compared after three tenths of the time, when everything has been loaded and compiled once.

    The page that has seen all this shows true pixels thereafter, at one change after another; so does a film.
    """
    process, draw = psutil.Process(), random.Random(38)

    def memory() -> float:
        gc.collect()
        return process.memory_info().rss / MEBIBYTE

    def heap(page: Page) -> float:
        return float(page.evaluate("performance.memory.usedJSHeapSize")) / MEBIBYTE

    with launched() as browser, serve(GALLERY, open_page=False) as explorer:
        with opened(browser, explorer.address, accept_downloads=False) as page:
            several, told, seen = 2 if seconds < 60 else 9, [], []
            for seed, part in enumerate((0.3, 0.7)):
                others = threading.Thread(target=used, args=(explorer.address, several, part * seconds, seed))
                others.start()
                told.append(use(page, part * seconds, draw))
                others.join()
                page.wait_for_timeout(1000)
                seen.append((memory(), heap(page)))
            assert sum(sum(done.values()) for done in told) > 10
            page.evaluate("location.hash = ''")
            page.uncheck("#hatched")
            after(page, lambda: page.select_option("#system", "swing"))
            after(page, lambda: page.select_option("#system", "wells"))
            different, pairs = compared(page, browser, number, draw)
        with opened(browser, f"{explorer.address}#schema=1&system=wells&cells=100,100") as page:
            along(page)
            with Image.open(saved(page, "#film", tmp_path / "basins.gif")) as film:
                for still in range(0, 20, 1 if seconds > 60 else 10):
                    film.seek(still)
                    labels = basins_of(page, keep=float(np.linspace(0.5, 0.7, 20)[still]))
                    different += differing(np.array(film.convert("RGB"))[:100], labels)
                    pairs += labels.size
    if seconds > 60:
        with capsys.disabled():
            print(f"{different} of {pairs:,} pixels differ after {number} changes")
            print(f"memory and page's heap after three tenths and at the end (MiB): {seen}; {told[0] + told[1]}")
    assert different == 0
    assert pairs > 5000 * number
    assert seconds < 60.0 or seen[1][0] < seen[0][0] + 20.0
    assert seconds < 60.0 or seen[1][1] < seen[0][1] + 20.0
