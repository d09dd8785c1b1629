"""One server for the tests of a file, and a page of it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from served_pages import GALLERY, Page, connected

from cellmap.explorer import Explorer
from cellmap.explorer.serving import serve


@pytest.fixture(scope="module")
def explorer() -> Iterator[Explorer]:
    with serve(GALLERY, open_page=False) as running:
        yield running


@pytest.fixture
def page(explorer: Explorer) -> Iterator[Page]:
    with connected(explorer) as there:
        yield there
