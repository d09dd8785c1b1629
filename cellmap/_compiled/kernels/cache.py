"""Where compiled code is kept: in folders that nobody but their user can write to, for what is found there is run."""

from __future__ import annotations

import os
import stat
import warnings
from pathlib import Path
from typing import Any

import numba
from numba import njit
from platformdirs import user_cache_path


def cache_folder() -> Path | None:
    """Return ``$CELLMAP_CACHE_DIR``, or a folder in the user's cache, made if need be.

    None where the variable is empty, where the folder cannot be made, or where it is not the user's alone: compiled
    code is not kept then.
    """
    chosen = os.environ.get("CELLMAP_CACHE_DIR")
    if chosen == "":
        return None
    try:
        folder = user_cache_path("cellmap") if chosen is None else Path(chosen)
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        private = _is_private(folder)
    except (OSError, RuntimeError):  # RuntimeError: a user without a home
        return None
    if not private:
        warnings.warn(
            f"CELLMAP_CACHE_DIR={str(folder)!r}: it belongs to somebody else, or others can write to it, so that code "
            "from there is not run and everything is compiled anew; empty it and take `chmod 700`, or give another one",
            stacklevel=2,
        )
        return None
    return folder


def kernels_are_kept() -> bool:
    """Tell whether there is a place for compiled kernels; where numba finds none by itself, give it that of cellmap."""
    if _numba_has_a_place():
        return True
    settings: Any = numba.config
    folder = None if settings.CACHE_DIR else cache_folder()
    if folder is None:
        return False
    settings.CACHE_DIR = str(folder / "numba")
    return _numba_has_a_place()


def _is_private(folder: Path) -> bool:
    found = folder.stat()
    return found.st_uid == os.geteuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _numba_has_a_place() -> bool:
    try:
        place = Path(str(njit(cache=True)(_probe).stats.cache_path))
    except RuntimeError:  # no folder that can be written to
        return False
    # Whoever can write beside the source can change that too.
    return Path(__file__).parent in place.parents or _is_private(place)


def _probe() -> None:
    """Stand for the kernels, which are in the same folder."""
