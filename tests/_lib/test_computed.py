"""Properties that are computed once: kept, one for all threads, and without a lock."""

import threading

from cellmap._lib.computed import computed_once


class Numbered:
    def __init__(self) -> None:
        self.calls, self.both = 0, threading.Barrier(2, timeout=60)

    @computed_once
    def number(self) -> object:
        """Different for each call."""
        self.calls += 1
        return object()

    @computed_once
    def beside(self) -> object:
        self.both.wait()  # ends only where two threads are inside
        return object()


def test_it_is_computed_once_and_kept_with_the_instance():
    one, other = Numbered(), Numbered()
    assert one.number is one.number and one.calls == 1
    assert one.number is not other.number
    assert "number" in vars(one) and Numbered.number.__doc__ == "Different for each call."


def test_threads_that_compute_it_side_by_side_get_the_same():
    shared, found = Numbered(), []
    threads = [threading.Thread(target=lambda: found.append(shared.beside)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 2 and found[0] is found[1]
