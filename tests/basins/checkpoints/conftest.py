"""Runs that were not disturbed."""

from __future__ import annotations

from pathlib import Path

import pytest
from checkpointed_runs import CASES

from cellmap import Basins


@pytest.fixture(scope="session")
def plain() -> dict[str, Basins]:
    return {name: make() for name, make in CASES.items()}


@pytest.fixture(scope="session")
def finished(tmp_path_factory) -> Path:
    """The file of a run of one pass that came to its end."""
    path = tmp_path_factory.mktemp("finished") / "basins.h5"
    CASES["one pass"](checkpoint=path)
    return path
