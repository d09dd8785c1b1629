"""Mathematics between dollar signs in names, which matplotlib sets in figures."""

from __future__ import annotations

from functools import lru_cache

from matplotlib.cbook import is_math_text
from matplotlib.mathtext import MathTextParser


@lru_cache
def fault_in(name: str) -> str:
    """Return the fault in the mathematics of a name; an empty text where all figures can show it.

    One dollar sign alone is no mathematics, but two names in a title are a pair of them.
    """
    words = f"{name}, {name}" if is_math_text(f"{name}$") else name
    try:
        if is_math_text(words):
            MathTextParser("path").parse(words)
    except (ValueError, RecursionError) as error:
        return str(error).strip().splitlines()[-1]
    return ""
