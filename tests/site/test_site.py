"""The site that the last build has made, as a browser without a network shows it; `make check-site` runs this."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser_pages import launched
from playwright.sync_api import Browser, BrowserContext

SITE = Path(__file__).parents[2] / "docs" / "_build" / "html"
WITH_FORMULAS = (
    "own-system concepts bifurcations bifurcation-curves the-report dimensions accuracy-and-cost "
    "auto/tutorials/getting_started auto/api/cellmap.analysis.fractal.basin_entropy"
).split()
TEX = re.compile(r"\\[(\[a-zA-Z]+")
SEEN = "document.body.innerText"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with launched() as running:
        yield running


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    """A context that reaches files alone, and fails where a page asks for anything else."""
    there = browser.new_context(viewport={"width": 390, "height": 800}, offline=True)
    asked: list[str] = []
    there.on("request", lambda request: asked.append(request.url))
    yield there
    there.close()
    assert not [url for url in asked if not url.startswith(("file:", "data:"))]


def test_formulas_are_typeset_without_a_network(context: BrowserContext) -> None:
    page = context.new_page()
    for name in WITH_FORMULAS:
        page.goto((SITE / f"{name}.html").as_uri())
        sizes = page.eval_on_selector_all(
            "article math",
            "all => all.map(one => [one.getBoundingClientRect().width, one.getBoundingClientRect().height])",
        )
        assert sizes and all(width > 3 and 5 < height < 120 for width, height in sizes), name
        page.eval_on_selector_all("pre, code", "all => all.forEach(one => one.remove())")
        assert not TEX.findall(page.evaluate(SEEN)), name


def test_pages_are_as_wide_as_a_phone(context: BrowserContext) -> None:
    page = context.new_page()
    for name in ("index", "guide", "which-function", "own-system", "reference-bifurcations", "how-to"):
        page.goto((SITE / f"{name}.html").as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, name


@pytest.mark.parametrize(
    "words, first", {"undecided": "symptoms", "diverged": "symptoms", "find_basins": "cellmap.find_basins"}.items()
)
def test_a_search_finds_what_is_meant_first(context: BrowserContext, words: str, first: str) -> None:
    page = context.new_page()
    page.goto(f"{(SITE / 'search.html').as_uri()}?q={words}")
    page.wait_for_selector("#search-results li a")
    page.wait_for_function("document.querySelector('#search-results p').innerText.includes('found')")
    assert first in page.locator("#search-results li a").first.get_attribute("href")


def test_names_in_the_table_of_questions_lead_to_their_pages(context: BrowserContext) -> None:
    page = context.new_page()
    page.goto((SITE / "which-function.html").as_uri())
    places = page.eval_on_selector_all("article table a", "all => all.map(one => one.getAttribute('href'))")
    assert len(places) > 35
    for place in places:
        name, _, anchor = place.partition("#")
        assert (text := (SITE / name).read_text(encoding="utf-8")) and (not anchor or f'id="{anchor}"' in text), place
