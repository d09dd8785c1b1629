"""Common parts of records: mappings by label, arrays in files, and methods that other rooms carry out.

Records stand below the room that knows the optional packages; it is looked up by its name when a method is called.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any, ClassVar, NamedTuple, NoReturn, TypeVar

from .checks import no_such_key

_ROOM = f"{__name__.split('.')[0]}.exchange"
Key = TypeVar("Key")
Value = TypeVar("Value")


class Keyed(dict[Key, Value]):
    """A dictionary of a record whose error for a missing key says which keys there are, and what they mean.

    Examples
    --------
    >>> counts = Keyed({0: 7, -1: 2}, "counts", {0: "fixed point", -1: "escaped"})
    >>> counts[0]
    7
    >>> counts["fixed point"]
    Traceback (most recent call last):
    KeyError: "counts['fixed point']: choose one of 0 (fixed point), -1 (escaped); counts.get(key) is None for others"
    """

    def __init__(
        self,
        entries: Mapping[Key, Value],
        name: str,
        meanings: Mapping[Key, str] | Callable[[], Mapping[Key, str]] | None = None,
    ) -> None:
        super().__init__(entries)
        self._name, self._meanings = name, meanings

    def _names(self) -> Mapping[Key, str]:
        found = self._meanings() if callable(self._meanings) else self._meanings
        return {} if found is None else found

    def __missing__(self, key: Any) -> NoReturn:
        raise no_such_key(self._name, self, key, self._names())

    def __reduce__(self) -> tuple[Any, ...]:
        return Keyed, (dict(self), self._name, dict(self._names()))


class Array(NamedTuple):
    """An array of a record as a variable of a file; its type is that of the record's field.

    Parameters
    ----------
    dims : str
        Names of its dimensions.  ``{parameter}``, ``{x}``, ``{y}`` and ``{cells}`` stand for names that the record
        gives: of its parameter or two, and, by its `coordinates`, of the axes of its grid.
    about : str
        What it is, in words in which ``{0}`` is the record.
    name : str
        Name of the variable, by default that of the field.  With ``{state}`` in it there is a variable for each state
        variable, along the last axis of the array.
    unit : str
        Unit of the CF conventions; ``"1"`` for pure numbers.
    flags : type of IntEnum, or str
        Meanings of whole numbers, or the name of the record's attribute that has them.
    comment : str
        What else is to be known.
    """

    dims: str
    about: str = ""
    name: str = ""
    unit: str = ""
    flags: type[IntEnum] | str = ""
    comment: str = ""


class Layout(NamedTuple):
    """A record as labelled arrays: a title, coordinates and variables by the names of fields or properties.

    An array that is None is left out; complex numbers are not for netCDF, so give their parts as properties.  Fields
    that are neither, of text, numbers, mappings, grids and their like, are attributes of the file, by their
    names or by those of `attributes`, where an empty name leaves a field out.
    """

    title: str
    coords: Mapping[str, Array]
    variables: Mapping[str, Array]
    attributes: Mapping[str, str] = {}


class ShownAsHtml:
    """A record that notebooks show as a short table."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return str(importlib.import_module(f"{_ROOM}.html").html(self))


class ConvertsToXarray:
    """A record that :func:`cellmap.exchange.to_xarray` converts, by its layout where it has one."""

    __slots__ = ()
    _layout: ClassVar[Layout | None] = None

    def to_xarray(self, functions: Mapping[str, Any] | None = None) -> Any:
        """Return labelled arrays of xarray, as :func:`cellmap.exchange.to_xarray` does."""
        return importlib.import_module(f"{_ROOM}.datasets").to_xarray(self, functions)


class ConvertsToDataFrame:
    """A record that :func:`cellmap.exchange.to_dataframe` converts."""

    __slots__ = ()

    def to_dataframe(self, functions: Mapping[str, Any] | None = None) -> Any:
        """Return a table of pandas, as :func:`cellmap.exchange.to_dataframe` does."""
        return importlib.import_module(f"{_ROOM}.tables").to_dataframe(self, functions)
