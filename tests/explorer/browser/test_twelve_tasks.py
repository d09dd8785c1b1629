"""Twelve tasks of a student, each with at most as many clicks as it took before there were tabs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from browser_pages import after, at, until
from playwright.sync_api import Page

pytestmark = pytest.mark.thorough


COUNT = """
window.clicks = 0;
for (const kind of ["pointerdown", "change"]) document.addEventListener(kind, (event) => {
  if (kind === "pointerdown" || event.target.matches("select")) window.clicks += 1;
}, true);
"""


@pytest.fixture
def counted(page: Page) -> Iterator[Callable[[Callable[[], object]], int]]:
    """Count clicks, and choices in lists as one more than none."""
    page.evaluate(COUNT)

    def clicks(act: Callable[[], object]) -> int:
        before = page.evaluate("window.clicks")
        act()
        return int(page.evaluate("window.clicks")) - before

    yield clicks


def test_twelve_tasks(page: Page, counted: Callable[[Callable[[], object]], int], tmp_path: Path) -> None:
    """Opening took no click: the page is complete."""
    middle = at(page, 0.7, 0.5)
    took = {"open": 0}

    took["change the system"] = 1 + counted(lambda: after(page, lambda: page.select_option("#system", "swing")))
    page.keyboard.press("Control+z")
    until(page, "document.getElementById('system').value === 'wells' && document.getElementById('preview').hidden")

    def drag() -> None:
        slider = page.get_by_label("keep, slider").bounding_box()
        assert slider is not None
        page.mouse.move(slider["x"] + slider["width"] / 2, slider["y"] + slider["height"] / 2)
        page.mouse.down()
        page.mouse.move(slider["x"] + slider["width"] * 0.55, slider["y"] + slider["height"] / 2, steps=3)
        page.mouse.up()

    took["drag a parameter"] = counted(lambda: after(page, drag))
    page.mouse.move(*middle)
    took["which attractor"] = counted(
        lambda: until(page, "document.getElementById('here').textContent.includes('fixed')")
    )
    took["orbit"] = counted(lambda: (page.mouse.click(*middle), until(page, "document.querySelector('#ends li')")))
    assert page.locator("#series").is_visible()
    took["saddles"] = counted(lambda: (page.click("#saddles"), until(page, "document.querySelector('#found li')")))
    took["zoom"] = counted(lambda: after(page, lambda: (page.mouse.move(*middle), page.mouse.wheel(0, -200))))

    def download(button: str) -> None:
        with page.expect_download():
            page.click(button)

    page.click("#tab-along")  # which is open at first
    page.select_option("#stills", "20")
    took["film"] = counted(lambda: download("#film"))
    until(page, "document.getElementById('preview').hidden")
    took["link"] = counted(
        lambda: (page.click("#link"), until(page, "document.body.textContent.includes('opens this view')"))
    )

    took["Python program"] = counted(lambda: download("#script"))
    was = page.input_value("#value-keep")
    took["undo"] = counted(lambda: after(page, lambda: page.keyboard.press("Control+z")))
    after(page, lambda: page.keyboard.press("Control+z"))
    assert page.input_value("#value-keep") != was

    def equation() -> None:
        page.click("#type")
        page.fill("#text", "x'' = x - x^3 - δ x' + γ cos(t)\nδ = 0.15\nγ = 0.2\nperiod = 2π")
        page.click("#equations [type=submit]")
        until(page, "document.getElementById('value-delta') !== null")

    took["own equation"] = counted(equation)

    def phase() -> None:
        page.get_by_label("Play phase of the section").click()
        until(page, "Number(document.getElementById('value-phase of the section').value) > 0.01")

    took["phase"] = counted(phase)
    none = ("open", "zoom", "which attractor", "undo")
    allowed = {**dict.fromkeys(took, 1), **dict.fromkeys(none, 0), "change the system": 2, "own equation": 3}
    assert len(took) == 13
    assert {task: n for task, n in took.items() if n > allowed[task]} == {}
