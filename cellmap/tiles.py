"""Work in tiles: on the threads of this process or on a cluster.  The tiles are the same, and so are the results."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

from .threads import progress_bar, run_over

Task = TypeVar("Task")
Result = TypeVar("Result")

_LARGEST_GROUP = 16  # tiles that travel together
_GROUPS_A_THREAD = 8  # at least, so that all threads are busy to the end
_UNDER_WAY = 2  # groups that a thread of the cluster has before it, so that it never waits
_RETRIES = 2  # of a group that fails for a reason of its worker's, such as memory
_KEPT_WORK = 4  # pieces of work that a worker keeps unpacked


def run_tiles(
    numbers: Sequence[int],
    task: Callable[[int], Task],
    work: Callable[[Task], Result],
    deliver: Callable[[int, Result], None],
    client: Any = None,
    progress: str | None = None,
) -> None:
    """Do the tiles of some numbers: ``deliver(number, work(task(number)))`` for each.

    Parameters
    ----------
    numbers : sequence of int
        Tiles to do.
    task : callable
        What a tile begins from; called here, when its turn comes.
    work : callable
        What is done to it: pure, and picklable where there is a client.  A tile that is lost is done again.
    deliver : callable
        What becomes of the result; called here, without a client from several threads at once.
    client : distributed.Client, optional
        Cluster that works; by default the threads of this process do.
    progress : str, optional
        Text beside a bar.
    """
    if client is None:
        run_over(numbers, lambda number: deliver(number, work(task(number))), progress)
    elif len(numbers):
        _run_on_cluster(numbers, task, work, deliver, client, progress)


def check_client(client: Any) -> None:
    """Refuse what is not a client of a Dask cluster."""
    if client is None:
        return
    try:
        from distributed import Client
    except ImportError:
        raise TypeError(f"client={client!r}: install cellmap[cluster], and give a distributed.Client") from None
    if not isinstance(client, Client) or client.asynchronous:
        raise TypeError(f"client={client!r}: give a distributed.Client that is not asynchronous")


def _run_on_cluster(
    numbers: Sequence[int],
    task: Callable[[int], Any],
    work: Callable[[Any], Any],
    deliver: Callable[[int, Any], None],
    client: Any,
    progress: str | None,
) -> None:
    """Keep all threads of a cluster busy, and no more than that under way; Dask repeats what a lost worker had."""
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

        with progress_bar(len(numbers), progress) as advance:
            try:
                under_way: Any = as_completed(next_ones(_UNDER_WAY * _threads(client)))
                for future in under_way:
                    results = future.result()
                    _, group = members.pop(future.key)
                    for number, result in zip(group, results, strict=True):
                        deliver(number, result)
                    advance(len(group))
                    # Workers come and go.
                    under_way.update(next_ones(_UNDER_WAY * _threads(client) - len(members)))
            finally:
                client.cancel([future for future, _ in members.values()])


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
