"""Methods of records that other rooms carry out: conversions to labelled arrays and tables, and HTML in notebooks.

Records stand below the room that knows the optional packages; it is looked up by its name when a method is called.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

_ROOM = f"{__name__.split('.')[0]}.exchange"


class ShownAsHtml:
    """A record that notebooks show as a short table."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return str(importlib.import_module(f"{_ROOM}.html").html(self))


class ConvertsToXarray:
    """A record that :func:`cellmap.exchange.to_xarray` converts."""

    __slots__ = ()

    def to_xarray(self, functions: Mapping[str, Any] | None = None) -> Any:
        """Return labelled arrays of xarray, as :func:`cellmap.exchange.to_xarray` does."""
        return importlib.import_module(f"{_ROOM}.datasets").to_xarray(self, functions)


class ConvertsToDataFrame:
    """A record that :func:`cellmap.exchange.to_dataframe` converts."""

    __slots__ = ()

    def to_dataframe(self, functions: Mapping[str, Any] | None = None) -> Any:
        """Return a table of pandas, as :func:`cellmap.exchange.to_dataframe` does."""
        return importlib.import_module(f"{_ROOM}.tables").to_dataframe(self, functions)
