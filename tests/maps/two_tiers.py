"""Parameters of a test of which the first tier takes some only."""

from collections.abc import Iterable, Sequence
from typing import Any

import pytest


def at_once(first: Sequence[Any], *, later: Iterable[Any]) -> list[Any]:
    """Return those of the first tier, and those that are left to the thorough one; entries of tuples are arguments."""
    rest = (value for value in later if not any(value is one or value == one for one in first))
    return [*first, *(pytest.param(*(v if isinstance(v, tuple) else (v,)), marks=pytest.mark.thorough) for v in rest)]
