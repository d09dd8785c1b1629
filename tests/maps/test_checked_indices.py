"""Loops over impacts, friction and coupled branches stay inside of their arrays, as seen where indices are checked."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

FILES = [str(Path(__file__).with_name(f"test_{name}.py")) for name in ("impacts", "branches", "switching_exact")]


@pytest.mark.thorough
def test_indices_of_switches_and_impacts() -> None:
    """A check that fails ends the process; where all hold, results agree with their witnesses as they do without."""
    chosen = "rest_on_a_floor_while or rest_on_a_wall or table_never_throws or machine or quantised or three_blocks"
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", chosen, *FILES]
    environment = {**os.environ, "CELLMAP_BOUNDS_CHECK": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stdout[-2000:]
