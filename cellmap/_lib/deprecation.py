"""Names that have changed: accepted for two minor versions, with a warning that says what to write instead."""

from __future__ import annotations

from typing import Any

from .checks import warn_caller


def renamed(before: str, now: str, since: str, *given: Any) -> None:
    """Warn the caller of a name that has another one; `given` may be the value that came under the former one.

    Parameters
    ----------
    before, now : str
        Both names.
    since : str
        Version from which the new one is there.
    *given : object
        Value of an argument, if it is one.

    Warns
    -----
    DeprecationWarning
        With both names, the version, and what to write.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings(record=True, action="always") as seen:
    ...     renamed("max_period", "longest_period", "0.2", 8)
    >>> print(seen[0].message)
    max_period is called longest_period since cellmap 0.2: give longest_period=8
    """
    remedy = f": give {now}={given[0]!r}" if given else ""
    warn_caller(f"{before} is called {now} since cellmap {since}{remedy}", DeprecationWarning)
