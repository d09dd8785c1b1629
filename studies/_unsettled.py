"""Basins in which many initial conditions have no attractor because that is what a study shows."""

from __future__ import annotations

import warnings
from typing import Any

from cellmap import Basins, find_basins
from cellmap.basins import UnsettledWarning


def unsettled_basins(*arguments: Any, **options: Any) -> Basins:
    """Return what :func:`find_basins` does, without its warning of initial conditions that have no attractor."""
    with warnings.catch_warnings(action="ignore", category=UnsettledWarning):
        return find_basins(*arguments, **options)
