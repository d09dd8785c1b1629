"""Files of basins that several tests read."""

from pathlib import Path

import pytest
from interrupted_files import make_files
from known_basins import Made
from stored_basins import CASES

from cellmap import save_basins


@pytest.fixture(scope="session")
def files(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    make_files(folder)
    return folder


@pytest.fixture(scope="session")
def made() -> Made:
    return Made(CASES)


@pytest.fixture(scope="session")
def stored(made, tmp_path_factory) -> Path:
    """A file of one basin image, never changed."""
    return save_basins(made["grid"], tmp_path_factory.mktemp("stored") / "grid.h5")
