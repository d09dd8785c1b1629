"""Runs that were not disturbed."""

import functools
from collections.abc import Iterator
from pathlib import Path

import pytest
from checkpointed_runs import CASES, TILE
from known_basins import Made

from cellmap.basins.sweeps import Progress


@pytest.fixture(scope="session")
def plain() -> Made:
    return Made(CASES)


@pytest.fixture(scope="module")
def small_tiles() -> Iterator[None]:
    """Several tiles to small basin images; no result depends on their size."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("cellmap.basins.run.CHUNK", TILE)
        patch.setattr("cellmap.basins.label_file.Progress", functools.partial(Progress, size=TILE))
        yield


@pytest.fixture(scope="module")
def finished(small_tiles, tmp_path_factory) -> Path:
    """The file of a run of one pass that came to its end."""
    path = tmp_path_factory.mktemp("finished") / "basins.h5"
    CASES["one pass"](checkpoint=path)
    return path
