"""Before an audience: prepared views, lecture mode, an orbit that is dragged, watchers, a page to take home."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from browser_pages import LOG, after, along, assert_shown, at, opened, pixels, put, saved, until
from browser_systems import GALLERY, SWING, TURN, WELLS, WINDOW

from cellmap import find_basins, stroboscopic_map
from cellmap.explorer import Explorer, export_html
from cellmap.explorer.serving import serve

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.thorough


VIEWS = """
[[view]]
title = "Two wells"
sentence = "Each has a basin."
system = "wells"
params = { keep = 0.7 }

[[view]]
title = "A swing"
sentence = "It hangs, or stands."
system = "swing"
phase = 0.25
cells = [100, 100]

[[view]]
title = "Typed"
equations = "x -> a x\\ny -> y/2\\na = 0.5"
lower = [-1.0, -1.0]
upper = [1.0, 1.0]
cells = [50, 50]
"""


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Explorer]:
    path = tmp_path_factory.mktemp("views") / "lecture.toml"
    path.write_text(VIEWS)
    with serve(GALLERY, open_page=False, views=path, watchers=2, host="127.0.0.1") as running:
        yield running


def test_views_are_chosen_by_keys_and_told_in_large_type(browser: Browser, shared: Explorer) -> None:
    with opened(browser, shared.address) as page:
        assert page.inner_text("#caption") == "Two wells\n\nEach has a basin."
        assert_shown(page, find_basins(WELLS.with_params(keep=0.7), WINDOW))
        after(page, lambda: page.keyboard.press("2"))
        assert page.inner_text("#caption h2") == "A swing"
        basins = find_basins(stroboscopic_map(SWING, 0.25, rtol=1e-6, atol=1e-6), TURN)
        assert_shown(page, basins)
        before = page.evaluate("document.getElementById('frame').clientWidth")
        page.keyboard.press("l")
        until(page, "document.body.classList.contains('lecture')")
        page.wait_for_timeout(400)
        frame, height = page.evaluate("[document.getElementById('frame').clientWidth, innerHeight]")
        assert frame == min(height, 1200 - 19 * 16)
        assert frame > before
        assert page.evaluate("parseFloat(getComputedStyle(document.getElementById('legend')).fontSize)") >= 22
        assert page.locator("#legend li").count() == 2
        page.mouse.move(*at(page, 0.5, 0.5))
        assert "fixed point (0, 0)" in page.inner_text("#pointer")
        assert page.locator("#system").is_hidden()
        after(page, lambda: page.keyboard.press("ArrowRight"))  # the first parameter
        assert float(page.input_value("#value-damping")) == pytest.approx(0.306)
        page.keyboard.press("Space")
        until(page, "Number(document.getElementById('value-damping').value) > 0.32")
        after(page, lambda: page.keyboard.press("Space"))
        page.keyboard.press("l")
        until(page, "!document.body.classList.contains('lecture')")
        after(page, lambda: page.keyboard.press("3"))
        assert page.input_value("#value-a") == "0.5"
        after(page, lambda: page.keyboard.press("PageUp"))
        assert page.input_value("#value-damping") == "0.3"


def test_an_orbit_follows_the_pointer_and_moves_with_its_pendulum(page: Page) -> None:
    after(page, lambda: page.select_option("#system", "swing"))
    page.mouse.click(*at(page, 0.45, 0.6))
    until(page, "document.querySelectorAll('#ends li').length === 1")
    assert page.locator("#body").is_visible()  # its tab has been opened
    until(page, "Number.parseFloat(document.getElementById('time').textContent) > 0.1")
    first = page.evaluate("document.getElementById('body').toDataURL()")
    until(page, f"document.getElementById('body').toDataURL() !== {first!r}")
    told = page.inner_text("#ends")
    page.mouse.move(*at(page, 0.45, 0.6))
    page.mouse.down()
    for k in range(1, 11):
        page.mouse.move(*at(page, 0.45 + 0.03 * k, 0.6))
        page.wait_for_timeout(20)
    page.mouse.up()
    until(page, "document.getElementById('ends').textContent.startsWith('(1.')")
    assert page.inner_text("#ends") != told
    assert page.locator("#ends li").count() == 1
    lower = float(page.input_value("[data-field=lower-0]"))
    assert lower == pytest.approx(-np.pi, abs=1e-3)  # the window has not moved
    page.click("#run")
    assert page.inner_text("#run") == "Run"


def test_the_layout_uses_the_window_and_the_screen(browser: Browser, tmp_path: Path) -> None:
    typed = tmp_path / "typed.txt"
    typed.write_text("x -> x + v + 0.2(x - x^3)\nv -> 0.6v + 0.2(x - x^3)")
    with (
        serve([GALLERY[0]], open_page=False) as running,
        opened(browser, running.address, 1400, device_scale_factor=2) as page,
    ):
        box = page.locator("#image").bounding_box()
        assert box is not None
        assert box["width"] > 0.85 * 1000
        assert page.evaluate("document.documentElement.scrollHeight <= innerHeight")
        page.click("#type")
        after(page, lambda: page.set_input_files("#file", typed))  # which has the usual number of cells
        page.click("#type")
        page.wait_for_timeout(400)
        until(page, "document.getElementById('preview').hidden")
        size = page.evaluate("document.getElementById('image').width / document.getElementById('image').clientWidth")
        assert size == 2.0
        panels = page.locator("[role=tabpanel]:visible")
        assert panels.count() == 1
        page.focus("#tab-along")
        page.keyboard.press("ArrowRight")
        assert page.locator("#plane-panel").is_visible()
        assert panels.count() == 1


def test_systems_have_a_sentence_and_ends_of_sliders_are_typed(page: Page) -> None:
    assert page.evaluate("document.querySelector('#system option[value=swing] .about').textContent") == (
        "A pendulum on a pivot that is driven."
    )
    end = page.get_by_label("keep, largest value of the slider")
    end.fill("0.5")
    after(page, lambda: end.press("Enter"))
    assert page.input_value("#value-keep") == "0.5"
    assert page.get_by_label("keep, slider").get_attribute("max") == "0.5"
    after(page, lambda: page.get_by_label("keep, slider").press("PageDown"))
    assert page.input_value("#value-keep") == "0.45"
    after(page, lambda: page.click("#first-values"))
    page.focus("#attractors tbody tr")
    page.wait_for_timeout(100)
    lit = pixels(page)
    page.focus("#image")
    page.wait_for_timeout(100)
    assert (pixels(page) != lit).any()


def test_those_who_watch_see_the_same_images(browser: Browser, shared: Explorer) -> None:
    address = shared.watch_address
    assert address is not None
    context = browser.new_context()
    watcher = context.new_page()
    watcher.add_init_script(LOG)
    with opened(browser, shared.address) as page:
        watcher.goto(address)
        for keep in (0.65, 0.55):
            after(page, put(page, "keep", keep))
            seen = f"window.frames.some((f) => f.complete && f.view.params.keep === {keep})"
            until(watcher, seen)
            watcher.wait_for_timeout(50)
            assert np.array_equal(pixels(watcher), pixels(page))
        assert watcher.inner_text("#sentence") == "Two wells. Each has a basin."
        assert watcher.inner_text("#values") == "keep\n0.55"
        assert watcher.locator("button, input, select").count() == 0
    context.close()


def test_a_page_to_take_home_has_the_images_of_the_library(browser: Browser, page: Page, tmp_path: Path) -> None:
    file = export_html(tmp_path / "wells.html", WELLS, {"keep": [0.5, 0.6, 0.7]}, WINDOW, progress=False)
    along(page)
    saved(page, "#html", tmp_path / "film.html")
    context = browser.new_context(offline=True)
    home = context.new_page()
    said: list[Any] = []
    home.on("console", lambda message: said.append(message.text))
    home.on("pageerror", lambda error: said.append(error))
    for path, count in ((file, 3), (tmp_path / "film.html", 20)):
        home.goto(f"file://{path}")
        until(home, "document.querySelectorAll('#legend li').length === 2")
        slider = home.locator("#slider-keep")
        assert slider.get_attribute("max") == str(count - 1)
        for number, keep in ((0, 0.5), (count - 1, 0.7), ((count - 1) // 2, None)):
            slider.evaluate(f"(s) => {{ s.value = {number}; s.dispatchEvent(new Event('input')); }}")
            keep = keep or float(np.linspace(0.5, 0.7, count)[number])
            labels = find_basins(WELLS.with_params(keep=keep), WINDOW).labels.T[::-1]
            pairs = np.column_stack([pixels(home).reshape(-1, 3), labels.ravel()])
            assert len(np.unique(pairs, axis=0)) == 2
        home.mouse.move(*at(home, 0.75, 0.5))
        assert "x = 1" in home.inner_text("#here")
        assert "fixed point (1, 0)" in home.inner_text("#pointer")
    assert said == []
    assert file.stat().st_size < 100_000
    context.close()
