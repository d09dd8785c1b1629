"""What a page does beside its image: equations typed, orbits pointed at, analyses, films, files."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from browser_pages import after, along, assert_shown, at, canvas, choose, drawn, pixels, press, put, saved, until, write
from browser_systems import WELLS, WINDOW
from PIL import Image
from playwright.sync_api import Page

from cellmap import find_basins

pytestmark = pytest.mark.thorough


def test_equations_are_read_from_a_file(page: Page, tmp_path: Any) -> None:
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


def test_a_mistake_is_selected_in_the_text(page: Page) -> None:
    page.click("#type")
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


def test_saddles_are_drawn_until_the_image_changes(page: Page) -> None:
    def marks() -> int:
        page.wait_for_timeout(100)
        return int((np.abs(canvas(page, "overlay") - [0.8, 0, 0, 1]) < 0.01).all(axis=-1).sum())

    before = marks()
    page.click("#saddles")
    until(page, "document.querySelectorAll('#found li').length === 1")
    assert "saddle, period 1, at (0, 0), |multipliers| 1.36, 0.442" in page.inner_text("#found")
    assert marks() > before == 0
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
