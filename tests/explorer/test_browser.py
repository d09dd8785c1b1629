"""The explorer in a browser of this machine: what its canvas shows is, pixel by pixel, what the library finds."""

from __future__ import annotations

import base64
import contextlib
import io
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from math import pi, sin
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.image import imread
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from cellmap import CellGrid, ForcedSystem, angle, discrete_map, find_basins, stroboscopic_map
from cellmap.attractors.labels import Label
from cellmap.basins import BasinFrame
from cellmap.explorer import Explored, ExploredScene, Explorer
from cellmap.explorer.protocol import LOWEST
from cellmap.explorer.serving import serve
from cellmap.plot._colours import COLOURS

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
PROGRAM = os.environ.get("CELLMAP_BROWSER") or next(filter(None, map(shutil.which, NAMES)), None)

pytestmark = pytest.mark.skipif(
    PROGRAM is None, reason="no Chromium on this machine: install one, or name it in CELLMAP_BROWSER"
)


def step(x, p):
    speed = p.keep * x[1] + 0.2 * (x[0] - x[0] ** 3)
    return x[0] + speed, speed


def swing(t, x, p):
    """A pendulum whose pivot is driven; 0 and pi are stable."""
    theta, v = x
    return v, -p.damping * v - (p.weight + p.drive * sin(t)) * sin(theta)


WELLS = discrete_map(step, {"keep": 0.6}, ("x", "v"))
SWING = ForcedSystem(swing, {"damping": 0.3, "weight": 0.01, "drive": 0.5}, 2 * pi, (angle("theta"), "v"), "swing")
WINDOW = CellGrid((-2.0, -1.5), (2.0, 1.5), (100, 100))
TURN = CellGrid((-pi, -2.0), (pi, 2.0), (100, 100))


def push(x, p):
    speed = p.keep * x[1] + 0.2 * (x[0] - x[0] ** 3) + 0.2 * p.push
    return x[0] + speed, speed


PUSHED = discrete_map(push, {"keep": 0.6, "push": 0.1}, ("x", "v"))
SCENE = ExploredScene(
    "parts",
    "From parts",
    ("ball",),
    ("push",),
    ("ball",),
    lambda _, e: Explored("", lambda: PUSHED if e else WELLS, WINDOW),
)
GALLERY = (
    Explored("wells", lambda: WELLS, WINDOW, source="from test_browser import WELLS as system\n"),
    Explored("swing", lambda: SWING, TURN),
    SCENE,
)

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


@pytest.fixture(scope="module")
def explorer() -> Iterator[Explorer]:
    with serve(GALLERY, open_page=False) as running:
        yield running


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=PROGRAM, args=["--no-sandbox"])
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


@pytest.fixture
def page(browser: Browser, explorer: Explorer) -> Iterator[Page]:
    with opened(browser, explorer.address) as there:
        yield there


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


def pixels(page: Page) -> NDArray[np.uint8]:
    """Read the canvas as the file that the page would save."""
    file = page.evaluate("document.getElementById('image').toDataURL('image/png')")
    image = imread(io.BytesIO(base64.b64decode(file.split(",")[1])))
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


def put(page: Page, label: str, value: float) -> Callable[[], None]:
    """Return what types a number into a field."""

    def act() -> None:
        field = page.get_by_label(label, exact=True)
        field.fill(str(value))
        field.press("Enter")

    return act


def limits(page: Page) -> list[float]:
    return [float(page.input_value(f"[data-field='{end}-{k}']")) for k in (0, 1) for end in ("lower", "upper")]


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
    box = page.locator("#image").bounding_box()
    assert box is not None
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def wheel() -> None:
        page.mouse.move(*middle)
        page.mouse.wheel(0, -300)

    def drag(shift: bool = False) -> None:
        page.mouse.move(*middle)
        if shift:
            page.keyboard.down("Shift")
        page.mouse.down()
        page.mouse.move(middle[0] + box["width"] / 4, middle[1] + box["height"] / 8, steps=5)
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


def test_equations_are_read_from_a_file(page: Page, tmp_path: Any) -> None:
    (tmp_path / "wells.txt").write_text("x -> x + v + 0.2*(x - x**3)\nv -> keep*v + 0.2*(x - x**3)\nkeep = 0.6\n")
    page.click("#type")
    after(page, lambda: page.set_input_files("#file", tmp_path / "wells.txt"))
    assert page.input_value("#text").startswith("x -> x + v")
    assert page.input_value("#value-keep") == "0.6"
    program = "def function(x, p):\n  return x[0]/2, x[1]/p.by\nparams = {'by': 4}\ncoordinates = ('a', 'b')\n"
    (tmp_path / "halves.py").write_text(program)
    after(page, lambda: page.set_input_files("#file", tmp_path / "halves.py"))
    assert page.input_value("#value-by") == "4"
    (tmp_path / "halves.py").write_text(program.replace("x[1]", "open('f')"))
    page.set_input_files("#file", tmp_path / "halves.py")
    until(page, "document.getElementById('mistake').textContent.startsWith('line 2, column 18: unknown function')")
    selected = "(t) => t.value.slice(t.selectionStart, t.selectionEnd)"
    assert page.eval_on_selector("#text", selected) == "open('f')/p.by"
    page.set_input_files("#file", {"name": "long.txt", "mimeType": "text/plain", "buffer": b"x" * 20000})
    until(page, "document.getElementById('mistake').textContent.includes('long.txt has 20000 bytes')")


def test_pointing_and_clicking(page: Page) -> None:
    box = page.locator("#image").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] * 0.75, box["y"] + box["height"] * 0.5)
    assert page.inner_text("#here").startswith("x = 1")
    assert "fixed point (1, 0)" in page.inner_text("#here")
    for x in (0.75, 0.25):
        page.mouse.click(box["x"] + box["width"] * x, box["y"] + box["height"] * 0.45)
        page.wait_for_timeout(200)
    until(page, "document.querySelectorAll('#ends li').length === 2")
    assert "fixed point (1, 0), in its trapping region after" in page.inner_text("#ends li:nth-child(1)")
    assert "fixed point (-1, 0)" in page.inner_text("#ends li:nth-child(2)")


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


def test_an_attractor_that_goes_is_announced(page: Page) -> None:
    text = "x -> x + 0.2*(x - x**3 + h) + 0*y\ny -> 0.5*y\nh = 0.1"
    page.click("#type")
    page.fill("#text", text)
    after(page, lambda: page.click("#equations button"))
    assert page.inner_text("#news").count("fixed point") == 2
    colours = set(map(tuple, np.unique(pixels(page).reshape(-1, 3), axis=0).tolist()))
    after(page, put(page, "h", 0.5))
    assert page.inner_text("#news").startswith("Gone: fixed point (-0.9")
    left = set(map(tuple, np.unique(pixels(page).reshape(-1, 3), axis=0).tolist()))
    assert len(left) == 1
    assert left < colours


def test_a_mistake_is_selected_in_the_text(page: Page) -> None:
    page.click("#type")
    page.fill("#text", "q' = v\nv' = -q^3\nperiod = 1")
    page.click("#equations button")
    until(page, "document.getElementById('mistake').textContent.includes('write **')")
    place = page.evaluate("[document.getElementById('text').selectionStart, document.activeElement.id]")
    assert place == [len("q' = v\nv' = -q"), "text"]


def test_the_script_is_downloaded_and_runs(page: Page, tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    after(page, put(page, "keep", 0.7))
    names: dict[str, Any] = {"__name__": "script"}
    for button, name in (
        ("#script", "basins.py"),
        ("#png", "basins.png"),
        ("#hdf5", "basins.h5"),
        ("#netcdf", "basins.nc"),
    ):
        with page.expect_download() as download:
            page.click(button)
        download.value.save_as(tmp_path / name)
    text = (tmp_path / "basins.py").read_text().replace("from test_browser import WELLS as system", "")
    exec(text, {**names, "system": WELLS})
    assert "bit by bit" in capsys.readouterr().out
    assert (tmp_path / "basins.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "basins.nc").read_bytes().startswith(b"\x89HDF")


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


def test_a_page_says_that_its_server_is_away(browser: Browser) -> None:
    with serve(GALLERY, open_page=False) as running:
        context = browser.new_context()
        page = context.new_page()
        page.add_init_script(LOG)
        page.goto(running.address)
        until(page, "window.frames.some((f) => f.complete)")
    until(page, "document.getElementById('state').textContent.includes('cannot be reached')")
    context.close()


def test_a_bifurcation_diagram_moves_the_parameter_and_a_film_is_made(page: Page, tmp_path: Any) -> None:
    page.click("#diagram")
    until(page, "!document.getElementById('bifurcations').hidden")
    box = page.locator("#bifurcations").bounding_box()
    assert box is not None
    after(page, lambda: page.click("#bifurcations", position={"x": 0.75 * box["width"], "y": 20}))
    keep = float(page.input_value("#value-keep"))
    assert keep == pytest.approx(0.3 + 0.75 * 0.6, abs=0.01)
    assert_shown(page, find_basins(WELLS.with_params(keep=keep), WINDOW))
    page.fill("#along-lower", "0.5")
    page.fill("#along-upper", "0.7")
    with page.expect_download() as download:
        page.click("#film")
    download.value.save_as(tmp_path / "basins.gif")
    with Image.open(tmp_path / "basins.gif") as still:
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
    page.click("#keep")
    after(page, put(page, "keep", 0.8))
    after(page, lambda: page.click("#kept button"))
    assert page.input_value("#value-keep") == "0.6"
    assert_shown(page, find_basins(WELLS, WINDOW))
    with page.expect_download() as download:
        page.click("#svg")
    download.value.save_as(tmp_path / "basins.svg")
    root = ElementTree.parse(tmp_path / "basins.svg").getroot()
    assert len(root.findall("{*}circle")) == 2
    assert len(root.findall("{*}image")) == 1


def test_a_click_in_the_stability_map_moves_both_parameters(page: Page) -> None:
    page.click("#type")
    page.fill("#text", "x -> x + 0.2*(a*x - x**3 + h) + 0*y\ny -> 0.5*y\na = 1.0\nh = 0.0")
    after(page, lambda: page.click("#equations button"))
    page.click("#stability")
    until(page, "!document.getElementById('plane').hidden")
    page.select_option("#stable", index=1)
    box = page.locator("#plane").bounding_box()
    assert box is not None
    wide, high = box["width"] - 52, box["height"] - 34
    after(page, lambda: page.click("#plane", position={"x": 52 + 0.75 * wide, "y": 0.25 * high}))
    a, h = (float(page.input_value(f"#value-{name}")) for name in "ah")
    assert (a, h) == (pytest.approx(1.25, abs=0.01), pytest.approx(0.25, abs=0.01))
    after(page, lambda: page.press("#plane", "ArrowLeft"))
    assert float(page.input_value("#value-a")) == pytest.approx(a - 0.01, abs=1e-4)
    assert "now a = 1.2" in str(page.get_attribute("#plane", "aria-label"))


def test_a_drag_ends_with_its_system(page: Page) -> None:
    """What is begun in a window of two coordinates has no meaning for a strip of one."""
    box = page.locator("#image").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 150, box["y"] + 100)
    page.evaluate("document.getElementById('text').value = 'x -> a*x*(1 - x)\\na = 2.5'")
    after(page, lambda: page.evaluate("document.querySelector('#equations button').click()"))
    page.mouse.move(box["x"] + 200, box["y"] + 120)
    page.mouse.up()
    assert page.locator("[data-field]").count() == 2
    assert page.input_value("[data-field=lower-0]") == "-2"


def test_saddles_are_drawn_until_the_image_changes(page: Page) -> None:
    def marks() -> int:
        page.wait_for_timeout(100)
        file = page.evaluate("document.getElementById('overlay').toDataURL('image/png')")
        image = imread(io.BytesIO(base64.b64decode(file.split(",")[1])))
        return int((np.abs(image - [0.8, 0, 0, 1]) < 0.01).all(axis=-1).sum())

    before = marks()
    page.click("#saddles")
    until(page, "document.querySelectorAll('#found li').length === 1")
    assert "saddle, period 1, at (0, 0), |multipliers| 1.36, 0.442" in page.inner_text("#found")
    assert marks() > before == 0
    after(page, put(page, "keep", 0.62))
    assert page.inner_text("#found") == ""
    assert marks() == before


def test_measures_and_certificates_are_shown(page: Page) -> None:
    page.click("#measure")
    until(page, "document.querySelectorAll('#measures li').length === 4")
    assert "basin entropy: 0." in page.inner_text("#measures li:nth-child(1)")
    after(page, lambda: page.select_option("#system", "swing"))
    assert page.inner_text("#measures") == ""
    after(page, lambda: page.select_option("#nodes", "64"))
    page.wait_for_timeout(300)
    page.click("#certify")
    until(page, "document.getElementById('quality').textContent.startsWith('Certified')", 60.0)


@pytest.mark.parametrize(
    "state",
    ["axes=0,0", "axes=5,6&lower=NaN,1&cells=x,3&phase=NaN&tolerance=x&nodes=&p.keep=NaN&p.none=3&others=1"],
)
def test_what_an_address_says_amiss_is_left_out(browser: Browser, explorer: Explorer, state: str) -> None:
    with opened(browser, f"{explorer.address}#schema=1&system=wells&{state}") as page:
        assert_shown(page, find_basins(WELLS, WINDOW))
