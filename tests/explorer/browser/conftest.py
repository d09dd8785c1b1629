"""One server and one browser for the tests of a file, and a page."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest
from browser_pages import launched, opened
from browser_systems import GALLERY

from cellmap.explorer import Explorer
from cellmap.explorer.serving import serve

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page


@pytest.fixture(scope="module")
def explorer() -> Iterator[Explorer]:
    with serve(GALLERY, open_page=False) as running:
        yield running


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with launched() as running:
        yield running


@pytest.fixture
def page(browser: Browser, explorer: Explorer) -> Iterator[Page]:
    with opened(browser, explorer.address) as there:
        yield there
