"""One server for the tests of a file, and a page of it."""

from collections.abc import Iterator

import pytest
from served_pages import GALLERY, Page, connected

from cellmap.explorer import Explorer
from cellmap.explorer.serving import serve


@pytest.fixture(scope="module")
def explorer() -> Iterator[Explorer]:
    with serve(GALLERY, open_page=False) as running:
        yield running


@pytest.fixture(scope="module")
def shared() -> Iterator[Explorer]:
    """One that others may watch."""
    with serve(GALLERY, open_page=False, watchers=2, host="127.0.0.1") as running:
        yield running


@pytest.fixture
def page(explorer: Explorer) -> Iterator[Page]:
    with connected(explorer) as there:
        yield there
