"""Packages that are optional, imported when they are used first."""

from __future__ import annotations

from typing import Any


def xarray_package() -> Any:
    """Return xarray.

    Raises
    ------
    ModuleNotFoundError
        If it is not installed; the message says how to install it.
    """
    try:
        import xarray
    except ModuleNotFoundError as error:
        raise _missing("xarray", error) from error
    return xarray


def pandas_package() -> Any:
    """Return pandas; errors are those of :func:`xarray_package`."""
    try:
        import pandas
    except ModuleNotFoundError as error:
        raise _missing("pandas", error) from error
    return pandas


def _missing(name: str, error: ModuleNotFoundError) -> ModuleNotFoundError:
    return ModuleNotFoundError(f"{error} ({name} is optional): pip install 'cellmap-dynamics[xarray]'", name=error.name)
