"""Codes with which compiled functions end early."""

from __future__ import annotations

from enum import IntEnum


class Failure(IntEnum):
    """Reason why a function has ended before it returned."""

    NO_MEMORY = 1
    OUTSIDE = 2
    """An index outside of an array."""
    WRONG_VALUE = 3
    """An array of negative length, or a range with step 0."""
