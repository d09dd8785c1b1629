"""Inventories of other projects' sites, written from the names below: nothing is downloaded when the site is built."""

from __future__ import annotations

import zlib
from pathlib import Path

SITES = {
    "python": (
        "https://docs.python.org/3/",
        {
            "collections.abc.Callable": "py:class library/collections.abc.html#collections.abc.Callable",
            "collections.abc.Mapping": "py:class library/collections.abc.html#collections.abc.Mapping",
            "collections.abc.Sequence": "py:class library/collections.abc.html#collections.abc.Sequence",
            "math": "py:module library/math.html#module-math",
        },
    ),
    "numpy": (
        "https://numpy.org/doc/stable/",
        {"numpy.random.Generator": "py:class reference/random/generator.html#numpy.random.Generator"},
    ),
    "scipy": (
        "https://docs.scipy.org/doc/scipy/",
        {
            "scipy.integrate.solve_ivp": (
                "py:function reference/generated/scipy.integrate.solve_ivp.html#scipy.integrate.solve_ivp"
            ),
        },
    ),
}
"""Address of each site, and of its names that our pages refer to."""


def written(folder: Path) -> dict[str, tuple[str, str]]:
    """Write the inventories into a folder; return the value of ``intersphinx_mapping``."""
    folder.mkdir(exist_ok=True)
    for site, (_, names) in SITES.items():
        lines = "".join(f"{name} {kind} 1 {place} -\n" for name, (kind, place) in _entries(names))
        header = f"# Sphinx inventory version 2\n# Project: {site}\n# Version: \n# Compressed with zlib.\n"
        (folder / f"{site}.inv").write_bytes(header.encode() + zlib.compress(lines.encode()))
    return {site: (address, str(folder / f"{site}.inv")) for site, (address, _) in SITES.items()}


def _entries(names: dict[str, str]) -> list[tuple[str, tuple[str, str]]]:
    return [(name, (text.split()[0], text.split()[1])) for name, text in names.items()]
