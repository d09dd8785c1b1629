"""Questions of a page: answered one at a time, in the order in which they came, unless they are cancelled."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from starlette.websockets import WebSocketDisconnect

from .._lib.stopping import Stop, Stopped, heeding
from .questions import failure

THREADS = 4
"""Threads for images, and for answers, of which one is at work: in others what was cancelled comes to its end."""

_Then = Callable[[Mapping[str, Any], Any], Awaitable[None]]

_MOST = 8  # questions that wait for their answers


class Jobs:
    """Questions of a page that have no answer yet.

    Parameters
    ----------
    tell : callable
        Sends a message to the page.
    """

    def __init__(self, tell: Callable[[Mapping[str, Any]], Awaitable[None]]) -> None:
        self._tell = tell
        self._tasks: set[asyncio.Task[None]] = set()
        self._stops: dict[int, tuple[asyncio.Task[None], Stop]] = {}  # by requests
        self._answering = asyncio.Lock()
        self._threads = ThreadPoolExecutor(THREADS, "question")

    def begin(self, asked: Mapping[str, Any], work: Callable[[], Any], then: _Then) -> None:
        """Answer a question with the result of some work.

        Raises
        ------
        ValueError
            If too many are waiting.
        """
        if len(self._tasks) >= _MOST:
            raise ValueError(f"type={asked['type']!r}: {_MOST} questions are waiting for answers, ask again later")
        request, stop = asked.get("request"), Stop()
        number = request if isinstance(request, int) else -1
        task = asyncio.ensure_future(self._answer(asked, work, then, number, stop))
        self._stops[number] = task, stop
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _answer(self, asked: Mapping[str, Any], work: Any, then: Any, number: int, stop: Stop) -> None:
        def heeded() -> Any:
            with heeding(stop):
                return work()

        told: Exception | None = None
        try:
            async with self._answering:
                answer = await asyncio.get_running_loop().run_in_executor(self._threads, heeded)
        except Exception as error:
            told = error
        finally:
            stop.request()
            self._stops.pop(number, None)  # from here on it is too late
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):  # the page is gone
            if told is None:
                await then(asked, answer)
            else:
                await self._tell(failure(told, asked.get("request")))

    async def cancel(self, request: int) -> bool:
        """End the work for a question, at once for the page, and tell whether there was one."""
        if request not in self._stops:
            return False
        task, stop = self._stops.pop(request)
        stop.request()
        task.cancel()
        await self._tell(failure(Stopped(), request))
        return True

    async def end(self) -> None:
        """End them all, for the page is gone."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._threads.shutdown(wait=False, cancel_futures=True)
