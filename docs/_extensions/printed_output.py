"""What executed pages print, compared with the files of ``docs/_printed``: a difference is a warning.

``python docs/_extensions/printed_output.py`` writes these files from the pages that the last build has executed.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from textwrap import dedent
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx


DOCS = Path(__file__).parents[1]
EXPECTED = DOCS / "_printed"
OUTPUT = re.compile(r"^ \.\. code-block:: none\n\n((?:    .*\n|\n)*)", re.MULTILINE)
NUMBER = re.compile(r"-?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?")
BETWEEN = "\n--------\n"


def printed(page: Path) -> str:
    """Return what the blocks of an executed page print, one after the other."""
    return BETWEEN.join(dedent(block).strip() for block in OUTPUT.findall(page.read_text(encoding="utf-8"))) + "\n"


def same(expected: str, found: str) -> bool:
    """Whether two texts have the same words, and numbers that differ by no more than one in the last digit printed."""
    if NUMBER.sub("#", expected) != NUMBER.sub("#", found):
        return False
    pairs = zip(NUMBER.findall(expected), NUMBER.findall(found), strict=True)
    return all(abs(_value(a) - _value(b)) < 1.01 * _last_digit(a) for a, b in pairs)


def _value(number: str) -> float:
    return float(number.replace(",", ""))


def _last_digit(number: str) -> float:
    mantissa, _, exponent = number.partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def executed_pages() -> dict[Path, Path]:
    """Return the executed pages with the files of what they must print."""
    pages = [p for p in sorted((DOCS / "auto").glob("*/*.rst")) if p.with_suffix(".py").exists()]
    return {page: EXPECTED / page.relative_to(DOCS / "auto").with_suffix(".txt") for page in pages}


def compare(app: Sphinx) -> None:
    """Warn of each page that prints something else than it must."""
    from sphinx.util import logging

    for page, target in executed_pages().items():
        expected = target.read_text(encoding="utf-8") if target.exists() else ""
        if not same(expected.strip(), (found := printed(page)).strip()):
            logging.getLogger(__name__).warning("%s prints\n%s\ninstead of\n%s", page.name, found, expected)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the comparison, which follows the execution of the pages."""
    app.connect("builder-inited", compare, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


if __name__ == "__main__":
    for page, target in executed_pages().items():
        if not OUTPUT.search(page.read_text(encoding="utf-8")):
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(printed(page), encoding="utf-8")
        print(target.relative_to(DOCS), file=sys.stderr)
