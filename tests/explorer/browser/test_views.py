"""What the canvas shows is, pixel by pixel, what the library finds: parameters, windows, phases, systems, addresses."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from browser_pages import after, assert_shown, at, drawn, limits, opened, pixels, put, until
from browser_systems import PUSHED, SWING, TURN, WELLS, WINDOW

from cellmap import CellGrid, Label, find_basins, stroboscopic_map
from cellmap.basins import BasinFrame
from cellmap.explorer import Explorer
from cellmap.explorer.protocol import LOWEST

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.thorough


def test_the_image_follows_a_slider(page: Page) -> None:
    assert_shown(page, find_basins(WELLS, WINDOW))
    slider = page.get_by_label("keep, slider")
    after(page, lambda: slider.press("ArrowRight"))
    keep = float(page.input_value("#value-keep"))
    assert keep == pytest.approx(0.612)
    assert_shown(page, find_basins(WELLS.with_params(keep=keep), WINDOW))
    after(page, put(page, "keep", 0.75))
    assert_shown(page, find_basins(WELLS.with_params(keep=0.75), WINDOW))


@pytest.mark.parametrize("shape", [(23, 30), (16, 17)])
def test_a_preview_is_spread_as_the_library_fills_its_frames(page: Page, shape: tuple[int, int]) -> None:
    basins = find_basins(WELLS, CellGrid((-2.0, -1.5), (2.0, 1.5), shape))
    known = basins.labels[::8, ::8]
    begun = np.full_like(basins.labels, Label.UNLABELLED)
    begun[::8, ::8] = known
    first = BasinFrame(replace(basins, labels=begun), 8, False, (8, 4, 2, 1))
    coarse, full = (labels.T[::-1] - LOWEST for labels in (known, first.image))
    facts = {"width": shape[0], "height": shape[1], "columns": known.shape[0], "rows": known.shape[1], "stride": 8}
    found = page.evaluate(
        "([codes, frame]) => import('./picture.js').then((m) => Array.from(m.spread(new Uint8Array(codes), frame)))",
        [coarse.ravel().tolist(), facts],
    )
    assert np.array_equal(np.reshape(found, full.shape), full)


def test_the_window_is_changed_by_wheel_drag_box_fields_and_history(page: Page) -> None:
    middle = at(page, 0.5, 0.5)

    def wheel() -> None:
        page.mouse.move(*middle)
        page.mouse.wheel(0, -300)

    def drag(shift: bool = False) -> None:
        page.mouse.move(*middle)
        if shift:
            page.keyboard.down("Shift")
        page.mouse.down()
        page.mouse.move(*at(page, 0.75, 0.375), steps=5)
        page.mouse.up()
        page.keyboard.up("Shift")

    def shown() -> None:
        view = dict(part.split("=") for part in page.evaluate("location.hash.slice(1)").replace("%2C", ",").split("&"))
        lower, upper = (tuple(map(float, view[end].split(","))) for end in ("lower", "upper"))
        assert_shown(page, find_basins(WELLS, CellGrid(lower, upper, (100, 100))))

    after(page, wheel)
    factor = 1.0015**-300
    assert limits(page) == pytest.approx([-2 * factor, 2 * factor, -1.5 * factor, 1.5 * factor], rel=0.01)
    page.wait_for_timeout(300)
    shown()
    before = limits(page)
    after(page, drag)
    assert limits(page)[:2] == pytest.approx([v - factor for v in before[:2]], rel=0.02)
    after(page, lambda: page.click("#back"))
    assert limits(page) == pytest.approx(before)
    after(page, lambda: page.click("#forward"))
    after(page, lambda: page.click("#reset"))
    assert limits(page) == pytest.approx([-2, 2, -1.5, 1.5])
    after(page, lambda: drag(shift=True))
    assert limits(page) == pytest.approx([0, 1, -0.375, 0], abs=0.03)
    after(page, put(page, "x to", 1.5))
    page.wait_for_timeout(300)
    shown()


def test_the_phase_another_system_and_the_address(page: Page, browser: Browser) -> None:
    after(page, lambda: page.select_option("#system", "swing"))
    exact = stroboscopic_map(SWING, rtol=1e-6, atol=1e-6)
    assert_shown(page, find_basins(exact, TURN))
    after(page, put(page, "phase of the section", 0.3))
    after(page, put(page, "drive", 0.55))
    basins = find_basins(stroboscopic_map(SWING.with_params(drive=0.55), 0.3, rtol=1e-6, atol=1e-6), TURN)
    assert_shown(page, basins)
    page.wait_for_timeout(300)
    with opened(browser, page.url) as again:
        assert again.input_value("#value-drive") == "0.55"
        assert_shown(again, basins)
    after(page, lambda: page.evaluate("location.hash = '#schema=1&system=wells&phase=0.5&lower=1&cells=9'"))
    assert_shown(page, find_basins(WELLS, WINDOW))
    page.evaluate("location.hash = '#schema=99&system=wells'")
    until(page, "document.getElementById('failure').textContent.includes('version 99')")


def test_an_effect_is_switched_on(page: Page, browser: Browser) -> None:
    after(page, lambda: page.select_option("#system", "parts"))
    after(page, put(page, "keep", 0.65))
    after(page, lambda: page.click("#in"))
    after(page, lambda: page.check("#parts input"))
    assert page.input_value("#value-keep") == "0.65"
    basins = find_basins(PUSHED.with_params(keep=0.65), CellGrid((-1.0, -0.75), (1.0, 0.75), (100, 100)))
    assert_shown(page, basins)
    page.wait_for_timeout(300)
    with opened(browser, page.url) as again:
        assert_shown(again, basins)
    after(page, lambda: page.uncheck("#parts input"))
    assert page.query_selector("#value-push") is None


def test_everything_can_be_done_with_keys(page: Page) -> None:
    page.focus("#image")
    for _ in range(10):
        page.keyboard.press("ArrowRight")
    assert "x = 0.8" in page.inner_text("#here")
    page.keyboard.press("Enter")
    until(page, "document.querySelectorAll('#ends li').length === 1")
    after(page, lambda: page.keyboard.press("+"))
    assert limits(page)[:2] == pytest.approx([-0.6, 1.4])
    after(page, lambda: page.keyboard.press("b"))
    assert limits(page)[:2] == pytest.approx([-2, 2])


def test_the_equations_are_typeset_with_a_sentence_and_units(page: Page) -> None:
    assert page.locator("#mathematics").is_visible()
    assert page.locator("#mathematics div p").count() == 2
    assert page.inner_text("#mathematics div p:first-child").replace("\n", "")[1] == "↦"
    after(page, lambda: page.select_option("#system", "swing"))
    assert page.evaluate("document.querySelector('#mathematics math').getBoundingClientRect().height > 5")
    assert page.inner_text("#mathematics > p") == "A pendulum on a pivot that is driven."
    assert "damping (1/s)" in page.inner_text("#parameters")
    assert "phase of the section (periods)" in page.inner_text("#parameters").replace("\n", " ")


def test_a_drag_ends_with_its_system(page: Page) -> None:
    """What is begun in a window of two coordinates has no meaning for a strip of one."""
    x, y = at(page, 0.0, 1.0)
    page.mouse.move(x + 100, y + 100)
    page.mouse.down()
    page.mouse.move(x + 150, y + 100)
    page.evaluate("document.getElementById('text').value = 'x -> a*x*(1 - x)\\na = 2.5'")
    after(page, lambda: page.evaluate("document.querySelector('#equations button').click()"))
    page.mouse.move(x + 200, y + 120)
    page.mouse.up()
    assert page.locator("[data-field]").count() == 2
    assert page.input_value("[data-field=lower-0]") == "-2"


def test_it_fits_on_a_phone_and_in_the_dark(browser: Browser, explorer: Explorer) -> None:
    with opened(browser, explorer.address, 375, color_scheme="dark") as page:
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(22, 24, 26)"
        basins = find_basins(WELLS, WINDOW)
        assert_shown(page, basins)
        page.check("#hatched")
        page.wait_for_timeout(100)
        different = (pixels(page) != drawn(page, basins)).any(axis=-1)
        assert 0.1 < different.mean() < 0.5


@pytest.mark.parametrize(
    "state", ["axes=0,0", "axes=5,6&lower=NaN,1&cells=x,3&phase=NaN&tolerance=x&nodes=&p.keep=NaN&p.none=3&others=1"]
)
def test_what_an_address_says_amiss_is_left_out(browser: Browser, explorer: Explorer, state: str) -> None:
    with opened(browser, f"{explorer.address}#schema=1&system=wells&{state}") as page:
        assert_shown(page, find_basins(WELLS, WINDOW))
