"""Programs in processes of their own."""

import os
import subprocess
import sys
from pathlib import Path


def printed(program: str, cache: Path | str | None, *path: str) -> str:
    """Return what a program prints: with its machine code in a folder, and modules of its own on a path."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([*path, *sys.path])}
    environment |= {} if cache is None else {"CELLMAP_CACHE_DIR": str(cache)}
    command = [sys.executable, "-B", "-c", program]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout[-200:] + done.stderr[-2000:]
    return done.stdout
