"""Files of basins that several tests read."""

from __future__ import annotations

from pathlib import Path

import pytest
from interrupted_files import make_files
from stored_basins import CASES

from cellmap import Basins, save_basins


@pytest.fixture(scope="session")
def files(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    make_files(folder)
    return folder


class Made(dict[str, Basins]):
    """Basins that are found when they are asked for."""

    def __missing__(self, name: str) -> Basins:
        return self.setdefault(name, CASES[name]())


@pytest.fixture(scope="session")
def made() -> Made:
    return Made()


@pytest.fixture(scope="session")
def stored(made, tmp_path_factory) -> Path:
    """A file of one basin image, never changed."""
    return save_basins(made["grid"], tmp_path_factory.mktemp("stored") / "grid.h5")
