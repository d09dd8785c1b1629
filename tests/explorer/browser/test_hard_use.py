"""What must not happen before an audience: frozen or stale pages, errors out of sight, lost colours and views."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from browser_pages import after, along, assert_shown, at, choose, opened, pixels, press, put, saved, until
from browser_systems import GALLERY, SWING, TURN, WELLS, WINDOW
from PIL import Image

from cellmap import find_basins, stroboscopic_map
from cellmap.explorer import Explorer
from cellmap.explorer.images import Images
from cellmap.explorer.serving import serve

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.thorough


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Images wait until the event is set."""
    released, frames = threading.Event(), Images.frames

    def waiting(self: Images, *arguments: Any) -> Iterator[Any]:
        released.wait(30.0)
        return frames(self, *arguments)

    released.set()
    monkeypatch.setattr(Images, "frames", waiting)
    yield released
    released.set()


def text(page: Page, element: str) -> str:
    return f"document.querySelector('{element}').textContent"


def test_no_window_freezes_the_page(page: Page) -> None:
    """The limits 0.3 and 0.30000000000000004 are neighbours among the floating-point numbers."""
    page.evaluate("location.hash = '#schema=1&system=wells&lower=0.3,-1&upper=0.30000000000000004,1'")
    until(page, f"{text(page, '#band')}.includes('o floating-point numbers separate cells of this width')")
    assert page.evaluate("document.getElementById('frame').classList.contains('stale')")
    after(page, lambda: page.click("#reset"))
    assert_shown(page, find_basins(WELLS, WINDOW))
    page.mouse.move(*at(page, 0.7, 0.7))
    for _ in range(90):
        page.mouse.wheel(0, -300)
    until(page, f"{text(page, '#window-note')}.includes('Closer in there are no numbers')")
    lower, upper = page.input_value("[data-field=lower-0]"), page.input_value("[data-field=upper-0]")
    assert lower != upper
    assert " + " in upper
    after(page, lambda: page.click("#reset"))


def test_numbers_have_the_digits_of_the_window(page: Page) -> None:
    def numbers(call: str) -> Any:
        return page.evaluate(f"import('./numbers.js').then((n) => n.{call})")

    assert numbers("placed(1.2345678, -2, 2)") == "1.235"
    assert numbers("placed(0.3 + 4e-13, 0.3, 0.3 + 1e-12)") == "0.3 + 4e-13"
    assert numbers("placed(-0.3, -0.3, -0.3 + 1e-12)") == "-0.3"
    for value in ("0.3 + 4e-13", "-2.5", "1e-320", "0.3 - 4e-13", ".5"):
        assert numbers(f"entered('{value}')") == eval(value)
    assert numbers("entered('0.3 + x')") is None or np.isnan(numbers("entered('0.3 + x')"))
    assert numbers("axisName({ name: 'x', unit: 'm' }, 0.3, 0.3 + 1e-12)") == "x − 0.3 (m)"
    ticks = [t["text"] for t in numbers("ticks(0.3, 0.3 + 1e-12, 5)")]
    assert ticks == "0 2e-13 4e-13 6e-13 8e-13 1e-12".split()
    for lower, upper in ((0.3, 0.3), (0.3, 0.30000000000000004), (0, 5e-324), (-1e308, 1e308), (1, 0)):
        assert len(numbers(f"ticks({lower}, {upper}, 6)")) <= 18
    assert numbers("impossible([0.3], [0.30000000000001], [500])") != ""
    assert numbers("impossible([0.3], [0.3000000000001], [125])") == ""
    assert numbers("impossible([-1e200], [1e200], [125])") != ""
    # exactly: of each pair of neighbouring labels some pixels are free between them
    apart = "import('./overlay.js').then((o) => o.apart([{place: 10, text: 'aa'}, {place: 20, text: 'aa'}, {place: 40, text: 'aa'}], () => 12, 0, 60).map((l) => l.place))"  # noqa: E501
    assert page.evaluate(apart) == [10, 40]


def test_pixels_finer_than_the_map_are_called_noise(page: Page) -> None:
    after(page, lambda: page.select_option("#system", "swing"))
    assert page.locator("#noise").is_hidden()
    after(page, put(page, "θ from", 0.3))
    after(page, lambda: put(page, "θ to", "0.3 + 1e-7")())  # type: ignore[arg-type]
    until(page, "!document.getElementById('noise').hidden")
    assert "error of the map" in page.inner_text("#noise")
    after(page, lambda: page.click("#noise button"))
    until(page, "document.getElementById('quality').textContent.startsWith('Exact map; tolerance 1e-9')")
    assert page.locator("#noise").is_hidden()


FILM_LOG = """document.addEventListener("drawn", ({ detail }) => (window.reels ??= []).push(detail.film && [
  document.getElementById("reel").textContent, document.getElementById("value-keep").valueAsNumber,
]));"""


def test_images_of_a_film_are_named_stop_and_go_on(page: Page, tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    released, eleventh, frames = threading.Event(), threading.Event(), Images.frames

    def slower(self: Images, view: Any, *arguments: Any) -> Iterator[Any]:
        if view.params["keep"] > 0.6:
            eleventh.set()
            released.wait(20.0)
        return frames(self, view, *arguments)

    monkeypatch.setattr(Images, "frames", slower)
    page.evaluate(FILM_LOG)
    along(page)
    page.click("#film")
    assert eleventh.wait(20.0)
    page.locator(".work", has_text="computing the images of the film").locator(".cancel").click()
    until(page, "document.getElementById('film').textContent === 'Resume the film (10 of 20)'")
    seen = [told for told in page.evaluate("window.reels") if told]
    for told, slider in seen:
        assert told.startswith("film: ")
        assert told.endswith(f" of 20, keep = {float(f'{slider:.6g}')}")
    assert len(seen) >= 1
    released.set()
    until(page, "document.getElementById('preview').hidden")
    assert page.input_value("#value-keep") == "0.6"
    page.evaluate("window.reels = []")
    saved(page, "#film", tmp_path / "basins.gif")
    assert min(slider for _, slider in filter(None, page.evaluate("window.reels"))) >= 0.6
    with Image.open(tmp_path / "basins.gif") as still:
        assert still.n_frames == 20
    until(page, "document.getElementById('preview').hidden")
    assert page.input_value("#value-keep") == "0.6"
    assert page.locator("#reel").is_hidden()


def test_what_fails_is_told_beside_it_and_what_cannot_be_done_is_disabled(page: Page) -> None:
    page.click("#tab-accuracy")
    assert page.locator("#certify").is_disabled()
    assert "the map is exact" in page.inner_text("#right")
    title = page.get_attribute("#certify", "title")
    assert title == "the map is exact, and has no interpolation errors; choose a map of cells"
    page.click("#tab-along")
    along(page, 7, 6)
    page.click("#diagram")
    until(page, "[...document.querySelectorAll('.why.failure')].some((e) => /the range is empty/.test(e.textContent))")
    told = page.locator(".why.failure", has_text="the range is empty or inverted").bounding_box()
    button = page.locator("#diagram").bounding_box()
    assert told is not None
    assert button is not None
    assert 0 < told["y"] - button["y"] < 60
    assert page.inner_text("#failure") == ""
    after(page, lambda: page.select_option("#system", "swing"))
    after(page, lambda: choose(page, "#nodes", "64"))
    assert page.locator("#certify").is_enabled()


def test_an_old_image_is_dimmed_and_a_new_one_can_be_cancelled(page: Page, held: threading.Event) -> None:
    held.clear()
    put(page, "keep", 0.7)()
    until(page, "document.getElementById('frame').classList.contains('stale')")
    assert page.evaluate("document.getElementById('attractors').classList.contains('stale')")
    until(page, "document.querySelector('#band .clock').textContent === ', 1 s'")
    assert "computing the image" in page.inner_text("#band")
    press(page, "#measure")
    until(page, "document.body.textContent.includes('waiting for the complete image')")
    page.click("#band .cancel")
    until(page, f"{text(page, '#band')}.startsWith('Compute again') || {text(page, '#band')}.includes('Cancelled')")
    until(page, "document.body.textContent.includes('There is no image of these values')")
    held.set()
    after(page, lambda: page.click("#band .cancel"))
    assert not page.evaluate("document.getElementById('frame').classList.contains('stale')")
    assert_shown(page, find_basins(WELLS.with_params(keep=0.7), WINDOW))


def test_a_question_can_be_cancelled(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    released = threading.Event()
    monkeypatch.setattr("cellmap.explorer.questions.measures", lambda frame: released.wait(20.0) or {"measures": []})
    press(page, "#measure")
    cancel = page.locator(".work:has-text('measuring') .cancel")
    cancel.click()
    until(page, "[...document.querySelectorAll('.why')].some((e) => e.textContent === 'Cancelled')")
    press(page, "#verify")  # others are answered meanwhile
    until(page, "document.getElementById('verdict').textContent.includes('random labels differ')")
    released.set()


def test_a_link_keeps_colours(page: Page, browser: Browser, explorer: Explorer) -> None:
    page.click("#link")
    until(page, "document.body.textContent.includes('opens this view, with its colours')")
    before = pixels(page)
    numbers = page.evaluate("[...new URLSearchParams(location.hash.slice(1))].filter(([k]) => k.startsWith('a.'))")
    assert sorted(key for key, _ in numbers) == ["a.0", "a.1"]
    with opened(browser, page.url) as same:
        assert np.array_equal(pixels(same), before)
    (_, one), (_, other) = numbers
    with opened(browser, f"{explorer.address}#schema=1&system=wells&a.1={one}&a.7={other}") as exchanged:
        assert sorted(a["identity"] for a in exchanged.evaluate("window.frames.at(-1).attractors")) == [1, 7]
        assert (pixels(exchanged) != before).any(axis=-1).all()
        assert_shown(exchanged, find_basins(WELLS, WINDOW))


def test_colours_stay_when_the_map_changes(page: Page) -> None:
    after(page, lambda: page.select_option("#system", "swing"))
    before = pixels(page)
    after(page, lambda: choose(page, "#tolerance", "1e-9"))
    basins = find_basins(stroboscopic_map(SWING, rtol=1e-9, atol=1e-9), TURN)
    assert_shown(page, basins)
    assert (pixels(page) != before).any(axis=-1).mean() < 0.01


def test_a_view_outlives_its_server(browser: Browser) -> None:
    context = browser.new_context()
    page = context.new_page()
    there = "document.querySelectorAll('#attractors td').length > 0 && document.getElementById('preview').hidden"
    with serve(GALLERY, open_page=False) as running:
        page.goto(running.address)
        until(page, there)
        put(page, "keep", 0.7)()
        until(page, "document.getElementById('preview').hidden && location.hash.includes('p.keep=0.7')")
        port = int(running.address.split(":")[2].split("/")[0])
    until(page, "!document.getElementById('away').hidden")
    until(page, "document.getElementById('state').textContent.includes('cannot be reached')")
    assert "keeps its view" in page.inner_text("#away")
    with serve(GALLERY, port, open_page=False) as again:
        page.fill("#next", again.address)
        page.click("#go")
        until(page, there)
        assert page.input_value("#value-keep") == "0.7"
        assert page.url.startswith(again.address)
    context.close()


def test_one_wrong_number_spoils_nothing(page: Page) -> None:
    slider = page.get_by_label("keep, slider")

    def ends() -> list[float]:
        return [float(slider.get_attribute(end) or "nan") for end in ("min", "max")]

    assert ends() == [0, 1.2]
    put(page, "keep", 1e300)()
    assert ends()[1] > 1e300
    after(page, put(page, "keep", 0.7))
    assert ends() == [0, 1.2]
    put(page, "keep", -0.3)()
    assert ends() == [-0.3, 1.2]
    after(page, lambda: page.click("#first-values"))
    assert ends() == [0, 1.2]
    assert page.input_value("#value-keep") == "0.6"
    assert_shown(page, find_basins(WELLS, WINDOW))


def test_news_go_with_their_image_and_headers_have_names(page: Page) -> None:
    assert page.inner_text("#news") == ""  # all are new at first
    after(page, put(page, "keep", 0.61))
    assert page.inner_text("#news") == ""
    assert all(page.eval_on_selector_all("th", "(heads) => heads.map((h) => h.textContent.trim())"))


def test_a_slider_plays_and_stops(page: Page) -> None:
    slider = page.get_by_label("keep, slider")
    slider.focus()
    page.keyboard.press("Space")
    until(page, "Number(document.getElementById('value-keep').value) > 0.61")
    assert page.get_attribute(".play", "aria-pressed") == "true"
    after(page, lambda: page.keyboard.press("Space"))
    assert page.get_attribute(".play", "aria-pressed") == "false"
    keep = float(page.input_value("#value-keep"))
    assert_shown(page, find_basins(WELLS.with_params(keep=keep), WINDOW))
    after(page, lambda: page.keyboard.press("Control+z"))
    assert page.input_value("#value-keep") == "0.6"
    page.click(".play")
    until(page, "Number(document.getElementById('value-keep').value) > 0.61")
    after(page, lambda: page.select_option("#system", "swing"))
    page.get_by_label("Play phase of the section").click()
    until(page, "Number(document.getElementById('value-phase of the section').value) > 0.02")
    after(page, lambda: page.get_by_label("Play phase of the section").click())


def test_a_row_lights_its_basin_and_an_image_has_the_pixels_of_the_screen(page: Page) -> None:
    before = pixels(page).reshape(-1, 3)
    page.hover("#attractors tbody tr:nth-child(1)")
    page.wait_for_timeout(200)
    lit = pixels(page).reshape(-1, 3)
    same = (lit == before).all(axis=1)
    colours = [np.unique(before[rows], axis=0) for rows in (same, ~same)]
    assert [len(c) for c in colours] == [1, 1]
    assert np.abs(np.unique(lit[~same], axis=0) - (255 - 0.25 * (255.0 - colours[1]))).max() <= 1
    page.mouse.move(*at(page, 0.75, 0.5))
    page.wait_for_timeout(200)
    assert np.array_equal(pixels(page).reshape(-1, 3), before)
    assert "fixed point (1, 0)" in page.inner_text("#attractors tr.lit")
    option = page.locator("#cells option", has_text="(screen)").get_attribute("value")
    after(page, lambda: choose(page, "#cells", option))
    assert page.evaluate(
        "(c => c.width === Math.round(c.clientWidth * devicePixelRatio))(document.getElementById('image'))"
    )


def test_everything_is_undone_and_done_again(page: Page) -> None:
    def shown() -> dict[str, str]:
        fields = "[...document.querySelectorAll('#parameters input, [data-field], header select, #cells, #tolerance')]"
        return dict(page.evaluate(f"{fields}.map((e) => [e.id || e.dataset.field || e.ariaLabel, e.value])"))

    assert page.locator("#undo").is_disabled()
    states = [shown()]
    slider = page.get_by_label("keep, slider")

    def drag() -> None:
        for _ in range(5):
            slider.press("ArrowRight")

    for act in (
        drag,
        lambda: page.click("#in"),
        lambda: page.select_option("#system", "swing"),
        put(page, "phase of the section", 0.25),
        lambda: page.click("#first-values"),
        lambda: choose(page, "#tolerance", "1e-9"),
    ):
        after(page, act)
        states.append(shown())
        page.wait_for_timeout(600)
    assert all(one != other for one, other in itertools.pairwise(states))
    for state in states[-2::-1]:
        after(page, lambda: page.keyboard.press("Control+z"))
        assert shown() == state
    assert page.locator("#undo").is_disabled()
    assert_shown(page, find_basins(WELLS, WINDOW))
    for k, state in enumerate(states[1:]):
        after(page, lambda k=k: page.click("#redo") if k % 2 else page.keyboard.press("Control+y"))
        assert shown() == state
    assert page.locator("#redo").is_disabled()
    assert_shown(page, find_basins(stroboscopic_map(SWING, rtol=1e-9, atol=1e-9), TURN))
