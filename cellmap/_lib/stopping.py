"""Requests to end work before it is done, from any thread or after some time."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar


class Stopped(Exception):
    """Work has ended before it was done, because that was asked for."""


class Stop:
    """A request that work looks for from time to time.

    Parameters
    ----------
    seconds : float or None
        Time after which the request makes itself.
    parent : Stop or None
        A request of which this one is a part.

    Examples
    --------
    >>> stop = Stop()
    >>> stop.requested
    False
    >>> stop.request()
    >>> stop.requested
    True
    """

    def __init__(self, seconds: float | None = None, parent: Stop | None = None) -> None:
        self._asked, self._parent = False, parent
        self._deadline = None if seconds is None else time.monotonic() + seconds

    def request(self) -> None:
        """Ask for the end, from any thread."""
        self._asked = True

    @property
    def timed_out(self) -> bool:
        """Whether the time is over, and nobody has asked for the end."""
        if self._asked:
            return False
        late = self._deadline is not None and time.monotonic() >= self._deadline
        return late or (self._parent is not None and self._parent.timed_out)

    @property
    def requested(self) -> bool:
        """Whether the end was asked for, or the time is over."""
        if self._asked or (self._parent is not None and self._parent.requested):
            return True
        return self._deadline is not None and time.monotonic() >= self._deadline

    def check(self) -> None:
        """Raise :class:`Stopped` if the end of the work was asked for."""
        if self.requested:
            raise Stopped


_HEEDED: ContextVar[Stop | None] = ContextVar("_HEEDED", default=None)


def heeded() -> Stop | None:
    """Return the request that this thread looks for."""
    return _HEEDED.get()


@contextmanager
def heeding(stop: Stop) -> Iterator[None]:
    """Let :func:`check_stop` look for a request, in this thread, while what is inside runs.

    Examples
    --------
    >>> stop = Stop()
    >>> stop.request()
    >>> check_stop()
    >>> with heeding(stop):
    ...     check_stop()
    Traceback (most recent call last):
        ...
    cellmap._lib.stopping.Stopped
    """
    token = _HEEDED.set(stop)
    try:
        yield
    finally:
        _HEEDED.reset(token)


def check_stop() -> None:
    """Raise :class:`Stopped` if somebody has asked this thread's work to end."""
    stop = _HEEDED.get()
    if stop is not None:
        stop.check()
