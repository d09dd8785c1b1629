"""One server and one browser for the tests of a file, and a page."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from browser_pages import GALLERY, PROGRAM, opened
from playwright.sync_api import Browser, Page, sync_playwright

from cellmap.explorer import Explorer
from cellmap.explorer.serving import serve


@pytest.fixture(scope="module")
def explorer() -> Iterator[Explorer]:
    with serve(GALLERY, open_page=False) as running:
        yield running


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if PROGRAM is None:
        pytest.skip("no Chromium on this machine: install one, or name it in CELLMAP_BROWSER")
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=PROGRAM, args=["--no-sandbox"])
        yield running
        running.close()


@pytest.fixture
def page(browser: Browser, explorer: Explorer) -> Iterator[Page]:
    with opened(browser, explorer.address) as there:
        yield there
