"""The thread pool.  Work is sliced independently of the number of threads, so that results do not depend on it."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from itertools import islice
from queue import SimpleQueue
from typing import Any, TypeVar

from .checks import whole_number
from .signatures import checked
from .stopping import Stop, heeded, heeding
from .systems import at_fork, cores

Task = TypeVar("Task")
Result = TypeVar("Result")

_AHEAD = 4  # tasks for each thread that are under way, or done and not taken yet

_KEPT = 4  # pools without work

_count: int | None = None
_idle: list[tuple[int, ThreadPoolExecutor]] = []
_SMALL = 4  # rows of matrices for which linear algebra never takes threads
_limits: list[Any] = []  # on its threads, one for each that asks for them: the first is in force
_limiting = threading.Lock()
at_fork(_idle.clear)  # their threads stay behind


def thread_count() -> int:
    """Return the number of threads in use: `set_threads`, else ``$CELLMAP_THREADS``, else the cores of this process.

    Examples
    --------
    >>> thread_count() >= 1
    True
    """
    if _count is not None:
        return _count
    chosen = os.environ.get("CELLMAP_THREADS")
    if chosen:
        return whole_number("CELLMAP_THREADS", int(chosen) if chosen.isdigit() else chosen, at_least=1)
    return cores()


@checked
def set_threads(count: int | None) -> None:
    """Choose the number of threads for all later work; None returns to the default.  Results never depend on it.

    Parameters
    ----------
    count : int or None
        Threads, at least 1.

    Examples
    --------
    >>> set_threads(1); thread_count()
    1
    >>> set_threads(None)
    """
    global _count
    _count = None if count is None else whole_number("count", count, at_least=1)


@contextmanager
def linear_algebra_on_one_thread(rows: int) -> Iterator[None]:
    """Keep products and factors of matrices with some rows on the thread that asks for them, in this process.

    For matrices of some dozens of rows the libraries take all cores, wait for those that other threads are on, and gain
    nothing; their last bits may depend on the number of threads.
    """
    if rows <= _SMALL:
        yield
        return
    from threadpoolctl import threadpool_limits

    with _limiting:
        _limits.append(None if _limits else threadpool_limits(1, "blas"))
    try:
        yield
    finally:
        with _limiting:
            # Whoever is the last to leave takes the limits away.
            if len(_limits) > 1:
                _limits.pop()
            else:
                _limits.pop().restore_original_limits()


def slices(total: int, size: int) -> list[slice]:
    """Cut ``range(total)`` into slices of `size`."""
    return [slice(i, min(i + size, total)) for i in range(0, total, size)]


def run_over(tasks: Sequence[Task], work: Callable[[Task], Result], progress: str | None = None) -> list[Result]:
    """Return ``work(task)`` for every task, from all threads; an exception or Ctrl-C stops the rest.

    Tasks that are under way then end where they look for it next, as every call of a compiled loop does.
    """
    with progress_bar(len(tasks), progress) as advance:
        if thread_count() == 1 or len(tasks) == 1:
            results = []
            for task in tasks:
                results.append(work(task))
                advance(1)
            return results
        pool, stop = _taken(threads := thread_count()), Stop(parent=heeded())
        try:
            done: SimpleQueue[Future[Result]] = SimpleQueue()
            futures = [_submitted(pool, stop, work, task) for task in tasks]
            for future in futures:
                future.add_done_callback(done.put)
            for _ in futures:
                if done.get().exception() is not None:
                    raise next(error for f in futures if f.done() and (error := f.exception()) is not None)
                advance(1)
        except BaseException:
            _ended(pool, stop)
            raise
        _given_back(threads, pool)
        return [future.result() for future in futures]


def results_of(tasks: Sequence[Task], work: Callable[[Task], Result]) -> Iterator[tuple[Task, Result]]:
    """Yield ``task, work(task)`` for every task as it is completed, on all threads; few results wait to be taken.

    Where they are no longer asked for, tasks that are under way end where they look for it, and no others begin.
    """
    threads = thread_count()
    if threads == 1 or len(tasks) == 1:
        for task in tasks:
            yield task, work(task)
        return
    pool, rest, stop = _taken(threads), iter(tasks), Stop(parent=heeded())
    under_way: dict[Future[Result], Task] = {}
    done: SimpleQueue[Future[Result]] = SimpleQueue()

    def begin(more: int) -> None:
        for task in islice(rest, more):
            under_way[future := _submitted(pool, stop, work, task)] = task
            future.add_done_callback(done.put)

    try:
        begin(_AHEAD * threads)
        while under_way:
            future = done.get()  # in C, which Ctrl-C never leaves half done
            yield under_way.pop(future), future.result()
            begin(1)
    except GeneratorExit:
        stop.request()
        # The garbage collector may say so while this thread holds the locks of pools, which let nobody in twice.
        _given_back_after([future for future in under_way if not future.cancel()], threads, pool)
        raise
    except BaseException:
        _ended(pool, stop)
        raise
    _given_back(threads, pool)


def _submitted(pool: ThreadPoolExecutor, stop: Stop, work: Callable[[Task], Result], task: Task) -> Future[Result]:
    """Begin a task; at the end of a program, when pools take none any more, do it on this thread."""
    try:
        return pool.submit(_until, stop, work, task)
    except RuntimeError as error:
        if not str(error).startswith("cannot schedule"):  # a thread cannot be started
            raise
    future: Future[Result] = Future()
    try:
        future.set_result(_until(stop, work, task))
    except Exception as error:
        future.set_exception(error)
    return future


def _until(stop: Stop, work: Callable[[Task], Result], task: Task) -> Result:
    with heeding(stop):
        return work(task)


def _ended(pool: ThreadPoolExecutor, stop: Stop) -> None:
    """End what the threads of a pool are doing, and them."""
    stop.request()
    pool.shutdown(wait=True, cancel_futures=True)


def _taken(threads: int) -> ThreadPoolExecutor:
    """Return a pool for one call alone, with threads that run already where a call before has left some."""
    with suppress(IndexError):  # calls in other threads take pools as well
        while True:
            count, pool = _idle.pop()
            if count == threads:
                return pool
            pool.shutdown(wait=False)
    return ThreadPoolExecutor(threads)


def _given_back(threads: int, pool: ThreadPoolExecutor) -> None:
    """Keep a pool whose tasks are all done for the next call: threads take a millisecond to start."""
    if len(_idle) < _KEPT:
        _idle.append((threads, pool))
    else:
        pool.shutdown(wait=False)


def _given_back_after(under_way: Sequence[Future[Any]], threads: int, pool: ThreadPoolExecutor) -> None:
    """Keep a pool for the next call when the tasks that are under way have come to their end."""
    pools = [pool, *[None] * (len(under_way) - 1)]  # taken from the end, so that the last task finds the pool

    def ended(_: Future[Any]) -> None:
        last = pools.pop()
        if last is not None:
            _given_back(threads, last)

    for future in under_way:
        future.add_done_callback(ended)
    if not under_way:
        _given_back(threads, pool)


@contextmanager
def progress_bar(total: int, description: str | None) -> Iterator[Callable[[int], object]]:
    """Show a bar on a terminal once the work has lasted two seconds; none without a description."""
    if description is None or not sys.stderr.isatty():
        yield lambda _: None
        return
    from tqdm import tqdm

    with tqdm(total=total, desc=description, disable=None, delay=2.0, leave=False) as bar:
        yield bar.update
