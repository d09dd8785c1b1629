"""Work in tiles on the threads of this process or on a cluster, with the same tiles and therefore the same results."""

from __future__ import annotations

import hashlib
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any, TypeVar

from .checks import warn_caller
from .threads import progress_bar, results_of

Task = TypeVar("Task")
Result = TypeVar("Result")

_LARGEST_GROUP = 16  # tiles that travel together
_GROUPS_A_THREAD = 8  # least number of groups for each thread, so that all threads are busy to the end
_UNDER_WAY = 2  # groups that a thread of the cluster has before it, so that it never waits
_RETRIES = 2  # retries of a group that fails for a reason of its worker's, such as memory
_LOOK = 0.01  # seconds between looks for completed groups
_SELDOM = 1.0  # seconds between looks for workers
_WARNED = 30.0  # seconds without workers after which a warning says so
_GIVEN_UP = 600.0  # seconds without workers after which the call ends
_KEPT_WORK = 4  # pieces of work that a worker keeps unpacked


def completed(
    numbers: Sequence[int],
    task: Callable[[int], Task],
    work: Callable[[Task], Result],
    client: Any = None,
    progress: str | None = None,
) -> Iterator[tuple[int, Result]]:
    """Do the tiles of some numbers, and yield ``number, work(task(number))`` for each as it is completed.

    Parameters
    ----------
    numbers : sequence of int
        Tiles to do.
    task : callable
        Returns the input of a tile; called just before the work on it, without a client from several threads at once.
    work : callable
        What is done to it: pure, and picklable where there is a client.  A tile that is lost is done again.
    client : distributed.Client, optional
        Cluster that works; by default the threads of this process do.
    progress : str, optional
        Text beside a bar.

    Raises
    ------
    TimeoutError
        Where the cluster has no workers for ten minutes.
    ConnectionError
        Where its scheduler is lost.
    RuntimeError
        Where its workers die, one after another, of the same tiles.
    """
    with progress_bar(len(numbers), progress) as advance:
        if client is None:
            results = results_of(numbers, lambda number: work(task(number)))
        else:
            results = _told_of_losses(_results_of_cluster(numbers, task, work, client), client)
        for number, result in results:
            yield number, result
            advance(1)


def check_client(client: Any) -> None:
    """Refuse what is not a client of a Dask cluster."""
    if client is None:
        return
    try:
        from distributed import Client
    except ImportError:
        raise TypeError(
            f"client={client!r}: pip install 'cellmap-dynamics[cluster]', and give a distributed.Client"
        ) from None
    if not isinstance(client, Client) or client.asynchronous:
        raise TypeError(f"client={client!r}: give a distributed.Client that is not asynchronous")


def _results_of_cluster(
    numbers: Sequence[int], task: Callable[[int], Any], work: Callable[[Any], Any], client: Any
) -> Iterator[tuple[int, Any]]:
    """Keep all threads of a cluster busy, and no more than that under way; Dask repeats what a lost worker had."""
    if not len(numbers):
        return
    import dask
    from distributed import as_completed

    # Tables may be large, and travel to each worker once.
    with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1TB"}):
        packed = _Packed(client, work)
        groups = _groups(numbers, _threads(client))
        members: dict[str, tuple[Any, list[int]]] = {}

        def begin(group: list[int]) -> Any:
            future = packed.submit([task(number) for number in group])
            members[future.key] = future, group
            return future

        def next_ones(wanted: int) -> list[Any]:
            return [begin(group) for _, group in zip(range(wanted), groups, strict=False)]

        try:
            under_way: Any = as_completed(next_ones(_UNDER_WAY * _threads(client)))
            waited = _Waiting(client)
            for future in _completed(under_way, waited):
                results = waited.result(future)
                _, group = members.pop(future.key)
                yield from zip(group, results, strict=True)
                # Workers come and go.
                under_way.update(next_ones(_UNDER_WAY * _threads(client) - len(members)))
        finally:
            with suppress(Exception):  # whatever Dask raises where there is no scheduler any more
                client.cancel([future for future, _ in members.values()])


def _told_of_losses(results: Iterator[Result], client: Any) -> Iterator[Result]:
    """Yield what a cluster yields; say of one that falls apart what to do."""
    from distributed import CancelledError, KilledWorker
    from distributed.comm.core import CommClosedError

    again = "call again: with a checkpoint the call goes on with what is done"
    try:
        yield from results
    except KilledWorker as error:
        raise RuntimeError(
            f"client={client!r}: the workers that had the same tiles died, as they do when their memory is full; give "
            f"them more of it, or fewer threads each, and {again} ({error})"
        ) from error
    except Exception as error:
        if client.status == "running" and not isinstance(error, CommClosedError | CancelledError):
            raise  # of the work itself
        raise ConnectionError(
            f"client={client!r}: the connection to the scheduler is lost; start a cluster and a client, and {again} "
            f"({type(error).__name__}: {error})"
        ) from error


def _completed(under_way: Any, waited: _Waiting) -> Iterator[Any]:
    """Yield futures as they are completed, as long as there is somebody to complete them."""
    while not under_way.is_empty():
        while not under_way.has_ready():
            waited.look()
            time.sleep(_LOOK)
        yield next(under_way)


class _Waiting:
    """Waiting for a cluster: an error ends it where that has no workers for long, and a warning comes first."""

    def __init__(self, client: Any) -> None:
        self._client, self._told = client, False
        self._seen = self._looked = time.monotonic()

    def result(self, future: Any) -> Any:
        """Return the result of a future; one that was lost with its worker is computed again by another."""
        while True:
            try:
                return future.result(timeout=_SELDOM)
            except TimeoutError:
                if future.status == "error":
                    raise
                self.look()

    def look(self) -> None:
        """Look for workers, from time to time."""
        now = time.monotonic()
        if now - self._looked < _SELDOM:
            return
        self._looked = now
        if self._client.nthreads():
            self._seen, self._told = now, False
        elif now - self._seen > _GIVEN_UP:
            raise TimeoutError(
                f"client={self._client!r}: the cluster has had no workers for {_GIVEN_UP:g} s; start some and call "
                "again: with a checkpoint the call goes on with what is done"
            )
        elif now - self._seen > _WARNED and not self._told:
            self._told = True
            warn_caller(
                f"client={self._client!r}: the cluster has had no workers for {_WARNED:g} s; start some, for without "
                f"them the call ends after {_GIVEN_UP:g} s"
            )


def _threads(client: Any) -> int:
    return max(1, sum(client.nthreads().values()))


def _groups(numbers: Sequence[int], threads: int) -> Iterator[list[int]]:
    """Cut tiles into groups, large for few messages and yet many for each thread."""
    size = min(max(len(numbers) // (threads * _GROUPS_A_THREAD), 1), _LARGEST_GROUP)
    return (list(numbers[i : i + size]) for i in range(0, len(numbers), size))


class _Packed:
    """Work as bytes that a worker fetches once and unpacks once.

    They are the result of a task of the cluster's own: where the only worker that has them dies, the scheduler makes
    them again, as it does not with data that were merely put there.
    """

    def __init__(self, client: Any, work: Callable[[Any], Any]) -> None:
        import cloudpickle

        content = cloudpickle.dumps(work)
        self._client, self._digest = client, hashlib.sha256(content).hexdigest()
        self._content = client.submit(bytes, content, key=f"cellmap-work-{self._digest}")

    def submit(self, tasks: list[Any]) -> Any:
        """Begin a group."""
        return self._client.submit(_work_on, self._content, self._digest, tasks, pure=False, retries=_RETRIES)


_unpacked: OrderedDict[str, Callable[[Any], Any]] = OrderedDict()
_unpacking = threading.Lock()


def _work_on(content: bytes, digest: str, tasks: list[Any]) -> list[Any]:
    """Do a group of tiles on a worker."""
    import pickle

    with _unpacking:  # threads of a worker share what it has compiled
        if digest not in _unpacked:
            _unpacked[digest] = pickle.loads(content)
        _unpacked.move_to_end(digest)
        work = _unpacked[digest]
        while len(_unpacked) > _KEPT_WORK:
            _unpacked.popitem(last=False)
    return [work(task) for task in tasks]
