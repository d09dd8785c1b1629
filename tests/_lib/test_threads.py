"""The thread pool."""

import os
import subprocess
import sys
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st
from threadpoolctl import threadpool_info, threadpool_limits

from cellmap import set_threads, thread_count
from cellmap._lib.threads import linear_algebra_on_one_thread, results_of, run_over, slices
from cellmap.utils import progress_bar


def threads_of_linear_algebra() -> int:
    return max(library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas")


def test_linear_algebra_stays_on_one_thread_until_the_last_has_left() -> None:
    with threadpool_limits(2, "blas"):
        first, second = linear_algebra_on_one_thread(80), linear_algebra_on_one_thread(5)
        with linear_algebra_on_one_thread(4):
            assert threads_of_linear_algebra() == 2
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert threads_of_linear_algebra() == 1
        second.__exit__(None, None, None)
        assert threads_of_linear_algebra() == 2


@given(st.integers(0, 10_000), st.integers(1, 5000))
def test_slices_cover_everything_once(total: int, size: int) -> None:
    parts = slices(total, size)
    assert [i for part in parts for i in range(part.start, part.stop)] == list(range(total))
    assert all(0 < part.stop - part.start <= size for part in parts)


def test_the_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CELLMAP_THREADS", raising=False)
    assert thread_count() >= 1
    monkeypatch.setenv("CELLMAP_THREADS", "5")
    assert thread_count() == 5
    set_threads(3)
    assert thread_count() == 3
    set_threads(None)
    assert thread_count() == 5


def test_bad_numbers_of_threads_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for count in (0, -1, 1.0, True, "2"):
        with pytest.raises(ValueError if type(count) is int else TypeError, match=r"count=.*: give a whole number"):
            set_threads(count)
    for value in ("many", "2.5", "0", "-1"):
        monkeypatch.setenv("CELLMAP_THREADS", value)
        with pytest.raises(ValueError if value == "0" else TypeError, match=r"CELLMAP_THREADS=.*: give a whole number"):
            thread_count()


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_every_task_runs_once(threads: int) -> None:
    set_threads(threads)
    done: list[int] = []
    for tasks in (range(50), []):
        run_over(tasks, done.append)
        assert sorted(done) == list(range(50))


@pytest.mark.parametrize("threads", [1, 2])
def test_an_exception_stops_the_rest(threads: int) -> None:
    set_threads(threads)
    started: list[int] = []

    def work(task: int) -> None:
        started.append(task)
        if task == 0:
            raise ZeroDivisionError("task 0")
        time.sleep(0.005)

    with pytest.raises(ZeroDivisionError, match="task 0"):
        run_over(range(200), work)
    assert len(started) < 100


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_results_come_once_each_and_few_wait_for_a_slow_reader(threads: int) -> None:
    set_threads(threads)
    begun: list[int] = []

    def work(task: int) -> int:
        begun.append(task)
        return task * task

    taken: list[tuple[int, int]] = []
    for pair in results_of(range(60), work):
        taken.append(pair)
        time.sleep(0.001)
        assert len(begun) - len(taken) <= 5 * threads
    assert sorted(taken) == [(k, k * k) for k in range(60)]
    assert list(results_of([], work)) == []


@pytest.mark.parametrize("threads", [1, 2])
def test_who_stops_reading_results_stops_the_rest(threads: int) -> None:
    set_threads(threads)
    begun: list[int] = []
    results = results_of(range(200), begun.append)
    next(results)
    results.close()
    assert len(begun) < 100
    with pytest.raises(ZeroDivisionError):
        list(results_of([1, 0, 2], lambda task: 1 // task))


def test_threads_serve_one_call_after_another_and_several_at_once() -> None:
    set_threads(2)

    def meet(_: int) -> None:
        together.wait()

    def both(task: int) -> tuple[int, str]:
        together.wait()
        inner = dict(results_of(range(2), lambda k: 10 * task + k))
        assert inner == {0: 10 * task, 1: 10 * task + 1}
        return task, threading.current_thread().name

    together = threading.Barrier(2, timeout=10.0)
    names = [sorted(name for _, (_, name) in results_of(range(2), both)) for _ in range(3)]
    assert names[0] == names[1] == names[2], "no thread was started for a later call"
    for _ in range(3):  # what is not read to its end leaves its threads as well, once they are done
        results = results_of(range(40), lambda task: time.sleep(0.001))
        next(results)
        results.close()
        time.sleep(0.05)
    assert sorted(name for _, (_, name) in results_of(range(2), both)) == names[0]
    with pytest.raises(ZeroDivisionError):
        run_over(range(4), lambda task: 1 // task)
    run_over(range(2), meet)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_process_that_forked_has_threads_of_its_own() -> None:
    set_threads(2)
    run_over(range(4), lambda _: None)
    child = os.fork()
    if child == 0:
        os._exit(0 if dict(results_of(range(4), lambda task: task * task)) == {0: 0, 1: 1, 2: 4, 3: 9} else 1)
    assert os.waitpid(child, 0)[1] == 0


def test_no_description_no_bar(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar(3, None) as advance:
        advance(1)
    with progress_bar(3, "work") as advance:
        advance(3)
    assert capsys.readouterr().err == ""


ENDING = """
import atexit, threading, time
from cellmap import set_threads
from cellmap._lib.threads import results_of, run_over

def work():
    total = sum(run_over(range(100), float))
    return total + sum(result for _, result in results_of(range(100), float))

def longer():
    slow = lambda k: time.sleep(0.01) or k
    total = sum(run_over(range(60), slow))
    threading.main_thread().join()
    print("a thread", total + sum(result for _, result in results_of(range(60), slow)), work())

def failing(task):
    raise KeyError(task)

def at_exit():
    print("at exit", work())
    for run in (run_over, lambda *call: list(results_of(*call))):
        try:
            run(range(2), failing)
        except KeyError as error:
            print("fails", error)

set_threads(3)
print("before", work())
atexit.register(at_exit)
threading.Thread(target=longer).start()
time.sleep(0.05)
"""


def test_at_the_end_of_a_program_one_thread_works() -> None:
    """In functions of `atexit`, and in threads that outlive the main one, whose calls are under way when that ends."""
    done = subprocess.run([sys.executable, "-c", ENDING], capture_output=True, text=True, timeout=60)
    assert done.stderr == ""
    every = ["before 9900.0", "a thread 3540 9900.0", "at exit 9900.0", "fails 0", "fails 0"]
    assert done.stdout.splitlines() == every
