"""What a page does beside its image: equations, orbits, analyses, films, files; twelve tasks in as few clicks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np
import pytest
from browser_pages import after, along, assert_shown, at, canvas, choose, drawn, pixels, press, put, saved, until, write
from browser_systems import WELLS, WINDOW
from PIL import Image

from cellmap import find_basins

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.thorough


def test_equations_are_read_from_a_file_and_a_mistake_is_selected_in_the_text(page: Page, tmp_path: Any) -> None:
    (tmp_path / "wells.txt").write_text("x -> x + v + 0.2*(x - x**3)\nv -> keep*v + 0.2*(x - x**3)\nkeep = 0.6\n")
    page.click("#type")
    after(page, lambda: page.set_input_files("#file", tmp_path / "wells.txt"))
    assert page.input_value("#text").startswith("x -> x + v")
    assert page.input_value("#value-keep") == "0.6"
    (tmp_path / "wells.txt").write_text("a -> a/2\nb -> open(by)/by\nby = 4")
    page.set_input_files("#file", tmp_path / "wells.txt")
    until(page, "document.getElementById('mistake').textContent.startsWith('line 2, column 6: unknown function')")
    selected = "(t) => t.value.slice(t.selectionStart, t.selectionEnd)"
    assert page.eval_on_selector("#text", selected) == "open(by)/by"
    page.set_input_files("#file", {"name": "long.txt", "mimeType": "text/plain", "buffer": b"x" * 20000})
    until(page, "document.getElementById('mistake').textContent.includes('long.txt has 20000 bytes')")
    page.fill("#text", "θ̈ = -sin^2(θ)\nperiod = 1")
    page.click("#equations button")
    until(page, "document.getElementById('mistake').textContent.includes('write  sin(theta)^2')")
    place = page.evaluate("[document.getElementById('text').selectionStart, document.activeElement.id]")
    assert place == [len("θ̈ = -"), "text"]


def test_pointing_and_clicking(page: Page) -> None:
    page.mouse.move(*at(page, 0.75, 0.5))
    assert page.inner_text("#here").startswith("x = 1")
    assert "fixed point (1, 0)" in page.inner_text("#here")
    for x in (0.75, 0.25):
        page.mouse.click(*at(page, x, 0.55))
        page.wait_for_timeout(200)
    until(page, "document.querySelectorAll('#ends li').length === 2")
    assert "fixed point (1, 0), in its trapping region after" in page.inner_text("#ends li:nth-child(1)")
    assert "fixed point (-1, 0)" in page.inner_text("#ends li:nth-child(2)")


def test_an_attractor_that_goes_is_announced(page: Page) -> None:
    write(page, "x -> x + 0.2*(x - x**3 + h) + 0*y\ny -> 0.5*y\nh = 0.1")
    assert page.inner_text("#attractors").count("fixed point") == 2
    colours = set(map(tuple, np.unique(pixels(page).reshape(-1, 3), axis=0).tolist()))
    after(page, put(page, "h", 0.5))
    assert page.inner_text("#news").startswith("Gone: fixed point (-0.9")
    left = set(map(tuple, np.unique(pixels(page).reshape(-1, 3), axis=0).tolist()))
    assert len(left) == 1
    assert left < colours


def test_saddles_and_their_manifolds_are_drawn_until_the_image_changes(page: Page) -> None:
    def marks() -> int:
        page.wait_for_timeout(100)
        return int((np.abs(canvas(page, "overlay") - [0.8, 0, 0, 1]) < 0.01).all(axis=-1).sum())

    def white() -> int:
        image = canvas(page, "overlay")
        right = image[:, int(0.52 * image.shape[1]) :]  # of the saddle's cross
        return int((right > 0.98).all(axis=-1).sum())

    before, without = marks(), white()
    page.click("#saddles")
    until(page, "document.querySelectorAll('#found li').length === 1")
    assert "saddle, period 1, at (0, 0), |multipliers| 1.36, 0.442" in page.inner_text("#found")
    assert marks() > before == 0
    page.wait_for_timeout(200)
    assert white() > without + 50
    assert page.locator("#found").is_visible()
    after(page, put(page, "keep", 0.62))
    assert page.inner_text("#found") == ""
    assert marks() == before


def test_measures_and_certificates_are_shown(page: Page) -> None:
    press(page, "#measure")
    until(page, "document.querySelectorAll('#measures li').length === 4")
    assert "basin entropy: 0." in page.inner_text("#measures li:nth-child(1)")
    after(page, lambda: page.select_option("#system", "swing"))
    assert page.inner_text("#measures") == ""
    after(page, lambda: choose(page, "#nodes", "64"))
    page.wait_for_timeout(300)
    press(page, "#certify")
    until(page, "document.getElementById('verdict').textContent.startsWith('Certified')", 60.0)


def test_a_click_in_the_stability_map_moves_both_parameters(page: Page) -> None:
    write(page, "x -> x + 0.2*(a*x - x**3 + h) + 0*y\ny -> 0.5*y\na = 1.0\nh = 0.0")
    press(page, "#stability")
    until(page, "!document.getElementById('plane').hidden")
    page.select_option("#stable", index=1)
    box = page.locator("#plane").bounding_box()
    assert box is not None
    place = {"x": 55.2 + 0.75 * (box["width"] - 61.2), "y": 18 + 0.25 * (box["height"] - 56.4)}
    after(page, lambda: page.click("#plane", position=place))
    a, h = (float(page.input_value(f"#value-{name}")) for name in "ah")
    assert (a, h) == (pytest.approx(1.25, abs=0.01), pytest.approx(0.25, abs=0.01))
    after(page, lambda: page.press("#plane", "ArrowLeft"))
    assert float(page.input_value("#value-a")) == pytest.approx(a - 0.01, abs=1e-4)
    assert "now a = 1.2" in str(page.get_attribute("#plane", "aria-label"))


def test_a_bifurcation_diagram_moves_the_parameter_and_a_film_is_made(page: Page, tmp_path: Any) -> None:
    page.click("#diagram")
    until(page, "!document.getElementById('bifurcations').hidden")
    box = page.locator("#bifurcations").bounding_box()
    assert box is not None
    after(page, lambda: page.click("#bifurcations", position={"x": 55.2 + 0.75 * (box["width"] - 61.2), "y": 20}))
    keep = float(page.input_value("#value-keep"))
    assert keep == pytest.approx(0.3 + 0.75 * 0.6, abs=0.01)
    assert_shown(page, find_basins(WELLS.with_params(keep=keep), WINDOW))
    along(page, stills="40")
    with Image.open(saved(page, "#film", tmp_path / "basins.gif")) as still:
        assert still.n_frames == 40
        still.seek(39)
        shown = np.array(still.convert("RGB"))
    until(page, "document.getElementById('preview').hidden")
    assert np.array_equal(shown[:100], drawn(page, find_basins(WELLS.with_params(keep=0.7), WINDOW)))
    page.select_option("#format", "mp4")
    page.select_option("#stills", "20")
    with page.expect_download() as download:
        page.click("#film")
    assert download.value.suggested_filename == "basins.mp4"


def test_views_are_kept_and_saved_as_vectors(page: Page, tmp_path: Any) -> None:
    press(page, "#keep")
    after(page, put(page, "keep", 0.8))
    after(page, lambda: page.click("#kept button"))
    assert page.input_value("#value-keep") == "0.6"
    assert_shown(page, find_basins(WELLS, WINDOW))
    root = ElementTree.parse(saved(page, "#svg", tmp_path / "basins.svg")).getroot()
    assert len(root.findall("{*}circle")) == 2
    assert len(root.findall("{*}image")) == 1


def test_the_script_is_downloaded_and_runs(page: Page, tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    after(page, put(page, "keep", 0.7))
    names: dict[str, Any] = {"__name__": "script"}
    text = saved(page, "#script", tmp_path / "basins.py").read_text()
    exec(text.replace("from browser_systems import WELLS as system", ""), {**names, "system": WELLS})
    assert "bit by bit" in capsys.readouterr().out
    for button, begins in (("#png", b"\x89PNG"), ("#hdf5", b"\x89HDF"), ("#netcdf", b"\x89HDF")):
        assert saved(page, button, tmp_path / "basins").read_bytes().startswith(begins)


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
