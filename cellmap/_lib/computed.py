"""Properties that are computed once, without a lock."""

from __future__ import annotations

import functools
from typing import Any, Self, TypeVar, overload

Value = TypeVar("Value")


class computed_once(functools.cached_property[Value]):  # noqa: TID251
    """A property that is computed when it is asked for first, and kept.

    That of :mod:`functools` holds a lock in Python 3.11 that all instances of a class share: a process that is forked
    meanwhile finds it held for ever.  Here threads that ask at the same time may compute it side by side, and all of
    them get what was kept first.
    """

    @overload
    def __get__(self, instance: None, owner: type[Any] | None = None) -> Self: ...

    @overload
    def __get__(self, instance: object, owner: type[Any] | None = None) -> Value: ...

    def __get__(self, instance: object, owner: type[Any] | None = None) -> Self | Value:
        """Return the value that is kept; compute it where none is."""
        if instance is None:
            return self
        kept, name = instance.__dict__, str(self.attrname)
        if name not in kept:
            kept.setdefault(name, self.func(instance))
        return kept[name]
