"""Views that a lecturer has prepared: systems, values, windows and a sentence each, from a file in TOML."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .._lib.checks import shown, text
from .equations import typed_system
from .explored import Explored, ExploredScene, explored_of
from .view import View

MOST_VIEWS = 100

_OWN = ("title", "sentence", "system", "parts", "equations")


def load_views(path: str | os.PathLike[str], gallery: Mapping[str, Explored | ExploredScene]) -> list[dict[str, Any]]:
    """Return the views of a file, as the page takes them.

    The file has a table ``[[view]]`` for each: a `title`, a `sentence`, the name of a `system` (perhaps with `parts`)
    or `equations` as text, and what differs from the first image of the system: `params`, `phase`, `axes`, `lower`,
    `upper`, `others`, `cells`, `nodes`, `tolerance`.

    Raises
    ------
    ValueError
        For a view that cannot be shown, with its number.
    OSError, UnicodeDecodeError
        For a file that cannot be read.
    """
    try:
        found = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path}: no TOML ({error})") from None
    listed = found.get("view")
    if not isinstance(listed, list) or not 0 < len(listed) <= MOST_VIEWS:
        raise ValueError(f"{path}: write a table [[view]] for each view, at most {MOST_VIEWS}")
    views = []
    for number, given in enumerate(listed, 1):
        try:
            views.append(_view(given, gallery))
        except (TypeError, ValueError) as error:
            raise ValueError(f"{path}, view {number}: {error}") from error
    return views


def _view(given: Mapping[str, Any], gallery: Mapping[str, Explored | ExploredScene]) -> dict[str, Any]:
    """Return a view after it has been checked."""
    texts = {key: text(key, given.get(key, "")) for key in ("title", "sentence", "equations")}
    name = given.get("system")
    if (name is None) == (not texts["equations"]):
        raise ValueError("give either the name of a system or equations")
    if name is not None and name not in gallery:
        raise ValueError(f"system={shown(name)}: choose one of {', '.join(gallery)}")
    explored = typed_system(texts["equations"]) if name is None else explored_of(gallery[name], given.get("parts"))
    view = {key: value for key, value in given.items() if key not in _OWN}
    View.of(view, explored).initial_conditions()
    return {
        "title": texts["title"],
        "sentence": texts["sentence"],
        "name": name,
        "text": texts["equations"] or None,
        "parts": explored.parts or None,
        "view": view,
    }
