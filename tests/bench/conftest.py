"""Benchmarks print what matters as ratios, measured in one run on one machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

LINES: list[str] = []


@pytest.fixture
def say() -> Callable[[str], None]:
    """Add a line to the summary at the end."""
    return LINES.append


@pytest.fixture
def one_thread() -> Iterator[None]:
    """Run cellmap on one thread."""
    import cellmap

    cellmap.set_threads(1)
    yield
    cellmap.set_threads(None)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print the ratios."""
    terminalreporter.section("ratios")
    for line in LINES:
        terminalreporter.write_line(line)
